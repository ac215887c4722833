"""Any HDMI projector as a second screen: a window over the whole of it, one pixel of the pattern on one of its own.

No screen saver comes meanwhile, and no night light that reddens the patterns, where the desktop offers that.

Patterns come from a worker thread; windows live in the program's own thread. A `Courier` carries each wish across and
waits until it is done, so that a pattern counts as shown only once it was painted.
"""

from __future__ import annotations

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QCoreApplication, QObject, QSize, Qt, QThread, Signal
from PySide6.QtDBus import QDBus, QDBusConnection, QDBusMessage, QDBusVariant
from PySide6.QtGui import QColor, QGuiApplication, QImage, QPainter, QScreen
from PySide6.QtWidgets import QWidget

from core.errors import DeviceError

PATIENCE_S = 5.0  # for a window to appear, and for the program's thread to answer
RETRY_S = 0.01
ANSWER_MS = 1000
# the freedesktop specification's, and KWin's: service, path, interface and method; they hold until the bus is left
INHIBITORS = {
    ("org.freedesktop.ScreenSaver", "/org/freedesktop/ScreenSaver", "org.freedesktop.ScreenSaver", "Inhibit"): [
        "stripe-gui",
        "shows measuring patterns",
    ],
    ("org.kde.KWin.NightLight", "/org/kde/KWin/NightLight", "org.kde.KWin.NightLight", "inhibit"): [],
}
COLOUR = "org.gnome.SettingsDaemon.Color", "/org/gnome/SettingsDaemon/Color", "org.freedesktop.DBus.Properties"
NIGHT_LIGHT = "org.gnome.SettingsDaemon.Color", "DisabledUntilTomorrow"
_CONTINUOUS, _DISPLAY = 0x80000000, 0x2  # of Windows' SetThreadExecutionState


class Awake:
    """Holds the screen as it is until `release`; `held` names what has agreed to that."""

    def __init__(self) -> None:
        self.held: list[str] = []
        self._undo: list[Callable[[], object]] = []
        if sys.platform == "win32":
            self._hold_windows()
        elif sys.platform == "darwin":
            self._hold_macos()
        else:
            self._hold_desktop()

    def release(self) -> None:
        """Let everything be as before; a second call does nothing."""
        while self._undo:
            self._undo.pop()()
        self.held.clear()

    def _hold_desktop(self) -> None:
        name = f"awake-{id(self)}"
        bus = QDBusConnection.connectToBus(QDBusConnection.BusType.SessionBus, name)
        self._undo.append(lambda: QDBusConnection.disconnectFromBus(name))
        if not bus.isConnected():
            return
        self.held += [place[0] for place, told in INHIBITORS.items() if _call(bus, place, told) is not None]
        off = _call(bus, (*COLOUR, "Get"), [*NIGHT_LIGHT])
        if off is None or (off[0].variant() if isinstance(off[0], QDBusVariant) else off[0]):
            return
        if _call(bus, (*COLOUR, "Set"), [*NIGHT_LIGHT, QDBusVariant(True)]) is not None:
            self._undo.append(lambda: _call(bus, (*COLOUR, "Set"), [*NIGHT_LIGHT, QDBusVariant(False)]))
            self.held.append(NIGHT_LIGHT[0])

    def _hold_windows(self) -> None:
        import ctypes

        kernel = ctypes.windll.kernel32  # type: ignore[attr-defined]
        if kernel.SetThreadExecutionState(_CONTINUOUS | _DISPLAY):
            self._undo.append(lambda: kernel.SetThreadExecutionState(_CONTINUOUS))
            self.held.append("Windows")

    def _hold_macos(self) -> None:
        with suppress(OSError):
            program = subprocess.Popen(["caffeinate", "-d"])
            self._undo += [program.wait, program.terminate]  # the last one first
            self.held.append("macOS")


def _call(bus: QDBusConnection, place: tuple[str, str, str, str], arguments: list[Any]) -> list[Any] | None:
    """Call a method; give what it answers, None where nobody does."""
    message = QDBusMessage.createMethodCall(*place)
    message.setArguments(arguments)
    answer = bus.call(message, QDBus.CallMode.Block, ANSWER_MS)
    return answer.arguments() if answer.type() == QDBusMessage.MessageType.ReplyMessage else None


def pixels_of(screen: QScreen) -> QSize:
    """Give a screen's size in its own pixels, whatever the desktop's scaling pretends."""
    ratio = screen.devicePixelRatio()
    return QSize(round(screen.geometry().width() * ratio), round(screen.geometry().height() * ratio))


class PatternWindow(QWidget):
    """A frameless window that paints one image, unscaled, on black."""

    def __init__(self, screen: QScreen) -> None:
        super().__init__(None, Qt.WindowType.FramelessWindowHint | Qt.WindowType.WindowStaysOnTopHint)
        self.setWindowTitle(self.tr("Patterns"))
        self.setAccessibleName(self.tr("Patterns of the projector"))
        self.setAttribute(Qt.WidgetAttribute.WA_QuitOnClose, False)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)
        self.setAttribute(Qt.WidgetAttribute.WA_ShowWithoutActivating)
        self.setCursor(Qt.CursorShape.BlankCursor)
        self.setScreen(screen)
        self.setGeometry(screen.geometry())
        self.painted = 0  # number of the image that was painted last
        self._number = 0
        self._image = QImage()
        self._pixels: NDArray[np.uint8] | None = None  # what the image looks into

    def show_image(self, pixels: NDArray[np.uint8]) -> int:
        """Paint an image, shape (H, W), at once if the window can be seen; give its number."""
        height, width = pixels.shape
        self._pixels = np.ascontiguousarray(pixels)
        self._image = QImage(self._pixels.data, width, height, width, QImage.Format.Format_Grayscale8)
        self._number += 1
        self.repaint()
        return self._number

    def paintEvent(self, _event: object) -> None:  # noqa: N802
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor("black"))
        if not self._image.isNull():
            self._image.setDevicePixelRatio(self.devicePixelRatioF())
            painter.drawImage(0, 0, self._image)
        painter.end()
        self.painted = self._number


