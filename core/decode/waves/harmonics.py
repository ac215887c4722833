"""What a square wave shows besides its first harmonic, and how that bends the phase.

Few steps cannot tell the first harmonic from those that are one more or one less than a multiple of their number: the
phase of a sharp square wave is bent, by a third of a line where the period is 16 lines and there are four steps. Sharp
waves even stand still over lines, and no phase tells where in them a pixel lies. How strong the harmonics are depends
on the blur. It shows in the first harmonic's amplitude, which then changes with the phase, in how phases crowd, and in
what is left of the contrast of white and black; but not every lens dims harmonics as a Gaussian blur does. So every
blur of a family counts by how well it explains a sample: the phase is straightened by their mean, and what they leave
open is part of its variance. What a noisy phase tells of its place is less than what a clear one does, so pixels are
straightened by their own noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, lru_cache
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from core.decode.noise import Noise
from core.decode.tables import AxisTable, Singles, sums_of
from core.decode.waves.curves import HIGHEST
from core.lazy import dataclass
from core.model import Array
from core.numerics import ranked
from core.patterns import Pattern, brightness, grey_reason, use_of

Terms = NDArray[np.complex128]

GRID = 512  # places in a period
PLACES = 2048  # of a wave, at least
LONGEST = 512  # lines after which waves of no whole number of lines are taken to repeat
WIDTHS = 0.12 * 1.12 ** np.arange(26)  # lines, blur of a family
SHAPES = {1.3: 0.07, 1.6: 0.17, 2.0: 0.5, 2.5: 0.17, 3.2: 0.07}  # exponent of the frequency, and how usual it is
USUAL = -0.8, 0.9  # logarithm of the blur's variance (lines²): what is usual, and how much rigs differ
SINE = 0.02  # how usual a lens is that passes nothing but the first harmonic
BINS = 128  # of the phase, in which a sample is looked at
PARTS = 3  # of the image in either direction, each of a blur of its own
UNEVEN = 4.0  # times chance, from which the crowding of phases is the scene's
UNLIKELY = 0.03  # of the mean density, there are phases everywhere
CONTRAST = 0.15  # part by which fringes may have another contrast than white and black
MISFIT = 0.02, 0.1  # part of amplitude and of density by which the family may miss
FAR = 4.0  # 80th percentiles of how far the amplitude is from the median, beyond which a pixel tells nothing
FEWEST = 100  # lit pixels that tell the blur
DIM = 0.1  # part of the brightest pixels' modulation that one must have
SLIGHT = 2e-4  # turns: less is not worth straightening
NOISES: Array = 2.0 ** np.arange(-10, -3.0)  # turns, of a phase; pixels take the nearest
STEEPEST = 4.0  # lines of place by lines of phase, from which a flat stretch of the phase tells nothing more


@dataclass(frozen=True, eq=False)
class SquareWave:
    """Square fringes of one period: the axis' how manieth, and what the frames that are fitted make of every line."""

    number: int
    period: float
    sharp: Terms

    @cached_property
    def family(self) -> Family:
        """Of every blur, what a wave seen through it shows."""
        return _family(self.sharp.tobytes(), self.period)  # the axes mostly show the same

    @lru_cache(maxsize=8)  # noqa: B019  a wave lives as long as its sequence
    def binned(self, octave: int) -> tuple[Array, Array]:
        """Density and logarithm of the amplitude in bins of the phase, (models, BINS), by noise of 2^octave turns."""
        density, _, _, amplitude = (_blurred(each, 2.0**octave) for each in self.family.sums)
        density, amplitude = (each.reshape(len(each), BINS, -1).sum(axis=2) for each in (density, amplitude))
        share = np.maximum(density * BINS, 0) + UNLIKELY
        return share / share.sum(axis=1, keepdims=True), amplitude / np.maximum(density, 1e-9)


