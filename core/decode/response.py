"""The projector's response, found in the frames of a capture.

Of every pixel of a sample the ambient light, the gain and the phases are unknown; of all of them together the curve's
parameters, the blur of each axis and how the light of whole fields compares with that of fringes. Least squares over
all frames: harmonics show in more than three steps, in the light of whole fields, bits and other periods against that
of the steps, and in the gain that several periods share. What that leaves open - four steps see no difference of the
third and fifth harmonic - shows in the crowding of the phases over the scene: bent phases are denser where the phase
runs slowly. How uneven the scene's own phases are is seen in harmonics that the steps cannot bend.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from core.decode.curves import HIGHEST, PARAMETERS, SPREAD, both_sides, dimming, light_at, light_of, waves
from core.decode.frames import Image, PhaseFrames, SortedFrames
from core.decode.harmonics import GRID, STEEPEST, STRAIGHT, correction
from core.decode.tables import AxisTable, Singles
from core.patterns import Axis, Pattern, grey_reason, level_of, use_of

Array = NDArray[np.float64]
Terms = NDArray[np.complex128]

PIXELS = 900  # of the sample that tell the curve
FIRST = 250  # that tell if it is worth looking for
FEWEST = 100  # pixels, fewer tell nothing
ROUNDS = 12
STEP = 1e-3  # of a parameter, for differences
LARGEST = 0.5  # change of a parameter in one round
MISFIT = 0.005  # part of a pixel's light by which fringes may differ from the model without noise
FIELD = 0.03  # the same for whole fields and bits, whose scattered light is another
BLUR = -0.8, 0.7  # logarithm of the blur's variance (lines²): what is usual, and how much rigs differ
HARMONICS = 12  # of a wave that count
OUTLIER = 9.0  # mean square of a pixel's residuals from which it counts less
HALFWAY = 0.15  # part of a bit's light beyond which it is at an edge
STEEP = 1.5  # squared slope of the straightening from which all periods are fitted together
DIM = 0.1  # part of the brightest pixels' modulation that one must have
LEAST = 1.0  # grey value, modulation
SIGNIFICANT = 30.0  # twice the logarithm of the likelihood by which a curve must explain more than a straight line
WORTH = 12.0  # the same at the first look; without a curve it is 5 in the mean
SETTLED = 0.05  # standard deviations squared of the last change
CROWDED = 2  # rounds
CROWD = 40000  # pixels whose phases' density is looked at
MULTIPLES = 2  # of the number of steps, harmonics of the phases' density that are looked at
NEIGHBOURS = 4  # harmonics on either side that tell how uneven the scene is


@dataclass(frozen=True, eq=False)
class Wave:
    """Sine fringes of one period: which axis' how manieth, its frames, and their sum to cosine plus i sine part."""

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
        """Light at the levels `core.decode.curves.LEVELS`."""
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


def sine_waves(frames: SortedFrames) -> tuple[Wave, ...]:
    """All periods of sine fringes, of which a response makes something else."""
    axes: tuple[Axis, Axis] = ("x", "y")
    found = []
    for a, axis in enumerate(axes):
        for j, phase in enumerate(frames.axes[axis].phases if axis in frames.axes else ()):
            shift = np.array([p.shift_rad for p in phase.patterns])
            design = np.column_stack([np.ones(len(shift)), np.cos(shift), np.sin(shift)])
            if grey_reason(phase.patterns[0]) and np.linalg.matrix_rank(design, tol=1e-6) == 3:
                _, c, s = np.linalg.pinv(design)
                found.append(Wave(a, j, phase, c + 1j * s))
    return tuple(found)


