"""Light that reaches a surface by a second way, told by a code: from a facing wall, or a mirror image of the stripes.

It bends phases, and one period alone does not show that. The code's frames do: they have more than two levels, as the
places that send light along are lit or not. Bits somewhat wider than the fringes count. In light from all around they
are nearly alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import islice
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.frames import Image
from core.decode.pairs import BESIDE, SOME, STEP, TILES, smooth_at
from core.decode.surface.moved import moved_edges
from core.decode.tables import CODE, Array, AxisTable, Limits, Singles, lifted, runs_of, sum_of, sums_of
from core.numerics import by_lot, distinct, median_of

LOOKS = 49, 144  # pixels of a tile that are looked at
EDGE_LOOKS = 25  # for edges of bits
FEWEST = 24  # that tell it
NEAREST, FARTHEST = 2, 5  # tiles to either side that tell it for one
BITS = 3  # that tell it
ALONG = 0.3  # of the change of lines from tile to tile one way, by which they count as changing the other way
WIDE, AWAY = 1.9, 0.5  # periods: runs of the bits that tell it; and how far, with `ASIDE`, their edges must be
ASIDE = 0.5  # line
NO_LEVEL = 1.0  # of half the contrast: such a difference is none of levels
LEAST, LEAST_DIRECT = 1e-3, 0.5  # grey values, of half the contrast; part of the light that comes straight
ROUNDS = 6
CELLS = 4.0  # of a code alone, which count as a period
SHOWN, SLIGHT = 3.5, 0.003  # standard deviations, and part of the light, from which there is anything to tell
AT_EDGE = 0.25  # cells
TINY = 1e-30

Groups = NDArray[np.int8]


def second_light(
    images: Sequence[Image], table: AxisTable, limits: Limits, place: Singles
) -> NDArray[np.float32] | None:
    """Find how much light of tiles (TILES, TILES) comes by a second way, as a part of what comes straight.

    From all frames and the decoded coordinates in lines; None where the code does not tell, or shows nothing.
    """
    if table.start != CODE:
        return None
    near = _by_edges(images, table, limits, place) if len(table.period) else None
    if len(table.period) > 1:  # they contradict each other by light from afar
        return near
    chosen, (few, many), part = _bits(table), LOOKS, None
    if len(chosen) > 1 and _part(images, table, limits, place, chosen, few) is not None:
        part = _part(images, table, limits, place, chosen, many)
    return near if part is None else part if near is None else np.maximum(part, near)


def bent_by(part: Singles, table: AxisTable, limits: Limits, place: Singles) -> Singles:
    """Variance (lines²) of coordinates by light that comes by a second way from anywhere.

    It turns phases. Of a code alone it moves the edges: by half of it over how steeply levels change there, and that
    shows in the share of the coordinates that lie at an edge, where a bit is unsure.
    """
    if len(table.period):
        moved = part * (1 + part * part / 8) * table.period[0] / np.float32(2 * np.pi * 2**0.5)
    else:
        y = (place[np.isfinite(place)] + np.float32(0.5)) / table.cell
        at_edges = np.mean(np.abs(y - np.rint(y)) < AT_EDGE) if len(y) else 0.0
        width = table.cell * at_edges / (limits.bit_margin * np.minimum(table.fading[-2:], 1).mean())
        moved = part / 2 / (1 + part) * width
    return np.asarray(np.square(moved), np.float32)


def _period(table: AxisTable) -> float:
    """Of the fringes, lines, or what counts as one of a code alone."""
    return float(table.period[0] if len(table.period) else CELLS * table.cell)


def _part(
    images: Sequence[Image],
    table: AxisTable,
    limits: Limits,
    place: Singles,
    chosen: Sequence[tuple[int, float]],
    pixels: int,
) -> NDArray[np.float32] | None:
    """Find it by so many pixels of a tile."""
    rows, columns = (_places(n, pixels) for n in place.shape)
    here = place[rows][:, columns]
    smooth = smooth_at(place, here, rows, columns)
    if not smooth.any():
        return None
    grey = _shown(images, table, [b for b, _ in chosen], lambda image: image[rows][:, columns])
    levels, groups, noise = _levels(table, limits, grey, here.ravel(), smooth.ravel(), chosen)
    grid, tile = here.shape, (len(rows) // TILES, len(columns) // TILES)
    down, across = steps = _steps(here)
    window = _window((down * tile[0], across * tile[1]), chosen[0][1])

    def sums(values: NDArray[Any]) -> Array:
        means = cv2.resize(values.reshape(grid).astype(np.float32), (TILES, TILES), interpolation=cv2.INTER_AREA)
        tiles = means.astype(float) * (tile[0] * tile[1])
        return np.asarray(cv2.boxFilter(tiles, -1, window[::-1], normalize=False, borderType=cv2.BORDER_CONSTANT))

    beside = _beside(steps)
    groups = np.where(groups == beside(groups, grid), groups, -1)
    weight, beyond = 1 / np.square(noise), np.zeros((TILES, TILES), np.float32)
    freedom = _freedom(groups)
    total, enough = np.maximum(sums(freedom * weight), TINY), sums(freedom) >= FEWEST
    for _ in range(ROUNDS):  # what is usual is so where light comes straight
        own = _apart(levels, groups, 1 / np.square(noise + np.kron(beyond, np.ones(tile, np.float32)).ravel()))
        product = _within(own, beside(own, grid), groups) * weight
        chance = np.sqrt(np.maximum(sums(np.square(product)), 0))
        found = np.where(enough, np.maximum(sums(product), 0), 0)
        beyond = (found / total).astype(np.float32)
        half = np.sqrt(np.where(found > SHOWN * chance, beyond, 0))
        if not (half > SLIGHT).any():
            return None
    return np.where(half > SLIGHT, half / np.maximum(1 - half, LEAST_DIRECT), 0).astype(np.float32)


def _by_edges(images: Sequence[Image], table: AxisTable, limits: Limits, place: Singles) -> Singles | None:
    """Find it by edges of bits that are not where phases say."""
    width, every = place.shape[1], place.reshape(-1)
    row, column = _scattered(place.shape)
    pixel = row * width + column
    here = every[pixel]
    bends = []
    for step in (1, width):
        before, after = (every.take(pixel + side * step, mode="clip") for side in (-BESIDE, BESIDE))
        bends.append(np.abs(before + after - 2 * here))
    bend = np.maximum(*bends)
    smooth = np.asarray(bend <= STEP * median_of(bend[:, ::SOME]), bool)

    def levels(at: NDArray[np.intp], bit: NDArray[np.intp]) -> Singles:
        some, used = pixel.reshape(-1)[at], distinct(bit).tolist()
        grey = _shown(images, table, used, lambda image: image.reshape(-1)[some])
        threshold, contrast = _middle(table, grey)
        found = np.full(len(at), np.nan, np.float32)
        for b in used:
            soft = sum_of(table.rows, 2 + b, grey) + table.sign[b] * threshold
            np.copyto(found, soft / contrast, where=(bit == b) & (grey.max(axis=0) < limits.saturation))
        return found

    return moved_edges(here, smooth, table, levels)


def _shown(
    images: Sequence[Image], table: AxisTable, bits: Sequence[int], of: Callable[[Image], NDArray[Any]]
) -> Singles:
    """Grey values (frames, n) of pixels in the frames that tell some bits and their levels, 0 in all others."""
    told = [0, 1, *(2 + b for b in bits)] if table.has_contrast else range(len(table.rows.first) - 1)
    frames = {f for r in told for f in table.rows.column[table.rows.first[r] : table.rows.first[r + 1]].tolist()}
    seen = {f: of(images[f]).ravel() for f in frames.union(table.fits.frame.tolist() if table.lift != 0 else ())}
    grey = np.zeros((len(images), len(next(iter(seen.values())))), np.float32)
    for frame, values in seen.items():
        grey[frame] = values
    return grey


def _middle(table: AxisTable, shown: Singles) -> tuple[Singles, Singles]:
    """Threshold of the code and half its contrast (n,)."""
    threshold, contrast = lifted(table, shown, sum_of(table.rows, 0, shown), sum_of(table.rows, 1, shown))
    if not table.has_contrast:
        bits, sign = np.stack([*islice(sums_of(table.rows, shown), 2, None)]), table.sign[:, None]
        if not table.has_threshold:
            levels = -sign * bits
            threshold = (levels.max(axis=0) + levels.min(axis=0)) / 2
        contrast = np.abs(bits + sign * threshold).max(axis=0)
    return threshold, np.maximum(contrast, LEAST)


def _places(size: int, pixels: int) -> NDArray[np.intp]:
    """Rows or columns that are looked at: as many in every tile."""
    each = max(1, min(round(pixels**0.5), size // TILES))
    return np.asarray((np.arange(TILES * each) + 0.5) * size / (TILES * each), np.intp)


@lru_cache(maxsize=4)
def _scattered(shape: tuple[int, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of pixels that are looked at for edges, as many in every tile, each anywhere in its own part.

    At even distances they would be in step with the lines, and so would multiples of a number on a tilted surface.
    """
    rows, columns = (_places(n, EDGE_LOOKS) for n in shape)
    down, across = (by_lot(len(rows) * len(columns), k).reshape(len(rows), -1) - 0.5 for k in (0, 1))
    places = (rows[:, None] + down * shape[0] / len(rows), columns + across * shape[1] / len(columns))
    row, column = (np.clip(np.rint(at), 0, n - 1).astype(np.intp) for at, n in zip(places, shape, strict=True))
    return row, column


