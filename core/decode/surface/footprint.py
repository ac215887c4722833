"""What no frame's residual shows: coordinates drawn to the brighter side.

A pixel sees the light of its footprint, and sees it where it is reflected most. Of a footprint that is a Gaussian of
variance S, the light L has its middle ``S grad(L) / L`` beside the pixel's, whatever the surface is, and the coordinate
is off by its slope times that. S is the camera's; it is found in the coordinates themselves where the light changes.
What is lit by the blur of its neighbours alone, beyond the rim of a surface, is no measurement.
"""

from __future__ import annotations

from operator import itemgetter
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.decode.kernels.compiled import HALF, INT, ONE, TINY, F, fast, part
from core.decode.options import Flag
from core.decode.tables import Limits, Rows, Shorts, Singles
from core.numerics import median_of, row_median
from core.parallel import run_in_bands

USUAL, DIFFERENT = 0.5, 0.3  # px²: an edge's footprint, its variance and `SHARP`, and by how much cameras differ
UNSURE = 0.3  # part of the correction that may be wrong
NOTICED = 1.2  # times the noise of a grey value: less draws coordinates by less than half of their own noise
REACH, MARGIN = 3, 5  # px from an edge to where it draws no more, and in which the surface must be even
SUMS = np.array(  # over a profile of pixels, `MARGIN` to either side: the middle's height, and bends of a surface
    [
        [0, 0, -1 / 2, 0, 0, 1, 0, 0, -1 / 2, 0, 0],
        [0, 0, 1 / 3, 0, -1, 0, 1, 0, -1 / 3, 0, 0],
        [0, 1, 0, -1, 0, 0, 0, -1, 0, 1, 0],
        [0, 0, 0, 0, 0, 0, 1, 0, -2, 0, 1],
        [1, 0, -2, 0, 1, 0, 0, 0, 0, 0, 0],
    ]
)
BLUNT = 0.4  # part of what edges draw that may be otherwise
STRONG, STRONGEST = 0.1, 2.0  # lines per px² of a footprint that tell it; more where coordinates are steep
LARGEST = 2.0  # lines, differences of coordinates: more, or of so many px, is a jump
SURE = 0.05  # px², a footprint's sigma by edges alone: where it is larger, texture tells more
UNCERTAIN = 0.15  # part of what an edge draws by which its sharpness changes that
APART = 2.4  # sigmas by which places scatter on even surfaces (2.3 at most were seen); at jumps, 2.6 and more
OUTLIER = 4.0  # standard deviations
CLEAR = 5.0  # standard deviations of a change of the light: more is an edge
FADED = 0.07  # part of an edge's change of the light, 3 px from it: where most have more, it is shading
SAMPLE = 1500  # places that tell
SOME = 4096  # places that are worth a thread
BESIDE = F(1)  # px that light has its middle beside the pixel: it comes from its neighbours
BEYOND = F(0.95)  # the same, squared, in footprints: of light that ends 0.8 sigma before the middle
BETWEEN = F(2)  # lines that it may draw a coordinate where it jumps: more tells of neither side
PULLS = 8  # numbers a pixel, see `find_changes`
TEXTURE = F(20)  # sum of four squares of changes, in units of those noticed: noise makes 5.6
ONE_WAY = F(0.75)  # part of the light's changes over five pixels that their sum must be to be an edge's
SHARP, MOST = 0.15, 0.6  # px², and part of it at most, by which an edge's footprint exceeds texture's, see `_change`

_NO_U, _NO_V = np.uint8(Flag.BESIDE | Flag.NO_U), np.uint8(Flag.BESIDE | Flag.NO_V)


