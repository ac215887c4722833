"""Kinds of edges that are measured as features, as they lie in a camera's image: a circle's, and a straight one's."""

from __future__ import annotations

from collections.abc import Callable
from warnings import catch_warnings

import numpy as np
from numpy.polynomial.chebyshev import chebfit, chebval
from numpy.typing import NDArray

from core.errors import InputError
from core.geometry import distort, image_to_pixel, pixel_to_image, undistort
from core.lazy import dataclass
from core.model import AdjustedDevice, Array

LEAST_RING_PX = 8.0  # width of the ring around a feature from which its surface is taken
CONTOUR = 360  # places of a contour that are carried to the surface
BENDS, DEGREE = np.linspace(-1.1, 1.1, 24), 8  # places along a straight edge whose images a polynomial describes


@dataclass(frozen=True)
class Edge:
    """A kind of edge near where it is said to be, by some shape parameters in px."""

    start: Array  #: (k,)
    distance: Callable[[Array, Array], Array]  #: of parameters and pixels (n, 2): px from the edge, negative inside
    curvature: Callable[[Array, Array], Array]  #: of parameters and pixels (n, 2): of the edge beside them, 1/px
    contour: Callable[[Array], Array]  #: of parameters: places (m, 2) of the edge
    near: Callable[[Array], NDArray[np.bool_]]  #: of pixels (n, 2): whether they may belong to it
    figures: Callable[[Array], tuple[Array, Array]]  #: of points (m, 3) of the edge: centre (3,) and vectors (j, 3)
    inside: bool  #: whether there is surface on the inner side, too


def _round(given: Array, _camera: AdjustedDevice) -> Edge:
    """The edge of a hole or a mark: an ellipse in the image, by its centre and a symmetrical matrix."""
    u, v, radius = given

    def matrix(p: Array) -> Array:
        return np.array([[p[2], p[3]], [p[3], p[4]]])

    def scaled(p: Array, at: Array) -> tuple[Array, Array]:
        """Distance from the centre, 1 at the edge, and its slope there, 1/px."""
        inverse = np.linalg.inv(matrix(p))
        y = (at - p[:2]) @ inverse
        rho = np.maximum(np.linalg.norm(y, axis=1), 1e-9)
        return rho, np.maximum(np.linalg.norm(y @ inverse, axis=1) / rho, 1e-6)

    def distance(p: Array, at: Array) -> Array:
        rho, slope = scaled(p, at)
        return (rho - 1) / slope

    def curvature(p: Array, at: Array) -> Array:
        return scaled(p, at)[1] ** -3.0 / np.linalg.det(matrix(p)) ** 2

    def contour(p: Array) -> Array:
        turn = np.linspace(0, 2 * np.pi, CONTOUR, endpoint=False)
        return np.asarray(p[:2] + np.stack([np.cos(turn), np.sin(turn)], axis=1) @ matrix(p))

    return Edge(
        start=np.array([u, v, radius, 0.0, radius]),
        distance=distance,
        curvature=curvature,
        contour=contour,
        near=lambda at: np.hypot(*(at - (u, v)).T) < 2.2 * radius + 3 * LEAST_RING_PX,
        figures=_ellipse,
        inside=False,
    )


def _ellipse(points: Array) -> tuple[Array, Array]:
    """Centre and semi-axes, longest first, of a closed curve by the moments of its area."""
    middle = points.mean(axis=0)
    plane = np.linalg.svd(points - middle, full_matrices=False)[2][:2]
    x, y = ((points - middle) @ plane.T).T
    x1, y1 = np.roll(x, -1), np.roll(y, -1)
    cross = x * y1 - x1 * y
    area = cross.sum() / 2
    cx, cy = ((x + x1) @ cross / (6 * area), (y + y1) @ cross / (6 * area))
    xx, yy = ((c * c + c * c1 + c1 * c1) @ cross / (12 * area) for c, c1 in ((x, x1), (y, y1)))
    xy = (x * y1 + 2 * x * y + 2 * x1 * y1 + x1 * y) @ cross / (24 * area)
    squares, turns = np.linalg.eigh([[xx - cx * cx, xy - cx * cy], [xy - cx * cy, yy - cy * cy]])
    axes = (turns * 2 * np.sqrt(np.maximum(squares, 0.0))).T[::-1] @ plane
    return middle + np.array([cx, cy]) @ plane, axes


def _straight(given: Array, camera: AdjustedDevice) -> Edge:
    """An edge that is straight in space, hence in the image before the lens bends it, by how far it passes beside."""
    spec, interior = camera.spec, camera.interior
    middle, half = (given[2:] + given[:2]) / 2, (given[2:] - given[:2]) / 2
    reach = float(np.linalg.norm(half))
    normal = np.array([-half[1], half[0]]) / reach
    ends = before_lens(camera, given.reshape(2, 2))

    def along(at: Array) -> Array:
        """From -1 at one end to 1 at the other."""
        return np.asarray((at - middle) @ half / reach**2)

    def bent(p: Array, share: Array) -> Array:
        """Where the camera sees places (n,) between the ends, as said, (n, 2)."""
        plain = np.column_stack([1 - share, 1 + share]) / 2 @ (ends + p[:, None] * normal)
        return image_to_pixel(spec, distort(interior, pixel_to_image(spec, plain)))

    def distance(p: Array, at: Array) -> Array:
        curve = bent(p, BENDS)
        with np.errstate(all="ignore"), catch_warnings(action="ignore"):  # of a fit that goes astray where no edge is
            course = chebfit(along(curve), (curve - middle) @ normal, DEGREE)
        return np.asarray((at - middle) @ normal - chebval(along(at), course))

    return Edge(
        start=np.zeros(2),
        distance=distance,
        curvature=lambda p, at: np.zeros(len(at)),  # a lens bends it by so little that blur does not move it
        contour=lambda p: bent(p, np.array([-1.0, 1.0])),
        near=lambda at: np.abs(along(at)) < 1,
        figures=lambda points: (points.mean(axis=0), (points[1:] - points[:1]) / 2),
        inside=True,
    )


FEATURES: dict[str, tuple[str, Callable[[Array, AdjustedDevice], Edge]]] = {
    "circle": ("U,V,RADIUS", _round),
    "line": ("U,V,U,V", _straight),
}  # how each is given, and its edge


def checked_place(kind: str, given: Array, where: str) -> Array:
    """Give where a kind of feature approximately is, (n,); InputError if that is no place of one."""
    if kind not in FEATURES:
        raise InputError(where, f"{kind!r} is no kind of feature", f"choose among {', '.join(FEATURES)}")
    words = FEATURES[kind][0]
    numbers = np.asarray(given, np.float64).ravel()
    whole = len(numbers) == words.count(",") + 1 and np.isfinite(numbers).all()
    if not whole or (numbers[2] <= 0 if kind == "circle" else np.array_equal(numbers[:2], numbers[2:])):
        raise InputError(where, f"is no {kind}", f"give {words} in px")
    return numbers


def before_lens(camera: AdjustedDevice, places: Array) -> Array:
    """Where places (n, 2) px would be seen without the lens's distortion."""
    return image_to_pixel(camera.spec, undistort(camera.interior, pixel_to_image(camera.spec, places)))
