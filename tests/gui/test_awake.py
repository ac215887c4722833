"""What is held while patterns are shown, by a desktop that is played on a session bus of its own."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from stripe_gui.screens import Awake

ROOT = Path(__file__).parents[2]
DESKTOP = """
import subprocess, sys
from PySide6.QtCore import ClassInfo, Property, QCoreApplication, QObject, QTimer, Slot
from PySide6.QtDBus import QDBusConnection

app = QCoreApplication([])
bus = QDBusConnection.sessionBus()

@ClassInfo({"D-Bus Interface": "org.freedesktop.ScreenSaver"})
class Saver(QObject):
    @Slot(str, str, result="uint")
    def Inhibit(self, who, why):
        print("inhibited by", who, flush=True)
        return 77

@ClassInfo({"D-Bus Interface": "org.gnome.SettingsDaemon.Color"})
class Colour(QObject):
    off = False
    def get(self):
        return Colour.off
    def set(self, value):
        Colour.off = value
        print("DisabledUntilTomorrow", value, flush=True)
    DisabledUntilTomorrow = Property(bool, get, set)

saver, colour = Saver(), Colour()
slots = QDBusConnection.RegisterOption.ExportAllSlots
assert bus.registerObject("/org/freedesktop/ScreenSaver", saver, slots)
assert bus.registerService("org.freedesktop.ScreenSaver")
assert bus.registerObject("/org/gnome/SettingsDaemon/Color", colour, QDBusConnection.RegisterOption.ExportAllProperties)
assert bus.registerService("org.gnome.SettingsDaemon.Color")
pattern = subprocess.Popen([sys.executable, "-c", sys.argv[1]])
timer = QTimer()
timer.timeout.connect(lambda: app.quit() if pattern.poll() is not None else None)
timer.start(20)
app.exec()
"""
PATTERNS = """
from PySide6.QtCore import QCoreApplication
from stripe_gui.screens import Awake
app = QCoreApplication([])
awake = Awake()
print("held", *awake.held, flush=True)
awake.release()
awake.release()
print("held", *awake.held, flush=True)
"""


@pytest.mark.skipif(shutil.which("dbus-run-session") is None, reason="needs a session bus of its own")
def test_screen_saver_and_night_light_are_held_and_let_go() -> None:
    command = ["dbus-run-session", "--", sys.executable, "-c", DESKTOP, PATTERNS]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert sorted(done.stdout.splitlines()) == [
        "DisabledUntilTomorrow False",
        "DisabledUntilTomorrow True",
        "held",
        "held org.freedesktop.ScreenSaver org.gnome.SettingsDaemon.Color",
        "inhibited by stripe-gui",
    ]


def test_without_a_desktop_nothing_is_held_and_nothing_fails(qapp, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DBUS_SESSION_BUS_ADDRESS", "unix:path=/nowhere")
    awake = Awake()
    assert awake.held == []
    awake.release()
