"""Coordinates by the likelihood of all frames of an axis, for words that only a look-up tells apart.

A pixel at projector coordinate u sees ``g_f = b + s T_f(u)`` in frame f: T_f are the pattern's lines, each a box,
blurred by a Gaussian. First the place is looked up whose values fit best, whatever b and s are. It must fit better than
every place elsewhere by `MARGIN`; where it does not, or neighbours that agree with each other say otherwise, theirs is
taken if it fits. Then u, b and s are adjusted by least squares with the noise of every grey value.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.chosen import spread, take_sample
from core.decode.frames import Image
from core.decode.noise import TINY, Noise
from core.decode.notes import COARSE_WORDS, MUCH, ODD_WORDS, SECOND_OF_WORDS, TELLING, note_on_second_light, notes_on
from core.decode.options import DecodeOptions, Flag
from core.decode.sample import full_scale, limits_of
from core.decode.surface.footprint import draw_back
from core.decode.surface.islands import drop_islands
from core.decode.tables import WORDS, Singles, make_rows, no_axis
from core.decode.words.book import BLURS, Book, Found, Shelf, adjust, book_of
from core.decode.words.shown import Shown, measure_words
from core.model import Note, PhaseMap
from core.numerics import median_of
from core.parallel import run_in_bands
from core.patterns import Axis, Pattern, axis_of, use_of
from core.progress import Progress

MARGIN = 16.0  # by which the squares (noise = 1) elsewhere must be greater: exp(-8) for one rival
MISFIT = 0.15  # of the contrast, for each frame: light of three to four tenths of the strength from elsewhere
ABOUT = 1.5  # px: standard deviation of the window in which residuals are held against noise
TOLD, ORDERS, SURELY = 1500, 8, 4.0  # pixels whose residuals are looked up, also in other orders; their spreads
NEIGHBOURS = 7  # px: of those around, the median predicts
ALIKE = 3.0  # lines by which neighbours' places differ that agree with each other
NEAR = 1.0  # times the blur, at least a line: so far a place may move while it is adjusted
SHARP = 0.26  # of its cell: with less blur, the narrowest for one line, a pixel may see one line alone
BESIDE, NEAR_BLURS = 2.0, 6.0  # lines, and blurs: within which light is of the place itself
TELLING_FAR = 0.2  # of the pixels
COARSE = 1.2  # lines that a pixel sees, beyond which its own shape is no blur of theirs
RIM = 0.5  # lines: so near the field's edge its fading light is taken for a place on it

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

    `others` decodes the frames of these numbers, those of the other axis and the evenly lit ones. InputError if an axis
    has too few frames, or its words repeat.
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
    drawn, none = np.full((2, 2, height, width), np.nan, np.float32), no_axis()
    for axis, part in zip(worded, progress.parts(len(worded)), strict=True):
        book = book_of(tuple(patterns), axis, lines[axis == "y"] if lines else None, where)
        seen = [images[i] for i in book.frames]
        sample = take_sample(seen)
        full = full_scale(seen, tuple(range(len(seen))), sample, options)
        place, sigma, modulation, image, bad, noise, word, second = _decode_axis(book, images, full, options, part)
        u, lack = axis == "x", Flag.NO_U if axis == "x" else Flag.NO_V
        alone = first and axis == worded[0]
        lost = bad | np.where(np.isnan(place), np.uint8(lack), np.uint8(0))
        drop_islands(place, sigma, lost, lack, ALIKE, Flag.UNSURE)
        drawn[:, 0 if u else 1] = place, sigma
        limits = limits_of(noise, full, options)
        words = none._replace(start=WORDS)
        of_sample = lost[spread(place.shape)].ravel()
        notes = notes_on(seen, sample, of_sample, limits, (words, none) if u else (none, words))
        result = replace(
            result,
            notes=tuple(dict.fromkeys((*result.notes, *(notes or second)))),
            modulation=modulation if alone else np.minimum(result.modulation, modulation),
            image=image if alone else (result.image + image) / F(2) if len(worded) == 2 else result.image,
            flags=(result.flags & np.uint8(255 - lack)) | lost,
        )
    pixels = drawn.reshape(2, 2, -1)
    lit, cofactor = (result.image.ravel(), result.modulation.ravel()), 1 / (4 * len(book.frames) * word**2)
    draw_back((pixels[0], pixels[1]), lit, result.flags, make_rows([{}]), limits, cofactor, (True, True))
    (u, v), (sigma_u, sigma_v) = drawn
    if "x" in worded:
        result = replace(result, u=u, sigma_u=sigma_u)
    return replace(result, v=v, sigma_v=sigma_v) if "y" in worded else result


class _Decoded(NamedTuple):
    """Of an axis, (H, W) each but for noise, contrast of the words (of full contrast) and what to say."""

    place: Singles
    sigma: Singles
    modulation: Singles
    image: Singles
    flags: NDArray[np.uint8]
    noise: Noise
    word: float
    notes: tuple[str, ...]


class _Places:
    """What is found of every pixel of an axis: looked up, adjusted, and whether it is to be believed."""

    def __init__(self, shown: Shown, images: Sequence[Image], options: DecodeOptions) -> None:
        shape, self.shown, self.usual = images[0].shape, shown, int(np.median(shown.blur))
        self.flat = [images[n].ravel() for n in shown.book.frames]
        self.width, self.freedom = shape[1], len(self.flat) - 3
        dark, shot, floor, *_ = shown.noise
        self.limits = F(dark), F(shot), F(floor)
        least = options.min_snr**2  # of the squares that a word must explain; its level is that of full light at most
        self.dim = least * dark, least * shot / 2, least * floor
        self.found = Found(*(np.empty(shape, kind) for kind in (np.int32, F, F, bool)))
        self.start, self.left = np.empty(shape, F), np.empty(shape, F)  # places looked up; squares that remain
        self.values = np.empty((4, *shape), F)  # place, sigma, contrast, offset

    def search(self, at: Pixels, shelf: Shelf) -> None:
        """Look pixels up."""
        for whole, some in zip(self.found, shelf.find(_grey(self.flat, at), self.width, self.dim), strict=True):
            whole.reshape(-1)[at] = some

    def refine(self, at: Pixels) -> None:
        """Adjust pixels from where they start."""
        grey, (book, blur, _, steady) = _grey(self.flat, at), self.shown
        values, squares = np.empty((4, grey.shape[1]), F), np.empty(grey.shape[1], F)
        adjust(grey, book.fine, blur.ravel()[at], self.start.ravel()[at], self.limits, steady, values, squares)
        self.values.reshape(4, -1)[:, at], self.left.reshape(-1)[at] = values, squares

    def look_up_all(self, progress: Progress) -> None:
        """Look every pixel up and adjust it."""
        (height, width), book = self.shown.blur.shape, self.shown.book
        rows, shelf = 16 * max(1, (1 << 16) // width), book.compared(self.usual)
        for top in progress.over(range(0, height, rows), "looking words up from row {}"):

            def band(first: int, last: int, top: int = top) -> None:
                self.search(slice((top + first) * width, (top + last) * width), shelf)

            run_in_bands(band, min(rows, height - top))
        self.start[:] = book.places(self.found.best)
        run_in_bands(lambda a, b: self.refine(slice(a * width, b * width)), height)

    def variance(self) -> Singles:
        """Give that of grey values at half the light."""
        _, _, contrast, offset = self.values
        dark, shot, floor = self.limits
        return np.asarray(np.maximum(dark + shot * (offset + contrast / 2), floor), np.float32)

    def sure(self, variance: Singles, lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Tell which lead every place elsewhere, looking up in full those for which that is not known."""
        beyond = _beyond(self.left / self.freedom, lit)  # those that fit by chance are few among them

        def leads() -> NDArray[np.bool_]:
            return np.asarray(self.found.top**2 - self.found.rival**2 > MARGIN * variance * beyond)

        some, shelf = np.flatnonzero(~(leads() | self.found.known)), self.shown.book.shelf(self.usual)
        run_in_bands(lambda a, b: self.search(some[a:b], shelf), len(some))
        return leads()

    def near(self) -> NDArray[np.bool_]:
        """Tell which stayed about where they started."""
        step = max(NEAR, NEAR * float(BLURS[self.usual]))
        return np.asarray(np.abs(self.values[0] - self.start) <= step)

    def fits(self, variance: Singles) -> NDArray[np.bool_]:
        """Tell which did, and leave no more squares than noise and what the model cannot explain."""
        k = self.freedom
        strange = (k + 3) * np.square(MISFIT * self.values[2]) / variance
        return np.asarray(self.near() & (self.left < k + 6 * np.sqrt(2.0 * k) + strange))

    def by_neighbours(self, good: NDArray[np.bool_], lit: NDArray[np.bool_], variance: Singles) -> None:
        """Put pixels where their neighbours agree, if they fit there; they are `good` then, in place."""
        expected, agreed = _predicted(self.values[0], good)
        again = np.flatnonzero(agreed & lit & ~(good & (np.abs(self.values[0] - expected) < ALIKE)))
        every, left, start = self.values.reshape(4, -1), self.left.reshape(-1), self.start.reshape(-1)
        kept, was, before = every[:, again], left[again], start[again]
        start[again] = expected.ravel()[again]
        run_in_bands(lambda a, b: self.refine(again[a:b]), len(again))
        fits = self.fits(variance).ravel()[again]
        back = again[~fits]
        every[:, back], left[back], start[back] = kept[:, ~fits], was[~fits], before[~fits]
        good.reshape(-1)[again[fits]] = True