def _steps(place: Singles) -> tuple[float, float]:
    """Lines by which a pixel that is looked at differs from the next down and across."""
    some = slice(None, None, SOME)
    return median_of(np.abs(np.diff(place[:, some], axis=0))), median_of(np.abs(np.diff(place[some], axis=1)))


def _window(changes: tuple[float, float], run: float) -> tuple[int, int]:
    """How many tiles down and across tell what one has, of such changes of lines from tile to tile: to either side a
    run of the coarsest bit."""
    most = max(changes)
    reach = (min(max(int(np.ceil(run / x)), NEAREST), FARTHEST) if x > ALONG * most else 1 for x in changes)
    return 2 * next(reach) + 1, 2 * next(reach) + 1


def _beside(steps: tuple[float, float]) -> Callable[[NDArray[Any], tuple[int, int]], NDArray[Any]]:
    """Give what takes values (k, n) to those of a neighbour, the way that lines change less: light by a second way is
    alike there, and noise is not."""
    axis = 1 if steps[0] < steps[1] else 2

    def of(values: NDArray[Any], grid: tuple[int, int]) -> NDArray[Any]:
        return np.roll(values.reshape(len(values), *grid), 1, axis).reshape(len(values), -1)

    return of


def _bits(table: AxisTable) -> list[tuple[int, float]]:
    """The finest bits that stay the same for long enough: numbers, and runs in lines."""
    return [(b, run) for b, run in enumerate(runs_of(table)) if run >= WIDE * _period(table)][-BITS:]


