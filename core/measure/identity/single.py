"""What an operator sees while picking: the centre of the dot at hand, the grid that follows from the picks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.measure.board import board_from_testfield
from core.measure.identity.picks import check_picks
from core.measure.identity.view import View, first_view, fit_both_tilts, no_view
from core.model import DeviceSpec, Seed, TargetSet, Testfield

FAINTEST = 0.1  # share of the image's contrast below which nothing counts as a dot


def dot_at(image: NDArray, u: float, v: float, *, dark: bool, reach_px: float) -> tuple[float, float] | None:
    """Find the centre of the dot at or next to a position (px); None where there is none.

    Its edge may be as far as `reach_px` from there; `dark` says that dots are darker than the board. A dot is what lies
    above the middle between the darkest and the brightest value near the position, connected, and enclosed by darker
    pixels; where the window cuts it, it is looked at again in a larger one.

    Examples
    --------
    >>> y, x = np.mgrid[0:40, 0:50]
    >>> image = 20 + 150 * np.clip(5.5 - np.hypot(x - 30.3, y - 12.5), 0, 1)
    >>> tuple(round(c, 1) for c in dot_at(image, 25, 15, dark=False, reach_px=6))
    (30.3, 12.5)
    >>> dot_at(image, 10, 30, dark=False, reach_px=6) is None
    True
    """
    from scipy import ndimage

    if not (np.isfinite(u) and np.isfinite(v)):
        return None
    coarse = np.asarray(image[:: max(1, image.shape[0] // 200), :: max(1, image.shape[1] // 200)], np.float64)
    faintest = FAINTEST * float(np.ptp(coarse[np.isfinite(coarse)])) if np.isfinite(coarse).any() else np.inf
    for size in (round(reach_px) + 2, 2 * round(reach_px) + 4, 4 * round(reach_px) + 8):
        x0, y0 = max(0, round(u) - size), max(0, round(v) - size)
        part = np.asarray(image[y0 : max(0, round(v) + size + 1), x0 : max(0, round(u) + size + 1)], np.float64)
        if not part.size or not np.isfinite(part).all():
            return None
        part = ndimage.gaussian_filter(-part if dark else part, 0.8, mode="nearest")  # against single noisy pixels
        if np.ptp(part) <= faintest:
            return None
        level = (part.min() + part.max()) / 2
        labels, _ = ndimage.label(part > level)
        rows, cols = np.nonzero(labels)
        away = np.hypot(cols + x0 - u, rows + y0 - v)
        nearest = int(np.argmin(away))
        if away[nearest] > reach_px:
            return None
        mine = labels[rows, cols] == labels[rows[nearest], cols[nearest]]
        rows, cols = rows[mine], cols[mine]
        cut = min(rows.min(), cols.min()) == 0 or rows.max() == part.shape[0] - 1 or cols.max() == part.shape[1] - 1
        if not cut:
            weight = part[rows, cols] - level
            return float(x0 + weight @ cols / weight.sum()), float(y0 + weight @ rows / weight.sum())
    return None


def predicted_view(testfield: Testfield, camera: DeviceSpec, seeds: Sequence[Seed], where: str = "picks.json") -> View:
    """Find the view of the board that follows from picks alone.

    InputError if they cannot be right: too few, on one line, swapped, beside the image.
    """
    check_picks(board_from_testfield(testfield), seeds, (camera.width, camera.height), where, "either")
    index = testfield.index()
    xyz = testfield.xyz_mm[[index[s.row, s.col] for s in seeds]]
    view = first_view(camera, xyz, np.array([[s.u, s.v] for s in seeds]))
    if view is None:
        raise no_view(where)
    return view


def measured_view(testfield: Testfield, camera: DeviceSpec, targets: TargetSet) -> View | None:
    """Find the view of the board that fits the measured targets best: pose and one radial parameter.

    None for fewer than four targets, and where they lie on one line.
    """
    index = testfield.index()
    at = [index[key] for key in targets.keys]
    start = first_view(camera, testfield.xyz_mm[at], targets.camera_uv) if len(at) >= 4 else None
    if start is None or len(at) < 6:
        return start
    return fit_both_tilts(start, testfield.xyz_mm[at], targets.camera_uv, radial=len(at) >= 12)
