"""Coordinates by the likelihood of all frames of an axis, for words that only a look-up tells apart.

A pixel at projector coordinate u sees ``g_f = b + s T_f(u)`` in frame f: T_f are the pattern's lines, each a box,
blurred by a Gaussian. First the place is looked up whose values fit best, whatever b and s are. It must fit better than
every place elsewhere by `MARGIN`; where it does not, or neighbours that agree with each other say otherwise, theirs is
taken if it fits. Then u, b and s are adjusted by least squares with the noise of every grey value. The blur is found
from the same residuals, in tiles of the image.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.decode.compiled import fast
from core.decode.noise import Noise
from core.decode.options import DecodeOptions, Flag
from core.errors import InputError
from core.model import PhaseMap
from core.numerics import erf
from core.parallel import run_in_bands
from core.patterns import Axis, Pattern, axis_of, brightness, level_of, use_of
from core.progress import Progress

Image = NDArray[np.uint8] | NDArray[np.uint16]
Array = NDArray[np.float64]
Singles = NDArray[np.float32]

PER_LINE = 8  # entries of the tables; between them they are interpolated
BLURS = np.round(np.geomspace(0.25, 2.4, 49), 4)  # lines
COARSE = 3  # so manieth is tried first, then each around the best
MARGIN = 16.0  # by which the squares (noise = 1) elsewhere must be greater: exp(-8) for one rival
ELSEWHERE = 1  # line: nearer than this is the same place
FEW = 10  # frames: their words are so much alike that places are looked up on quarter lines, else on half lines
MISFIT = 0.08  # of the contrast, for each frame: what blur and box do not explain; twice what the virtual rig shows
ROUNDS = 5  # of the adjustment
SAMPLE = 6000  # pixels that tell blur and noise
TILES = 6, 8  # of the image, each with its blur
NEIGHBOURS = 7  # px: of those around, the median predicts
ALIKE = 3.0  # lines by which neighbours' places differ that agree with each other
NEAR = 1.0  # lines that a place may move while it is adjusted
RIM = 0.5  # lines: so near the field's edge its fading light is taken for a place on it
FEWEST = 4  # frames: three unknowns and one that tells whether they fit

F = np.float32


@dataclass(frozen=True)
class _Book:
    """The words of one axis.

    `frames` are the numbers of its frames and of those lit evenly, `fine` (blurs, entries, k) their values on a fine
    grid of lines, from line -1 on.
    """

    frames: tuple[int, ...]
    lines: int
    fine: Singles

    @property
    def grid(self) -> int:
        """Places on a line that are looked up."""
        return 4 if len(self.frames) <= FEW else 2

    def places(self, best: NDArray[np.int32]) -> Singles:
        """Give what was looked up in lines."""
        return (best / F(self.grid) - F(0.5)).astype(np.float32)

    def find(self, blur: int) -> Singles:
        """Values (k, m) at the places looked up, from line -1/2 on, centred and of unit norm."""
        rows = self.fine[blur, PER_LINE // 2 : (self.lines + 1) * PER_LINE - PER_LINE // 2 + 1 : PER_LINE // self.grid]
        centred = rows - rows.mean(axis=1, keepdims=True)
        norm = np.maximum(np.sqrt(np.sum(centred**2, axis=1)), F(1e-3))
        return np.ascontiguousarray((centred / norm[:, None]).T)


def has_words(patterns: Sequence[Pattern], axis: Axis) -> bool:
    """Whether an axis has frames that only a look-up decodes."""
    return any(axis_of(p) == axis and use_of(p) == "word" for p in patterns)


def decode_words(
    patterns: Sequence[Pattern],
    images: Sequence[Image],
    lines: tuple[int, int] | None,
    options: DecodeOptions,
    where: str,
    progress: Progress,
    others: Callable[[list[int]], PhaseMap],
) -> PhaseMap:
    """Decode the axes that have words here, and the other one, if any, as always.

    Parameters
    ----------
    others : callable
        Decodes the frames of these numbers, those of the other axis and the evenly lit ones.

    Raises
    ------
    InputError
        If an axis has too few frames, or its words repeat.
    """
    height, width = images[0].shape
    blank = np.full((height, width), np.nan, np.float32)
    flags = np.full((height, width), Flag.NO_U | Flag.NO_V, np.uint8)
    result = PhaseMap(blank, blank, blank, blank, np.zeros_like(blank), np.zeros_like(blank), flags)
    axes: tuple[Axis, ...] = ("x", "y")
    worded = [axis for axis in axes if has_words(patterns, axis)]
    rest = [i for i, p in enumerate(patterns) if axis_of(p) not in worded]
    if any(axis_of(patterns[i]) for i in rest):
        result = others(rest)
    first = len(worded) == 2 or not any(axis_of(patterns[i]) for i in rest)
    for number, axis in enumerate(worded):
        part = progress.part(number / len(worded), (number + 1) / len(worded))
        book = _book(tuple(patterns), axis, lines[axis == "y"] if lines else None, where)
        place, sigma, modulation, image, bad = _decode_axis(book, images, options, part)
        u, lack = axis == "x", Flag.NO_U if axis == "x" else Flag.NO_V
        alone = first and number == 0
        measured: dict[str, Any] = {"u": place, "sigma_u": sigma} if u else {"v": place, "sigma_v": sigma}
        result = replace(
            result,
            **measured,
            modulation=modulation if alone else np.minimum(result.modulation, modulation),
            image=image if alone else (result.image + image) / F(2) if len(worded) == 2 else result.image,
            flags=(result.flags & np.uint8(255 - lack)) | bad | np.where(np.isnan(place), np.uint8(lack), np.uint8(0)),
        )
    return result


@lru_cache(maxsize=8)
def _book(patterns: tuple[Pattern, ...], axis: Axis, lines: int | None, where: str) -> _Book:
    mine = [i for i, p in enumerate(patterns) if axis_of(p) == axis]
    even = [i for i, p in enumerate(patterns) if level_of(p) in (0, 1)]
    if len(mine) < FEWEST - 1:
        seen = f"{len(mine)} frames with lines"
        raise InputError(f"{where}, axis {axis}", seen, f"give at least {FEWEST - 1} to tell place, light and offset")
    told = [len(v) for i in mine if isinstance(v := getattr(patterns[i], "values", None), str | tuple)]
    count = lines or max(told)
    light = np.array([brightness(patterns[i], np.arange(count)) for i in mine + even])
    context = np.stack([np.pad(light, ((0, 0), (1, 1)))[:, d : d + count] for d in range(3)]).reshape(-1, count)
    if np.unique(context, axis=1).shape[1] < count:
        seen = "words that are the same at several lines, neighbours included"
        raise InputError(f"{where}, axis {axis}", seen, "show more frames, or words that differ")
    return _Book((*mine, *even), count, np.stack([_blurred(light, blur, len(even)) for blur in BLURS.tolist()]))


def _blurred(light: Array, blur: float, even: int) -> Singles:
    """Values (entries, k) of lines (k, n), boxes blurred by a Gaussian, from line -1 to one beyond the last."""
    reach = int(np.ceil(1 + 4 * blur))
    wide = np.pad(light, ((0, 0), (reach + 1, reach + 1)))
    if even:  # the evenly lit frames stay what they are up to the edge
        wide[-even:] = light[-even:, :1]
    entries = (light.shape[1] + 1) * PER_LINE + 1
    out = np.empty((entries, len(light)), np.float32)
    taps = np.arange(-reach, reach + 1)
    for r in range(PER_LINE):
        x = r / PER_LINE - taps
        kernel = 0.5 * (erf((x + 0.5) / (np.sqrt(2) * blur)) - erf((x - 0.5) / (np.sqrt(2) * blur)))
        count = len(range(r, entries, PER_LINE))
        # entry r + 8 j lies at line j - 1 + r / 8; line i is column i + reach + 1
        windows = np.lib.stride_tricks.sliding_window_view(wide, 2 * reach + 1, axis=1)
        first = (
            windows[:, :count] if windows.shape[1] >= count else np.pad(windows, ((0, 0), (0, 1), (0, 0)))[:, :count]
        )
        out[r::PER_LINE] = (first @ kernel).T
    return out


def _decode_axis(
    book: _Book, images: Sequence[Image], options: DecodeOptions, progress: Progress
) -> tuple[Singles, Singles, Singles, Singles, NDArray[np.uint8]]:
    """Give place, sigma, modulation, evenly lit image and flags, each (H, W)."""
    shape, k = images[0].shape, len(book.frames)
    full = options.saturation or float(np.iinfo(images[0].dtype).max)
    progress(0.0, "reading blur and noise")
    blur, noise = _measure(book, images, full)
    find = book.find(int(np.median(blur)))
    best = np.empty(shape, np.int32)
    top, rival = np.empty(shape, np.float32), np.empty(shape, np.float32)
    out = np.empty((4, *shape), np.float32)  # place, sigma, contrast, offset
    left = np.empty(shape, np.float32)  # squares that remain

    def search(first: int, last: int) -> None:
        grey = _grey(book, images, first, last)
        found = (a[first:last].ravel() for a in (best, top, rival))  # views: rows lie one after the other
        _search(grey, find, ELSEWHERE * book.grid, np.empty(find.shape[1], F), *found)

    def refine(first: int, last: int) -> None:
        grey = _grey(book, images, first, last)
        values = out[:, first:last].reshape(4, -1).copy()
        squares = np.empty(values.shape[1], F)
        _refine(grey, book.fine, blur[first:last].ravel(), start[first:last].ravel(), _limits(noise), values, squares,
                np.empty((2, k), F))  # fmt: skip
        out[:, first:last] = values.reshape(4, last - first, -1)
        left[first:last] = squares.reshape(last - first, -1)

    rows = max(1, (1 << 16) // shape[1])
    for at in progress.over(range(0, shape[0], 16 * rows), "looking words up from row {}"):
        run_in_bands(lambda a, b, at=at: search(at + a, at + b), min(16 * rows, shape[0] - at))  # type: ignore[misc]
    start = book.places(best)
    run_in_bands(refine, shape[0])
    place, sigma, contrast, offset = out
    variance = np.maximum(noise.dark + noise.shot * (offset + contrast / 2), noise.floor).astype(np.float32)
    sure = (top**2 - rival**2) > MARGIN * variance
    weak = (top < options.min_snr * np.sqrt(variance)) | (contrast / 2 < options.min_modulation) | (contrast <= 0)
    good = sure & ~weak & (left < _bound(k, contrast, variance)) & (np.abs(place - start) <= NEAR)
    if good.any():
        expected, agreed = _predicted(place, good)
        again = agreed & ~weak & ~(good & (np.abs(place - expected) < ALIKE))
        if again.any():
            kept, was = out.copy(), left.copy()
            start = np.where(again, expected, start).astype(np.float32)
            run_in_bands(refine, shape[0])
            near = np.abs(place - start) <= NEAR
            found = again & near & (left < _bound(k, contrast, variance))
            out[:, ~found], left[~found] = kept[:, ~found], was[~found]
            good |= found
    inside = (place >= RIM) & (place <= book.lines - 1 - RIM)
    saturated = _saturated(book, images, full)
    flags = np.zeros(shape, np.uint8)
    for wrong, flag in (
        (weak, Flag.LOW_MODULATION),
        (saturated, Flag.SATURATED),
        (~weak & ~good & ~sure, Flag.UNSURE),
        (~weak & ~good & sure, Flag.DISAGREEMENT),
        (good & ~inside, Flag.OUTSIDE),
    ):
        flags |= np.where(wrong, np.uint8(flag), np.uint8(0))
    bad = flags != 0
    mean = np.mean([images[n] for n in book.frames], axis=0)
    even = np.where(weak, mean, offset + contrast / 2).astype(np.float32)
    progress(1.0, "decoded")
    return (
        np.where(bad, F(np.nan), place),
        np.where(bad, F(np.nan), sigma),
        np.maximum(contrast / 2, 0).astype(np.float32),
        np.clip(even, 0, full).astype(np.float32),
        flags,
    )


def _bound(k: int, contrast: Singles, variance: Singles) -> Singles:
    """Squares up to which a place fits: six standard deviations above their mean, and what the model cannot explain."""
    return np.asarray((k - 3) + 6 * np.sqrt(2.0 * (k - 3)) + k * np.square(MISFIT * contrast) / variance, np.float32)


def _grey(book: _Book, images: Sequence[Image], first: int, last: int) -> Singles:
    return np.stack([images[n][first:last].ravel() for n in book.frames]).astype(np.float32)


def _limits(noise: Noise) -> tuple[np.float32, np.float32, np.float32]:
    return F(noise.dark), F(noise.shot), F(noise.floor)


def _saturated(book: _Book, images: Sequence[Image], full: float) -> NDArray[np.bool_]:
    return np.asarray(np.max([images[n] for n in book.frames], axis=0) >= full)


def _measure(book: _Book, images: Sequence[Image], full: float) -> tuple[NDArray[np.int64], Noise]:
    """Find the blur, a number of `BLURS` for every pixel (H, W), and the noise, from the residuals of a sample."""
    shape, k = images[0].shape, len(book.frames)
    stack = [images[n] for n in book.frames]
    step = max(1, int(np.sqrt(shape[0] * shape[1] / (4 * SAMPLE))))
    rows, columns = (np.arange(step // 2, n, step) for n in shape)
    grey = np.stack([image[np.ix_(rows, columns)].ravel() for image in stack]).astype(np.float32)
    at = np.stack([a.ravel() for a in np.meshgrid(rows, columns, indexing="ij")])
    swing = grey.max(axis=0) - grey.min(axis=0)
    lit = np.flatnonzero((swing > 0.3 * np.quantile(swing, 0.98)) & (grey.max(axis=0) < full))
    middle = len(BLURS) // 2
    if len(lit) < 50:
        return np.full(shape, middle), Noise(1.0, 0.0, 1 / 12)
    lit = lit[np.linspace(0, len(lit) - 1, min(len(lit), SAMPLE)).astype(int)]
    grey, at = np.ascontiguousarray(grey[:, lit]), at[:, lit]
    n = len(lit)
    best, top, rival = np.empty(n, np.int32), np.empty(n, F), np.empty(n, F)
    unit = F(1), F(0), F(1)
    word, costs = np.empty((2, k), F), {}

    def trial(numbers: list[int]) -> None:
        find = book.find(numbers[len(numbers) // 2])  # what is looked up hardly depends on the blur
        _search(grey, find, ELSEWHERE * book.grid, np.empty(find.shape[1], F), best, top, rival)
        for number in numbers:
            blurs, costs[number] = np.full(n, number), np.empty(n, F)
            _refine(grey, book.fine, blurs, book.places(best), unit, np.empty((4, n), F), costs[number], word)

    for first in range(0, len(BLURS), 4 * COARSE):
        trial(list(range(first, min(first + 4 * COARSE, len(BLURS)), COARSE)))
    centre = min(costs, key=lambda number: float(np.median(costs[number])))
    trial([i for i in range(max(0, centre - 2 * COARSE), min(len(BLURS), centre + 2 * COARSE + 1)) if i not in costs])
    numbers = sorted(costs)
    left = np.stack([costs[number] for number in numbers])
    usual = numbers.index(centre)
    keep = left[usual] <= 4 * np.median(left[usual]) + 1  # without what is no word at all
    cell = (at[0] * TILES[0] // shape[0]) * TILES[1] + at[1] * TILES[1] // shape[1]
    tiles = np.full(TILES[0] * TILES[1], np.nan)
    for tile in range(len(tiles)):
        some = keep & (cell == tile)
        if some.sum() >= 25:
            tiles[tile] = numbers[int(np.argmin(np.sum(left[:, some], axis=1)))]
    whole = numbers[int(np.argmin(np.sum(left[:, keep], axis=1)))]
    blur = _spread(np.where(np.isnan(tiles), whole, tiles).reshape(TILES), shape)
    mine = blur[at[0], at[1]]
    values, squares = np.empty((4, n), F), np.empty(n, F)
    find = book.find(whole)
    _search(grey, find, ELSEWHERE * book.grid, np.empty(find.shape[1], F), best, top, rival)
    _refine(grey, book.fine, mine, book.places(best), unit, values, squares, word)
    entry = np.clip(np.rint((values[0] + 1) * PER_LINE).astype(int), 0, book.fine.shape[1] - 1)
    level = values[3][:, None] + values[2][:, None] * book.fine[mine, entry]
    good = squares <= 4 * np.median(squares) + 1
    # of all residuals of a pixel three are spent on its unknowns; their mean square is the noise, by level
    used = int(np.bitwise_or.reduce(grey.astype(np.int64), axis=None))
    quantum = 1.0 if images[0].itemsize == 1 else float(max(1, used & -used))
    return blur, _noise(squares[good] / (k - 3), level[good].mean(axis=1), quantum)


def _noise(square: NDArray[Any], level: NDArray[Any], quantum: float) -> Noise:
    """Fit the noise to mean squares (n,) at levels (n,): a line through the means of bins, outliers left out."""
    bins = int(np.clip(len(square) // 100, 1, 8))
    order = np.argsort(level, kind="stable")[len(level) % bins :].reshape(bins, -1)
    variance = np.array([float(np.mean(s[s <= 4 * np.median(s)])) for s in square[order]])
    mean = level[order].mean(axis=1)
    slope = 0.0
    if bins > 2 and np.ptp(mean) > 1:
        slope = max(0.0, float(np.polyfit(mean, variance, 1)[0]))
    floor = quantum**2 / 12
    return Noise(float(variance.mean() - slope * mean.mean()), slope, max(floor, 0.5 * float(variance.min())))


def _spread(tiles: Array, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Give every pixel the blur of its tile, smoothly."""
    around = np.lib.stride_tricks.sliding_window_view(np.pad(tiles, 1, mode="edge"), (3, 3))
    smooth = np.median(around, axis=(2, 3))
    at = [np.clip((np.arange(n) + 0.5) * t / n - 0.5, 0, t - 1) for n, t in zip(shape, smooth.shape, strict=True)]
    low = [np.minimum(a.astype(int), t - 2) for a, t in zip(at, smooth.shape, strict=True)]
    y, x = (at[0] - low[0])[:, None], (at[1] - low[1])[None, :]
    a, b = smooth[np.ix_(low[0], low[1])], smooth[np.ix_(low[0], low[1] + 1)]
    c, d = smooth[np.ix_(low[0] + 1, low[1])], smooth[np.ix_(low[0] + 1, low[1] + 1)]
    return np.asarray(np.rint((1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * d)), np.int64)


