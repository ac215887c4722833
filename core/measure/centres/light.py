"""Where the projector's light ends: targets too near to it are pulled by the light that is missing.

A centroid is honest only where everything it is made of is lit: the window of its weights, and around that the blur of
camera and projector, through which the dark beyond the edge still reaches in. The edge is known in projector lines, the
window in camera pixels; the projector coordinate's gradient at the target turns one into the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.model import Array, DeviceSpec
from core.numerics import nearest, normal_equations, row_median

CUT = "cut by the light's edge"
REACH = 3.0  # sigmas that a blur reaches
LINE_BLUR = 0.7  # lines, sigma: a projector that is more blurred can hardly show single lines
NEIGHBOURS = 12
LEAST_NEIGHBOURS = 5  # that tell a gradient, robustly


def line_gradients(camera_uv: Array, projector_uv: Array) -> Array:
    """How projector coordinates change over the camera's image at every target, shape (n, 2, 2), lines per px.

    Row 0 is of the columns' coordinate u, row 1 of v, by the camera's u and v. They follow from the targets around,
    each axis for itself; NaN where too few of them have a coordinate.

    Examples
    --------
    >>> uv = np.stack(np.meshgrid([0.0, 10, 20], [0.0, 10, 20]), axis=-1).reshape(-1, 2)
    >>> np.round(line_gradients(uv, uv @ [[0.5, 0.0], [0.1, 2.0]])[4], 3) + 0  # no minus 0
    array([[0.5, 0.1],
           [0. , 2. ]])
    """
    gradient, before = np.full((len(camera_uv), 2, 2), np.nan), np.zeros(0, np.intp)
    for axis, lines in enumerate(projector_uv.T):
        known = np.flatnonzero(np.isfinite(lines))
        if len(known) < LEAST_NEIGHBOURS:
            continue
        if not np.array_equal(known, before):  # mostly both axes are known of the same targets
            near, before = known[nearest(camera_uv[known], min(NEIGHBOURS, len(known)), of=camera_uv)], known
        offset = camera_uv[near] - camera_uv[:, None]
        A = np.concatenate([np.ones((*near.shape, 1)), offset], axis=2)
        weight = np.ones(near.shape)
        for _ in range(6):  # a coordinate decoded wrongly is far off
            N, b = normal_equations(A, weight, lines[near][..., None])
            scale = np.einsum("nii->n", N)[:, None, None] * 1e-12
            plane = np.linalg.solve(N + scale * np.eye(3), b)
            off = np.abs((A @ plane)[..., 0] - lines[near])
            weight = 1 / (1 + (off / np.maximum(2 * row_median(off)[:, None], 0.2)) ** 2)
        gradient[:, axis] = plane[:, 1:, 0]
    return gradient


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
