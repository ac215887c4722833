"""What is to be thought of a result, and what had no part in it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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
