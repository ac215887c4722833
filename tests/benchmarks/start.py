"""How long commands take from their start, beside interpreters that do nothing or import what every command needs."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from core.demo import run_demo
from core.project import write_network
from tests.benchmarks.networks import task
from tests.benchmarks.timing import OURS, Contestant, Row, race

IMPORTS = "import numpy, cv2, numba"
STATIONS = 21


def run() -> list[Row]:
    """Start them in turns."""

    def told(output: str) -> str:
        assert "reconstruct" in output, "the commands are not listed"
        return f"{len(output.splitlines())} lines"

    rows = _beside("--help", ["pass", "import numpy"], told, "--help")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        project = str(out / "demo")
        run_demo(out / "demo")
        write_network(out / "network", task(STATIONS).network)
        for name, arguments in {
            "decode": [f"{project}/captures/plane+00", "--out", f"{folder}/phase.npz"],
            "reconstruct": [project, "object-sphere", "--out", f"{folder}/points.ply"],
            f"adjust, {STATIONS} stations": [f"{folder}/network"],
            "evaluate, 4 planes": [project],
            "report": [project],
            "calibrate again": [project],
        }.items():
            rows += _beside(name, [IMPORTS], lambda output: "", name.split()[0].rstrip(","), *arguments)
    return rows


def _beside(name: str, others: list[str], right: Callable[[str], str], *arguments: str) -> list[Row]:
    contestants = [Contestant(OURS, lambda: _output("-m", "core", *arguments), right)]
    contestants += [Contestant(f"python -c {code!r}", lambda code=code: _output("-c", code)) for code in others]
    return race("start", name, 1, "", contestants)


def _output(*arguments: str) -> str:
    return subprocess.run([sys.executable, *arguments], check=True, capture_output=True, text=True).stdout
