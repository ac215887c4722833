"""Many captures at once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from core.cli.arguments import Commands, Options
from core.errors import StripeError
from core.progress import Progress


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    sub = commands.add_on_project("batch", _batch, "decode, reconstruct and evaluate many captures on worker processes")
    sub.add_argument("captures", nargs="*", metavar="CAPTURE", help="names or folders; all of the project if unsaid")
    sub.add_argument("--out", type=Path, required=True, metavar="DIR", help="a second run leaves what is up to date")
    sub.add_argument("--do", default="decode,reconstruct,evaluate", metavar="STEPS", help="of these (default: all)")
    sub.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler that is running; default: this machine")
    sub.add_argument("--workers", type=int, metavar="N", help="worker processes to start (default: one per processor)")


def _batch(options: Options, progress: Progress) -> dict[str, Any]:
    from core.batch import run_batch

    report = run_batch(
        options.project,
        options.out,
        options.captures,
        steps=options.do.split(","),
        scheduler=options.scheduler,
        workers=options.workers,
        progress=progress,
    )
    print(f"{report.count('done')} done, {report.count('left')} up to date, {report.count('failed')} failed")
    if bad := [outcome for outcome in report.outcomes if outcome.state == "failed"]:
        raise StripeError(bad[0].capture, bad[0].error, f"see all in {options.out / 'summary.json'} and run it again")
    return report.figures()
