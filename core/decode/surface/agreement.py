"""How far the periods of an axis contradict each other: what that adds to sigma, and where it leaves the order open.

Every period tells the coordinate by itself. By what two differ beyond their noise, both are wrong: through light that
is reflected twice, a response that is not the same everywhere, a lens that blurs unlike the model. It differs from
place to place, so tiles of the image tell it each for themselves. Errors that all periods share stay unseen.

Where there is no code, the periods' differences also tell the order of the fringe. Where many pixels lie about halfway
between two orders, and noise does not explain that, others have passed the middle and been miscounted.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.frames import Image, Numbers
from core.decode.kernels.compiled import HALF, TILE
from core.decode.kernels.fringes import TWO_PI, orders_stand
from core.decode.kernels.kernel import decode_pixels, scratch_for
from core.decode.noise import MEDIAN_OF_SQUARE
from core.decode.options import Flag, invalidate
from core.decode.pairs import FEWEST, TILES, Pairs, look_at, median_around, smooth_at
from core.decode.surface.beats import beating
from core.decode.tables import PHASES, SWEEP, Array, AxisTable, Limits, Rows, Singles, no_axis
from core.numerics import distinct, erf, median_of, row_median

SHOWN = 1.2  # times what noise alone makes of the median square, from which there is anything to tell
FAR = 0.4  # turns that a step of the way to the finest phase must round, and nearly rounds to the next
OPEN, CHANCE, ENOUGH = 0.08, 2.0, 100  # part of so many pixels that do, besides so many times what noise alone makes
REACH = 5  # tiles: what leaves orders open in a tile may do so around it
# square of the mean cosine of what a step rounds by that of its scatter within pairs: errors of up to 0.33 turns, as of
# a sine, or of 0.29 in their standard deviation; and cosine within pairs below which noise hides them
ASTRAY, CLEAR = 0.04, 0.1
CERTAINLY = 0.25  # turns that leave every order open
HARMONICS, OUTSIDE, HOLD = 4, 25.0, 1e-6  # of a phase by which a period errs; squares by their median, of other errors
ROWS = 64  # of the image that are judged at once


class Contradiction(NamedTuple):
    """Of tiles of the image, float32 (TILES, TILES): variances beyond noise.

    `lines` is that of the coordinate (lines²). `turns` is that of a phase (turns²) within `REACH` of tiles whose orders
    it leaves open, but for sound ones that others join with the rest, and 0 elsewhere. `part` is how much light comes
    by a second way, of what comes straight, if that is shown.
    """

    lines: Singles
    turns: Singles
    part: Singles | None


def contradiction(
    images: Sequence[Image],
    table: AxisTable,
    limits: Limits,
    image_rows: Rows,
    plain: tuple[Numbers, Numbers],
    coordinates: Singles,
) -> Contradiction | None:
    """Find by what the two finest periods contradict each other beyond their noise; None where they agree.

    `plain` are the white frames and the black ones, `coordinates` those decoded.
    """
    if table.start == SWEEP or len(table.period) < 2:
        return None
    pairs = look_at(coordinates)
    shown = [image[np.ix_(pairs.rows, pairs.columns)] for image in images]
    place, turns, variance, lit, amplitude = decoded_at(shown, table, limits, image_rows)
    period = table.period[:, None]
    apart = period * turns - (place + HALF)
    apart -= period * np.rint(apart / period)
    spread = period**2 * variance
    finest = np.argsort(table.period)[:2]
    difference, noise = np.diff(apart[finest], axis=0)[0], spread[finest].sum(axis=0)
    weight = 1 / spread / np.sum(1 / spread, axis=0)
    own = _own(difference, noise, turns[finest], place)
    rest = difference - (own[1] - own[0])
    square, bent = rest**2, np.sum(weight[finest] * own, axis=0) ** 2
    of_both = np.sum(period[finest] ** 2)
    share = np.sum((weight * period) ** 2, axis=0) / of_both  # if all are as wrong, in turns
    seen = np.where(np.isfinite(place), np.array([square / noise, square, noise, share]), np.nan)
    tiles = seen.reshape(4, *pairs.in_tiles).transpose(0, 1, 3, 2, 4).reshape(4 * TILES**2, -1)
    medians = row_median(tiles).reshape(4, TILES, TILES)
    few = np.isfinite(tiles).sum(axis=1).reshape(4, TILES, TILES)[0] < FEWEST
    whole = row_median(seen)
    shown_anywhere = whole[0] > SHOWN * MEDIAN_OF_SQUARE
    left_open, astray, sound = _left_open(pairs, table, turns, variance, lit)
    part = None
    if plain[0] and plain[1]:
        white, black = ([shown[n].ravel() for n in some] for some in plain)
        light = np.asarray((np.mean(white, axis=0) - np.mean(black, axis=0)) / 2, np.float32)
        known = np.isfinite(place) & (np.max(white, axis=0) < limits.saturation)
        steps = len(distinct(table.fits.frame[: table.fits.first[1]]))
        mine = amplitude, light, difference / np.sqrt(noise), turns[0], steps
        if beating(pairs, known, *mine) is not None:  # it may be that of pixels at steps, which are looked for but then
            here = coordinates[pairs.rows][:, pairs.columns]
            part = beating(pairs, known & smooth_at(coordinates, here, pairs.rows, pairs.columns).ravel(), *mine)
    if not shown_anywhere and not left_open.any() and part is None:
        return None
    smooth = median_around(np.where(few, np.nan, _beyond(medians) * medians[3]))
    lines = np.nan_to_num(smooth, nan=float(_beyond(whole) * whole[3]))
    known = np.isfinite(place)
    lines += float(bent[known].mean()) if known.any() else 0.0
    turned = np.nan_to_num(np.where(left_open, _beyond(medians) / of_both, 0.0))
    turned = np.maximum(turned, np.where(astray, CERTAINLY**2 / table.step_error[-1].sum(), 0.0)).astype(np.float32)
    around = np.asarray(cv2.dilate(turned, np.ones((REACH, REACH), np.uint8)), np.float32)
    around[_joined(sound & ~left_open, around == 0)] = 0
    return Contradiction(np.where(shown_anywhere | left_open, lines, 0.0).astype(np.float32), around, part)


def _joined(sound: NDArray[np.bool_], beyond: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Sound tiles (TILES, TILES) that others join with most of those beyond the reach of all that leaves orders open.

    What bends phases changes steadily: it does not pass half a turn from tile to tile without leaving orders open.
    """
    _, part = cv2.connectedComponents(sound.astype(np.uint8), connectivity=4)
    largest = np.bincount(part[sound & beyond], minlength=1).argmax()
    return sound & (part == largest)


