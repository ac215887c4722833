"""Where another camera sees what a camera sees: both decoded the same stripes.

Nothing of a calibration enters. A first place comes from a grid over the projector's lines, in which every pixel of the
other camera left its own; Newton's steps along the slopes of the coordinates between its pixels lead to where it
decoded the same column and row.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from core.model import Array, Floats, PhaseMap
from core.numerics import inverse_2x2, quantile_of
from core.parallel import run_in_bands
from core.reconstruct.labels import BEND, Labels, labels_of

CELL_PX = 2.5  # of a cell of the grid, so that a pixel leaves its place in each; not where the surface is seen as steep
STEEP = 0.95  # share of the pixels that see it less steep
STEPS = 4
BENDS = np.repeat(BEND, 3, axis=0) / 3  # along a row, the mean of three
AT_REST_PX = 0.01  # by what the last step may move a place


def seen_by_other(own: PhaseMap, other: PhaseMap) -> PhaseMap:
    """Give the places in another camera's image that show what a camera's pixels do, as if that were a projector.

    Parameters
    ----------
    own, other : PhaseMap
        Of two cameras and one projector, with columns and rows.

    Returns
    -------
    PhaseMap
        Of `own`, whose (u, v) are pixels of the other camera and whose projector is that camera; NaN where it does not
        see the place. Its sigmas hold the whole noise of a pixel of either, as for means over many of them; that of a
        single place, between four pixels, is a little less.
    """
    labels = labels_of(other)
    bends: Floats = np.stack([cv2.filter2D(labels.values, -1, kernel) for kernel in (BENDS, BENDS.T)], axis=-1)
    wanted = np.stack([own.u, own.v], axis=-1).astype(np.float64)
    variance = np.stack([own.sigma_u, own.sigma_v], axis=-1).astype(np.float64) ** 2
    places, sigmas = (np.full(wanted.shape, np.nan, np.float32) for _ in range(2))
    begin = _begin(labels, wanted)

    def band(first: int, last: int) -> None:
        rows, columns = np.nonzero(np.isfinite(begin[first:last]).all(axis=-1))
        here = rows + first, columns
        places[here], sigmas[here] = _walk(labels, bends, wanted[here], variance[here], begin[here])

    run_in_bands(band, len(wanted))
    u, v = np.moveaxis(places, -1, 0)
    sigma_u, sigma_v = np.moveaxis(sigmas, -1, 0)
    return replace(own, u=u, v=v, sigma_u=sigma_u, sigma_v=sigma_v, projector=other.camera)


def _begin(labels: Labels, wanted: Array) -> Array:
    """A place near each: of the last pixel that left its own in the same cell of the grid."""
    known, some = (np.isfinite(each).all(axis=-1) for each in (labels.values, wanted))
    begin = np.full(wanted.shape, np.nan)
    slopes = np.abs(labels.slopes).max(axis=(2, 3))
    if not (np.isfinite(slopes).any() and some.any()):
        return begin
    cell = max(1.0, CELL_PX * quantile_of(slopes[np.isfinite(slopes)], STEEP))
    cells, asked = labels.values / cell, wanted / cell
    least = np.floor(cells[known].min(axis=0)).astype(int)
    shape = np.floor(cells[known].max(axis=0)).astype(int) - least + 1
    grid = np.full((*shape, 2), np.nan)
    rows, columns = np.nonzero(known)
    grid[tuple((np.floor(cells[known]).astype(int) - least).T)] = np.stack([columns, rows], axis=-1)
    at = np.floor(asked[some]).astype(int) - least
    inside = ((at >= 0) & (at < shape)).all(axis=-1)
    begin[some] = np.where(inside[:, None], grid[tuple(np.where(inside[:, None], at, 0).T)], np.nan)
    return begin


def _walk(labels: Labels, bends: Floats, wanted: Array, variance: Array, place: Array) -> tuple[Array, Array]:
    """Walk to where the coordinates are the wanted ones; places and their sigmas, each (n, 2).

    `bends` (H, W, 2, 2) are the second differences of the coordinates along both axes of the image: between four pixels
    of a curved surface they are larger or smaller than their mean.
    """
    last = np.array(labels.values.shape[1::-1]) - 1
    for _ in range(STEPS):
        nearest = np.clip(np.rint(np.nan_to_num(place)), 0, last).astype(int)
        share = place - np.floor(place)
        value, _, slope = labels.between(place)
        value -= np.einsum("nij,nj->ni", bends[nearest[:, 1], nearest[:, 0]], share * (1 - share) / 2)
        back = inverse_2x2(slope)
        step = np.einsum("nij,nj->ni", back, wanted - value)
        place = place + step
    place[~(np.abs(step) < AT_REST_PX).all(axis=1)] = np.nan
    both = variance + labels.at_pixels(nearest)[1]
    return place, np.where(np.isfinite(place), np.sqrt(np.einsum("nij,nj->ni", back**2, both)), np.nan)