def _decode_axis(
    book: Book, images: Sequence[Image], full: float, options: DecodeOptions, progress: Progress
) -> _Decoded:
    """Decode the words of an axis; `full` is the grey value from which a pixel is saturated."""
    progress(0.0, "reading blur and noise")
    pixels = _Places(measure_words(book, images, full), images, options)
    pixels.look_up_all(progress)
    book, (place, sigma, contrast, offset), variance = pixels.shown.book, pixels.values, pixels.variance()
    lit = (pixels.found.top >= options.min_snr * np.sqrt(variance)) & (contrast > 0)
    lit &= contrast / 2 >= options.min_modulation
    sure = pixels.sure(variance, lit)
    good = sure & lit & pixels.fits(variance)
    if good.any():
        pixels.by_neighbours(good, lit, variance)
    beyond = _beyond(pixels.left / pixels.freedom, good | pixels.near() & lit)
    sigma *= np.sqrt(beyond)
    inside = (place >= RIM) & (place <= book.lines - 1 - RIM)
    cell = book.cells[np.clip(np.rint(np.nan_to_num(place)), 0, book.lines - 1).astype(int)]
    alike = BLURS[pixels.shown.blur] < SHARP * cell  # its middle looks the same everywhere
    sigma = np.where(alike, np.maximum(sigma, cell / F(np.sqrt(12))), sigma)
    stack = [images[n] for n in book.frames]
    flags = np.zeros(place.shape, np.uint8)
    for wrong, flag in (
        (~lit, Flag.LOW_MODULATION),
        (np.max(stack, axis=0) >= full, Flag.SATURATED),
        (lit & ~good & ~sure, Flag.UNSURE),
        (lit & ~good & sure, Flag.DISAGREEMENT),
        (good & ~inside, Flag.OUTSIDE),
    ):
        flags |= np.where(wrong, np.uint8(flag), np.uint8(0))
    bad = flags != 0
    word = float(book.fine[pixels.usual].std(axis=1).mean())
    notes = _second_light(pixels, ~bad, beyond, variance, word)
    even = np.where(lit, offset + contrast / 2, np.mean(stack, axis=0)).astype(np.float32)
    progress(1.0, "decoded")
    return _Decoded(
        np.where(bad, F(np.nan), place),
        np.where(bad, F(np.nan), sigma).astype(np.float32),
        np.maximum(contrast / 2, 0).astype(np.float32),
        np.clip(even, 0, full).astype(np.float32),
        flags,
        pixels.shown.noise,
        word,
        notes,
    )


