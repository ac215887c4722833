"""Projector coordinates of a target: the phase maps read at the image of its centre."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.compiling import njit
from core.measure.centres.kernels import inverted
from core.measure.centres.rays import Rays
from core.model import Array, Floats
from core.numerics import four_pixels, row_median
from core.parallel import run_in_bands

TERMS, BENT = 6, 3  # of a quadratic surface: all, and those by which it bends
FEWEST = 5  # pixels of a dot's quarter
ENOUGH, MOST_SHARE = 3.0, 0.5  # targets for each term of the least; share that one has in itself
FOUND = 6  # figures of a fitted surface, see `_fit_surfaces`
MOST_TWIST = 9.0  # times its expectation that the square of one counts at most
BY_CHANCE = 0.1  # part by which sound captures' twists are smaller than expected
INTERIOR, RING = 0.85, 0.8  # radii of a dot: inside are its own pixels; width of the ring around that is like it
JUMP_LINES = 0.5  # a value this far (and six sigma) off the rest of the dot is a decoding error, not a measurement


def bilinear(values: Floats, sigma: Floats, uv: Array) -> tuple[Array, Array]:
    """Interpolate a map at points (n, 2) px between its four pixels: values and sigmas (n,), NaN unless all are valid.

    The four errors are independent, so that ``sigma² = sum(weight² sigma_i²)``: smaller than a pixel's own. In a smooth
    map both diagonals have the same sum; where they differ by more than noise, one of the four is a decoding error.
    """
    rows, columns, weight = four_pixels(values.shape, uv)
    value, error = values[rows, columns].astype(np.float64), sigma[rows, columns].astype(np.float64)
    total, variance = (weight * value).sum(axis=0), ((weight * error) ** 2).sum(axis=0)
    twist, spread = value[0] - value[1] - value[2] + value[3], (error**2).sum(axis=0)
    with np.errstate(invalid="ignore"):
        total[np.abs(twist) > JUMP_LINES + 6 * np.sqrt(spread)] = np.nan
    return total, np.sqrt(variance)


def middle_of_surface(
    values: Floats, sigma: Floats, uv: Array, ellipse: Array, inner: Array, outer: Array, bend: Array | None = None
) -> tuple[Array, Array]:
    """Value and sigma (n,) at dots' middles of a surface through the valid pixels between two radii in the unit disc.

    A weighted robust fit of a quadratic surface: inside a dot it has two to four times the precision of the four pixels
    around the middle. How the surface bends, by perspective across the dot, is found with it, or known: `bend` (n, 4)
    of `bends`, NaN where it is not. Then the middle is twice as precise once more.

    Errors of decoding that depend on the place in the pattern are common to neighbours along its lines, and cancel in
    part across them. Blocks of four pixels then twist less than the residuals let expect; by that part, a row of n
    pixels counts as the root of n.
    """
    found = np.zeros((len(uv), FOUND))
    bend = np.full((len(uv), 4), np.nan) if bend is None else np.ascontiguousarray(bend)

    def band(a: int, b: int) -> None:
        _fit_surfaces(values, sigma, uv[a:b], ellipse[a:b], inner[a:b], outer[a:b], bend[a:b], found[a:b])

    run_in_bands(band, len(uv), least=32)
    value, variance, misfit, redundancy, *_, blocks = found.T
    squares, of, twists, number = found[np.isfinite(value) & (blocks > 0), 2:].sum(axis=0)
    common = 1 - (twists / number) / (squares / of) if squares * number > 0 else 0.0
    common = max(common - BY_CHANCE, 0) / (1 - BY_CHANCE)
    free = np.where(np.isnan(bend[:, 0]), TERMS, TERMS - BENT)
    row = (redundancy + free) / (2 * outer * np.sqrt(np.abs(np.linalg.det(ellipse))))  # px
    widened = 1 + common * np.maximum(np.sqrt(row) - 1, 0)
    misfit = np.maximum(misfit / np.maximum(redundancy, 1), 1)  # of blur beside other prints
    area = (inner**2 + outer**2) / 4 * np.abs(np.linalg.det(ellipse))  # mean square of places along an axis, px²
    return value, np.sqrt(variance * misfit * widened + (np.nan_to_num(bend[:, 3]) * area / 2) ** 2)


@njit(cache=True, nogil=True, error_model="numpy")
def _fit_surfaces(
    values: Floats, sigma: Floats, uv: Array, ellipse: Array, inner: Array, outer: Array, bend: Array, found: Array
) -> None:  # pragma: no cover  compiled
    """Set `found`: value, its variance; weighted squares of residuals, redundancy; squares of twists, their number."""
    b, surface = np.empty(TERMS), np.empty(TERMS)
    for k in range(len(uv)):
        known = not np.isnan(bend[k, 0])
        terms = TERMS - BENT if known else TERMS
        N = np.empty((terms, terms))
        p, q, r, s = ellipse[k, 0, 0], ellipse[k, 0, 1], ellipse[k, 1, 0], ellipse[k, 1, 1]
        du, dv = outer[k] * np.hypot(p, q) + 1, outer[k] * np.hypot(r, s) + 1
        found[k, :2] = np.nan
        if not (np.isfinite(uv[k, 0] + du) and np.isfinite(uv[k, 1] + dv)):
            continue
        left, right = max(int(uv[k, 0] - du), 0), min(int(uv[k, 0] + du) + 1, values.shape[1] - 1)
        top, bottom = max(int(uv[k, 1] - dv), 0), min(int(uv[k, 1] + dv) + 1, values.shape[0] - 1)
        across = max(right - left + 1, 0)
        room, n = across * max(bottom - top + 1, 0), 0
        A, y, weight, off = np.empty((room, TERMS)), np.empty(room), np.empty(room), np.empty(room)
        number = np.full(room, -1)  # of a pixel, among those that count
        for v in range(top, bottom + 1):
            for u in range(left, right + 1):
                du, dv = u - uv[k, 0], v - uv[k, 1]
                x, z = (s * du - q * dv) / (p * s - q * r), (p * dv - r * du) / (p * s - q * r)
                square = x * x + z * z  # in the unit disc the terms are of one size
                if inner[k] ** 2 <= square <= outer[k] ** 2 and np.isfinite(values[v, u]) and sigma[v, u] > 0:
                    A[n, 0], A[n, 1], A[n, 2], A[n, 3], A[n, 4], A[n, 5] = 1.0, x, z, x * x, x * z, z * z
                    y[n], weight[n] = values[v, u], 1 / np.float64(sigma[v, u]) ** 2
                    if known:
                        y[n] -= bend[k, 0] * du * du / 2 + bend[k, 1] * du * dv + bend[k, 2] * dv * dv / 2
                    number[(v - top) * across + u - left] = n
                    n += 1
        found[k, 4], found[k, 5] = _twists(y, weight, number, across)
        for _ in range(3):
            N[:], b[:], quadrants = 0.0, 0.0, np.zeros(4)
            for i in range(n):
                quadrants[2 * (A[i, 1] > 0) + (A[i, 2] > 0)] += 1
                for j in range(terms):
                    weighted = A[i, j] * weight[i]
                    b[j] += weighted * y[i]
                    for m in range(j + 1):
                        N[j, m] += weighted * A[i, m]
            for j in range(terms):
                for m in range(j):
                    N[m, j] = N[j, m]
            # never a value that only one side vouches for
            if quadrants.min() < FEWEST or not inverted(N):
                found[k, :2] = np.nan
                break
            surface[:], misfit = 0.0, 0.0
            for j in range(terms):
                for m in range(terms):
                    surface[j] += N[j, m] * b[m]
            for i in range(n):
                rest = y[i]
                for j in range(terms):
                    rest -= A[i, j] * surface[j]
                off[i] = abs(rest)
                misfit += off[i] ** 2 * weight[i]
            found[k, 0], found[k, 1], found[k, 2], found[k, 3] = surface[0], N[0, 0], misfit, n - terms
            limit, kept = max(3.0 * np.median(off[:n]), 0.05), 0
            for i in range(n):
                if off[i] < 5 / np.sqrt(weight[i]) + limit:
                    A[kept], y[kept], weight[kept] = A[i], y[i], weight[i]
                    kept += 1
            if kept == n:
                break
            n = kept


@njit(cache=True, nogil=True, error_model="numpy")
def _twists(y: Array, weight: Array, number: NDArray[np.int64], across: int) -> tuple[float, int]:  # pragma: no cover
    """Sum of the squared twists of blocks of four pixels, over what independent errors let expect, and their number.

    `number` tells where in `y` and `weight` every pixel of a rectangle, `across` wide, is; -1 where it does not count.
    """
    total, blocks = 0.0, 0
    for at in range(len(number) - across - 1):
        a, c, d, e = number[at], number[at + 1], number[at + across], number[at + across + 1]
        if (at + 1) % across and min(a, c, d, e) >= 0:
            expected = 1 / weight[a] + 1 / weight[c] + 1 / weight[d] + 1 / weight[e]
            total += min((y[a] - y[c] - y[d] + y[e]) ** 2 / expected, MOST_TWIST)
            blocks += 1
    return total, blocks


def refuse_jumps(values: Floats, uv: Array, ellipse: Array, found: Array, sigma: Array) -> NDArray[np.bool_]:
    """Which values (n,) disagree with the rest of their dot by a decoding error.

    Pairs of points opposite each other average to the value in the middle, whatever the slope; their median is immune
    to a few wrong pixels. Where fewer than three pairs are valid nothing is refused.
    """
    around = Rays(uv, ellipse).sample(values, np.array([0.3, 0.55]))
    half = around.shape[1] // 2
    pairs = ((around[:, :half] + around[:, half:]) / 2).reshape(len(uv), half * around.shape[2])
    enough = np.isfinite(pairs).sum(axis=1) >= 3
    with np.errstate(invalid="ignore"):
        return np.asarray(enough & (np.abs(found - row_median(pairs)) > JUMP_LINES + 6 * sigma))


def decoded_inside(values: Floats, uv: Array, ellipse: Array) -> NDArray[np.bool_]:
    """Whether most of a dot's interior (n,) is decoded: an invalid pixel in its middle is then an exception."""
    inside = Rays(uv, ellipse).sample(values, np.array([0.0, 0.3, 0.6]))
    return np.asarray(np.mean(np.isfinite(inside), axis=(1, 2)) > 0.5)
