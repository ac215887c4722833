"""What a projector and a camera promise to whoever captures with them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

from numpy.typing import NDArray

from core.errors import DeviceError, PatternRefusedError
from core.lazy import dataclass
from core.patterns import Pattern, grey_reason

Pixels = NDArray[Any]  # (H, W), uint8 or uint16
Note = Callable[[str, str], None]  # who, what: a device tells the transcript what it did beside the asked
Check = Callable[[], None]  # raises when the user has cancelled
GRAIN_S = 0.1  # longest wait between two checks


def no_note(who: str, what: str) -> None:
    """Drop what a device tells."""


def no_check() -> None:
    """Never cancel."""


@dataclass(frozen=True)
class Image:
    """One exposure: grey values of shape (H, W), of which the lowest `bits` bits are used.

    `time_s` is the time of `time.monotonic` at which the exposure began; where the device cannot tell, at which the
    image arrived.
    """

    pixels: Pixels
    bits: int
    time_s: float
    number: int | None = None  # that the camera counts it as

    @property
    def full(self) -> int:
        """The grey value at which the sensor is saturated."""
        return (1 << self.bits) - 1


class Projector(Protocol):
    """Something that shows patterns.

    `show`, `load` and `step` return once the device has acknowledged and within a bounded time, or raise `DeviceError`
    saying what to check. From then on the light is steady after `settle_s`. `check` is called at least every `GRAIN_S`
    while they wait for an answer; what it raises ends the wait, and what is loaded and shown is then unknown.
    """

    name: str
    settle_s: float
    capacity: int  # how many patterns `load` takes; 0: patterns are sent one by one
    sequence: tuple[Pattern, ...] | None  # the one it is made for; None: the reference sequence of its size

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows, in lines."""

    def refusal(self, pattern: Pattern) -> str | None:
        """Why this pattern cannot be shown, in words; None if it can."""

    def show(self, pattern: Pattern, check: Check = no_check) -> None:
        """Show one pattern.

        Raises
        ------
        PatternRefusedError, DeviceError
        """

    def load(self, patterns: Sequence[Pattern], check: Check = no_check) -> None:
        """Store a sequence in the device; nothing is shown yet. `check` is called at every pattern too."""

    def step(self, index: int, check: Check = no_check) -> None:
        """Show pattern `index` of the loaded sequence."""

    def close(self) -> None:
        """Let the device go; a second call does nothing."""


class Camera(Protocol):
    """Something that takes images."""

    name: str

    @property
    def bits(self) -> int:
        """How many bits of a grey value are used."""

    @property
    def size(self) -> tuple[int, int] | None:
        """Width and height in px; None where the device cannot tell before its first image."""

    def grab(self, timeout_s: float = 5.0, check: Check = no_check) -> Image:
        """Take one image whose exposure begins after the call, never one that waited in a buffer.

        `check` is called at least every `GRAIN_S` while nothing has come; what it raises ends the wait.

        Raises
        ------
        DeviceError
            When no image has come within the time.
        """

    def close(self) -> None:
        """Let the device go; a second call does nothing."""


@dataclass(frozen=True)
class Setting:
    """What makes a camera's images brighter: the option of its URL, "exposure" or "gain", and the value that is set."""

    option: str
    what: str
    unit: str
    value: float


@runtime_checkable
class Adjustable(Protocol):
    """A camera whose exposure can be set while it is open."""

    @property
    def setting(self) -> Setting:
        """What is set now."""

    def adjust(self, value: float) -> Setting:
        """Set the exposure and read it back.

        Raises
        ------
        DeviceError
            When the camera takes another value.
        """


@runtime_checkable
class SelfRunning(Protocol):
    """A projector that can show its loaded sequence by its own clock, with a trigger for the camera at each pattern."""

    period_s: float  # of a pattern; 0: it waits for every step

    def run(self, check: Check = no_check) -> None:
        """Start the sequence that is loaded; it runs through once."""


@runtime_checkable
class Following(Protocol):
    """A projector that can show its loaded sequence by the triggers on its cable."""

    can_follow: bool

    def follow(self, period_s: float, check: Check = no_check) -> None:
        """Wait for triggers `period_s` apart: each shows the next pattern, the first one pattern 0."""


@runtime_checkable
class Armed(Camera, Protocol):
    """A camera that can take an image at every trigger on its cable."""

    can_arm: bool

    def arm(self, count: int) -> None:
        """Be ready for triggers; what was taken before is thrown away."""

    def collect(self, count: int, timeout_s: float, check: Check = no_check) -> list[Image]:
        """Give the images since, in their order, once there are `count` and no more come, or the time is over."""


@runtime_checkable
class Leading(Armed, Protocol):
    """A camera that can take images by its own clock, with a trigger for others at each."""

    lead_period_s: float  # of an image; 0: it waits for every call

    def lead(self, count: int) -> None:
        """Begin to take `count` images, which `collect` gives; what was taken before is thrown away."""


def refuse_grey(pattern: Pattern) -> str | None:
    """Say why a device of lines that are on or off cannot show a pattern."""
    reason = grey_reason(pattern)
    return f"it shows black or white only, and {reason}" if reason else None


def check_pattern(projector: Projector, pattern: Pattern) -> None:
    """See that a projector can show a pattern, else it is a PatternRefusedError."""
    if reason := projector.refusal(pattern):
        raise PatternRefusedError(projector.name, f"pattern {pattern.kind}", reason)


def check_sequence(projector: Projector, patterns: Sequence[Pattern], check: Check = no_check) -> tuple[Pattern, ...]:
    """Give a sequence as a projector keeps it, having seen that it fits and that all of it can be shown."""
    if not 0 < len(patterns) <= projector.capacity:
        raise DeviceError(
            projector.name,
            f"a sequence of {len(patterns)}",
            f"load at least one pattern and at most {projector.capacity} patterns",
        )
    for pattern in patterns:
        check()
        check_pattern(projector, pattern)
    return tuple(patterns)


def pattern_at(projector: Projector, loaded: Sequence[Pattern], index: int) -> Pattern:
    """Give a pattern of the loaded sequence."""
    if not 0 <= index < len(loaded):
        raise DeviceError(projector.name, f"step to pattern {index} of {len(loaded)}", "load the sequence first")
    return loaded[index]


def wait_until(moment_s: float, check: Check = no_check) -> None:
    """Sleep until a moment of `time.monotonic`; never shorter, whatever the clock's grain."""
    while (rest := moment_s - time.monotonic()) > 0:
        time.sleep(min(rest, GRAIN_S))
        check()
