"""Whether a device, or the object, was another one from some image on: its focus, or a board that bends.

Residuals grow so little that their sigmas explain them, while parameters are off by several of theirs.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from core.checks.lacking import Lacking
from core.geometry import Projection
from core.geometry.lens import lens_of
from core.model import AdjustedDevice, Adjustment, Array, Concern, Ints
from core.numerics import spaced

SIGNIFICANT = 6.0  # sigmas of a change: of 590 devices whose images were alike 3.4 at most
MATTERS = 1.0  # sigmas, by which it puts a parameter off
LEAST, MOST = 3, 24  # images before and after; of which so many are tried, spread over all
FORMS = 4  # that change: c, and three bends of the object
TOLD = 1e-6  # square of a term, beside what all else makes of it


def tried(count: int) -> Ints:
    """Numbers of the images, of so many, from which on something may be another one."""
    return spaced(count - 2 * LEAST + 1, MOST) + LEAST if count >= 2 * LEAST else np.zeros(0, np.int64)


def changes(adjustment: Adjustment) -> Callable[[int, int, Projection, Array], Array]:
    """Make the terms of images (m, 2, e), px: c, and three bends of the object, from each image on."""
    middle = adjustment.points_mm.mean(axis=0)
    axes = np.linalg.svd(adjustment.points_mm - middle, full_matrices=False)[2]
    half = float(np.abs((adjustment.points_mm - middle) @ axes[:2].T).max()) or 1.0

    def terms(number: int, count: int, found: Projection, xyz: Array) -> Array:
        a, b = ((xyz - middle) @ axes[:2].T / half).T
        bent = found.by_point @ axes[2]
        each = np.stack([found.by_interior[..., 0], *(bent * form[:, None] for form in (a * a, a * b, b * b))], axis=-1)
        after = tried(count) <= number
        return np.asarray((each[..., None, :] * after[:, None]).reshape(*each.shape[:2], -1))

    return terms


def change_concerns(
    adjustment: Adjustment, name: str, device: AdjustedDevice, found: Lacking, first: int
) -> list[Concern]:
    """H0: all images of a device show one c and one object; `found` has the terms of `changes` from `first` on.

    Tested is each image as the first of those that differ. It is told if it puts parameters off by their sigmas.
    """
    terms = [c for c in range(first, len(found.rest) - 1) if found.rest[c, c] > TOLD]
    if not terms:
        return []
    worst = max(terms, key=lambda c: abs(found.sigmas(c)))
    sigmas, amount = abs(found.sigmas(worst)), found.amount(worst)
    off = np.abs(amount * found.by_parameters(worst)) / device.sigma[found.free]
    if sigmas < SIGNIFICANT or off.max() < MATTERS:
        return []
    image, form = divmod(worst - first, FORMS)
    station = adjustment.network.station_names[found.stations[tried(len(found.stations))[image]]]
    parameter = lens_of(device.interior).keys[found.free[int(np.argmax(off))]]
    since = f"from {station.rpartition('/')[0] or station} on ({sigmas:.2g} sigmas)"
    if form == 0:
        text = (
            f"{name}: its c is {amount / device.interior.c_mm:+.2%} another one {since}, which alone puts "
            f"{parameter} off by {off.max():.2g} sigmas: focus, zoom or warmth changed; fix the lens, warm up, and "
            "capture all again"
        )
    else:
        text = (
            f"by {name} the points are bent by {abs(amount):.2g} mm more {since}, which alone puts its {parameter} "
            f"off by {off.max():.2g} sigmas: the board bends as it is turned; hold it elsewhere, or take a stiffer one"
        )
    return [Concern("doubtful", text)]
