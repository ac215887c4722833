"""How long `stripe-core --help` takes, beside an interpreter that does nothing and one that imports numpy."""

from __future__ import annotations

import subprocess
import sys

from tests.benchmarks.timing import OURS, Contestant, Row, race


def run() -> list[Row]:
    """Start them in turns."""

    def told(output: str) -> str:
        assert "reconstruct" in output, "the commands are not listed"
        return f"{len(output.splitlines())} lines"

    return race(
        "start",
        "--help",
        1,
        "",
        [
            Contestant(OURS, lambda: _output("-m", "core", "--help"), told),
            Contestant("python -c pass", lambda: _output("-c", "pass")),
            Contestant("python -c 'import numpy'", lambda: _output("-c", "import numpy")),
        ],
    )


def _output(*arguments: str) -> str:
    return subprocess.run([sys.executable, *arguments], check=True, capture_output=True, text=True).stdout
