"""How much the light changes across dots, which draws their centroids to the brighter side.

Round dark dots the board shows it. Its grey values there are light times print, and what every pixel has besides: the
camera's level in the dark, light scattered in the lens. The contrast of a dot is without that, so that dots under more
and less light tell how much it is. Bright dots lie on a dark board, which shows too little.

Lamps, projectors and vignettes change it slowly: over a whole image one over the light's root is nearly a polynomial of
few terms, under ``cos⁴`` exactly a quadratic one. What that leaves, of hot spots and shadows' rims, cubics through each
dot's neighbours follow. Without the polynomial the cubics' errors, which neighbours share, were up to half of the
centroids' own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.model import Array
from core.numerics import (
    MEDIAN_OF_NORMAL,
    median_of,
    nearest,
    normal_equations,
    polynomial,
    polynomial_slopes,
    row_median,
)

NEIGHBOURS, LEAST_NEIGHBOURS = 20, 6  # dots that tell the light's gradient
PRINTS = 0.01  # share by which dots' prints differ, to begin with
# how much light's logarithm usually changes over the neighbours' reach, by the terms of a cubic: a bound for few dots
USUAL, UNUSUAL = np.repeat([2.0, 4.0, 4.0, 4.0], [1, 2, 3, 4]), 1.5
DEGREE, DOTS_A_TERM = 4, 3  # of the polynomial over the image, at most, and how many dots it needs
ROOT = 0.5  # the light is the polynomial to the power of -1 / ROOT
UNSEEN = 0.5  # of single dots' scatter: change over the neighbours' reach that the polynomial may lack unnoticed
LEVEL = 0.05  # of the board's grey values, that a camera may give without light: a bound for even light and few dots
BESIDE, SHARED = 5, 0.05  # neighbours that may share of a dot's variance so much, if the polynomial follows the light


def light_of_ground(plane: Array, contrast: Array) -> tuple[Array, Array]:
    """Relative change of the light per px at dark dots, shape (m, 2), and its covariance (m, 2, 2).

    By the board round every dot, `plane` (m, 3) of its grey value and slopes per px, less what it has without light.
    That is where a line through the `contrast` of all dots (m,), by the board's value beside them, ends: contrasts
    scatter by the prints. NaN does not count.

    Examples
    --------
    >>> light = np.linspace(60.0, 100.0, 40)  # 2 grey values more than that are seen
    >>> plane = np.stack([light + 2.0, 0.004 * light, 0.0 * light], axis=1)
    >>> print(np.round(light_of_ground(plane, 0.9 * light)[0][[0, 39], 0], 5))
    [0.004 0.004]
    """
    ground = np.maximum(plane[:, 0], 1e-9)
    level, sigma = _unlit(ground, contrast)
    lit = np.maximum(ground - level, LEVEL * ground)[:, None]
    with np.errstate(all="ignore"):
        gradient = np.nan_to_num(plane[:, 1:] / lit)
    unsure = gradient * (sigma / lit)
    return gradient, unsure[:, :, None] * unsure[:, None, :]


def _unlit(ground: Array, contrast: Array) -> tuple[float, float]:
    """Grey value of a board (m,) without light, and its sigma, from contrasts (m,) that go with the light."""
    use = np.isfinite(ground) & np.isfinite(contrast) & (contrast > 0)
    usual = float(median_of(ground[use])) if use.any() else 0.0
    if np.count_nonzero(use) < LEAST_NEIGHBOURS or usual <= 0:
        return 0.0, LEVEL * max(usual, 0.0)
    x, y = ground[use] / usual, contrast[use] / float(median_of(contrast[use]))
    A, prior = np.stack([np.ones_like(x), x], axis=1), np.diag([LEVEL**-2, 0.0])
    weight, scatter = np.ones_like(x), PRINTS
    for _ in range(5):
        N = (A * weight[:, None]).T @ A / scatter**2 + prior
        fit = np.linalg.solve(N, A.T @ (weight * y) / scatter**2)
        off = np.abs(y - A @ fit) / np.sqrt(np.maximum(x, 0.1))  # of prints in proportion, of noise alike
        scatter = max(float(median_of(off)) / MEDIAN_OF_NORMAL, 1e-4)
        weight = 1 / np.maximum(x, 0.1) / (1 + (off / (3 * scatter)) ** 2)
    slope = max(float(fit[1]), 0.1)
    cov = np.linalg.inv(N)
    at = np.array([1.0, -fit[0] / slope]) / slope
    level, dots = usual * -float(fit[0]) / slope, float(median_of((ground - contrast)[use]))
    return min(level, dots), usual * float(np.sqrt(at @ cov @ at))  # dots reflect something, too


def light_gradient(
    uv: Array, contrast: Array, inside: Array, weight: Array, shadowed: NDArray[np.bool_] | None = None
) -> tuple[Array, Array]:
    """Relative change of the light per px at every bright dot, shape (m, 2), and its covariance (m, 2, 2).

    By the logarithms of the contrasts of the dots around, and the changes seen `inside` them (m, 2), whose variances go
    with 1 / `weight` (m,): a dot alone tells too little, and prints differ at random. A quadratic through neighbours
    leaves 0.002 px at a testfield's corners, where all are on one side and the light falls off fastest. What either
    kind is worth follows from how well it fits. A contrast of NaN does not count: where the light ends in the ring
    round a dot, its background is too dark and its contrast too high. Dots that are `shadowed` (m,) and dots that are
    not say nothing of each other's light.
    """
    k = min(NEIGHBOURS, len(uv))
    if k < LEAST_NEIGHBOURS:
        return np.zeros_like(uv), np.zeros((len(uv), 2, 2))
    near = nearest(uv, k)
    lit = np.ones(len(uv), bool) if shadowed is None else ~shadowed
    bright = np.log(np.maximum(contrast, 1e-6))
    gradient, cov, allowed = np.zeros_like(uv), np.zeros((len(uv), 2, 2)), np.tile(USUAL, (len(uv), 1))
    if (whole := _over_image(uv, bright, inside, weight, lit, near[:, 1 : 1 + BESIDE])) is not None:
        value, slope, its_cov, variance = whole
        gradient[lit], cov[lit], allowed[lit, 1:] = slope[lit], its_cov[lit], UNSEEN * np.sqrt(variance)
        bright, inside = np.where(lit, bright - value, bright), inside - gradient
    scale = np.linalg.norm(uv[near[:, -1]] - uv, axis=1, keepdims=True)
    x, y = np.moveaxis((uv[near] - uv[:, None, :]) / scale[..., None], 2, 0)
    bright = bright[near] - row_median(bright[near])[:, None]
    valid = (np.abs(bright) < UNUSUAL) & (lit[near] == lit[:, None])
    # near ones count most: over all of them a cubic follows light that falls steeply only in part
    share = np.tile((1 - np.minimum(np.hypot(x, y), 0.999) ** 3) ** 3, (1, 3))
    seen = np.concatenate([bright, inside[near, 0] * scale, inside[near, 1] * scale], axis=1)
    told = np.concatenate([valid, *2 * [valid * weight[near] / scale**2]], axis=1)
    prior = np.eye(len(USUAL)) / allowed[:, None, :] ** 2
    fit, its_cov, _ = _fitted(_terms(x, y, 3), seen, told, share, prior, own=1)
    return gradient + fit[:, 1:3] / scale, cov + its_cov[:, 1:3, 1:3] / scale[..., None] ** 2


def _over_image(
    uv: Array, bright: Array, inside: Array, weight: Array, lit: NDArray[np.bool_], beside: NDArray[np.int64]
) -> tuple[Array, Array, Array, float] | None:
    """Logarithm of the light (m,), its slope (m, 2), that one's covariance and the variance of single dots.

    By one polynomial p for all: the light is ``p^(-1 / ROOT)``. None where dots are few, or what is left of neighbours,
    (m, BESIDE), is alike: then the light has more shape than that.
    """
    use = lit & np.isfinite(bright)
    usual = float(median_of(bright[use])) if use.any() else 0.0
    use &= np.abs(bright - usual) < 2 * UNUSUAL
    degree = DEGREE
    while degree > 1 and np.count_nonzero(use) < DOTS_A_TERM * (degree + 1) * (degree + 2) // 2:
        degree -= 1
    if degree < 2:
        return None
    middle, rows = uv[use].mean(axis=0), len(uv)
    size = float(np.abs(uv[use] - middle).max())
    x, y = (uv - middle).T / size
    A = _terms(x, y, degree)
    root = np.where(use, np.exp(ROOT * (usual - bright)), 1.0)  # p of single dots, which makes the equations linear
    seen = np.concatenate([np.ones(rows), *(-ROOT * size * inside.T)])
    told = np.concatenate([use, *2 * [use * weight / size**2]]) / ROOT**2
    relative, prior = A / np.tile(root, 3)[:, None], 1e-6 * np.eye(A.shape[1])
    fit, C, variance = _fitted(relative[None], seen[None], told[None], np.ones(told.shape), prior, own=rows)
    value, by_x, by_y = A.reshape(3, rows, -1)
    p = np.maximum(value @ fit[0], 1e-3)[:, None, None]
    slopes = -np.stack([by_x, by_y], axis=1) / (ROOT * size * p)
    gradient = slopes @ fit[0]
    light = usual - np.log(p[:, 0, 0]) / ROOT
    off = np.where(use, np.clip((bright - light) / np.sqrt(variance), -5.0, 5.0), 0.0)
    others = off[beside].sum(axis=1) / np.maximum(use[beside].sum(axis=1), 1)
    if off @ others > SHARED * np.count_nonzero(use):
        return None
    slopes -= gradient[:, :, None] * value[:, None, :] / p
    return light, gradient, slopes @ C[0] @ slopes.transpose(0, 2, 1), variance


def _terms(x: Array, y: Array, degree: int) -> Array:
    """Terms of a polynomial at places (..., k), then their slopes by x and by y: shape (..., 3 k, terms)."""
    return np.concatenate([polynomial(x, y, degree), *polynomial_slopes(x, y, degree)], axis=-2)


def _fitted(A: Array, seen: Array, told: Array, share: Array, prior: Array, own: int) -> tuple[Array, Array, float]:
    """Robust fits (m, terms) of values and slopes (m, 3 k), their covariances, and the variance of a value.

    `told` are relative weights, for values and slopes apart: their variances follow from what the fits leave of the
    first `own` of k.
    """
    rows, seen = A.shape[1] // 3, np.nan_to_num(seen)
    chosen = (np.arange(own) + rows * np.arange(3)[:, None]).ravel()
    variance, doubt = [PRINTS**2, PRINTS**2], np.ones(told.shape)
    for _ in range(3):
        known = told / np.repeat(variance, (rows, 2 * rows))
        counted = known * doubt * share
        N, b = normal_equations(A, counted, seen[..., None])
        C = np.linalg.inv(N + prior)
        fit = C @ b
        square = (seen - (A @ fit)[..., 0]) ** 2 * known
        doubt = 1 / (1 + square / 9)
        # of a dot's own values, which the fit has drawn to itself
        drawn = np.sum(A[:, chosen] @ C * A[:, chosen], axis=2) * known[:, chosen]
        left = np.where(known[:, chosen] > 0, square[:, chosen] / np.maximum(1 - drawn, 0.1), np.nan)
        for i, part in enumerate((left[:, :own], left[:, own:])):
            if np.isfinite(part).any():
                variance[i] = max(variance[i] * median_of(part) * MEDIAN_OF_NORMAL**-2, 1e-8)
    cov = C @ (normal_equations(A, counted * share, seen[..., None])[0] + prior) @ C
    return fit[..., 0], cov, variance[0]
