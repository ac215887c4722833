"""The window, offscreen: first paint, the next 5 Mpx image, memory after 100 of them, 5,000 residual vectors."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.benchmarks.timing import EFFORT, OURS, Contestant, Row, race, resident_mb

if TYPE_CHECKING:
    from PySide6.QtGui import QImage
    from PySide6.QtWidgets import QApplication

WIDTH, HEIGHT = 2448, 2048
VIEW = 1100, 800
VECTORS = 5000
SWITCHES = 100


def run() -> list[Row]:
    """Everything in the offscreen platform, whose painting is the same as a window's but for the last copy."""
    os.environ["QT_QPA_PLATFORM"] = "offscreen"
    rows = race("window", "first paint", 1, "", [_start(OURS, "workbench"), _start("an empty Qt window", "empty")])
    with tempfile.TemporaryDirectory() as settings:
        os.environ["XDG_CONFIG_HOME"] = settings
        from stripe_gui.app import make_application

        app = make_application()
        return rows + _images(app) + _residuals(app)


def _start(name: str, which: str) -> Contestant:
    def work() -> str:
        with tempfile.TemporaryDirectory() as settings:
            return subprocess.run(
                [sys.executable, "-m", "tests.benchmarks.first_paint", which],
                check=True,
                capture_output=True,
                text=True,
                env={**os.environ, "XDG_CONFIG_HOME": settings},
            ).stdout

    def right(told: str) -> str:
        size, widgets = told.split()
        assert which == "empty" or int(widgets) > 50, f"only {widgets} widgets are there"
        return f"{size} px, {widgets} widgets"

    return Contestant(name, work, right)


def _images(app: QApplication) -> list[Row]:
    from PySide6.QtGui import QImage

    from core.project import read_image, write_image
    from stripe_gui.widgets.image_view import ImageView
    from tests.benchmarks.painting import Canvas

    images = _pictures()
    view, plain = ImageView("benchmark", bar=False), Canvas()
    for widget in (view, plain):
        widget.resize(*VIEW)
        widget.show()
    app.processEvents()
    turn = {"n": 0}

    def following() -> int:
        turn["n"] += 1
        return turn["n"] % len(images)

    def ours(k: int, image: np.ndarray | None = None) -> tuple[int, QImage]:
        view.set_image(images[k] if image is None else image)
        view.canvas.viewport().repaint()
        return k, view.canvas

    def qt(k: int, image: QImage | None = None) -> tuple[int, QImage]:
        plain.image = image or QImage(images[k].data, WIDTH, HEIGHT, WIDTH, QImage.Format.Format_Grayscale8)
        plain.repaint()
        return k, plain

    def right(shown: tuple[int, Any]) -> str:
        """The picture's left and right halves have the grey values that the image has there."""
        k, widget = shown
        grey = _grey(widget.grab().toImage())
        middle = grey[grey.shape[0] // 2]
        found = [float(np.mean(middle[int(len(middle) * a) : int(len(middle) * (a + 0.1))])) for a in (0.3, 0.6)]
        meant = [float(images[k][HEIGHT // 2, WIDTH // 4]), float(images[k][HEIGHT // 2, 3 * WIDTH // 4])]
        assert np.allclose(found, meant, atol=3), f"grey values {found} are shown for {meant}"
        return "its grey values are on the screen"

    field = [Contestant(OURS, ours, right, following), Contestant("Qt alone: scaled QImage", qt, right, following)]
    rows = race("window", "5 Mpx image", WIDTH * HEIGHT, "", field)
    with tempfile.TemporaryDirectory() as name:
        files = [Path(name) / f"{k}.png" for k in range(len(images))]
        for file, image in zip(files, images, strict=True):
            write_image(file, image, durable=False)
        field = [
            Contestant(OURS, lambda k: ours(k, read_image(files[k])), right, following),
            Contestant("Qt alone: scaled QImage", lambda k: qt(k, QImage(str(files[k]))), right, following),
        ]
        rows += race("window", "5 Mpx image from its PNG", WIDTH * HEIGHT, "", field)

    def switch() -> float:
        before = resident_mb()
        for _ in range(SWITCHES):
            ours(following(), images[following()].copy())
            app.processEvents()
        return resident_mb() - before

    def flat(grown: float) -> str:
        assert grown < SWITCHES * WIDTH * HEIGHT / 1e6 / 10, f"memory grew by {grown:.0f} MB"  # a leak keeps all
        return f"memory grew by {grown:.1f} MB"

    memory = race("window", f"{SWITCHES} switches of 5 Mpx images", SWITCHES, "", [Contestant(OURS, switch, flat)])
    for widget in (view, plain):
        widget.close()
    return rows + memory


def _pictures() -> list[np.ndarray]:
    """Four images: two halves of different grey, with noise of one grey value."""
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 2, (HEIGHT, WIDTH), dtype=np.uint8)
    pictures = []
    for k in range(2 if EFFORT.quick else 4):
        image = noise + np.uint8(40 * k)
        image[:, WIDTH // 2 :] += np.uint8(60)
        pictures.append(image)
    return pictures


def _grey(image: QImage) -> np.ndarray:
    from PySide6.QtGui import QImage as Image

    grey = image.convertToFormat(Image.Format.Format_Grayscale8)
    return np.frombuffer(grey.constBits(), np.uint8).reshape(grey.height(), grey.bytesPerLine())[:, : grey.width()]


def _residuals(app: QApplication) -> list[Row]:
    from stripe_gui.widgets.residual_view import ResidualPlot
    from tests.benchmarks.painting import Canvas, quiver

    rng = np.random.default_rng(0)
    uv = rng.uniform([0, 0], [747, 575], (VECTORS, 2))
    d = rng.normal(0, 0.05, (VECTORS, 2))
    plot, plain = ResidualPlot("benchmark"), Canvas()
    for widget in (plot, plain):
        widget.resize(*VIEW)
        widget.show()
    app.processEvents()

    def ours() -> ResidualPlot:
        plot.set_residuals(uv, d, (748, 576), (8.0, 8.0))
        plot.canvas.viewport().repaint()
        return plot

    def qt() -> Canvas:
        plain.lines = np.hstack([uv, uv + 200 * d]) * np.array([VIEW[0] / 748, VIEW[1] / 576] * 2)
        plain.repaint()
        return plain

    def right(widget: ResidualPlot | Canvas) -> str:
        drawn = len(widget.vectors.getData()[0]) // 2 if isinstance(widget, ResidualPlot) else len(widget.lines)
        grey = _grey(widget.grab().toImage()).astype(int)
        inked = np.mean(np.abs(grey - np.median(grey)) > 20)
        assert drawn == VECTORS, f"{drawn} vectors of {VECTORS}"
        assert inked > 0.01, f"{inked:.1%} of the picture is drawn on"
        return f"{drawn} vectors on {inked:.0%} of the picture"

    def covers(inked: float) -> str:
        assert inked > 0.01, f"{inked:.1%} of the picture is drawn on"
        return f"on {inked:.0%} of the picture"

    field = [
        Contestant(OURS, ours, right),
        Contestant("Qt alone: QPainter.drawLines", qt, right),
        Contestant("matplotlib quiver", lambda: quiver(uv, d, VIEW), covers),
    ]
    rows = race("window", "5,000 residuals", VECTORS, "", field)
    for widget in (plot, plain):
        widget.close()
    return rows
