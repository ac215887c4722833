"""What tests of the window do and see as an operator does: click, wait, and tell where the targets really are."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractButton, QTabWidget

from core.geometry import Pose, project
from core.model import Interior, Seed
from core.project import read_project

PATIENCE_MS = 120_000
NEAR_PX = 3.0  # dots of the small rig are about 20 px apart
Targets = dict[tuple[int, int], np.ndarray]  # row and column to camera coordinates (2,), px


def click(button: QAbstractButton, qtbot) -> None:
    """Click a button that can be seen and clicked."""
    assert button.isVisible(), button.text()
    assert button.isEnabled(), button.text()
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)


def idle(window, qtbot, done: Callable[[], bool] = lambda: True) -> None:
    """Wait until nothing is under way, and something is done."""
    bench = window.bench

    def over() -> bool:
        background = getattr(window.page, "background", None)  # of the picking page: the images to come
        preparing = background is not None and background.preparing
        return not (bench.views.busy or bench.jobs.busy or preparing) and done()

    qtbot.waitUntil(over, timeout=PATIENCE_MS)


def front(tabs: QTabWidget, name: str) -> None:
    """Bring a tab to the front."""
    tabs.setCurrentIndex(next(i for i in range(tabs.count()) if tabs.widget(i).objectName() == name))


def true_targets(folder: Path, capture: str, testfield: str = "testfield.csv") -> Targets:
    """Where the camera of a simulated project really sees the targets of a board."""
    truth = json.loads((folder / "truth.json").read_text())
    camera, pose = truth["camera"], truth["captures"][capture]["camera_from_board"]
    a = tuple(camera[f"A{i}"] for i in range(1, 7))
    interior = Interior(camera["c_mm"], camera["x0_mm"], camera["y0_mm"], a, camera["r0_mm"])
    board = truth["testfields"][testfield]
    uv = project(
        read_project(folder).camera,
        interior,
        np.array([t["xyz_mm"] for t in board]),
        Pose(np.array(pose["rotation"]), np.array(pose["translation_mm"])),
    )
    return {(t["row"], t["col"]): at for t, at in zip(board, uv, strict=True)}


def rightly_named(guess: Sequence[Seed] | None, targets: Targets) -> bool:
    """Whether the picks that are guessed lie on the dots whose names they bear."""
    return bool(guess) and all(np.hypot(*(targets[s.row, s.col] - (s.u, s.v))) < NEAR_PX for s in guess)
