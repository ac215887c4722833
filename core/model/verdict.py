"""What is to be thought of a result, and what had no part in it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from core.lazy import dataclass

State = Literal["passed", "doubtful", "failed"]


@dataclass(frozen=True)
class Verdict:
    """Whether a result can be trusted, and the sentences that say why or why not."""

    state: State = "passed"
    because: tuple[str, ...] = ()


@dataclass(frozen=True)
class LeftOut:
    """Points of a capture, out of `of`, that had no part in a result, and why."""

    capture: str
    points: int
    of: int
    because: str


@dataclass(frozen=True)
class Concern:
    """What speaks against a result: how much, and a sentence with figure, probable cause and remedy."""

    state: Literal["doubtful", "failed"]
    text: str
    about: str = ""  #: what alone it tells of: a plane's capture, "blunders", or of lengths "board" or "plates"


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
