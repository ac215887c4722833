"""A verdict and what was left out, as commands print them: first of all, and red where it failed."""

from __future__ import annotations

import sys
from typing import Any

COLOURS = {"failed": "\033[31m", "doubtful": "\033[33m", "passed": "\033[32m"}
MOST = 12  # lines of what was left out


def print_verdict(name: str, verdict: dict[str, Any]) -> None:
    """Print one verdict with its sentences."""
    state = verdict["state"]
    begin, end = (COLOURS[state], "\033[0m") if sys.stdout.isatty() else ("", "")
    print(f"{begin}{name}: {state.upper() if state == 'failed' else state}{end}")
    for text in verdict["because"]:
        print(f"  {text}")


def print_left_out(entries: list[dict[str, Any]]) -> None:
    """Print what was left out, the greatest share first."""
    if not entries:
        return
    print("left out:")
    ordered = sorted(entries, key=lambda e: -(e["points"] / e["of"] if e["of"] else 2.0))
    for entry in ordered[:MOST]:
        share = (
            f"{entry['points']} of {entry['of']} points ({entry['points'] / entry['of']:.0%})" if entry["of"] else "all"
        )
        print(f"  {entry['capture']}: {share}: {entry['because']}")
    if len(ordered) > MOST:
        rest = ordered[MOST:]
        print(f"  and {sum(e['points'] for e in rest)} points more, see --json")
