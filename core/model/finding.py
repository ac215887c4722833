"""What is said of captures, checks and results: notes, findings, and verdicts with what had no part."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass

Level = Literal["good", "warning", "bad"]
LEVELS: dict[Level, str] = {"bad": "wrong", "warning": "could be better", "good": "good"}  # the worst first
TITLES = {
    "identity": "patterns",
    "modulation": "stripes",
    "exposure": "exposure",
    "saturation": "saturation",
    "lamp": "lamp",
    "movement": "movement",
    "settle": "settle time",
    "linearity": "linearity",
    "focus": "focus",
    "order": "order",
    "orientation": "orientation",
    "visibility": "working depth",
}
PICTURES = {
    "exposure": "white, share of the range",
    "linearity": "half light, seen as",
    "focus": "modulation of the finest stripes",
    "order": "contradiction, white = 1",
    "orientation": "projector column",
}
AXES = {
    "settle": ("delay after the acknowledgement [ms]", "light, white = 1"),
    "linearity": ("light meant", "light seen"),
    "visibility": ("position of the plate [mm]", "modulation [grey values]"),
}
Names = Literal["mistake", "value", "projector", "capture", "light", "pick", "mended"]
SHARPEST: tuple[Names, ...] = ("mistake", "value", "projector")  # what points at a cause, the plainest first
State = Literal["passed", "doubtful", "failed"]


@dataclass(frozen=True)
class Finding:
    """One check's result.

    `level` good: nothing to do; warning: the capture is right but could be better; bad: frames do not show what they
    claim. `shots` are the numbers of the shots concerned, to be taken again where the level is bad. `picture` shows the
    matter over the image, NaN where there is nothing to show; `curve` is a list of points (x, y); `check` says of what.
    `names` is what the text names, see `Note`. In words: `title`, `level_words`, what the picture shows, and the
    curve's `axes`.
    """

    check: str
    level: Level
    text: str
    figures: Mapping[str, float] = field(default_factory=dict)
    shots: tuple[int, ...] = ()
    picture: NDArray[np.float64] | None = field(default=None, compare=False, repr=False)
    curve: tuple[tuple[float, float], ...] = ()
    names: Names = "capture"

    @property
    def title(self) -> str:
        """What was checked."""
        return TITLES.get(self.check, self.check)

    @property
    def level_words(self) -> str:
        """The level in words."""
        return LEVELS[self.level]

    @property
    def picture_label(self) -> str:
        """What the picture's values are."""
        return PICTURES.get(self.check, "")

    @property
    def axes(self) -> tuple[str, str]:
        """Names of the curve's axes, units included."""
        return AXES.get(self.check, ("", ""))

    def as_dict(self) -> dict[str, Any]:
        """Give the finding as capture.json holds it."""
        return {"check": self.check, "level": self.level, "text": self.text, "figures": dict(self.figures)}


class Note(str):
    """A sentence that says what is wrong with a capture, and the remedy.

    It `names` a mistake in storing or describing frames ("mistake"), a frame or a value that is wrong ("value"), the
    projector's size or patterns ("projector"), or nothing closer than the capture ("capture"). Three kinds are no
    fault everywhere: too little light for the noise is none of a board between its measured targets ("light"), a pick
    that was not used is none where the others tell as well ("pick"), and what was found and taken out leaves none
    ("mended").
    """

    names: Names

    def __new__(cls, text: str, names: Names = "capture") -> Self:
        """Make a note of a text."""
        note = super().__new__(cls, text)
        note.names = names
        return note


def named_by(note: str) -> Names:
    """What a note names; a plain text, as other programs' parts may give it, names nothing closer than the capture."""
    return note.names if isinstance(note, Note) else "capture"


def bluntness(note: str) -> int:
    """Order notes: those that point at a cause first."""
    names = named_by(note)
    return SHARPEST.index(names) if names in SHARPEST else len(SHARPEST)


def points_at_a_cause(note: str) -> bool:
    """Whether a note names something to be corrected."""
    return named_by(note) in SHARPEST


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
    #: what alone it tells of: a plane's capture, "blunders", "held", "captures", "rigid"; of lengths "board", "plates"
    about: str = ""


UNJUDGED = Verdict("doubtful", ("not judged: made by another version of the program",))


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
