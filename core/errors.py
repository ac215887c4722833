"""What can go wrong, told so that the reader knows what to do.

Every error names the place (a file, a field, a device), what was seen there and the remedy, in one line.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

LONGEST = 800  # characters of what was seen that a message repeats
MANY = 12  # names are not listed in a message: the likeliest are


def choose_among(name: str, names: Collection[str]) -> str:
    """Say as a remedy which names there are; of many, those most like the one that is unknown."""
    if not names:
        return "there is none yet"
    if len(names) <= MANY:
        return f"choose among {', '.join(names)}"
    from difflib import get_close_matches

    near = get_close_matches(name, names, 5, 0.5) or list(names)[:5]
    return f"choose among {', '.join(near)} and others, {len(names)} in all"


def listed(names: Sequence[object], most: int = 8) -> str:
    """Join names for a message, the first few of many."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(map(str, names[:most])) + more


class StripeError(Exception):
    """Anything this program refuses or fails at.

    Parameters
    ----------
    where : str
        The file, field, target or device concerned.
    seen : str
        What was found there, the value included.
    remedy : str
        What the user can do about it.
    """

    exit_code = 1

    def __init__(self, where: object, seen: str, remedy: str) -> None:
        self.where, self.seen, self.remedy = str(where), seen, remedy
        super().__init__(self.where, seen, remedy)

    def __str__(self) -> str:
        return f"{_printable(self.where)}: {_shortened(_printable(self.seen))}; {_printable(self.remedy)}"


def _printable(text: str) -> str:
    """A name or value from a file may hold anything: nothing of it may move the cursor or colour the screen."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text.replace("\n", " "))


def _shortened(text: str) -> str:
    """A file's value may be of any length."""
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 100]} ... {text[-95:]}"


class InputError(StripeError):
    """A file or an argument that cannot be used; nothing has been written."""

    exit_code = 2


class BusyError(StripeError):
    """A project that another program is writing into."""


class NotRecognisedError(InputError):
    """A board that an image does not show well enough; other images may."""


class TooLittleSeenError(InputError):
    """A capture that shows one camera and projector too little to tell of a movement; others may see more."""


class NoCoordinateError(InputError):
    """Decoded frames without a projector coordinate that points follow from; another method may do without it."""


class TooFewPointsError(StripeError):
    """Points that no plane follows from; another method may give more."""


class AdjustmentError(StripeError):
    """A network that cannot be solved, or an adjustment that does not converge."""


class DeviceError(StripeError):
    """A projector or camera that does not do what it was asked."""


class NotThereError(DeviceError):
    """A device that cannot be opened where it is said to be: nothing has been done yet."""

    exit_code = 2


class PatternRefusedError(DeviceError):
    """A pattern that this projector cannot show."""


class Cancelled(StripeError):  # noqa: N818  a wish, not a fault
    """The user stopped the work."""

    def __init__(self, what: str = "the work") -> None:
        super().__init__(what, "cancelled", "start it again when you want the result")
