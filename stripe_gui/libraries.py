"""What of the system Qt would miss at its start: all of it at once, without loading Qt, which would end the process."""

from __future__ import annotations

import ctypes
import re
import struct
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from mmap import ACCESS_READ, mmap
from pathlib import Path

_DYNAMIC, _STRINGS, _NEEDED = 2, 5, 1  # of ELF: the segment's type, and tags in it
_LOADED = 1
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
    roots = [path for name in _MODULES for path in package.glob(f"{name}.abi3.so")]
    roots += package.glob(f"Qt/plugins/platforms/libq{platform}*.so")
    brought = (package / "Qt/lib", package, package.parent / "shiboken6", package.parent)  # the last one in a bundle
    outside: set[str] = set()
    waiting, seen = list(roots), set(roots)
    while waiting:
        for name in needed(waiting.pop()):
            file = next((folder / name for folder in brought if (folder / name).exists()), None)
            if file is None:
                outside.add(name)
            elif file not in seen:
                seen.add(file)
                waiting.append(file)
    system = [name for name in outside if not name.startswith(_BROUGHT)]
    return sorted({absent for name in system if (absent := _absent(name))})


def needed(path: Path) -> list[str]:
    """Read which libraries an ELF file of 64 bits names as needed; none of any other file."""
    with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
        return _needed(data) if data[:6] == b"\x7fELF\2\1" else []


def _needed(data: mmap) -> list[str]:
    start, size, count = (*struct.unpack_from("<Q", data, 32), *struct.unpack_from("<2H", data, 54))
    segments = [struct.unpack_from("<2I4Q", data, start + i * size) for i in range(count)]

    def offset(address: int) -> int:
        """Give where in the file an address of the loaded library is."""
        return next(at + address - a for kind, _, at, a, _, n in segments if kind == _LOADED and a <= address < a + n)

    tags: list[tuple[int, int]] = []
    for kind, _, at, _, _, length in segments:
        if kind == _DYNAMIC:
            tags += [struct.unpack_from("<2Q", data, at + i) for i in range(0, length, 16)]
    strings = next((offset(value) for tag, value in tags if tag == _STRINGS), 0)
    names = [strings + value for tag, value in tags if tag == _NEEDED]
    return [data[at : data.find(b"\0", at)].decode() for at in names]


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


def _absent(name: str) -> str:
    """Name the library that keeps one from being loaded: itself, or one that it needs; empty if it can be."""
    try:
        ctypes.CDLL(name)
    except OSError as error:
        told = re.match(r"(\S+\.so[.\d]*): cannot open", str(error))
        return told[1] if told else name
    return ""


def _platform(environment: Mapping[str, str]) -> str:
    chosen = environment.get("QT_QPA_PLATFORM", "").split(":")[0].split(";")[0]
    return chosen or ("wayland" if environment.get("WAYLAND_DISPLAY") and not environment.get("DISPLAY") else "xcb")
