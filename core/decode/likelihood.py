"""Coordinates by the likelihood of all frames of an axis, for words that only a look-up tells apart.

A pixel at projector coordinate u sees ``g_f = b + s T_f(u)`` in frame f: T_f are the pattern's lines, each a box,
blurred by a Gaussian. First the place is looked up whose values fit best, whatever b and s are. It must fit better than
every place elsewhere by `MARGIN`; where it does not, or neighbours that agree with each other say otherwise, theirs is
taken if it fits. Then u, b and s are adjusted by least squares with the noise of every grey value. The blur is found
from the same residuals, in tiles of the image, and so are gain and offset of every frame, for lamps flicker. The noise
is found from those of pixels side by side, which light by a second way contradicts alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.book import BLURS, PER_LINE, Book, Found, Shelf, adjust, book_of
from core.decode.frames import Image
from core.decode.noise import TINY, Noise, estimate_noise
from core.decode.notes import MUCH, note_on_second_light, notes_on
from core.decode.options import DecodeOptions, Flag
from core.decode.rim import drop_alone
from core.decode.sample import limits_of, quantum, spread, take_sample
from core.decode.tables import WORDS, Array, Singles, no_axis
from core.model import PhaseMap
from core.parallel import run_in_bands
from core.patterns import Axis, Pattern, axis_of, use_of
from core.progress import Progress

COARSE = 3  # so manieth is tried first, then each around the best
MARGIN = 16.0  # by which the squares (noise = 1) elsewhere must be greater: exp(-8) for one rival
MISFIT = 0.15  # of the contrast, for each frame: light of three to four tenths of the strength from elsewhere
ABOUT = 1.5  # px: standard deviation of the window in which residuals are held against noise
SAMPLE = 6000  # pixels that tell blur and noise
TILES = 6, 8  # of the image, each with its blur
NEIGHBOURS = 7  # px: of those around, the median predicts
ALIKE = 3.0  # lines by which neighbours' places differ that agree with each other
NEAR = 1.0  # times the blur, at least a line: so far a place may move while it is adjusted
RIM = 0.5  # lines: so near the field's edge its fading light is taken for a place on it
NEXT, ASIDE = 3, ((0, 0), (1, 0), (0, 1))  # px: nearer, noise may be alike, too; itself, down and across
ROUNDS = 4  # of what flickers
HOLD, LARGEST = 1e-4, 0.3  # part of the contrast's squares; of a round's change

F = np.float32
Pixels = slice | NDArray[np.intp]


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
        book = book_of(tuple(patterns), axis, lines[axis == "y"] if lines else None, where)
        place, sigma, modulation, image, bad, noise, second = _decode_axis(book, images, options, part)
        u, lack = axis == "x", Flag.NO_U if axis == "x" else Flag.NO_V
        alone = first and number == 0
        measured: dict[str, Any] = {"u": place, "sigma_u": sigma} if u else {"v": place, "sigma_v": sigma}
        seen = [images[i] for i in book.frames]
        lost = bad | np.where(np.isnan(place), np.uint8(lack), np.uint8(0))
        drop_alone(place, sigma, lost, lack, Flag.UNSURE)
        limits = limits_of(noise, options.saturation or float(np.iinfo(images[0].dtype).max), options)
        words, none = no_axis()._replace(start=WORDS), no_axis()
        of_sample = lost[spread(place.shape)].ravel()
        notes, dim = notes_on(seen, take_sample(seen), of_sample, limits, (words, none) if u else (none, words))
        result = replace(
            result,
            **measured,
            notes=tuple(dict.fromkeys((*result.notes, *(notes or second)))),
            dim_notes=(*result.dim_notes, *notes) if dim else result.dim_notes,
            modulation=modulation if alone else np.minimum(result.modulation, modulation),
            image=image if alone else (result.image + image) / F(2) if len(worded) == 2 else result.image,
            flags=(result.flags & np.uint8(255 - lack)) | lost,
        )
    return result


def _decode_axis(
    book: Book, images: Sequence[Image], options: DecodeOptions, progress: Progress
) -> tuple[Singles, Singles, Singles, Singles, NDArray[np.uint8], Noise, tuple[str, ...]]:
    """Give place, sigma, modulation, evenly lit image and flags, each (H, W), the noise, and what to say."""
    shape, k = images[0].shape, len(book.frames)
    full = options.saturation or float(np.iinfo(images[0].dtype).max)
    progress(0.0, "reading blur and noise")
    blur, noise, steady = _measure(book, images, full)
    usual = int(np.median(blur))
    shelf, step = book.compared(usual), max(NEAR, NEAR * float(BLURS[usual]))
    width, flat, blurs = shape[1], [images[n].ravel() for n in book.frames], blur.ravel()
    found = Found(*(np.empty(shape, kind) for kind in (np.int32, F, F, bool)))
    limits = F(noise.dark), F(noise.shot), F(noise.floor)
    least = options.min_snr**2  # of the squares that a word must explain; its level is that of full light at most
    dim = least * noise.dark, least * noise.shot / 2, least * noise.floor
    out = np.empty((4, *shape), F)  # place, sigma, contrast, offset
    every = out.reshape(4, -1)
    left = np.empty(shape, F)  # squares that remain

    def search(at: Pixels, shelf: Shelf) -> None:
        for whole, some in zip(found, shelf.find(_grey(flat, at), width, dim), strict=True):
            whole.reshape(-1)[at] = some

    def refine(at: Pixels) -> None:
        grey = _grey(flat, at)
        values, squares = np.empty((4, grey.shape[1]), F), np.empty(grey.shape[1], F)
        adjust(grey, book.fine, blurs[at], start.ravel()[at], limits, steady, values, squares)
        every[:, at], left.reshape(-1)[at] = values, squares

    rows = max(1, (1 << 16) // width)
    for at in progress.over(range(0, shape[0], 16 * rows), "looking words up from row {}"):
        run_in_bands(
            lambda a, b, at=at: search(slice((at + a) * width, (at + b) * width), shelf),  # type: ignore[misc]
            min(16 * rows, shape[0] - at),
        )
    start = book.places(found.best)
    run_in_bands(lambda a, b: refine(slice(a * width, b * width)), shape[0])
    place, sigma, contrast, offset = out
    variance = np.maximum(noise.dark + noise.shot * (offset + contrast / 2), noise.floor).astype(np.float32)
    weak = (found.top < options.min_snr * np.sqrt(variance)) | (contrast / 2 < options.min_modulation) | (contrast <= 0)
    beyond = _beyond(left / (k - 3), ~weak)  # those that fit by chance are few among them

    def leads() -> NDArray[np.bool_]:
        return np.asarray(found.top**2 - found.rival**2 > MARGIN * variance * beyond)

    some = np.flatnonzero(~(leads() | found.known))
    run_in_bands(lambda a, b: search(some[a:b], book.shelf(usual)), len(some))
    sure, near = leads(), np.abs(place - start) <= step
    good = sure & ~weak & near & (left < _bound(k, contrast, variance))
    if good.any():
        expected, agreed = _predicted(place, good)
        again = np.flatnonzero(agreed & ~weak & ~(good & (np.abs(place - expected) < ALIKE)))
        kept, was = every[:, again], left.ravel()[again]
        start.ravel()[again] = expected.ravel()[again]
        run_in_bands(lambda a, b: refine(again[a:b]), len(again))
        near.ravel()[again] = np.abs(place - start).ravel()[again] <= step
        fits = (near & (left < _bound(k, contrast, variance))).ravel()[again]
        every[:, again[~fits]], left.ravel()[again[~fits]] = kept[:, ~fits], was[~fits]
        good.ravel()[again[fits]] = True
    beyond = _beyond(left / (k - 3), good | near & ~weak)
    sigma *= np.sqrt(beyond)
    inside = (place >= RIM) & (place <= book.lines - 1 - RIM)
    cell = book.cells[np.clip(np.rint(np.nan_to_num(place)), 0, book.lines - 1).astype(int)]
    sigma = np.where(cell > 1, np.maximum(sigma, cell / F(np.sqrt(12))), sigma)  # its middle looks the same everywhere
    stack = [images[n] for n in book.frames]
    saturated = np.max(stack, axis=0) >= full
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
    seen = ~bad & (beyond > MUCH**2)
    word = float(book.fine[usual].std(axis=1).mean())  # of full contrast
    second = np.sqrt((beyond[seen] - 1) * variance[seen]) / (word * contrast[seen])
    even = np.where(weak, np.mean(stack, axis=0), offset + contrast / 2).astype(np.float32)
    progress(1.0, "decoded")
    return (
        np.where(bad, F(np.nan), place),
        np.where(bad, F(np.nan), sigma).astype(np.float32),
        np.maximum(contrast / 2, 0).astype(np.float32),
        np.clip(even, 0, full).astype(np.float32),
        flags,
        noise,
        note_on_second_light(second, seen[~bad], words=True),
    )


def _beyond(misfit: NDArray[np.floating], known: NDArray[np.bool_]) -> Singles:
    """Mean squared residuals (H, W) over what noise makes of them, about every pixel, of those known.

    What neither noise nor the words explain - light that comes by a second way, motion, two surfaces in a pixel - errs
    as much in the place as in what is left.
    """
    weight, seen = (
        cv2.GaussianBlur(each.astype(np.float32), (0, 0), ABOUT, borderType=cv2.BORDER_CONSTANT)
        for each in (known, np.where(known, misfit, 0))
    )
    return np.asarray(np.maximum(np.where(known, seen / np.maximum(weight, F(TINY)), misfit), 1), np.float32)


def _bound(k: int, contrast: Singles, variance: Singles) -> Singles:
    """Squares up to which a place fits: six standard deviations above their mean, and what the model cannot explain."""
    return np.asarray((k - 3) + 6 * np.sqrt(2.0 * (k - 3)) + k * np.square(MISFIT * contrast) / variance, np.float32)


def _grey(flat: Sequence[Image], at: Pixels) -> Singles:
    return np.stack([image[at] for image in flat]).astype(np.float32)


def _measure(book: Book, images: Sequence[Image], full: float) -> tuple[NDArray[np.int64], Noise, Singles]:
    """Find the blur, a number of `BLURS` for every pixel (H, W), the noise, and how much more of offset and contrast
    each frame shows (2, k), from the residuals of a sample."""
    shape, k = images[0].shape, len(book.frames)
    stack = [images[n] for n in book.frames]
    step = max(1, int(np.sqrt(shape[0] * shape[1] / (4 * SAMPLE))))
    rows, columns = (np.arange(step // 2, n, step) for n in shape)
    grey = np.stack([image[np.ix_(rows, columns)].ravel() for image in stack]).astype(np.float32)
    at = np.stack([a.ravel() for a in np.meshgrid(rows, columns, indexing="ij")])
    swing = grey.max(axis=0) - grey.min(axis=0)
    lit = np.flatnonzero((swing > 0.3 * np.quantile(swing, 0.98)) & (grey.max(axis=0) < full))
    middle, steady = len(BLURS) // 2, np.ones((2, k), F)
    if len(lit) < 50:
        return np.full(shape, middle), Noise(1.0, 0.0, 1 / 12), steady
    lit = lit[np.linspace(0, len(lit) - 1, min(len(lit), SAMPLE)).astype(int)]
    grey, at = np.ascontiguousarray(grey[:, lit]), at[:, lit]
    n = len(lit)
    unit = F(1), F(0), F(1)
    costs = {}

    def trial(numbers: list[int]) -> None:
        found = book.shelf(numbers[len(numbers) // 2]).find(grey)  # what is looked up hardly depends on the blur
        for number in numbers:
            blurs, costs[number] = np.full(n, number), np.empty(n, F)
            adjust(grey, book.fine, blurs, book.places(found.best), unit, steady, np.empty((4, n), F), costs[number])

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
    seen = [
        np.minimum(at + NEXT * np.array([[down], [across]]), np.array(shape)[:, None] - 1) for down, across in ASIDE
    ]
    mine, *beside = (_Seen(book, stack, pixels, blur, whole) for pixels in seen)
    here = mine.explained(steady)
    for _ in range(ROUNDS):
        steady = _steadier(steady, here)
        here = mine.explained(steady)
    # what contradicts the words alike the way that lines change less is no noise
    others = (each.explained(steady) for each in beside)
    other = min(others, key=lambda each: float(np.median(np.abs(each.place - here.place))))
    good = np.maximum(here.squares, other.squares) <= 4 * np.median(here.squares) + 1
    apart = 1.0 if images[0].itemsize == 1 else max(1.0, quantum(grey))
    apiece = (here.residual - other.residual)[good] * np.sqrt(k / (k - 3) / 2)
    return blur, estimate_noise(apiece.ravel(), ((here.level + other.level)[good] / 2).ravel(), apart), steady


class _Explained(NamedTuple):
    """Places (n,), squares that remain, offsets, contrast by words (n, k), levels and residuals."""

    place: Singles
    squares: Singles
    offset: Singles
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
        x = np.clip((values[0] + 1) * PER_LINE, 0, fine.shape[1] - 2)
        entry, part = x.astype(int), (x % 1)[:, None]
        light = (1 - part) * fine[self.blur, entry] + part * fine[self.blur, entry + 1]
        light *= values[2][:, None] * steady[1]
        level = values[3][:, None] * steady[0] + light
        return _Explained(values[0], squares, values[3], light, level, self.grey.T - level)


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


def _spread(tiles: Array, shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Give every pixel the blur of its tile, smoothly."""
    smooth = cv2.medianBlur(tiles.astype(np.float32), 3)
    return np.asarray(np.rint(cv2.resize(smooth, shape[::-1], interpolation=cv2.INTER_LINEAR)), np.int64)


def _predicted(place: Singles, good: NDArray[np.bool_]) -> tuple[Singles, NDArray[np.bool_]]:
    """What the good neighbours say of a pixel's place (H, W), and where most of them agree."""
    known = np.where(good, place, 0).astype(np.float32)
    share = cv2.blur(good.astype(np.float32), (NEIGHBOURS, NEIGHBOURS))
    mean = cv2.blur(known, (NEIGHBOURS, NEIGHBOURS)) / np.maximum(share, F(1e-6))
    middle = cv2.medianBlur(np.where(good, place, mean).astype(np.float32), 5)
    alike = (good & (np.abs(place - middle) < ALIKE)).astype(np.float32)
    agreed = cv2.blur(alike, (NEIGHBOURS, NEIGHBOURS)) > 0.5
    return np.asarray(middle, np.float32), np.asarray(agreed, bool)
