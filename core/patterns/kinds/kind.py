"""What the program must know of a kind of pattern."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from core.fields import Fields
from core.lazy import dataclass

Axis = Literal["x", "y"]
Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
LONGEST = 10.0  # stripes over the lines of the projector: of longer ones hardly anything is seen
Use = Literal["level", "code", "phase", "section", "word"]


class Pattern(Protocol):
    """What a projector is to show: a frozen dataclass of one of the registered kinds.

    One that varies along an axis has an attribute `axis`; the others light the whole field evenly.
    """

    @property
    def kind(self) -> str:
        """The name it has in capture.json."""
        ...


def never(*_pattern: Any) -> None:
    """Say that no pattern of a kind is concerned."""
    return


def fields_of(pattern: Any) -> dict[str, Any]:
    """Give the fields of a pattern as capture.json holds them."""
    return asdict(pattern)


@dataclass(frozen=True)
class Kind:
    """A kind of pattern."""

    #: what a decoder can do with its frames: "level" lights the whole field evenly; "code" is a bit of a number,
    #: "phase" a step of a wave, "section" a lit line, "word" any lines that only a look-up tells apart
    use: Use
    read: Callable[[Fields], Any]  #: from the fields of capture.json to the pattern; raises `InputError`
    light: Callable[[Any, Numbers], Array]  #: how bright (0 to 1) the pattern makes lines, given as whole numbers
    words: Callable[[Any, str], str]  #: the pattern in words; is given "columns" or "rows", which it runs across
    #: why a projector of black and white cannot show a pattern, and what to use instead; None if it can
    grey: Callable[[Any], str | None] = never
    #: lines in one cycle of its finest stripes; None where it has no regular ones
    cycle: Callable[[Any], float | None] = never
    #: what of a pattern no projector of so many lines can show, and the remedy; None if it can
    beyond: Callable[[Any, int], tuple[str, str] | None] = never
    write: Callable[[Any], dict[str, Any]] = fields_of  #: the fields as capture.json holds them, without the kind


def read_axis(fields: Fields) -> Axis:
    """Read the axis that a pattern varies along."""
    axis: Axis = fields.text("axis", among=("x", "y"))
    return axis
