"""What of the system Qt would miss at its start: all of it at once, without loading Qt, which would end the process."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

_BROUGHT = ("libQt", "libpyside", "libshiboken")  # these the packages themselves bring
_MODULES = ("QtCore", "QtGui", "QtWidgets", "QtSvg", "QtDBus")
_ELSEWHERE = {"libz.so.1": "zlib1g"}  # packages of Debian that are not named after their library
_GLIB = re.compile(r"lib(g[a-z]+)-2\.0\.so\.0")


def missing_libraries(environment: Mapping[str, str]) -> list[str]:
    """Name the libraries that a window of PySide6 would need here and that are not there."""
    spec = find_spec("PySide6")
    if spec is None or not spec.submodule_search_locations:
        return []
    return missing_of(Path(spec.submodule_search_locations[0]), _platform(environment))


def missing_of(package: Path, platform: str) -> list[str]:
    """Name what the modules of an installed PySide6, and Qt's plugin of a platform, need beyond what is there."""
    files = [path for name in _MODULES for path in package.glob(f"{name}.abi3.so")]
    files += package.glob(f"Qt/plugins/platforms/libq{platform}*.so")
    try:
        told = subprocess.run(["ldd", *files], capture_output=True, text=True, errors="replace").stdout
    except OSError:  # no GNU system
        return []
    absent = re.findall(r"^\s*(\S+) => not found", told, re.MULTILINE)
    return sorted({name for name in absent if not name.startswith(_BROUGHT)})


def packages(libraries: Sequence[str]) -> list[str]:
    """Give the packages of Debian and Ubuntu that hold libraries, by Debian's rule for their names.

    Examples
    --------
    >>> packages(["libxcb-cursor.so.0", "libGL.so.1", "libdbus-1.so.3", "libglib-2.0.so.0"])
    ['libdbus-1-3', 'libgl1', 'libglib2.0-0', 'libxcb-cursor0']
    """
    found = set()
    for library in libraries:
        name, _, number = library.partition(".so.")
        name, number = name.lower().replace("_", "-"), number.split(".")[0]
        plain = f"{name}-{number}" if name[-1:].isdigit() else name + number
        found.add("libglib2.0-0" if _GLIB.fullmatch(library) else _ELSEWHERE.get(library, plain))
    return sorted(found)


def _platform(environment: Mapping[str, str]) -> str:
    chosen = environment.get("QT_QPA_PLATFORM", "").split(":")[0].split(";")[0]
    return chosen or ("wayland" if environment.get("WAYLAND_DISPLAY") and not environment.get("DISPLAY") else "xcb")
