"""A second screen: every pixel of a pattern on a pixel of the screen, at single and double scale, from any thread."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QWidget

from core.devices import offer_screens, open_projector
from core.errors import DeviceError
from core.patterns import Black, Code, Pattern, Phase, White, pattern_image
from stripe_gui.screens import PatternWindow, Screens, screen_names
from stripe_gui.wizards.capture.wizard import CaptureWizard

PATTERNS: list[Pattern] = [
    White(),
    Black(),
    Code("gray", "x", 8, 9, 2),
    Code("gray", "y", 8, 9, 2),
    Phase("x", 2.0, 4, 0, 0.0, "square"),
    Phase("y", 2.0, 4, 0, 0.0, "square"),
    Phase("x", 17.3, 4, 1, 1.0, "sine"),
    Phase("y", 17.3, 4, 1, 1.0, "sine"),
]


@pytest.fixture
def screens(qapp) -> Iterator[Screens]:
    made = Screens()
    offer_screens(made.open)
    yield made
    offer_screens(None)


def in_thread(work: Callable[[], object], qtbot) -> object:
    """Run in a worker while the window's thread goes on; give the result or the error."""
    result: list[object] = []

    def run() -> None:
        try:
            result.append(work())
        except DeviceError as error:
            result.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    qtbot.waitUntil(lambda: not thread.is_alive(), timeout=20_000)
    return result[0]


def window_of(qapp) -> PatternWindow:
    return next(w for w in qapp.topLevelWidgets() if isinstance(w, PatternWindow) and w.isVisible())


def seen(window: QWidget) -> np.ndarray:
    """The window's own pixels."""
    image = window.grab().toImage().convertToFormat(QImage.Format.Format_Grayscale8)
    rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), image.bytesPerLine())
    return rows[:, : image.width()].copy()


def wanted(pattern: Pattern, size: tuple[int, int]) -> np.ndarray:
    return np.rint(255 * pattern_image(pattern, *size)).astype(np.uint8)


def test_every_pixel_is_the_patterns_from_a_worker(screens: Screens, qapp, qtbot) -> None:
    projector = in_thread(lambda: open_projector("screen:0"), qtbot)
    try:
        for pattern in PATTERNS:
            assert in_thread(lambda pattern=pattern: projector.show(pattern), qtbot) is None
            assert np.array_equal(seen(window_of(qapp)), wanted(pattern, projector.size))
    finally:
        in_thread(projector.close, qtbot)


def test_a_pattern_has_been_painted_when_show_returns(screens: Screens, qapp, qtbot) -> None:
    projector = in_thread(lambda: open_projector("screen:0"), qtbot)
    painted: list[bool] = []

    def work() -> None:
        for pattern in PATTERNS:
            projector.show(pattern)
            window = window_of(qapp)
            painted.append(window.painted == window._number)

    try:
        in_thread(work, qtbot)
        assert painted == [True] * len(PATTERNS)
    finally:
        in_thread(projector.close, qtbot)


def test_it_works_from_the_windows_own_thread_too(screens: Screens, qapp) -> None:
    surface = screens.open(0)
    image = wanted(PATTERNS[2], surface.size)
    surface.present(image)
    assert np.array_equal(seen(window_of(qapp)), image)
    surface.close()
    surface.close()
    with pytest.raises(DeviceError, match="closed"):
        surface.present(image)


def test_the_capture_wizard_offers_the_screens(bench, qtbot) -> None:
    wizard = CaptureWizard(bench)
    qtbot.addWidget(wizard)
    projector = in_thread(lambda: open_projector("screen:0"), qtbot)
    assert projector.size == (800, 800)  # what the offscreen platform pretends
    in_thread(projector.close, qtbot)


def test_an_image_that_would_be_scaled_is_refused(screens: Screens) -> None:
    surface = screens.open(0)
    with pytest.raises(DeviceError, match="px for"):
        surface.present(np.zeros((10, 10), np.uint8))
    surface.close()


def test_a_screen_that_is_not_there_is_told_with_those_that_are(screens: Screens, qtbot) -> None:
    error = in_thread(lambda: open_projector("screen:7"), qtbot)
    assert isinstance(error, DeviceError)
    assert "screen:7" in str(error)
    assert screen_names()[0].split()[1] in str(error)


def test_at_double_scale_too_a_pixel_is_a_pixel() -> None:
    code = (
        "import sys; sys.path.insert(0, '.')\n"
        "import numpy as np\n"
        "from stripe_gui.app import make_application\n"
        "from stripe_gui.screens import Screens\n"
        "from tests.gui.test_screens import PATTERNS, seen, wanted, window_of\n"
        "app = make_application(); surface = Screens().open(0)\n"
        "for pattern in PATTERNS:\n"
        "    surface.present(wanted(pattern, surface.size))\n"
        "    assert np.array_equal(seen(window_of(app)), wanted(pattern, surface.size)), pattern\n"
        "window = window_of(app); ratio = window.devicePixelRatioF()\n"
        "assert surface.size == (round(window.width() * ratio), round(window.height() * ratio))\n"
        "surface.close(); print(ratio)\n"
    )
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    for scale in ("2", "1.5"):
        done = subprocess.run(
            [sys.executable, "-c", code],
            env={**environment, "QT_SCALE_FACTOR": scale},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert float(done.stdout.split()[-1]) == float(scale)
