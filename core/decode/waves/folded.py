"""What phases err alike in every period, seen on smooth surfaces and taken out.

A response that is not known quite, light of two strengths or steps of unequal size displace the coordinate by waves of
the phase: with N steps what is left of a response repeats N, 2 N and 3 N times a period, unequal gains twice and
unequal offsets once. Three steps of one period cannot show it, as any three grey values fit some phase. Neighbours do:
over a window of smooth surface the coordinate is a quadratic polynomial of the pixel, and what it deviates by follows
the phase, the same in all windows. Windows tell how sure that is: a surface that is no polynomial deviates otherwise
in each. Windows are as small as the shortest wave allows: beside it, waves once a period are rarely told. A surface
that keeps step with the fringes to a quarter of a turn over the image, as corrugations may, is taken for a wave; what
drifts more has other phases in other windows, which nothing but a surface makes.

Blur, which dims what a response leaves more than the fringes themselves, differs over the image: what repeats N times a
period may be a wave of another size at every place, a polynomial of that, but of one phase. What windows show of that
phase besides, and not of the one a quarter turn away, which is the surface's, is left for sigma.
"""

from __future__ import annotations

from functools import partial, reduce
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.chosen import middles
from core.decode.tables import Singles
from core.model import Array
from core.numerics import (
    MEDIAN_OF_NORMAL,
    chi_square_limit,
    exponents,
    fisher_limit,
    median_of,
    polynomial,
    row_median,
    spaced,
)
from core.parallel import run_in_bands

CYCLES = 2.0  # of a wave that a window holds at least: of fewer, a polynomial takes too much
SMALLEST, WIDEST, ACROSS = 16, 128, 16  # pixels along a window, and windows along an axis
DOT = 12  # pixels along a window at most where larger ones are nowhere full
THICK, BLURRED = 24, 0.6  # pixels along a window, of more means, in which a wave has so many cycles at most
FEWEST, MANY = 16, 4  # windows, and of them for every number that tells how waves differ over the image
FULL = 0.75  # of a window's pixels have a coordinate
GROSS = 4.0  # sigmas from the polynomial; windows with `FULL` of the others less than this from it are smooth
ROUGH = 3.0  # times the median window's deviations are no smooth surface
ROUNDS = 3  # in which pixels off the polynomial, and rough windows, are left out
CHANCE = 1e-7  # that a wave is found where there is none
SEEN, SHOWN = 0.8, 0.7  # cycles a pixel that neighbours tell; a line, beyond which blur leaves none
LINES_TAKEN = 100  # rows and columns that tell the slope
LEAST = 0.002  # lines: less is not worth it, nor is any window surer of its surface
TURNED = 0.15  # of a wave's squares a quarter turn from the others, beyond which the surface makes it: blur turns none
SURE = 3.0  # standard deviations of what is left of a wave
BY_CHANCE = 1.0  # of such squares by their variances, in the median, twice what noise makes
MOST = 0.02  # of a period: more is the scene in step with the fringes
TINY = 1e-12
PLACES = 512  # of a period
DEGREE, UNEVEN = 4, (6, 15)  # by which waves may differ over the image, quadratically first: the numbers of terms
TURNS = 2 * np.pi * (np.arange(PLACES) + 0.5) / PLACES


class Wave(NamedTuple):
    """A wave of coordinates: so many cycles a period, and its cosine and sine part in lines, (2, 15), each of them a
    polynomial of the place in the image, x and y from -1 to 1, of degree `DEGREE`. Both stay
    within `limits` (2, 2), the least and the most that windows show: beyond these, a polynomial is anything."""

    period: float
    order: int
    parts: Array
    limits: Array

    def at(self, rows: Array, columns: Array) -> Array:
        """Cosine and sine part where rows (h,) and columns (w,) of the image, each from -1 to 1, meet: (2, h, w)."""
        powers = np.zeros((2, DEGREE + 1, DEGREE + 1))
        i, j = np.transpose(exponents(DEGREE))
        powers[:, j, i] = self.parts
        across = powers @ columns ** np.arange(DEGREE + 1)[:, None]
        there = np.einsum("ph,cpw->chw", rows ** np.arange(DEGREE + 1)[:, None], across)
        return np.clip(there, *self.limits[:, :, None, None])

    @property
    def turned(self) -> Wave:
        """The same of the other sign."""
        return self._replace(parts=-self.parts, limits=-self.limits[::-1])


def take_waves_out(u: Singles, periods: list[tuple[float, int]]) -> float:
    """Correct, in place, coordinates, shape (H, W), lines, for waves of the phases of `periods` (lines) in N steps.

    What windows show of them besides is given, as a variance (lines²).
    """
    waves, left = find_waves(u, periods)
    for period in {wave.period for wave in waves}:
        mine = [wave for wave in waves if wave.period == period]
        run_in_bands(partial(subtract, u, mine, period), len(u))
    return left


