"""The noise of the grey values, from the frames themselves.

Some combinations of frames carry no signal whatever the scene is: the alternating sum of four phase steps, the
difference between the means of two axes' steps, of a bit plus its inverse and the next. What they show is noise. Its
variance is taken as ``var(g) = max(dark + shot g, floor)``: read and quantisation noise, shot noise. `dark` is negative
where the camera adds an offset to its grey values, for the offset is without shot noise; `shot` is where a camera's own
gamma makes the dark noisiest.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.decode.frames import Numbers, PhaseFrames, SortedFrames
from core.decode.tables import Singles, fundamental
from core.model import Array
from core.numerics import polynomial
from core.patterns import brightness

BINS = 12  # of grey values, with the same number of residuals each
LEAST = 50  # residuals that tell a variance
SHOWN, FALLING = 2.0, 5.0  # standard deviations that a slope must have, and a falling one
OWN = 0.5  # of the noise of residuals, that of their levels at most: of those of two frames
LOWEST = 0.5  # the noise is never taken below this part of the least seen
TINY = 1e-12
MEDIAN_OF_SQUARE = 0.45494  # of a normal deviate
OUTSIDE = 50.0  # squares by their median, of what is no noise
EXPLAINED = 8  # harmonics of a sine wave that a response makes
UNEVEN = slice(1, 3)  # of these, the second and third: blur, which differs over the image, tells their strength
EACH = 8  # lit pixels for every part of the waves' harmonics, of which fewer do not tell how that differs
LINES = 256  # of square waves that tell what their steps show
VISIBLE = 1e-6  # part of the strongest, of what is no rounding


class Noise(NamedTuple):
    """Variance of a grey value g: ``max(dark + shot g, floor)``, in grey values squared.

    By ``misfit m²``, m being the modulation, the frames of a pixel contradict each other more: that is the same for its
    neighbours, and no noise. `unlit` is the variance seen where no stripes are, as far as these were left out: a camera
    with a gamma of its own is noisiest there. Above `upto` there is more noise, as the longer of two exposures is
    saturated.
    """

    dark: float
    shot: float
    floor: float
    misfit: float = 0.0
    unlit: float = 0.0
    upto: float = np.inf

    def variance(self, level: NDArray[np.floating]) -> NDArray[np.floating]:
        """Give the variance at grey values, same shape."""
        return np.maximum(self.dark + self.shot * level, self.floor)


def contrasts(frames: SortedFrames, count: int) -> Array:
    """Orthonormal combinations of `count` frames that show noise only, shape (n, count); n may be 0.

    The most trustworthy kind that exists is used: repeated frames and more steps than unknowns; then, of scenes lit
    evenly by different patterns (means of steps, bit plus inverse), the differences; then white and black as well.
    """
    phases = [phase for axis in frames.axes.values() for phase in axis.phases]
    repeated = [_within(numbers, np.ones((len(numbers), 1)), count) for numbers in frames.duplicates]
    redundant = [_within(phase.frames, _design(phase), count) for phase in phases]
    found = np.vstack([np.zeros((0, count)), *repeated, *redundant])
    if len(found):
        return np.asarray(np.linalg.svd(found, full_matrices=False)[2][: np.linalg.matrix_rank(found)])
    for white, black in (((), ()), (frames.white, frames.black)):
        numbers, design = _joint(frames, phases, white, black)
        found = _within(numbers, design, count)
        if len(found):
            return found
    return np.zeros((0, count))


def _design(phase: PhaseFrames) -> Array:
    """Mean, first harmonic, and for square waves what else the steps show, one row per frame."""
    parts = np.array([fundamental(pattern) for pattern in phase.patterns])
    design = np.column_stack([np.ones(len(parts)), parts])
    if phase.patterns[0].profile == "square":
        light = np.array([brightness(pattern, np.arange(LINES)) for pattern in phase.patterns])
        shown, strength, _ = np.linalg.svd(light, full_matrices=False)
        design = np.column_stack([design, shown[:, strength > VISIBLE * strength[0]]])
    return design


def _joint(frames: SortedFrames, phases: list[PhaseFrames], white: Numbers, black: Numbers) -> tuple[Numbers, Array]:
    """Frames of all kinds with the unknowns: ambient light, projector's light, and every pattern's own modulation."""
    numbers: list[int] = []
    parts: list[tuple[list[float], Array]] = []  # level of each frame about one half, own unknowns of the group
    for phase in phases:
        numbers += phase.frames
        design = _design(phase)
        parts.append((list(design[:, 1] - 0.5), design[:, 2:]))
    for axis in frames.axes.values():
        for code in axis.codes:
            for bit in code.direct:
                if bit in code.inverse:
                    pair = [*code.direct[bit], *code.inverse[bit]]
                    numbers += pair
                    own = np.array([[1.0]] * len(code.direct[bit]) + [[-1.0]] * len(code.inverse[bit]))
                    parts.append(([0.0] * len(pair), own))
    for group, level in ((white, 0.5), (black, -0.5)):
        if group:
            numbers += group
            parts.append(([level] * len(group), np.zeros((len(group), 0))))
    width = 2 + sum(own.shape[1] for _, own in parts)
    design, row, column = np.zeros((len(numbers), width)), 0, 2
    for levels, own in parts:
        n, k = own.shape
        design[row : row + n, 0] = 1
        design[row : row + n, 1] = levels
        design[row : row + n, column : column + k] = own
        row, column = row + n, column + k
    return tuple(numbers), design


def _within(numbers: Numbers, design: Array, count: int) -> Array:
    """Orthonormal combinations of the numbered frames orthogonal to all columns of a design matrix."""
    if not numbers:
        return np.zeros((0, count))
    left, values, _ = np.linalg.svd(design)
    rank = int(np.sum(values > 1e-6 * values[0]))
    found = np.zeros((len(numbers) - rank, count))
    found[:, list(numbers)] = left[:, rank:].T
    return found


def estimate_noise(residual: Array, level: Array, quantum: float, darkest: float = np.inf) -> Noise:
    """Fit the noise model to residuals (n,): combinations of grey values, of unit norm, that should be zero.

    `level` is the grey value at which each is taken: the mean of the frames, weighted by the squared coefficients. The
    noise is never taken below quantum² / 12, nor to grow from nothing at a grey value above `darkest`, which is seen.
    """
    floor = quantum * quantum / 12
    if len(residual) < BINS:
        return Noise(floor, 0.0, floor)
    bins = min(len(residual) // LEAST, BINS) or 1
    by_level = np.argsort(level)[len(level) % bins :].reshape(bins, -1)
    variances = _robust_variances(residual[by_level], floor)
    return _fit(variances, level[by_level].mean(axis=1, dtype=float), floor, by_level.shape[1], darkest)


def robust_variance(residual: Array) -> float:
    """Variance of residuals without their outliers, 0 where they are too few to tell it."""
    return float(_robust_variances(residual[None], TINY)[0]) if len(residual) >= LEAST else 0.0


def _robust_variances(residual: Array, floor: float) -> Array:
    """Mean squares of the rows without the outliers beyond four standard deviations."""
    square = np.sort(np.square(residual), axis=1)
    middle = square.shape[1] // 2
    half = (square[:, middle] + square[:, -1 - middle]) / 2
    variance = np.maximum(half.astype(float) / MEDIAN_OF_SQUARE, floor)
    sums = np.cumsum(square, axis=1, dtype=float)
    for _ in range(3):
        inner = np.count_nonzero(square <= 16 * variance[:, None], axis=1)
        variance = np.maximum(np.take_along_axis(sums, inner[:, None] - 1, axis=1)[:, 0] / inner, floor)
    return variance


def _fit(variance: Array, level: Array, floor: float, number: int, darkest: float) -> Noise:
    """Weighted straight line through variances of so many residuals each; level where no slope is shown.

    The weights follow from the line itself: those from the variances found would favour what is small by chance.
    Levels that differ by no more than their noise tell no slope: the noise that sorted them is in the residuals, too.
    """
    weight, noise = np.ones(len(level)), Noise(floor, 0.0, floor)
    least = max(floor, LOWEST * float(variance.min()))
    for _ in range(3):
        total = float(weight.sum())
        mean_level, mean_variance = float(weight @ level) / total, float(weight @ variance) / total
        away = weight * (level - mean_level)
        lever = max(float(away @ (level - mean_level)), TINY * total)
        slope = float(away @ (variance - mean_variance)) / lever
        sigma = np.sqrt(2 / number * mean_variance**2 * total / lever / len(level))
        shown = lever > OWN * mean_variance * total and not -FALLING * sigma <= slope <= SHOWN * sigma
        steepest = mean_variance / (mean_level - darkest) if darkest < mean_level else np.inf
        slope = min(slope, steepest) if shown else 0.0
        noise = Noise(mean_variance - slope * mean_level, slope, least)
        weight = 1 / np.square(noise.variance(level))
    return noise


def _as_they_are(values: NDArray) -> tuple[Array, Array]:
    return values, values


class Told(NamedTuple):
    """A wave as the frames show it: their numbers, coefficients of its cosine plus i sine part, and this in pixels."""

    frames: Numbers
    both: NDArray[np.complexfloating]
    seen: NDArray[np.complexfloating]


def without_harmonics(
    residual: NDArray[np.floating],
    factors: NDArray[np.floating],
    shown: Singles,
    waves: Sequence[Told],
    places: Array,
    also: Callable[[NDArray], tuple[Array, Array]] = _as_they_are,
    of: NDArray[np.bool_] | bool = True,
) -> tuple[Array, Array]:
    """What is left of combinations of frames without the part that harmonics of the waves explain, linearly.

    `residual`, (k, ...), are combinations of grey values by `factors`, (k, frames), of `shown`, (frames, ...), after
    what `also` did; it is done with the harmonics too, and gives their mean there. `of` are the pixels that tell the
    harmonics, `places`, (5, ...), where in the image they are, see `chosen.places_of`.

    What is left is given as combinations of unit norm, with the grey values at which they are taken: the waves' own
    noise, which is that of the same frames, is taken away or added with the harmonics.
    """
    flat = residual.reshape(len(residual), -1).astype(float)
    left, told = flat, np.broadcast_to(of, residual.shape[1:]).ravel()
    field = _over_the_image(places, told.sum() / len(waves))
    design = np.concatenate([also(_harmonics(wave, field))[0] for wave in waves]).reshape(-1, len(told))
    for _ in range(2):  # edges of the scene must not take part
        square = np.square(left)
        usual = np.maximum(np.median(square[:, told], axis=1, keepdims=True), TINY)
        inner = told & (np.max(square / usual, axis=0) < OUTSIDE)
        some = design[:, inner]
        normal = some @ some.T
        normal += max(1e-9 * np.trace(normal) / len(normal), TINY) * np.eye(len(normal))  # flat frames have no waves
        parts = np.linalg.solve(normal, some @ flat[:, inner].T).T
        left = flat - parts @ design
    number = int(np.count_nonzero(inner))
    left *= np.sqrt(number / max(number - len(design), 1))
    square, level = _with_own_noise(factors, shown, waves, field, parts)
    square, level = also(square)[1], also(level)[1]
    return left.reshape(residual.shape) / np.sqrt(square), level / square


def _over_the_image(places: Array, number: float) -> Array:
    """How blur may differ at `places`, (5, ...), over the image and by kind of pixel, shape (8, ...): not at all if so
    many pixels do not tell."""
    x, y, *kinds = places.reshape(len(places), -1)
    field = np.vstack([polynomial(x, y, 2).T[1:], *kinds]).reshape(-1, *places.shape[1:])
    return field if number > EACH * (1 + 2 * len(_orders(field))) else field[:0]


def _orders(field: Array) -> NDArray[np.intp]:
    """Of what `_turns` gives."""
    orders = np.arange(1, EXPLAINED + 1)
    return np.concatenate([orders, *[orders[UNEVEN]] * len(field)])


def _turns(wave: Told, field: Array) -> NDArray[np.complex128]:
    """Harmonics of unit amplitude, and what of the uneven ones differs over the image, (orders, ...)."""
    turn = wave.seen / np.maximum(np.abs(wave.seen), 1e-6).astype(float)
    harmonics = np.array(list(accumulate([turn] * EXPLAINED, np.multiply)))
    return np.concatenate([harmonics, *(harmonics[UNEVEN] * each for each in field)])


def _harmonics(wave: Told, field: Array) -> Array:
    """Amplitude of a wave, its harmonics' real and then their imaginary parts, (1 + 2 orders, ...)."""
    turns, amplitude = _turns(wave, field), np.abs(wave.seen)[None]
    return np.concatenate([amplitude, amplitude * turns.real, amplitude * turns.imag])