def _levels(
    table: AxisTable,
    limits: Limits,
    shown: Singles,
    place: Singles,
    smooth: NDArray[np.bool_],
    chosen: Sequence[tuple[int, float]],
) -> tuple[Singles, Groups, Singles]:
    """Bits as parts of half the contrast (k, n), if each is off (0) or on (1), and -1 where edges are near; and the
    variance of one by noise (n,)."""
    threshold, contrast = _middle(table, shown)
    spread = np.add.reduceat(np.square(table.rows.value), table.rows.first[:-1])
    fit = smooth & (shown.max(axis=0) < limits.saturation)
    size = (len(chosen), len(place))
    levels, groups = np.empty(size, np.float32), np.full(size, -1, np.int8)
    noise = np.zeros(len(place), np.float32)
    for n, (b, run) in enumerate(chosen):
        soft = sum_of(table.rows, 2 + b, shown) + table.sign[b] * threshold
        levels[n] = soft / contrast
        edge = (place + 0.5) / run - (0.5 if table.gray else 0.0)
        clear = np.abs(edge - np.rint(edge)) * run > AWAY * _period(table) + ASIDE
        groups[n] = np.where(fit & clear & (np.abs(1 - np.abs(levels[n])) < NO_LEVEL), soft > 0, -1)
        noise += spread[2 + b] * limits.variance(threshold + soft) / len(chosen)
    return levels, groups, np.asarray(noise / np.square(contrast), np.float32)


def _apart(levels: Singles, groups: Groups, weight: NDArray[np.floating]) -> Singles:
    """Levels in comparison with what is usual where a bit is as bright: the light may change from frame to frame."""
    own = levels.copy()
    for mine in (groups == 0, groups == 1):
        weights = weight * mine
        usual = np.einsum("kn,kn->k", weights, levels) / np.maximum(weights.sum(axis=1), TINY)
        own -= usual[:, None] * mine
    return own


def _freedom(groups: Groups) -> NDArray[np.int8]:
    """Degrees of freedom (n,) of a pixel's bits about the mean of those as bright."""
    counts = (np.count_nonzero(groups == side, axis=0) for side in (0, 1))
    return np.asarray(sum(np.maximum(count - 1, 0) for count in counts), np.int8)


def _within(own: Singles, other: Singles, groups: Groups) -> Singles:
    """Sums of products (n,) of two pixels' bits about the mean of those as bright."""
    product = np.zeros(own.shape[1], np.float32)
    for side in (0, 1):
        mine = groups == side
        mean = (own * mine).sum(axis=0) / np.maximum(np.count_nonzero(mine, axis=0), 1).astype(np.float32)
        product += ((own - mean) * other * mine).sum(axis=0)
    return product
