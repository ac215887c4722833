"""What stands in front of the rig: boards that are not quite flat, spheres and blocks.

All lengths are mm in the board's frame: x right, y up along the board, z out of it towards the rig.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike

from core.geometry import Pose
from core.lazy import dataclass
from core.model import Array, Testfield

WHITE = 1.0
BLACK = 0.045


@dataclass(frozen=True)
class Form:
    """A smooth height over the plane, ``h = Σ a[p, q] (x/s)^p (y/s)^q`` in mm, with s the `scale_mm`.

    Examples
    --------
    A bend of 0.3 mm at the ends of a board 200 mm wide:

    >>> Form(np.array([[0.0], [0.0], [0.3]]), 100.0).height([0.0, 100.0], [0.0, 0.0])
    array([0. , 0.3])
    """

    coefficients: Array = field(default_factory=lambda: np.zeros((0, 0)))
    scale_mm: float = 1.0

    def height(self, x_mm: ArrayLike, y_mm: ArrayLike) -> Array:
        """Height in mm at places of any shape."""
        x, y = np.asarray(x_mm, np.float64) / self.scale_mm, np.asarray(y_mm, np.float64) / self.scale_mm
        if self.coefficients.size == 0:
            return np.zeros(np.broadcast(x, y).shape)
        return np.asarray(np.polynomial.polynomial.polyval2d(x, y, self.coefficients))


@dataclass(frozen=True)
class Board:
    """A board, plate or plane-table: its form, its paint and the targets as they were really made."""

    half_size_mm: tuple[float, float]  #: it reaches from -half to +half in x and y; beyond it there is nothing
    form: Form = field(default_factory=Form)
    albedo: float = WHITE  #: of the paint between the targets
    #: the targets at their true places, z included: a target lies `z - h(x, y)` above the form
    targets: Testfield | None = None
    #: (k, 5): unwanted circles painted over everything: x, y, height over the form, radius, albedo. An albedo far above
    #: 1 is a glint.
    spots: Array = field(default_factory=lambda: np.zeros((0, 5)))

    def circles(self) -> Array:
        """Give everything painted on the board, shape (n, 5): x, y, height over the form, radius, albedo."""
        if self.targets is None:
            return self.spots
        t = self.targets
        x, y = t.xyz_mm[:, 0], t.xyz_mm[:, 1]
        ink = WHITE if t.polarity == "white-on-black" else BLACK
        above = t.xyz_mm[:, 2] - self.form.height(x, y)
        painted = np.column_stack([x, y, above, t.diameter_mm / 2, np.full(len(x), ink)])
        return np.vstack([painted, self.spots])


@dataclass(frozen=True)
class Sphere:
    """A matt sphere."""

    centre_mm: tuple[float, float, float]
    radius_mm: float
    albedo: float = WHITE


@dataclass(frozen=True)
class Block:
    """A matt block with faces parallel to the board's axes, from one corner to the opposite one: a step."""

    lower_mm: tuple[float, float, float]
    upper_mm: tuple[float, float, float]
    albedo: float = WHITE


@dataclass(frozen=True)
class Detour:
    """Light that reaches the camera over other places of the scene, as parts of the image.

    A `share` of what a place reflects appears up to `spread` (standard deviation, part of the image's width) beside
    it: light that goes on below the surface. If `mirrored`, it comes in addition from the other half of the image: over
    a facing wall, or from its gloss where the spread is small.
    """

    share: float
    spread: float
    mirrored: bool = False


@dataclass(frozen=True)
class Scene:
    """A board at its place before the camera, and what lies on it.

    `ambient` is the evenly scattered light of the room: the grey value it gives to white at the image's middle.
    """

    board: Board
    camera_from_board: Pose
    spheres: tuple[Sphere, ...] = ()
    blocks: tuple[Block, ...] = ()
    ambient: float = 4.0
    detours: tuple[Detour, ...] = ()


def random_form(rng: np.random.Generator, half_size_mm: tuple[float, float], peak_to_valley_mm: float) -> Form:
    """Draw a smooth error of form without tilt, of a given height from its lowest to its highest place.

    A polynomial to degree 4 with random coefficients, smaller for the higher degrees, as cast or planed plates have.
    """
    p, q = np.meshgrid(np.arange(5), np.arange(5), indexing="ij")
    degree = p + q
    size = np.where((degree >= 2) & (degree <= 4), 1.0 / np.maximum(degree, 1) ** 2, 0.0)
    scale = float(max(half_size_mm))
    a = rng.normal(size=(5, 5)) * size
    x, y = np.meshgrid(*(np.linspace(-half, half, 41) for half in half_size_mm))
    # remove the plane that fits best: it belongs to the pose
    h = Form(a, scale).height(x, y)
    A = np.column_stack([np.ones(x.size), x.ravel() / scale, y.ravel() / scale])
    plane = np.linalg.lstsq(A, h.ravel(), rcond=None)[0]
    a[0, 0], a[1, 0], a[0, 1] = -plane
    h = Form(a, scale).height(x, y)
    return Form(a * (peak_to_valley_mm / np.ptp(h)), scale)


def board_as_made(
    nominal: Testfield,
    rng: np.random.Generator,
    *,
    bend_mm: float,
    offset_sigma_mm: tuple[float, float, float],
    margin_mm: float,
) -> Board:
    """Make a board as a workshop does: bent by `bend_mm` in all, its targets a little off their nominal places."""
    half = tuple(float(h) + margin_mm for h in np.abs(nominal.xyz_mm[:, :2]).max(axis=0))
    form = random_form(rng, (half[0], half[1]), bend_mm)
    xyz = nominal.xyz_mm + rng.normal(size=nominal.xyz_mm.shape) * np.array(offset_sigma_mm)
    xyz[:, 2] += form.height(xyz[:, 0], xyz[:, 1])
    made = Testfield(nominal.row, nominal.col, xyz, nominal.diameter_mm, nominal.polarity)
    albedo = BLACK if nominal.polarity == "white-on-black" else WHITE
    return Board((half[0], half[1]), form, albedo, made)
