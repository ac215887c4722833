"""One frame of a complete capture taken again: a better one, or everything as it was."""

import json
import zlib

import numpy as np
import pytest

from core.capture import capture_status, retake_frame, run_capture
from core.devices import open_camera
from core.devices.scene import FlatScene
from core.errors import Cancelled, DeviceError, InputError
from core.model import Project, Subject
from core.progress import Progress
from core.project import read_capture, read_image
from tests.captures import write_capture

FLAT = "virtual:flat"


@pytest.fixture
def project(project: Project) -> Project:
    """The same with one capture."""
    run_capture(project, Subject("object", "a"), FLAT, FLAT)
    return project


def content(project: Project) -> dict[str, int]:
    """Checksums of everything in the capture but its transcript."""
    folder = project.path / "captures/a"
    return {p.name: zlib.crc32(p.read_bytes()) for p in folder.iterdir() if p.name != "transcript.jsonl"}


def test_the_new_frame_takes_the_place_of_the_old_one_and_of_no_other(project: Project) -> None:
    before = [f.path.name for f in read_capture(project.path / "captures/a").frames]
    report = retake_frame(project, "a", 7, FLAT, FLAT)
    frames = read_capture(report.folder).frames
    changed = [i for i, f in enumerate(frames) if f.path.name != before[i]]
    assert changed == [7]
    assert not (report.folder / before[7]).exists()
    truth = FlatScene(noise=0.0).frame(frames[7].pattern, 0)
    assert np.abs(read_image(frames[7].path).astype(float) - truth).mean() < 1.5  # noise of 1 gives 0.8
    assert capture_status(report.folder).state == "complete"


def test_a_frame_can_be_retaken_again_and_again(project: Project) -> None:
    for _ in range(3):
        retake_frame(project, "a", 0, FLAT, FLAT)
    assert len(list((project.path / "captures/a").glob("shot-*.tif"))) == 24


@pytest.mark.parametrize(
    ("camera", "seen"), [(f"{FLAT}?faults=no-frame:1", "no image"), (f"{FLAT}?faults=stale-frame:1", "does not fit")]
)
def test_a_frame_that_cannot_be_had_leaves_the_capture_as_it_was(project: Project, camera: str, seen: str) -> None:
    before = content(project)
    with pytest.raises(DeviceError, match=seen):
        retake_frame(project, "a", 3, FLAT, camera)
    assert content(project) == before


def test_a_scene_that_has_moved_since_is_refused(project: Project) -> None:
    before = content(project)
    camera = open_camera(FLAT)  # keeps the stage alive
    still, camera.stage.scene = camera.stage.scene, FlatScene(shift_px=1.0)
    try:
        with pytest.raises(DeviceError, match="moved"):
            retake_frame(project, "a", 3, FLAT, FLAT)
    finally:
        camera.stage.scene = still
    assert content(project) == before


def test_a_cancelled_retake_leaves_the_capture_as_it_was(project: Project) -> None:
    before, calls = content(project), []

    def cancelled() -> bool:
        calls.append(1)
        return len(calls) > 2

    with pytest.raises(Cancelled):
        retake_frame(project, "a", 3, FLAT, FLAT, progress=Progress(cancelled=cancelled))
    assert content(project) == before


def test_a_frame_that_is_not_there_is_refused(project: Project) -> None:
    with pytest.raises(InputError, match="no frame 20"):
        retake_frame(project, "a", 20, FLAT, FLAT)


def test_a_capture_of_another_program_is_not_touched(project: Project) -> None:
    frames = [(f.pattern, read_image(f.path)) for f in read_capture(project.path / "captures/a").frames]
    write_capture(project.path / "captures/b", Subject("object"), frames)
    with pytest.raises(InputError, match="not recorded and verified"):
        retake_frame(project, "b", 3, FLAT, FLAT)


def test_the_listener_hears_every_shot_while_it_is_taken(project: Project) -> None:
    heard: list[dict] = []
    report = run_capture(project, Subject("object", "b"), FLAT, FLAT, listen=heard.append)
    lines = [json.loads(line) for line in (report.folder / "transcript.jsonl").read_text().splitlines()]
    assert heard == lines
    assert [e["planned"] for e in heard if e["event"] == "shot"] == list(range(24))
