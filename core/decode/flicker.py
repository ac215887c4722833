"""Light that changes from frame to frame: a flickering or drifting lamp, found and taken out of the phase steps.

Lit once more than the other steps, one step draws the phases to its own. Then the amplitude of fringes as a part of
their mean depends on the phase, though it is the same for neighbours in truth, and more steps than three contradict
each other. Both are linear in the gains of the frames, which follow by least squares over a sample of pixels. A room's
lamp adds light instead, of their mean the same part in all pixels; what is left tells which of both it was.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.decode.frames import Image
from core.decode.tables import Array, AxisTable, Fits, Singles
from core.numerics import distinct, quantile_of, sigma_by_median

ROUNDS = 3
# of the image in either direction; px of each; px of parts in which fringes must change, wide ones in wider
PATCHES, PATCH, PARTS = 8, 96, (24, 48, 96)
STEP, SMALL = 8, 400 * 400  # px of a square of which one pixel is looked at; pixels of an image below which it is half
COHERENT = 0.5  # mean of exp(i phase) in such a part from which it has less than about half a fringe
NOTICED = 0.005  # part by which the light of all pixels differs from frame to frame; fringes may do that too
ROWS = 300  # of an image that tell it
PIXELS = 1024  # tell if it is worth looking; all then tell how much
FEWEST, SEVERAL = 300, 9  # pixels in all, in a patch
DIM = 0.2  # part of the brightest pixels' modulation that one must have
PRIOR = 0.1  # standard deviation of a frame's gain
OUTLIER = 4.0  # standard deviations
SIGNIFICANT = 6.0  # standard deviations of chi squared
PHASES = 12  # parts of a period
# of the gains that the light may leave unexplained: flicker of 1 to 12 % left 0.34 to 0.86, harmonics 0.92
AGREE = 0.85
APART = 0.27  # of the gains, r.m.s., that any quarter may tell otherwise: planes to 0.26, a board's dots from 0.3 on
SLIGHT = 0.003  # of the gain: less is not worth it


def steady(
    tables: tuple[AxisTable, AxisTable], images: Sequence[Image], saturation: float
) -> tuple[tuple[AxisTable, AxisTable], Array | None]:
    """Free the frames of every period, of axes x and y, from what their light differs by.

    The tables are the same where the light was steady. The matrix (frames, frames) leads from the grey values of all
    frames to those in steady light; it is diagonal where the projector's lamp flickers.
    """
    waves = [wave for table in tables for wave in _waves(table)]
    differs = [_differs([images[n] for n in frames]) for frames, _ in waves]
    if not any(differs):
        return tables, None
    step = STEP if images[0].size > SMALL else STEP // 2
    rows, columns = (_places(size, step) for size in images[0].shape)
    patch, *parts = (_numbers(len(rows), len(columns), each // step) for each in (PATCH, *PARTS))
    aside = np.random.default_rng(0).integers(0, step, (2, len(rows), len(columns)))  # no fringes are as uneven
    row, column = (
        np.minimum(each, size - 1)
        for each, size in zip((rows[:, None] + aside[0], columns + aside[1]), images[0].shape, strict=True)
    )
    seen = [np.stack([images[n][row, column].ravel() for n in frames]) for frames, _ in waves]
    found = [
        _gains(grey.astype(np.float32), solution, patch, parts, saturation) if look else None
        for grey, (_, solution), look in zip(seen, waves, differs, strict=True)
    ]
    costs = [[cost for _, cost in kinds] for kinds in found if kinds]
    if not np.any(costs):
        return tables, None
    room = bool(np.argmin(np.sum(costs, axis=0)))
    each = [
        _to_steady(kinds[room][0] if kinds else np.ones(len(frames)), solution, room)
        for (frames, solution), kinds in zip(waves, found, strict=True)
    ]
    lit = np.max([grey.max(axis=0) for grey in seen], axis=0) < saturation
    means = [solution[0] @ own @ grey[:, lit] for (_, solution), own, grey in zip(waves, each, seen, strict=True)]
    usual = np.median(means, axis=0)
    bright = usual > 1  # grey value: where black is 0, most of an image may be that
    light = np.eye(len(images))
    for (frames, solution), own, mean in zip(waves, each, means, strict=True):
        level = float(np.median(mean[bright] / usual[bright])) if bright.any() else 1.0
        whole = np.full(len(frames), 2 - 1 / level if room else level)
        light[np.ix_(frames, frames)] = _to_steady(whole, solution, room) @ own
    x, y = (_lit_by(table, light) for table in tables)
    return (x, y), light


def _differs(images: Sequence[Image]) -> bool:
    """Whether the light of whole images differs from frame to frame; that of a sample does, by fringes."""
    light = np.array([cv2.mean(image[:: max(1, len(image) // ROWS)])[0] for image in images])
    return bool(np.ptp(light) > NOTICED * light.mean())


def _to_steady(gains: Array, solution: Array, room: bool) -> Array:
    """Leads from the grey values of a period's frames to those in steady light, shape (frames, frames)."""
    return np.eye(len(gains)) - np.outer(gains - 1, solution[0]) if room else np.diag(1 / gains)


