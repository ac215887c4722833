"""What a square wave shows besides its first harmonic, and how that bends the phase.

Few steps cannot tell the first harmonic from those that are one more or one less than a multiple of their number: the
phase of a sharp square wave is bent, by a third of a line where the period is 16 lines and there are four steps. How
strong the harmonics are follows from the blur, and that from the modulation: what it has lost of a sharp wave's, the
m-th harmonic has lost m² times, as a logarithm (the blur is taken as Gaussian, and as the same in the whole image).
Not every lens is so: phases are straightened only where they crowd as these harmonics would make them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from core.decode.curves import HIGHEST, LEVELS, both_sides, waves
from core.decode.noise import Noise
from core.decode.tables import AxisTable, Singles, sums_of
from core.patterns import Pattern, grey_reason, use_of

Array = NDArray[np.float64]
Spectrum = tuple[complex, ...]

GRID = 512  # places in a period
SLIGHT = 2e-4  # turns: less is not worth straightening
FEWEST = 100  # lit pixels that tell the blur
THINNED = 2  # so many times fewer pixels of the sample tell it as well
UNKNOWN = 0.15, 0.015  # part of the logarithm of the first harmonic's loss, and loss, by which the blur may be mistaken
ROUNDS = 4  # to the loss
STEPS = 500  # of the modulation, so that captures of a rig need not compute the bend anew
SEEN, SIGMAS = 0.25, 2.0  # part of the expected crowding that must show, and standard deviations beyond it
STRAIGHT = np.repeat(np.array([[0.0], [1.0], [0.0]], np.float32), GRID, axis=1)
STEEPEST = 4.0  # lines of place by lines of phase, from which a flat stretch of the phase tells nothing more


def spectra(patterns: Sequence[Pattern], table: AxisTable) -> tuple[Spectrum, ...]:
    """What the sharp waves of every period make of cosine plus i sine, by harmonic; empty for what has but one.

    Parameters
    ----------
    patterns : sequence of Pattern
        Of all frames.
    table : AxisTable

    Returns
    -------
    spectra : tuple of tuple of complex
        The term of harmonic m, at index m + HIGHEST, is the factor of ``exp(2 pi i m (u + 1/2) / P)`` at line u.
    """
    found = []
    for j, period in enumerate(table.period):
        entries = slice(table.fits.first[j], table.fits.first[j + 1])
        shown = [patterns[n] for n in table.fits.frame[entries]]
        square = any(use_of(p) == "phase" and grey_reason(p) is None for p in shown)
        if not square or abs(period - round(float(period))) > 1e-6:
            found.append(())
            continue
        both = table.fits.value[1, entries] + 1j * table.fits.value[2, entries]
        found.append(tuple((both @ both_sides(waves(shown, round(float(period)), LEVELS))).tolist()))
    return tuple(found)


def measure_bend(table: AxisTable, sharp: tuple[Spectrum, ...], sample: Singles, noise: Noise) -> AxisTable:
    """Set how the phase of every period is straightened, as far as the sample's contrast tells the blur.

    Parameters
    ----------
    table : AxisTable
    sharp : tuple of tuple of complex
        Of `spectra`.
    sample : float32 (frames, n)
        Grey values.
    noise : Noise
    """
    if not table.has_contrast or not any(len(spectrum) for spectrum in sharp):
        return table
    sample = sample[:, ::THINNED]
    threshold, contrast = islice(sums_of(table.rows, sample), 2)
    lit = np.flatnonzero(contrast > 5 * np.sqrt(noise.variance(threshold)))
    if len(lit) < FEWEST:
        return table
    bends = table.bend.copy() if len(table.bend) else np.repeat(STRAIGHT[None], len(sharp), axis=0)
    for j, spectrum in enumerate(sharp):
        if len(spectrum) == 0:
            continue
        entries = slice(table.fits.first[j], table.fits.first[j + 1])
        c, s = np.einsum("rf,fn->rn", table.fits.value[1:, entries], sample[table.fits.frame[entries]])[:, lit]
        light = np.sort(np.sqrt(c * c + s * s) / (2 * contrast[lit]))
        left = float(light[len(light) // 2])  # `np.median` takes ten times as long
        bend, density = _bend(spectrum, max(round(left * STEPS), 1) / STEPS)
        if density.any() and _is_seen(density, np.arctan2(s, c) / np.float32(2 * np.pi)):
            bends[j] = bend
    return table._replace(bend=bends) if bends[:, 0].any() else table


@lru_cache(maxsize=64)
def _bend(spectrum: Spectrum, left: float) -> tuple[Singles, Singles]:
    """How a wave is straightened the median of whose modulation is `left` of the light.

    Returns
    -------
    bend : float32 (3, GRID)
        Correction of the phase (turns), square of the slope, variance of the correction (turns²).
    density : float32 (GRID,)
        By how much more phases there are than in the mean, as a part of it.
    """
    terms, (part, least) = np.array(spectrum), UNKNOWN
    loss = _loss(terms, left)
    doubt = part * loss + least
    straight, sharper, softer = (correction(terms, max(each, 0.0)) for each in (loss, loss - doubt, loss + doubt))
    if np.abs(straight).max() < SLIGHT:
        return STRAIGHT, STRAIGHT[0]
    density = np.gradient(np.r_[straight[-1], straight, straight[0]], 1 / GRID)[1:-1]
    slope = np.clip(1 + density, 1 / STEEPEST, STEEPEST)
    bend = np.stack([straight, slope**2, ((sharper - softer) / 2) ** 2])
    return bend.astype(np.float32), density.astype(np.float32)


def _is_seen(density: Singles, turns: Singles) -> bool:
    """Whether phases crowd where such a bend would crowd them: not every lens dims harmonics as a Gaussian blur does.

    Phases of a scene are evenly spread; bent ones with a density of ``1 + d(correction)/d(phase)``.
    """
    strength = float(np.mean(density**2))
    at = np.minimum(((turns + np.float32(0.5)) * GRID).astype(np.intp), GRID - 1)
    share = float(np.mean(density[at])) / strength
    return share > SEEN + SIGMAS / np.sqrt(len(at) * strength)


def _loss(terms: NDArray[np.complex128], left: float) -> float:
    """Logarithm of the first harmonic's loss where the modulation's median is `left` of the light."""
    loss = 0.0
    for _ in range(ROUNDS):
        usual = float(np.median(np.abs(_wave(terms, loss))))
        loss = max(loss + float(np.log(usual / left)), 0.0)
    return loss


def _wave(terms: NDArray[np.complex128], loss: float) -> NDArray[np.complex128]:
    """Cosine plus i sine part over `GRID` places of a period."""
    m = np.arange(-HIGHEST, HIGHEST + 1)
    placed = np.zeros(GRID, complex)
    placed[m] = terms * np.exp(-loss * m**2)
    return np.asarray(GRID * np.fft.ifft(placed))


def correction(terms: NDArray[np.complex128], loss: float = 0.0) -> NDArray[np.float64]:
    """True minus measured phase (turns) at the middles of `GRID` equal parts of a turn from -1/2 to 1/2."""
    true = np.arange(GRID) / GRID
    seen = np.unwrap(np.angle(_wave(terms, loss))) / (2 * np.pi)
    seen += np.round(true[0] - seen[0])
    seen, true = (np.concatenate([a - 1, a, a + 1]) for a in (np.maximum.accumulate(seen), true))
    at = (np.arange(GRID) + 0.5) / GRID - 0.5
    return np.asarray(np.interp(at, seen, true) - at)
