"""The model of OpenCV: k1, k2, k3 radial, k4, k5, k6 in the denominator, p1, p2 decentring; b1 stretches x.

With ``x = X/-Z``, ``y = -Y/-Z`` (OpenCV's axes: y down), ``r² = x² + y²`` and
``d = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)``::

    x' = x d + 2 p1 x y + p2 (r² + 2x²)        fx = c (1 + b1) / pitch_x      cx = (W - 1)/2 + x0 / pitch_x
    y' = y d + p1 (r² + 2y²) + 2 p2 x y        fy = c / pitch_y               cy = (H - 1)/2 - y0 / pitch_y

k1 to p2 are OpenCV's own numbers. Brown, *Close-range camera calibration*, Photogrammetric Engineering 37 (1971).
"""

from __future__ import annotations

import numpy as np

from core.geometry.lens.record import Lens, Parameter
from core.model import Array, DeviceSpec, Interior


def _distort(interior: Interior, xy: Array) -> Array:
    k1, k2, p1, p2, k3, k4, k5, k6, b1 = interior.a
    x, y = xy[..., 0] / interior.c_mm, xy[..., 1] / interior.c_mm  # y up: p1 changes its sign
    r2 = x * x + y * y
    d = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    d += (2 * p2) * x - (2 * p1) * y
    out = np.empty_like(xy)
    out[..., 0] = (x * d + p2 * r2) * (interior.c_mm * (1 + b1)) + interior.x0_mm
    out[..., 1] = (y * d - p1 * r2) * interior.c_mm + interior.y0_mm
    return out


def _derivatives(interior: Interior, xy: Array) -> tuple[Array, Array]:
    k1, k2, p1, p2, k3, k4, k5, k6, b1 = interior.a
    c = interior.c_mm
    x, y = xy[..., 0] / c, xy[..., 1] / c
    r2 = x * x + y * y
    r4, r6 = r2 * r2, r2 * r2 * r2
    upper, lower = 1 + r2 * (k1 + r2 * (k2 + r2 * k3)), 1 + r2 * (k4 + r2 * (k5 + r2 * k6))
    d = upper / lower
    # twice the derivative of d by r²
    slope = 2 * ((k1 + r2 * (2 * k2 + 3 * r2 * k3)) - d * (k4 + r2 * (2 * k5 + 3 * r2 * k6))) / lower
    fx, fy, f2 = r2 + 2 * x * x, r2 + 2 * y * y, 2 * x * y
    x1, y1 = x * d - p1 * f2 + p2 * fx, y * d - p1 * fy + p2 * f2
    jxx = d + x * x * slope - 2 * p1 * y + 6 * p2 * x
    jxy = x * y * slope - 2 * p1 * x + 2 * p2 * y
    jyy = d + y * y * slope - 6 * p1 * y + 2 * p2 * x
    stretch = 1 + b1
    by_xy = np.stack([np.stack([stretch * jxx, stretch * jxy], -1), np.stack([jxy, jyy], -1)], axis=-2)
    radial = [f / lower for f in (r2, r4, r6)] + [-d * f / lower for f in (r2, r4, r6)]
    one, zero = np.ones_like(x), np.zeros_like(x)
    rows = [[stretch * x1, one, zero], [y1, zero, one]]
    for row, size, along, p in ((rows[0], stretch * c, x, (-f2, fx)), (rows[1], c, y, (-fy, f2))):
        moved = [size * along * f for f in radial]
        row += [moved[0], moved[1], size * p[0], size * p[1], *moved[2:]]
    rows[0].append(c * x1)
    rows[1].append(zero)
    return by_xy, np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _usual_sigma(spec: DeviceSpec) -> Array:
    half = spec.half_diagonal_mm
    t2 = (half / spec.nominal_c_mm) ** 2  # of a corner
    main = [0.2 * spec.nominal_c_mm, 0.05 * half, 0.05 * half]
    radial = [0.1 / t2, 0.1 / t2**2, 0.1 / t2**3]  # they move the corner by a tenth of its radius
    p = 0.01 / t2**0.5
    return np.array([*main, radial[0], radial[1], p, p, radial[2], *radial, 0.05])


LENS = Lens(
    name="brown",
    additional=(
        Parameter("k1", "", "radial"),
        Parameter("k2", "", "radial"),
        Parameter("p1", "", "decentring"),
        Parameter("p2", "", "decentring"),
        Parameter("k3", "", "radial"),
        Parameter("k4", "", "radial", usual=False),
        Parameter("k5", "", "radial", usual=False),
        Parameter("k6", "", "radial", usual=False),
        Parameter("b1", "", "affine"),
    ),
    distort=_distort,
    derivatives=_derivatives,
    usual_sigma=_usual_sigma,
)
