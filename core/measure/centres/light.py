"""Where the projector's light ends: targets too near to it are pulled by the light that is missing.

A centroid is honest only where everything it is made of is lit: the window of its weights, and around that the blur of
camera and projector, through which the dark beyond the edge still reaches in. The edge is known in projector lines, the
window in camera pixels; the projector coordinate's gradient at the target turns one into the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.measure.centres.course import DEGREES, courses, enough, planes
from core.model import Array, DeviceSpec

CUT = "cut by the light's edge"
REACH = 3.0  # sigmas that a blur reaches
LINE_BLUR = 0.7  # lines, sigma: a projector that is more blurred can hardly show single lines
LEAST_NEIGHBOURS = 5  # that tell a gradient, robustly
COURSES = 2, 3, *DEGREES  # degrees of courses over a board: the highest for which there are enough targets


def line_gradients(camera_uv: Array, projector_uv: Array) -> Array:
    """How projector coordinates change over the camera's image at every target, shape (n, 2, 2), lines per px.

    Row 0 is of the columns' coordinate u, row 1 of v, by the camera's u and v. They follow from a course over the whole
    board where there are enough targets, and what that leaves of those around, each axis for itself; NaN where too few
    of them have a coordinate. Those around alone are on one side at the board's rim: by a plane through them slopes
    were off by 3 % under a camera of 86 degrees, at the rim by 10 to 25 %.

    Examples
    --------
    >>> uv = np.stack(np.meshgrid([0.0, 10, 20], [0.0, 10, 20]), axis=-1).reshape(-1, 2)
    >>> np.round(line_gradients(uv, uv @ [[0.5, 0.0], [0.1, 2.0]])[4], 3) + 0  # no minus 0
    array([[0.5, 0.1],
           [0. , 2. ]])
    """
    gradient = np.full((len(camera_uv), 2, 2), np.nan)
    for axis, lines in enumerate(projector_uv.T):
        known = np.isfinite(lines)
        if np.count_nonzero(known) < LEAST_NEIGHBOURS:
            continue
        slope, whole = _along(camera_uv, lines, known)
        gradient[known, axis] = slope[known] + planes(camera_uv, lines - whole, known)[known, 1:]
        if not known.all():  # a course says nothing beyond its targets
            gradient[~known, axis] = planes(camera_uv, lines, known)[~known, 1:]
    return gradient


def _along(uv: Array, lines: Array, known: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Slopes (n, 2), lines per px, and lines (n,) of the course over a board; 0 without one."""
    degrees = [d for d in COURSES if enough(int(np.count_nonzero(known)), d)]
    fits = courses(uv, lines, known, [d for d in degrees if d in DEGREES] or degrees[-1:])
    if not fits:
        return np.zeros_like(uv), np.zeros(len(uv))
    return fits[-1].slopes(uv), fits[-1].values(uv)


def cut_by_edge(
    projector: DeviceSpec, projector_uv: Array, gradient: Array, ellipse: Array, window: Array, blur_px: Array
) -> NDArray[np.bool_]:
    """Which targets (n,) lie nearer to the edge of the projector's raster than their window and its blur allow.

    An axis of `projector_uv`, (n, 2) lines, that is NaN says nothing; its `gradient`, (n, 2, 2), is in lines per px.
    `ellipse` maps the unit disc to the dot, `window` is the radius in the unit disc of what is weighted, `blur_px` the
    sigma of the dot's edge.
    """
    half = np.linalg.norm(gradient @ ellipse, axis=2) * window[:, None]
    blur = np.hypot(np.linalg.norm(gradient, axis=2) * blur_px[:, None], LINE_BLUR)
    size = np.array([projector.width, projector.height])
    inside = np.minimum(projector_uv + 0.5, size - 0.5 - projector_uv)
    with np.errstate(invalid="ignore"):
        return np.asarray((inside < half + REACH * blur).any(axis=1))
