"""Corresponding places of two cameras under a projector of which nothing is known but its labels.

The rays of corresponding places lie in one epipolar plane: they have the same angle about the base, whatever the lenses
do. So the angle is a label that needs no projector, and with one coordinate of the projector, which is enough, a place
of the other image has two. It is found by steps of less than a pixel from those pixels whose labels are next,

    δ = G⁻¹ (angle_own - angle, L_own - L),    G: slopes of angle and coordinate L in the other image

and the other coordinate, if it was decoded, must agree there. With rays ``d``, whose parts along the base and across it
have the ratio ``t``, and the base B the inverse depth is ``q = |d across| (t_own - t) / B``.

One coordinate labels all points on a line in the epipolar plane: where that meets surfaces several times, a place may
be another's, of which one camera does not see the own. Places count only if they lead back, and if no other surface in
either image has the same labels, and if they lie where the others say that their light is, see `light_planes`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.compiling import njit
from core.errors import NoCoordinateError
from core.lazy import dataclass
from core.model import Array, Floats
from core.numerics import quantile_of
from core.parallel import run_in_bands
from core.reconstruct.labels import Labels
from core.reconstruct.light_planes import off_their_planes
from core.reconstruct.placed import Device
from core.reconstruct.rays import camera_rays

WITHIN = 1.5  # px of a pixel whose labels are next, at most
APART_PX = 3.0, 12.0  # places with the same labels farther apart, noise added up to the latter, lie on two surfaces
OFF_PX = 4.0  # the coordinate that does not find a place may be off by, beyond noise
SIGMAS = 5.0
WEAK = 0.1  # share of a coordinate's slope that lies along epipolar lines, less of which tells no place
SINGULAR = 1e-6
MOST_CELLS = 3000  # each way


@dataclass(frozen=True)
class Fan:
    """A camera's pixels (H, W) by the epipolar planes through its base with another camera."""

    angle: Floats  #: about the base, rad
    along: Floats  #: the ratio t of a ray's parts along the base and across it
    across: Floats  #: the part across, of the ray with Z = -1


def fans(own: Device, other: Device) -> tuple[Fan, Fan, float]:
    """Give both cameras' pixels by epipolar planes, and the base in mm."""
    start, stop = (device.from_base.origin_mm for device in (own, other))
    base_mm = float(np.linalg.norm(stop - start))
    along = (stop - start) / base_mm
    looking = -(own.from_base.rotation[2] + other.from_base.rotation[2])  # the two cameras' middle direction
    across = looking - along * (looking @ along)
    across /= np.linalg.norm(across)
    axes = np.stack([along, across, np.cross(along, across)])

    def fan(device: Device) -> Fan:
        turn = (axes @ device.from_base.rotation.T).astype(np.float32)
        x, y = np.moveaxis(camera_rays(device.spec, device.interior), -1, 0)
        b, p, n = (row[0] * x + row[1] * y - row[2] for row in turn)
        away = np.hypot(p, n)
        return Fan(np.arctan2(n, p), b / away, away)

    return fan(own), fan(other), base_mm


def depths_by_cameras(own: Device, own_labels: Labels, other: Device, other_labels: Labels) -> Array:
    """Inverse depths (H, W), 1/mm, of a camera's pixels by their places in another's image; NaN where none is sure.

    NoCoordinateError if no coordinate was decoded by both, or the only one hardly changes along epipolar lines.
    """
    one, two, base_mm = fans(own, other)
    lead = _leading(two, other_labels, own_labels)
    there, back = _places(one, own_labels, two, other_labels, lead), _places(two, other_labels, one, own_labels, lead)
    q = np.where(_lead_back(there, back), one.across * (one.along - there[..., 2]) / base_mm, np.nan)
    q[~(q > 0)] = np.nan
    known = np.isfinite(q)
    plane = camera_rays(own.spec, own.interior)[known]
    points = np.column_stack([plane, np.full(len(plane), -1.0)]) / q[known][:, None]
    off = off_their_planes(points, own_labels.values[known][:, lead].astype(float), one.angle[known].astype(float))
    q[known] = np.where(off, np.nan, q[known])
    return q


def _slopes(values: Floats) -> tuple[Floats, Floats]:
    """Give slopes along rows and columns."""
    return np.gradient(values, axis=1), np.gradient(values, axis=0)


def _leading(fan: Fan, labels: Labels, others: Labels) -> int:
    """Choose the coordinate that changes most along epipolar lines, in its sigmas."""
    x, y = _slopes(fan.angle)
    tells = []
    for k in range(2):
        along = np.abs(labels.slopes[..., k, 0] * y - labels.slopes[..., k, 1] * x) / np.hypot(x, y)
        known = np.isfinite(along)
        if not known.any() or not np.isfinite(others.values[..., k]).any():
            tells.append((0.0, 0.0))
            continue
        steepest = np.hypot(*np.moveaxis(labels.slopes[..., k, :][known], -1, 0))
        sigma = np.sqrt(np.maximum(labels.variances[..., k][known], 1e-8))
        tells.append((float(np.median(along[known] / sigma)), float(np.median(along[known] / steepest))))
    best = int(tells[1][0] > tells[0][0])
    if tells[best][0] == 0:
        remedy = "check the capture's frames and exposure"
        raise NoCoordinateError(
            "the cameras", "no projector coordinate was decoded by both over more than single pixels", remedy
        )
    if tells[best][1] < WEAK:
        seen = f"only {'uv'[best]} was decoded, which hardly changes along their epipolar lines"
        raise NoCoordinateError("the cameras", seen, f"capture with patterns along {'yx'[best]}")
    return best