def _predicted(place: Singles, good: NDArray[np.bool_]) -> tuple[Singles, NDArray[np.bool_]]:
    """What the good neighbours say of a pixel's place (H, W), and where most of them agree."""
    import cv2

    known = np.where(good, place, 0).astype(np.float32)
    share = cv2.blur(good.astype(np.float32), (NEIGHBOURS, NEIGHBOURS))
    mean = cv2.blur(known, (NEIGHBOURS, NEIGHBOURS)) / np.maximum(share, F(1e-6))
    middle = cv2.medianBlur(np.where(good, place, mean).astype(np.float32), 5)
    alike = (good & (np.abs(place - middle) < ALIKE)).astype(np.float32)
    agreed = cv2.blur(alike, (NEIGHBOURS, NEIGHBOURS)) > 0.5
    return np.asarray(middle, np.float32), np.asarray(agreed, bool)


@fast
def _search(grey, find, elsewhere, fit, best, top, rival):  # type: ignore[no-untyped-def]
    """Look up the place of every pixel.

    Parameters
    ----------
    grey : float32 (k, n)
    find : float32 (k, m)
        Of `_Book.find`.
    elsewhere : int
        How far another place must be, entries.
    fit : float32 (m,)
        Scratch.
    best, top, rival : (n,)
        The place that fits best, and how well that and the best elsewhere fit, grey values.
    """
    k, n = grey.shape
    m = find.shape[1]
    for p in range(n):
        mean = np.float32(0)
        for f in range(k):
            mean += grey[f, p]
        mean /= np.float32(k)
        g = grey[0, p] - mean
        for c in range(m):
            fit[c] = g * find[0, c]
        for f in range(1, k):
            g = grey[f, p] - mean
            for c in range(m):
                fit[c] += g * find[f, c]
        at, most = 0, fit[0]
        for c in range(1, m):
            if fit[c] > most:
                at, most = c, fit[c]
        second = np.float32(0)
        for c in range(0, at - elsewhere):
            second = max(second, fit[c])
        for c in range(at + elsewhere + 1, m):
            second = max(second, fit[c])
        best[p], top[p], rival[p] = at, max(most, np.float32(0)), second


