"""The words of an axis, as values over its lines under every blur, and the kernels that find a pixel's place there."""

from __future__ import annotations

from dataclasses import field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.decode.kernels.compiled import NONE, fast, part
from core.decode.tables import Array, Singles
from core.errors import InputError
from core.lazy import dataclass
from core.numerics import erf
from core.patterns import Axis, Pattern, axis_of, brightness, level_of

PER_LINE = 8  # entries of the tables; between them they are interpolated
BLURS = np.round(np.concatenate([np.geomspace(0.25, 2.4, 49), np.geomspace(2.64, 12.0, 15)]), 4)  # lines
WIDE = [int(np.argmin(np.abs(BLURS - lines))) for lines in (1.2, 3.0, 8.0)]  # as light that spreads is blurred
FEW = 10  # frames: their words are so much alike that places are looked up on quarter lines, else on half lines
ELSEWHERE = 2.0  # times the blur, at least a line: nearer than this is the same place
NEAREST = 64  # words elsewhere that are compared one by one, where the rest is known to be unlike
CLEARLY = 0.9  # of the best fit: what fits less needs no figure of its own until it is asked for
ROUNDS = 5  # of the adjustment
INVERSE = 0.2  # mean product of two frames' values, of 0.25 where none is blurred and one inverts the other
FEWEST = 4  # frames: three unknowns and one that tells whether they fit

F = np.float32


