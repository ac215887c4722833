"""Whether a report is as it was written and signed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from core.cli.arguments import Commands, Options
from core.errors import StripeError
from core.progress import Progress


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    sub = commands.add("verify-report", _verify, "is the signed report as it was signed")
    sub.add_argument("file", type=Path, metavar="FILE", help="report.html or report.pdf")


def _verify(options: Options, progress: Progress) -> dict[str, Any]:
    from core.report.seal import verify

    seal = verify(options.file)
    print(f"{options.file}: {seal.words}")
    print(f"sha256 {seal.digest}")
    if not seal.intact:
        raise StripeError(options.file, "is not as it was written", "take the report from where it was signed")
    return {"intact": True, "signed": bool(seal.operator), "operator": seal.operator, "date": seal.date}
