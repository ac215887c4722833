"""Starting the program: with and without a display, and the tour."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from stripe_gui.__main__ import display_problem
from stripe_gui.pages import PAGES

NO_DISPLAY = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")


def run(*arguments: str, **environment: str) -> subprocess.CompletedProcess:
    kept = {k: v for k, v in os.environ.items() if k not in NO_DISPLAY}
    command = [sys.executable, "-W", "error", "-m", "stripe_gui", *arguments]
    return subprocess.run(command, env={**kept, **environment}, capture_output=True, text=True, timeout=120)


def test_without_a_display_the_program_points_to_the_command() -> None:
    done = run()
    assert done.returncode == 2
    assert "stripe-core" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("display", [":4711", "nowhere.invalid:0", "nonsense"])
def test_a_display_that_does_not_answer_is_told(display: str) -> None:
    assert "does not answer" in display_problem({"DISPLAY": display}, "linux")


def test_other_systems_and_a_chosen_platform_are_not_looked_at() -> None:
    assert display_problem({}, "win32") == ""
    assert display_problem({"QT_QPA_PLATFORM": "offscreen"}, "linux") == ""


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="no Xvfb here: sudo apt-get install xvfb libxcb-cursor0 ...")
def test_in_a_real_window_the_project_opens_and_is_drawn(recorded: Path, tmp_path: Path) -> None:
    reading, writing = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writing), "-screen", "0", "1400x900x24", "-nolisten", "tcp"],
        pass_fds=[writing],
        stderr=subprocess.DEVNULL,
    )
    try:
        os.close(writing)
        with os.fdopen(reading) as pipe:
            display = f":{pipe.readline().strip()}"
        assert display_problem({"DISPLAY": display}, "linux") == ""
        picture = tmp_path / "window.png"
        done = subprocess.run(
            [sys.executable, "-W", "error", "-c", REAL_WINDOW, str(recorded), str(picture), str(tmp_path / "s.ini")],
            env={**{k: v for k, v in os.environ.items() if k not in NO_DISPLAY}, "DISPLAY": display},
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert done.returncode == 0, done.stderr
        assert done.stdout.split() == ["xcb", "capture"]
        image = cv2.imread(str(picture))
        assert len(np.unique(image.reshape(-1, 3), axis=0)) > 50  # the screen itself shows it, not only Qt's buffer
    finally:
        server.terminate()
        server.wait()


REAL_WINDOW = """
import sys
from pathlib import Path
from stripe_gui.app import Program, make_application
from stripe_gui.settings import Settings
from stripe_gui.tour import wait_until
from stripe_gui.workbench import Workbench

app = make_application()
bench = Workbench(Settings(Path(sys.argv[3])))
program = Program(app, bench)
program.window.show()
wait_until(program.window.isVisible)
program.window.open_path(Path(sys.argv[1]))
wait_until(lambda: not bench.views.busy)
app.primaryScreen().grabWindow(0).save(sys.argv[2])
print(app.platformName(), program.window.page.id)
program.window.close()
"""


def test_the_tour_pictures_every_page_light_and_dark_at_both_scales(finished_project: Path, tmp_path: Path) -> None:
    done = run("--tour", str(tmp_path / "tour"), str(finished_project))
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    pictures = sorted((tmp_path / "tour").glob("*.png"))
    for page in PAGES:
        for theme in ("light", "dark"):
            for scale in (1, 2):
                found = [p for p in pictures if p.name.startswith(page) and p.name.endswith(f"{theme}-{scale}x.png")]
                assert found, (page, theme, scale)
                assert cv2.imread(str(found[0])).shape == (860 * scale, 1360 * scale, 3)


def test_the_tour_of_what_is_no_project_fails(tmp_path: Path) -> None:
    done = run("--tour", str(tmp_path / "tour"), str(tmp_path))
    assert done.returncode == 1
    assert "project.json" in done.stderr
