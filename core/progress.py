"""How long work reports itself and is cancelled."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeVar

from core.errors import Cancelled
from core.lazy import dataclass

T = TypeVar("T")
Report = Callable[[float, str], None]
Course = Callable[[str, int, float], None]


def _quiet(fraction: float, message: str) -> None:
    return None


_latest: tuple[Report, float] = (_quiet, 0.0)  # the channel last used, until its end, and how far it was


def announce(message: str) -> None:
    """Say to whoever waits for the present work what nobody can foresee, such as that something is compiled first."""
    report, fraction = _latest
    report(fraction, message)


@dataclass(frozen=True)
class Progress:
    """A channel from long work to whoever waits for it.

    `report(fraction, message)` receives the fraction done, 0 to 1. `cancelled()` is asked between steps; when it says
    yes the work stops with `Cancelled` at the next `check`, having written nothing half. `course(name, step, value)`
    receives a figure that shows where iterations are going; step 0 begins them anew.

    Examples
    --------
    >>> seen = []
    >>> progress = Progress(report=lambda fraction, message: seen.append((round(fraction, 2), message)))
    >>> for name in progress.part(0.5, 1.0).over(["a", "b"], "decoding {}"):
    ...     pass
    >>> seen
    [(0.5, 'decoding a'), (0.75, 'decoding b'), (1.0, 'decoding b')]
    """

    report: Report = _quiet
    cancelled: Callable[[], bool] = lambda: False
    course: Course = lambda name, step, value: None

    def check(self) -> None:
        """Raise `Cancelled` if the user asked to stop."""
        if self.cancelled():
            raise Cancelled

    def __call__(self, fraction: float, message: str = "") -> None:
        """Report a fraction done (0 to 1), after looking whether to stop."""
        global _latest
        self.check()
        self.report(fraction, message)
        if self.report is not _quiet:
            _latest = (self.report, fraction) if fraction < 1 else (_quiet, 0.0)

    def part(self, start: float, stop: float) -> Progress:
        """Give the channel for a part of the work that runs from `start` to `stop` of the whole."""
        return Progress(
            lambda f, message: self.report(start + f * (stop - start), message), self.cancelled, self.course
        )

    def parts(self, count: int) -> list[Progress]:
        """Give the channels for as many parts of the work, all equally long."""
        return [self.part(k / count, (k + 1) / count) for k in range(count)]

    def quiet(self) -> Progress:
        """Give a channel that tells nothing and still stops the work: for parts too short to be reported."""
        return Progress(cancelled=self.cancelled)

    def over(self, items: Iterable[T], message: str = "{}") -> Iterator[T]:
        """Iterate over items, reporting before each one; `message` is formatted with the item."""
        sequence: Sequence[T] = list(items)
        text = ""
        for i, item in enumerate(sequence):
            text = message.format(item)
            self(i / len(sequence), text)
            yield item
        self(1.0, text)


SILENT = Progress()