def _own(difference: Singles, noise: Singles, turns: Singles, place: Singles) -> Singles:
    """By what (lines) either of two periods errs as its phase says, the same all over the image, (2, n).

    Lamps that flicker and responses do that; it is nothing of one period that another errs by. What harmonics of both
    phases explain in one half of the lines must explain the other half; else nothing does.
    """
    known = np.isfinite(place)
    square = np.where(known, difference**2 / noise, 0)
    known &= square < OUTSIDE * median_of(square[known]) if known.any() else known
    angle = TWO_PI * turns[:, None] * np.arange(1, HARMONICS + 1)[:, None]
    waves = np.concatenate([np.cos(angle), np.sin(angle)], axis=1)
    design = np.where(known, np.concatenate([waves.reshape(-1, len(place)), np.ones((1, len(place)))]), 0)
    weight, own = np.where(known, 1 / noise, 0), np.zeros_like(turns)
    upper = place > median_of(place[known]) if known.any() else known
    for half in (upper, ~upper):
        some = design * (weight * half)
        normal = some @ design.T
        normal[np.diag_indices(len(normal))] *= 1 + HOLD
        parts = np.linalg.solve(normal + np.eye(len(normal)) * HOLD, some @ np.where(known, difference, 0))[:-1]
        explained = np.einsum("jk,jkn->jn", parts.reshape(2, -1), waves)
        own = np.where(half, own, explained)
    own *= np.array([[-1.0], [1.0]], np.float32)  # it is the second's less the first's
    left = np.sum((weight * (difference - own[1] + own[0]) ** 2)[known])
    return own if left < np.sum((weight * difference**2)[known]) else np.zeros_like(own)


def _left_open(
    pairs: Pairs, table: AxisTable, turns: Singles, variance: Singles, lit: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]:
    """In which tiles (TILES, TILES) more steps nearly round to the next order than noise explains; where the most; and
    which have few of their own.

    By how much a step rounds should be about 0, and scatter no more than two of a pair differ.
    """
    if table.start != PHASES:
        return (np.zeros((TILES, TILES), bool),) * 3
    rounded, far, chance = _rounded(table, turns, variance)
    sums = [np.where(lit, each, 0).reshape(pairs.in_tiles).sum(axis=(1, 3)) for each in (far, chance, 1)]
    halfway, by_chance, count = (cv2.blur(each.astype(np.float64), (3, 3)) * 9 for each in sums)
    sound = (count >= ENOUGH) & (sums[0] <= OPEN * sums[2])
    left_open = (count >= ENOUGH) & (halfway > OPEN * count + CHANCE * by_chance)
    astray, several = np.zeros_like(left_open), halfway > OPEN * count
    if not several.any():
        return left_open, astray, sound
    both = np.logical_and(*pairs.split(lit))
    number = pairs.around(both)
    for away in rounded:
        angle = TWO_PI * away
        (c, d), (s, t) = pairs.split(np.cos(angle)), pairs.split(np.sin(angle))
        mean, alike = (pairs.around(each * both) / np.maximum(number, 1) for each in ((c + d) / 2, c * d + s * t))
        astray |= (number >= ENOUGH) & (alike > CLEAR) & (np.maximum(mean, 0) ** 2 < ASTRAY * alike)
    astray &= several
    return left_open | astray, astray, sound


