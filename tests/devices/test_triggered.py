"""Sequences by one device's clock, which triggers the other: every image is its pattern's, or all are taken again."""

import json
from pathlib import Path

import numpy as np
import pytest

from core.capture.live import Continuous
from core.capture.run import TRIES
from core.capture.triggered import matched
from core.devices import TRIGGER_FAULTS, Image, open_devices
from core.errors import DeviceError
from tests.devices.campaign import CABLED, TRIGGERED, make_project, outcome, triggered

PERIOD_MS = 8  # 125 patterns a second


@pytest.mark.parametrize("setup", TRIGGERED)
def test_a_sequence_runs_at_125_patterns_a_second(tmp_path: Path, setup: str) -> None:
    project = make_project(tmp_path)
    assert outcome(project, "a", *TRIGGERED[setup]) == "right"
    entries = [json.loads(line) for line in (tmp_path / "captures/a/transcript.jsonl").read_text().splitlines()]
    assert not [e for e in entries if e["event"] in ("failed", "rejected")]
    exposed = np.diff([e["exposed"] for e in entries if e["event"] == "shot"])
    np.testing.assert_allclose(exposed, PERIOD_MS / 1000, atol=1e-5)


@pytest.mark.parametrize("fault", TRIGGER_FAULTS)
@pytest.mark.parametrize("at", [0, 7, 14])
@pytest.mark.parametrize("setup", [setup for setup in TRIGGERED if "virtual" in setup])
def test_a_wrong_trigger_is_told_and_the_sequence_taken_again(tmp_path: Path, fault: str, at: int, setup: str) -> None:
    project = make_project(tmp_path)
    projector, camera = TRIGGERED[setup]
    assert outcome(project, "a", projector, f"{camera}faults={fault}@{at}") == "right"
    told = (tmp_path / "captures/a/transcript.jsonl").read_text()
    # a pattern later than all others of the sequence leaves no gap before the first: what it shows tells
    assert '"failed"' in told or '"rejected"' in told


@pytest.mark.parametrize("setup", [*TRIGGERED, *CABLED])
def test_many_wrong_triggers_never_mislabel_a_frame(tmp_path: Path, setup: str) -> None:
    count, seed = (6, 2) if setup in CABLED else (12, 3)
    counts = triggered(make_project(tmp_path), setup, count, seed)
    assert counts["mislabelled"] == 0
    assert counts["right"] > count / 2
    assert counts["wrong triggers"] > 1


def image(time_s: float, number: int | None = None) -> Image:
    return Image(np.zeros((2, 2), np.uint8), 8, time_s, number)


@pytest.mark.parametrize(
    ("times", "seen"),
    [
        ([0.0, 1.0, 2.0, 3.0], None),
        ([5.0, 6.1, 6.9, 8.0], None),
        ([0.0, 1.0, 3.0], "lost"),
        ([0.0, 1.0, 2.0], "3 images for 4"),
        ([0.0, 1.0, 1.1, 2.0, 3.0], "doubled"),
        ([0.0, 1.0, 2.4, 3.0], "late"),
        ([0.0, 1.2, 2.4, 3.6], "periods off"),
    ],
)
def test_images_are_matched_to_triggers_by_their_times(times: list[float], seen: str | None) -> None:
    images = [image(t) for t in times]
    if seen is None:
        assert matched(images, 4, 1.0, "camera") == images
        return
    with pytest.raises(DeviceError, match=seen):
        matched(images, 4, 1.0, "camera")


def test_what_a_projector_of_bytes_is_asked(tmp_path: Path) -> None:
    """Loaded once, then one question a sequence: nothing is said between the patterns."""
    with open_devices(*TRIGGERED["camera, emulated"]) as (projector, camera):
        rig = Continuous(make_project(tmp_path), projector, {"camera": camera})
        rig.take()
        asked = projector.dialogue.asked
        rig.take()
        assert projector.dialogue.asked == asked + 1
        assert projector.dialogue.sent.split()[1:] == [b"FOLLOW", b"%d" % len(rig.plan.shots)]


def test_a_gap_in_the_frame_numbers_is_told() -> None:
    with pytest.raises(DeviceError, match="frame numbers 7 to 11 with gaps"):
        matched([image(float(k), n) for k, n in enumerate((7, 8, 10, 11))], 4, 1.0, "camera")


def test_where_triggers_are_always_lost_patterns_are_shown_step_by_step(tmp_path: Path) -> None:
    camera = "virtual:flat?faults=lost-trigger:0.5"
    assert outcome(make_project(tmp_path), "a", f"virtual:flat?period_ms={PERIOD_MS}", camera) == "right"
    told = [json.loads(line) for line in (tmp_path / "captures/a/transcript.jsonl").read_text().splitlines()]
    assert [entry["event"] for entry in told if entry["event"] != "shot"] == ["began", *["failed"] * TRIES, "verified"]
