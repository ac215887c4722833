"""Compile the kernels ahead: `python packaging/kernels.py FOLDER`, for any x86-64 of level v3 (with AVX2).

What lies in `core/kernels` of a bundle or of an installed wheel is loaded instead of being compiled at first use, where
Python, numba and NumPy are of the versions it was compiled with. Commands are run on a small project, and every
preset's frames are decoded, to learn what is compiled.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
LEVEL = "x86-64-v3"
COMMANDS = (
    "demo P --scenario quick",
    "calibrate P --table --free-stations",
    "reconstruct P plane+00 --method polynomial --out P/points.ply",
    "orient P plane+00 --correct",
    "-c NETWORK P N",
    "adjust N",
    "-c SEQUENCES",
    "-c ANEW met/stripe-workbench/kernels",
)
CODE = {
    "NETWORK": """
import sys
from pathlib import Path
from core.model import Adjustment
from core.pipeline.runs import calibration_file
from core.project import load_archive, read_project, write_network
found = load_archive(calibration_file(read_project(Path(sys.argv[1])), "adjustment.npz"), Adjustment)
write_network(Path(sys.argv[2]), found.network)
""",
    "SEQUENCES": """
import numpy as np
from core.decode import DecodeOptions, decode
from core.errors import InputError
from core.patterns import PRESETS, SequenceSpec, brightness, light_sections
lines, (y, x) = 64, np.mgrid[:60, :80]
place = {"x": 2 + 0.75 * x + 0.02 * y, "y": 2 + y - 0.02 * x}
draw = np.random.default_rng(0)
lists = [SequenceSpec(name).patterns((lines, lines)) for name in PRESETS]
for patterns in [*lists, [p for axis in "xy" for p in light_sections(axis, lines)]]:
    for depth in (np.uint8, np.uint16):
        light = [brightness(p, place[getattr(p, "axis", None) or "x"]) for p in patterns]
        images = [(40 + 150 * i + draw.normal(0, 1, x.shape)).astype(depth) for i in light]
        for estimate in (False, True):
            try:
                decode(patterns, images, lines=(lines, lines), options=DecodeOptions(estimate=estimate))
            except InputError as told:  # not every sequence can be refined
                print(told)
""",
    # all of them in one order and by one process: names in a kernel count what was compiled before it
    "ANEW": """
import sys
from importlib import import_module
from pathlib import Path
from core.compiling.kept import read
for kernel in sorted(Path(sys.argv[1]).glob("*.kernel")):
    module, _, name = kernel.name.rpartition("-")[0].rpartition(".")
    getattr(import_module(module), name).compile(read(kernel).kinds)
""",
}


def main() -> int:
    """Run all; copy what was compiled."""
    out = Path(sys.argv[1])
    with tempfile.TemporaryDirectory(prefix="stripe-kernels-") as folder:
        work = Path(folder)
        own = {"NUMBA_CPU_NAME": LEVEL, "NUMBA_CPU_FEATURES": "", "PYTHONPATH": str(ROOT)}
        own["PYTHONHASHSEED"] = "1"  # the same sources give the same bytes; a frozen program would not heed it
        for command in COMMANDS:
            words = [CODE.get(word, word) for word in command.split()]
            whole = [sys.executable, *([] if words[0] == "-c" else ["-m", "core"]), *words]
            own["XDG_CACHE_HOME"] = str(work / ("made" if "ANEW" in command else "met"))
            done = subprocess.run(whole, cwd=work, env={**os.environ, **own}, capture_output=True, text=True)
            if done.returncode:
                print(f"kernels: {command} gave {done.returncode}:\n{done.stderr}", file=sys.stderr)
                return 1
        kernels = sorted((work / "made/stripe-workbench/kernels").glob("*.kernel"))
        size = sum(kernel.stat().st_size for kernel in kernels) / 1e6
        out.mkdir(parents=True, exist_ok=True)
        for kernel in kernels:
            shutil.copyfile(kernel, out / kernel.name)
            (out / kernel.name).chmod(0o644)  # whoever builds
    print(f"kernels: {len(kernels)} for {LEVEL}, {size:.1f} MB, in {out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
