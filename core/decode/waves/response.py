"""The projector's response, and what it makes of sine fringes: how their phases are straightened."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from core.decode.frames import PhaseFrames, SortedFrames
from core.decode.tables import AxisTable, Singles
from core.decode.waves.curves import HIGHEST, LEVELS, PARAMETERS, both_sides, dimming, light_of, waves
from core.decode.waves.harmonics import GRID, STRAIGHT, bend_of, correction
from core.lazy import dataclass
from core.model import Array
from core.patterns import Axis, grey_reason

Terms = NDArray[np.complex128]

STEP = 1e-3  # of a parameter, for differences
LARGEST = 0.5  # change of a parameter in one round
TURNS = (np.arange(GRID) + 0.5) / GRID - 0.5
SHADED = 0.05  # amplitudes by which the steps that tell a phase are brighter than all; less is not worth it
HARMONICS = 12  # of a wave that count
STEEP = 1.5  # squared slope of the straightening from which all periods are fitted together


@dataclass(frozen=True, eq=False)
class Wave:
    """Fringes of one period: which axis' how manieth, its frames, and their sum to cosine plus i sine part."""

    axis: int
    number: int
    frames: PhaseFrames
    both: Terms

    def seen(self, sample: Singles) -> Terms:
        """Cosine plus i sine part in every pixel of a sample, float32 (frames, n)."""
        # not by matrix product, see `tables.sums_of`
        return np.asarray(np.einsum("f,fn->n", self.both.astype(np.complex64), sample[list(self.frames.frames)]))

    def spectrum(self, response: Response) -> Terms:
        """What these frames make of cosine plus i sine, by harmonic from -HIGHEST to HIGHEST."""
        shown = waves(self.frames.patterns, self.frames.period, response.table).copy()
        shown[:, HARMONICS + 1 :] = 0  # of long periods those that whole lines make, which blur has taken away
        return self.both @ both_sides(shown * dimming(self.frames.period, response.blur[self.axis]))


@dataclass(frozen=True)
class Response:
    """A curve, the blur of both axes, and how whole fields compare with fringes.

    `values` are the curve's parameters, the logarithms of the blur (lines²) of axis x and y, the light of a dark field,
    and by how much that of a lit one differs from the fringes'; `normal` is the inverse of their covariance.
    """

    values: Array
    normal: Array

    @cached_property
    def table(self) -> Array:
        """Light at the levels `core.decode.waves.curves.LEVELS`."""
        return light_of(self.values[:PARAMETERS])

    @property
    def blur(self) -> Array:
        """Variance of the blur of axis x and y in lines²."""
        return np.exp(self.values[PARAMETERS : PARAMETERS + 2])

    @property
    def straight(self) -> Response:
        """The same blur and fields of a projector without a curve."""
        return Response(np.concatenate([np.zeros(PARAMETERS), self.values[PARAMETERS:]]), self.normal)

    def moved(self, k: int) -> Response:
        """The same with one value changed by `STEP`."""
        values = self.values.copy()
        values[k] += STEP
        return Response(values, self.normal)


def waves_of(frames: SortedFrames) -> tuple[tuple[Wave, ...], tuple[Wave, ...]]:
    """All periods of sine fringes, of which a response makes something else, and of square ones."""
    axes: tuple[Axis, Axis] = ("x", "y")
    sines: list[Wave] = []
    squares: list[Wave] = []
    for a, axis in enumerate(axes):
        for j, phase in enumerate(frames.axes[axis].phases if axis in frames.axes else ()):
            shift = np.array([p.shift_rad for p in phase.patterns])
            design = np.column_stack([np.ones(len(shift)), np.cos(shift), np.sin(shift)])
            if np.linalg.matrix_rank(design, tol=1e-6) == 3:
                _, c, s = np.linalg.pinv(design)
                (sines if grey_reason(phase.patterns[0]) else squares).append(Wave(a, j, phase, c + 1j * s))
    return tuple(sines), tuple(squares)


def straighten(
    tables: tuple[AxisTable, AxisTable], r: Response, all_waves: Sequence[Wave]
) -> tuple[AxisTable, AxisTable]:
    """Set how the phases of sine fringes are straightened, and where the middle between off and on is."""
    out = list(tables)
    covariance = np.linalg.inv(r.normal)
    for wave in all_waves:
        table = out[wave.axis]
        if len(table.period) == 0:
            continue
        straight = correction(wave.spectrum(r))
        values = [*range(PARAMETERS), PARAMETERS + wave.axis]
        slopes = np.array([correction(wave.spectrum(r.moved(k))) - straight for k in values]) / STEP
        unsure = np.einsum("kg,kl,lg->g", slopes, covariance[np.ix_(values, values)], slopes)
        slope = 1 + np.gradient(np.r_[straight[-1], straight, straight[0]], 1 / GRID)[1:-1]
        bends = table.bend.copy() if len(table.bend) else np.repeat(STRAIGHT[None], len(table.period), axis=0)
        bends[wave.number, 0] = bend_of(straight, slope, unsure)
        out[wave.axis] = table._replace(bend=bends)
    out = list(shade(out, all_waves, r))
    for axis, table in enumerate(out):
        mine = [wave for wave in all_waves if wave.axis == axis]
        if len(mine) > 0:
            out[axis] = table = table._replace(rest=_rests(mine, table, r))
        if len(mine) == len(table.period) > 0 and table.bend[..., 2].max() > STEEP:
            out[axis] = table._replace(joint=np.array([_shape(wave, r) for wave in mine], np.float32))
    return _lift(out[0], r, all_waves), _lift(out[1], r, all_waves)


