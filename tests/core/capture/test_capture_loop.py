"""The loop on virtual devices: right frames, wrong frames taken again, interruptions."""

import json
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.capture import capture_status, make_plan, run_capture
from core.devices import open_camera
from core.devices.scene import FlatScene
from core.errors import BusyError, Cancelled, DeviceError, InputError
from core.model import Project, Subject
from core.patterns import Black, Level, Phase, SequenceSpec, White, gray_and_phase, parse_sequence, reference_sequence
from core.progress import Progress
from core.project import read_capture, read_image, read_project

A = Subject("object", "a")
FLAT = "virtual:flat"


def truly_shows(folder: Path) -> bool:
    """Whether every listed frame is, up to noise, the image of its pattern."""
    scene = FlatScene(noise=0.0)
    return all(
        np.abs(read_image(f.path).astype(float) - scene.frame(f.pattern, 0)).mean() < 1.5
        for f in read_capture(folder).frames
    )


def test_a_project_without_a_sequence_takes_what_the_projector_can_show(project: Project) -> None:
    """The flat scene's projector shows grey: sine fringes, by which the LCD could not measure."""
    report = run_capture(replace(project, sequence=None), A, FLAT, FLAT)
    capture = read_capture(report.folder)
    assert [f.pattern for f in capture.frames] == list(parse_sequence("gray-sine").patterns((64, 64)))
    assert truly_shows(report.folder)


def test_a_capture_of_any_sequence_is_verified(project: Project) -> None:
    """A list with levels and lines of its own; what comes out is version 2."""
    patterns = [*parse_sequence("dense:frames=24").patterns((64, 64)), White(), Black(), Level(0.5)]
    report = run_capture(project, A, FLAT, FLAT, patterns=patterns)
    assert [f.pattern for f in read_capture(report.folder).frames] == patterns
    assert truly_shows(report.folder)
    assert json.loads((report.folder / "capture.json").read_text())["version"] == 2


def test_a_capture_holds_the_projects_sequence_in_order(project: Project) -> None:
    report = run_capture(project, A, FLAT, FLAT)
    capture = read_capture(report.folder)
    assert [f.pattern for f in capture.frames] == reference_sequence(64, 64)
    assert truly_shows(report.folder)
    assert report.retakes == 0
    assert all(f.level == "good" for f in report.findings)
    assert read_project(project.path).captures == (report.folder,)
    assert capture_status(report.folder).state == "complete"


@pytest.mark.parametrize(
    ("fault", "shot"),
    [
        (fault, shot)
        for k, fault in enumerate(["stale-frame", "torn-frame", "no-frame"])
        for shot in range(4 * k, 24, 8)
    ],
)
def test_a_camera_fault_at_any_frame_is_mended(project: Project, fault: str, shot: int) -> None:
    report = run_capture(project, A, FLAT, f"{FLAT}?faults={fault}@{shot}")
    assert truly_shows(report.folder)


@pytest.mark.parametrize("shot", [5, 7, 14])
def test_a_step_that_was_exposed_partly_over_the_pattern_before_is_taken_again(project: Project, shot: int) -> None:
    """It held 30 % of that one's light, and passed."""
    project = replace(project, sequence=SequenceSpec("gray-sine"))
    report = run_capture(project, A, FLAT, f"{FLAT}?faults=mixed-frame@{shot}")
    assert report.retakes > 0
    assert truly_shows(report.folder)


def test_a_camera_that_always_lies_gives_an_error_and_no_frame_is_listed(project: Project) -> None:
    with pytest.raises(DeviceError, match="further tries"):
        run_capture(project, A, FLAT, f"{FLAT}?faults=stale-frame:1")
    assert json.loads((project.path / "captures/a/capture.json").read_text())["frames"] == []
    assert read_project(project.path).captures == ()


