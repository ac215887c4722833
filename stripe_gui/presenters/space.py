"""Things in space, for a view that is turned: points with colours, lines and names, in mm.

Axes are right, away and up of the camera that all refers to.
"""

from __future__ import annotations

from dataclasses import field
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.lazy import dataclass
from core.model import Array

SEEN = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # from a camera's X (right), Y (up), Z (towards its back)


@dataclass(frozen=True)
class Line:
    """A line through places, shape (n, 3); `colour` is a field of the theme, `filled` closes and tints it."""

    places_mm: Array
    colour: str
    width: float = 1.2
    filled: bool = False


@dataclass(frozen=True)
class Name:
    """A word below a place, shape (3,)."""

    place_mm: Array
    text: str
    colour: str


@dataclass(frozen=True)
class Scene:
    """Everything that a view shows."""

    #: places_mm, colours: (n, 3): points; colours are uint8
    places_mm: Array = field(default_factory=lambda: np.zeros((0, 3)))
    colours: NDArray[np.uint8] | None = None
    lines: tuple[Line, ...] = ()
    names: tuple[Name, ...] = ()
    spacing_mm: float = 0.0  #: between neighbouring points


def seen(xyz_mm: ArrayLike) -> Array:
    """Turn places of the camera's frame, shape (..., 3), into those of a scene."""
    return np.asarray(xyz_mm, float) @ SEEN


def ends_of(scene: Scene) -> Array:
    """Give places, shape (n, 3), between which all lies but the points farthest out."""
    ends = [line.places_mm for line in scene.lines]
    if len(scene.places_mm):
        low, high = np.percentile(scene.places_mm, (1, 99), axis=0)
        ends.append(np.array(list(product(*zip(low, high, strict=True)))))
    return np.concatenate(ends) if ends else np.zeros((1, 3))
