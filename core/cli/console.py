"""What a command shows while it works, and its verdicts."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from core.model import Project

COLOURS = {"failed": "\033[31m", "doubtful": "\033[33m", "passed": "\033[32m"}
MOST = 12  # lines of what was left out


class Console:
    """Progress on stderr: one line rewritten on a terminal; elsewhere a line now and then.

    Where a program reads stderr, a refusal has to be the only line there: progress waits half a minute.
    """

    def __init__(self, started: float) -> None:
        self.terminal = sys.stderr.isatty()
        self.due = started + (0.2 if self.terminal else 30.0)

    def report(self, fraction: float, message: str) -> None:
        """Show how far the work is, if it is time to."""
        now = time.monotonic()
        if now >= self.due:
            self.due = now + (0.1 if self.terminal else 10.0)
            start, end = ("\r\033[K", "") if self.terminal else ("", "\n")
            print(f"{start}{fraction:4.0%}  {message}", end=end, file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Take the line away again."""
        if self.terminal:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


class Unread:
    """Standard output that goes on where nobody reads it any more, for work whose figures are still to be written."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write, to nowhere if the reader has gone."""
        try:
            return self.stream.write(text)
        except BrokenPipeError:
            self._leave()
            return len(text)

    def flush(self) -> None:
        """Bring out what is written."""
        try:
            self.stream.flush()
        except BrokenPipeError:
            self._leave()

    def _leave(self) -> None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), self.stream.fileno())

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def print_verdict(name: str, verdict: dict[str, Any]) -> None:
    """Print one verdict with its sentences."""
    state = verdict["state"]
    begin, end = (COLOURS[state], "\033[0m") if sys.stdout.isatty() else ("", "")
    print(f"{begin}{name}: {state.upper() if state == 'failed' else state}{end}")
    for text in verdict["because"]:
        print(f"  {text}")


def print_plane_verdicts(planes: list[dict[str, Any]], several: bool) -> None:
    """Print the verdicts on planes, with the devices where there are several."""
    for plane in planes:
        pair = f", {plane['camera']} with {plane['projector']}" if several else ""
        print_verdict(f"{plane['capture']}{pair}, {plane['method']}", plane["verdict"])


def tell_outdated(project: Project, words: Sequence[str]) -> None:
    """Say in a line on stderr if what was used does not follow from what the project holds."""
    if words:
        told = f"{'; '.join(words)}; run `stripe-core update {project.path}`"
        print(f"stripe-core: made from something else than the project holds now: {told}", file=sys.stderr)


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
