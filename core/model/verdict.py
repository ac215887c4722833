"""What is to be thought of a result."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

State = Literal["passed", "doubtful", "failed"]


@dataclass(frozen=True)
class Verdict:
    """Whether a result can be trusted, and the sentences that say why or why not."""

    state: State = "passed"
    because: tuple[str, ...] = ()