class _Model:
    """The sample's pixels with their unknowns, and what the frames would show."""

    def __init__(
        self, all_waves: tuple[Wave, ...], patterns: Sequence[Pattern], sample: Singles, top: float, pixels: int
    ) -> None:
        sample = sample[:, :: max(1, sample.shape[1] // (4 * pixels))]
        self.waves = all_waves
        fringes = [n for wave in all_waves for n in wave.frames.frames]
        fields = [n for n, p in enumerate(patterns) if use_of(p) == "level"]
        shown = sample[fringes].astype(float)
        codes = [] if fields else [n for n, p in enumerate(patterns) if use_of(p) == "code"]
        self.levels = np.array([level_of(patterns[n]) for n in fields], float)
        if codes:
            bits = np.sort(sample[codes].astype(float), axis=0)
            off, on = bits[0], bits[-1]
            part = (bits - off) / np.maximum(on - off, LEAST)
            clear = np.all((part < HALFWAY) | (part > 1 - HALFWAY), axis=0)
            lit = part > 0.5
            on = (bits * lit).sum(axis=0) / np.maximum(lit.sum(axis=0), 1)
            off = (bits * ~lit).sum(axis=0) / np.maximum((~lit).sum(axis=0), 1)
            seen = np.vstack([shown, on, off])
            self.levels = np.array([1.0, 0.0])
        else:
            seen = np.vstack([shown, sample[fields]])
        group = [j for j, wave in enumerate(all_waves) for _ in wave.frames.frames]
        self.member = np.zeros((len(seen), len(all_waves)))
        self.member[np.arange(len(group)), group] = 1
        self.fringes = len(group)
        # start: as if the projector were linear
        quadratures = np.array([wave.seen(sample) for wave in all_waves])
        amplitude = np.abs(quadratures)
        dimmest = amplitude.min(axis=0)
        good = (seen.max(axis=0) < top) & (dimmest > DIM * np.percentile(dimmest, 90)) & (dimmest > LEAST)
        if codes and (good & clear).sum() >= FEWEST:
            good &= clear
        where = np.flatnonzero(good)
        where = where[:: max(1, len(where) // pixels)]
        self.size = len(where)
        self.seen = seen[:, where].T  # (n, F)
        self.phase = np.angle(quadratures[:, where]).T  # (n, J)
        self.gain, self.ground = np.ones(self.size), np.zeros(self.size)
        self.solved = np.zeros(0)

    def terms(self, r: Response) -> Terms:
        """Terms of every frame over the phase, shape (F, HARMONICS + 1); of whole fields only the first."""
        return _terms(self.waves, self.levels, r)

    def slopes(self, r: Response) -> tuple[Terms, Terms]:
        """The terms, and their changes by every value of the response, shape (values, F, HARMONICS + 1)."""
        if r.values.tobytes() == _START:  # every look begins with the same
            return _first_slopes(self.waves, tuple(self.levels))
        return _slopes(self.waves, self.levels, r)


_START = np.concatenate([np.zeros(PARAMETERS), [BLUR[0], BLUR[0], 0.0, 0.0]]).tobytes()


def _terms(all_waves: tuple[Wave, ...], levels: Array, r: Response) -> Terms:
    found = np.zeros((sum(len(w.frames.frames) for w in all_waves) + len(levels), HARMONICS + 1), complex)
    at = 0
    for wave in all_waves:
        each = waves(wave.frames.patterns, wave.frames.period, r.table)
        each = each * dimming(wave.frames.period, r.blur[wave.axis])
        found[at : at + len(each)] = each[:, : HARMONICS + 1]
        at += len(each)
    light, (dark, more) = light_at(r.table, levels), r.values[-2:]
    found[at:, 0] = dark * (1 - light) + (1 + more) * light
    return found


def _slopes(all_waves: tuple[Wave, ...], levels: Array, r: Response) -> tuple[Terms, Terms]:
    terms = _terms(all_waves, levels, r)
    moved = [_terms(all_waves, levels, r.moved(k)) for k in range(len(r.values))]
    return terms, (np.array(moved) - terms) / STEP


@lru_cache(maxsize=16)
def _first_slopes(all_waves: tuple[Wave, ...], levels: tuple[float, ...]) -> tuple[Terms, Terms]:
    return _slopes(all_waves, np.array(levels), Response(np.frombuffer(_START), np.zeros((0, 0))))


def estimate_response(
    all_waves: tuple[Wave, ...],
    patterns: Sequence[Pattern],
    sample: Singles,
    saturation: float,
    images: Sequence[Image],
) -> Response | None:
    """Find the projector's response in a sample of the grey values.

    Parameters
    ----------
    all_waves : tuple of Wave
        Of `sine_waves`.
    patterns : sequence of Pattern
        Of all frames.
    sample : float32 (frames, n)
        Grey values.
    saturation : float
        Grey value from which a pixel is saturated.
    images : sequence of arrays (H, W)
        For more pixels, where the crowding of the phases must tell.

    Returns
    -------
    response : Response, optional
        None where there are no sine fringes or too few pixels see them.
    """
    if not all_waves:
        return None
    turns = _turns(all_waves, sample, saturation)
    first = _Model(all_waves, patterns, sample, saturation, FIRST)
    if first.size < FEWEST:
        return None
    crowds = [_Crowd(wave, each) for wave, each in zip(all_waves, turns, strict=True)]
    looked = _search(first, crowds)
    if looked is None or _significance(*_explained(crowds, looked)) < WORTH:
        return None
    found = _search(_Model(all_waves, patterns, sample, saturation, PIXELS))
    assert found is not None
    phases = _phases(images, all_waves, saturation)
    values, normal = _explained([_Crowd(wave, each) for wave, each in zip(all_waves, phases, strict=True)], found)
    return Response(values, normal) if _significance(values, normal) > SIGNIFICANT else None


def _search(model: _Model, crowds: Sequence[_Crowd] = ()) -> Response | None:
    """Least squares over all frames; with `crowds`, None where neither they nor the first round show a curve."""
    start = np.frombuffer(_START)
    prior = np.diag(np.concatenate([SPREAD, [BLUR[1], BLUR[1], FIELD, FIELD]]) ** -2.0)
    found = Response(start, prior)
    for k in range(ROUNDS):
        normal, right = _reduced(model, found, first=k == 0)
        right -= prior @ (found.values - start)
        normal += prior
        change = np.asarray(np.linalg.solve(normal, right), float)
        nothing = k == 0 and crowds and _significance(change, normal) < WORTH
        change *= min(1.0, LARGEST / np.abs(change).max())
        _follow(model, change)
        found = Response(found.values + change, normal)
        if nothing and not _crowded(crowds, found.straight):
            return None
        if change @ normal @ change < SETTLED:
            break
    return found


def _significance(values: Array, normal: Array) -> float:
    """By how much a curve explains more than the straight line, which has parameters of 0; as chi squared."""
    curve = slice(0, PARAMETERS)
    return float(values[curve] @ np.linalg.solve(np.linalg.inv(normal)[curve, curve], values[curve]))


def _phases(images: Sequence[Image], all_waves: Sequence[Wave], saturation: float) -> Array:
    """Phases (turns) of all periods in many pixels, as if the projector were linear, shape (J, n)."""
    height, width = images[0].shape
    step = max(1, int(np.sqrt(height * width / CROWD)))
    some = {n: images[n][step // 2 :: step, step // 2 :: step].ravel() for w in all_waves for n in w.frames.frames}
    return _turns(all_waves, some, saturation)


def _turns(all_waves: Sequence[Wave], shown: Mapping[int, NDArray] | Singles, saturation: float) -> Array:
    """Phases (turns) of all periods in those pixels, given by frame, that see all of them well."""
    found, good = [], np.array(True)
    for wave in all_waves:
        grey = np.stack([shown[n] for n in wave.frames.frames]).astype(np.float32)
        z = np.einsum("f,fn->n", wave.both.astype(np.complex64), grey)
        amplitude = np.abs(z)
        good = good & (grey.max(axis=0) < saturation) & (amplitude > max(DIM * np.percentile(amplitude, 90), LEAST))
        found.append(z)
    return np.asarray(np.angle(np.array(found)[:, good]) / (2 * np.pi), float)


def _reduced(model: _Model, r: Response, first: bool = False) -> tuple[Array, Array]:
    """Normal equations of the common unknowns, those of the pixels eliminated; remembers how these follow."""
    double = np.full(HARMONICS + 1, 2.0)
    double[0] = 1.0
    powers = np.exp(1j * model.phase.T[:, :, None] * np.arange(HARMONICS + 1))  # (J, n, M + 1)
    rows = [np.flatnonzero(column) for column in model.member.T]

    def shown(t: Terms) -> Array:
        light = np.tile(t[:, 0].real, (model.size, 1))
        for mine, power in zip(rows, powers, strict=True):
            light[:, mine] = (power @ (t[mine] * double).T).real
        return light

    terms, changes = model.slopes(r)
    light = shown(terms)
    if first:
        mean, grey = light.mean(axis=1, keepdims=True), model.seen.mean(axis=1, keepdims=True)
        away = light - mean
        gain = (away * (model.seen - grey)).sum(axis=1) / (away * away).sum(axis=1)
        model.gain = np.maximum(gain, LEAST)
        model.ground = grey[:, 0] - model.gain * mean[:, 0]
    gain = model.gain[:, None]
    residual = model.seen - model.ground[:, None] - gain * light
    slope = gain * shown(terms * 1j * np.arange(HARMONICS + 1))
    common = np.stack([gain * shown(change) for change in changes], axis=2)
    pixel = np.concatenate([np.ones((*light.shape, 1)), light[..., None], slope[..., None] * model.member], axis=2)
    fringe = np.arange(light.shape[1]) < model.fringes
    freedom = max(light.shape[1] - pixel.shape[2], 1) / light.shape[1]
    noise = max(float(np.median(np.square(residual[:, fringe]))) / 0.455 / freedom, 0.1)
    weight = 1 / (noise + np.square(np.where(fringe, MISFIT, FIELD) * gain))
    misfit = np.mean(weight * residual**2, axis=1)
    weight *= (1 / np.maximum(1.0, misfit / OUTLIER))[:, None]
    weighted = (weight[..., None] * pixel).transpose(0, 2, 1)
    inner, outer = weighted @ pixel, weighted @ common
    inner += 1e-9 * np.einsum("nii->ni", inner).max(axis=1)[:, None, None] * np.eye(inner.shape[1])
    right = weighted @ residual[..., None]
    model.solved = np.linalg.solve(inner, np.concatenate([outer, right], axis=2))
    flat, count = (weight[..., None] * common).reshape(-1, len(r.values)), len(r.values)
    full, free = flat.T @ common.reshape(-1, count), flat.T @ residual.ravel()
    beside = outer.reshape(-1, count).T @ model.solved.reshape(-1, count + 1)
    return full - beside[:, :-1], free - beside[:, -1]


def _follow(model: _Model, change: Array) -> None:
    """Change the pixels' unknowns as the common ones have changed."""
    own = model.solved[..., -1] - model.solved[..., :-1] @ change
    model.ground = model.ground + own[:, 0]
    model.gain = np.maximum(model.gain + own[:, 1], LEAST)
    model.phase = model.phase + np.clip(own[:, 2:], -0.5, 0.5)


def _crowded(crowds: Sequence[_Crowd], r: Response) -> bool:
    """Whether phases crowd beyond what the scene and `r` explain, at as many places of their period as steps."""
    for crowd in crowds:
        crowding, usual = (np.abs(each) ** 2 for each in crowd.densities(r))
        if crowding.max() > SIGNIFICANT / 2 * max(float(usual.mean()), 1 / crowd.count):
            return True
    return False


class _Crowd:
    """Harmonics of the density of a wave's phases (turns), whatever they are straightened by.

    A straightening is a table over `GRID` parts of a turn: sums over the phases of each part are enough.
    """

    def __init__(self, wave: Wave, turns: Array) -> None:
        self.wave, self.count = wave, max(len(turns), 1)
        steps = len({round(p.shift_rad, 6) for p in wave.frames.patterns})
        self.made = steps * np.arange(1, MULTIPLES + 1)  # harmonics that bending makes
        others = np.arange(max(2, steps - NEIGHBOURS), self.made[-1] + NEIGHBOURS + 1)
        self.others = others[others % steps != 0]  # of the same kind, that it does not
        at = np.minimum(((turns + 0.5) * GRID).astype(np.intp), GRID - 1)
        number = np.bincount(at, minlength=GRID)
        middle = (np.arange(GRID) + 0.5) / GRID - 0.5
        within = np.bincount(at, turns - middle[at], minlength=GRID) / np.maximum(number, 1)
        self.number, self.place = number, middle + within

    def densities(self, r: Response) -> tuple[Terms, Terms]:
        """Harmonics that bending makes, and the others, of the phases as a response straightens them."""
        first = np.exp(2j * np.pi * (self.place + correction(self.wave.spectrum(r))))
        power, found = self.number.astype(complex), np.zeros(int(self.others[-1]) + 1, complex)
        for k in range(1, len(found)):  # a power of a complex number takes many times as long
            power = power * first
            found[k] = power.sum() / self.count
        return found[self.made], found[self.others]


def _explained(crowds: Sequence[_Crowd], base: Response) -> tuple[Array, Array]:
    """Values of the response, and the inverse of their covariance, that explain the crowding of phases as well."""
    found = base
    for _ in range(CROWDED):
        found = _use_crowding(crowds, base, found)
    return found.values, found.normal


def _use_crowding(crowds: Sequence[_Crowd], base: Response, r: Response) -> Response:
    """Let the straightened phases be spread as evenly over their period as the scene allows; `base` is without."""
    full, right = base.normal.copy(), base.normal @ (base.values - r.values)
    for crowd in crowds:
        seen, others = crowd.densities(r)
        weight = 2 / max(float(np.mean(np.abs(others) ** 2)), 0.25 / crowd.count)
        slopes = np.zeros((len(r.values), len(seen)), complex)
        for k in (*range(PARAMETERS), PARAMETERS + crowd.wave.axis):
            slopes[k] = (crowd.densities(r.moved(k))[0] - seen) / STEP
        full += weight * (slopes @ slopes.conj().T).real
        right -= weight * (slopes @ seen.conj()).real
    change = np.linalg.solve(full, right)
    values = r.values + change * min(1.0, LARGEST / np.abs(change).max())
    return Response(values, full)


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
        bends[wave.number] = [straight, np.clip(slope, 1 / STEEPEST, STEEPEST) ** 2, unsure]
        out[wave.axis] = table._replace(bend=bends)
    for axis, table in enumerate(out):
        mine = [wave for wave in all_waves if wave.axis == axis]
        if len(mine) > 0:
            out[axis] = table = table._replace(rest=_rests(mine, table, r))
        if len(mine) == len(table.period) > 0 and table.bend[:, 1].max() > STEEP:
            out[axis] = table._replace(joint=np.array([_shape(wave, r) for wave in mine], np.float32))
    return _lift(out[0], r, all_waves), _lift(out[1], r, all_waves)


def _rests(mine: Sequence[Wave], table: AxisTable, r: Response) -> Singles:
    """What the waves of an axis show beyond the fit of all steps, see `AxisTable.rest`."""
    found = np.zeros((len(table.period), table.hat.shape[1], GRID), np.float32)
    turns = (np.arange(GRID) + 0.5) / GRID - 0.5
    places = np.exp(2j * np.pi * np.outer(np.arange(-HIGHEST, HIGHEST + 1), turns))
    for wave in mine:
        numbers = list(wave.frames.frames)
        first = table.fits.first[wave.number]
        if table.fits.frame[first : first + len(numbers)].tolist() != numbers:
            continue
        shown = waves(wave.frames.patterns, wave.frames.period, r.table).copy()
        shown[:, HARMONICS + 1 :] = 0
        light = (both_sides(shown * dimming(wave.frames.period, r.blur[wave.axis])) @ places).real
        beyond = light - table.hat[wave.number, : len(numbers), : len(numbers)] @ light
        z = wave.both @ light
        measured = np.angle(z) / (2 * np.pi)
        for out, step in zip(found[wave.number], beyond / np.abs(z), strict=False):
            out[:] = np.interp(turns, measured, step, period=1.0)
    return found


def _shape(wave: Wave, r: Response) -> Array:
    """What mean and amplitude of the steps are over the phase: see `AxisTable.joint`; shape (5, GRID)."""
    shown = waves(wave.frames.patterns, wave.frames.period, r.table)[:, : HARMONICS + 1]
    shown = shown * dimming(wave.frames.period, r.blur[wave.axis])[: HARMONICS + 1]
    both = both_sides(np.array([shown.mean(axis=0)]))[0], wave.both @ both_sides(shown)
    turns = (np.arange(GRID) + 0.5) / GRID - 0.5
    places = np.exp(2j * np.pi * np.outer(turns, np.arange(-HARMONICS, HARMONICS + 1)))
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
