"""A second screen as a projector: any HDMI projector that shows a window over its whole picture.

Here the images are made, pixel for pixel. The window itself belongs to the desktop program: to the running one, which
registers it with `offer_screens`, or else to one that is started for the purpose and shows what comes through a pipe.
One pixel of the image must be one pixel of the projector: a surface that would scale is refused.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from core.devices.protocol import Check, Note, check_sequence, no_check, no_note, pattern_at
from core.errors import DeviceError, InputError
from core.patterns import Pattern, pattern_image

SETTLE_S = 0.05  # three refreshes at 60 Hz; most projectors hold one or two images back: a capture measures it
_START_S = 60.0  # for a window's program to start
_SHOW_S = 10.0  # for it to show an image


class Surface(Protocol):
    """A window that fills a screen."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in the screen's own pixels, not in those that a desktop's scaling pretends."""

    def present(self, image: NDArray[np.uint8]) -> None:
        """Show an image (H, W) of exactly the surface's size; return once the screen has been given it."""

    def close(self) -> None:
        """Take the window away."""


Screens = Callable[[int], Surface]
_screens: list[Screens] = []


def offer_screens(screens: Screens | None) -> None:
    """Say how a window on screen number n is made; None: not any more."""
    _screens[:] = [] if screens is None else [screens]


def open_surface(number: int) -> Surface:
    """Open the window on a screen."""
    return _screens[0](number) if _screens else ServedSurface(number)


class ServedSurface:
    """A window of a program of its own: it is sent size and pixels of every image, and answers once it is painted."""

    def __init__(self, number: int, program: Sequence[str] = ()) -> None:
        self._name, self.size = f"screen:{number}", (0, 0)
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115  read when the program has ended
        command = [*(program or _window_program()), "--patterns", str(number)]
        pipe = subprocess.PIPE
        self._program = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=self._errors)
        try:
            self._ask(b"", _START_S)
        except BaseException:
            self.close()
            raise

    def present(self, image: NDArray[np.uint8]) -> None:
        height, width = image.shape
        self._ask(b"%d %d\n" % (width, height) + np.ascontiguousarray(image).tobytes(), _SHOW_S)

    def close(self) -> None:
        with suppress(OSError):
            self._program.stdin.close()  # type: ignore[union-attr]
        try:
            self._program.wait(_SHOW_S)
        except subprocess.TimeoutExpired:
            self._program.kill()
            self._program.wait()
        self._program.stdout.close()  # type: ignore[union-attr]
        self._errors.close()

    def _ask(self, data: bytes, patience_s: float) -> None:
        """Send something and read the answer: the screen's size, or what is wrong."""
        timer, line = threading.Timer(patience_s, self._program.kill), b""
        timer.start()
        try:
            self._program.stdin.write(data)  # type: ignore[union-attr]
            self._program.stdin.flush()  # type: ignore[union-attr]
            line = self._program.stdout.readline()  # type: ignore[union-attr]
        except (OSError, ValueError):
            line = b""  # it has ended
        finally:
            timer.cancel()
        told = json.loads(line) if line else {"error": self._ended()}
        if "error" in told:
            raise DeviceError(self._name, *told["error"])
        width, height = told["size"]
        self.size = int(width), int(height)

    def _ended(self) -> tuple[str, str]:
        """Say why there is no answer."""
        if self._errors.closed:
            return "its window is closed", "open the projector again"
        self._program.wait()
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        if lines and "No module named" in lines[-1]:
            return "the window's packages are missing", "install them: pip install 'stripe-workbench[gui]'"
        return f"no window to show patterns in ({lines[-1] if lines else 'it did not answer'})", "look at the display"


def _window_program() -> list[str]:
    """Give the command of the desktop program that belongs to this one."""
    if getattr(sys, "frozen", False):
        here = Path(sys.executable)
        return [str(here.with_name(f"stripe-gui{here.suffix}"))]
    return [sys.executable, "-m", "stripe_gui"]


def screen_image(pattern: Pattern, width: int, height: int, gamma: float = 1.0) -> NDArray[np.uint8]:
    """Make the image, shape (height, width), that shows a pattern on a screen, whose light is its input to `gamma`.

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
        settle_s: float | None = None,
        name: str = "screen",
        note: Note = no_note,
        release: Callable[[], None] = no_release,
    ) -> None:
        self.name, self.note = name, note
        self.settle_s = SETTLE_S if settle_s is None else settle_s
        self.late = settle_s is None  # by how much, nobody has said
        self._release = release  # of what switches the projector behind the screen
        self.capacity = 4096  # images are made when they are shown: only the list is kept
        self.sequence: tuple[Pattern, ...] | None = None
        self.surface, self.gamma = surface, gamma
        self._loaded: tuple[Pattern, ...] = ()
        self.size = surface.size
        self._open = True
        if min(self.size) < 1:
            raise InputError(name, f"a surface of {self.size[0]}x{self.size[1]} px", "choose a screen that is on")

    def refusal(self, pattern: Pattern) -> str | None:
        return None

    def show(self, pattern: Pattern, check: Check = no_check) -> None:
        if not self._open:
            raise DeviceError(self.name, "closed", "open it again")
        if self.surface.size != self.size:
            now, was = self.surface.size, self.size
            raise DeviceError(
                self.name,
                f"the screen has {now[0]}x{now[1]} px, it had {was[0]}x{was[1]}",
                "set its resolution to the projector's own and start the capture again",
            )
        self.surface.present(screen_image(pattern, *self.size, self.gamma))

    def load(self, patterns: Sequence[Pattern], check: Check = no_check) -> None:
        self._loaded = check_sequence(self, patterns, check)

    def step(self, index: int, check: Check = no_check) -> None:
        self.show(pattern_at(self, self._loaded, index))

    def close(self) -> None:
        if self._open:
            self._open = False
            self.surface.close()
            self._release()
