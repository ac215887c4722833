"""A second screen as a projector: any HDMI projector that shows a window over its whole picture.

Here the images are made, pixel for pixel; the window itself belongs to the desktop program, which registers it with
`offer_screens`. One pixel of the image must be one pixel of the projector: a surface that would scale is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from core.devices.protocol import Check, Note, check_sequence, no_check, no_note, pattern_at
from core.errors import DeviceError, InputError
from core.patterns import Pattern, pattern_image

SETTLE_S = (
    0.05  # three refreshes at 60 Hz; most projectors hold one or two images back: measure it with the pre-flight check
)


class Surface(Protocol):
    """A window that fills a screen."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in the screen's own pixels, not in those that a desktop's scaling pretends."""
        ...

    def present(self, image: NDArray[np.uint8]) -> None:
        """Show an image (H, W) of exactly the surface's size; return once the screen has been given it."""
        ...

    def close(self) -> None:
        """Take the window away."""
        ...


Screens = Callable[[int], Surface]
_screens: list[Screens] = []


def offer_screens(screens: Screens | None) -> None:
    """Say how a window on screen number n is made; None: not any more."""
    _screens[:] = [] if screens is None else [screens]


def open_surface(number: int) -> Surface:
    """Open the window on a screen."""
    if not _screens:
        raise DeviceError(
            f"screen:{number}", "no window here to show patterns in", "start the capture from the desktop program"
        )
    return _screens[0](number)


def screen_image(pattern: Pattern, width: int, height: int, gamma: float = 1.0) -> NDArray[np.uint8]:
    """Make the image, shape (height, width), that shows a pattern on a screen.

    Parameters
    ----------
    gamma : float
        The screen's light is its input to this power; 1 for a screen that has been made linear.

    Examples
    --------
    >>> from core.patterns import Code
    >>> screen_image(Code("gray", "x", 0, 1, 2), 4, 1)
    array([[  0,   0, 255, 255]], dtype=uint8)
    """
    light = pattern_image(pattern, width, height)
    return np.rint(255 * light ** (1 / gamma)).astype(np.uint8)


def no_release() -> None:
    """Let nothing go: the projector behind the screen is switched by hand."""


class ScreenProjector:
    """A projector that is a screen: rows, columns and grey values alike."""

    def __init__(
        self,
        surface: Surface,
        *,
        gamma: float = 1.0,
        settle_s: float = SETTLE_S,
        name: str = "screen",
        note: Note = no_note,
        release: Callable[[], None] = no_release,
    ) -> None:
        self.name, self.settle_s, self.note = name, settle_s, note
        self._release = release  # of what switches the projector behind the screen
        self.capacity = 4096  # images are made when they are shown: only the list is kept
        self.sequence: tuple[Pattern, ...] | None = None
        self.surface, self.gamma = surface, gamma
        self._loaded: tuple[Pattern, ...] = ()
        self._size = surface.size
        self._open = True
        if min(self._size) < 1:
            raise InputError(name, f"a surface of {self._size[0]}x{self._size[1]} px", "choose a screen that is on")

    @property
    def size(self) -> tuple[int, int]:
        return self._size

    def refusal(self, pattern: Pattern) -> str | None:
        return None

    def show(self, pattern: Pattern, check: Check = no_check) -> None:
        if not self._open:
            raise DeviceError(self.name, "closed", "open it again")
        if self.surface.size != self._size:
            now, was = self.surface.size, self._size
            raise DeviceError(
                self.name,
                f"the screen has {now[0]}x{now[1]} px, it had {was[0]}x{was[1]}",
                "set its resolution to the projector's own and start the capture again",
            )
        self.surface.present(screen_image(pattern, *self._size, self.gamma))

    def load(self, patterns: Sequence[Pattern], check: Check = no_check) -> None:
        self._loaded = check_sequence(self, patterns, check)

    def step(self, index: int, check: Check = no_check) -> None:
        self.show(pattern_at(self, self._loaded, index))

    def close(self) -> None:
        if self._open:
            self._open = False
            self.surface.close()
            self._release()