class Shelf(NamedTuple):
    """The words under one blur where they are looked up, centred and of unit norm.

    `values` (k, m) and `words` (m, k) are the same, from line -1/2 on. Of every word `like` (m, l) are those most like
    it, the most alike first, and `cosine` of the angle to them; l is 0 where these are not wanted. From `apart` entries
    on another place is elsewhere, for blurred words are alike.
    """

    values: Singles
    words: Singles
    like: NDArray[np.int32]
    cosine: Singles
    apart: int

    def find(self, grey: Singles, across: int = 1, dim: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Found:
        """Look the places of pixels (k, n) up, in an image of so many columns, but for those without light."""
        found = Found(*(np.empty(grey.shape[1], kind) for kind in (np.int32, F, F, bool)))
        fit = np.empty(len(self.words), F)
        least = (F(dim[0]), F(dim[1]), F(dim[2]))
        look_up(grey, self, across, least, (np.empty(len(grey), F), fit, fit.view(np.int32)), *found)
        return found


class Found(NamedTuple):
    """What was looked up, (n,) each.

    The place that fits best, and how well that and the best elsewhere fit, grey values; `known` tells whether `rival`
    is that, else the best elsewhere fits no better.
    """

    best: NDArray[np.int32]
    top: Singles
    rival: Singles
    known: NDArray[np.bool_]


@dataclass(frozen=True)
class Book:
    """The words of one axis.

    `frames` are the numbers of its frames and of those lit evenly, `fine` (blurs, entries, k) their values on a fine
    grid of lines, from line -1 on, `cells` (lines,) how many neighbours, itself included, have a line's word.
    """

    frames: tuple[int, ...]
    lines: int
    fine: Singles
    cells: NDArray[np.int64]
    _kept: dict[int, Shelf] = field(default_factory=dict, compare=False)

    @property
    def grid(self) -> int:
        """Places on a line that are looked up."""
        return 4 if len(self.frames) <= FEW else 2

    def places(self, best: NDArray[np.int32]) -> Singles:
        """Give what was looked up in lines."""
        return (best / F(self.grid) - F(0.5)).astype(np.float32)

    def values(self, blur: NDArray[np.int64], place: Singles) -> Singles:
        """Give the words (n, k) at places (n,) in lines, each under its blur."""
        x = np.clip((place + 1) * PER_LINE, 0, self.fine.shape[1] - 2)
        entry, part = x.astype(int), (x % 1)[:, None]
        return np.asarray((1 - part) * self.fine[blur, entry] + part * self.fine[blur, entry + 1], np.float32)

    def bends(self, blur: NDArray[np.int64], place: Singles) -> list[Singles]:
        """Give the words (n, k) at places, and what changes if a camera bends grey values, or light spreads widely."""
        words = self.values(blur, place)
        wide = (self.values(np.full_like(blur, number), place) - words for number in WIDE)
        return [words, words**2 - words, words**3 - words, *wide]

    def bent(self, terms: Array, blurs: slice) -> Book:
        """Give the book of words so changed, under some blurs."""
        fine = self.fine.copy()
        some = fine[blurs]
        more = terms[0] * (some**2 - some) + terms[1] * (some**3 - some)
        for term, number in zip(terms[2:], WIDE, strict=True):
            more += term * (self.fine[number] - some)
        fine[blurs] += more
        return replace(self, fine=fine, _kept={})

    def halved(self, half: float, blurs: slice) -> Book:
        """Give the book of words of which a camera's gamma makes `half` where half the light is, under some blurs."""
        return self.bent(np.array([2 - 4 * half, *[0.0] * (1 + len(WIDE))]), blurs)

    @property
    def inverted(self) -> bool:
        """Whether frames show each other's inverse."""
        sharp = self.fine[0, PER_LINE:-PER_LINE]
        sharp = sharp - sharp.mean(axis=0)  # 0 where a frame is evenly lit
        return bool(((sharp.T @ sharp) / len(sharp) < -INVERSE).any())

    def shelf(self, blur: int) -> Shelf:
        """Give what is looked up under a blur."""
        rows = self.fine[blur, PER_LINE // 2 : (self.lines + 1) * PER_LINE - PER_LINE // 2 + 1 : PER_LINE // self.grid]
        centred = rows - rows.mean(axis=1, keepdims=True)
        words = centred / np.maximum(np.sqrt(np.sum(centred**2, axis=1)), F(1e-3))[:, None]
        none = np.empty((len(words), 0))
        apart = round(max(1.0, ELSEWHERE * float(BLURS[blur])) * self.grid)
        return Shelf(np.ascontiguousarray(words.T), words, none.astype(np.int32), none.astype(np.float32), apart)

    def compared(self, blur: int) -> Shelf:
        """Give the same, with the words most like every one; it is kept, as captures of a rig have one blur."""
        if blur not in self._kept:
            shelf = self.shelf(blur)
            words, count = shelf.words, min(NEAREST + 2 * shelf.apart, len(shelf.words))
            like, cosine = np.empty((len(words), count), np.int32), np.empty((len(words), count), np.float32)
            for n, word in enumerate(words):
                alike = words @ word
                some = np.argpartition(alike, len(words) - count)[len(words) - count :]
                like[n] = some[np.argsort(-alike[some])]
                cosine[n] = alike[like[n]]
            self._kept.clear()
            self._kept[blur] = shelf._replace(like=like, cosine=cosine)
        return self._kept[blur]


@lru_cache(maxsize=8)
def book_of(patterns: tuple[Pattern, ...], axis: Axis, lines: int | None, where: str) -> Book:
    """Make the book of an axis; too few frames, or words that repeat, are an InputError."""
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
        remedy = "show more frames, or words that differ, or say gray or binary with its cell"
        raise InputError(f"{where}, axis {axis}", seen, remedy)
    ends = np.flatnonzero(np.any(light[:, 1:] != light[:, :-1], axis=0)) + 1
    sizes = np.diff(ends, prepend=0, append=count)
    fine = np.stack([_blurred(light, blur, len(even)) for blur in BLURS.tolist()])
    return Book((*mine, *even), count, fine, np.repeat(sizes, sizes))


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


@part
def _fit(words, entry, g):  # type: ignore[no-untyped-def]
    """How well a word fits grey values without their mean."""
    total = np.float32(0)
    for f in range(len(g)):
        total += words[entry, f] * g[f]
    return total


@part
def _climb(words, entry, g):  # type: ignore[no-untyped-def]
    """The place near an entry that fits best, and how well."""
    most = _fit(words, entry, g)
    for way in (1, -1):
        while 0 <= entry + way < len(words):
            more = _fit(words, entry + way, g)
            if more < most or (more == most and way > 0):  # of equals the first
                break
            entry, most = entry + way, more
    return entry, most


@part
def _foretold(shelf, entry, g, square):  # type: ignore[no-untyped-def]
    """Whether no word fits better than that near an entry: the best, its fit, that elsewhere, and what is known.

    Known is nothing (0), that no other fits as well and none elsewhere better than is given (1), or exactly how well
    one does (2). A word at an angle B to one at an angle A < B to the grey values is at least B - A from these.
    """
    at, top = _climb(shelf.words, entry, g)
    rest, last = np.sqrt(max(square - top * top, np.float32(0))), shelf.like.shape[1] - 1
    norm, second = np.sqrt(square), np.float32(0)
    cosine = shelf.cosine[at, last]
    bound = cosine * top + np.sqrt(np.float32(1) - cosine * cosine) * rest
    if cosine * norm >= top or bound >= top:
        return at, top, second, 0
    for j in range(last + 1):
        cosine = shelf.cosine[at, j]
        if cosine * norm < top:
            bound = cosine * top + np.sqrt(np.float32(1) - cosine * cosine) * rest
            if bound < max(second, CLEARLY * top):
                return at, top, max(second, bound), 2 if bound <= second else 1
        other = shelf.like[at, j]
        if other != at:
            fit = _fit(shelf.words, other, g)
            if fit >= top:
                return at, top, second, 0
            if abs(other - at) > shelf.apart:
                second = max(second, fit)
    return at, top, max(second, bound), 1


@part
def _search(shelf, g, fit, bits):  # type: ignore[no-untyped-def]
    """The word of all that fits best, how well, and how well the best elsewhere.

    `bits` are those of `fit` as whole numbers, of which the largest is found quicker: the order is the same above 0.
    """
    values = shelf.values
    k, m = values.shape
    for c in range(m):
        fit[c] = g[0] * values[0, c]
    f = 1
    while f + 3 < k:
        for c in range(m):
            one = fit[c] + g[f] * values[f, c] + g[f + 1] * values[f + 1, c]
            fit[c] = one + g[f + 2] * values[f + 2, c] + g[f + 3] * values[f + 3, c]
        f += 4
    for rest in range(f, k):
        for c in range(m):
            fit[c] += g[rest] * values[rest, c]
    most = _largest(bits, 0, m)
    at = 0
    while at < m - 1 and bits[at] != most:
        at += 1
    before, after = _largest(bits, 0, at - shelf.apart), _largest(bits, at + shelf.apart + 1, m)
    bits[0], bits[1] = most, max(before, after)
    return at, fit[0], fit[1]


@part
def _largest(bits, first, last):  # type: ignore[no-untyped-def]
    most = NONE
    for c in range(first, last):
        most = max(most, bits[c])
    return most


@fast
def look_up(grey, shelf, across, least, scratch, best, top, rival, known):  # type: ignore[no-untyped-def]
    """Look up the place of every pixel of `grey`, (k, n); pixels before it foretell its word.

    Where the angles between words prove that no other fits better, that is it; else all are tried. The shelf is
    `Book.shelf`, or `Book.compared` where pixels may foretell; `across` are the pixels of a row. Below the sum `least`
    (dark, shot, floor) of the frames' squared deviations from their mean a pixel fits nothing. Scratch: float32 (k,)
    and (m,), the same as int32. `best`, `top`, `rival` and `known`, (n,), are of `Found`.
    """
    k, n = grey.shape
    g, fit, bits = scratch
    for p in range(n):
        mean, square = np.float32(0), np.float32(0)
        for f in range(k):
            mean += grey[f, p]
        mean /= np.float32(k)
        for f in range(k):
            g[f] = grey[f, p] - mean
            square += g[f] * g[f]
        told = 0
        if square < max(least[0] + least[1] * mean, least[2]):
            best[p], top[p], rival[p], known[p] = len(fit) // 2, np.float32(0), np.float32(0), True
            continue
        if shelf.like.shape[1] > 0:
            for q in (p - 1, p - across):
                if q >= 0 and told == 0:
                    best[p], top[p], rival[p], told = _foretold(shelf, best[q], g, square)
        if told == 0:
            best[p], top[p], rival[p] = _search(shelf, g, fit, bits)
        known[p] = told != 1


@fast
def adjust(grey, fine, blur, start, noise, steady, out, left):  # type: ignore[no-untyped-def]
    """Adjust place, contrast and offset of every pixel of `grey`, (k, n), by weighted least squares.

    From `start`, (n,) lines, in the words `fine`, (blurs, entries, k), of its `blur`; noise is (dark, shot, floor).
    `steady`, (2, k), is by how much more, 1 in the mean, a frame shows of offset and contrast: lamps flicker. Written:
    `out`, (4, n): place, its sigma, contrast, offset; `left`, (n,): weighted squares that remain.
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
                a, t, d = steady[0, f], steady[1, f] * t, steady[1, f] * d
                expected = b * a + s * t if turn > 0 else grey[f, p]
                w = np.float32(1) / max(dark + shot * expected, floor)
                e = grey[f, p] - b * a - s * t
                sd = s * d
                n0 += w * a * a
                n1 += w * a * t
                n2 += w * t * t
                n3 += w * a * sd
                n4 += w * t * sd
                n5 += w * sd * sd
                h0 += w * a * e
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
