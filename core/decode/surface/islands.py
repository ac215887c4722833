"""Coordinates that nothing around vouches for: pixels without neighbours, and small groups torn off from all others.

Noise and dirt make words and orders that look sound. Their pixels lie whole periods or cells from those around, and
agree with few others by chance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.decode.kernels.compiled import F, fast, part
from core.decode.options import Flag, invalidate
from core.decode.tables import CODE, SWEEP, AxisTable, Singles
from core.parallel import run_in_bands

# px of a group that agrees by chance: what time stamps burnt into frames gave, of twelve captures of three sequences,
# had 1 to 4
SMALL = 4
SURELY = F(3)  # standard deviations of a difference within which coordinates agree
CELLS = 2.0  # of a code alone, by which neighbours may differ
HALF_PERIOD = 0.5
_NO, _YES = np.uint8(0), np.uint8(1)


def farthest(table: AxisTable) -> float:
    """Lines by which neighbours on one surface may differ: fringes that change faster are not seen."""
    if table.start == SWEEP:
        return float("inf")
    if len(table.period):
        return HALF_PERIOD * float(table.period.min())
    return CELLS * float(table.cell) if table.start == CODE else float("inf")


def drop_islands(
    place: Singles, sigma: Singles, flags: NDArray[np.uint8], missing: Flag, lines: float, as_good: int = 0
) -> None:
    """Invalidate, in place, pixels without neighbours, and groups of up to `SMALL` torn off from those around.

    `place` and `sigma`, (H, W) lines, are of one axis, NaN where there is none; `missing` is `Flag.NO_U` or `NO_V`.
    Neighbours agree by `lines` at least, see `farthest`; their sigmas may allow more. A pixel is not alone with
    neighbours without a coordinate that have one of the flags `as_good`.
    """
    if place.size <= 2 * SMALL:  # there are no surfaces to be torn off from
        return
    islands = np.zeros(place.shape, np.uint8)

    def band(first: int, last: int) -> None:
        seen = place, sigma, flags, np.uint8(as_good), F(lines)
        find_islands(first, last, *seen, np.empty(place.shape[1], np.uint8), np.empty((SMALL, 2), np.intp), islands)

    run_in_bands(band, len(place))
    lost = np.flatnonzero(islands)  # few
    invalidate(place.reshape(-1), sigma.reshape(-1), flags.reshape(-1), lost, Flag.UNSURE | missing)


@part
def _is_island(place, sigma, flags, as_good, lines, row, column, group):  # type: ignore[no-untyped-def]
    """Whether a pixel has no neighbours, or its group is small and torn off; `group`, (SMALL, 2), is scratch memory."""
    height, width = place.shape
    group[0, 0], group[0, 1] = row, column
    size, at, torn, vouched = 1, 0, False, False
    while at < size:
        r, c = group[at]
        for y in range(max(r - 1, 0), min(r + 2, height)):
            for x in range(max(c - 1, 0), min(c + 2, width)):
                away = abs(place[y, x] - place[r, c])
                if np.isnan(away):
                    vouched |= flags[y, x] & as_good != _NO
                    continue
                both = sigma[y, x] * sigma[y, x] + sigma[r, c] * sigma[r, c]
                if away > lines and away * away > SURELY * SURELY * both:
                    torn = True
                    continue
                known = False
                for k in range(size):
                    known |= group[k, 0] == y and group[k, 1] == x
                if not known:
                    if size == len(group):
                        return False
                    group[size, 0], group[size, 1] = y, x
                    size += 1
        at += 1
    return torn or (size == 1 and not vouched)


@fast
def find_islands(first, last, place, sigma, flags, as_good, lines, mask, group, islands):  # type: ignore[no-untyped-def]
    """Mark the islands of the rows ``first <= row < last``; `mask`, uint8 (W,), and `group` are scratch memory."""
    height, width = place.shape
    inner = max(width - 2, 0)
    for row in range(first, last):
        here, up, down = place[row], place[max(row - 1, 0)], place[min(row + 1, height - 1)]
        # views from 0 on: an index that may be negative would not compile to vector instructions
        left, middle, right, above, below = here[:inner], here[1:], here[2:], up[1:], down[1:]
        torn = _NO
        for c in range(inner):
            g = middle[c]
            across = (abs(left[c] - g) <= lines) & (abs(right[c] - g) <= lines)
            alike = across & (abs(above[c] - g) <= lines) & (abs(below[c] - g) <= lines)
            mask[c] = _NO if alike | (g != g) else _YES
            torn |= mask[c]
        for c in range(width if torn != _NO else 0):
            if 0 < c < width - 1 and mask[c - 1] != _NO:
                islands[row, c] = _is_island(place, sigma, flags, as_good, lines, row, c, group)
        for c in (0, width - 1):  # at the border
            if here[c] == here[c]:
                islands[row, c] = _is_island(place, sigma, flags, as_good, lines, row, c, group)
