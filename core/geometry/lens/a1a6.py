"""Six additional parameters: A1, A2 radial with their zero at r0, A3, A4 affine, A5, A6 decentring.

The set is the one of Brenner, Böhm, Gühring (1999), section 3; cf. Brown, *Close-range camera calibration* (1971).
With ``r² = x² + y²`` and ``d = A1 (r² - r0²) + A2 (r⁴ - r0⁴)``::

    x' = x + x d + 2 A5 x y + A6 (r² + 2x²) + x0        x" = x' + A3 x' + A4 y'
    y' = y + y d + 2 A6 x y + A5 (r² + 2y²) + y0        y" = y' + A4 x' - A3 y'
"""

from __future__ import annotations

import numpy as np

from core.geometry.lens.record import Lens, Parameter
from core.model import Array, DeviceSpec, Interior


def _distort(interior: Interior, xy: Array) -> Array:
    x, y = xy[..., 0], xy[..., 1]
    a1, a2, a3, a4, a5, a6 = interior.a
    r2, r02 = x * x + y * y, interior.r0_mm**2
    stretch = r2 * (a1 + a2 * r2) + (1 - r02 * (a1 + a2 * r02)) + ((2 * a5) * y + (2 * a6) * x)
    x1, y1 = x * stretch + a6 * r2 + interior.x0_mm, y * stretch + a5 * r2 + interior.y0_mm
    out = np.empty_like(xy)
    out[..., 0], out[..., 1] = (1 + a3) * x1 + a4 * y1, a4 * x1 + (1 - a3) * y1
    return out


def _derivatives(interior: Interior, xy: Array) -> tuple[Array, Array]:
    x, y = xy[..., 0], xy[..., 1]
    a1, a2, a3, a4, a5, a6 = interior.a
    r2, r02 = x * x + y * y, interior.r0_mm**2
    radial1, radial2 = r2 - r02, r2 * r2 - r02 * r02
    d, slope = a1 * radial1 + a2 * radial2, 2 * (a1 + 2 * a2 * r2)
    fx, fy, f2 = r2 + 2 * x * x, r2 + 2 * y * y, 2 * x * y
    x1, y1 = x + x * d + a5 * f2 + a6 * fx + interior.x0_mm, y + y * d + a6 * f2 + a5 * fy + interior.y0_mm
    jxx = 1 + d + x * x * slope + 2 * a5 * y + 6 * a6 * x
    jxy = x * y * slope + 2 * a5 * x + 2 * a6 * y
    jyy = 1 + d + y * y * slope + 2 * a6 * x + 6 * a5 * y
    by_xy, by_parameter = np.empty((*x.shape, 2, 2)), np.empty((*x.shape, 2, 9))

    def affine(out: Array, p: Array | float, q: Array | float) -> None:
        out[..., 0], out[..., 1] = (1 + a3) * p + a4 * q, a4 * p + (1 - a3) * q

    affine(by_xy[..., 0], jxx, jxy)
    affine(by_xy[..., 1], jxy, jyy)
    affine(by_parameter[..., 0], (jxx * x + jxy * y) / interior.c_mm, (jxy * x + jyy * y) / interior.c_mm)
    affine(by_parameter[..., 1], 1, 0)
    affine(by_parameter[..., 2], 0, 1)
    affine(by_parameter[..., 3], x * radial1, y * radial1)
    affine(by_parameter[..., 4], x * radial2, y * radial2)
    by_parameter[..., 0, 5], by_parameter[..., 1, 5] = x1, -y1
    by_parameter[..., 0, 6], by_parameter[..., 1, 6] = y1, x1
    affine(by_parameter[..., 7], f2, fy)
    affine(by_parameter[..., 8], fx, f2)
    return by_xy, by_parameter


def _usual_sigma(spec: DeviceSpec) -> Array:
    half = spec.half_diagonal_mm
    main = [0.2 * spec.nominal_c_mm, 0.05 * half, 0.05 * half]
    radial = [0.1 / half**2, 0.1 / half**4]  # they move the corner by a tenth of its radius
    return np.array([*main, *radial, 0.05, 0.02, 0.01 / half, 0.01 / half])


def _referred(interior: Interior, r0_mm: float) -> Interior:
    """Give the same imaging with the radial terms' zero crossing at another radius.

    Image coordinates scale with c, so a change of r0 leaves ``c (1 - A1 r0² - A2 r0⁴)``, ``c³ A1``, ``c⁵ A2``, ``c²
    A5`` and ``c² A6`` alone. c follows from the first by Newton's method.

    >>> moved = _referred(Interior(12.0, a=(-6e-4, 0, 0, 0, 0, 0), r0_mm=2.5), 0.0)
    >>> round(moved.c_mm, 6)  # 12 (1 + 6e-4 · 2.5²)
    12.045
    """
    if interior.r0_mm == r0_mm:
        return interior
    a1, a2, a3, a4, a5, a6 = interior.a
    c, old2, new2 = interior.c_mm, interior.r0_mm**2, r0_mm**2
    central = c * (1 - a1 * old2 - a2 * old2**2)
    k1, k2 = a1 * c**3, a2 * c**5
    new = central
    for _ in range(20):
        f = new - k1 * new2 / new**2 - k2 * new2**2 / new**4 - central
        new -= f / (1 + 2 * k1 * new2 / new**3 + 4 * k2 * new2**2 / new**5)
    s = c / new
    return Interior(new, interior.x0_mm, interior.y0_mm, (a1 * s**3, a2 * s**5, a3, a4, a5 * s**2, a6 * s**2), r0_mm)


LENS = Lens(
    name="A1..A6",
    additional=(
        Parameter("A1", "mm⁻²", "radial"),
        Parameter("A2", "mm⁻⁴", "radial"),
        Parameter("A3", "", "affine"),
        Parameter("A4", "", "affine"),
        Parameter("A5", "mm⁻¹", "decentring"),
        Parameter("A6", "mm⁻¹", "decentring"),
    ),
    distort=_distort,
    derivatives=_derivatives,
    referred=_referred,
    usual_sigma=_usual_sigma,
)
