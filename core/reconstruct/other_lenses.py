"""Inverse depths where the projector's lens is none that the kernel knows: the same iteration in plain numpy."""

from __future__ import annotations

import numpy as np

from core.geometry import lens_of
from core.model import Array, Floats
from core.reconstruct.system import System

Coordinate = tuple[Floats, Floats, tuple[float, float, float]]

STEPS = 8
LEAST_VARIANCE = 1e-8  # lines², so that a sigma of 0 has a weight


def solve_rows(
    system: System, first: Coordinate, second: Coordinate | None, lead: str, start: int, stop: int
) -> tuple[Array, Array, Array, Array]:
    """Inverse depths of rows start to stop - 1 from one or two projector coordinates.

    Each has values (H, W) in lines, their sigmas, and (k0, kx, ky); `lead` names the first, "u" or "v". Gives, (rows,
    W): inverse depth, its sigma, the last step in lines, and the depth in the projector at q = 0.
    """
    values, _, (k0, kx, ky) = first
    spec, interior = system.devices.projector
    lens = lens_of(interior)
    rays = system.rays[start:stop].astype(np.float64)
    directions = np.concatenate([rays, np.full((*rays.shape[:2], 1), -1.0)], axis=-1)
    X, Y, W = np.moveaxis(directions @ system.matrix.T, -1, 0)
    mx, my, mw = system.vector
    m = values[start:stop].astype(np.float64) - k0
    q = (kx * X + ky * Y - m * W) / (m * mw - kx * mx - ky * my)
    per_line = np.array([1 / spec.pitch_mm[0], -1 / spec.pitch_mm[1]])
    middle = np.array([(spec.width - 1) / 2, (spec.height - 1) / 2])
    observed: list[tuple[int, Array, Array]] = []
    axes = (0, 1) if lead == "u" else (1, 0)
    for axis, (seen, spread, _) in zip(axes, (first,) if second is None else (first, second), strict=False):
        variance = np.nan_to_num(spread[start:stop].astype(np.float64) ** 2, nan=1.0)
        observed.append((axis, seen[start:stop].astype(np.float64), np.maximum(variance, LEAST_VARIANCE)))
    sigma_q, last = np.full(q.shape, np.nan), np.full(q.shape, np.inf)
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            w = 1.0 / (W + mw * q)
            xy = np.stack([(X + mx * q) * w, (Y + my * q) * w], axis=-1)
            along = (system.vector[:2] - xy * mw) * w[..., None]
            lines = lens.distort(interior, xy) * per_line + middle
            slopes = (lens.derivatives(interior, xy)[0] @ along[..., None])[..., 0] * per_line
            right, information, steepest = np.zeros(q.shape), np.zeros(q.shape), np.zeros(q.shape)
            for k, (axis, value, variance) in enumerate(observed):
                rest, slope = value - lines[..., axis], slopes[..., axis]
                weight = slope / variance if k == 0 else np.where(np.isfinite(rest), slope / variance, 0.0)
                right += weight * (rest if k == 0 else np.nan_to_num(rest))
                information += weight * slope
                steepest = np.maximum(steepest, np.abs(slope))
            step = right / information
            q, last = q + step, np.abs(step) * steepest
            sigma_q = 1.0 / np.sqrt(information)
            if not np.any(last > 1e-6):
                break
    return q, sigma_q, np.nan_to_num(last, nan=np.inf), np.ascontiguousarray(W)