def _places(size: int, step: int) -> NDArray[np.intp]:
    """Rows or columns at which squares begin, in patches all over the image."""
    patches = max(1, min(PATCHES, size // PATCH))
    first = (np.arange(patches) * size) // patches
    places = (first[:, None] + np.arange(0, PATCH, step)).ravel()
    return np.asarray(places[places < size], np.intp)


def _numbers(rows: int, columns: int, each: int) -> NDArray[np.intp]:
    """Number of the square of so many places that each of a grid belongs to."""
    row, column = np.divmod(np.arange(rows * columns), columns)
    return np.asarray(row // each * (columns // each + 1) + column // each, np.intp)


def _waves(table: AxisTable) -> list[tuple[NDArray[np.int32], Array]]:
    """Frames of every period that are phase steps alone, and their solution (3, frames)."""
    found = []
    for j in range(len(table.period)):
        entries = slice(int(table.fits.first[j]), int(table.fits.first[j + 1]))
        used = table.hat[j].diagonal()[: entries.stop - entries.start] > 0
        solution = table.fits.value[:, entries][:, used].astype(float)
        if used.sum() > 2 and np.ptp(solution[0]) < 1e-3:  # else white or black take part
            found.append((table.fits.frame[entries][used], solution))
    return found


def _lit_by(table: AxisTable, light: Array) -> AxisTable:
    """Fit the frames in steady light."""
    value, hat = table.fits.value.copy(), table.hat.copy()
    for j in range(len(table.period)):
        used = np.flatnonzero(hat[j].diagonal() > 0)
        frames = table.fits.frame[table.fits.first[j] + used]
        own, block, entries = light[np.ix_(frames, frames)], np.ix_(used, used), table.fits.first[j] + used
        value[:, entries] = value[:, entries] @ own
        hat[j][block] = np.linalg.solve(own, hat[j][block]) @ own
    return table._replace(fits=Fits(table.fits.first, table.fits.frame, value), hat=hat)


def _gains(
    grey: Singles, solution: Array, patch: NDArray[np.intp], parts: Sequence[NDArray[np.intp]], saturation: float
) -> list[tuple[Array, float]] | None:
    """Gains of the frames of one period, by a projector's lamp and by a room's, and the logarithm of the part that each
    leaves unexplained, 0 where it shows nothing; None where too few pixels tell."""
    both = (solution[1] + 1j * solution[2]).astype(np.complex64)
    z = np.einsum("f,fn->n", both, grey)
    amplitude = np.abs(z)
    good = (grey.max(axis=0) < saturation) & (amplitude > DIM * quantile_of(amplitude, 0.9))
    turn = np.where(good, z / np.maximum(amplitude, 1e-6), 0)
    for part in parts:
        count = np.maximum(np.bincount(part[good], minlength=part.max() + 1), 1)
        means = np.hypot(*(np.bincount(part, side, len(count)) for side in (turn.real, turn.imag)))
        tell = good & (means < COHERENT * count)[part] & (count > 4)[part]
        tell &= (np.bincount(patch[tell], minlength=patch.max() + 1) > SEVERAL)[patch]
        if tell.sum() >= FEWEST:
            break
    else:
        return None
    good = tell
    grey, patch = grey[:, good], patch[good]
    return [_by(grey, solution, patch, room) for room in (False, True)]


def _by(grey: Singles, solution: Array, patch: NDArray[np.intp], room: bool) -> tuple[Array, float]:
    """Gains by one of both lamps, and what they leave, see `_gains`."""
    steady_light, thinned = np.ones(len(grey)), max(1, grey.shape[1] // PIXELS)
    total, unexplained = steady_light, np.zeros(ROUNDS)
    for k in range(ROUNDS):
        some = slice(None, None, thinned if k == 0 else 1)
        shown = (_to_steady(total, solution, room) @ grey[:, some]).astype(np.float32)
        change, significant, unexplained[k] = _look(shown, solution, patch[some], room)
        if k == 0 and not significant:
            return steady_light, 0.0
        total = total + change if room else total * (1 + change)
    total = total + 1 - total.mean() if room else total / total.mean()
    both = (solution[1] + 1j * solution[2]).astype(np.complex64)
    steady = _to_steady(total, solution, room) @ grey
    told = (
        np.abs(total - 1).max() > SLIGHT
        # a frame that came late in some rows is no flicker
        and all(_lit_so(seen, shown, both, total) for seen, shown in _parts(2, grey, steady))
        # dots of a board show some phases more than others, and tell other gains elsewhere
        and all(
            np.std(_look(shown.astype(np.float32), solution, own, room)[0]) < APART * np.std(total)
            for shown, own in _parts(4, steady, patch)
        )
    )
    return (total, float(unexplained[-1] - unexplained[0])) if told else (steady_light, 0.0)


def _parts(count: int, *values: NDArray[Any]) -> Iterator[tuple[NDArray[Any], ...]]:
    """Divide arrays (..., n) of pixels into those of so many bands of rows."""
    return zip(*(np.array_split(each, count, axis=-1) for each in values), strict=True)


def _lit_so(grey: Singles, steady: Singles, both: NDArray[np.complex64], gains: Array) -> bool:
    """Whether the light of all pixels changes as the gains do: harmonics of the wave do not change it.

    True flicker shifts the phases that this goes by, and takes a part of its own light away. Where too much is gone,
    light by the phases without flicker is nearer to the gains than this is to no change.
    """
    light = _light(grey, grey, both)
    plain = float(np.std(light - gains)) < AGREE * float(np.std(gains))
    return plain or float(np.std(_light(grey, steady, both) - gains)) < float(np.std(light))


def _light(grey: Singles, phased: Singles, both: NDArray[np.complex64]) -> Array:
    """Light of the frames, 1 in the mean; every phase counts alike, so that fringes seen in part leave nothing."""
    mean = np.maximum(phased.mean(axis=0), 1)
    phase = ((np.angle(np.einsum("f,fn->n", both, phased)) / (2 * np.pi) + 1) * PHASES).astype(int) % PHASES
    count = np.bincount(phase, minlength=PHASES)
    light = np.array(
        [(np.bincount(phase, row / mean, PHASES) / np.maximum(count, 1))[count > 0].mean() for row in grey]
    )
    return np.asarray(light / light.mean())


def _look(grey: Singles, solution: Array, block: NDArray[np.intp], room: bool = False) -> tuple[Array, bool, float]:
    """Changes of the gains, whether they are significant, and the logarithm of what there was to explain."""
    g, both = grey.astype(float), solution[1] + 1j * solution[2]
    z, m = both @ g, np.maximum(solution[0] @ g, 1)
    turn = z / np.maximum(np.abs(z), 1e-6)
    part = np.abs(z) / m
    light = np.ones_like(g) if room else g / m
    slopes = ((turn.conj() * both[:, None]).real - part * solution[0][:, None]) * light
    weight = np.minimum(m / quantile_of(m, 0.9), 1)  # noise is of grey values, not of parts of the mean
    shift = np.linalg.pinv(solution)[:, 1:] @ [1, -1j]
    steps = len(distinct(shift.round(6)))
    # light that all frames hold alike, ambient or of the sensor, makes fringes on dark surface weaker; harmonics of
    # the wave next to a multiple of the steps make their amplitude depend on the phase
    aside = np.array([1 / m, *_both(part * turn**steps)])
    radial, seen, aside = (weight * _without_mean(each, block) for each in (slopes, part[None], aside))
    design, observed = [_beside(radial, aside)], [_beside(seen, aside)[0]]
    contrasts = np.linalg.svd(solution)[2][3:]
    if len(contrasts):  # as one: what noise makes of each differs from frame to frame, of all together it does not
        shown = weight * g / m
        harmonics = [np.multiply.outer(contrasts @ shift**h, weight * part * turn**h) for h in range(2, steps - 1)]
        aside = np.reshape([each for h in harmonics for each in _both(h)], (-1, len(contrasts) * g.shape[1]))
        design.append(_beside((contrasts[:, :, None] * weight * light).transpose(1, 0, 2).reshape(len(g), -1), aside))
        observed.append(_beside((contrasts @ shown).reshape(1, -1), aside)[0])
    free = np.linalg.svd(np.ones((1, len(g))))[2][1:]  # a factor common to all frames shows nowhere
    size = len(free)
    normal, right, prior = np.zeros((size, size)), np.zeros(size), np.eye(size) / PRIOR**2
    to_explain = 0.0
    for slope, y in zip(design, observed, strict=True):
        a = free @ slope
        keep = np.ones(len(y), bool)
        for _ in range(3):
            own = np.linalg.solve(a[:, keep] @ a[:, keep].T + 1e-6 * prior, a[:, keep] @ y[keep])
            left = y - own @ a
            keep = np.abs(left) < OUTLIER * sigma_by_median(left[keep]) + 1e-9
        per = 1 / max(float(np.mean(left[keep] ** 2)), 1e-9)
        to_explain += len(y) * float(np.log(np.median(np.square(y)) + 1e-9))
        normal += per * a[:, keep] @ a[:, keep].T
        right += per * a[:, keep] @ y[keep]
    own = np.linalg.solve(normal + prior, right)
    change, chance = own @ free, size + SIGNIFICANT * np.sqrt(2 * size)
    significant = bool(own @ normal @ own > chance and np.abs(change).max() > SLIGHT)
    return change, significant, to_explain / sum(len(y) for y in observed)


def _both(values: NDArray[np.complex128]) -> tuple[Array, Array]:
    return values.real, values.imag


def _beside(rows: Array, aside: Array) -> Array:
    """Rows (k, n) without what the rows `aside` explain."""
    return rows - np.linalg.lstsq(aside.T, rows.T, rcond=None)[0].T @ aside if len(aside) else rows


def _without_mean(values: Array, block: NDArray[np.intp]) -> Array:
    count = np.maximum(np.bincount(block), 1)
    return np.array([row - (np.bincount(block, row) / count)[block] for row in values])
