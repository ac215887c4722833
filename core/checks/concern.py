"""A concern, and the verdict that several make."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from core.model import Verdict

LEVEL = 0.001  # chance that a test, on its own, calls a sound result doubtful


@dataclass(frozen=True)
class Concern:
    """What speaks against a result: how much, and a sentence with figure, probable cause and remedy."""

    state: Literal["doubtful", "failed"]
    text: str


def verdict_of(concerns: Iterable[Concern], sound: Iterable[str] = ()) -> Verdict:
    """Give the verdict of all concerns, the worst first; `sound` says what speaks for a result that has none.

    Examples
    --------
    >>> verdict_of([Concern("doubtful", "a"), Concern("failed", "b")])
    Verdict(state='failed', because=('b', 'a'))
    """
    found = list(dict.fromkeys(concerns))
    if not found:
        return Verdict("passed", tuple(sound))
    failed = [c.text for c in found if c.state == "failed"]
    doubtful = [c.text for c in found if c.state == "doubtful"]
    return Verdict("failed" if failed else "doubtful", (*failed, *doubtful))