def shade(
    tables: Sequence[AxisTable], all_waves: Sequence[Wave], r: Response | None = None
) -> tuple[AxisTable, AxisTable]:
    """Set how bright the steps are that tell the phase of sine fringes, see `AxisTable.shade`."""
    out = list(tables)
    for wave in all_waves:
        table, numbers = out[wave.axis], list(wave.frames.frames)
        at = slice(table.fits.first[wave.number], table.fits.first[wave.number] + len(numbers))
        if table.fits.frame[at].tolist() != numbers:
            continue
        light, z = _lights(wave, r)
        weight = np.square((z.conj() / np.abs(z) * wave.both[:, None]).imag)
        beyond = (light - table.fits.value[0, at] @ light) / np.abs(z)
        brighter = np.einsum("kg,kg->g", weight, beyond) / weight.sum(axis=0)
        if np.abs(brighter).max() > SHADED:
            found = table.shade.copy() if len(table.shade) else np.zeros((len(table.period), GRID), np.float32)
            found[wave.number] = np.interp(TURNS, np.angle(z) / (2 * np.pi), brighter, period=1.0)
            out[wave.axis] = table._replace(shade=found)
    x, y = out
    return x, y


def _lights(wave: Wave, r: Response | None) -> tuple[Array, Terms]:
    """Light of every step at `TURNS`, shape (steps, GRID), and the cosine plus i sine part seen there."""
    shown = waves(wave.frames.patterns, wave.frames.period, r.table if r else LEVELS).copy()
    shown[:, HARMONICS + 1 :] = 0
    if r:
        shown *= dimming(wave.frames.period, r.blur[wave.axis])
    light = (both_sides(shown) @ np.exp(2j * np.pi * np.outer(np.arange(-HIGHEST, HIGHEST + 1), TURNS))).real
    return light, wave.both @ light


def _rests(mine: Sequence[Wave], table: AxisTable, r: Response) -> Singles:
    """What the waves of an axis show beyond the fit of all steps, see `AxisTable.rest`."""
    found = np.zeros((len(table.period), table.hat.shape[1], GRID), np.float32)
    for wave in mine:
        numbers = list(wave.frames.frames)
        first = table.fits.first[wave.number]
        if table.fits.frame[first : first + len(numbers)].tolist() != numbers:
            continue
        light, z = _lights(wave, r)
        beyond = light - table.hat[wave.number, : len(numbers), : len(numbers)] @ light
        measured = np.angle(z) / (2 * np.pi)
        for out, step in zip(found[wave.number], beyond / np.abs(z), strict=False):
            out[:] = np.interp(TURNS, measured, step, period=1.0)
    return found


def _shape(wave: Wave, r: Response) -> Array:
    """What mean and amplitude of the steps are over the phase: see `AxisTable.joint`; shape (5, GRID)."""
    shown = waves(wave.frames.patterns, wave.frames.period, r.table)[:, : HARMONICS + 1]
    shown = shown * dimming(wave.frames.period, r.blur[wave.axis])[: HARMONICS + 1]
    both = both_sides(np.array([shown.mean(axis=0)]))[0], wave.both @ both_sides(shown)
    places = np.exp(2j * np.pi * np.outer(TURNS, np.arange(-HARMONICS, HARMONICS + 1)))
    slopes = 2j * np.pi * np.arange(-HARMONICS, HARMONICS + 1)
    mean, first = places @ both[0], places @ both[1]
    mean_slope, first_slope = places @ (slopes * both[0]), places @ (slopes * both[1])
    along = first / np.abs(first)
    change = first_slope * along.conj()
    return np.array([mean.real, np.abs(first), mean_slope.real, change.real, change.imag])


def _lift(table: AxisTable, r: Response, all_waves: Sequence[Wave]) -> AxisTable:
    """Put the threshold of a code, where it is the mean of the steps, to the middle between off and on."""
    mine = [w for w in all_waves if w.number == 0 and set(w.frames.frames) <= set(table.phase_frames.tolist())]
    start, middle, stop = table.rows.first[:3].tolist() if table.has_threshold else (0, 0, 0)
    used = set(table.rows.column[start:middle].tolist())
    if not mine or not used or not used <= {n for w in all_waves for n in w.frames.frames}:
        return table
    mean, first = waves(mine[0].frames.patterns, mine[0].frames.period, r.table)[0, :2]
    lift = (0.5 - float(mean.real)) / (2 * abs(first))
    # half the contrast is white less this threshold, or the threshold less black
    entries = zip(table.rows.column[middle:stop], table.rows.value[middle:stop], strict=True)
    fields = [value for n, value in entries if n not in used]
    side = -float(np.sign(sum(fields))) if fields else 0.0
    return table._replace(lift=np.float32(lift), contrast_lift=np.float32(side * lift))
