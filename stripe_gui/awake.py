"""While patterns are shown: no screen saver, and no night light that reddens them, where the desktop offers it."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from PySide6.QtDBus import QDBus, QDBusConnection, QDBusMessage, QDBusVariant

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
