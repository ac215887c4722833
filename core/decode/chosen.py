"""Which pixels stand for all: rows and columns spread over the image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.decode.frames import Image
from core.decode.tables import Array, Singles
from core.numerics import quantile_of

SAMPLE = 4096  # pixels; the variance of one residual each is then known to 2 %
UNLIKE = 0.06  # by which a neighbour in the next row is oftener noisier than less noisy: of 1.1 times the noise
LIT = 0.3  # part of the contrast of the clearest stripes, from which a pixel sees them
BRIGHT = 0.6  # part of the range of mean grey values beyond which a pixel is bright


def take_sample(images: Sequence[Image], number: int = SAMPLE) -> Singles:
    """Grey values of about so many pixels spread over the image, shape (frames, pixels)."""
    sample = np.stack([image[spread(image.shape, number)] for image in images])
    return sample.reshape(len(images), -1).astype(np.float32)


def spread(shape: tuple[int, ...], number: int = SAMPLE) -> tuple[slice, slice]:
    """Rows and columns of the pixels that `take_sample` takes of images of a shape."""
    height, width = shape
    step = max(1, int(np.sqrt(height * width / number)))
    across = min(step, 4)  # neighbours share cache lines: rather fewer rows
    down = max(1, min(height // 16, step * step // across))
    return slice(down // 2, None, down), slice(None, None, across)


def in_steady_light(sample: Singles, light: Array | None) -> Singles:
    """What `flicker.steady` makes of grey values (frames, pixels)."""
    return sample if light is None else np.einsum("fg,gn->fn", light.astype(np.float32), sample)


def of_lit(
    sample: Singles, images: Sequence[Image], light: Array | None, stripes: Sequence[int]
) -> tuple[Singles, Array]:
    """The sample and where its pixels lie, x and y from -1 to 1, (2, n); where few of it see the stripes that some
    frames show, as of a board of white dots, with more pixels that do."""
    (height, width), (down, across) = images[0].shape, spread(images[0].shape)
    grid = np.meshgrid(np.arange(height)[down], np.arange(width)[across], indexing="ij")
    rows, columns = (each.ravel() for each in grid)
    swing = np.ptp(sample[stripes], axis=0)
    limit = LIT * quantile_of(swing, 0.99)
    number = int(np.count_nonzero(swing > limit))
    if number < SAMPLE // 2:
        step = max(1, number * height * width // (swing.size * SAMPLE))
        every = max(1, int(np.sqrt(step)))
        down, across = slice(None, None, -(-step // every)), slice(None, None, every)
        seen = np.stack([images[n][down, across] for n in stripes])
        there = np.nonzero(seen.max(axis=0).astype(np.float32) - seen.min(axis=0) > limit)
        below, right = (part.step * at for part, at in zip((down, across), there, strict=True))
        more = np.stack([image[below, right] for image in images]).astype(np.float32)
        sample = np.concatenate([sample, in_steady_light(more, light)], axis=1)
        rows, columns = np.concatenate([rows, below]), np.concatenate([columns, right])
    return sample, np.stack([middles(columns, width), middles(rows, height)])


def middles(pixels: NDArray[np.intp], size: int) -> Array:
    """Middles of pixels by their numbers along an axis of so many, from -1 at one edge of the image to 1."""
    return np.asarray((2 * pixels + 1) / size - 1)


def places_of(shape: tuple[int, ...], rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Array:
    """Where pixels lie in an image of a shape, x and y from -1 to 1, and in squares of two by two, where a mosaic of
    colours has them: -1 or 1 by the column, the row and both, shape (5, ...)."""
    height, width = shape
    right, below = 2.0 * (columns % 2) - 1, 2.0 * (rows % 2) - 1
    x, y = middles(columns, width), middles(rows, height)
    return np.array(np.broadcast_arrays(x, y, right, below, right * below))


def of_all_rows(
    sample: Singles, found: Array, images: Sequence[Image], light: Array | None, number: int
) -> tuple[Singles, NDArray[np.intp]]:
    """A sample of such a number and its rows; every other is the row above it, if it has even or odd ones that differ.

    They are where a colour camera's pixels were interpolated to grey, of which every column shows two kinds by turns.
    """
    part, columns = spread(images[0].shape, number)
    rows = np.arange(len(images[0]))[part]
    if part.step % 2:
        return sample, rows
    whole, factors = sample.reshape(len(images), len(rows), -1), found.astype(np.float32)
    some = slice(None, None, max(1, number // SAMPLE))
    here, above = whole[:, some], _above(images, rows[some], columns, light)
    own, others = (np.abs(np.einsum("kf,fij->kij", factors, each)) for each in (here, above))
    oftener, level = np.sign(others - own).mean(axis=0), here.mean(axis=0)
    bright = level >= level.min() + BRIGHT * np.ptp(level)  # in the dark, whole grey values make all noise alike
    if max(abs(oftener.mean()), abs(oftener[bright].mean())) < UNLIKE:
        return sample, rows
    whole[:, 1::2] = _above(images, rows[1::2], columns, light)
    rows[1::2] -= 1
    return sample, rows


def _above(images: Sequence[Image], rows: NDArray[np.intp], columns: slice, light: Array | None) -> Singles:
    """Grey values of the rows above some, (frames, rows, columns)."""
    shown = np.stack([image[rows - 1, columns] for image in images]).astype(np.float32)
    return in_steady_light(shown.reshape(len(images), -1), light).reshape(shown.shape)
