"""Power cuts, kill -9 and full disks: a capture opens afterwards, says what is missing, and goes on."""

import errno
import json
import os
import shutil
import signal
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from core.capture import capture_status, run_capture
from core.devices.scene import FlatScene
from core.errors import StripeError
from core.model import Project, Subject
from core.patterns import Phase, White
from core.project import read_capture, read_image, read_project

A = Subject("object", "a")
FLAT = "virtual:flat"
PATTERNS = [*(Phase("x", 80.0, 3, k, 2 * np.pi * k / 3) for k in range(3)), White()]

pytestmark = [
    pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork"),
    pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning"),
]


def capture(project: Project) -> None:
    run_capture(project, A, FLAT, FLAT, patterns=PATTERNS)


def count_writes(monkeypatch: pytest.MonkeyPatch, at_write: Callable[[int], None]) -> None:
    """Call at_write(number) before and after everything that changes the disk."""
    number = [0]

    def around(function: Callable[..., object]) -> Callable[..., object]:
        def call(*args: object, **more: object) -> object:
            at_write(number[0])
            result = function(*args, **more)
            at_write(number[0] + 1)
            number[0] += 2
            return result

        return call

    monkeypatch.setattr(os, "fsync", around(os.fsync))
    monkeypatch.setattr(tempfile, "mkstemp", around(tempfile.mkstemp))
    monkeypatch.setattr(Path, "replace", around(Path.replace))
    monkeypatch.setattr(Path, "unlink", around(Path.unlink))
    monkeypatch.setattr(Path, "mkdir", around(Path.mkdir))


def run_and_kill(
    project: Project, monkeypatch: pytest.MonkeyPatch, number: int, capture: Callable[[Project], None] = capture
) -> bool:
    """Capture in a process that is killed at a write; whether it was."""

    def at_write(n: int) -> None:
        if n == number:
            os.kill(os.getpid(), signal.SIGKILL)

    child = os.fork()
    if child == 0:
        try:
            with monkeypatch.context() as patch:
                count_writes(patch, at_write)
                capture(project)
        finally:
            os._exit(0)
    _, status = os.waitpid(child, 0)
    return os.WIFSIGNALED(status)


def check_what_is_left(project: Project) -> None:
    """It opens, and no frame is listed unless all are."""
    folder = project.path / "captures/a"
    read_project(project.path)
    if (folder / "capture.json").exists():
        listed = json.loads((folder / "capture.json").read_text())["frames"]
        status = capture_status(folder)
        assert len(listed) == (len(PATTERNS) if status.state == "complete" else 0)
        assert status.taken + len(status.missing) == len(PATTERNS)


def check_complete(project: Project) -> None:
    """All frames are there and right, the project lists the capture, nothing half is left."""
    folder = project.path / "captures/a"
    frames = read_capture(folder).frames
    scene = FlatScene(noise=0.0)
    assert [f.pattern for f in frames] == PATTERNS
    for frame in frames:
        assert np.abs(read_image(frame.path).astype(float) - scene.frame(frame.pattern, 0)).mean() < 1.5
    assert read_project(project.path).captures == (folder,)


def test_killed_at_every_write_it_opens_and_goes_on(project: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    number, killed = 0, True
    while killed:
        shutil.rmtree(project.path / "captures", ignore_errors=True)
        data = json.loads((project.path / "project.json").read_text())
        (project.path / "project.json").write_text(json.dumps({**data, "captures": []}))
        killed = run_and_kill(project, monkeypatch, number)
        check_what_is_left(project)
        if not read_project(project.path).captures:
            capture(project)
        check_complete(project)
        number += 9  # before and after in turn: all operations are met
    assert number > 100


def test_killed_again_and_again_it_comes_to_its_end(project: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    runs = 0
    while run_and_kill(project, monkeypatch, 25):
        check_what_is_left(project)
        runs += 1
        assert runs < 30
    check_complete(project)
    assert runs > 5


def test_a_transcript_torn_anywhere_in_its_last_lines_is_no_obstacle(project: Project) -> None:
    with pytest.raises(StripeError):
        run_capture(project, A, FLAT, f"{FLAT}?faults=no-frame@5,no-frame@6,no-frame@7", patterns=PATTERNS)
    folder = project.path / "captures/a"
    shutil.copytree(folder, project.path / "original")
    whole = (folder / "transcript.jsonl").read_bytes()
    for length in range(len(whole) - 400, len(whole), 23):
        shutil.rmtree(folder)
        shutil.copytree(project.path / "original", folder)
        (folder / "transcript.jsonl").write_bytes(whole[:length])
        check_what_is_left(project)
    capture(project)
    check_complete(project)


def test_a_shot_that_was_damaged_on_disk_is_taken_again(project: Project) -> None:
    with pytest.raises(StripeError):
        run_capture(project, A, FLAT, f"{FLAT}?faults=no-frame@6,no-frame@7,no-frame@8", patterns=PATTERNS)
    folder = project.path / "captures/a"
    assert capture_status(folder).taken == 3
    shot = folder / "shot-0004.tif"
    shot.write_bytes(shot.read_bytes()[:-20])
    assert capture_status(folder).missing == (1, 3)
    capture(project)
    check_complete(project)


@pytest.mark.parametrize("number", range(0, 100, 7))
def test_a_full_disk_is_told_and_once_there_is_room_it_goes_on(
    project: Project, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def at_write(n: int) -> None:
        if n == number:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        count_writes(patch, at_write)
        with pytest.raises(StripeError, match="No space left on device"):
            capture(project)
    check_what_is_left(project)
    capture(project)
    check_complete(project)
