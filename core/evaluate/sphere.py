"""The sphere that fits points best in the sense of orthogonal distances."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from core.errors import StripeError
from core.lazy import dataclass
from core.model import Array

LEAST_POINTS = 5  # four points fit any sphere
STEPS = 50


@dataclass(frozen=True)
class Sphere:
    """A sphere by its centre, shape (3,), and its radius, mm."""

    centre_mm: Array
    radius_mm: float

    def deviations(self, points: ArrayLike) -> Array:
        """Signed distances (mm) of points, shape (..., 3), positive outside."""
        return np.asarray(np.linalg.norm(np.asarray(points, np.float64) - self.centre_mm, axis=-1) - self.radius_mm)


def fit_sphere(points: ArrayLike) -> Sphere:
    """Fit a sphere to points, shape (n, 3) in mm, all finite, by least squares of the orthogonal distances.

    Raises
    ------
    StripeError
        If there are fewer than 5 points, or they lie in a plane.

    Notes
    -----
    Gauss and Newton's method from the algebraic solution, which alone would be biased for a cap: its radius comes out
    too small.

    Examples
    --------
    >>> sphere = fit_sphere([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
    >>> bool(abs(sphere.radius_mm - 1) < 1e-12)
    True
    """
    p = np.asarray(points, np.float64)
    if len(p) < LEAST_POINTS:
        raise StripeError("a ball", f"{len(p)} valid points, too few to fit a sphere", "choose more of the object")
    mean = p.mean(axis=0)
    scale = float(np.sqrt(np.mean((p - mean) ** 2))) or 1.0
    x = (p - mean) / scale
    design = np.column_stack([2 * x, np.ones(len(x))])
    solution, _, rank, _ = np.linalg.lstsq(design, np.sum(x**2, axis=1), rcond=1e-10)
    if rank < 4:
        raise StripeError("a ball", f"{len(p)} valid points in one plane", "choose a part of the object that is curved")
    centre = solution[:3]
    radius = float(np.sqrt(solution[3] + centre @ centre))
    for _ in range(STEPS):
        away = x - centre
        distance = np.linalg.norm(away, axis=1)
        jacobian = np.column_stack([-away / distance[:, None], -np.ones(len(x))])
        step = np.linalg.lstsq(jacobian, radius - distance, rcond=None)[0]
        centre, radius = centre + step[:3], radius + float(step[3])
        if np.abs(step).max() < 1e-12 * max(radius, 1.0):
            break
    return Sphere(centre * scale + mean, radius * scale)
