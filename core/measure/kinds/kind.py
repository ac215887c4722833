"""What measuring must know of a kind of target."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from core.geometry import Pose
from core.lazy import dataclass
from core.measure.board import Board
from core.measure.identity.picks import Side
from core.model import Array, DeviceSpec, Interior, PhaseMap, Seed, TargetSet, Testfield
from core.progress import Progress

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
    """Targets as the camera shows them, one row of every array per target."""

    target: NDArray[np.int64]  #: (m,): indices into the board
    uv: Array  #: (m, 2): image of the nominal point (a circle's centre, a corner), px, after every correction
    cov: Array  #: (m, 2, 2): px²
    #: (m, 2, 2): map of the unit disc to the patch that is one target, px. Projector coordinates are read within it.
    ellipse: Array
    window: Array  #: (m,): radius, in that unit disc, of all pixels that `uv` is made of
    blur: Array  #: (m,): sigma of edges, px
    shift: Array  #: (m, 2): the correction that `uv` contains: what was measured minus `uv`, px
    missing: dict[int, str]  #: why each of the other targets was not measured
    notes: tuple[str, ...] = ()  #: what else an operator should know
    #: (3, 3): covariance of the shifts that all of an image row has in common, px²; see `TargetSet`; not in `cov`
    row_shifts: Array | None = None
    light: Array | None = None  #: (m, 2): relative change, per px, of the light on bright targets
    code: float = np.inf  #: radius, in that unit disc, from which something else is printed round the targets


@dataclass(frozen=True)
class Patch:
    """A printed area: its outline (k, 2) on the board, mm, in the targets' tone or in that of the ground."""

    outline_mm: Array
    ink: bool


@dataclass(frozen=True)
class TargetKind:
    """A kind of target."""

    plural: str  #: what the targets are called in messages
    #: ``(image, testfield, camera, known, side) -> uv, guesses``: the targets seen in an evenly lit image, (n, 2) px,
    #: and the picks that may be meant, the likeliest first; `known` are picks of a neighbouring image, `side` is
    #: "front" or "back" (see `measure_targets`). Empty where the board is not recognised.
    guess: Callable[[NDArray, Testfield, DeviceSpec, Sequence[Seed], str], tuple[Array, Guesses]]
    #: ``(sight, picks) -> marks``, from picks of an operator or of `guess`. Raises `InputError` where they contradict
    #: each other, `NotRecognisedError` where the image does not show them.
    measure: Callable[[Sight, Sequence[Seed]], Marks]
    #: ``(image, testfield, uv, reach_px) -> uv``: the target that an operator points at; None where there is none
    nearest: Callable[[NDArray, Testfield, tuple[float, float], float], tuple[float, float] | None]
    coded: bool = False  #: every target tells which one it is, so that the board never looks the same after a turn
    #: ``(targets, testfield, spec, interior, pose) -> targets``: the correction from an adjusted camera and its pose
    #: instead of the nominal one; None where nothing depends on it
    recentred: Callable[[TargetSet, Testfield, DeviceSpec, Interior, Pose], TargetSet] | None = None
    #: ``testfield -> patches``: what is printed, each over those before, beside the dots of round targets
    drawn: Callable[[Testfield], tuple[Patch, ...]] | None = None
    round: bool = True  #: the targets are dots