def test_an_interrupted_capture_says_what_is_missing_and_goes_on_there(project: Project) -> None:
    calls = []

    def cancelled() -> bool:
        calls.append(1)
        return len(calls) > 24 + 12  # once a pattern while loading, then before every image

    with pytest.raises(Cancelled):
        run_capture(project, A, FLAT, FLAT, progress=Progress(cancelled=cancelled))
    status = capture_status(project.path / "captures/a")
    assert 0 < status.taken < 20
    assert status.missing == tuple(range(status.taken, 20))
    assert f"{status.taken} of 20" in str(status)
    with pytest.raises(InputError, match=f"{status.taken} of 20 frames taken; missing: {status.taken}"):
        read_capture(project.path / "captures/a")
    report = run_capture(project, A, FLAT, FLAT)
    assert report.resumed == status.taken + 2  # and the two guards before
    assert truly_shows(report.folder)


def test_an_interrupted_capture_of_a_scene_that_was_moved_is_taken_anew(project: Project) -> None:
    """The guard frame of before was kept, and every further call said that the scene had moved."""
    project = replace(project, sequence=SequenceSpec("gray-sine"))
    asked = iter(range(24 + 8))  # once a pattern while loading, then before every image
    with pytest.raises(Cancelled):
        run_capture(project, A, FLAT, FLAT, progress=Progress(cancelled=lambda: next(asked, None) is None))
    assert capture_status(project.path / "captures/a").taken > 3
    camera = open_camera(FLAT)  # keeps the stage alive
    still, camera.stage.scene = camera.stage.scene, FlatScene(shift_px=16.0)
    try:
        report = run_capture(project, A, FLAT, FLAT)
    finally:
        camera.stage.scene = still
    assert not any(f.check == "movement" and f.level != "good" for f in report.findings)
    moved = FlatScene(noise=0.0, shift_px=16.0)
    for frame in read_capture(report.folder).frames:
        assert np.abs(read_image(frame.path).astype(float) - moved.frame(frame.pattern, 0)).mean() < 1.5


def test_an_interrupted_capture_is_not_continued_with_another_plan(project: Project) -> None:
    with pytest.raises(DeviceError):
        run_capture(project, A, FLAT, f"{FLAT}?faults=no-frame:1")
    with pytest.raises(InputError, match="another plan"):
        run_capture(project, Subject("plane", "a"), FLAT, FLAT)


def test_a_second_program_does_not_record_into_the_same_capture(project: Project) -> None:
    """It took the capture for an interrupted one: frames of two rigs were mixed, and both said that all was well."""
    refused: list[str] = []

    def second() -> None:
        with pytest.raises(BusyError) as told:
            run_capture(project, A, FLAT, FLAT)
        refused.append(str(told.value))

    def listen(entry: dict) -> None:
        if not refused:
            thread = threading.Thread(target=second)
            thread.start()
            thread.join()

    report = run_capture(project, A, FLAT, FLAT, listen=listen)
    assert refused
    assert f"{report.folder}: is being written by" in refused[0]
    assert truly_shows(report.folder)
    assert not (report.folder / ".lock").exists()


def test_a_complete_capture_is_never_overwritten(project: Project) -> None:
    run_capture(project, A, FLAT, FLAT)
    with pytest.raises(InputError, match="complete"):
        run_capture(project, A, FLAT, FLAT)


def test_a_replayed_capture_is_the_capture(project: Project) -> None:
    first = run_capture(project, A, FLAT, FLAT)
    url = f"replay:{first.folder}"
    second = run_capture(project, Subject("object", "b"), url, url)
    for a, b in zip(read_capture(first.folder).frames, read_capture(second.folder).frames, strict=True):
        assert a.pattern == b.pattern
        assert np.array_equal(read_image(a.path), read_image(b.path))


def test_grey_patterns_and_a_sequence_of_ones_own_can_be_captured(project: Project) -> None:
    patterns = [*gray_and_phase("x", 64, cell=8, periods=[16.0, 64.0]), White()]
    report = run_capture(project, A, FLAT, FLAT, patterns=patterns)
    assert truly_shows(report.folder)
    assert any(isinstance(f.pattern, Phase) for f in read_capture(report.folder).frames)