def _places(one: Fan, one_labels: Labels, two: Fan, two_labels: Labels, lead: int) -> Floats:
    """Where each pixel's labels are in the other image: x, y, `along`, px that are one place; NaN where in several.

    Of shape (H, W, 4).
    """
    x, y = _slopes(two.angle)
    value, slope = two_labels.values[..., lead], two_labels.slopes[..., lead, :]
    known = np.flatnonzero(np.isfinite(value + slope.sum(axis=-1) + two.angle))
    found = np.full((*one.angle.shape, 4), np.nan, np.float32)
    if not len(known):
        return found
    steep = np.abs(slope).max(axis=-1).ravel()[known]
    cell = WITHIN * np.array([quantile_of(np.hypot(x, y).ravel()[known], 0.98), quantile_of(steep, 0.98)])
    labels = np.stack([two.angle.ravel()[known], value.ravel()[known]], axis=1)
    cell = np.maximum(cell, np.ptp(labels, axis=0) / MOST_CELLS + np.finfo(float).tiny)
    least = labels.min(axis=0)
    at = ((labels - least) / cell).astype(np.int64)
    rows, columns = (int(n) for n in at.max(axis=0) + 1)
    bucket = at[:, 0] * columns + at[:, 1]
    order = known[np.argsort(bucket, kind="stable")]
    ends = np.concatenate([[0], np.cumsum(np.bincount(bucket, minlength=rows * columns))])
    arguments = (
        one.angle, one_labels.values, one_labels.variances, two.angle, two.along, two_labels.values,
        two_labels.variances, two_labels.slopes, lead, order, ends, rows, columns, least, cell, found,
    )  # fmt: skip
    run_in_bands(lambda first, last: _find(first, last, *arguments), len(found))
    return found


@njit(cache=True, nogil=True, error_model="numpy")
def _find(  # type: ignore[no-untyped-def]
    first, last, angle, values, variances, angles, along, theirs, their_variances, slopes, lead, order, ends,
    rows, columns, least, cell, found,
):  # fmt: skip
    """Find the places of pixels in rows first to last - 1; `order` has the other's, by cells of angle and label."""
    width, next_one = angles.shape[1], 1 - lead
    for r in range(first, last):
        for c in range(angle.shape[1]):
            a, own = angle[r, c], values[r, c, lead]
            if not (abs(a) < np.inf and abs(own) < np.inf):
                continue
            i, j = int(np.floor((a - least[0]) / cell[0])), int(np.floor((own - least[1]) / cell[1]))
            nearest, x0, y0, t0, apart0, lone = np.inf, 0.0, 0.0, 0.0, 0.0, True
            left, right = max(j - 1, 0), min(j + 2, columns)
            for row in range(max(i - 1, 0), min(i + 2, rows) if left < right else 0):
                for k in range(ends[row * columns + left], ends[row * columns + right]):
                    y, x = order[k] // width, order[k] % width
                    if y < 1 or x < 1 or y > angles.shape[0] - 2 or x > width - 2:
                        continue
                    ax, ay = 0.5 * (angles[y, x + 1] - angles[y, x - 1]), 0.5 * (angles[y + 1, x] - angles[y - 1, x])
                    lx, ly = slopes[y, x, lead, 0], slopes[y, x, lead, 1]
                    det = ax * ly - ay * lx
                    if not abs(det) > SINGULAR * np.hypot(ax, ay) * np.hypot(lx, ly):
                        continue
                    da, dl = a - angles[y, x], own - theirs[y, x, lead]
                    dx, dy = (ly * da - ay * dl) / det, (ax * dl - lx * da) / det
                    away = max(abs(dx), abs(dy))
                    noise = variances[r, c, lead] + their_variances[y, x, lead]
                    noise_px = SIGMAS * np.sqrt(noise) * max(abs(ax), abs(ay)) / abs(det)
                    if not away <= min(max(0.5 + noise_px, 0.75), WITHIN):
                        continue
                    mx, my = slopes[y, x, next_one, 0], slopes[y, x, next_one, 1]
                    off = abs(values[r, c, next_one] - theirs[y, x, next_one] - mx * dx - my * dy)
                    noise = variances[r, c, next_one] + their_variances[y, x, next_one]
                    if off > OFF_PX * np.hypot(mx, my) + SIGMAS * np.sqrt(noise):
                        continue
                    apart = min(APART_PX[0] + noise_px, APART_PX[1])
                    if nearest < np.inf and max(abs(x + dx - x0), abs(y + dy - y0)) > max(apart, apart0):
                        lone = False
                    if away < nearest:
                        tx = 0.5 * (along[y, x + 1] - along[y, x - 1])
                        ty = 0.5 * (along[y + 1, x] - along[y - 1, x])
                        nearest, x0, y0, t0 = away, x + dx, y + dy, along[y, x] + tx * dx + ty * dy
                        apart0 = apart
            if nearest < np.inf and lone:
                found[r, c, 0], found[r, c, 1], found[r, c, 2], found[r, c, 3] = x0, y0, t0, apart0


def _lead_back(there: Floats, back: Floats) -> NDArray[np.bool_]:
    """Whether the place of a pixel has its own place at the pixel."""
    rows, columns = np.indices(there.shape[:2])
    known = np.isfinite(there[..., 0])
    x, y = (np.where(known, np.rint(there[..., i]), 0).astype(np.intp) for i in (0, 1))
    inside = known & (x >= 0) & (y >= 0) & (x < back.shape[1]) & (y < back.shape[0])
    came = back[np.where(inside, y, 0), np.where(inside, x, 0)]
    away = np.maximum(np.abs(came[..., 0] - columns), np.abs(came[..., 1] - rows))
    return inside & (away <= np.maximum(there[..., 3], came[..., 3]))
