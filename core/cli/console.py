"""What a command shows while it works."""

from __future__ import annotations

import os
import sys
import time
from typing import Any, TextIO


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
