"""Lens models by name. A file in this folder with a `LENS` is one; others may be added to `LENSES`.

The lens of a device maps the collinearity image to the one that is measured. Everything that depends on its form is in
one record (`record.Lens`): names, units, derivatives. Sizes elsewhere follow from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pkgutil import iter_modules

import numpy as np
from numpy.typing import ArrayLike

from core.geometry.lens.record import MAIN, Lens, Parameter
from core.model import Array, DeviceSpec, Interior

LENSES: dict[str, Lens] = {
    lens.name: lens
    for module in iter_modules(__path__)
    if (lens := getattr(import_module(f"{__name__}.{module.name}"), "LENS", None)) is not None
}
DIFFERENCE_MM = 1e-5  # by which slopes are taken: they err by 1e-7, which a step more makes up for
SHORT = 2e-3  # of the principal distance: steps after which the slopes have hardly changed
TOGETHER = 16_384  # places that are inverted at once: they stay in the processor's cache
GRID = 24  # places along each side of an image at which two lenses are compared


def lens_of(device: Interior | DeviceSpec) -> Lens:
    """Look up the lens model of a device."""
    return LENSES[device.model]


def nominal(spec: DeviceSpec) -> Interior:
    """Give what is known of a device before it is calibrated: its maker's focal length, or all of it."""
    if spec.interior is not None:
        return spec.interior
    return LENSES[spec.model].interior(spec.nominal_c_mm, spec.zero_radius_mm)


def distort(interior: Interior, xy: ArrayLike) -> Array:
    """From the collinearity image (x, y) to the measured image (x", y"), both mm, shape (..., 2)."""
    return LENSES[interior.model].distort(interior, np.asarray(xy, dtype=np.float64))


def undistort(interior: Interior, measured_xy: ArrayLike, tolerance_mm: float = 1e-9) -> Array:
    """From the measured image (x", y") back to the collinearity image (x, y), both mm, shape (..., 2).

    Newton's method, with slopes by differences; points where it does not converge within 20 steps (outside the range
    in which the distortion can be inverted) are NaN.
    """
    measured = np.asarray(measured_xy, dtype=np.float64)
    flat = measured.reshape(-1, 2)
    xy = np.empty_like(flat)
    for first in range(0, len(flat), TOGETHER):
        some = slice(first, first + TOGETHER)
        xy[some] = _undistorted(interior, flat[some], tolerance_mm)
    return xy.reshape(measured.shape)


def _undistorted(interior: Interior, measured: Array, tolerance_mm: float) -> Array:
    """Invert the lens for places (n, 2)."""
    bend, seen = LENSES[interior.model].distort, np.ascontiguousarray(measured.T)  # x and y each in a row
    xy = seen - [[interior.x0_mm], [interior.y0_mm]]
    longest = np.inf
    with np.errstate(all="ignore"):
        for _ in range(20):
            there = bend(interior, xy.T).T
            if longest > SHORT * interior.c_mm:  # else the slopes from there serve
                sides = (xy + side[:, None] for side in DIFFERENCE_MM * np.eye(2))
                by_x, by_y = ((bend(interior, side.T).T - there) / DIFFERENCE_MM for side in sides)
                det = by_x[0] * by_y[1] - by_x[1] * by_y[0]
            off = there - seen
            sx, sy = (by_y[1] * off[0] - by_y[0] * off[1]) / det, (by_x[0] * off[1] - by_x[1] * off[0]) / det
            xy[0] -= sx
            xy[1] -= sy
            step = sx * sx + sy * sy
            longest = float(np.sqrt(np.fmax.reduce(step, initial=0.0)))
            if longest <= tolerance_mm:
                break
    return np.where(step <= tolerance_mm**2, xy, np.nan).T


def _raster(spec: DeviceSpec) -> Array:
    """Places spread over a device's image, shape (n, 2), mm."""
    half = np.array([(spec.width - 1) * spec.pitch_mm[0], (spec.height - 1) * spec.pitch_mm[1]]) / 2
    x, y = np.meshgrid(np.linspace(-1, 1, GRID), np.linspace(-1, 1, GRID))
    return np.asarray(np.stack([x.ravel(), y.ravel()], axis=-1) * half)


def regular(spec: DeviceSpec, interior: Interior) -> bool:
    """Whether every place of the image belongs to one direction: the distortion can be inverted and does not fold."""
    xy = undistort(interior, _raster(spec))
    if not np.isfinite(xy).all():
        return False
    J = LENSES[interior.model].derivatives(interior, xy)[0]
    return bool(np.all(np.linalg.det(J) > 0))


def at_radius(interior: Interior, r0_mm: float) -> Interior:
    """Give the same imaging with the radial terms' zero crossing at another radius, where the model has one."""
    referred = LENSES[interior.model].referred
    return interior if referred is None else referred(interior, r0_mm)


def fitted(spec: DeviceSpec, interior: Interior, model: str, names: Sequence[str] = ()) -> tuple[Interior, float]:
    """Say the same by another lens model, as nearly as it can; give what remains over the image, px r.m.s.

    `names` are those of its parameters to use, the usual ones if none are named.
    """
    lens = LENSES[model]
    measured = _raster(spec)
    rays = undistort(interior, measured) / interior.c_mm
    keep = np.isfinite(rays).all(axis=-1)
    measured, rays = measured[keep], rays[keep]
    free = [lens.names.index(name) for name in names or lens.usual]
    p = lens.interior(interior.c_mm, spec.zero_radius_mm).vector
    p[1:3] = interior.x0_mm, interior.y0_mm
    off = measured
    for _ in range(12):
        there = Interior.from_vector(p, spec.zero_radius_mm, model)
        off = measured - lens.distort(there, rays * there.c_mm)
        J = lens.derivatives(there, rays * there.c_mm)[1][..., free].reshape(-1, len(free))
        scale = np.linalg.norm(J, axis=0)
        # of brown's k1 to k6 together some change nothing: steps along them would grow without end; usual ones are 0.01
        p[free] += np.linalg.lstsq(J / scale, off.ravel(), rcond=1e-6)[0] / scale
    return there, float(np.sqrt(np.mean(np.sum((off / spec.pitch_mm) ** 2, axis=-1))))


__all__ = [
    "LENSES", "MAIN", "Lens", "Parameter", "at_radius", "distort", "fitted", "lens_of", "nominal", "regular",
    "undistort",
]  # fmt: skip
