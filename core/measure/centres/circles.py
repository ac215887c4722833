"""Why the middle of an ellipse is not the image of the circle's centre, and by how much."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from core.geometry import Pose, distort, image_to_pixel
from core.measure.identity.view import View
from core.model import Array, DeviceSpec, Interior, TargetSet, Testfield
from core.numerics import nearest, polynomial, polynomial_slopes

# uncertainty of the correction: nominal focal length, one lens parameter, board taken as flat; when adjusted, 1 % of
# the dots' diameter
NOMINAL_SHARE, ADJUSTED_SHARE = 0.05, 0.02
LEAST = 12  # targets that tell how a board is bent
SMOOTH = 0.02  # of the targets' spacing: what a surface through them leaves may turn each dot by as much
ALONG = 0.9  # cosine between the XY plane's normal and the targets' own where these are said to be in that plane


def tangents(xyz_mm: Array) -> Array:
    """Two orthogonal unit vectors along the board at every target, shape (n, 3, 2).

    Of a board that is bent smoothly, they follow a quadratic surface through all targets (n, 3), mm; where these lie on
    steps, the dots are taken as parallel to the XY plane, or to the targets' own if they stand across it.

    Examples
    --------
    >>> x, y = (g.ravel() for g in np.mgrid[-4.0:5, -3.0:4])
    >>> print(np.round(np.abs(tangents(np.stack([x, y, 0.01 * x**2], axis=1))[0]), 3))
    [[0.997 0.   ]
     [0.    1.   ]
     [0.08  0.   ]]
    """
    return _tangents(np.asarray(xyz_mm, np.float64).tobytes())


@lru_cache(maxsize=8)  # many captures share a board
def _tangents(targets: bytes) -> Array:
    xyz_mm = np.frombuffer(targets).reshape(-1, 3)
    centred = xyz_mm - xyz_mm.mean(axis=0)
    axes = np.linalg.eigh(centred.T @ centred)[1].T[::-1]
    if abs(axes[2, 2]) > ALONG:
        axes = np.eye(3)
    x, y, z = (centred @ axes.T).T
    slopes, one, none = np.zeros((2, len(x))), np.ones_like(x), np.zeros_like(x)
    if len(x) >= LEAST:
        A = polynomial(x, y, 2)
        fit = np.linalg.lstsq(A, z, rcond=None)[0]
        spacing = np.median(np.linalg.norm(centred[nearest(centred, 2)[:, 1]] - centred, axis=1))
        if np.std(z - A @ fit) < SMOOTH * spacing:
            slopes = polynomial_slopes(x, y, 2) @ fit
    surface = np.array([[one, none, slopes[0]], [none, one, slopes[1]]]).transpose(2, 1, 0)
    found = np.asarray(axes.T @ np.linalg.qr(surface)[0])
    found.flags.writeable = False
    return found


def eccentricity(
    view: View, xyz_mm: Array, radius_mm: Array, interior: Interior | None = None, along: Array | None = None
) -> Array:
    """Centre of a circle's image minus the image of the circle's centre, shape (n, 2), px.

    The circles have the centres (n, 3) and radii (n,); `along`, (n, 3, 2), are orthogonal unit vectors in their planes,
    as `tangents` gives them, else they are parallel to XY. `interior` is the camera's, of any model, where it is known
    better than the view has it.

    With the homography H from the circle's plane (origin in its centre) to the image, the dual conic of the image is
    ``K = H diag(r², r², -1) H'``; its last column is the ellipse's centre m, the pole of the line at infinity, and H's
    last column the image of the circle's centre. Exact; for a camera that looks at the circle's centre this is the
    closed form ``c r² sin a cos a / (D² - r² sin² a)`` of a circle tilted by a at the distance D.

    The lens then bends the ellipse, see `_bent`.

    Examples
    --------
    >>> from core.geometry import Pose, matrix_from_axis_angle
    >>> from core.model import DeviceSpec
    >>> tilted = Pose(matrix_from_axis_angle([0, 1, 0], np.pi / 4), np.array([0.0, 0.0, -1000.0]))
    >>> view = View(DeviceSpec(748, 576, (0.008, 0.008), 12.0), tilted)
    >>> print(round(float(np.hypot(*eccentricity(view, np.zeros((1, 3)), np.array([2.5]))[0])), 4))
    0.0047
    """
    interior = interior or view.interior
    R, c = view.camera_from_board.rotation, interior.c_mm
    centre = view.camera_from_board.apply(xyz_mm)
    image = np.diag([-c, -c, 1.0])
    H = np.empty((len(xyz_mm), 3, 3))
    H[:, :, :2] = image @ R @ (np.eye(3)[:, :2] if along is None else along)
    H[:, :, 2] = centre @ image.T
    scale = np.stack([radius_mm**2, radius_mm**2, -np.ones(len(xyz_mm))], axis=1)
    dual = (H * scale[:, None, :]) @ np.swapaxes(H, 1, 2)
    dual /= dual[:, 2:, 2:]
    middle, point = dual[:, :2, 2], H[:, :2, 2] / H[:, 2:, 2]
    moments = (middle[:, :, None] * middle[:, None, :] - dual[:, :2, :2]) / 4
    bent = distort(interior, middle) + _bent(interior, middle, moments)
    return image_to_pixel(view.spec, bent) - image_to_pixel(view.spec, distort(interior, point))


def _bent(interior: Interior, middle: Array, moments: Array) -> Array:
    """How much further a lens moves an ellipse's centroid than its middle m (n, 2), mm.

    To second order in the lens, with the second moments S (n, 2, 2): ``S:f''/2`` of the curved map f, and
    ``f' S grad(ln det f')`` of the areas, which it does not keep.
    """
    step = np.sqrt(np.trace(moments, axis1=1, axis2=2))[:, None]

    def at(i: int, j: int) -> Array:
        return distort(interior, middle + step * np.array([i, j]))

    left, right, below, above, twice = at(-1, 0), at(1, 0), at(0, -1), at(0, 1), 2 * at(0, 0)
    slope = np.stack([right - left, above - below], axis=2) / 2
    xx, yy, xy = right + left - twice, above + below - twice, (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / 4
    S = moments / step[:, :, None] ** 2
    curved = (S[:, :1, 0] * xx + S[:, 1:, 1] * yy) / 2 + S[:, :1, 1] * xy
    second = np.stack([np.stack([xx, xy], axis=2), np.stack([xy, yy], axis=2)], axis=1)  # slope's change by x, by y
    grows = np.einsum("nij,nkji->nk", np.linalg.inv(slope), second)
    return np.asarray(curved + np.einsum("nij,njk,nk->ni", slope, S, grows))


def recentred(
    targets: TargetSet, testfield: Testfield, camera: DeviceSpec, interior: Interior, camera_from_board: Pose
) -> TargetSet:
    """Correct targets by the eccentricity that an adjusted camera and pose give, in place of the nominal camera's.

    A nominal camera takes the difference of its pixels' true pitches, or a wrong c, for a tilt of the board. The
    projector's coordinates move with the centres at which they are read.
    """
    index = testfield.index()
    at = [index[key] for key in targets.keys]
    if not at:
        return targets
    view = View(camera, camera_from_board)
    along = tangents(testfield.xyz_mm)[at]
    shift = eccentricity(view, testfield.xyz_mm[at], testfield.diameter_mm[at] / 2, interior, along)
    moved = targets.eccentricity_px - shift
    more = uncertain(shift, ADJUSTED_SHARE) - uncertain(targets.eccentricity_px, NOMINAL_SHARE)
    result = replace(
        targets, camera_uv=targets.camera_uv + moved, camera_cov=targets.camera_cov + more, eccentricity_px=shift
    )
    if targets.gradient is None:
        return result
    J = np.nan_to_num(targets.gradient)
    return replace(
        result,
        projector_uv=targets.projector_uv + np.einsum("nij,nj->ni", J, moved),
        projector_sigma=np.sqrt(targets.projector_sigma**2 + np.einsum("nij,njk,nik->ni", J, more, J)),
    )


def uncertain(shift: Array, share: float) -> Array:
    """Covariance (n, 2, 2) of centres, px², that are corrected by shifts (n, 2) known to a share of themselves."""
    return np.asarray(share**2 * shift[:, :, None] * shift[:, None, :])
