"""Frames that show the pattern before, in some rows or in all: a rolling shutter, or a pattern that came late."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from core.decode.tables import Array, Limits, Singles
from core.numerics import median_of, polynomial
from core.patterns import Pattern, axis_of, brightness, level_of

ALIKE = 1.6  # times the noise of their difference, by which frames of one pattern may differ
LEAST = 3  # rows of the sample
CLEAR = 8.0  # times the noise, range of grey values of a lit pixel
CHANGED = 0.5  # part of full light by which the two patterns differ in a pixel that can tell
# doubts by which the place may be off: the change must be the same in all, and mostly the first tells that it is not
PLACES = (0, -1, -0.5, 0.5, 1)
SEEN = 0.4  # part of that which it may still do
KNOWN = 0.25  # part of full light by which all other frames may be off where a place is taken as known
WITNESSES = 30  # pixels that can tell, at the least
MOST = 0.6  # of the rows; where more are alike, all tell where they look
FEWEST, ENOUGH = 100, 800  # pixels that tell where the others look
DOUBT, FARTHER = 1.0, 3.0  # lines, by which that surface may be off there, at least; times the median outside
TRIMMED = 0.5  # of them that lie farthest from a smooth surface do not count
USUAL = 2 / np.sqrt(np.pi)  # mean difference of two normal deviates

_Surface = tuple[Array, float]  # a coordinate at some pixels, and by how much it may be off
_Place = Callable[[int], _Surface]  # of both coordinates, found when it is asked for


def late_frames(
    patterns: Sequence[Pattern], sample: Singles, rows: range, place: tuple[Singles, Singles], limits: Limits
) -> tuple[str, ...]:
    """Say which frames show what the frame listed before them should; patterns are in the order they were taken in.

    Where these rows look is told by the other rows, as far as the other frames agree with that: a frame is late where
    `WITNESSES` such pixels should have changed and have not. The sample, (frames, n), is of these rows of the image,
    its decoded u and v, (n,), are NaN where there is none.
    """
    grey = sample.reshape(len(sample), len(rows), -1)
    differ = np.abs(np.diff(grey, axis=0)).mean(axis=2)
    noise = np.sqrt(limits.variance(grey.mean(axis=2)))
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
        if _unchanged(n, patterns, seen, cache(partial(_surface, place, outside, some))):
            told = f"Frame {n} shows the pattern of frame {n - 1}"
            notes[n] = (
                f"{told}: it was exposed before the pattern changed, or the projector did not change it. Wait longer "
                "after showing a pattern, look at the line to the projector, and take the capture again."
                if whole
                else f"{told} in rows {rows[first]} to {rows[last - 1]}: it was exposed while the pattern changed. "
                "Wait longer after showing a pattern, and take the capture again."
            )
    return tuple(notes.values())


def _unchanged(n: int, patterns: Sequence[Pattern], seen: Array, place: _Place) -> bool:
    """Whether enough pixels that should have changed from the frame before have not."""
    rising = falling = np.full(seen.shape[1], np.inf)
    telling = np.ones(seen.shape[1], bool)
    for doubts in PLACES:
        before, after = _light(patterns[n - 1 : n + 1], place, seen.shape[1], doubts)
        change = after - before
        rising, falling = np.minimum(rising, change), np.minimum(falling, -change)
        expected = np.maximum(rising, falling)
        # stripes that are too fine may be one grey in both
        telling &= (np.abs(before - seen[n - 1]) < KNOWN) & (expected > CHANGED)
        if np.count_nonzero(telling) < WITNESSES:
            return False
    others = [k for k in range(len(patterns)) if k not in (n - 1, n)]
    off = np.abs(_light([patterns[k] for k in others], place, seen.shape[1]) - seen[others])
    telling &= np.nansum(off, axis=0) < KNOWN * np.isfinite(off).sum(axis=0)
    if np.count_nonzero(telling) < WITNESSES:
        return False
    return bool(np.abs(seen[n] - seen[n - 1])[telling].mean() < SEEN * expected[telling].mean())


def _surface(both: tuple[Singles, Singles], outside: NDArray[np.bool_], some: NDArray[np.bool_], axis: int) -> _Surface:
    """A coordinate at some pixels by a quadratic surface through most of those outside; NaN where too few are known."""
    place = both[axis]
    known = np.flatnonzero(np.isfinite(place) & outside.ravel())
    if len(known) < FEWEST:
        return np.full(np.count_nonzero(some), np.nan), np.nan
    known = known[:: max(1, len(known) // ENOUGH)]
    design, values = _terms(known, some.shape), place[known].astype(float)
    away, rank = np.zeros(len(known)), int((1 - TRIMMED) * (len(known) - 1))
    for _ in range(4):
        kept = away <= np.partition(away, rank)[rank]
        half = design[:, kept]
        ridge = 1e-9 * half.shape[1] * np.eye(len(half))  # of one row alone there is no slope
        terms = np.linalg.solve(half @ half.T + ridge, half @ values[kept])
        away = np.abs(values - terms @ design)
    farther = 1.0 if outside.all() else FARTHER
    return terms @ _terms(np.flatnonzero(some), some.shape), max(DOUBT, farther * median_of(away))


def _terms(pixels: NDArray[np.intp], shape: tuple[int, ...]) -> Array:
    y, x = (2 * each / size - 1 for each, size in zip(np.divmod(pixels, shape[1]), shape, strict=True))
    return polynomial(x, y, 2).T


def _light(patterns: Sequence[Pattern], place: _Place, count: int, doubts: float = 0) -> Array:
    """Part of full light of every pattern at so many pixels, whose coordinates are off by some doubts; NaN where they
    are not known."""
    levels = []
    for pattern in patterns:
        axis = axis_of(pattern)
        if axis is None:
            levels.append(np.full(count, float(level_of(pattern) or 0)))
        else:
            at, doubt = place(int(axis == "y"))
            lines = np.rint(at + doubts * doubt)
            known = np.isfinite(lines)
            shown = brightness(pattern, lines if known.all() else np.where(known, lines, 0.0))
            levels.append(np.where(known, shown, np.nan))
    return np.stack(levels)
