"""How long commands take from their start, beside interpreters that do nothing or import what every command needs.

`python -m tests.benchmarks.start [PROJECT]` prints a table of their processor time, which other work on the machine
changes less than what the clock shows, and of its ratio to those imports. PROJECT, a finished demo, is copied; without
it one is made.
"""

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
        for name, arguments in _commands(out).items():
            fresh = out / "demo/results" if name.startswith("calibrate,") else None
            command = name.split()[0].rstrip(",")
            rows += _beside(name, [IMPORTS], lambda output: "", command, *arguments, fresh=fresh)
    return rows


def _commands(out: Path) -> dict[str, list[str]]:
    """Give the arguments of every command, by what it does; the first makes what all that follow work on."""
    project = str(out / "demo")
    write_network(out / "network", task(STATIONS).network)
    return {
        "demo, 37 captures": [project],
        "decode": [f"{project}/captures/plane+00", "--out", f"{out}/phase.npz"],
        "reconstruct": [project, "object-sphere", "--out", f"{out}/points.ply"],
        f"adjust, {STATIONS} stations": [f"{out}/network"],
        "evaluate, 4 planes": [project],
        "report": [project],
        "calibrate again": [project],
        "calibrate, 31 captures": [project],
    }


def main() -> None:
    """Print the table: the least of three calls after one that is not counted, of slow commands the only one."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        if len(sys.argv) > 1:
            shutil.copytree(sys.argv[1], out / "demo")
        print("| command | CPU seconds | times the imports |\n|---|---|---|")
        for name, arguments in _commands(out).items():
            if name.startswith("demo") and len(sys.argv) > 1:
                continue
            seconds: dict[bool, list[float]] = {True: [], False: []}
            once = name.startswith(("demo", "report", "calibrate,"))
            for counted in [True] if once else [False, True, True, True]:
                for ours in (False, True):
                    if name.startswith("calibrate,"):
                        shutil.rmtree(out / "demo/results", ignore_errors=True)
                    before = os.times()
                    _output(*(["-m", "core", name.split()[0].rstrip(","), *arguments] if ours else ["-c", IMPORTS]))
                    after = os.times()
                    spent = after.children_user + after.children_system - before.children_user - before.children_system
                    if counted:
                        seconds[ours].append(spent)
            ours, imports = min(seconds[True]), min(seconds[False])
            print(f"| {name} | {ours:.2f} | {ours / imports:.1f} |", flush=True)


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


if __name__ == "__main__":
    main()
