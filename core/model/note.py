"""What a capture says of itself: a sentence, and what that sentence names."""

from __future__ import annotations

from typing import Literal, Self

Names = Literal["mistake", "value", "projector", "capture", "light", "pick"]
SHARPEST: tuple[Names, ...] = ("mistake", "value", "projector")  # what points at a cause, the plainest first


class Note(str):
    """A sentence that says what is wrong with a capture, and the remedy.

    It `names` a mistake in storing or describing frames ("mistake"), a frame or a value that is wrong ("value"), the
    projector's size or patterns ("projector"), or nothing closer than the capture ("capture"). Two kinds are no fault
    everywhere: too little light for the noise is none of a board between its measured targets ("light"), and a pick
    that was not used is none where the others tell as well ("pick").
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
