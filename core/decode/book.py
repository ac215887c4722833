"""The words of an axis, as values over its lines under every blur, and the kernels that find a pixel's place there."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from core.decode.compiled import fast
from core.decode.tables import Array, Singles
from core.errors import InputError
from core.numerics import erf
from core.patterns import Axis, Pattern, axis_of, brightness, level_of

PER_LINE = 8  # entries of the tables; between them they are interpolated
BLURS = np.round(np.concatenate([np.geomspace(0.25, 2.4, 49), np.geomspace(2.64, 12.0, 15)]), 4)  # lines
FEW = 10  # frames: their words are so much alike that places are looked up on quarter lines, else on half lines
ROUNDS = 5  # of the adjustment
FEWEST = 4  # frames: three unknowns and one that tells whether they fit

F = np.float32


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


@lru_cache(maxsize=8)
def book_of(patterns: tuple[Pattern, ...], axis: Axis, lines: int | None, where: str) -> Book:
    """Make the book of an axis.

    Raises
    ------
    InputError
        If it has too few frames, or words that repeat.
    """
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


@fast
def look_up(grey, find, elsewhere, fit, best, top, rival):  # type: ignore[no-untyped-def]
    """Look up the place of every pixel.

    Parameters
    ----------
    grey : float32 (k, n)
    find : float32 (k, m)
        Of `Book.find`.
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
def adjust(grey, fine, blur, start, noise, steady, out, left):  # type: ignore[no-untyped-def]
    """Adjust place, contrast and offset of every pixel by weighted least squares.

    Parameters
    ----------
    grey : float32 (k, n)
    fine : float32 (blurs, entries, k)
    blur : int64 (n,)
    start : float32 (n,)
        Places in lines.
    noise : (dark, shot, floor)
    steady : float32 (2, k)
        By how much more, 1 in the mean, a frame shows of offset and contrast: lamps flicker.
    out : float32 (4, n)
        Place, its standard deviation, contrast, offset.
    left : float32 (n,)
        Weighted squares that remain.
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
