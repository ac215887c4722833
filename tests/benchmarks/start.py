"""How long commands take from their start, beside interpreters that do nothing or import what every command needs."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from core.project import write_network
from tests.benchmarks.networks import task
from tests.benchmarks.timing import OURS, Contestant, Row, race

IMPORTS = "import numpy, cv2, numba"
STATIONS = 21
SLOW = ("demo", "report", "calibrate")  # seconds a call: the first one counts


def run() -> list[Row]:
    """Start them in turns."""

    def told(output: str) -> str:
        assert "reconstruct" in output, "the commands are not listed"
        return f"{len(output.splitlines())} lines"

    rows = _beside("--help", ["pass", "import numpy"], told, "--help")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        project = str(out / "demo")
        write_network(out / "network", task(STATIONS).network)
        commands = {
            "demo, 37 captures": [project],  # what all that follows work on
            "decode": [f"{project}/captures/plane+00", "--out", f"{folder}/phase.npz"],
            "reconstruct": [project, "object-sphere", "--out", f"{folder}/points.ply"],
            f"adjust, {STATIONS} stations": [f"{folder}/network"],
            "evaluate, 4 planes": [project],
            "report": [project],
            "calibrate again": [project],
            "calibrate, 31 captures": [project],
        }
        for name, arguments in commands.items():
            fresh = out / "demo/results" if name.startswith("calibrate,") else None
            command = name.split()[0].rstrip(",")
            rows += _beside(name, [IMPORTS], lambda output: "", command, *arguments, fresh=fresh)
    return rows


def _beside(
    name: str, others: list[str], right: Callable[[str], str], *arguments: str, fresh: Path | None = None
) -> list[Row]:
    """One command beside interpreters; slow ones run once. The folder `fresh` is removed before every call."""

    def work(_: None = None) -> str:
        return _output("-m", "core", *arguments)

    def prepare() -> None:
        if fresh:
            shutil.rmtree(fresh, ignore_errors=True)

    once = arguments[0] in SLOW
    contestants = [Contestant(OURS, work, right, prepare, warm=not once)]
    contestants += [Contestant(f"python -c {code!r}", lambda code=code: _output("-c", code)) for code in others]
    return race("start", name, 1, "", contestants)


def _output(*arguments: str) -> str:
    # as it is installed: an interpreter that keeps no bytecode would compile our sources, and nobody else's
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command = [sys.executable, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout
