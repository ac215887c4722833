"""The stages' states follow from the files alone."""

from __future__ import annotations

import json
import os
import shutil
import time
from pathlib import Path

import pytest

from core.errors import InputError
from core.pipeline.state.failures import clear_failure, read_failures
from core.project import read_image, write_image
from stripe_gui.presenters.failures import describe, keep_failure
from stripe_gui.presenters.folder import ProjectFolder
from stripe_gui.presenters.stages import STAGES, State
from stripe_gui.presenters.status import stage_statuses
from tests.copies import own


def states(folder: Path) -> dict[str, State]:
    return {stage: s.state for stage, s in stage_statuses(ProjectFolder(folder)).items()}


def touch(path: Path) -> None:
    """Make a file newer than everything else, its content the same."""
    later = time.time_ns() + 5_000_000_000
    os.utime(own(path), ns=(later, later))


def pick_again(folder: Path) -> None:
    """Move a pick by half a pixel."""
    path = folder / "captures" / "testfield-01" / "picks.json"
    data = json.loads(path.read_text())
    data["seeds"][0]["u"] += 0.5
    path.write_text(json.dumps(data))


def record_again(folder: Path, capture: str) -> None:
    """Change a grey value in the first frame of a capture."""
    path = folder / "captures" / capture / "000.png"
    image = read_image(path).copy()
    image[0, 0] ^= 1
    write_image(path, image)


def test_a_recorded_project_is_captured_and_the_rest_is_to_do(recorded: Path) -> None:
    found = states(recorded)
    assert found.pop("capture") is State.DONE
    assert set(found.values()) == {State.TODO}


def test_a_finished_project_is_done(finished: Path) -> None:
    assert set(states(finished).values()) == {State.DONE}


def test_new_picks_make_everything_from_measuring_on_stale(finished_project: Path) -> None:
    pick_again(finished_project)
    found = states(finished_project)
    assert found["capture"] is State.DONE
    assert found["calibrate"] is State.STALE
    assert found["evaluate"] is State.STALE
    assert found["report"] is State.STALE


def test_a_new_plane_capture_makes_the_evaluation_stale_but_not_the_calibration(finished_project: Path) -> None:
    record_again(finished_project, "plane+15")
    found = states(finished_project)
    assert found["calibrate"] is State.DONE
    assert found["evaluate"] is State.STALE
    assert found["report"] is State.STALE


def test_captures_stay_decoded_when_picks_or_the_calibration_change(finished_project: Path) -> None:
    pick_again(finished_project)
    assert states(finished_project)["evaluate"] is State.STALE
    assert states(finished_project)["decode"] is State.DONE


def test_a_capture_recorded_again_was_decoded_before(finished_project: Path) -> None:
    record_again(finished_project, "testfield-01")
    assert states(finished_project)["decode"] is State.STALE


def test_files_written_again_as_they_were_change_nothing(finished_project: Path) -> None:
    for name in ("project.json", "captures/testfield-01/picks.json", "captures/plane+15/000.png"):
        touch(finished_project / name)
    assert set(states(finished_project).values()) == {State.DONE}


def test_another_camera_in_the_project_file_makes_the_calibration_stale(finished_project: Path) -> None:
    path = finished_project / "project.json"
    data = json.loads(path.read_text())
    data["camera"]["nominal_c_mm"] *= 1.1
    path.write_text(json.dumps(data))
    touch(path)
    assert states(finished_project)["calibrate"] is State.STALE


def test_missing_picks_are_counted(project: Path) -> None:
    (project / "captures" / "testfield-02" / "picks.json").unlink()
    status = stage_statuses(ProjectFolder(project))["measure"]
    assert status.state is State.TODO
    assert "1 of 13 captures: not measured yet, nor picked (testfield-02)" in status.reason


def test_a_damaged_capture_fails_with_its_reason_and_leaves_the_others_readable(project: Path) -> None:
    (project / "captures" / "plane+00" / "capture.json").write_text("{")
    folder = ProjectFolder(project)
    status = stage_statuses(folder)["capture"]
    assert status.state is State.FAILED
    assert "plane+00" in status.reason
    assert len([e for e in folder.captures() if e.capture]) == len(folder.captures()) - 1


def test_a_frame_that_goes_while_the_project_is_open_is_told_until_it_is_back(project: Path) -> None:
    folder = ProjectFolder(project)
    frame = folder.entry("plane+00").capture.frames[3].path
    frame.rename(frame.with_suffix(".away"))
    status = stage_statuses(folder)["capture"]
    assert status.state is State.FAILED
    assert frame.name in status.reason
    frame.with_suffix(".away").rename(frame)
    assert stage_statuses(folder)["capture"].state is State.DONE


def test_a_failure_is_kept_until_the_stage_succeeds(project: Path) -> None:
    keep_failure(project, "calibrate", describe(InputError("testfield-03", "two picks on one target", "pick again")))
    status = stage_statuses(ProjectFolder(project))["calibrate"]
    assert status.state is State.FAILED
    assert read_failures(project)["calibrate"].remedy == "pick again"
    clear_failure(project, "calibrate")
    assert states(project)["calibrate"] is State.TODO


def test_a_failure_no_longer_counts_once_its_captures_changed(project: Path) -> None:
    keep_failure(project, "calibrate", describe(InputError("testfield-03", "two picks on one target", "pick again")))
    pick_again(project)
    assert states(project)["calibrate"] is State.TODO


@pytest.mark.parametrize("content", ["", "{", "[]", '{"calibrate": 3}'])
def test_a_damaged_list_of_failures_counts_as_none(project: Path, content: str) -> None:
    (project / "results").mkdir(exist_ok=True)
    (project / "results" / "failures.json").write_text(content)
    assert read_failures(project) == {}
    assert set(states(project)) == set(STAGES)


def test_results_are_read_once_per_version(finished_project: Path) -> None:
    folder = ProjectFolder(finished_project)
    first = folder.result("evaluation.npz", tuple)
    assert folder.result("evaluation.npz", tuple) is first
    shutil.copy(finished_project / "results" / "evaluation.npz", finished_project / "copy.npz")
    touch(finished_project / "copy.npz")
    (finished_project / "copy.npz").replace(finished_project / "results" / "evaluation.npz")
    assert folder.result("evaluation.npz", tuple) is not first