@dataclass(frozen=True, eq=False)
class Family:
    """Of every blur: how usual it is, and sums over all places by the phase seen there.

    `sums` (4, models, GRID) are parts of the places, those times true minus seen phase (turns), times its square, and
    times the logarithm of the amplitude.
    """

    prior: Array
    sums: Array


def square_waves(patterns: Sequence[Pattern], table: AxisTable) -> tuple[SquareWave, ...]:
    """All periods of an axis whose steps are square waves."""
    found = []
    for j, period in enumerate(table.period.tolist()):
        entries = slice(table.fits.first[j], table.fits.first[j + 1])
        shown = [patterns[n] for n in table.fits.frame[entries]]
        if any(use_of(p) == "phase" and grey_reason(p) is None for p in shown):
            lines = np.arange(_repeat(period))
            both = table.fits.value[1, entries] + 1j * table.fits.value[2, entries]
            found.append(SquareWave(j, period, both @ np.array([brightness(p, lines) for p in shown])))
    return tuple(found)


def _repeat(period: float) -> int:
    """Lines after which a wave of whole lines is the same again, or nearly so."""
    cycles = period * np.arange(1, max(2, int(LONGEST / period)))
    return round(float(cycles[np.argmin(np.abs(cycles - np.round(cycles)).round(4))]))


