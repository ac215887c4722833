"""Picks on disk: exclusions, drafts of unfinished picks, and what a crash between two files leaves."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path

import pytest

from core.errors import InputError, StripeError
from core.model import Seed
from core.project import keep_picks, kept_picks, read_capture, read_picks, write_picks
from tests.core.pipeline.disturbing import disturb, disturbed

FOUR = tuple(Seed(r, c, 10.5 * c, 20.25 * r) for r, c in ((0, 0), (0, 8), (6, 8), (6, 0)))


def test_exclusions_come_back_and_files_without_them_are_read(tmp_path: Path) -> None:
    write_picks(tmp_path / "picks.json", FOUR, [(3, 7), (0, 1), (3, 7)])
    assert read_picks(tmp_path / "picks.json") == (FOUR, ((3, 7), (0, 1)))
    write_picks(tmp_path / "picks.json", FOUR)
    assert "excluded" not in json.loads((tmp_path / "picks.json").read_text())
    assert read_picks(tmp_path / "picks.json") == (FOUR, ())


@pytest.mark.parametrize("wrong", [[[1]], [[1, 2, 3]], ["1,2"], [[1.5, 2]], [["a", 2]], {"row": 1}, 7])
def test_a_wrong_exclusion_is_told(tmp_path: Path, wrong: object) -> None:
    write_picks(tmp_path / "picks.json", FOUR)
    data = json.loads((tmp_path / "picks.json").read_text())
    (tmp_path / "picks.json").write_text(json.dumps({**data, "excluded": wrong}))
    with pytest.raises(InputError, match=r"picks\.json.*excluded") as caught:
        read_picks(tmp_path / "picks.json")
    assert caught.value.remedy


def test_fewer_than_four_picks_are_a_draft_that_no_command_reads(tmp_path: Path) -> None:
    for count in (1, 2, 3, 4, 3, 4, 0):
        keep_picks(tmp_path, FOUR[:count], [(1, 1)] if count else [])
        assert kept_picks(tmp_path) == (FOUR[:count], ((1, 1),) if count else ())
        assert (tmp_path / "picks.json").exists() == (count == 4)
        assert (tmp_path / "picks-draft.json").exists() == (0 < count < 4)


def test_of_two_files_that_a_crash_left_the_later_one_counts(tmp_path: Path) -> None:
    write_picks(tmp_path / "picks.json", FOUR)
    write_picks(tmp_path / "picks-draft.json", FOUR[:3])
    for name, count in (("picks.json", 4), ("picks-draft.json", 3)):
        later = max(p.stat().st_mtime_ns for p in tmp_path.iterdir()) + 1_000_000
        os.utime(tmp_path / name, ns=(later, later))
        assert len(kept_picks(tmp_path)[0]) == count


@pytest.mark.parametrize("fault", ["kill", "ENOSPC"])
@pytest.mark.parametrize(("before", "after"), [(3, 4), (4, 3), (4, 2), (2, 0), (0, 4)])
def test_picks_disturbed_at_any_call_are_the_old_or_the_new(
    fault: str, before: int, after: int, tmp_path: Path
) -> None:
    """As the window keeps them after every change; a repeat always keeps the new ones."""
    number, reached = 0, True
    while reached:
        number += 1
        folder = tmp_path / str(number)
        folder.mkdir()
        keep_picks(folder, FOUR[:before])
        if (pid := os.fork()) == 0:
            with disturbed(folder, number, lambda: disturb(fault)) as calls, contextlib.suppress(OSError, StripeError):
                keep_picks(folder, FOUR[:after])
            os._exit(int(len(calls) >= number))
        ended = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        reached = ended != 0
        assert kept_picks(folder)[0] in (FOUR[:before], FOUR[:after]), number
        if not reached:
            assert kept_picks(folder)[0] == FOUR[:after]
        keep_picks(folder, FOUR[:after])
        assert kept_picks(folder)[0] == FOUR[:after], number
    assert number > 1


def test_picks_behind_a_broken_link_and_too_many_frames_are_refused(tmp_path: Path) -> None:
    """The picks were passed over without a word; 120,000 frames took all memory."""
    frame = {"file": "0.png", "pattern": {"kind": "white"}}
    document = {"format": "stripe-capture", "version": 1, "role": "object", "frames": [frame]}
    (tmp_path / "0.png").touch()
    (tmp_path / "capture.json").write_text(json.dumps(document))
    assert read_capture(tmp_path).seeds == ()
    (tmp_path / "picks.json").symlink_to("nowhere.json")
    with pytest.raises(InputError, match=r"picks\.json: cannot be read"):
        read_capture(tmp_path)
    (tmp_path / "capture.json").write_text(json.dumps({**document, "frames": [frame] * 10_001}))
    with pytest.raises(InputError, match=r"capture\.json: frames lists 10001; give a capture at most 10000 frames"):
        read_capture(tmp_path)
