"""Frames that show the pattern before, in some rows or in all: a rolling shutter, or a pattern that came late."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from core.decode.tables import Array, Limits, Singles
from core.patterns import Pattern, axis_of, brightness, level_of

ALIKE = 1.6  # times the noise of their difference, by which frames of one pattern may differ
LEAST = 3  # rows of the sample
CLEAR = 8.0  # times the noise, range of grey values of a lit pixel
CHANGED = 0.5  # part of full light by which the two patterns differ in a pixel that can tell
SEEN = 0.4  # part of that which it may still do
KNOWN = 0.25  # part of full light by which all other frames may be off where a place is taken as known
WITNESSES = 30  # pixels that can tell, at the least
MOST = 0.6  # of the rows; where more are alike, all tell where they look
FEWEST = 100  # pixels that tell where the others look
DOUBT, FARTHER = 1.0, 3.0  # lines, by which that surface may be off there, at least; times the median outside
TRIMMED = 0.5  # of them that lie farthest from a smooth surface do not count
USUAL = 2 / np.sqrt(np.pi)  # mean difference of two normal deviates


def late_frames(
    patterns: Sequence[Pattern], sample: Singles, rows: range, place: tuple[Singles, Singles], limits: Limits
) -> tuple[str, ...]:
    """Say which frames show what the frame listed before them should.

    Where these rows look is told by the other rows, as far as the other frames agree with that: a frame is late where
    `WITNESSES` such pixels should have changed and have not.

    Parameters
    ----------
    patterns : sequence of Pattern
        Of all frames, in the order in which they were taken.
    sample : float32 (frames, n)
        Their grey values in pixels all over the image.
    rows : range
        Rows of the image that the sample has.
    place : (float32 (n,), float32 (n,))
        Decoded u and v of the sample, NaN where there is none.
    limits : Limits
        For the noise.
    """
    grey = sample.reshape(len(sample), len(rows), -1)
    differ = np.abs(np.diff(grey, axis=0)).mean(axis=2)
    noise = np.sqrt(np.maximum(limits.dark + limits.shot * grey.mean(axis=2), limits.floor))
    alike = differ < ALIKE * USUAL * noise[1:]
    low, high = grey.min(axis=0), grey.max(axis=0)
    lit = high - low > CLEAR * noise.max(axis=0)[:, None]
    notes: dict[int, str] = {}
    for n in (np.flatnonzero(alike.sum(axis=1) >= LEAST) + 1).tolist():
        top, bottom = (int(np.argmin(each)) for each in (alike[n - 1], alike[n - 1][::-1]))
        whole = bool(alike[n - 1].all())
        if patterns[n] == patterns[n - 1] or n - 1 in notes or not (whole or max(top, bottom) >= LEAST):
            continue
        first, last = (0, len(rows)) if whole else (0, top) if top >= bottom else (len(rows) - bottom, len(rows))
        some = np.zeros_like(lit)
        some[first:last] = lit[first:last]
        if np.count_nonzero(some) < WITNESSES:
            continue
        outside = np.ones_like(lit)
        outside[first:last] = last - first > MOST * len(rows)
        seen = (grey[:, some] - low[some]) / (high - low)[some]
        if _unchanged(n, patterns, seen, [_Surface(each.reshape(lit.shape), outside, some) for each in place]):
            where = "" if whole else f" in rows {rows[first]} to {rows[last - 1]}"
            notes[n] = (
                f"Frame {n} shows the pattern of frame {n - 1}{where}: it was exposed before or while the pattern "
                "changed. Wait longer after showing a pattern, and take the capture again."
            )
    return tuple(notes.values())


def _unchanged(n: int, patterns: Sequence[Pattern], seen: Array, place: Sequence[_Surface]) -> bool:
    """Whether enough pixels that should have changed from the frame before have not."""
    changes = [_light(patterns[n - 1 : n + 1], place, doubts) for doubts in (-1, 0, 1)]
    expected = np.abs(np.diff(changes, axis=1)[:, 0]).min(axis=0)
    telling = expected > CHANGED
    if np.count_nonzero(telling) < WITNESSES:
        return False
    off = np.abs(np.delete(_light(patterns, place) - seen, (n - 1, n), axis=0))
    telling &= np.nansum(off, axis=0) < KNOWN * np.isfinite(off).sum(axis=0)
    if np.count_nonzero(telling) < WITNESSES:
        return False
    return bool(np.abs(seen[n] - seen[n - 1])[telling].mean() < SEEN * expected[telling].mean())


class _Surface:
    """Quadratic surface through most of one coordinate outside some pixels, and there; found when it is asked for."""

    def __init__(self, place: Singles, outside: NDArray[np.bool_], some: NDArray[np.bool_]) -> None:
        self.place, self.outside, self.some = place, outside, some

    @cached_property
    def fitted(self) -> tuple[Array, float]:
        """Coordinate at the pixels, and by how much it may be off; NaN where too few are known outside."""
        known = np.isfinite(self.place) & self.outside
        if known.sum() < FEWEST:
            return np.full(np.count_nonzero(self.some), np.nan), np.nan
        design, values = _quadratic(known), np.asarray(self.place[known], float)
        away = np.zeros(len(values))
        for _ in range(4):
            kept = away <= np.quantile(away, 1 - TRIMMED)
            half = design[kept].T
            terms = np.linalg.lstsq(half @ half.T, half @ values[kept], rcond=None)[0]
            away = np.abs(values - design @ terms)
        farther = 1.0 if self.outside.all() else FARTHER
        return _quadratic(self.some) @ terms, max(DOUBT, farther * float(np.median(away)))


def _quadratic(some: NDArray[np.bool_]) -> Array:
    y, x = (2 * each / size - 1 for each, size in zip(np.nonzero(some), some.shape, strict=True))
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)


def _light(patterns: Sequence[Pattern], place: Sequence[_Surface], doubts: float = 0) -> Array:
    """Part of full light of every pattern, its coordinates off by some doubts; NaN where they are not known."""
    levels = []
    for pattern in patterns:
        axis = axis_of(pattern)
        if axis is None:
            levels.append(np.full(np.count_nonzero(place[0].some), float(level_of(pattern) or 0)))
        else:
            at, doubt = place[axis == "y"].fitted
            lines = np.rint(np.nan_to_num(at + doubts * doubt))
            levels.append(np.where(np.isfinite(at), brightness(pattern, lines), np.nan))
    return np.stack(levels)
