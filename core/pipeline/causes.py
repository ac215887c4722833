"""What captures say of themselves, told where a result fails or is in doubt because of them: causes before effects."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from core.errors import AdjustmentError, InputError, NotRecognisedError, StripeError
from core.model import Concern

FIGURE = re.compile(r"\d+(?:\.\d+)? ?%?")
# notes that name the mistake, those that name a frame or a value, and those that name what must be looked at
SHARP = (
    re.compile("they fit|were exchanged|earlier|later|mirrored"),
    re.compile("claims|scale bar"),
    re.compile("projector's lines"),
)


def noted(notes: Mapping[str, Sequence[str]]) -> list[Concern]:
    """What captures say of themselves, alike ones together, those that name a mistake first."""
    by_text: dict[str, list[tuple[str, str]]] = {}
    for name, texts in notes.items():
        for text in texts:
            by_text.setdefault(FIGURE.sub("", text), []).append((name, text))
    concerns = []
    for entries in by_text.values():
        names = [name for name, _ in entries]
        told = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
        concerns.append(Concern("doubtful", f"{told}: {entries[0][1]}"))
    return sorted(concerns, key=lambda concern: _blunt(concern.text))


def _blunt(text: str) -> int:
    return next((k for k, sharp in enumerate(SHARP) if sharp.search(text)), len(SHARP))


@contextmanager
def because_of(notes: Mapping[str, Sequence[str]]) -> Iterator[None]:
    """Where work fails, say also what captures say of themselves: the cause, as a rule."""
    try:
        yield
    except StripeError as error:
        told = [c.text for c in noted(notes)]
        refused = isinstance(error, InputError)
        known = type(error) in (StripeError, AdjustmentError, InputError, NotRecognisedError)
        if not known or not told or (refused and _blunt(told[0]) == len(SHARP)):
            raise
        raise type(error)(error.where, error.seen, f"{error.remedy}. First see to this: {told[0]}") from None
