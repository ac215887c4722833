"""`python -m tests.benchmarks.laboratories [NAME ...] [--seeds N] [--estimator NAME]`: another renderer.

Errors against what the renderer knows, over the sigmas that the program states: 1 is right. Base: largest error of a
device's position; points: a relief's depth, from one camera and one projector. No figure is asserted.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import tempfile
from pathlib import Path

from core.measure import ESTIMATORS
from tests.foreign.projects import LABORATORIES
from tests.foreign.scoring import Score, score


def row(name: str, seed: int, found: Score) -> str:
    """One line of Markdown."""
    worst = max(found.points.values(), key=lambda points: points.error_mm)
    parameters = " ".join(f"{device} {value:.2f}" for device, value in found.parameters.items())
    planes = " ".join(f"{value:.2f}" for value in found.planes.values())
    relief = f"{100 * worst.valid:.2f} % · {worst.error_mm:.3f} mm · {worst.ratio:.2f}"
    base = f"{found.base_mm:.3f}"
    farthest = f"{found.worst[0]} {found.worst[1]:.1f}"
    cells = (
        name,
        seed,
        found.verdict,
        found.image_points,
        parameters,
        farthest,
        base,
        relief,
        planes,
    )
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="tests.benchmarks.laboratories", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(LABORATORIES)}; all if unsaid")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--estimator", choices=ESTIMATORS, default="centroid", help="of dots' centres")
    options = parser.parse_args()
    print("| laboratory | seed | verdict | image points | error/σ of parameters | worst | base mm | relief | planes |")
    print("|---|---|---|---|---|---|---|---|---|", flush=True)
    for name in options.names or LABORATORIES:
        for seed in range(1, options.seeds + 1):
            with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
                laboratory = LABORATORIES[name](seed)
                project = laboratory.write(Path(folder) / "project")
                board = project / "testfield.csv"
                board.write_text(f"# estimator: {options.estimator}\n{board.read_text()}")
                found = score(laboratory, project)
            print(row(name, seed, found), flush=True)


if __name__ == "__main__":
    main()
