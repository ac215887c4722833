"""The libraries that Qt would miss are named before it starts, all at once."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import PySide6
import pytest

from stripe_gui import libraries
from stripe_gui.__main__ import library_problem

PACKAGE = Path(PySide6.__file__).parent
PLUGIN = PACKAGE / "Qt/plugins/platforms/libqxcb.so"
pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Qt's libraries of Linux")


@pytest.mark.skipif(shutil.which("readelf") is None, reason="needs binutils")
@pytest.mark.parametrize("path", [PLUGIN, PACKAGE / "QtGui.abi3.so", Path(sys.executable).resolve()])
def test_what_a_file_needs_is_what_readelf_says(path: Path) -> None:
    told = subprocess.run(["readelf", "-d", path], capture_output=True, text=True, check=True).stdout
    wanted = [line.partition("[")[2].rstrip("]") for line in told.splitlines() if "(NEEDED)" in line]
    assert libraries.needed(path) == wanted


def test_a_file_of_another_kind_needs_nothing() -> None:
    assert libraries.needed(Path(__file__)) == []


@pytest.fixture
def qt(tmp_path: Path) -> Path:
    """Qt's plugin and libraries; the plugin needs two that do not exist anywhere."""
    package = tmp_path / "PySide6"
    (package / "Qt/plugins/platforms").mkdir(parents=True)
    (package / "Qt/lib").symlink_to(PACKAGE / "Qt/lib")
    data = PLUGIN.read_bytes()
    data = data.replace(b"libxcb-icccm.so.4", b"libxcb-icqqm.so.4").replace(b"libxcb-shm.so.0", b"libxcb-sqm.so.0")
    (package / "Qt/plugins/platforms/libqxcb.so").write_bytes(data)
    return package


def test_here_nothing_is_missing() -> None:
    assert libraries.missing_libraries({"QT_QPA_PLATFORM": "offscreen"}) == []
    assert library_problem({"QT_QPA_PLATFORM": "offscreen"}, "linux") == ""


def test_what_a_plugin_needs_and_nobody_has_is_missing(qt: Path) -> None:
    assert libraries.missing_of(qt, "xcb") == ["libxcb-icqqm.so.4", "libxcb-sqm.so.0"]


def test_all_that_is_missing_is_named_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    gone = {"libxcb-cursor.so.0", "libEGL.so.1", "libdbus-1.so.3", "libglib-2.0.so.0"}

    def load(name: str) -> None:
        if name in gone:
            raise OSError(f"{name}: cannot open shared object file: No such file or directory")
        if name == "libxcb-keysyms.so.1":  # there, and lacks what it needs itself
            raise OSError("libxcb-own.so.2: cannot open shared object file: No such file or directory")

    monkeypatch.setattr(libraries.ctypes, "CDLL", load)
    problem = library_problem({"DISPLAY": ":0"}, "linux")
    for name in (*gone, "libxcb-own.so.2"):
        assert name in problem
    assert problem.endswith("install libdbus-1-3 libegl1 libglib2.0-0 libxcb-cursor0 libxcb-own2")
    assert "libxcb" not in library_problem({"QT_QPA_PLATFORM": "offscreen"}, "linux")
    assert library_problem({}, "win32") == ""
