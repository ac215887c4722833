"""Coordinates by the likelihood of all frames of an axis, for words that only a look-up tells apart.

A pixel at projector coordinate u sees ``g_f = b + s T_f(u)`` in frame f: T_f are the pattern's lines, each a box,
blurred by a Gaussian. First the place is looked up whose values fit best, whatever b and s are. It must fit better than
every place elsewhere by `MARGIN`; where it does not, or neighbours that agree with each other say otherwise, theirs is
taken if it fits. Then u, b and s are adjusted by least squares with the noise of every grey value.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.book import BLURS, Book, Found, Shelf, adjust, book_of
from core.decode.footprint import draw_back
from core.decode.frames import Image
from core.decode.islands import drop_islands
from core.decode.noise import TINY, Noise
from core.decode.notes import MUCH, ODD_WORDS, SECOND_OF_WORDS, note_on_second_light, notes_on
from core.decode.options import DecodeOptions, Flag
from core.decode.sample import limits_of, spread, take_sample
from core.decode.shown import measure_words
from core.decode.tables import WORDS, Singles, make_rows, no_axis
from core.model import PhaseMap
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
    for number, axis in enumerate(worded):
        part = progress.part(number / len(worded), (number + 1) / len(worded))
        book = book_of(tuple(patterns), axis, lines[axis == "y"] if lines else None, where)
        place, sigma, modulation, image, bad, noise, word, second = _decode_axis(book, images, options, part)
        u, lack = axis == "x", Flag.NO_U if axis == "x" else Flag.NO_V
        alone = first and number == 0
        seen = [images[i] for i in book.frames]
        lost = bad | np.where(np.isnan(place), np.uint8(lack), np.uint8(0))
        drop_islands(place, sigma, lost, lack, ALIKE, Flag.UNSURE)
        drawn[:, 0 if u else 1] = place, sigma
        limits = limits_of(noise, options.saturation or float(np.iinfo(images[0].dtype).max), options)
        words = none._replace(start=WORDS)
        of_sample = lost[spread(place.shape)].ravel()
        notes = notes_on(seen, take_sample(seen), of_sample, limits, (words, none) if u else (none, words))
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


def _decode_axis(
    book: Book, images: Sequence[Image], options: DecodeOptions, progress: Progress
) -> tuple[Singles, Singles, Singles, Singles, NDArray[np.uint8], Noise, float, tuple[str, ...]]:
    """Give place, sigma, modulation, evenly lit image and flags, each (H, W), noise, contrast of words, what to say."""
    shape, k = images[0].shape, len(book.frames)
    full = options.saturation or float(np.iinfo(images[0].dtype).max)
    progress(0.0, "reading blur and noise")
    book, blur, noise, steady = measure_words(book, images, full)
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
    second_notes = note_on_second_light(second, seen[~bad], SECOND_OF_WORDS)
    if second_notes:
        some = np.flatnonzero(seen)[:: max(1, np.count_nonzero(seen) // TOLD)]
        words = book.values(blurs[some], place.ravel()[some])
        shown = offset.ravel()[some, None] * steady[0] + contrast.ravel()[some, None] * steady[1] * words
        if not _from_elsewhere(_grey(flat, some) - shown.T.astype(F), book.shelf(usual)):
            second_notes = note_on_second_light(second, seen[~bad], ODD_WORDS)
    even = np.where(weak, np.mean(stack, axis=0), offset + contrast / 2).astype(np.float32)
    progress(1.0, "decoded")
    return (
        np.where(bad, F(np.nan), place),
        np.where(bad, F(np.nan), sigma).astype(np.float32),
        np.maximum(contrast / 2, 0).astype(np.float32),
        np.clip(even, 0, full).astype(np.float32),
        flags,
        noise,
        word,
        second_notes,
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


def _from_elsewhere(left: Singles, shelf: Shelf) -> bool:
    """Whether residuals (k, n) are words of other places, rather than anything: as they are in other orders."""
    draw = np.random.default_rng(0)
    orders = [np.arange(len(left)), *(draw.permutation(len(left)) for _ in range(ORDERS))]
    square = np.maximum(np.sum(left * left, axis=0), TINY)
    own, *others = (float(np.mean(shelf.find(left[order]).top ** 2 / square)) for order in orders)
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