class Courier(QObject):
    """Has functions called in the thread it was made in, and waits for their results."""

    _sent = Signal(object, object)

    def __init__(self) -> None:
        super().__init__()
        self._sent.connect(self._deliver, Qt.ConnectionType.QueuedConnection)

    @property
    def at_home(self) -> bool:
        """Whether the caller is in the courier's own thread."""
        return QThread.currentThread() == self.thread()

    def call(self, function: Callable[[], Any]) -> Any:
        """Call a function over there; DeviceError if the program's thread does not answer."""
        if self.at_home:
            return function()
        answer: Future[Any] = Future()
        self._sent.emit(function, answer)
        if not wait([answer], PATIENCE_S).done:
            raise DeviceError(
                "screen", f"the window does not answer within {PATIENCE_S:g} s", "start the program again"
            )
        return answer.result()

    def _deliver(self, function: Callable[[], Any], answer: Future[Any]) -> None:
        try:
            answer.set_result(function())
        except Exception as error:  # handed over to whoever asked
            answer.set_exception(error)


class ScreenSurface:
    """A pattern window as `core.devices` wants it; may be used from any thread."""

    def __init__(self, courier: Courier, number: int) -> None:
        self._courier, self._number = courier, number
        self._window: PatternWindow | None = courier.call(self._make)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in the screen's own pixels."""
        size = self._courier.call(lambda: pixels_of(self._window.screen()) if self._window else QSize())
        return size.width(), size.height()

    def present(self, image: NDArray[np.uint8]) -> None:
        """Show an image (H, W) of the surface's size; returns once it was painted.

        DeviceError if the window is gone or cannot be seen, or the image is of another size.
        """
        end = time.monotonic() + PATIENCE_S
        while not self._courier.call(lambda: self._paint(image)):
            if time.monotonic() > end:
                raise DeviceError(
                    f"screen {self._number}", "its window cannot be seen", "switch the screen on and end screen savers"
                )
            if self._courier.at_home:
                QCoreApplication.processEvents()  # the window is still on its way to the screen
            time.sleep(RETRY_S)

    def close(self) -> None:
        self._courier.call(self._remove)

    def _make(self) -> PatternWindow:
        screens = QGuiApplication.screens()
        if not 0 <= self._number < len(screens):
            raise DeviceError(f"screen:{self._number}", "no such screen", f"there are {'; '.join(screen_names())}")
        window = PatternWindow(screens[self._number])
        self._awake = Awake()
        window.showFullScreen()
        return window

    def _paint(self, image: NDArray[np.uint8]) -> bool:
        window = self._window
        if window is None:
            raise DeviceError(f"screen {self._number}", "its window is closed", "open the projector again")
        size = pixels_of(window.screen())
        if image.shape != (size.height(), size.width()):
            seen = f"an image of {image.shape[1]}x{image.shape[0]} px for {size.width()}x{size.height()}"
            raise DeviceError(f"screen {self._number}", seen, "set the screen to the projector's own resolution")
        return window.show_image(image) == window.painted

    def _remove(self) -> None:
        window, self._window = self._window, None
        if window is not None:
            self._awake.release()
            window.hide()
            window.deleteLater()


class Screens:
    """Makes pattern windows; to be made in the program's own thread."""

    def __init__(self) -> None:
        self._courier = Courier()

    def serve(self, number: int) -> None:
        """Show what comes through standard input on a screen until it ends, and say so on standard output.

        An image is a line with its width and height, and its pixels; the answer to each, and to the start, is a line of
        JSON: the screen's size, or what is wrong and what to do. For `core.devices.screen.ServedSurface`.
        """

        def say(**told: object) -> None:
            print(json.dumps(told), flush=True)

        def work() -> None:
            try:
                surface = self.open(number)
                say(size=surface.size)
            except DeviceError as error:
                say(error=(error.seen, error.remedy))
                self._courier.call(QCoreApplication.quit)
                return
            source = sys.stdin.buffer
            while header := source.readline():
                width, height = map(int, header.split())
                data = source.read(width * height)
                if len(data) < width * height:
                    break
                try:
                    surface.present(np.frombuffer(data, np.uint8).reshape(height, width))
                    say(size=surface.size)
                except DeviceError as error:
                    say(error=(error.seen, error.remedy))
            surface.close()
            self._courier.call(QCoreApplication.quit)

        worker = threading.Thread(target=work)
        worker.start()
        QCoreApplication.exec()
        worker.join()

    def open(self, number: int) -> ScreenSurface:
        return ScreenSurface(self._courier, number)


def screen_names() -> list[str]:
    """Describe the screens of this computer, in the order of their numbers."""
    found = []
    for number, screen in enumerate(QGuiApplication.screens()):
        size = pixels_of(screen)
        found.append(f"{number}: {screen.name()} {size.width()} × {size.height()}")
    return found
