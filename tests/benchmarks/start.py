"""How long `stripe-core --help` takes, beside an interpreter that does nothing."""

from __future__ import annotations

import subprocess
import sys

from tests.benchmarks.timing import Contestant, Row, race


def run() -> list[Row]:
    """Start both in turns."""

    def start(*arguments: str) -> Contestant:
        command = [sys.executable, *arguments]
        name = "python -c pass" if arguments[0] == "-c" else "stripe-core --help"
        return Contestant(name, lambda: subprocess.run(command, check=True, capture_output=True))

    return race("start", "--help", 1, "", [start("-c", "pass"), start("-m", "core", "--help")])