def subtract(u: Singles, waves: list[Wave], period: float, first: int, last: int) -> None:
    """Take waves of a period out of some rows of coordinates (H, W), in place."""
    place, columns = u[first:last], middles(np.arange(u.shape[1]), u.shape[1])
    with np.errstate(invalid="ignore"):  # of NaN any place, which stays NaN
        at = ((place + np.float32(0.5)) * np.float32(PLACES / period)).astype(np.int32) & (PLACES - 1)
    away = np.zeros(PLACES, np.float32)
    for wave in waves:
        cosine, sine = (f(wave.order * TURNS).astype(np.float32) for f in (np.cos, np.sin))
        if not wave.parts[:, 1:].any():
            away += wave.parts[0, 0] * cosine + wave.parts[1, 0] * sine
            continue
        here = wave.at(middles(np.arange(first, last), len(u)), columns).astype(np.float32)
        place -= here[0] * cosine[at] + here[1] * sine[at]
    place -= away[at]


class Windows(NamedTuple):
    """Windows of smooth surface: normal equations (m, 2 n, 2 n) and right sides (m, 2 n) of the waves, and the terms
    (m, 15) of a polynomial of the place in the image."""

    normal: Array
    right: Array
    terms: Array


Column = tuple[int, int]  # wave, term


def find_waves(u: Singles, periods: list[tuple[float, int]]) -> tuple[list[Wave], float]:
    """Find what smooth surfaces show of waves of the phases of some periods (lines) in N steps, if it is worth it, and
    the variance (lines²) of what they show of them besides."""
    slopes = slopes_of(u)
    steep = float(np.hypot(*slopes))
    if not steep > 0:
        return [], 0.0
    seen = {
        round(order / period, 9): (period, order)
        for period, steps in periods
        for order in (1, 2, steps, 2 * steps, 3 * steps)
        if order / period < SHOWN and order / period * steep < SEEN
    }
    times = max(1, int(BLURRED / max(seen, default=1.0) / steep))
    for most in (min(WIDEST, min(u.shape) // 4, THICK * times), DOT):
        mine = {each: wave for each, wave in seen.items() if most * steep * each >= CYCLES}
        if not mine or most < min(SMALLEST, DOT):
            continue
        waves = list(mine.values())
        side = max(min(SMALLEST, most), int(np.ceil(CYCLES / min(mine) / steep)))
        told = _windows(u, side, slopes, waves)
        if len(told.right) >= FEWEST:
            break
    else:
        return [], 0.0
    found, left = waves_by(told, waves, periods)
    return [wave for _, wave in found], left


def waves_by(
    told: Windows, waves: list[tuple[float, int]], periods: list[tuple[float, int]]
) -> tuple[list[tuple[int, Wave]], float]:
    """Which of the waves, periods and orders, windows are sure of, by number, and the variance of what is left of them.

    Those of N cycles may differ over the image, and where there are such, those of 2 N, which are next.
    """
    columns = _even([(n, 0) for n in range(len(waves))], told)
    columns = [column for column in columns if not _turns(column[0], columns, told)]
    for n, wave in enumerate(waves):
        twice = n > 0 and waves[n - 1] in periods and any(column[0] == n - 1 for column in columns)
        if wave in periods or (twice and wave == (waves[n - 1][0], 2 * waves[n - 1][1])):
            columns = reduce(partial(_uneven, n, told), UNEVEN, columns)
    found = np.array([_in_phase(parts, told.terms) for parts in _parts(columns, told)])
    shown = found @ told.terms.T  # (waves, 2, windows)
    size = np.sqrt(np.mean(np.sum(np.square(shown), axis=1), axis=1))
    limits = np.stack([shown.min(axis=2), shown.max(axis=2)], axis=1)
    likely = [n for n in range(len(waves)) if LEAST < size[n] < MOST * waves[n][0]]
    left = sum(_left(n, shown, told) for n in likely if waves[n] in periods)
    return [(n, Wave(*waves[n], found[n], limits[n])) for n in likely], left


def _even(columns: list[Column], told: Windows) -> list[Column]:
    """Of waves of one size all over the image, those that are sure."""
    limit = chi_square_limit(2, CHANCE)
    while columns:
        parts, covariance = _solve(columns, told)
        own = covariance.reshape(*2 * parts.shape)[range(len(parts)), :, range(len(parts))]
        own = own + np.eye(2) * LEAST**2 / limit  # so that less than `LEAST` is never sure
        sure = np.einsum("ni,nij,nj->n", parts, np.linalg.inv(own), parts)
        least = int(np.argmin(sure))
        if sure[least] > limit:
            break
        columns = columns[:least] + columns[least + 1 :]
    return columns


def _uneven(n: int, told: Windows, columns: list[Column], terms: int) -> list[Column]:
    """The columns, and the first so many terms of one wave if those it does not have yet are surely there."""
    others = [column for column in columns if column[0] != n]
    new = [(n, term) for term in range(terms)]
    many, number = len(told.right), 2 * (terms - max(len(columns) - len(others), 1))
    if many < MANY * 2 * len(others + new):
        return columns
    parts, covariance = _solve(others + new, told)
    limit = number * (many - 1) / (many - number) * fisher_limit(number, many - number, CHANCE)  # Hotelling
    own = covariance[-number:, -number:] + np.eye(number) * LEAST**2 / limit
    more = parts.ravel()[-number:]
    sure = more @ np.linalg.solve(own, more) > limit
    return others + new if sure and not _turns(n, others + new, told) else columns


def _turns(n: int, columns: list[Column], told: Windows) -> bool:
    """Whether a wave has other phases in other windows, as has what a surface itself repeats."""
    sizes = np.einsum("nkt,mt->nkm", _parts(columns, told), told.terms)
    phases = _phases(sizes[n])
    sizes[n] = 0
    seen, strength = _seen(n, phases, sizes, told)
    along, across = np.median(np.square(seen) / np.maximum(strength, TINY), axis=0)
    return bool(across > max(TURNED * along, BY_CHANCE))


def _left(n: int, sizes: Array, told: Windows) -> float:
    """Variance of what windows show of a wave besides its sizes (n, 2, m): what has its phase, less what has none."""
    seen, strength = _seen(n, _phases(sizes[n]), sizes, told)
    along, across = np.square(seen / np.maximum(strength, TINY)).T
    excess = along - across
    mean = float(excess.mean())
    return mean / 2 if mean > SURE * float(excess.std()) / np.sqrt(len(excess)) else 0.0


def _phases(sizes: Array) -> Array:
    """A wave's own phase, by its sizes (2, m), and what is a quarter turn from it, as columns."""
    return np.asarray(np.linalg.svd(sizes, full_matrices=False)[0])


def _seen(n: int, phases: Array, sizes: Array, told: Windows) -> tuple[Array, Array]:
    """Right sides and normal equations' diagonals (m, 2) of a wave's two phases, beside waves of such sizes."""
    mine = slice(2 * n, 2 * n + 2)
    left = told.right[:, mine] - np.einsum("mij,jm->mi", told.normal[:, mine], sizes.reshape(-1, len(told.right)))
    return left @ phases, np.einsum("ik,mij,jk->mk", phases, told.normal[:, mine, mine], phases)


def _parts(columns: list[Column], told: Windows) -> Array:
    """Cosine and sine parts of all waves by all windows together, shape (n, 2, 15)."""
    parts = np.zeros((told.right.shape[1] // 2, 2, told.terms.shape[1]))
    for (n, term), part in zip(columns, _solve(columns, told)[0], strict=True):
        parts[n, :, term] = part
    return parts


def _in_phase(parts: Array, terms: Array) -> Array:
    """Parts (2, 15) of a wave as one phase has them everywhere."""
    main = np.linalg.svd(parts @ terms.T, full_matrices=False)[0][:, 0]
    return np.outer(main, main) @ parts


def _solve(columns: list[Column], told: Windows) -> tuple[Array, Array]:
    """Cosine and sine parts (columns, 2) by all windows together, and their covariance by how windows differ."""
    shape = np.zeros((*told.right.shape, 2 * len(columns)))
    for k, (n, term) in enumerate(columns):
        shape[:, 2 * n, 2 * k] = shape[:, 2 * n + 1, 2 * k + 1] = told.terms[:, term]
    turned = shape.transpose(0, 2, 1)
    normal, right = turned @ told.normal @ shape, (turned @ told.right[..., None])[..., 0]
    total, many = normal.sum(axis=0), len(right)
    inverse = np.linalg.inv(total + np.eye(len(total)))  # an even surface, and two pixels a wave, tell no wave: none
    solution = inverse @ right.sum(axis=0)
    score = right - normal @ solution
    covariance = inverse @ (score.T @ score) @ inverse * many / max(many - len(total), 1)
    return solution.reshape(-1, 2), covariance


def slopes_of(u: Singles) -> tuple[float, float]:
    """Medians of the gradient's parts along columns and rows, lines a pixel."""
    rows, columns = (slice(None, None, max(1, size // LINES_TAKEN)) for size in u.shape)
    changes = u[4:, columns] - u[:-4, columns], u[rows, 4:] - u[rows, :-4]
    return median_of(np.abs(changes[0])) / 4, median_of(np.abs(changes[1])) / 4


def _thinned(u: Singles, times: int) -> Singles:
    """Means of so many pixels along each axis; NaN where any is."""
    height, width = (size // times * times for size in u.shape)
    parts = [u[i:height:times, j:width:times] for i in range(times) for j in range(times)]
    return np.asarray(sum(parts[1:], parts[0]) / np.float32(times * times), np.float32)


def _windows(u: Singles, side: int, slopes: tuple[float, float], waves: list[tuple[float, int]]) -> Windows:
    """What windows tell of the waves, beside a polynomial of the surface."""
    times = -(-side // THICK)
    u, side = _thinned(u, times), side // times
    firsts = _fullest(u, side)
    rows, columns = (first[:, None] + np.arange(side) for first in firsts)
    place = u[rows[:, :, None], columns[:, None]].reshape(-1, side**2).astype(float)
    y, x = (2 * (first + side / 2) / size - 1 for first, size in zip(firsts, u.shape, strict=True))
    where = polynomial(x, y, DEGREE)
    y, x = (each.ravel() for each in np.meshgrid(*2 * [np.linspace(-1, 1, side)], indexing="ij"))
    terms = polynomial(x, y, 2)
    products = (terms[:, :, None] * terms[:, None]).reshape(len(terms), -1)
    weight = np.isfinite(place).astype(float)
    for _ in range(ROUNDS):
        whole = np.nan_to_num(place)
        fitted = np.linalg.solve(_squares(weight, products), ((weight * whole) @ terms)[..., None])[..., 0] @ terms.T
        away = np.abs(place - fitted)
        scale = np.maximum(row_median(away) / MEDIAN_OF_NORMAL, LEAST)
        weight = (away < GROSS * scale[:, None]).astype(float)
        smooth = (weight.mean(axis=1) >= FULL) & (scale < ROUGH * median_of(scale))
        place, fitted, weight, scale, where = (each[smooth] for each in (place, fitted, weight, scale, where))
    place, weight = np.nan_to_num(place), weight / np.square(scale)[:, None]
    turns = (2 * np.pi * (place + 0.5)).astype(np.float32)
    turned = np.array([k / p * np.array(slopes) for p, k in waves])  # from pixel to pixel
    dimmed = np.prod(np.sinc(times * turned) / np.sinc(turned), axis=1)  # in the means of pixels
    shapes = np.empty((len(turns), 2 * len(waves), turns.shape[1]), np.float32)  # as sums of so many need no doubles
    for n, (d, (p, k)) in enumerate(zip(dimmed, waves, strict=True)):
        np.cos(np.float32(k / p) * turns, out=shapes[:, 2 * n])
        np.sin(np.float32(k / p) * turns, out=shapes[:, 2 * n + 1])
        shapes[:, 2 * n : 2 * n + 2] *= np.float32(d)
    single, slim = terms.astype(np.float32), weight.astype(np.float32)[:, None]
    shared = (shapes * slim) @ single
    explained = np.linalg.solve(_squares(weight, products), shared.transpose(0, 2, 1).astype(float)).astype(np.float32)
    left = (shapes - (single @ explained).transpose(0, 2, 1)) * slim
    away = (place - fitted).astype(np.float32)[..., None]
    return Windows((left @ shapes.transpose(0, 2, 1)).astype(float), (left @ away)[..., 0].astype(float), where)


def _fullest(u: Singles, side: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First rows and columns of windows that hold coordinates enough, the most of those that begin in a square."""
    known = np.isfinite(u).astype(np.float32)
    held = cv2.boxFilter(known, -1, (side, side), anchor=(0, 0), borderType=cv2.BORDER_CONSTANT)
    held = held[: len(u) - side + 1, : u.shape[1] - side + 1]
    high, wide = (size // side for size in held.shape)
    squares = held[: high * side, : wide * side].reshape(high, side, wide, side).transpose(0, 2, 1, 3)
    squares = squares.reshape(high, wide, side * side)[np.ix_(*(spaced(number, ACROSS) for number in (high, wide)))]
    best, full = squares.argmax(axis=2), squares.max(axis=2) >= FULL
    down, across = np.divmod(best[full], side)
    row, column = (spaced(number, ACROSS)[at] for number, at in zip((high, wide), np.nonzero(full), strict=True))
    return row * side + down, column * side + across


def _squares(weight: Array, products: Array) -> Array:
    """``A' W A`` of every window, from the products of the terms of each pixel."""
    return np.asarray((weight @ products).reshape(-1, 6, 6))
