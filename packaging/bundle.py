"""Build the bundle: `.venv/bin/python packaging/bundle.py [--quick]` (`make bundle`).

One folder, dist/stripe-workbench, runs on a machine without Python: `stripe-gui`, `stripe-core`, what they need, a
desktop entry with icons and AppStream data below share, the licences of all parts, and a script that installs them.
It is put together in an environment of its own, .bundle-venv, from the sources as they are, and tried at the end.
"""

from __future__ import annotations

import argparse
import compileall
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from importlib.metadata import distributions
from pathlib import Path
from py_compile import PycInvalidationMode

from PySide6.QtGui import QImage, QPainter
from PySide6.QtSvg import QSvgRenderer

ROOT = Path(__file__).parents[1]
PACKAGING = ROOT / "packaging"
VENV = ROOT / ".bundle-venv"
DIST = ROOT / "dist"
ID = "org.stripe_workbench.StripeWorkbench"
SOURCES = ("core", "stripe_gui", "resources", "pyproject.toml", "README.md", "LICENSE")
ICON_PX = (48, 128, 256)  # for desktops that do not draw SVG; 48 is the size the icon theme specification asks for
LICENCE = re.compile(r"LICEN[CS]E|COPYING|NOTICE", re.IGNORECASE)
TOOLS = {"altgraph", "packaging", "pip", "pyinstaller", "pyinstaller-hooks-contrib", "setuptools"}  # not in the bundle


def main() -> int:
    """Build and try; give the exit code of the trial."""
    parser = argparse.ArgumentParser(prog="bundle.py", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="try it without the reference experiment")
    options = parser.parse_args()
    started = time.monotonic()
    python = environment()
    folder = assemble(python)
    complete(folder)
    seconds = time.monotonic() - started
    print(f"bundle: {folder}: {megabytes(folder)} MB in {seconds:.0f} s; needs glibc {glibc(folder)} or newer")
    for part in sorted((folder / "_internal").iterdir(), key=megabytes)[:-9:-1]:
        print(f"bundle: {megabytes(part):5d} MB  {part.name}")
    check = [str(python), str(PACKAGING / "check_bundle.py"), str(folder), *(["--quick"] if options.quick else [])]
    return subprocess.run(check, check=False).returncode


def environment() -> Path:
    """Install PyInstaller, the extras and the program as it is now into `VENV`; give its interpreter."""
    python, stamp, wanted = VENV / "bin/python", VENV / "installed.toml", (ROOT / "pyproject.toml").read_bytes()
    with tempfile.TemporaryDirectory() as temporary:  # a copy: setuptools would leave its own traces beside the sources
        for name in SOURCES:
            source, copy = ROOT / name, Path(temporary) / name
            if source.is_dir():
                shutil.copytree(source, copy, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(source, copy)
        pip = [str(python), "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
        if not stamp.exists() or stamp.read_bytes() != wanted:
            print(f"bundle: installing PyInstaller and what the program needs into {VENV.name}")
            subprocess.run([sys.executable, "-m", "venv", "--clear", str(VENV)], check=True)
            subprocess.run([*pip, f"{temporary}[bundle]"], check=True)
            stamp.write_bytes(wanted)
        else:
            subprocess.run([*pip, "--no-deps", "--force-reinstall", temporary], check=True)
    return python


def assemble(python: Path) -> Path:
    """Let PyInstaller gather modules and libraries; give the bundle's folder."""
    print("bundle: putting it together")
    command = [str(python), "-m", "PyInstaller", "--noconfirm", "--clean", "--log-level", "ERROR"]
    places = ["--distpath", str(DIST), "--workpath", str(ROOT / "build/bundle")]
    quiet = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1"}
    subprocess.run([*command, *places, "stripe.spec"], cwd=PACKAGING, env=quiet, check=True)
    return DIST / "stripe-workbench"


def complete(folder: Path) -> None:
    """Add the window's name for the program, the desktop's files, the licences and the script that installs all."""
    (folder / "stripe-gui").hardlink_to(folder / "stripe-core")
    # the core's sources lie in the bundle: compiled beside them, whatever the clock says after copying
    compileall.compile_dir(folder / "_internal/core", quiet=1, invalidation_mode=PycInvalidationMode.UNCHECKED_HASH)
    share = folder / "share"
    place(PACKAGING / f"desktop/{ID}.desktop", share / "applications")
    place(PACKAGING / f"desktop/{ID}.metainfo.xml", share / "metainfo")
    drawing = ROOT / "resources/icons/program.svg"
    place(drawing, share / "icons/hicolor/scalable/apps", f"{ID}.svg")
    for side in ICON_PX:
        paint(drawing, side, share / f"icons/hicolor/{side}x{side}/apps/{ID}.png")
    place(PACKAGING / "desktop/install.sh", folder)
    place(ROOT / "LICENSE", folder)
    collect_licences(folder / "licences")


def collect_licences(folder: Path) -> None:
    """Copy the licences of all packages; of one that brings no text, what it says of itself (METADATA)."""
    for package in distributions(path=[str(next(VENV.glob("lib/python*/site-packages")))]):
        if package.name.lower().replace("_", "-") in TOOLS:
            continue
        files = package.files or []
        texts = [f for f in files if LICENCE.match(f.name) and f.suffix != ".py"]
        for file in texts or [f for f in files if f.name == "METADATA"]:
            below = [part for part in file.parts[1:-1] if part != ".."]  # a package may hold others, with their own
            place(Path(str(file.locate())), folder.joinpath(package.name, *below))


def place(source: Path, folder: Path, name: str = "") -> None:
    """Copy a file into a folder, which is made if need be."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(source, folder / (name or source.name))


def paint(drawing: Path, side: int, out: Path) -> None:
    """Draw an SVG file as a square picture."""
    image = QImage(side, side, QImage.Format.Format_ARGB32)
    image.fill(0)
    painter = QPainter(image)
    QSvgRenderer(str(drawing)).render(painter)
    painter.end()
    out.parent.mkdir(parents=True, exist_ok=True)
    if not image.save(str(out)):
        raise OSError(f"{out} cannot be written")


def megabytes(path: Path) -> int:
    """Give the room a file or folder takes; one file under two names counts once."""
    sizes = {(s.st_dev, s.st_ino): s.st_size for s in (file.lstat() for file in (path, *path.rglob("*")))}
    return round(sum(sizes.values()) / 1e6)


def glibc(folder: Path) -> str:
    """Give the oldest system C library that all parts of the bundle run on."""
    parts = [file for file in folder.rglob("*") if file.is_file() and (".so" in file.name or os.access(file, os.X_OK))]
    minor = max(int(found) for file in parts for found in re.findall(rb"GLIBC_2\.(\d+)", file.read_bytes()))
    return f"2.{minor}"


if __name__ == "__main__":
    sys.exit(main())
