"""The deviations of a plane along a line drawn across the camera's image."""

from __future__ import annotations

from collections.abc import Sequence
from math import dist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import InputError
from core.geometry import ray_directions
from core.lazy import dataclass
from core.model import Array, DeviceSpec, Interior, PlaneEvaluation
from core.numerics import four_pixels

LEAST_PX = 1.0  # a shorter line has no direction worth a profile
MOST_IMAGES = 10.0  # of the image's width and height, that a line may be long
Pair = tuple[float, float]
Line = tuple[Pair, Pair]  # two ends (u, v), px


@dataclass(frozen=True)
class Profile:
    """Deviations at points of a line, one row of every array per point, about one a pixel."""

    uv: Array  #: (n, 2): where they lie in the camera's image, px
    #: (n,): distance from the first point, measured along the fitted plane; NaN throughout where the camera is not
    #: known
    length_mm: Array
    deviation_mm: Array  #: (n,): interpolated between pixels; NaN beside a pixel without point
    #: (n,): predicted from the phase noise of the pixels it was interpolated from, NaN where that is not known
    sigma_mm: Array
    devices: tuple[str, str]  #: the camera, and the projector or what else stands for it


def read_profile(evaluation: PlaneEvaluation, spec: DeviceSpec, start: Pair, stop: Pair) -> Profile:
    """Read the deviations along a line, whose ends (u, v) in the camera's image, px, may lie outside it.

    Neighbouring pixels are independent, so a value interpolated with the weights w has the variance Σ w² σ².
    """
    ends = np.array([start, stop], np.float64)
    distance = dist(start, stop)
    if not distance >= LEAST_PX:
        raise InputError("profile", f"its ends are {distance:.2f} px apart", "draw a longer line")
    if distance > MOST_IMAGES * (spec.width + spec.height):
        raise InputError("profile", f"its ends are {distance:.4g} px apart", "draw a line across the image")
    uv = ends[0] + np.linspace(0, 1, round(distance) + 1)[:, None] * (ends[1] - ends[0])
    deviation, _ = interpolate(evaluation.deviation_mm, uv)
    sigma = np.full(len(uv), np.nan)
    if evaluation.sigma_mm.shape == evaluation.deviation_mm.shape:
        _, sigma = interpolate(evaluation.sigma_mm, uv)
    length = np.full(len(uv), np.nan)
    if evaluation.camera is not None:
        points = points_on_plane(evaluation.plane, spec, evaluation.camera, uv)
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return Profile(uv, length, deviation, sigma, evaluation.devices)


def line_across(deviations: Sequence[NDArray], start: Pair = (0.05, 0.5), stop: Pair = (0.95, 0.5)) -> Line:
    """Lay a line over the area in which any of several maps (H, W) has deviations; its ends are shares of that area.

    Examples
    --------
    >>> line_across([np.zeros((21, 41))])
    ((2.0, 10.0), (38.0, 10.0))
    """
    valid = np.any([np.isfinite(d) for d in deviations], axis=0)
    rows, cols = (np.flatnonzero(valid.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        raise InputError("profile", "no pixel has a deviation", "evaluate the plane anew")
    low, size = np.array([cols[0], rows[0]]), np.array([np.ptp(cols), np.ptp(rows)])
    (u0, v0), (u1, v1) = (np.round(low + np.array(share) * size).tolist() for share in (start, stop))
    return (u0, v0), (u1, v1)


def interpolate(image: NDArray, uv: ArrayLike) -> tuple[Array, Array]:
    """Interpolate an image (H, W) bilinearly between the four pixels around every point, (n, 2) px.

    Gives Σ w g and √Σ w² g², (n,) each, with the weights w of the four pixels' values g: the mean, and where the values
    are sigmas of independent pixels, the sigma of their mean. NaN outside the image, and where a pixel of weight above
    zero is.

    Examples
    --------
    >>> interpolate(np.array([[0.0, 1.0], [2.0, 3.0]]), [[0.5, 0.5], [1.0, 0.0]])[0].tolist()
    [1.5, 1.0]
    """
    rows, columns, weight = four_pixels(image.shape, uv)
    share = weight * np.where(weight > 0, image[rows, columns], 0.0)
    return share.sum(axis=0), np.sqrt((share**2).sum(axis=0))


def points_on_plane(
    plane: ArrayLike, spec: DeviceSpec, camera: Interior, uv: ArrayLike, deviation_mm: ArrayLike = 0.0
) -> Array:
    """Where the rays of pixels (..., 2) meet a plane, (..., 3) mm in the camera's frame; NaN where not in front of it.

    `plane` is unit normal and offset (mm) in the camera's frame, as `PlaneEvaluation.plane`. With deviations (...) from
    it these are the points that have them.
    """
    normal, offset = np.asarray(plane, np.float64)[:3], float(np.asarray(plane)[3])
    rays = ray_directions(spec, camera, uv)
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (offset + np.asarray(deviation_mm, np.float64)) / (rays @ normal)
    return np.where(distance > 0, distance, np.nan)[..., None] * rays
