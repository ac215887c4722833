"""All frames, one estimate: coordinates by maximum likelihood from every frame of a capture.

Edges of bits, white and black carry position too, not the phase steps alone. Of every pixel the ambient light, the gain
and both coordinates are adjusted to all its frames, from where the decoder put it. How much the pattern is blurred is
found in the same residuals, tile by tile.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from core.decode.frames import AxisFrames, Image, SortedFrames
from core.decode.noise import TINY
from core.decode.refined import PAD, PER_LINE, SUMS, TILE, AxisModel, Light, blur_costs, refine_pixels, rows_for
from core.decode.tables import Array, AxisTable, Limits, Singles
from core.decode.waves.curves import light_at
from core.decode.waves.response import Response
from core.lazy import dataclass
from core.parallel import run_in_bands
from core.patterns import Pattern, brightness, grey_reason
from core.progress import Progress

WIDTHS = 0.3 * 1.02 ** np.arange(96)  # lines, standard deviations of the blur
COARSE = (8, 28, 48, 68, 88)  # of them, looked at first
AROUND = 12  # of them on either side of the best, among which tiles choose
STEP = 4  # of them: those between are chosen by what the nearest of every fourth say
OF_TILE = 12  # pixels of a tile that tell its blur
USUAL = 2.0  # pixels' worth of the whole image's blur in that of a tile, for every pixel of it
BEST_TILES = 64  # that tell the whole image's blur
MEDIAN = 0.97  # of the mean of some twenty squares of normal deviates
FAR = 9.0  # times the variance: no squared difference counts more, and where the surface is rougher, none
NOISE_OF_BEND = 6.0  # variance of second differences by that of their values
GROUP = 8  # frames: a row of the tables is a multiple of them


@dataclass(frozen=True)
class Planes:
    """Flat: coordinates and standard deviations (2, pixels) in lines, which are refined."""

    place: Singles
    sigma: Singles
    columns: int

    @property
    def rows(self) -> int:
        """Of the image."""
        return self.place.shape[1] // self.columns


def estimable(frames: SortedFrames) -> bool:
    """Whether there is more than the phase steps: codes and phases, and no light sections."""
    axes = frames.axes.values()
    return all(axis.lines is None for axis in axes) and any(axis.codes and axis.phases for axis in axes)


def refine(
    frames: SortedFrames,
    patterns: Sequence[Pattern],
    images: Sequence[Image],
    tables: tuple[AxisTable, AxisTable],
    limits: Limits,
    response: Response | None,
    steady: Array | None,
    planes: Planes,
    progress: Progress,
) -> Singles:
    """Refine decoded coordinates, `planes`, in place by all frames; give the misfit (pixels,).

    That is the mean squared residual over its expectation, 1 in the mean; NaN where a pixel is left as it is. The
    tables give the numbers of lines, `limits` noise and full scale; grey patterns go through the projector's
    `response`. `steady` (frames, frames) leads to grey values in steady light; what a room's lamp adds stays.
    """
    curve = b"" if response is None else response.table.tobytes()
    shown = [_shown(frames.axes.get(axis), patterns) for axis in ("x", "y")]
    lines = [int(table.lines) for table in tables]
    if steady is None or np.count_nonzero(steady) > len(steady):
        steady = np.eye(len(images))
    light = Light(
        np.array(frames.white, np.int32),
        np.array(frames.black, np.int32),
        limits.dark,
        limits.shot,
        limits.floor,
        limits.saturation,
        steady.diagonal().astype(np.float32),
    )
    addresses = np.array([image.ctypes.data for image in images], np.uint64)
    source = addresses, images[0].itemsize
    kept: list[object] = []

    def models(x: Sequence[int], y: Sequence[int]) -> tuple[AxisModel, AxisModel]:
        made = [_model(*of, n, curve, widths) for of, n, widths in zip(shown, lines, (x, y), strict=True)]
        kept.extend(tables for _, tables in made)
        return made[0][0], made[1][0]

    progress(0.0, "finding the blur")
    pixels = _pixels_of_tiles(planes, [k for k in (0, 1) if shown[k][0]])
    misfit = np.full(planes.place.shape[1], np.nan, np.float32)
    if pixels.max() < 0:
        return misfit
    chosen, blur = _find_blur(models, source, light, planes, pixels)
    x, y = models(*chosen)
    before = planes.place.copy(), planes.sigma.copy()
    out = (planes.place, planes.sigma, misfit)
    for top in progress.over(range(0, planes.rows, 512), "refining from row {}"):

        def band(first: int, last: int, top: int = top) -> None:
            grey = rows_for(x, y, light)
            refine_pixels(top + first, top + last, planes.columns, *source, x, y, light, blur, grey, out)

        run_in_bands(band, min(512, planes.rows - top))
    _hold_against(planes, *before)
    known = misfit[np.isfinite(misfit)]
    beyond = float(np.median(known)) / MEDIAN if len(known) else 1.0
    if beyond > 1:
        misfit /= np.float32(beyond)
    return misfit


def _hold_against(planes: Planes, place: Singles, sigma: Singles) -> None:
    """Hold the estimate, in place, against what was decoded before, and undo it where it is no better.

    Where all frames are as their patterns say, it differs from what was decoded by the noise it has taken away, and is
    smoother by as much. What a tile's differences are more than that is its own error. By so much less its variance is
    below the former one (Hausman 1978 compares estimates so).
    """
    shape = planes.rows, planes.columns
    for new, new_sigma, old, old_sigma in zip(planes.place, planes.sigma, place, sigma, strict=True):
        left, middle, right = ([a.reshape(shape)[1::2, k : k - 2 or None : 2] for a in (old, new)] for k in range(3))
        bends = [a + c - 2 * b for a, b, c in zip(left, middle, right, strict=True)]
        before, after = (np.square(a.reshape(shape)[1::2, 1:-1:2]) for a in (old_sigma, new_sigma))
        moved = np.square(middle[0] - middle[1])
        told = (moved > 0) & (np.square(bends[0] + bends[1]) < 4 * NOISE_OF_BEND * FAR * before)
        weight = np.where(told, 1 / np.square(before), 0)
        smoother = (np.square(bends[0]) - np.square(bends[1])) / NOISE_OF_BEND
        gained, expected = (
            _around(np.where(told, weight * a, 0), shape)
            for a in (2 * smoother - np.minimum(moved, FAR * before), before - after)
        )
        part = np.clip(gained / np.maximum(expected, np.float32(1e-20)), 0, 1)
        part = part.repeat(TILE, axis=0).repeat(TILE, axis=1)[: shape[0], : shape[1]].ravel()
        new_sigma[:] = np.sqrt((1 - part) * np.square(old_sigma) + part * np.square(new_sigma))
        worse = ~(new_sigma < old_sigma)
        new[worse], new_sigma[worse] = old[worse], old_sigma[worse]


def _around(values: Singles, shape: tuple[int, int]) -> Singles:
    """Sums over three by three tiles of values of every second row and column."""
    down, across = (-(-size // TILE) + 2 for size in shape)
    half = TILE // 2
    padded = np.zeros((half * down, half * across), np.float32)
    padded[half : half + values.shape[0], half : half + values.shape[1]] = values
    tiles = padded.reshape(down, half, across, half).sum(axis=(1, 3))
    return np.asarray(sum(tiles[i : i + down - 2, j : j + across - 2] for i in range(3) for j in range(3)))


def _shown(axis: AxisFrames | None, patterns: Sequence[Pattern]) -> tuple[tuple[int, ...], tuple[Pattern, ...]]:
    """Numbers and patterns of the frames that tell an axis."""
    if axis is None:
        return (), ()
    codes = [n for code in axis.codes for side in (code.direct, code.inverse) for bit in side.values() for n in bit]
    numbers = sorted({*codes, *(n for phase in axis.phases for n in phase.frames)})
    return tuple(numbers), tuple(patterns[n] for n in numbers)


def _model(
    numbers: tuple[int, ...], patterns: tuple[Pattern, ...], lines: int, curve: bytes, widths: Sequence[int]
) -> tuple[AxisModel, object]:
    """Make the model of an axis, and what must be kept as long as it is used."""
    tables = [_blurred(patterns, lines, curve, w) for w in widths]
    light, sums = (np.array([each[k].ctypes.data for each in tables], np.uint64) for k in (0, 1))
    places, _, size = tables[0][0].shape
    return AxisModel(light, sums, places, size, np.array(numbers, np.int32)), tables


@lru_cache(maxsize=32)
def _blurred(patterns: tuple[Pattern, ...], lines: int, curve: bytes, width: int) -> tuple[Singles, Singles]:
    """One width of an `AxisModel`: boxes of lines, blurred by a Gaussian."""
    if not patterns:
        return np.zeros((1, 2, GROUP), np.float32), np.zeros((1, SUMS), np.float32)
    shown = [brightness(p, np.arange(lines)) for p in patterns]
    if curve:
        table = np.frombuffer(curve)
        shown = [light_at(table, s) if grey_reason(p) else s for p, s in zip(patterns, shown, strict=True)]
    fine = np.repeat(np.pad(np.array(shown), ((0, 0), (PAD, PAD))), PER_LINE, axis=1)
    n = fine.shape[1]
    frequency = np.fft.rfftfreq(n, 1 / PER_LINE)
    terms = np.fft.rfft(fine) * np.exp(-2 * (np.pi * WIDTHS[width] * frequency) ** 2)
    t, slope = np.fft.irfft(terms, n), np.fft.irfft(2j * np.pi * frequency * terms, n)
    sums = np.stack([(a * b).sum(axis=0) for a, b in ((t, 1), (t, t), (slope, 1), (t, slope), (slope, slope))], axis=1)
    sums = np.column_stack([sums, (t * slope * slope).sum(axis=0)])
    light = np.zeros((n, 2, -(-len(patterns) // GROUP) * GROUP), np.float32)
    light[:, 0, : len(patterns)], light[:, 1, : len(patterns)] = t.T, slope.T
    return light, sums.astype(np.float32)


def _pixels_of_tiles(planes: Planes, axes: list[int]) -> NDArray[np.int64]:
    """Numbers of some decoded pixels of every tile (tiles down, tiles across, OF_TILE); -1 where there is none."""
    rows, columns = planes.rows, planes.columns
    down, across = (np.arange(-(-size // TILE)) * TILE for size in (rows, columns))
    offset = np.random.default_rng(0).permutation(TILE * TILE)[:OF_TILE]
    row = down[:, None, None] + offset // TILE + np.zeros((1, len(across), 1), int)
    column = across[None, :, None] + offset % TILE + np.zeros((len(down), 1, 1), int)
    inside = (row < rows) & (column < columns)
    number = np.where(inside, row * columns + column, 0)
    decoded = np.isfinite(planes.place[axes][:, number]).all(axis=0)
    return np.where(inside & decoded, number, -1)


def _find_blur(models, source, light, planes, pixels):  # type: ignore[no-untyped-def]
    """Widths of both axes that tiles choose among, and their choices, uint8 (2, tiles down, tiles across)."""
    tiles = pixels.reshape(-1, OF_TILE)
    known = (tiles >= 0).sum(axis=1)
    some = tiles[np.argsort(-known, kind="stable")[:: max(1, np.count_nonzero(known) // BEST_TILES)][:BEST_TILES]]

    def costs(tiles: NDArray[np.int64], axis: int, mine: Sequence[int], other: int) -> Array:
        x, y = models(*((mine, [other]) if axis == 0 else ([other], mine)))
        found = np.zeros((len(tiles), len(mine)))

        def band(first: int, last: int) -> None:
            grey = rows_for(x, y, light, 1)
            blur_costs(tiles[first:last], *source, x, y, light, planes.place, axis, 0, grey, found[first:last])

        run_in_bands(band, len(tiles))
        return found

    best = [COARSE[1], COARSE[1]]
    for _ in range(2):
        for axis in (0, 1):
            best[axis] = COARSE[int(costs(some, axis, COARSE, best[1 - axis]).sum(axis=0).argmin())]
    chosen, choice = [], np.zeros((2, *pixels.shape[:2]), np.uint8)
    for axis in (0, 1):
        low = int(np.clip(best[axis] - AROUND, 0, len(WIDTHS) - 2 * AROUND - 1))
        mine = range(low, low + 2 * AROUND + 1, STEP)
        each = costs(tiles, axis, mine, best[1 - axis])
        usual = each.sum(axis=0) / max(known.sum(), 1)
        field = (each + USUAL * OF_TILE * usual).reshape(*pixels.shape[:2], -1)
        padded = np.pad(field, ((1, 1), (1, 1), (0, 0)), mode="edge")
        down, across = pixels.shape[:2]
        smooth = np.sum([padded[i : i + down, j : j + across] for i in range(3) for j in range(3)], axis=0)
        best[axis] = mine[int(usual.argmin())]
        used, which = np.unique(low + _lowest(smooth), return_inverse=True)
        choice[axis] = which.reshape(down, across)
        chosen.append(used.tolist())
    return chosen, choice


def _lowest(costs: Array) -> NDArray[np.int64]:
    """Number of the width at which costs (..., n) of every `STEP`-th are least, by the parabola about the least one."""
    at = np.clip(costs.argmin(axis=-1), 1, costs.shape[-1] - 2)
    left, middle, right = (np.take_along_axis(costs, (at + k)[..., None], -1)[..., 0] for k in (-1, 0, 1))
    beside = 0.5 * (left - right) / np.maximum(left - 2 * middle + right, TINY)
    return np.asarray(np.rint(STEP * np.clip(at + beside, 0, costs.shape[-1] - 1)), np.int64)
