"""Prove the versions that pyproject.toml states: `python packaging/versions.py [--python 3.11 3.12] [--only lowest]`.

For each interpreter that is here, the lowest and the newest versions that the bounds admit are installed into an
environment of their own with uv, every module is imported, and a small project goes the road from simulation to report.
At the end `pip uninstall` has to leave nothing behind. With `--kernels` a wheel brings compiled kernels along, and none
may be compiled on the road. First of all, wheel and archive of the sources are built twice, by people whose files have
other rights, and have to be equal byte for byte; the wheel has to hold its bill of materials. Prints a table; the exit
code is 1 if anything failed.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
BILL = "sboms/stripe-workbench.cdx.json"
SHOWN = ("numpy", "scipy", "opencv-python-headless", "numba", "matplotlib", "PySide6-Essentials", "distributed")
IMPORTS = """
import importlib, pkgutil
for package in ("core", "stripe_gui"):
    for found in pkgutil.walk_packages(importlib.import_module(package).__path__, package + "."):
        if not found.name.endswith("__main__"):
            importlib.import_module(found.name)
"""
ROAD = (
    "simulate P --scenario quick",
    "decode P/captures/plane+00 --out P/d.npz",
    "calibrate P --method photogrammetric",
    "reconstruct P plane+00 --out P/points.ply",
    "evaluate P",
    "report P",
)


def main() -> int:
    """Try every pair and print the table."""
    parser = argparse.ArgumentParser(prog="versions.py", description=__doc__.splitlines()[0])
    parser.add_argument("--python", nargs="+", default=PYTHONS, metavar="X.Y")
    parser.add_argument("--only", choices=("lowest", "newest"))
    parser.add_argument("--kernels", action="store_true", help="try a wheel with kernels: some minutes more for each")
    options = parser.parse_args()
    uv = shutil.which("uv")
    if uv is None:
        print("versions: uv is missing; install it: pip install uv", file=sys.stderr)
        return 1
    failed = not equal_builds(uv)
    for python in options.python:
        found = subprocess.run([uv, "python", "find", "--no-python-downloads", python], capture_output=True, text=True)
        if found.returncode:
            print(f"{python}  not here, not tried")
            continue
        for which in [options.only] if options.only else ["lowest", "newest"]:
            with tempfile.TemporaryDirectory(prefix="stripe-versions-") as folder:
                outcome = trial(uv, found.stdout.strip(), which, Path(folder), options.kernels)
            print(f"{python} {which:7s} {outcome}", flush=True)
            failed |= "FAILED" in outcome
    return int(failed)


def equal_builds(uv: str) -> bool:
    """Build twice with one SOURCE_DATE_EPOCH; print and give whether the files are equal."""
    made = []
    for rights in (0o022, 0o077):
        with tempfile.TemporaryDirectory(prefix="stripe-versions-") as folder:
            before = os.umask(rights)
            try:
                copy(Path(folder) / "source")
                out = Path(folder) / "out"
                own = {**os.environ, "SOURCE_DATE_EPOCH": "1700000000"}
                build = [uv, "build", "-q", "--out-dir", str(out), str(Path(folder) / "source")]
                subprocess.run(build, env=own, check=True)
            finally:
                os.umask(before)
            wheels = [zipfile.ZipFile(path).namelist() for path in out.glob("*.whl")]
            billed = all(any(name.endswith(".dist-info/" + BILL) for name in names) for names in wheels)
            made.append({path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(out.glob("s*"))})
    differing = [name for name in made[0] if made[0][name] != made[1].get(name)]
    print(
        f"two builds  {'FAILED: ' + ', '.join(differing) + ' differ' if differing else 'equal: ' + ', '.join(made[0])}"
    )
    if not billed:
        print(f"two builds  FAILED: no {BILL} in the wheel")
    return bool(made[0]) and billed and not differing


def copy(source: Path) -> None:
    """Copy what a build needs, with the rights that files get here."""
    ignored = shutil.ignore_patterns(
        ".git", ".venv", "*.pyc", "__pycache__", "build", "dist", ".bundle-venv", "*.egg-info"
    )
    shutil.copytree(ROOT, source, ignore=ignored, copy_function=shutil.copyfile)


def trial(uv: str, interpreter: str, which: str, folder: Path, with_kernels: bool) -> str:
    """Install, import, go the road, remove; give what became of it."""
    source, home, kernels, wheels = (folder / name for name in ("source", "home", "kernels", "wheels"))
    copy(source)
    home.mkdir()
    environment = folder / "env"
    python = environment / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    own = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "VIRTUAL_ENV")}
    own |= {"QT_QPA_PLATFORM": "offscreen", "OPENBLAS_NUM_THREADS": "1", "XDG_CACHE_HOME": str(home)}
    resolution = {"lowest": "lowest-direct", "newest": "highest"}[which]
    install = [uv, "pip", "install", "-q", "--python", str(python)]
    rebuild = [
        [str(python), str(source / "packaging/kernels.py"), str(kernels)],
        [uv, "build", "-q", "--wheel", "--python", str(python), "--out-dir", str(wheels), str(source)],
        [*install, "--reinstall", "--no-deps", "--no-index", "--find-links", str(wheels), "stripe-workbench"],
    ]
    if with_kernels:
        kernels.mkdir()  # empty, until they are compiled
        own |= {"STRIPE_KERNELS": str(kernels)}
    steps = [
        [uv, "venv", "-q", "--seed", "--python", interpreter, str(environment)],
        [*install, "--resolution", resolution, f"{source}[gui,devices,batch]"],
        *(rebuild if with_kernels else ()),
        [str(python), "-c", IMPORTS],
        *([str(python), "-m", "core", *step.split()] for step in ROAD),
        [str(python), "-m", "pip", "uninstall", "-q", "-y", "stripe-workbench"],
    ]
    versions = ""
    for step in steps:
        if "uninstall" in step:
            versions = told(uv, python)
        done = subprocess.run(step, cwd=folder, env=own, capture_output=True, text=True)
        if done.returncode:
            last = (done.stderr or done.stdout).strip().splitlines() or ["no word"]
            return f"FAILED {' '.join(step[-6:])}: {last[-1][:300]}"
    left = [p for p in (environment / "lib").rglob("*") if p.parts[-1] in ("core", "stripe_gui", "stripe_resources")]
    left = [p for p in left if p.parent.name == "site-packages"]
    if with_kernels and (anew := sorted(path.name for path in home.glob("stripe-workbench/**/*.kernel"))):
        return f"FAILED {len(anew)} kernels were compiled though the wheel brings some, as {anew[0]}"
    return f"FAILED uninstall left {left[0]}" if left else f"ok  {versions}"


def told(uv: str, python: Path) -> str:
    """Name the versions that were installed."""
    text = subprocess.run([uv, "pip", "list", "--python", str(python)], capture_output=True, text=True).stdout
    found = dict(line.split()[:2] for line in text.splitlines() if len(line.split()) >= 2)
    return ", ".join(f"{name} {found[key]}" for name in SHOWN if (key := name.lower()) in found)


if __name__ == "__main__":
    sys.exit(main())
