"""What measuring must know of a kind of target."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.geometry import Pose
from core.measure.board import Board
from core.measure.picks import Side
from core.model import DeviceSpec, Interior, PhaseMap, Seed, TargetSet, Testfield
from core.progress import Progress

Array = NDArray[np.float64]
Guesses = tuple[tuple[Seed, ...], ...]


@dataclass(frozen=True)
class Sight:
    """One image of a board, checked: size, values, testfield and excluded targets are in order.

    `image` (H, W) is finite float32. `unwanted` targets (indices into the board) may help to tell who is who, but must
    not be among the marks. `where` names the file of the picks in messages.
    """

    image: NDArray[np.float32]
    phase: PhaseMap
    testfield: Testfield
    board: Board
    camera: DeviceSpec
    unwanted: frozenset[int]
    where: str
    side: Side
    progress: Progress


@dataclass(frozen=True)
class Marks:
    """Targets as the camera shows them, one row of every array per target.

    Attributes
    ----------
    target : int array, shape (m,)
        Indices into the board.
    uv : array, shape (m, 2)
        Image of the nominal point (a circle's centre, a corner), px, after every correction.
    cov : array, shape (m, 2, 2)
        px².
    ellipse : array, shape (m, 2, 2)
        Map of the unit disc to the patch that is one target, px. Projector coordinates are read within it.
    window : array, shape (m,)
        Radius, in that unit disc, of all pixels that `uv` is made of.
    blur : array, shape (m,)
        Sigma of edges, px.
    shift : array, shape (m, 2)
        The correction that `uv` contains: what was measured minus `uv`, px.
    missing : dict
        Why each of the other targets was not measured.
    notes : tuple of str
        What else an operator should know.
    row_shift_px : float
        Standard deviation of the shift that all of an image row has in common, which is not in `cov`.
    code : float
        Radius, in that unit disc, from which something else is printed round the targets.
    """

    target: NDArray[np.int64]
    uv: Array
    cov: Array
    ellipse: Array
    window: Array
    blur: Array
    shift: Array
    missing: dict[int, str]
    notes: tuple[str, ...] = ()
    row_shift_px: float = 0.0
    code: float = np.inf


@dataclass(frozen=True)
class Patch:
    """A printed area: its outline (k, 2) on the board, mm, in the targets' tone or in that of the ground."""

    outline_mm: Array
    ink: bool


@dataclass(frozen=True)
class TargetKind:
    """A kind of target.

    Attributes
    ----------
    plural : str
        What the targets are called in messages.
    guess : callable
        ``(image, testfield, camera, known, side) -> uv, guesses``: the targets seen in an evenly lit image, (n, 2) px,
        and the picks that may be meant, the likeliest first; `known` are picks of a neighbouring image, `side` is
        "front" or "back" (see `measure_targets`). Empty where the board is not recognised.
    measure : callable
        ``(sight, picks) -> marks``, from picks of an operator or of `guess`. Raises `InputError` where they contradict
        each other, `NotRecognisedError` where the image does not show them.
    nearest : callable
        ``(image, testfield, uv, reach_px) -> uv``: the target that an operator points at; None where there is none.
    coded : bool
        Every target tells which one it is, so that the board never looks the same after a turn.
    recentred : callable or None
        ``(targets, testfield, spec, interior, pose) -> targets``: the correction from an adjusted camera and its pose
        instead of the nominal one; None where nothing depends on it.
    drawn : callable or None
        ``testfield -> patches``: what is printed, each over those before, beside the dots of round targets.
    round : bool
        The targets are dots.
    """

    plural: str
    guess: Callable[[NDArray, Testfield, DeviceSpec, Sequence[Seed], str], tuple[Array, Guesses]]
    measure: Callable[[Sight, Sequence[Seed]], Marks]
    nearest: Callable[[NDArray, Testfield, tuple[float, float], float], tuple[float, float] | None]
    coded: bool = False
    recentred: Callable[[TargetSet, Testfield, DeviceSpec, Interior, Pose], TargetSet] | None = None
    drawn: Callable[[Testfield], tuple[Patch, ...]] | None = None
    round: bool = True
