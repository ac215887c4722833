"""Orders of fringes that noise leaves open in a pixel alone, told by those around.

A pixel too noisy for several periods to tell its order is refused. On a surface the plane through the coordinates
around says it to far less than a period. Where these lie all around it is enough that all phases fit the plane; where
the plane is prolonged, beyond an edge of the surface perhaps, the open pixels around must together be far likelier on
it than in any other orders.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.decode.frames import Image
from core.decode.kernels.compiled import HALF, ONE, F, fast, part
from core.decode.kernels.fringes import EVIDENCE, FITTING, fit_at, search
from core.decode.options import Flag
from core.decode.surface.agreement import decoded_at
from core.decode.tables import CODE, AxisTable, Limits, Rows, Shorts, Singles
from core.parallel import run_in_bands

WORTH = 0.002  # of the image, from which open orders are looked at
REACH, NEAR = 3, 2  # px around, whose coordinates make the plane, and whose phases are held against it
FEWEST = 8  # coordinates that make a plane
SURELY = F(5)  # standard deviations by which a pixel may differ from the plane
QUARTER, ROUGH = F(0.25), F(1 / 16)  # of the finest period: as far as it may differ; scatter of a plane's points
FLAT = F(1e-3)  # of its points' spread both ways: less is a line, not a plane
AMID = F(0.08)  # variance of the plane by that of its points, where these lie all around: beside an edge it is 0.2
AGAINST = F(6)  # by how much a pixel amid others may itself be likelier in another order, as twice a logarithm
PASSES = 30  # what was told tells those beside
ENOUGH = 0.01  # of the open ones: a pass that tells fewer is the last
AXES = int(Flag.NO_U | Flag.NO_V)


class Open(NamedTuple):
    """Pixels whose order is open, n of them."""

    row: Shorts
    column: Shorts
    turns: Singles  # (periods, n)
    variance: Singles  # (periods, n), turns²
    likeliest: Singles  # (3, n): the likeliest place, chi squared there and at the likeliest of all others
    number: Shorts  # (H, W): which pixel it is, -1 for all others


def ask_neighbours(
    images: Sequence[Image],
    table: AxisTable,
    limits: Limits,
    image_rows: Rows,
    axis: tuple[Singles, Singles, NDArray[np.uint8], Flag],
    used: int,
) -> None:
    """Set, in place, coordinates whose order noise leaves open, where those around tell it.

    `axis` has coordinates and sigmas in lines and flags, each (H, W), and `Flag.NO_U` or `Flag.NO_V`; `used` are those
    of all axes with frames.
    """
    place, sigma, flags, missing = axis
    if len(table.period) < 2:  # phases of one alone fit a plane by chance
        return
    coded = table.start == CODE  # what phases tell apart repeats then, and says nothing of a plane that is prolonged
    why = flags & np.uint8(255 - AXES - int(Flag.DISAGREEMENT))  # phases too noisy seem to contradict each other, too
    unsure = (why == int(Flag.UNSURE)) & (flags & np.uint8(missing) != 0)
    if np.count_nonzero(unsure) < WORTH * place.size:
        return
    row, column = (each.astype(np.int32) for each in np.nonzero(unsure))
    _, turns, variance, *_ = decoded_at([image[row, column] for image in images], table, limits, image_rows)
    number = np.full(place.shape, -1, np.int32)
    number[row, column] = np.arange(len(row))
    pixels = Open(row, column, turns, variance, np.empty((3, len(row)), np.float32), number)
    run_in_bands(partial(weigh_orders, table, pixels), len(row), 4096)
    left = np.arange(len(row), dtype=np.int32)
    for _ in range(PASSES):
        found = np.empty((2, len(left)), np.float32)
        run_in_bands(partial(tell_orders, left, pixels, table.period, coded, place, sigma, found), len(left), 4096)
        told = np.isfinite(found[0])
        here = row[left[told]], column[left[told]]
        place[here], sigma[here] = found[:, told]
        rest = flags[here] & np.uint8(255 - missing)
        flags[here] = np.where(rest & np.uint8(used), rest, rest & np.uint8(AXES))
        left = left[~told]
        if np.count_nonzero(told) < ENOUGH * len(told) or len(left) == 0:
            return


@fast
def weigh_orders(table, pixels, first, last):  # type: ignore[no-untyped-def]
    """Write the likeliest places of pixels first to last - 1."""
    for i in range(first, last):
        found, best, second = search(table, pixels.turns, pixels.variance, F(0), i, F(0))
        pixels.likeliest[0, i], pixels.likeliest[1, i], pixels.likeliest[2, i] = found, best, second


@part
def _evidence(pixels, periods, i, place):  # type: ignore[no-untyped-def]
    """By how much a pixel is likelier in the order nearest to a place than in any other, as twice a logarithm."""
    found, best, second = pixels.likeliest[0, i], pixels.likeliest[1, i], pixels.likeliest[2, i]
    if abs(found - place) < HALF * periods[0]:
        return second - best
    return best - fit_at(periods, pixels.turns, pixels.variance, F(0), i, place)[2]


@fast
def tell_orders(left, pixels, periods, coded, place, sigma, found, first, last):  # type: ignore[no-untyped-def]
    """Write coordinates and sigmas of the pixels ``left[first:last]`` to `found` (2, n); NaN where they stay open.

    `place` and `sigma` are of the whole image.
    """
    height, width = place.shape
    for k in range(first, last):
        i = left[k]
        r, c = pixels.row[i], pixels.column[i]
        found[0, k], found[1, k] = F(np.nan), F(np.nan)
        n, base, noise = F(0), F(0), F(0)
        sx, sy, sxx, sxy, syy, g, gx, gy, gg = F(0), F(0), F(0), F(0), F(0), F(0), F(0), F(0), F(0)
        for y in range(max(r - REACH, 0), min(r + REACH + 1, height)):
            for x in range(max(c - REACH, 0), min(c + REACH + 1, width)):
                value = place[y, x]
                if value != value:
                    continue
                base = value if n == F(0) else base
                dx, dy, z = F(x - c), F(y - r), value - base
                n, sx, sy, sxx, sxy, syy = n + ONE, sx + dx, sy + dy, sxx + dx * dx, sxy + dx * dy, syy + dy * dy
                g, gx, gy, gg = g + z, gx + z * dx, gy + z * dy, gg + z * z
                noise += sigma[y, x] * sigma[y, x]
        if n < F(FEWEST):
            continue
        sx, sy, g, noise = sx / n, sy / n, g / n, noise / n
        sxx, sxy, syy = sxx - n * sx * sx, sxy - n * sx * sy, syy - n * sy * sy
        gx, gy, gg = gx - n * g * sx, gy - n * g * sy, gg - n * g * g
        det = sxx * syy - sxy * sxy
        if not det > FLAT * n * n:
            continue
        a, b = (gx * syy - gy * sxy) / det, (gy * sxx - gx * sxy) / det
        scatter = max((gg - a * gx - b * gy) / (n - F(3)), noise)
        if scatter > F(9) * noise + ROUGH * ROUGH * periods[0] * periods[0]:
            continue
        expected = base + g - a * sx - b * sy
        leverage = ONE / n + (sx * sx * syy - F(2) * sx * sy * sxy + sy * sy * sxx) / det
        shift, weight, misfit = fit_at(periods, pixels.turns, pixels.variance, F(0), i, expected)
        allowed = SURELY * SURELY * (ONE / weight + scatter * (ONE + leverage))
        if misfit > FITTING or shift * shift > min(allowed, QUARTER * QUARTER * periods[0] * periods[0]):
            continue
        own = _evidence(pixels, periods, i, expected)
        together = F(0)
        if leverage > AMID and not coded:
            for y in range(max(r - NEAR, 0), min(r + NEAR + 1, height)):
                for x in range(max(c - NEAR, 0), min(c + NEAR + 1, width)):
                    m = pixels.number[y, x]
                    if m >= 0:
                        there = expected + a * F(x - c) + b * F(y - r)
                        together += _evidence(pixels, periods, m, there)
        if own > -AGAINST if leverage <= AMID else together > EVIDENCE:
            found[0, k], found[1, k] = expected + shift, np.sqrt(ONE / weight)
