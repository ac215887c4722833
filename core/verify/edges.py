"""Edges of a code that rows and columns of an image cross: lines that are known, whatever was decoded there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Array
from core.patterns import Pattern, brightness

SECTIONS = 32  # rows and columns of an image that are looked at
CLEAR = 0.4  # of a frame's usual difference from the mean light, which both sides of an edge have together
REACH = 8  # px to the nearest coordinates, which tell which edge it is: beside edges they may be invalid


@dataclass(frozen=True)
class Edges:
    """Edges that some rows of an image cross, (n,); of columns, where it was `turned`.

    `row` and `column` are of the pixel before an edge, `part` the way from there to the next, `line` the first line
    behind it, and `rising` where light rises with the line. `off` is how far behind the edge the decoded coordinate is,
    in lines, NaN where that is invalid.
    """

    turned: bool
    row: NDArray[np.intp]
    column: NDArray[np.intp]
    part: Array
    line: NDArray[np.int64]
    rising: NDArray[np.bool_]
    off: Array

    @property
    def key(self) -> NDArray[np.int64]:
        """A number of each edge of the projector's, rising and falling ones apart."""
        return 2 * self.line + self.rising


def code_edges(
    patterns: Sequence[Pattern],
    images: Sequence[NDArray],
    lines: NDArray,
    codes: Sequence[int],
    steps: Sequence[int],
    turned: bool,
) -> Edges:
    """Find edges of the code in frames `codes`; the mean of `steps` is half of the light, `lines` decoded (H, W)."""
    every = -(-lines.shape[turned] // SECTIONS)

    def some(image: NDArray) -> Array:
        return np.asarray((image.T if turned else image)[::every], np.float64)

    u = some(lines)
    count = int(np.nanmax(u, initial=0)) + 2
    before, after = _nearest(u)
    ahead = after - before
    level = np.mean([some(images[k]) for k in steps], axis=0)
    rows, columns, parts, edges, rising, off = [], [], [], [], [], []
    for k in codes:
        above = some(images[k]) - level
        usual = float(np.abs(above[np.isfinite(u)]).mean()) if np.isfinite(u).any() else np.inf
        climb = np.diff(above, axis=1)
        row, col = np.nonzero((above[:, :-1] * above[:, 1:] < 0) & (np.abs(climb) > CLEAR * usual) & np.isfinite(ahead))
        part = -above[row, col] / climb[row, col]
        near = before[row, col] + part * ahead[row, col]
        at = u[row, col] + part * (u[row, col + 1] - u[row, col])
        rises = climb[row, col] * ahead[row, col] > 0
        change = np.diff(brightness(patterns[k], np.arange(count)))
        for way in (True, False):
            known = np.flatnonzero(change > 0.5 if way else change < -0.5) + 1
            own = np.flatnonzero(rises == way)
            if len(known) and len(own):
                line = known[np.searchsorted((known[1:] + known[:-1] - 1) / 2, near[own])]
                rows.append(row[own] * every)
                columns.append(col[own])
                parts.append(part[own])
                edges.append(line)
                rising.append(np.full(len(own), way))
                off.append(at[own] - line + 0.5)
    none = np.zeros(0, np.intp)
    return Edges(
        turned,
        np.concatenate([none, *rows]),
        np.concatenate([none, *columns]),
        np.concatenate([np.zeros(0), *parts]),
        np.concatenate([none, *edges]),
        np.concatenate([np.zeros(0, bool), *rising]),
        np.concatenate([np.zeros(0), *off]),
    )


def _nearest(u: Array) -> tuple[Array, Array]:
    """The nearest valid values before and behind each pair of neighbours in a row, NaN where they are far."""
    place = np.arange(u.shape[1], dtype=np.int32)
    valid = np.isfinite(u)
    last = np.maximum.accumulate(np.where(valid, place, np.int32(-REACH)), axis=1)[:, :-1]
    following = np.minimum.accumulate(np.where(valid, place, np.int32(len(place) + REACH))[:, ::-1], axis=1)[:, -2::-1]
    far = (place[:-1] - last >= REACH) | (following - place[1:] >= REACH)
    before, after = (np.take_along_axis(u, np.clip(each, 0, len(place) - 1), axis=1) for each in (last, following))
    before[far] = np.nan
    return before, after
