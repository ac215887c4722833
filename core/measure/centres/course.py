"""How a projector's coordinate runs over the image of a board: smoothly, so that all targets tell it together.

A projection of a plane, and a polynomial for all that it is not, lenses and a board that is bent.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Array
from core.numerics import (
    MEDIAN_OF_NORMAL,
    exponents,
    median_of,
    nearest,
    normal_equations,
    polynomial,
    row_median,
)

DEFECT, EVEN = 1e-9, 1.2  # of the equations; of the squared noise, within which a board is as smooth as that
DEGREES = 4, 5, 6  # of polynomials that may tell how a coordinate bends
ENOUGH, MOST_SHARE = 3.0, 0.5  # targets for each term of the first; share that one has in itself
FURTHER = 0.3  # of what the highest degree's terms add to a bend: what further ones would, by cameras of 86 degrees
NEIGHBOURS, ALIKE = 12, 6.0  # times the usual distance from planes through them beyond which a target may be wrong
SETTLED = 0.1  # change of a target's weight that alters a fit by less than its noise
NEAR = 4.0  # times the usual distance from a course of fewer terms
SLANTED, LEAST = (0.5, 0.05), 1e-9  # by which a denominator may change over half a board; lines that are nothing
LEAST_BELOW = 0.1  # of a projection's denominator, 1 in the middle, on a board that is seen from the front
BY_NOISE = 2.0  # sigmas by which two bends may differ


@dataclass(frozen=True)
class Course:
    """A coordinate of the projector, fitted over the image of a board."""

    degree: int
    middle: Array  # (2,) px
    size: float  # px
    terms: Array  # (p,): of the polynomial, and two of the denominator
    root: Array  # (p, p): upper triangle R of the normal equations R'R
    share: Array  # (n,): share that each target has in itself, 1 where it is astray: wrong, or of more shape than that
    scatter: float  # lines: of a target, robust

    def derivatives(self, uv: Array) -> Array:
        """Derivatives of the coordinate at places (n, 2) by all terms (n, p), and the coordinate as the last column."""
        at = (uv - self.middle) / self.size
        poly, below = polynomial(at[:, 0], at[:, 1], self.degree), 1 + at @ self.terms[-2:]
        value = poly @ self.terms[:-2] / below
        return np.concatenate([poly, -at * value[:, None], value[:, None] * below[:, None]], axis=1) / below[:, None]

    def values(self, uv: Array) -> Array:
        """Coordinates (n,) at places (n, 2), px."""
        at = (uv - self.middle) / self.size
        poly = polynomial(at[:, 0], at[:, 1], self.degree) @ self.terms[:-2]
        return np.asarray(poly / (1 + at @ self.terms[-2:]))

    def slopes(self, uv: Array) -> Array:
        """Lines per px along the camera's u and v, (n, 2)."""
        return np.stack([(self.values(uv + step) - self.values(uv - step)) / 2 for step in np.eye(2)], axis=1)


def enough(number: int, degree: int) -> bool:
    """Whether so many targets tell a course of some degree."""
    return number >= ENOUGH * (len(exponents(degree)) + 2)


def planes(uv: Array, lines: Array, known: NDArray[np.bool_]) -> Array:
    """Value and slopes (n, 3) of robust planes, about every target, through those around that have any lines (n,)."""
    at = np.flatnonzero(known)
    near = at[nearest(uv[at], min(NEIGHBOURS, len(at)), of=uv)]
    offset = uv[near] - uv[:, None]
    A = np.concatenate([np.ones((*near.shape, 1)), offset], axis=2)
    weight = np.ones(near.shape)
    for _ in range(6):  # a coordinate decoded wrongly is far off
        N, b = normal_equations(A, weight, lines[near][..., None])
        scale = np.einsum("nii->n", N)[:, None, None] * 1e-12
        plane = np.linalg.solve(N + scale * np.eye(3), b)
        off = np.abs((A @ plane)[..., 0] - lines[near])
        weight = 1 / (1 + (off / np.maximum(2 * row_median(off)[:, None], 0.2)) ** 2)
    return np.asarray(plane[..., 0])


def courses(
    uv: Array, lines: Array, known: NDArray[np.bool_], degrees: Sequence[int], noise: float = 0.0
) -> list[Course]:
    """Fit courses of rising degrees to coordinates (n,) of usual `noise` at places (n, 2).

    Each begins with the targets that the one before has near; the first with those that are not far off planes through
    the targets around. So one in ten may be decoded wrongly. It ends where terms cannot be parted.
    """
    off = np.abs(planes(uv, lines, known)[:, 0] - lines)
    start, found = known & (off <= ALIKE * median_of(off[known]) + 1e-6), list[Course]()
    for degree in degrees:
        fit = _course(uv, lines, known, start, degree, noise)
        if fit is None:
            break
        found.append(fit)
        start = known & (np.abs(fit.values(uv) - lines) <= NEAR * max(fit.scatter, noise) + 1e-6)
    return found