@fast
def _refine(grey, fine, blur, start, noise, out, left, word):  # type: ignore[no-untyped-def]
    """Adjust place, contrast and offset of every pixel by weighted least squares.

    Parameters
    ----------
    grey : float32 (k, n)
    fine : float32 (blurs, entries, k)
    blur : int64 (n,)
    start : float32 (n,)
        Places in lines.
    noise : (dark, shot, floor)
    out : float32 (4, n)
        Place, its standard deviation, contrast, offset.
    left : float32 (n,)
        Weighted squares that remain.
    word : float32 (2, k)
        Scratch: values and slopes.
    """
    k, n = grey.shape
    last = np.float32(fine.shape[1] - 2)
    per = np.float32(PER_LINE)
    dark, shot, floor = noise
    for p in range(n):
        u, s, b = start[p], np.float32(0), np.float32(0)
        table = fine[blur[p]]
        variance_u, squares = np.float32(0), np.float32(0)
        for turn in range(ROUNDS + 1):
            x = min(max((u + np.float32(1)) * per, np.float32(1)), last - np.float32(1.001))
            j = int(x)
            r = x - np.float32(j)
            n0 = n1 = n2 = n3 = n4 = n5 = np.float32(0)
            h0 = h1 = h2 = np.float32(0)
            squares = np.float32(0)
            for f in range(k):
                t = (np.float32(1) - r) * table[j, f] + r * table[j + 1, f]
                # slope by central differences, interpolated likewise
                d = (
                    (np.float32(1) - r) * (table[j + 1, f] - table[j - 1, f]) + r * (table[j + 2, f] - table[j, f])
                ) * (np.float32(0.5) * per)
                word[0, f], word[1, f] = t, d
                expected = b + s * t if turn > 0 else grey[f, p]
                w = np.float32(1) / max(dark + shot * expected, floor)
                e = grey[f, p] - b - s * t
                sd = s * d
                n0 += w
                n1 += w * t
                n2 += w * t * t
                n3 += w * sd
                n4 += w * t * sd
                n5 += w * sd * sd
                h0 += w * e
                h1 += w * t * e
                h2 += w * sd * e
                squares += w * e * e
            # eliminate offset, then contrast
            m22, m24, m25 = n2 - n1 * n1 / n0, n4 - n1 * n3 / n0, n5 - n3 * n3 / n0
            g1, g2 = h1 - n1 * h0 / n0, h2 - n3 * h0 / n0
            m22 = max(m22, np.float32(1e-9))
            rest = m25 - m24 * m24 / m22
            if turn == ROUNDS:
                variance_u = np.float32(1) / max(rest, np.float32(1e-12))
                break
            du = (g2 - m24 * g1 / m22) / rest if turn > 0 and rest > np.float32(1e-9) else np.float32(0)
            du = min(max(du, np.float32(-0.4)), np.float32(0.4))
            ds = (g1 - m24 * du) / m22
            b += (h0 - n1 * ds - n3 * du) / n0
            s += ds
            u += du
        out[0, p], out[1, p], out[2, p], out[3, p] = u, np.sqrt(variance_u), s, b
        left[p] = squares
