"""The libraries that Qt would miss are named before it starts, all at once."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import PySide6
import pytest

from stripe_gui import libraries
from stripe_gui.__main__ import library_problem

PACKAGE = Path(PySide6.__file__).parent
PLUGIN = PACKAGE / "Qt/plugins/platforms/libqxcb.so"
pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="Qt's libraries of Linux")


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


def test_all_that_is_missing_is_named_at_once(qt: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libraries, "find_spec", lambda _: SimpleNamespace(submodule_search_locations=[str(qt)]))
    problem = library_problem({"DISPLAY": ":0"}, "linux")
    assert problem.startswith("Qt needs libxcb-icqqm.so.4, libxcb-sqm.so.0; ")
    assert problem.endswith("install libxcb-icqqm4 libxcb-sqm0")
    assert library_problem({"QT_QPA_PLATFORM": "offscreen"}, "linux") == ""
    assert library_problem({}, "win32") == ""


def test_a_folder_whose_name_is_no_text_here_hides_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As ldd writes where libraries are: of a home folder that was named in another encoding."""
    ldd = tmp_path / "ldd"
    ldd.write_text(
        "#!/bin/sh\nprintf 'libQt6Gui.so.6 => /home/M\\374ller/libQt6Gui.so.6\\nlibxcb-sqm.so.0 => not found\\n'\n"
    )
    ldd.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    assert libraries.missing_of(PACKAGE, "xcb") == ["libxcb-sqm.so.0"]