@lru_cache(maxsize=16)
def _family(sharp: bytes, period: float) -> Family:
    light = np.frombuffer(sharp, complex)
    lines = len(light)
    fine = -(-PLACES // lines)
    terms = np.fft.fft(np.repeat(light, fine))
    frequency = np.abs(np.fft.fftfreq(lines * fine, 1 / fine))
    terms[frequency > HIGHEST / period + 0.5 / lines] = 0
    frequency[0] = 1e-9
    place = (np.arange(lines * fine) + 0.5) / (fine * period)
    there = np.flatnonzero(terms)
    passed = [np.exp(-((np.sqrt(2) * np.pi * w * frequency[there]) ** q)) for q in SHAPES for w in WIDTHS]
    first = np.abs(np.fft.fftfreq(lines * fine, 1 / fine) * period - 1) < 0.5 * period / lines
    waves = np.zeros((len(passed) + 1, len(terms)), complex)
    waves[:, there] = terms[there] * np.array([*passed, first[there]])
    waves = np.fft.ifft(waves)
    usual = np.exp(-0.5 * ((np.log(WIDTHS**2) - USUAL[0]) / USUAL[1]) ** 2)
    prior = np.concatenate([*(share * usual / usual.sum() for share in SHAPES.values()), [SINE]])
    seen = np.angle(waves) / (2 * np.pi)
    away = place - seen - np.rint(place - seen)
    at = np.minimum(((seen + 0.5) * GRID).astype(int), GRID - 1) + GRID * np.arange(len(waves))[:, None]
    parts = np.ones_like(away), away, away * away, np.log(np.abs(waves) + 1e-9)
    sums = np.array([np.bincount(at.ravel(), part.ravel(), at.shape[0] * GRID) for part in parts])
    sums = sums.reshape(4, -1, GRID) / waves.shape[1]
    return Family(prior, sums)


def _blurred(rows: Array, turns: Array | float) -> Array:
    """Rows over the phase, as phases of so much noise (turns) show them; the last axis but one is the noise's."""
    noise = np.exp(-2 * (np.pi * np.multiply.outer(turns, np.arange(GRID // 2 + 1))) ** 2)
    terms = np.fft.rfft(rows) * noise
    return np.asarray(np.fft.irfft(terms, GRID))


def measure_bend(
    table: AxisTable,
    waves: Sequence[SquareWave],
    sample: Singles,
    places: Array,
    noise: Noise,
    saturation: float,
) -> AxisTable:
    """Set how the phase of every square wave is straightened, and how uncertain that is.

    From a sample (frames, n) of the grey values, at x and y from -1 to 1, `places` (2, n); from `saturation` on a step
    tells nothing.
    """
    if not waves:
        return table
    threshold, contrast = islice(sums_of(table.rows, sample), 2)
    bends = table.bend if len(table.bend) else np.repeat(STRAIGHT[None], len(table.period), axis=0)
    bends = np.repeat(bends, len(NOISES), axis=1)
    column, row = np.minimum(((places + 1) * (PARTS / 2)).astype(np.int8), PARTS - 1)
    block = row * np.int8(PARTS) + column
    fields = table.rows.column[: table.rows.first[2]]
    cut = np.any(sample[fields] >= saturation, axis=0)  # white is saturated before the steps
    for wave in waves:
        entries = slice(table.fits.first[wave.number], table.fits.first[wave.number + 1])
        mean, c, s = np.einsum("rf,fn->rn", table.fits.value[:, entries], sample[table.fits.frame[entries]])
        amplitude = np.sqrt(c * c + s * s)  # hypot takes ten times as long
        spread = np.sqrt(noise.variance(mean) * table.covariance[wave.number, 0])
        lit = (amplitude > DIM * ranked(amplitude, 0.9)) & (amplitude > 5 * spread)
        lit &= sample[table.fits.frame[entries]].max(axis=0) < saturation
        absolute = table.has_contrast
        light = 2 * contrast if absolute else threshold if table.has_threshold else mean
        if 2 * np.count_nonzero(cut & lit) > np.count_nonzero(lit):
            light, absolute = mean, False
        else:
            lit &= ~cut
        lit &= light > 0
        weight = wave.family.prior
        if lit.sum() >= FEWEST:
            turns = float(np.sqrt(np.mean((spread[lit] / amplitude[lit]) ** 2))) / (2 * np.pi)
            seen = np.arctan2(s[lit], c[lit]) / (2 * np.pi)
            part = np.log(amplitude[lit] / light[lit])
            usual = _usual(part, block[lit])
            binned = wave.binned(int(np.clip(np.rint(np.log2(max(turns, 1e-6))), -12, -4)))
            sight = seen[usual], part[usual], block[lit][usual]
            weight = _weights(wave.family.prior, binned, *sight, absolute)
        bends[wave.number] = _bend(wave.family, weight)
    return table._replace(bend=bends) if np.abs(bends[..., 0]).max() > SLIGHT else table


def _usual(part: Singles, block: NDArray[np.int8]) -> NDArray[np.bool_]:
    """Where the amplitude is not far from its part of the image: at rims of light and surface it is anything."""
    usual = np.ones(len(part), bool)
    for b in range(PARTS * PARTS):
        at = np.flatnonzero(block == b)
        if len(at):
            off = np.abs(part[at] - ranked(part[at], 0.5))
            usual[at] = off <= FAR * ranked(off, 0.8)
    return usual


def _weights(
    prior: Array, binned: tuple[Array, Array], seen: Singles, part: Singles, block: NDArray[np.int8], absolute: bool
) -> Array:
    """How likely every blur of the family is somewhere in the image, each part of which tells for itself.

    By phases (turns) and the amplitudes' logarithms, which are `absolute` or not. What no blur explains - scenes have
    some phases more often, and textures of their own - makes both count less.
    """
    density, amplitude = binned
    at = np.minimum(((seen + np.float32(0.5)) * BINS).astype(np.intp), BINS - 1) + np.intp(BINS) * block
    size = PARTS * PARTS * BINS
    count = np.bincount(at, minlength=size).reshape(-1, BINS).astype(float)
    mean = np.bincount(at, part, size).reshape(-1, BINS) / np.maximum(count, 1)
    within = float(np.mean(np.square(part - mean.ravel()[at])))
    total = count.sum(axis=1)
    # (count - expected)² by its variance, which is that of the mean part of the image
    expected = density * (len(part) / np.count_nonzero(total))
    per = 1 / (expected + (MISFIT[1] * expected) ** 2)
    crowd = _times(count**2, per) - 2 * _times(count, density * per) * total + _times(1.0, density**2 * per) * total**2
    # not by matrix product, see `tables.sums_of`
    weight = np.where(count > 0, 1 / (within / np.maximum(count, 1) + MISFIT[0] ** 2), 0)
    level = (weight * mean).sum(axis=1) - _times(weight, amplitude)
    light = (weight * mean**2).sum(axis=1) - 2 * _times(weight * mean, amplitude) + _times(weight, amplitude**2)
    light -= level**2 / (weight.sum(axis=1) + (1 / CONTRAST**2 if absolute else 1e-9))
    uneven, own = (np.maximum(each.min(axis=0) / BINS, 1.0) for each in (crowd, light))
    likelihood = -0.5 * (crowd / uneven * (uneven < UNEVEN) + light / own)
    likely = prior[:, None] * np.exp(likelihood - likelihood.max(axis=0))
    return np.asarray((likely / likely.sum(axis=0)) @ total)


def _times(rows: Array | float, models: Array) -> Array:
    """Sums over the bins, shape (models, rows)."""
    return np.einsum("mb,rb->mr", models, np.broadcast_to(rows, (np.shape(rows)[0] if np.ndim(rows) else 1, BINS)))


def _bend(family: Family, weight: Array) -> Singles:
    """By noise of the phase: its correction (turns), square of its slope, variance (turns²) of the correction."""
    some = weight > 1e-4 * weight.max()
    total, first, second = _blurred(np.einsum("k,skg->sg", weight[some], family.sums[:3, some])[:, None], NOISES)
    known = total > 1e-6 * total.max(axis=1, keepdims=True)
    straight = first / np.where(known, total, 1.0)
    for row, here in zip(straight, known, strict=True):
        if not here.all():
            row[:] = np.interp(np.arange(GRID), np.flatnonzero(here), row[here], period=GRID)
    unsure = np.where(known, second / np.maximum(total, 1e-12) - straight**2, 1 / GRID)
    slope = 1 + (np.roll(straight, -1, axis=1) - np.roll(straight, 1, axis=1)) * (GRID / 2)
    slope = np.clip(slope, 1 / STEEPEST, STEEPEST)
    return bend_of(straight, slope, np.maximum(unsure - (NOISES[:, None] * slope) ** 2, 0))


def bend_of(straight: Array, slope: Array, variance: Array) -> Singles:
    """Tabulate how phases are straightened, see `AxisTable.bend`: corrections (turns), slopes, variances (turns²)."""
    bend = np.empty((*straight.shape[:-1], GRID + 1, 4), np.float32)
    bend[..., 1:, 0], bend[..., 1:, 1] = straight, np.roll(straight, -1, axis=-1) - straight
    bend[..., 1:, 2], bend[..., 1:, 3] = np.square(np.clip(slope, 1 / STEEPEST, STEEPEST)), variance
    bend[..., 0, :] = bend[..., -1, :]
    return bend


STRAIGHT = bend_of(np.zeros(GRID), np.ones(GRID), np.zeros(GRID))[None]


def correction(terms: Terms) -> Array:
    """True minus measured phase (turns) at the middles of `GRID` equal parts of a turn from -1/2 to 1/2.

    `terms` are those of cosine plus i sine, by harmonic from -HIGHEST to HIGHEST.
    """
    placed = np.zeros(GRID, complex)
    placed[np.arange(-HIGHEST, HIGHEST + 1)] = terms
    true = np.arange(GRID) / GRID
    seen = np.unwrap(np.angle(GRID * np.fft.ifft(placed))) / (2 * np.pi)
    seen += np.round(true[0] - seen[0])
    seen, true = (np.concatenate([a - 1, a, a + 1]) for a in (np.maximum.accumulate(seen), true))
    at = (np.arange(GRID) + 0.5) / GRID - 0.5
    return np.asarray(np.interp(at, seen, true) - at)