def _with_own_noise(
    factors: NDArray[np.floating], shown: Singles, waves: Sequence[Told], field: Array, parts: Array
) -> tuple[Array, Array]:
    """Sums over the frames of the squares, and of these times the grey values, of what each counts in combinations
    without such parts of the waves' harmonics, (k, ...)."""
    orders, size = _orders(field), (len(factors), *shown.shape[1:])
    changes = []  # of what is taken away, by the wave as the frames show it: (k, ...)
    for wave, part in zip(waves, np.split(parts, len(waves), axis=1), strict=True):
        both = part[:, 1 : 1 + len(orders)] - 1j * part[:, 1 + len(orders) :]
        turns = _turns(wave, field)
        along = part[:, :1] + (both @ turns.reshape(len(orders), -1)).real
        across = -((orders * both) @ turns.reshape(len(orders), -1)).imag
        changes.append((along - 1j * across).reshape(size) * turns[0].conj())
    square, level = np.zeros((2, *size))
    for k, row in enumerate(factors):
        counts = np.array(np.broadcast_to(row.reshape(-1, *[1] * (shown.ndim - 1)), shown.shape), float)
        for wave, change in zip(waves, changes, strict=True):
            for n, each in zip(wave.frames, wave.both, strict=True):
                counts[n] -= (change[k] * each).real
        np.square(counts, out=counts)
        square[k], level[k] = counts.sum(axis=0), (counts * shown).sum(axis=0)
    return square, level


def spatial_residual(rows: NDArray[np.floating]) -> tuple[Array, Array]:
    """Second differences along image rows, of unit norm, and the means they are taken at, shape (..., W - 2).

    They are noise where the scene is smooth. The mean of the same three values is not correlated with them.
    """
    g = np.asarray(rows, float)
    left, middle, right = g[..., :-2], g[..., 1:-1], g[..., 2:]
    return (left - 2 * middle + right) / np.sqrt(6.0), (left + middle + right) / 3