def draw_back(
    coordinates: tuple[Singles, Singles],
    lit: tuple[Singles, Singles],
    flags: NDArray[np.uint8],
    rows: Rows,
    limits: Limits,
    cofactor: float,
    even: tuple[bool, bool],
) -> None:
    """Take out, in place, what changes of the light do to coordinates.

    Coordinates and sigmas, float32 (2, pixels), are in lines, NaN where there is none; `lit` has the scene lit evenly,
    ambient light among it, and the fringes' amplitude, (pixels,) grey values. Without image rows the modulation tells
    the light; `cofactor` is its variance in units of the grey values'. `even` says whether u and v change evenly, and
    not by whole cells of a code: the others are not drawn.
    """
    shape = height, width = flags.shape
    place, sigma = (a.reshape(2, *shape) for a in coordinates)
    modulation = lit[1].reshape(shape)
    light = lit[0].reshape(shape) if len(rows.value) else modulation
    scale = float(rows.value @ rows.value) if len(rows.value) else cofactor
    some = slice(None, None, max(1, light.size // SAMPLE))
    known = np.isfinite(coordinates[0][:, some]).any(axis=0) & (lit[1][some] > TINY)
    if not known.any():
        return
    unit = F(median_of(light.ravel()[some][known] / lit[1][some][known]))
    if not len(rows.value):  # it undulates with the patterns
        seen = np.where(np.isfinite(place).any(axis=0), light, np.nan)
        bends = [b[np.isfinite(b)] for b in (np.abs(np.diff(seen, 2, axis=k)) for k in (0, 1))]
        bent = max(np.median(b) if len(b) else 0 for b in bends) ** 2 / 0.45
        limits = limits._replace(dark=limits.dark + F(bent / scale))
    fields, share = (light, modulation, place), F(cofactor / (NOTICED**2 * scale))
    least = tuple(F(NOTICED**2 * scale * n) for n in (limits.dark, limits.shot, limits.floor))
    at, pull = np.empty(light.size, INT), np.empty((light.size, PULLS), F)
    found: list[tuple[int, int]] = []

    def look(first: int, last: int) -> None:
        start, mask = first * width, np.empty(width, np.uint8)
        count = find_changes(first, last, *fields, even, unit, share, least, mask, at[start:], pull[start:])
        found.append((start, start + count))

    run_in_bands(look, height)
    found.sort()
    there = np.concatenate([at[a:b] for a, b in found]), np.concatenate([pull[a:b] for a, b in found])
    grey = limits.variance(light.ravel()[there[0]])
    noise = np.sqrt(scale * grey) / (unit * modulation.ravel()[there[0]] + TINY)
    footprint, doubt = _footprint(place, sigma, *there, noise)
    print_of, inside = F(footprint), F(footprint - _sharper(footprint))
    per_px = print_of, inside, F(np.hypot(UNSURE * footprint, doubt))
    run_in_bands(lambda a, b: find_beside(a, b, print_of, *there, place), len(there[0]), SOME)
    run_in_bands(lambda a, b: take_out(a, b, *per_px, *there, place, sigma, flags), len(there[0]), SOME)


@part
def _change(ahead, behind):  # type: ignore[no-untyped-def]
    """Change of the light per px, about half of it at an edge as sharp as the footprint.

    Of the changes f and b to either side, of equal sign, ``4 f b / (sqrt f + sqrt b)²``: beside a sharp edge, where
    their mean is several times too large, this is the same part of the true one as at the edge itself.
    """
    if ahead * behind <= F(0):
        return F(0)
    size = np.sqrt(abs(ahead)) + np.sqrt(abs(behind))
    return F(4) * ahead * abs(behind) / (size * size + TINY)


@part
def _texture(ahead, behind, farther, before, noise):  # type: ignore[no-untyped-def]
    """Change of the light per px by five pixels, if it changes to and fro, or steadily, by more than noise; else 0.

    Texture has no more than the footprint lets through, and this is what it draws by the footprint's variance alone.
    """
    squares = ahead * ahead + behind * behind + farther * farther + before * before
    total = abs(ahead) + abs(behind) + abs(farther) + abs(before)
    steady = F(8) * min(abs(ahead), abs(behind), abs(farther), abs(before)) > total
    if (abs(ahead + behind + farther + before) > ONE_WAY * total and not steady) or squares < TEXTURE * noise:
        return F(0)
    return (F(7) * (ahead + behind) - farther - before) / F(12)


@part
def _beyond(change, noise):  # type: ignore[no-untyped-def]
    """A change of the light less what its noise (its square that is noticed) makes of it."""
    square = change * change
    return change * max(ONE - F(2 / NOTICED**2) * noise / square, F(0)) if square > noise else F(0)


@part
def _slope(values, row, column, down, right):  # type: ignore[no-untyped-def]
    """Change of values per px along rows or columns, and how far that of one side may differ from it.

    Over two pixels on either side; where there are none, over two a pixel off, which the rim has drawn less.
    """
    height, width = values.shape
    here = values[row, column]
    sides, number, low, high = F(0), 0, F(0), F(0)
    for side in range(-1, 2, 2):
        near_row, near = row + side * down, column + side * right
        far_row, far = row + 2 * side * down, column + 2 * side * right
        if far_row < 0 or far_row >= height or far < 0 or far >= width:
            continue
        slope = HALF * F(side) * (values[far_row, far] - here)
        last_row, last = row + 3 * side * down, column + 3 * side * right
        if last_row >= 0 and last_row < height and last >= 0 and last < width:
            other_row, other = row - side * down, column - side * right
            if (
                other_row < 0
                or other_row >= height
                or other < 0
                or other >= width
                or np.isnan(values[other_row, other])
            ):
                slope = HALF * F(side) * (values[last_row, last] - values[near_row, near])
        if not np.isnan(slope):
            sides += slope
            low, high = (min(low, slope), max(high, slope)) if number > 0 else (slope, slope)
            number += 1
    if number == 0:
        return F(0), F(0)
    return sides / F(number), high - low


@fast
def find_changes(first, last, light, modulation, place, even, unit, share, least, mask, at, pull):  # type: ignore[no-untyped-def]
    """Find the pixels of the rows ``first <= row < last`` where the light changes by more than noise does; count them.

    `unit` is light in units of the modulation, `share` the modulation's variance in units of the noticed change's,
    `least` (dark, shot, floor) of squares of changes that are noticed, `mask` scratch, uint8 (W,). Their numbers `at`,
    int32 (n,), are written, and `pull`, float32 (n, 8), for a footprint of 1 px²: shifts of u and v in lines by edges
    and by texture, what sides of a jump make of them, and how far the middle of the light surely lies beside the
    pixel's along row and column, px.
    """
    height, width = light.shape
    dark, shot, floor = least
    count = 0
    inner = width - 2
    for row in range(first, last):
        here = light[row]
        above, below = light[max(row - 1, 0)], light[min(row + 1, height - 1)]
        lone = row == 0 or row == height - 1
        amid = row > 1 and row < height - 2
        if inner > 0:
            # views from 0 on: an index that may be negative would not compile to vector instructions
            left, middle, right, up, down = here[:inner], here[1:], here[2:], above[1:], below[1:]
            for c in range(inner):
                g = middle[c]
                noise = max(dark + shot * g, floor)
                across, along = (right[c] - g) * (g - left[c]), (down[c] - g) * (g - up[c])
                wide, high = right[c] - left[c], down[c] - up[c]
                steep = high * high if lone else along
                even_so = max(wide * wide, high * high) > F(8) * noise
                mask[c + 1] = (across > noise) | (steep > noise) | even_so
        mask[0] = mask[width - 1] = 1
        for c in range(width):
            if mask[c] == 0 or (np.isnan(place[0, row, c]) and np.isnan(place[1, row, c])):
                continue
            g = here[c]
            noise = spread = max(dark + shot * g, floor)
            right, left = here[min(c + 1, width - 1)] - g, g - here[max(c - 1, 0)]
            down, up = below[c] - g, g - above[c]
            x = _change(right, left) if 0 < c < width - 1 else right + left
            y = _change(down, up) if not lone else down + up
            fine_x = fine_y = F(0)
            if 1 < c < width - 2:
                fine_x = _texture(right, left, here[c + 2] - here[c + 1], here[c - 1] - here[c - 2], noise)
            if amid:
                fine_y = _texture(down, up, light[row + 2, c] - below[c], above[c] - light[row - 2, c], noise)
            if lone or not 0 < c < width - 1:  # at the border one side tells, less surely
                noise *= F(4)
            x = _beyond(x, noise) if fine_x == F(0) else F(0)
            y = _beyond(y, noise) if fine_y == F(0) else F(0)
            fine_x, fine_y = _beyond(fine_x, noise), _beyond(fine_y, noise)
            if x == F(0) and y == F(0) and fine_x == F(0) and fine_y == F(0):
                continue
            own = modulation[row, c] + TINY
            per = ONE / (unit * own)
            sure = max(ONE - np.sqrt(spread * share) / own, HALF)
            x, y, fine_x, fine_y = x * per, y * per, fine_x * per, fine_y * per
            at[count] = row * width + c
            for k in range(2):
                shift, fine, doubt = F(0), F(0), F(0)
                if even[k] and not np.isnan(place[k, row, c]):
                    for across in range(2):
                        edge, all_over = (x, fine_x) if across == 1 else (y, fine_y)
                        if edge == F(0) and all_over == F(0):
                            continue
                        slope, apart = _slope(place[k], row, c, 1 - across, across)
                        if apart <= abs(slope):
                            shift += edge * slope
                            fine += all_over * slope
                        else:
                            doubt += (abs(edge) + abs(all_over)) * (abs(slope) + apart)
                pull[count, k], pull[count, 2 + k], pull[count, 4 + k] = shift, fine, doubt
            pull[count, 6], pull[count, 7] = sure * (x + fine_x), sure * (y + fine_y)
            count += 1
    return count


@fast
def find_beside(first, last, footprint, at, pull, place):  # type: ignore[no-untyped-def]
    """Mark by NaN the pulls, of the numbers ``first <= n < last``, of pixels that are lit from beside.

    Where there is no surface on the dark side, light that ends before a pixel's middle is not of its ray.
    """
    height, width = place.shape[1:]
    for n in range(first, last):
        row, c = at[n] // width, at[n] % width
        x, y = footprint * pull[n, 6], footprint * pull[n, 7]
        off = x * x + y * y
        beside = off > BESIDE * BESIDE or footprint * max(pull[n, 4], pull[n, 5]) > BETWEEN
        if not beside and off > BEYOND * footprint:
            far_row, far = row - INT(np.rint(y / np.sqrt(off))), c - INT(np.rint(x / np.sqrt(off)))
            if 0 <= far_row < height and 0 <= far < width:
                beside = np.isnan(place[0, far_row, far]) and np.isnan(place[1, far_row, far])
        pull[n, 6] = F(np.nan) if beside else x


@fast
def take_out(first, last, footprint, inside, unsure, at, pull, place, sigma, flags):  # type: ignore[no-untyped-def]
    """Draw pixels `at` back by their `pull` for footprints of edges and of texture (`inside`), of sigma `unsure`, px².

    Those lit from beside are dropped.
    """
    width = flags.shape[1]
    for n in range(first, last):
        row, c = at[n] // width, at[n] % width
        for k in range(2):
            if np.isnan(place[k, row, c]):
                continue
            if np.isnan(pull[n, 6]):
                place[k, row, c] = sigma[k, row, c] = F(np.nan)
                flags[row, c] |= _NO_U if k == 0 else _NO_V
                continue
            s, wrong, doubt = sigma[k, row, c], unsure * (pull[n, k] + pull[n, 2 + k]), footprint * pull[n, 4 + k]
            place[k, row, c] -= footprint * pull[n, k] + inside * pull[n, 2 + k]
            sigma[k, row, c] = np.sqrt(s * s + wrong * wrong + doubt * doubt)


class _Profiles(NamedTuple):
    """Sums over profiles of pixels about changes of the light, one for each row of `SUMS`: (5, n, 2)."""

    told: NDArray[np.float64]  # of the coordinates, lines
    drawn: NDArray[np.float64]  # of their shifts for a footprint of 1 px²
    textured: NDArray[np.float64]  # of these, by texture
    most: NDArray[np.float64]  # of their sizes
    own: NDArray[np.float64]  # the coordinates' sigmas, (n, 2)


def _footprint(place: Singles, sigma: Singles, at: Shorts, pull: Singles, noise: Singles) -> tuple[float, float]:
    """The footprint of edges in px², and its sigma, by differences from two pixels about an edge.

    Where edges that stand alone do not tell it, all changes of the light do, unless surfaces end there. Shading tells
    nothing (`noise` (n,) is that of a change of the light), nor do edges and bends of surfaces.
    """
    height, width = place.shape[1:]
    n = np.flatnonzero(np.hypot(pull[:, 6], pull[:, 7]) > CLEAR * noise)
    n = n[:: max(1, 3 * len(n) // SAMPLE)]
    row, column = at[n] // width, at[n] % width
    down = np.abs(pull[n, 7]) > np.abs(pull[n, 6])
    along, size = np.where(down, row, column), np.array([width, height])[down.astype(int)]
    inside = (along >= MARGIN + REACH) & (along < size - MARGIN - REACH)
    step, n = np.tile(np.where(down[inside], width, 1), 3), np.tile(n[inside], 3)
    here = at[n] + np.repeat([-REACH, 0, REACH], len(n) // 3) * step
    pixels = here + np.arange(-MARGIN, MARGIN + 1)[:, None] * step
    number = np.minimum(np.searchsorted(at, pixels), len(at) - 1)
    edge = at[number] == pixels
    fine = np.where(edge[..., None], pull[number, 2:4], 0)  # (pixels of a profile, profiles, axes)
    pulls = np.where(edge[..., None], pull[number, :2], 0) + fine
    seen = place.reshape(2, -1).T[pixels].astype(float)
    dim = np.where(edge, noise[number], noise[n])[[MARGIN - REACH, MARGIN, MARGIN + REACH]].max(axis=0)
    slope = np.abs(seen[MARGIN + REACH] - seen[MARGIN - REACH]) / (2 * REACH)
    told = np.tensordot(SUMS, np.where(np.isnan(seen), 0, seen), 1)
    told[np.tensordot(SUMS != 0, np.isnan(seen), 1)] = np.nan
    drawn, textured, most = (
        np.tensordot(sums, values, 1) for sums, values in ((SUMS, pulls), (SUMS, fine), (np.abs(SUMS), np.abs(pulls)))
    )
    own = sigma.reshape(2, -1).T[here].astype(float)
    x, steep = np.abs(drawn[0]), np.maximum(slope, 1)
    clear = (x > np.maximum(STRONG, CLEAR * dim[:, None] * slope)) & (x < STRONGEST * steep)
    clear &= np.abs(told[0]) < LARGEST * steep
    light = np.where(edge, np.hypot(*pull[number, 6:].T).T, 0)
    far = np.abs(np.arange(len(light))[:, None] - light.argmax(axis=0)) > 2
    alone = (row_median(np.where(far, light, np.nan).T) < FADED * light.max(axis=0))[:, None]
    profiles = _Profiles(told, drawn, textured, most, own)
    by_edges = _fit(profiles, clear & alone & (np.abs(textured[0]) < MOST * x), True)
    return by_edges if by_edges[1] < SURE else min(by_edges, _fit(profiles, clear, False), key=itemgetter(1))


def _fit(profiles: _Profiles, chosen: NDArray[np.bool_], even: bool) -> tuple[float, float]:
    """Fit a footprint and its sigma to those `chosen` of profiles, and of an `even` surface if that is asked.

    If it is not, and they scatter by more than their noise and what a footprint's form explains, they tell nothing.
    """
    told, drawn, textured, most, own = profiles
    expected = np.sqrt(1.5) * own + UNCERTAIN * np.abs(drawn[0])
    value, doubt = USUAL, DIFFERENT
    for _ in range(6):
        left = told + _sharper(value) * textured
        bends = np.abs(left - value * drawn)[1:] > OUTLIER * own + value * BLUNT * most[1:]
        good = chosen & ~np.logical_or.reduce(bends, axis=(0, 2))[:, None] if even else chosen
        if not good.any():
            return USUAL, DIFFERENT
        a, b = drawn[0][good] / expected[good], left[0][good] / expected[good]
        off = np.abs(b - value * a)
        scatter = max(1.0, 1.5 * median_of(off))
        keep, weight = off < OUTLIER * scatter, (scatter / DIFFERENT) ** 2
        known = a[keep] @ a[keep] + weight
        value, doubt = (a[keep] @ b[keep] + USUAL * weight) / known, scatter / np.sqrt(known)
    if not even and scatter > APART * max(1.0, value / USUAL):
        return USUAL, DIFFERENT
    return float(max(value, 0.0)), float(doubt)


def _sharper(footprint: float) -> float:
    """By how much the footprint of texture is smaller than an edge's, px²."""
    return min(SHARP, MOST * footprint)