def _course(
    uv: Array, lines: Array, known: NDArray[np.bool_], start: NDArray[np.bool_], degree: int, noise: float
) -> Course | None:
    """One of them; None where the terms cannot be parted."""
    middle, size = uv[known].mean(axis=0), float(np.ptp(uv[known], axis=0).max()) / 2
    x, y = (uv - middle) / size, np.where(known, lines, 0.0)
    A = np.concatenate([polynomial(x[:, 0], x[:, 1], degree), -x * y[:, None]], axis=1)
    number, p = np.count_nonzero(known), A.shape[1]
    free = np.sqrt(number / max(number - p, 1))  # residuals are smaller than errors
    for slanted in SLANTED:
        root, usual, denominator = start.astype(float), max(noise, LEAST), np.eye(p)[-2:]
        for _ in range(5):  # a coordinate decoded wrongly is far off
            Q, R = np.linalg.qr(np.concatenate([A * root[:, None], usual / slanted * denominator]))
            if np.abs(np.diagonal(R)).min() < DEFECT * np.abs(np.diagonal(R)).max():
                return None
            Q = Q[:-2]
            fit = np.linalg.solve(R, Q.T @ (root * y))
            off = np.abs(y - A @ fit)
            usual = free * median_of(off[known]) / MEDIAN_OF_NORMAL
            limit = 3 * max(usual, noise, LEAST)
            before, root = root, known / np.sqrt(1 + (off / limit) ** 2)
            if np.abs(root - before).max() < SETTLED:
                break
        if np.min(1 + x[known] @ fit[-2:]) > LEAST_BELOW:
            return Course(degree, middle, size, fit, R, np.where(off < limit, np.sum(Q * Q, axis=1), 1.0), usual)
    return None


def bends(uv: Array, lines: Array, sigma: Array) -> Array:
    """Second derivatives (n, 4) of a coordinate by the camera's u twice, u and v, v twice, and their sigma: lines/px².

    From values (n,) at all targets of a board. Each target takes the degree that is most certain there: few terms lack,
    most at the rim, what a wide-angle lens bends (at 86 degrees degree 4 left 0.04 lines in coordinates), many carry
    noise. NaN where the targets do not tell, or one has itself to go by.
    """
    nothing, known = np.full((len(uv), 4), np.nan), np.isfinite(lines) & (sigma > 0)
    if not enough(int(np.count_nonzero(known)), DEGREES[0]):
        return nothing
    noise = median_of(sigma[known])
    fits = [_bends(fit, uv, known, noise) for fit in courses(uv, lines, known, DEGREES, noise)]
    if not fits:
        return nothing
    lacking = [_lacking(fit, fits[-1]) for fit in fits[:-1]]
    lacking.append(FURTHER * lacking[-1] if lacking else np.zeros(len(uv)))
    for fit, lacks in zip(fits, lacking, strict=True):
        fit[:, 3] = np.hypot(fit[:, 3], lacks)
    best = np.argmin([fit[:, 3] for fit in fits], axis=0)
    found = np.asarray(fits)[best, np.arange(len(uv))]
    return np.where((known & np.isfinite(found[:, 3]))[:, None], found, np.nan)


def _bends(fit: Course, uv: Array, known: NDArray[np.bool_], noise: float) -> Array:
    """These (n, 4) by one course, of infinite sigma where one target has itself to go by.

    What is left beyond noise may be waves over four targets.
    """
    (u, v), here = np.eye(2), fit.derivatives(uv)
    uu, across, vv = (fit.derivatives(uv + s) + fit.derivatives(uv - s) - 2 * here for s in (u, u + v, v))
    second = np.stack([uu, (across - uu - vv) / 2, vv], axis=1)
    usual = max(fit.scatter, noise)
    fitted = np.linalg.norm(second[..., :-1] @ np.linalg.inv(fit.root), axis=2).max(axis=1) * usual
    apart = median_of(np.linalg.norm(uv[known] - uv[known][nearest(uv[known], 2)[:, 1]], axis=1))
    uneven = np.sqrt(max(fit.scatter**2 - EVEN * noise**2, 0.0)) * (np.pi / (2 * apart)) ** 2
    doubt = np.where(fit.share < MOST_SHARE, np.hypot(fitted, uneven), np.inf)
    return np.concatenate([second[..., -1], doubt[:, None]], axis=1)


def _lacking(fewer: Array, more: Array) -> Array:
    """What bends (n,) by fewer terms lack of those by more, beyond what these have of noise."""
    apart = np.abs(more[:, :3] - fewer[:, :3]).max(axis=1)
    noise = np.where(np.isfinite(more[:, 3]), more[:, 3], 0.0)
    return np.asarray(np.sqrt(np.maximum(apart**2 - (BY_NOISE * noise) ** 2, 0.0)))
