"""Which pixels stand for all: rows and columns spread over the image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.decode.frames import Image
from core.decode.tables import Array, Singles

SAMPLE = 4096  # pixels; the variance of one residual each is then known to 2 %
UNLIKE = 0.06  # by which a neighbour in the next row is oftener noisier than less noisy: of 1.1 times the noise
BRIGHT = 0.6  # part of the range of mean grey values beyond which a pixel is bright


def take_sample(images: Sequence[Image]) -> Singles:
    """Grey values of pixels spread over the image, shape (frames, pixels)."""
    sample = np.stack([image[spread(image.shape)] for image in images])
    return sample.reshape(len(images), -1).astype(np.float32)


def spread(shape: tuple[int, ...]) -> tuple[slice, slice]:
    """Rows and columns of the pixels that `take_sample` takes of images of a shape."""
    height, width = shape
    step = max(1, int(np.sqrt(height * width / SAMPLE)))
    across = min(step, 4)  # neighbours share cache lines: rather fewer rows
    down = max(1, min(height // 16, step * step // across))
    return slice(down // 2, None, down), slice(None, None, across)


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
    sample: Singles, found: Array, images: Sequence[Image], light: Array | None
) -> tuple[Singles, NDArray[np.intp]]:
    """The sample and its rows; every other one is the row above it, if it has even or odd ones alone that are unlike.

    They are where a colour camera's pixels were interpolated to grey, of which every column shows two kinds by turns.
    """
    part, columns = spread(images[0].shape)
    rows = np.arange(len(images[0]))[part]
    if part.step % 2:
        return sample, rows
    above = np.stack([image[rows - 1, columns] for image in images]).astype(np.float32)
    above = above if light is None else np.einsum("fg,gij->fij", light.astype(np.float32), above)
    here, factors = sample.reshape(above.shape), found.astype(np.float32)
    own, others = (np.abs(np.einsum("kf,fij->kij", factors, each)) for each in (here, above))
    oftener, level = np.sign(others - own).mean(axis=0), here.mean(axis=0)
    bright = level >= level.min() + BRIGHT * np.ptp(level)  # in the dark, whole grey values make all noise alike
    if max(abs(oftener.mean()), abs(oftener[bright].mean())) < UNLIKE:
        return sample, rows
    rows[1::2] -= 1
    above[:, ::2] = here[:, ::2]
    return above.reshape(sample.shape), rows
