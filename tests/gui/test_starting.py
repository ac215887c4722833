"""Starting the program: with and without a display, and the tour."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from PySide6.QtGui import QColor, QImage

from stripe_gui.__main__ import display_problem
from stripe_gui.tour import SCALE, write

NO_DISPLAY = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")

TOUR = (
    "import sys; from stripe_gui import __main__, tour; tour.PAGES = sys.argv[1].split(); "
    "sys.exit(__main__.main(sys.argv[2:]))"
)


def run(
    *arguments: str, program: Sequence[str] = ("-m", "stripe_gui"), **environment: str
) -> subprocess.CompletedProcess:
    kept = {k: v for k, v in os.environ.items() if k not in NO_DISPLAY}
    command = [sys.executable, "-W", "error", *program, *arguments]
    return subprocess.run(command, env={**kept, **environment}, capture_output=True, text=True, timeout=280)


def test_without_a_display_the_program_points_to_the_command() -> None:
    done = run()
    assert done.returncode == 2
    assert "stripe-core" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("display", [":4711", "nowhere.invalid:0", "nonsense"])
def test_a_display_that_does_not_answer_is_told(display: str) -> None:
    assert "does not answer" in display_problem({"DISPLAY": display}, "linux")
    assert "does not answer" in display_problem({"WAYLAND_DISPLAY": "nowhere"}, "linux")


def test_other_systems_and_a_chosen_platform_are_not_looked_at() -> None:
    assert display_problem({}, "win32") == ""
    assert display_problem({"QT_QPA_PLATFORM": "offscreen"}, "linux") == ""


def test_the_tour_pictures_pages_light_and_dark_at_double_scale(finished: Path, tmp_path: Path) -> None:
    """As the tour starts itself for each scale; all pages and parts are walked at single scale (test_geometry)."""
    pages = ("start", "evaluate")
    (temporary := tmp_path / "temporary").mkdir()
    program, environment = ("-c", TOUR, " ".join(pages)), {SCALE: "2", "QT_SCALE_FACTOR": "2", "TMPDIR": str(temporary)}
    done = run("--tour", str(tmp_path / "tour"), str(finished), program=program, **environment)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert not list(temporary.iterdir())
    pictures = sorted((tmp_path / "tour").glob("*.png"))
    for page in pages:
        for theme in ("light", "dark"):
            found = [p for p in pictures if p.name.startswith(page) and p.name.endswith(f"{theme}-2x.png")]
            assert found, (page, theme)
            assert cv2.imread(str(found[0])).shape == (1720, 2720, 3)


def test_a_picture_of_the_tour_keeps_its_colours(tmp_path: Path) -> None:
    picture = QImage(5, 3, QImage.Format.Format_ARGB32_Premultiplied)
    picture.fill(QColor(200, 100, 50))
    write(tmp_path / "a.png", picture)
    assert np.array_equal(cv2.imread(str(tmp_path / "a.png")), np.full((3, 5, 3), (50, 100, 200)))


def test_the_tour_of_what_is_no_project_fails(tmp_path: Path) -> None:
    done = run("--tour", str(tmp_path / "tour"), str(tmp_path))
    assert done.returncode == 1
    assert "project.json" in done.stderr
