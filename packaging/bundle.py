"""Build the bundle: `.bundle-venv/bin/python packaging/bundle.py [--quick]` (`make bundle`).

One folder, dist/stripe-workbench, runs on a machine without Python: `stripe-gui`, `stripe-core`, what they need and its
licences, kernels compiled ahead, a desktop entry with icons and AppStream data below share, and a script that installs
them. `stripe.spec` says what goes in, out of the environment this runs in. At the end the bundle is tried.
"""

from __future__ import annotations

import argparse
import compileall
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from py_compile import PycInvalidationMode

from PySide6.QtGui import QImage, QPainter
from PySide6.QtSvg import QSvgRenderer

ROOT = Path(__file__).parents[1]
PACKAGING = ROOT / "packaging"
BUILD = ROOT / "build/bundle"
DIST = ROOT / "dist"
ID = "org.stripe_workbench.StripeWorkbench"
ICON_PX = (48, 128, 256)  # for desktops that do not draw SVG; 48 is the size the icon theme specification asks for


def main() -> int:
    """Build and try; give the exit code of the trial."""
    parser = argparse.ArgumentParser(prog="bundle.py", description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="try it without the reference experiment")
    options = parser.parse_args()
    started = time.monotonic()
    folder = assemble()
    complete(folder)
    seconds = time.monotonic() - started
    print(f"bundle: {folder}: {megabytes(folder)} MB in {seconds:.0f} s; needs glibc {glibc(folder)} or newer")
    for part in sorted((folder / "_internal").iterdir(), key=megabytes)[:-9:-1]:
        print(f"bundle: {megabytes(part):5d} MB  {part.name}")
    check = [sys.executable, str(PACKAGING / "check_bundle.py"), str(folder)]
    return subprocess.run([*check, *(["--quick"] if options.quick else [])], check=False).returncode


def assemble() -> Path:
    """Let PyInstaller gather modules, libraries and licences; give the bundle's folder."""
    print("bundle: putting it together", flush=True)
    command = [sys.executable, "-m", "PyInstaller", "--noconfirm", "--clean", "--log-level", "ERROR"]
    places = ["--distpath", str(DIST), "--workpath", str(BUILD)]
    # the same sources give the same bytes: hashes that do not differ from run to run, and no clock
    fixed = {"PYTHONHASHSEED": "1", "SOURCE_DATE_EPOCH": os.environ.get("SOURCE_DATE_EPOCH", "315532800")}
    own = {**os.environ, **fixed, "PYTHONDONTWRITEBYTECODE": "1", "PYINSTALLER_CONFIG_DIR": str(BUILD / "cache")}
    subprocess.run([*command, *places, "stripe.spec"], cwd=PACKAGING, env=own, check=True)
    return DIST / "stripe-workbench"


def complete(folder: Path) -> None:
    """Add the window's name for the program, the desktop's files and the script that installs all."""
    (folder / "stripe-gui").hardlink_to(folder / "stripe-core")
    # the core's sources lie in the bundle: compiled beside them, whatever the clock says after copying
    inside = folder / "_internal"
    how = {"stripdir": inside, "invalidation_mode": PycInvalidationMode.UNCHECKED_HASH}  # nor where it was built
    compileall.compile_dir(inside / "core", quiet=1, **how)
    subprocess.run([sys.executable, str(PACKAGING / "kernels.py"), str(inside / "core/kernels")], check=True)
    share = folder / "share"
    place(PACKAGING / f"desktop/{ID}.desktop", share / "applications")
    place(PACKAGING / f"desktop/{ID}.metainfo.xml", share / "metainfo")
    drawing = ROOT / "resources/icons/program.svg"
    place(drawing, share / "icons/hicolor/scalable/apps", f"{ID}.svg")
    for side in ICON_PX:
        paint(drawing, side, share / f"icons/hicolor/{side}x{side}/apps/{ID}.png")
    place(PACKAGING / "desktop/install.sh", folder)
    place(ROOT / "LICENSE", folder)


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
