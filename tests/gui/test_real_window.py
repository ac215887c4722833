"""The program in a real window on a virtual screen (Xvfb, which setting up installs): drawn, walked, and in space."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.pipeline.update import keep_points
from core.project import read_project
from stripe_gui.__main__ import display_problem
from stripe_gui.pages import PAGES
from tests.copies import copied

ELSEWHERE = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
WALK = """
import sys
from pathlib import Path
from stripe_gui.app import Program, make_application
from stripe_gui.pages import PAGES
from stripe_gui.settings import Settings
from stripe_gui.tour import wait_until, write
from stripe_gui.workbench import Workbench

project, out = Path(sys.argv[1]), Path(sys.argv[2])
app = make_application()
bench = Workbench(Settings(out / "settings.ini"))
problems = []
bench.noticed.connect(lambda notice: problems.append(notice.happened) if notice.kind == "error" else None)
program = Program(app, bench)
window = program.window
window.show()
wait_until(window.isVisible)

def photograph(name):
    wait_until(lambda: not bench.views.busy)
    write(out / f"{name}.png", app.primaryScreen().grabWindow(0).toImage())

window.open_path(project)
for page in PAGES:
    window.show_page(page)
    photograph(page)
bench.session.choose_capture("object-sphere")
window.show_page("reconstruct")
wait_until(lambda: not bench.views.busy)
page = window.page
page.kind.setCurrentIndex(page.kind.findData("space"))
photograph("space")
picture = page.space.space
corner = picture.mapToGlobal(picture.rect().topLeft())
(out / "place").write_text(f"{corner.x()} {corner.y()} {picture.width()} {picture.height()}")
print(app.platformName(), *problems, sep="|")
window.close()
"""


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    """A screen that nobody sees. Without Xvfb this fails: sudo apt-get install xvfb, or packaging/setup.sh."""
    reading, writing = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writing), "-screen", "0", "1400x900x24", "-nolisten", "tcp"],
        pass_fds=[writing],
        stderr=subprocess.DEVNULL,
    )
    try:
        os.close(writing)
        with os.fdopen(reading) as pipe:
            yield f":{pipe.readline().strip()}"
    finally:
        server.terminate()
        server.wait()


@pytest.fixture(scope="module")
def walked(display: str, finished: Path, tmp_path_factory) -> tuple[Path, list[str]]:
    """Pictures of the screen at every page, and what the program said at its end."""
    folder = copied(finished, tmp_path_factory.mktemp("real") / "project")
    out = tmp_path_factory.mktemp("screen")
    keep_points(read_project(folder), "object-sphere", "photogrammetric")
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", WALK, str(folder), str(out)],
        env={**{k: v for k, v in os.environ.items() if k not in ELSEWHERE}, "DISPLAY": display},
        capture_output=True,
        text=True,
        timeout=200,
    )
    assert done.returncode == 0, done.stderr
    return out, done.stdout.strip().split("|")


def colours(image: np.ndarray) -> int:
    return len(np.unique(image.reshape(-1, 3).astype(np.uint32) @ np.array([1, 256, 65536], np.uint32)))


def test_the_screen_is_found_to_answer(display: str) -> None:
    assert display_problem({"DISPLAY": display}, "linux") == ""


def test_every_page_is_drawn_on_the_screen_and_nothing_goes_wrong(walked: tuple[Path, list[str]]) -> None:
    out, said = walked
    assert said[0] == "xcb"
    assert said[1:] == []
    pictures = {page: cv2.imread(str(out / f"{page}.png")) for page in PAGES}
    for page, picture in pictures.items():
        assert colours(picture[::2, ::2]) > 50, page  # the screen itself shows it, not only Qt's buffer
    names = list(pictures)
    for before, after in pairwise(names):
        assert (pictures[before] != pictures[after]).mean() > 0.01, (before, after)


def test_points_are_drawn_in_space(walked: tuple[Path, list[str]]) -> None:
    out, _ = walked
    x, y, width, height = map(int, (out / "place").read_text().split())
    view = cv2.imread(str(out / "space.png"))[y : y + height, x : x + width]
    background = view[2, 2]
    drawn = (view != background).any(axis=-1)
    assert 0.02 < drawn.mean() < 0.9  # a ball in the middle, its surroundings empty
    assert drawn[height // 2, width // 2]
    assert colours(view[drawn]) > 50  # coloured by height and lit
