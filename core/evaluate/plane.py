"""The plane that fits points best in the sense of orthogonal distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from core.errors import StripeError
from core.model import Array

LEAST_POINTS = 4  # three points fit any plane
COLLINEAR = 1e-6  # ratio of the second to the first spread below which points lie on a line


@dataclass(frozen=True)
class Plane:
    """The plane ``normal · X = offset_mm``.

    Attributes
    ----------
    normal : array, shape (3,)
        Unit normal, towards the origin (the camera) for a plane the camera sees.
    """

    normal: Array
    offset_mm: float

    def deviations(self, points: ArrayLike) -> Array:
        """Signed distances (mm) of points, shape (..., 3), positive on the camera's side."""
        return np.asarray(np.asarray(points, np.float64) @ self.normal - self.offset_mm)


def fit_plane(points: ArrayLike, *, where: str = "plane") -> Plane:
    """Fit a plane to points by least squares of the orthogonal distances.

    Parameters
    ----------
    points : array-like, shape (n, 3)
        In mm, in the camera's frame, all finite.
    where : str
        What the points belong to, for the message.

    Raises
    ------
    StripeError
        If there are fewer than 4 points, or they lie on a line.

    Notes
    -----
    The normal is the eigenvector of the least eigenvalue of the points' scatter matrix, taken about their mean in
    double precision.

    Examples
    --------
    >>> plane = fit_plane([[0, 0, -600], [1, 0, -600], [0, 1, -600], [1, 1, -600]])
    >>> [float(v) for v in plane.normal], plane.offset_mm
    ([0.0, 0.0, 1.0], -600.0)
    """
    p = np.asarray(points, np.float64)
    if len(p) < LEAST_POINTS:
        raise StripeError(where, f"{len(p)} valid points, too few to fit a plane", "check the capture and calibration")
    mean = p.mean(axis=0)
    centred = p - mean
    spread, vectors = np.linalg.eigh(centred.T @ centred)
    if spread[1] <= COLLINEAR**2 * spread[2]:
        raise StripeError(
            where, f"{len(p)} valid points on one line", "check the capture: no plane follows from a line"
        )
    normal = vectors[:, 0]
    offset = float(normal @ mean)
    if offset > 0 or (offset == 0 and normal[2] < 0):
        normal, offset = -normal, -offset
    return Plane(normal + 0.0, offset)