def _rounded(table: AxisTable, turns: Singles, variance: Singles) -> tuple[list[Singles], Array, Array]:
    """By how much (turns) every step of pixels (n,) is rounded; which lie about halfway between two orders in any, and
    how probable noise makes that."""
    middle = HALF * (table.lines - 1)
    far, chance = np.zeros((2, turns.shape[1]))
    place, rounded = np.zeros_like(far), []
    for s, (step, error, beat) in enumerate(zip(table.steps, table.step_error, table.step_period, strict=True)):
        away = step @ turns - ((place if s else middle) + HALF) / beat
        away -= np.rint(away)
        place = (place if s else middle) + beat * away
        if s:
            rounded.append(away.astype(np.float32))
            far = np.maximum(far, np.abs(away) > FAR)
            chance += 1 - erf(FAR / np.sqrt(2 * (error @ variance)))
    return rounded, far, chance


def widen(sigma: Singles, variance: Singles) -> None:
    """Add a variance (lines²) by tiles of the image to standard deviations (H, W) in lines, in place."""
    more = cv2.resize(variance, sigma.shape[::-1], interpolation=cv2.INTER_NEAREST)
    np.sqrt(sigma * sigma + more, out=sigma)


def refuse_open_orders(
    images: Sequence[Image],
    table: AxisTable,
    limits: Limits,
    image_rows: Rows,
    turns: Singles,
    axis: tuple[Singles, Singles, np.ndarray, Flag],
) -> int:
    """Invalidate, in place, coordinates whose order a contradiction of the periods leaves open; give their number.

    `turns`, (TILES, TILES), are of a `Contradiction`; `axis` has coordinates and sigmas in lines and flags, each (H,
    W), and `Flag.NO_U` or `Flag.NO_V`.
    """
    place, sigma, flags, missing = axis
    height, width = place.shape
    lost = 0
    more = cv2.resize(turns, (width, height), interpolation=cv2.INTER_NEAREST)
    for top in range(0, height, ROWS):
        band = slice(top, min(top + ROWS, height))
        row, column = np.nonzero((more[band] > 0) & np.isfinite(place[band]))
        if len(row) == 0:
            continue
        row += top
        found, phases, variance, *_ = decoded_at([image[row, column] for image in images], table, limits, image_rows)
        stand = np.empty(len(row), np.bool_)
        orders_stand(table, phases, variance, more[row, column], found, stand)
        row, column = row[~stand], column[~stand]
        invalidate(place, sigma, flags, (row, column), Flag.DISAGREEMENT | missing)
        lost += len(row)
    return lost


def _beyond(medians: Array) -> Array:
    """Variance (lines²) of a difference beyond that by noise, from medians of its square and of that by noise."""
    return np.asarray(np.maximum(medians[1] / MEDIAN_OF_SQUARE - medians[2], 0))


def decoded_at(
    shown: Sequence[Image], table: AxisTable, limits: Limits, image_rows: Rows
) -> tuple[Singles, Singles, Singles, NDArray[np.bool_], Singles]:
    """Coordinates (n,), NaN where invalid; phases (turns) and their variances (J, n); what is lit; the amplitude."""
    count = shown[0].size
    addresses = np.array([image.ctypes.data for image in shown], np.uint64)
    place, sigma, others = np.empty((3, 2, count), np.float32)
    flags = np.empty(count, np.uint8)
    out = (place, sigma, *others, flags)
    tables, plain = (table, no_axis()), np.arange(len(shown), dtype=np.int32)
    scratch = scratch_for(tables)
    phases = np.empty((2, len(table.period), count), np.float32)
    for first in range(0, count, TILE):  # of the last tile the phases stay in the scratch memory
        last = min(first + TILE, count)
        decode_pixels(first, last, addresses, shown[0].itemsize, limits, image_rows, plain, tables, scratch, out)
        phases[:, :, first:last] = scratch.phases[:2, :, : last - first]
    return place[0], phases[0], phases[1], flags & int(Flag.LOW_MODULATION | Flag.SATURATED) == 0, others[0]
