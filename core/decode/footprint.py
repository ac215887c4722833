"""What no frame's residual shows: coordinates drawn to the brighter side.

A pixel sees the light of its footprint, and sees it where it is reflected most: with reflectance A and a footprint of
covariance S the coordinate is off by ``grad(u) . S . grad(A) / A``. S is the camera's; it is found in the coordinates
themselves where reflectance changes.
"""

from __future__ import annotations

import numpy as np

from core.decode.tables import Array, Singles

USUAL, DIFFERENT = 0.38, 0.15  # px²: twice a footprint's variance, see `_change`, and by how much cameras differ
UNSURE = 0.3  # part of the correction that may be wrong
NOTICED = 0.8  # times the noise of a grey value: three standard deviations of the light's change over a pixel
STRONG = 0.1  # lines per px² of a footprint, second difference that tells it
LARGEST = 0.5  # lines of a correction
OUTLIER = 4.0  # standard deviations


def draw_back(place: Singles, sigma: Singles, gain: Singles, image: Singles, noise: float) -> float:
    """Take out, in place, what changes of the reflectance do to coordinates.

    Parameters
    ----------
    place, sigma : float32 (2, H, W)
        Coordinates and their standard deviations in lines; NaN where there is none.
    gain : float32 (H, W)
        Light of the projector in grey values, NaN where it is not known.
    image : float32 (H, W)
        The scene lit evenly, which tells the light beside those pixels.
    noise : float
        Standard deviation of a grey value.

    Returns
    -------
    footprint : float
        Twice its variance in px², of both directions.
    """
    known = np.isfinite(gain)
    if not known.any():
        return USUAL
    ambient = np.median((image - gain)[known])
    light = np.where(known, gain, np.maximum(image - ambient, 0))
    relative = [_change(light, axis, NOTICED * noise) / gain for axis in (1, 0)]
    drawn = [_slope(p, 1, 2) * relative[0] + _slope(p, 0, 2) * relative[1] for p in place]
    footprint = _footprint(place, sigma, drawn)
    for p, s, d in zip(place, sigma, drawn, strict=True):
        shift = np.clip(np.where(np.isfinite(d), footprint * d, 0), -LARGEST, LARGEST).astype(np.float32)
        p -= shift
        s[:] = np.sqrt(s * s + np.square(UNSURE * shift))
    return footprint


def _change(light: Singles, axis: int, least: float) -> Singles:
    """Change of the light (H, W) per px, about half of it at an edge as sharp as the footprint; 0 below `least`.

    Of the changes f and b to either side, of equal sign, ``4 f b / (sqrt f + sqrt b)²``: beside a sharp edge, where
    their mean is several times too large, this is the same part of the true one as at the edge itself.
    """
    step = np.diff(light, axis=axis)
    ends = [(0, 0), (0, 0)]
    ends[axis] = (1, 0)
    behind = np.pad(step, ends)
    ends[axis] = (0, 1)
    ahead = np.pad(step, ends)
    size = np.sqrt(np.abs(ahead)) + np.sqrt(np.abs(behind))
    change = 4 * np.maximum(ahead * behind, 0) / np.maximum(size, np.float32(1e-6)) ** 2
    return np.where(change > least, np.copysign(change, ahead), 0)


def _slope(values: Singles, axis: int, reach: int) -> Singles:
    """Change of values (H, W) per px along an axis, over `reach` px on either side, or over fewer, or to one side."""
    slope = np.full_like(values, np.nan)
    step = np.diff(values, axis=axis)
    for first, last in ((None, -1), (1, None)):
        to: list[slice] = [slice(None)] * 2
        to[axis] = slice(first, last)
        slope[tuple(to)] = np.where(np.isfinite(step), step, slope[tuple(to)])
    for r in range(1, reach + 1):
        ahead, behind, middle = ([slice(None)] * 2 for _ in range(3))
        ahead[axis], behind[axis], middle[axis] = slice(2 * r, None), slice(None, -2 * r), slice(r, -r)
        wide = (values[tuple(ahead)] - values[tuple(behind)]) / np.float32(2 * r)
        slope[tuple(middle)] = np.where(np.isfinite(wide), wide, slope[tuple(middle)])
    return slope


def _footprint(place: Singles, sigma: Singles, drawn: list[Singles]) -> float:
    """Variance of the footprint by second differences along rows, weighted with what is usual."""
    found: list[tuple[Array, Array]] = []
    for p, s, d in zip(place, sigma, drawn, strict=True):
        bent = d[:, :-2] - 2 * d[:, 1:-1] + d[:, 2:]
        row, column = np.nonzero(np.abs(bent) > STRONG)
        seen = p[row, column] - 2 * p[row, column + 1] + p[row, column + 2]
        noise = np.sqrt(6.0) * s[row, column + 1]
        good = np.isfinite(seen) & (np.abs(seen) < 2 * LARGEST)
        found.append(((bent[row, column] / noise)[good].astype(float), (seen / noise)[good].astype(float)))
    x, y = (np.concatenate(each) for each in zip(*found, strict=True))
    value = USUAL
    for _ in range(3):
        left = y - value * x
        keep = np.abs(left) < OUTLIER * max(1.0, 1.5 * float(np.median(np.abs(left)))) if len(left) else left > 0
        value = (x[keep] @ y[keep] + USUAL / DIFFERENT**2) / (x[keep] @ x[keep] + 1 / DIFFERENT**2)
    return float(max(value, 0.0))
