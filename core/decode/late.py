"""Frames that show the pattern before, in some rows or in all: a rolling shutter, or a pattern that came late."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.decode.tables import Array, Limits, Singles
from core.patterns import Pattern, axis_of, brightness, level_of

ALIKE = 1.6  # times the noise of their difference, by which frames of one pattern may differ
LEAST = 3  # rows of the sample
CLEAR = 8.0  # times the noise, range of grey values of a lit pixel
EXPECTED = 0.15  # part of full light by which patterns should differ in these rows
SEEN = 0.4  # part of that which they may still do
MOST = 0.6  # of the rows; where more are alike, all tell where they look
FEWEST = 100  # pixels that tell where the others look
TRIMMED = 0.5  # of them that lie farthest from a smooth surface do not count
USUAL = 2 / np.sqrt(np.pi)  # mean difference of two normal deviates


def late_frames(
    patterns: Sequence[Pattern], sample: Singles, rows: range, place: tuple[Singles, Singles], limits: Limits
) -> tuple[str, ...]:
    """Say which frames show what the frame listed before them should.

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
        if some.sum() < LEAST * LEAST:
            continue
        seen = np.abs(grey[n] - grey[n - 1])[some].mean()
        own = np.sqrt(max(limits.dark + limits.shot * grey[n - 1 : n + 1, some].mean(), limits.floor))
        if seen >= ALIKE * USUAL * own:
            continue
        outside = np.ones_like(lit)
        outside[first:last] = last - first > MOST * len(rows)
        smooth = [_smooth(p.reshape(lit.shape), outside) for p in place]
        if all(len(smooth[axis == "y"]) > 0 for axis in (axis_of(patterns[k]) for k in (n - 1, n)) if axis):
            light = [_light(patterns[k], smooth, some) for k in (n - 1, n)]
            expected = np.abs(light[1] - light[0])
            if expected.mean() > EXPECTED and seen < SEEN * np.mean(expected * (high - low)[some]):
                where = "" if whole else f" in rows {rows[first]} to {rows[last - 1]}"
                notes[n] = (
                    f"Frame {n} shows the pattern of frame {n - 1}{where}: it was exposed before or while the pattern "
                    "changed. Wait longer after showing a pattern, and take the capture again."
                )
    return tuple(notes.values())


def _smooth(place: Singles, some: NDArray[np.bool_]) -> Array:
    """Quadratic surface through most of some coordinates, everywhere; empty where too few are known."""
    known = np.isfinite(place) & some
    if known.sum() < FEWEST:
        return np.zeros(0)
    y, x = (each / size for each, size in zip(np.indices(place.shape), place.shape, strict=True))
    design = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)
    keep = known
    for _ in range(4):
        surface = design @ np.linalg.lstsq(design[keep], place[keep], rcond=None)[0]
        away = np.abs(place - surface)
        keep = known & (away <= np.quantile(away[known], 1 - TRIMMED))
    return np.asarray(surface, float)


def _light(pattern: Pattern, place: Sequence[Array], some: NDArray[np.bool_]) -> Array:
    """Part of full light at some coordinates."""
    axis = axis_of(pattern)
    if axis is None:
        return np.full(np.count_nonzero(some), float(level_of(pattern) or 0))
    return np.asarray(brightness(pattern, np.rint(place[axis == "y"][some])))
