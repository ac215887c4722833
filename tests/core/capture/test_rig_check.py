"""The checks of a rig that two URLs name, its page, and the command."""

import json
import re
import sys
from pathlib import Path

import pytest

from core.capture.rigcheck import check_rig
from core.cli import main
from core.devices import offer_screens, screen
from core.devices.opening import at_depth
from core.errors import Cancelled, DeviceError, InputError
from core.model import Project
from core.progress import Progress

FLAT = "virtual:flat"
CHECKS = ["exposure", "settle", "linearity", "focus", "order", "orientation"]


def test_every_check_comes_with_a_picture_or_a_curve(project: Project) -> None:
    findings = check_rig(project, (FLAT, FLAT))
    assert [f.check for f in findings] == CHECKS
    assert all(f.curve or f.picture is not None for f in findings)


def test_the_plate_is_put_at_every_depth_and_the_stripes_are_judged(project: Project) -> None:
    asked: list[float] = []
    *_, depth = check_rig(project, (FLAT, FLAT), (-20.0, 0.0, 20.0), asked.append)
    assert asked == [-20.0, 0.0, 20.0]
    assert depth.check == "visibility"
    assert [z for z, _ in depth.curve] == asked
    # half the lamp's 150 grey values through the last bit's blur, over dots and board of albedo 0.3 to 0.9
    assert all(20 < swing < 75 for _, swing in depth.curve)
    assert depth.level == "good"


def test_the_virtual_bench_puts_its_own_plate() -> None:
    assert at_depth("virtual:quick?seed=1", -25.0) == "virtual:quick?seed=1&shot=depth-02"
    assert at_depth("virtual:quick", 7.0) == "virtual:quick"
    assert at_depth("serial:/dev/ttyUSB0", -25.0) == "serial:/dev/ttyUSB0"


def test_a_rig_of_other_sizes_is_refused(project: Project) -> None:
    with pytest.raises(InputError, match="projector is 64x64"):
        check_rig(project, ("virtual:quick", FLAT))


def test_a_silent_camera_is_told(project: Project) -> None:
    with pytest.raises(DeviceError, match="no image"):
        check_rig(project, (FLAT, f"{FLAT}?faults=no-frame:1"))


def test_checking_can_be_cancelled(project: Project) -> None:
    calls: list[int] = []

    def cancelled() -> bool:
        calls.append(1)
        return len(calls) > 5

    with pytest.raises(Cancelled):
        check_rig(project, (FLAT, FLAT), progress=Progress(cancelled=cancelled))
    assert len(calls) == 6


def test_the_command_writes_figures_and_a_page_with_a_drawing_of_each(project: Project, tmp_path: Path, capsys) -> None:
    out, figures = tmp_path / "checks", tmp_path / "checks.json"
    command = ["preflight", str(project.path), "--projector", FLAT, "--camera", FLAT]
    assert main([*command, "--out", str(out), "--json", str(figures)]) == 0
    told = json.loads(figures.read_text())["findings"]
    assert [f["check"] for f in told] == CHECKS
    printed = capsys.readouterr().out
    page = (out / "preflight.html").read_text()
    assert page.count("<svg") == len(CHECKS)
    assert not re.search(r'(src|href)="(?!#|data:)', page)  # nothing from elsewhere
    for finding in told:
        assert finding["text"] in printed


def test_the_command_refuses_a_device_that_is_none(project: Project, tmp_path: Path, capsys) -> None:
    assert main(["preflight", str(project.path), "--projector", "laser:1", "--camera", FLAT]) == 2
    assert "laser" in capsys.readouterr().err


def test_a_screen_without_a_window_is_told_where_to_find_one(
    project: Project, capsys, monkeypatch: pytest.MonkeyPatch
) -> None:
    offer_screens(None)  # as without the desktop program
    missing = [sys.executable, "-c", "import no_such_window"]
    monkeypatch.setattr(screen, "_window_program", lambda: missing)
    command = ["capture", str(project.path), "a", "--role", "object", "--projector", "screen:1", "--camera", FLAT]
    assert main(command) == 1
    error = capsys.readouterr().err
    assert "pip install 'stripe-workbench[gui]'" in error
    assert len(error.splitlines()) == 1