def test_a_sequence_that_repeats_nothing_is_captured_with_a_warning(project: Project) -> None:
    patterns = gray_and_phase("x", 64, cell=1, periods=[])
    report = run_capture(project, A, FLAT, FLAT, patterns=patterns)
    assert any(f.level == "warning" and "inverse frames" in f.text for f in report.findings)


def test_movement_makes_the_capture_again_and_is_reported_when_it_goes_on(project: Project) -> None:
    camera = open_camera(FLAT)  # keeps the stage alive
    still = camera.stage.scene
    step = {"n": 0}

    class Drifting(FlatScene):
        def frame(self, pattern, seed):
            step["n"] += 1
            return FlatScene(shift_px=0.012 * step["n"]).frame(pattern, seed)

    camera.stage.scene = Drifting()
    try:
        report = run_capture(project, A, FLAT, FLAT)
    finally:
        camera.stage.scene = still
    assert any(f.check == "movement" and f.level == "warning" and "moved" in f.text for f in report.findings)


def test_the_transcript_tells_every_shot_with_its_time(project: Project) -> None:
    report = run_capture(project, A, FLAT, f"{FLAT}?faults=torn-frame@9")
    lines = [json.loads(line) for line in (report.folder / "transcript.jsonl").read_text().splitlines()]
    shots = [e for e in lines if e["event"] == "shot"]
    times = [e["exposed"] for e in shots]
    assert len(shots) == 24 + report.retakes
    assert times == sorted(times)
    assert any(e["event"] == "rejected" for e in lines)


def test_waiting_for_a_camera_that_is_silent_can_be_cancelled_within_half_a_second(
    project: Project, tmp_path: Path
) -> None:
    (tmp_path / "images").mkdir()
    asked: list[float] = []

    def cancelled() -> bool:
        asked.append(time.monotonic())
        return len(asked) > 1 and asked[-1] - asked[0] > 0.3

    with pytest.raises(Cancelled):
        run_capture(project, A, FLAT, f"folder:{tmp_path}/images", progress=Progress(cancelled=cancelled))
    assert max(np.diff(asked)) < 0.5


@pytest.mark.parametrize(
    ("change", "seen"),
    [
        ({"name": "../a"}, "name"),
        ({"name": ""}, "name"),
        ({"role": "dance"}, "dance"),
        ({"role": "depth"}, "without z"),
        ({"z_mm": float("nan")}, "z_mm"),
        ({"testfield": "none.csv"}, "no such testfield"),
        ({"projector_url": "virtual:quick"}, "projector is 64x64"),
        ({"camera_url": "virtual:quick"}, "camera is 96x72"),
        ({"patterns": []}, "no patterns"),
    ],
)
def test_a_wrong_request_writes_nothing(project: Project, change: dict, seen: str) -> None:
    of = {"name": "a", "role": "object"}
    wanted = {"projector_url": FLAT, "camera_url": FLAT, **change}
    of |= {key: wanted.pop(key) for key in change if key in ("name", "role", "z_mm", "testfield")}
    with pytest.raises(InputError, match=seen):
        run_capture(project, Subject(**of), **wanted)
    assert not (project.path / "captures").exists()


def test_a_testfield_may_be_named_from_the_working_folder(project: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    (project.path / "board.csv").write_text("of no matter")
    (project.path.parent / "outside.csv").write_text("of no matter")
    monkeypatch.chdir(project.path.parent)
    for named in ("board.csv", f"{project.path.name}/board.csv", str(project.path / "board.csv")):
        plan = make_plan(project, Subject(name="a", role="testfield", testfield=named))
        assert plan.subject.testfield == "board.csv"
    with pytest.raises(InputError, match="copy it into the project's folder"):
        make_plan(project, Subject(name="a", role="testfield", testfield="outside.csv"))
