"""The epipolar residual of every pixel, and how it changes with the relative orientation.

A pixel's ray d and inverse depth q put the point ``X = d / q`` into the camera's frame; with the projector's centre p
and the rotation R, the projector sees it in the direction ``R (d - q p)``. Of the two residuals of u and v, weighted by
their sigmas, the part along the change with q is taken up by the depth. What remains, across it, is the epipolar
residual, in units of its standard deviation.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from core.geometry import Pose, project, ray_directions
from core.model import AdjustedDevice, Array

LEAST_SIGMA = 1e-3  # lines; what a sigma is at least
SLIGHT = 1e-6  # relative change of a direction for its derivative


@dataclass(frozen=True)
class Sight:
    """The pixels of a capture that saw column and row, thinned out to a grid.

    Attributes
    ----------
    at : array of int, shape (n,)
        Number of the tile of the image that a pixel lies in.
    pixels : array, shape (n, 2)
        Where they are in the camera's image, px.
    rays : array, shape (n, 3)
        Directions in the camera's frame, Z = -1.
    uv, sigma : array, shape (n, 2)
        Projector coordinates in lines.
    pull : array, shape (n, 2)
        Where reflectance changes within a pixel's footprint its coordinate is drawn to the brighter side: by this, in
        lines, for a footprint of 1 px² (variance).
    """

    at: NDArray[np.int64]
    pixels: Array
    rays: Array
    uv: Array
    sigma: Array
    pull: Array

    def only(self, chosen: NDArray[np.bool_] | slice) -> Sight:
        """Give some of the pixels."""
        return Sight(*(getattr(self, f.name)[chosen] for f in fields(Sight)))


@dataclass(frozen=True)
class Residuals:
    """Epipolar residuals and what they depend on.

    Attributes
    ----------
    e : array, shape (n,)
        Observed less computed, in standard deviations.
    A : array, shape (n, 6)
        Change of the computed value with the projector's rotation vector (rad) and centre (mm) in the camera's frame.
    pulled : array, shape (n,)
        Change of the observed value with the footprint, by px².
    q : array, shape (n,)
        Inverse depths, 1/mm.
    """

    e: Array
    A: Array
    pulled: Array
    q: Array


def epipolar_residuals(sight: Sight, projector: AdjustedDevice, projector_from_camera: Pose) -> Residuals:
    """Compute the residuals of all pixels.

    Parameters
    ----------
    sight : Sight
    projector : AdjustedDevice
    projector_from_camera : Pose

    Notes
    -----
    The residual is stationary in q, so that q may come from a plain intersection of both rays.
    """
    R, centre = projector_from_camera.rotation, projector_from_camera.origin_mm
    towards = sight.rays @ R.T
    base = R @ centre
    weight = 1 / np.maximum(sight.sigma, LEAST_SIGMA)
    q = _depths(sight, projector, towards, base)
    computed, image = _sensitivity(projector, towards - q[:, None] * base)
    rest = weight * (sight.uv - computed)
    along = -weight * np.einsum("nij,j->ni", image, base)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(along[:, 0], along[:, 1])[:, None]
    normal = np.einsum("ni,nij->nj", weight * across, image) @ R  # by the direction, in the camera's frame
    seen = sight.rays - q[:, None] * centre
    # the projector turned by a small vector w looks along R (1 - [w]x): R (d - q p) changes by -R (w x (d - q p))
    A = np.concatenate([-np.cross(seen, normal), -q[:, None] * normal], axis=1)
    return Residuals(np.sum(across * rest, axis=1), A, np.sum(across * weight * sight.pull, axis=1), q)


def _depths(sight: Sight, projector: AdjustedDevice, towards: Array, base: Array) -> Array:
    """Inverse depths at which the rays come closest, as seen from the projector."""
    back = ray_directions(projector.spec, projector.interior, sight.uv)
    # towards - q base is parallel to back: its cross product with back vanishes
    left, right = np.cross(back, np.broadcast_to(base, back.shape)), np.cross(back, towards)
    return np.asarray(np.sum(left * right, axis=1) / np.sum(left**2, axis=1))


def _sensitivity(projector: AdjustedDevice, directions: Array) -> tuple[Array, Array]:
    """Projector coordinates (n, 2) of directions (n, 3), and their derivatives by them (n, 2, 3), by differences."""
    spec, interior = projector.spec, projector.interior
    depth = -directions[:, 2:]
    plane = np.concatenate([directions[:, :2] / depth, -np.ones_like(depth)], axis=1)
    computed = project(spec, interior, plane)
    columns = []
    for axis in range(2):
        step = np.zeros(3)
        step[axis] = SLIGHT
        columns.append((project(spec, interior, plane + step) - computed) / SLIGHT)
    inner = np.stack(columns, axis=-1) / depth[:, :, None]  # by the direction's X and Y
    by_depth = np.einsum("nij,nj->ni", inner, plane[:, :2])
    return computed, np.concatenate([inner, by_depth[:, :, None]], axis=-1)