def _second_light(
    pixels: _Places, valid: NDArray[np.bool_], beyond: Singles, variance: Singles, word: float
) -> tuple[str, ...]:
    """What to say of valid pixels that differ from their words `beyond` noise; `word` is the words' contrast."""
    (place, _, contrast, offset), (book, blur, _, steady) = pixels.values, pixels.shown
    seen = valid & (beyond > MUCH**2)
    part = np.zeros_like(place)
    part[seen] = np.sqrt((beyond[seen] - 1) * variance[seen]) / (word * contrast[seen])
    seen = part > TELLING
    notes = note_on_second_light(part[seen], seen[valid], SECOND_OF_WORDS)
    if notes:
        some = np.flatnonzero(seen)[:: max(1, np.count_nonzero(seen) // TOLD)]
        words = book.values(blur.ravel()[some], place.ravel()[some])
        shown = offset.ravel()[some, None] * steady[0] + contrast.ravel()[some, None] * steady[1] * words
        reach = BESIDE + NEAR_BLURS * BLURS[blur.ravel()[some]]
        left = _grey(pixels.flat, some) - shown.T.astype(F)
        if not _from_elsewhere(left, book, pixels.usual, place.ravel()[some], reach):
            if _lines_per_pixel(np.where(seen, place, F(np.nan))) > COARSE:
                coarse = note_on_second_light(part[seen], seen[valid], COARSE_WORDS)
                return tuple(Note(text, "mended") for text in coarse)
            return note_on_second_light(part[seen], seen[valid], ODD_WORDS)
    return notes


def _lines_per_pixel(place: Singles) -> float:
    """How many lines a pixel sees, the median of those that have places (H, W)."""
    return float(np.nanmax([0.0, *(median_of(np.abs(np.diff(place, axis=axis))) for axis in (0, 1))]))


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


def _from_elsewhere(left: Singles, book: Book, blur: int, place: Singles, reach: NDArray[np.floating]) -> bool:
    """Whether residuals (k, n) are words of other places, rather than anything: as they are in other orders.

    Those of words within `reach` lines (n,) of the own `place` tell of the blur.
    """
    draw, shelf = np.random.default_rng(0), book.shelf(blur)
    square = np.maximum(np.sum(left * left, axis=0), TINY)
    found = shelf.find(left)
    far = np.abs(book.places(found.best) - place) > reach
    if far.sum() < TELLING_FAR * len(far):
        return False
    orders = [found, *(shelf.find(left[draw.permutation(len(left))]) for _ in range(ORDERS))]
    own, *others = (float(np.mean(each.top[far] ** 2 / square[far])) for each in orders)
    return own > float(np.mean(others)) + SURELY * float(np.std(others))


def _grey(flat: Sequence[Image], at: Pixels) -> Singles:
    return np.stack([image[at] for image in flat]).astype(np.float32)


def _predicted(place: Singles, good: NDArray[np.bool_]) -> tuple[Singles, NDArray[np.bool_]]:
    """What the good neighbours say of a pixel's place (H, W), and where most of them agree."""
    known = np.where(good, place, 0).astype(np.float32)
    share = cv2.blur(good.astype(np.float32), (NEIGHBOURS, NEIGHBOURS))
    mean = cv2.blur(known, (NEIGHBOURS, NEIGHBOURS)) / np.maximum(share, F(1e-6))
    middle = cv2.medianBlur(np.where(good, place, mean).astype(np.float32), 5)
    alike = (good & (np.abs(place - middle) < ALIKE)).astype(np.float32)
    agreed = cv2.blur(alike, (NEIGHBOURS, NEIGHBOURS)) > 0.5
    return np.asarray(middle, np.float32), np.asarray(agreed, bool)
