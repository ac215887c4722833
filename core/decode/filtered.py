"""Whether frames were smoothed or sharpened after they were exposed, told by how noise differs between neighbours.

A sensor's noise is as strong in fine ripples as in coarse ones. Filters against noise, a camera's own among them, and
enlarging take the fine ones out, sharpening raises them. The interpolation of a colour camera's mosaic takes out less.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.decode.frames import Image
from core.decode.tables import Array, Singles
from core.decode.waves.response import Wave
from core.model import Note
from core.numerics import median_of, quantiles, quantum

TILE, ACROSS = 32, 5  # pixels a side of the squares that are looked at, and their number along each axis
FEWEST = 9  # of them that tell anything
MOST = 2  # contrasts of frames that are looked at
WHOLE, ABOVE = 0.98, 0.5  # of a square's pixels that are not saturated, and above 0: noise cut off there stays white
COARSE, FINE, FINEST = (0.06, 0.13), (0.2, 0.3), (0.3, 0.5)  # cycles a pixel; coarser ones may be lamps and stripes
WAYS = 6  # directions in which ripples run: edges and harmonics of fringes do not lie in all
TILES = 0.3  # quantile of the squares: an object's edges are in others
# of the power, with the harmonics of fringes and without them: unfiltered 0.8 to 1.3, interpolated mosaics 0.43 to 0.7;
# a Gaussian of 1 px 0.1 to 0.25 and up to 0.33. Without them 105 sound scenes that seem smoothed have more than 0.52
LEFT = 0.3, 0.45
SEEN = 3.0  # times what rounding of grey values makes
EDGES = 1.3  # times as much coarse power where the image is steep: noise 0.95 to 1.1; a camera that shakes 1.5 to 2.9
RAISED = 1.7  # times as much; unfiltered up to 1.3, an unsharp mask by half 1.5 to 1.8, by all 2.1 to 3
HARMONICS = 6  # of fringes, that are none of the noise
SMOOTHED = Note(
    "The frames were smoothed after exposure: neighbouring pixels share noise that a sensor makes in each alone. A "
    "filter against noise, the camera's own noise reduction, or enlarging does this; coordinates shift at edges, and "
    "sigma does not hold what neighbours share. Switch it off, and record frames as they are.",
    "mistake",
)
SHARPENED = Note(
    "The frames were sharpened after exposure: noise is stronger between neighbouring pixels than over several, where "
    "a sensor's is alike. Edges of dots and stripes then overshoot, and what is read there shifts. Switch sharpening "
    "off, and record frames as they are.",
    "mistake",
)


def filtered(images: Sequence[Image], contrasts: Array, waves: Sequence[Wave], saturation: float) -> Note | None:
    """Look at combinations (k, frames) of frames that show noise only, besides harmonics of the waves, in squares."""
    seen = _ripples(images, contrasts[:MOST], (), saturation)
    if seen.least < LEFT[0] and seen.at_edges < EDGES:
        return SMOOTHED if _ripples(images, contrasts[:MOST], waves, saturation).least < LEFT[1] else None
    return SHARPENED if seen.finest > RAISED else None


class Ripples(NamedTuple):
    """Power of finer ripples over that of coarse ones; 1 where nothing tells it."""

    least: float  # of fine ones, by the least direction of coarse ones
    finest: float  # of the finest, by coarse ones in all directions
    at_edges: float  # of coarse ones where the image is steep, over that anywhere


def _ripples(images: Sequence[Image], contrasts: Array, waves: Sequence[Wave], saturation: float) -> Ripples:
    shape = images[0].shape
    if not len(contrasts) or min(shape) < TILE:
        return Ripples(1.0, 1.0, 1.0)
    if not waves:  # which other frames show as well
        used = np.flatnonzero(np.abs(contrasts).max(axis=0) > 0).tolist()
        images, contrasts = [images[n] for n in used], contrasts[:, used]
    few, window = contrasts.astype(np.float32), np.hanning(TILE + 2)[1:-1].astype(np.float32)
    squares, residuals, step = [], [], 1.0
    for top, left in product(*(np.linspace(0, size - TILE, ACROSS).astype(int).tolist() for size in shape)):
        grey = np.stack([image[top : top + TILE, left : left + TILE] for image in images])
        if np.mean(grey.max(axis=0) < saturation) < WHOLE or np.mean(grey.min(axis=0) > 0) < ABOVE:
            continue
        step = max(step, quantum(grey)) if images[0].itemsize > 1 else step
        residuals.append(_residual(grey.reshape(len(grey), -1).astype(np.float32), few, waves))
        squares.append(grey)
    if len(residuals) < FEWEST:
        return Ripples(1.0, 1.0, 1.0)
    seen = np.reshape(residuals, (len(residuals), -1, TILE, TILE)) * (window[:, None] * window)
    spectra = np.fft.rfft2(seen)
    powers = np.square(np.abs(spectra))
    usual = quantiles(powers, TILES)[0] / (np.log(1 / (1 - TILES)) * np.square(np.square(window).sum()))
    down, across = np.meshgrid(np.fft.fftfreq(TILE), np.fft.rfftfreq(TILE), indexing="ij")
    ripple, way = np.hypot(down, across), np.arctan2(down, across) % np.pi // (np.pi / WAYS)
    coarse, fine, finest = ((ripple >= low) & (ripple < high) for low, high in (COARSE, FINE, FINEST))
    least = min([_usual(usual, coarse & (way == k)) for k in range(WAYS)])
    if least <= SEEN * step * step / 12:
        return Ripples(1.0, 1.0, 1.0)
    found, at_edges = _usual(usual, fine) / least, 1.0
    if found < LEFT[0]:
        at_edges = _at_edges(np.fft.irfft2(spectra * (ripple < COARSE[1])), np.stack(squares).mean(axis=1), window)
    return Ripples(found, _usual(usual, finest) / _usual(usual, coarse), at_edges)


def _at_edges(coarse: Array, image: Array, window: Singles) -> float:
    """Power of coarse ripples (squares, k, y, x), in a window, where an image (squares, y, x) is steep, by all."""
    power, weight = np.square(coarse), np.square(window[:, None] * window)
    steep = np.square(np.gradient(image, axis=(1, 2))).sum(axis=0)
    there = np.einsum("skyx,syx->sk", power, steep) / power.sum(axis=(2, 3))
    return median_of(there * weight.sum() / (steep * weight).sum(axis=(1, 2))[:, None])


def _residual(grey: Singles, contrasts: Singles, waves: Sequence[Wave]) -> Singles:
    """Combinations (k, n) of grey values (frames, n) less their mean and the part that harmonics explain."""
    residual = contrasts @ grey
    if not waves:
        return np.asarray(residual - residual.mean(axis=1, keepdims=True))
    design: list[Array] = [np.ones((1, grey.shape[1]))]
    for wave in waves:
        seen = wave.seen(grey)
        size = np.maximum(np.abs(seen), np.float32(1e-6))
        turns = size * (seen / size) ** np.arange(HARMONICS + 1)[:, None]
        design += [turns.real, turns.imag[1:]]
    explained = np.concatenate(design).astype(np.float32)
    normal = np.einsum("in,jn->ij", explained, explained).astype(float)
    normal += 1e-6 * np.diag(normal.diagonal() + 1e-6)
    parts = np.linalg.solve(normal, np.einsum("in,kn->ik", explained, residual))
    return np.asarray(residual - np.einsum("ik,in->kn", parts.astype(np.float32), explained), np.float32)


def _usual(power: Array, at: NDArray[np.bool_]) -> float:
    return median_of(power[:, at])
