"""What phases err alike in every period, seen on smooth surfaces and taken out.

A response that is not known quite, light of two strengths or steps of unequal size displace the coordinate by waves of
the phase: with N steps what is left of a response repeats N, 2 N and 3 N times a period, unequal gains twice and
unequal offsets once. Three steps of one period cannot show it, as any three grey values fit some phase. Neighbours do:
over a window of smooth surface the coordinate is a quadratic polynomial of the pixel, and what it deviates by follows
the phase, the same in all windows. Windows tell how sure that is: a surface that is no polynomial deviates otherwise
in each. Windows are as small as the shortest wave allows: beside it, waves once a period are rarely told. A surface
that keeps step with the fringes to less than a turn over the image, as corrugations may, is taken for a wave.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from core.decode.tables import Singles
from core.model import Array
from core.numerics import MEDIAN_OF_NORMAL, chi_square_limit, median_of, quadratic, row_median
from core.parallel import run_in_bands

CYCLES = 2.0  # of a wave that a window holds at least: of fewer, a polynomial takes too much
SMALLEST, WIDEST, ACROSS = 16, 128, 12  # pixels along a window, and windows along an axis
THICK, BLURRED = 24, 0.6  # pixels along a window, of more means, in which a wave has so many cycles at most
FEWEST = 16  # windows
FULL = 0.75  # of a window's pixels have a coordinate
GROSS = 4.0  # sigmas from the polynomial; windows with `FULL` of the others less than this from it are smooth
ROUGH = 3.0  # times the median window's deviations are no smooth surface
ROUNDS = 3  # in which pixels off the polynomial, and rough windows, are left out
CHANCE = 1e-7  # that a wave is found where there is none
SEEN, SHOWN = 0.8, 0.7  # cycles a pixel that neighbours tell; a line, beyond which blur leaves none
LINES_TAKEN = 100  # rows and columns that tell the slope
LEAST = 0.002  # lines: less is not worth it, nor is any window surer of its surface
MOST = 0.02  # of a period: more is the scene in step with the fringes
PLACES = 512  # of a period
TURNS = 2 * np.pi * (np.arange(PLACES) + 0.5) / PLACES


class Wave(NamedTuple):
    """A wave of coordinates: so many cycles a period, its cosine and sine part in lines."""

    period: float
    order: int
    cosine: float
    sine: float


def take_waves_out(u: Singles, periods: list[tuple[float, int]]) -> None:
    """Correct, in place, coordinates, shape (H, W), lines, for waves of the phases of `periods` (lines) in N steps."""
    waves = find_waves(u, periods)
    for period in {wave.period for wave in waves}:
        mine = [wave for wave in waves if wave.period == period]
        away = sum(w.cosine * np.cos(w.order * TURNS) + w.sine * np.sin(w.order * TURNS) for w in mine)
        run_in_bands(partial(_subtract, u, np.asarray(away, np.float32), period), len(u))


def _subtract(u: Singles, away: Singles, period: float, first: int, last: int) -> None:
    place = u[first:last]
    with np.errstate(invalid="ignore"):  # of NaN any place, which stays NaN
        at = ((place + np.float32(0.5)) * np.float32(PLACES / period)).astype(np.int32) & (PLACES - 1)
    place -= away[at]


def find_waves(u: Singles, periods: list[tuple[float, int]]) -> list[Wave]:
    """Find what smooth surfaces show of waves of the phases of some periods (lines) in N steps, if it is worth it."""
    slopes = _slopes(u)
    steep = float(np.hypot(*slopes))
    if not steep > 0:
        return []
    seen = {
        round(order / period, 9): (period, order)
        for period, steps in periods
        for order in (1, 2, steps, 2 * steps, 3 * steps)
        if order / period < SHOWN and order / period * steep < SEEN
    }
    times = max(1, int(BLURRED / max(seen, default=1.0) / steep))
    most = min(WIDEST, min(u.shape) // 4, THICK * times)
    seen = {each: wave for each, wave in seen.items() if most * steep * each >= CYCLES}
    if not seen or most < SMALLEST:
        return []
    waves = list(seen.values())
    normal, right = _windows(u, max(SMALLEST, int(np.ceil(CYCLES / min(seen) / steep))), slopes, waves)
    limit = chi_square_limit(2, CHANCE)
    while waves and len(right) >= FEWEST:
        parts, covariance = _solve(normal, right)
        covariance += np.eye(2) * LEAST**2 / limit  # so that less than `LEAST` is never sure
        sure = np.einsum("ni,nij,nj->n", parts, np.linalg.inv(covariance), parts)
        least = int(np.argmin(sure))
        if sure[least] > limit:
            found = [Wave(p, k, c, s) for (p, k), (c, s) in zip(waves, parts.tolist(), strict=True)]
            return [w for w in found if LEAST < np.hypot(w.cosine, w.sine) < MOST * w.period]
        del waves[least]
        kept = np.delete(np.arange(2 * len(parts)), [2 * least, 2 * least + 1])
        normal, right = normal[:, kept][:, :, kept], right[:, kept]
    return []


def _solve(normal: Array, right: Array) -> tuple[Array, Array]:
    """Cosine and sine parts (n, 2) by all windows together, and their covariances (n, 2, 2) by how windows differ."""
    total = normal.sum(axis=0)
    inverse = np.linalg.inv(total + np.eye(len(total)))  # an even surface, and two pixels a wave, tell no wave: none
    solution, n = inverse @ right.sum(axis=0), right.shape[1] // 2
    score = right - normal @ solution
    covariance = inverse @ (score.T @ score) @ inverse * len(score) / (len(score) - 1)
    return solution.reshape(n, 2), covariance.reshape(n, 2, n, 2)[range(n), :, range(n)]


def _slopes(u: Singles) -> tuple[float, float]:
    """Medians of the gradient's parts along columns and rows, lines a pixel."""
    rows, columns = (slice(None, None, max(1, size // LINES_TAKEN)) for size in u.shape)
    changes = u[4:, columns] - u[:-4, columns], u[rows, 4:] - u[rows, :-4]
    return median_of(np.abs(changes[0])) / 4, median_of(np.abs(changes[1])) / 4


def _thinned(u: Singles, times: int) -> Singles:
    """Means of so many pixels along each axis; NaN where any is."""
    height, width = (size // times * times for size in u.shape)
    parts = [u[i:height:times, j:width:times] for i in range(times) for j in range(times)]
    return np.asarray(sum(parts[1:], parts[0]) / np.float32(times * times), np.float32)


def _windows(u: Singles, side: int, slopes: tuple[float, float], waves: list[tuple[float, int]]) -> tuple[Array, Array]:
    """Normal equations (windows, 2 n, 2 n) and right sides (windows, 2 n) of the waves, beside a polynomial."""
    times = -(-side // THICK)
    u, side = _thinned(u, times), side // times
    offsets = np.arange(side)
    firsts = [np.linspace(0, size - side, min(ACROSS, size // side)).astype(int) for size in u.shape]
    rows, columns = firsts[0][:, None, None, None] + offsets[:, None], firsts[1][:, None, None] + offsets
    place = u[rows, columns].reshape(-1, side**2).astype(float)
    place = place[np.isfinite(place).mean(axis=1) >= FULL]
    y, x = (each.ravel() for each in np.meshgrid(*2 * [np.linspace(-1, 1, side)], indexing="ij"))
    terms = quadratic(x, y)
    products = (terms[:, :, None] * terms[:, None]).reshape(len(terms), -1)
    weight = np.isfinite(place).astype(float)
    for _ in range(ROUNDS):
        whole = np.nan_to_num(place)
        fitted = np.linalg.solve(_squares(weight, products), ((weight * whole) @ terms)[..., None])[..., 0] @ terms.T
        away = np.abs(place - fitted)
        scale = np.maximum(row_median(away) / MEDIAN_OF_NORMAL, LEAST)
        weight = (away < GROSS * scale[:, None]).astype(float)
        smooth = (weight.mean(axis=1) >= FULL) & (scale < ROUGH * median_of(scale))
        place, fitted, weight, scale = place[smooth], fitted[smooth], weight[smooth], scale[smooth]
    place, weight = np.nan_to_num(place), weight / np.square(scale)[:, None]
    turns = 2 * np.pi * (place + 0.5)
    dimmed = [np.prod(np.sinc(times * k / p * np.array(slopes))) for p, k in waves]  # in the means of pixels
    parts = [d * f(k / p * turns) for d, (p, k) in zip(dimmed, waves, strict=True) for f in (np.cos, np.sin)]
    shapes = np.stack(parts, axis=1)  # (windows, 2 n, pixels)
    shared = (shapes * weight[:, None]) @ terms
    explained = np.linalg.solve(_squares(weight, products), shared.transpose(0, 2, 1))
    left = (shapes - (terms @ explained).transpose(0, 2, 1)) * weight[:, None]
    return left @ shapes.transpose(0, 2, 1), (left @ (place - fitted)[..., None])[..., 0]


def _squares(weight: Array, products: Array) -> Array:
    """``A' W A`` of every window, from the products of the terms of each pixel."""
    return np.asarray((weight @ products).reshape(-1, 6, 6))
