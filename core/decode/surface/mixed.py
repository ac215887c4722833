"""Pixels that see two places at once: both sides of a jump, or the rim of the projected field and what is dark beside.

Where coordinates jump, a pixel's grey values are those of both sides, and its phase is of neither. The noise of grey
values shows nothing of that, nor does the light where both sides are as bright. But on one side at least the surface
goes on as it came: a pixel that fits the two before it on neither side is a mixture, and its sigma holds the misfit.

At the rim blur carries light of the last lines beyond the projector's edge, but none comes back from there: the fringe
is cut and its phase wrong by up to a line. Seen alone such a pixel looks sound; it betrays itself by the darkness
beside it.
"""

from __future__ import annotations

import cv2
import numpy as np

from core.decode.kernels.compiled import HALF, F, fast, part
from core.decode.options import Flag, invalidate
from core.decode.tables import Singles
from core.numerics import median_of
from core.parallel import run_in_bands

TORN, BENT = F(12), HALF  # sigmas, and slopes, by which the continuations of both sides differ where there is a jump
VAGUE = 0.25  # of a period
CLEAR = F(24)  # square of a misfit in units of the variance: of that 6 are the noise of three pixels
_TWO = F(2)
EVEN, TORN_APART = np.uint8(0), np.uint8(1)
FARTHEST = 48  # px
LAST = 1.0  # lines: so near the field's edge the darkness may begin where the image ends


def doubt_mixtures(place: Singles, sigma: Singles) -> None:
    """Widen, in place, the sigmas (H, W) in lines of pixels that see two surfaces."""

    def band(first: int, last: int) -> None:
        widen_mixtures(max(first, 2), min(last, len(place) - 2), place, sigma, np.empty(place.shape[1], np.uint8))

    run_in_bands(band, len(place))


def drop_vague(place: Singles, sigma: Singles, flags: np.ndarray, period: float, missing: Flag) -> None:
    """Invalidate, in place, coordinates (H, W) in lines whose sigma leaves the order of their fringe open.

    At two sigmas to either side such a pixel may lie a finest `period` away: its phase is measured, its place is not.
    `missing` is `Flag.NO_U` or `Flag.NO_V`.
    """
    vague = np.divmod(np.flatnonzero(sigma > VAGUE * period), sigma.shape[1])  # few
    invalidate(place, sigma, flags, vague, Flag.UNSURE | missing)


@part
def _misfit(here, s, before, far_before, after, far_after):  # type: ignore[no-untyped-def]
    """Square of the misfit to the better of both sides, 0 where there is no jump or no side goes on."""
    ahead, back = _TWO * before - far_before, _TWO * after - far_after
    limit = TORN * s + BENT * np.fmax(abs(before - far_before), abs(after - far_after))
    apart = abs(ahead - back)
    if np.isnan(apart):
        apart = abs(before - here - here + after)
    best = np.fmin(abs(here - ahead), abs(here - back))
    return F(0) if apart <= limit or np.isnan(best) else best * best


@fast
def widen_mixtures(first, last, place, sigma, mask):  # type: ignore[no-untyped-def]
    """Widen the sigmas of the rows ``first <= row < last``; `mask`, uint8 (W,), is scratch memory."""
    width = place.shape[1]
    inner = width - 4
    for row in range(first, last):
        here, s = place[row], sigma[row]
        up, top, down, bottom = place[row - 1], place[row - 2], place[row + 1], place[row + 2]
        # views from 0 on: an index that may be negative would not compile to vector instructions
        l2, l1, r1, r2 = here[:inner], here[1 : inner + 1], here[3 : inner + 3], here[4:]
        t2, t1, b1, b2, own = top[2:], up[2:], down[2:], bottom[2:], s[2:]
        jumps = EVEN
        for c in range(inner):
            across = abs(_TWO * (l1[c] - r1[c]) - (l2[c] - r2[c]))
            along = abs(_TWO * (t1[c] - b1[c]) - (t2[c] - b2[c]))
            limit = TORN * own[c]
            even = (across <= limit) & (along <= limit)
            mask[c] = EVEN if even | (own[c] != own[c]) else TORN_APART
            jumps |= mask[c]
        if jumps == EVEN:
            continue
        for c in range(2, width - 2):
            if mask[c - 2] != EVEN:
                p, own = here[c], s[c]
                across = _misfit(p, own, here[c - 1], here[c - 2], here[c + 1], here[c + 2])
                square = max(across, _misfit(p, own, up[c], top[c], down[c], bottom[c]))
                if square > CLEAR * own * own:
                    s[c] = np.sqrt(own * own + square)


def drop_rim(u: Singles, sigma: Singles, flags: np.ndarray, lines: float, width: float, missing: Flag) -> None:
    """Invalidate, in place, the coordinates of the last lines of a field whose edge is in the image.

    `u` and `sigma`, (H, W) lines, are of one axis of so many `lines`, `width` that of the rim, `missing` `Flag.NO_U` or
    `Flag.NO_V`.
    """
    rim = np.flatnonzero((u < width - 0.5) | (u > lines - 0.5 - width))
    if len(rim) == 0:
        return
    row, column = np.unravel_index(rim, u.shape)
    here = u[row, column]
    across = np.abs(here - u[row, np.maximum(column - 1, 0)])
    down = np.abs(here - u[np.maximum(row - 1, 0), column])
    slopes = [median_of(known) for step in (across, down) if len(known := step[np.isfinite(step)])]
    slope = max(sum(slopes), 1e-3)
    reach = int(min(FARTHEST, np.ceil(2 * width / slope) + 1))
    beside = cv2.dilate(flags & int(Flag.LOW_MODULATION), np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    last = np.minimum(here + 0.5, lines - 0.5 - here) < LAST
    aside = np.min([row, u.shape[0] - 1 - row, column, u.shape[1] - 1 - column], axis=0)
    lost = (beside[row, column] > 0) | (last & (aside < min(FARTHEST, 2 * LAST / slope + 1)))
    invalidate(u, sigma, flags, (row[lost], column[lost]), Flag.OUTSIDE | missing)
