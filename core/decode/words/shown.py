"""How words are shown in a capture: the blur, the noise, and whatever else bends their light, from a sample of pixels.

The blur is found in tiles of the image, by what it leaves of the grey values; so are gain and offset of every frame,
for lamps flicker. A camera's gamma, and light that spreads within a surface, bend the light of all words alike: where
that explains most of what noise does not, the words are bent as well. Where no frame shows another's inverse, a gamma
also moves places and blur, and is sought before. The noise is found from the residuals of pixels side by side, which
all else contradicts alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.frames import Image
from core.decode.noise import Noise, estimate_noise
from core.decode.tables import Array, Singles
from core.decode.words.book import BLURS, PER_LINE, Book, adjust
from core.numerics import quantile_of, quantum, spaced

COARSE = 3  # so manieth is tried first, then each around the best
SAMPLE = 6000  # pixels that tell blur and noise
TILES = 6, 8  # of the image, each with its blur
NEXT, ASIDE = 3, ((0, 0), (1, 0), (0, 1))  # px: nearer, noise may be alike, too; itself, down and across
HALVES, EVERY = (0.15, 0.15, 0.07, 0.03), 4  # of the contrast, steps of what half the light shows; pixels that tell it
FLAT, UNLIKE = 0.1, 0.1  # of the contrast: what blur leaves of a frame that tells half the light; by which these differ
CLEARLY = 0.8  # times the squares that are left without
ROUNDS = 4  # of what flickers
HOLD, LARGEST = 1e-4, 0.3  # part of the contrast's squares; of a round's change
BENDS, FEW = 4, 2000  # rounds of bending, and pixels of the sample that tell it
SLIGHT = 0.05  # of the noise, from which it is worth it
MOST, MORE = 0.5, 0.2  # of what noise leaves open that it must explain, at first and then

F = np.float32


class Shown(NamedTuple):
    """The words as they are seen, the blur, a number of `BLURS` for every pixel (H, W), the noise, and how much more of
    offset and contrast each frame shows (2, k)."""

    book: Book
    blur: NDArray[np.int64]
    noise: Noise
    steady: Singles


def measure_words(book: Book, images: Sequence[Image], full: float) -> Shown:
    """Find how words are shown, by the residuals of a sample; `full` is the grey value of saturation."""
    shape, k = images[0].shape, len(book.frames)
    stack = [images[n] for n in book.frames]
    step = max(1, int(np.sqrt(shape[0] * shape[1] / (4 * SAMPLE))))
    rows, columns = (np.arange(step // 2, n, step) for n in shape)
    grey = np.stack([image[np.ix_(rows, columns)].ravel() for image in stack]).astype(np.float32)
    at = np.stack([a.ravel() for a in np.meshgrid(rows, columns, indexing="ij")])
    swing = grey.max(axis=0) - grey.min(axis=0)
    lit = np.flatnonzero((swing > 0.3 * quantile_of(swing, 0.98)) & (grey.max(axis=0) < full))
    middle, steady = len(BLURS) // 2, np.ones((2, k), F)
    if len(lit) < 50:
        return Shown(book, np.full(shape, middle), Noise(1.0, 0.0, 1 / 12), steady)
    lit = lit[spaced(len(lit), SAMPLE)]
    grey, at = np.ascontiguousarray(grey[:, lit]), at[:, lit]
    plain = book
    costs, centre = _tried(book, grey, steady)
    if not book.inverted:
        other = _halved(book, grey[:, ::EVERY], steady, centre)
        if other is not book:
            book, (costs, centre) = other, _tried(other, grey, steady)
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
    seen = [
        np.minimum(at + NEXT * np.array([[down], [across]]), np.array(shape)[:, None] - 1) for down, across in ASIDE
    ]
    mine, *beside = (_Seen(book, stack, pixels, blur, whole) for pixels in seen)
    here = mine.explained(steady)
    for _ in range(ROUNDS):
        steady = _steadier(steady, here)
        here = mine.explained(steady)
    apart = 1.0 if images[0].itemsize == 1 else max(1.0, quantum(grey))
    noise = _noise(here, [each.explained(steady) for each in beside], apart)
    for turn in range(BENDS):
        terms = _bends(mine, here, steady, noise, MOST if turn == 0 and book is plain else MORE)
        if terms is None:
            break
        book = book.bent(terms, slice(int(blur.min()), int(blur.max()) + 1))
        for each in (mine, *beside):
            each.book = book
        here = mine.explained(steady)
        noise = _noise(here, [each.explained(steady) for each in beside], apart)
    return Shown(book, blur, noise, steady)


def _tried(book: Book, grey: Singles, steady: Singles) -> tuple[dict[int, Singles], int]:
    """Squares (n,) that grey values (k, n) leave under blurs, numbers of `BLURS`, about the one that leaves the least:
    the second value."""
    costs: dict[int, Singles] = {}

    def best() -> int:
        return min(costs, key=lambda number: float(np.median(costs[number])))

    for first in range(0, len(BLURS), 4 * COARSE):
        costs |= _squares(book, grey, steady, list(range(first, min(first + 4 * COARSE, len(BLURS)), COARSE)))
    centre = best()
    around = range(max(0, centre - 2 * COARSE), min(len(BLURS), centre + 2 * COARSE + 1))
    return costs | _squares(book, grey, steady, [number for number in around if number not in costs]), centre


def _squares(book: Book, grey: Singles, steady: Singles, numbers: Sequence[int]) -> dict[int, Singles]:
    """Squares (n,) that grey values (k, n) leave under each of these blurs."""
    n = grey.shape[1]
    found = book.shelf(numbers[len(numbers) // 2]).find(grey)  # what is looked up hardly depends on the blur
    start, unit, left = book.places(found.best), (F(1), F(0), F(1)), np.empty((len(numbers), n), F)
    for number, squares in zip(numbers, left, strict=True):
        adjust(grey, book.fine, np.full(n, number), start, unit, steady, np.empty((4, n), F), squares)
    return dict(zip(numbers, left, strict=True))


def _halved(book: Book, grey: Singles, steady: Singles, blur: int) -> Book:
    """The words with what a camera's gamma makes of half the light, as grey values (k, n) clearly fit better.

    It makes the same of all frames of which blur leaves half the light; those that differ are shown darker themselves.
    """
    grey = np.ascontiguousarray(grey)
    words, swing = book.fine[blur], np.ptp(grey, axis=0)
    flat = (words.std(axis=0) < FLAT) & (np.abs(words.mean(axis=0) - F(0.5)) < FLAT)
    if flat.any() and np.ptp(np.median((grey[flat] - grey.min(axis=0)) / np.maximum(swing, F(1)), axis=1)) > UNLIKE:
        return book
    half, least = 0.5, CLEARLY * float(np.median(_squares(book, grey, steady, [blur])[blur]))
    for step in HALVES:
        for other in (half - step, half + step):
            bent = book.halved(other, slice(blur, blur + 1))
            if (left := float(np.median(_squares(bent, grey, steady, [blur])[blur]))) < least:
                half, least = other, left
    return book if half == 0.5 else book.halved(half, slice(None))


def _noise(here: _Explained, beside: Sequence[_Explained], apart: float) -> Noise:
    """Noise by pixels side by side: what contradicts the words alike the way that lines change less is none."""
    k = here.residual.shape[1]
    other = min(beside, key=lambda each: float(np.median(np.abs(each.place - here.place))))
    good = np.maximum(here.squares, other.squares) <= 4 * np.median(here.squares) + 1
    apiece = (here.residual - other.residual)[good] * np.sqrt(k / (k - 3) / 2)
    return estimate_noise(apiece.ravel(), ((here.level + other.level)[good] / 2).ravel(), apart)


class _Explained(NamedTuple):
    """Places (n,), squares that remain, offsets, contrasts, contrasts by words (n, k), levels and residuals."""

    place: Singles
    squares: Singles
    offset: Singles
    contrast: Singles
    light: Singles
    level: Singles
    residual: Singles


class _Seen:
    """Pixels of a sample in these rows and columns (2, n), and where they were looked up."""

    def __init__(
        self, book: Book, stack: Sequence[Image], at: NDArray[Any], blur: NDArray[np.int64], usual: int
    ) -> None:
        self.book, self.blur = book, blur[at[0], at[1]]
        self.grey = np.stack([image[at[0], at[1]] for image in stack]).astype(np.float32)
        self.start = book.places(book.shelf(usual).find(self.grey).best)

    def explained(self, steady: Singles) -> _Explained:
        """What words explain of the pixels, and what not."""
        fine, n = self.book.fine, len(self.start)
        values, squares = np.empty((4, n), F), np.empty(n, F)
        adjust(self.grey, fine, self.blur, self.start, (F(1), F(0), F(1)), steady, values, squares)
        light = values[2][:, None] * steady[1] * self.book.values(self.blur, values[0])
        level = values[3][:, None] * steady[0] + light
        return _Explained(values[0], squares, values[3], values[2], light, level, self.grey.T - level)


def _steadier(steady: Singles, seen: _Explained) -> Singles:
    """What frames show more than others of offset and contrast, by what is left of all pixels."""
    good = seen.squares <= 4 * np.median(seen.squares) + 1
    b, s, r = seen.offset[good, None] * steady[0], seen.light[good], seen.residual[good]
    bb, bs, ss, br, sr = (np.sum(p * q, axis=0, dtype=float) for p, q in ((b, b), (b, s), (s, s), (b, r), (s, r)))
    hold = HOLD * ss.mean()  # of an offset of nearly nothing nothing is told
    bb, ss = bb + hold, ss + hold
    more = np.array([br * ss - sr * bs, sr * bb - br * bs]) / (bb * ss - bs * bs)
    found = steady * (1 + np.clip(more, -LARGEST, LARGEST))
    return np.asarray(found / found.mean(axis=1, keepdims=True), np.float32)


def _bends(seen: _Seen, here: _Explained, steady: Singles, noise: Noise, most: float) -> Array | None:
    """Terms of `Book.bent` that explain what noise, place, offset and contrast do not; None where little is left."""
    lines = seen.book.lines
    within = np.abs(here.place - (lines - 1) / 2) < lines / 2  # beyond the last line words end
    some = np.flatnonzero((here.squares <= 4 * np.median(here.squares) + 1) & within)
    some = some[:: max(1, len(some) // FEW)]
    blur, place = seen.blur[some], here.place[some]
    words, *others = seen.book.bends(blur, place)
    slope = seen.book.values(blur, place + F(0.5 / PER_LINE)) - seen.book.values(blur, place - F(0.5 / PER_LINE))
    sigma = np.sqrt(noise.variance(here.level[some]))
    own = np.stack([steady[0] + 0 * words, steady[1] * words, steady[1] * slope], axis=2) / sigma[:, :, None]
    known, by = np.linalg.qr(own)

    def without(values: NDArray[np.floating]) -> Array:
        values = values / sigma
        return np.asarray(values - (known @ (known.transpose(0, 2, 1) @ values[..., None]))[..., 0], float).ravel()

    changes = [here.contrast[some, None] * steady[1] * each for each in others]
    left, design = without(here.residual[some]), np.stack([without(each) for each in changes], axis=1)
    terms = np.linalg.lstsq(design, left, rcond=None)[0]
    by_noise = len(some) * (words.shape[1] - 3)
    beyond = float(left @ left) - by_noise
    if beyond < SLIGHT * by_noise or float(np.sum(np.square(design @ terms))) < most * beyond:
        return None
    change = np.tensordot(terms, np.stack(changes), 1) / sigma
    taken = np.linalg.solve(by, known.transpose(0, 2, 1) @ change[..., None])[:, 1, 0]  # of the contrast
    return np.asarray(terms * np.median(here.contrast[some] / (here.contrast[some] - taken)), float)


def _spread(tiles: Array, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Give every pixel the blur of its tile, smoothly."""
    smooth = cv2.medianBlur(tiles.astype(np.float32), 3)
    return np.asarray(np.rint(cv2.resize(smooth, shape[::-1], interpolation=cv2.INTER_LINEAR)), np.int64)
