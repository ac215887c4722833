"""`python -m tests.benchmarks [PART ...]`: all contestants in one run; a table and plots in bench-results/.

Peers are installed into .bench-venv and work in processes of their own; every part runs in a fresh process. No time is
asserted. Exit code 1 if an answer of ours was wrong or a part failed.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

from tests.benchmarks import timing
from tests.benchmarks.environments import ROOT, install_peers
from tests.benchmarks.machine import load, machine
from tests.benchmarks.results import update_readme, write_results
from tests.benchmarks.timing import OURS, Row, say

PARTS = (
    "decode",
    "intersection",
    "cloud",
    "adjustment",
    "measurement",
    "opening",
    "start",
    "window",
    "rendering",
    "batch",
)
RESULTS = ROOT / "bench-results"


def main() -> int:
    """Install the peers, run the parts asked for, write what was measured."""
    parser = argparse.ArgumentParser(prog="tests.benchmarks", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; all if unsaid")
    parser.add_argument("--quick", action="store_true", help="fewer rounds, and small sizes only")
    parser.add_argument("--no-peers", action="store_true", help="install nothing; take the peers that are there")
    parser.add_argument("--readme", action="store_true", help="run nothing: put the last run's table into README.md")
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)  # a part's own process
    options = parser.parse_args()
    if unknown := set(options.parts) - set(PARTS):
        parser.error(f"no part {sorted(unknown)[0]!r}: choose among {', '.join(PARTS)}")
    if options.readme:
        update_readme(ROOT / "README.md", RESULTS / "table.json")
        return 0
    if options.quick:
        timing.EFFORT.seconds, timing.EFFORT.rounds, timing.EFFORT.quick = 0.3, 5, True
    if options.into:
        rows = importlib.import_module(f"tests.benchmarks.{options.parts[0]}").run()
        options.into.write_text(json.dumps([asdict(row) for row in rows]))
        return 0
    if not options.no_peers:
        install_peers()
    started, busy = time.monotonic(), load()
    rows: list[Row] = []
    for part in options.parts or PARTS:
        rows += _run(part, options.quick)
        seconds = time.monotonic() - started
        about = {**machine(), "load": f"{busy:.1f} at the start", "took": f"{seconds:.0f} s"}
        write_results(RESULTS, rows, about, seconds)  # after every part: a run may be stopped
    from tests.benchmarks.plots import write_plots

    write_plots(RESULTS, rows)
    say(f"{seconds:.0f} s; {RESULTS}/table.md, table.json and plots")
    wrong = [row for row in rows if row.failed and row.contestant.startswith(OURS)]
    for row in wrong:
        say(f"{row.part}, {row.size}: {row.right}")
    return 1 if wrong else 0


def _run(part: str, quick: bool) -> list[Row]:
    """Run a part in a process of its own, so that none finds another's memory or threads; give its rows."""
    say(part)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "rows.json"
        command = [sys.executable, "-m", "tests.benchmarks", part, "--into", str(path), *(["--quick"] if quick else [])]
        # the linear algebra's own threads would only spin beside ours
        done = subprocess.run(command, cwd=ROOT, check=False, env={"OPENBLAS_NUM_THREADS": "1", **os.environ})
        if done.returncode == 0:
            return [Row(**entry) for entry in json.loads(path.read_text())]
    nan, reason = float("nan"), f"the part failed, exit code {done.returncode}"
    say(f"  {reason}")
    return [Row(part, "", 0, "", OURS, nan, nan, 0, nan, "", nan, reason, failed=True)]


if __name__ == "__main__":
    sys.exit(main())
