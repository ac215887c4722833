"""From frames and plan to the small tables that drive the kernel.

Most of decoding is linear in the grey values: means and quadratures of the phase steps (least squares), thresholds,
the contrast of a code, the difference of a bit and its inverse, the evenly lit image. Each is one row of a sparse
matrix over the frames, so one kernel serves every set of frames.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.decode.frames import AxisFrames, Numbers, PhaseFrames, SortedFrames
from core.decode.plan import Plan, UsedCode
from core.lazy import dataclass
from core.model import Array
from core.numerics import distinct
from core.patterns import Phase, brightness

Singles = NDArray[np.float32]
Shorts = NDArray[np.int32]

NOTHING, PHASES, CODE, SWEEP, WORDS = range(5)  # where an axis' coordinate starts
NEGLIGIBLE = 1e-9
TOGETHER = 4  # frames that the kernel adds in one pass, for every pass over the sum costs more than a frame
TAIL = 0.05  # part of a light section's height below which light is not counted
RIM = 0.25  # of the finest period: as far as a blur that leaves its fringes visible reaches


class Rows(NamedTuple):
    """Sparse rows over the frames: entries first[r] to first[r + 1] - 1 of column and value make row r."""

    first: Shorts
    column: Shorts
    value: Singles


class Fits(NamedTuple):
    """Least squares of the periods: entries first[j] to first[j + 1] - 1, a multiple of `TOGETHER`, are period j's.

    `frame` (n,) are the frames, `value` (3, n) their coefficients in the mean, the cosine and the sine part.
    """

    first: Shorts
    frame: Shorts
    value: Singles


class Limits(NamedTuple):
    """Noise ``var(g) = max(dark + shot g, floor)`` (grey values²) and the thresholds of `DecodeOptions`.

    ``misfit m²``, m being the modulation, is by how much more the frames contradict each other: it counts for sigma,
    but is no noise that could hide what a pixel shows.
    """

    dark: np.float32
    shot: np.float32
    floor: np.float32
    snr: np.float32
    modulation: np.float32
    saturation: np.float32
    bit_margin: np.float32
    misfit: np.float32

    def variance(self, level: Singles) -> Singles:
        """Give the noise's variance at grey values, same shape."""
        return np.asarray(np.maximum(self.dark + self.shot * level, self.floor), np.float32)


class AxisTable(NamedTuple):
    """What the kernel needs to know about one axis.

    `rows` yields the threshold of the code, half its contrast, then every bit; `fits` the mean, cosine and sine part of
    each period. `covariance` (J, 3) holds the cofactors (cc, cs, ss) of the quadratures, `period` (J,) is in lines; so
    is `rim`, the width of the field's edge where fringes are cut. `steps` (S, J) are the integer combinations of
    phases, `step_period` (S,) theirs, `step_error` (S, J) the
    squares that propagate the phases' variances (cycles²) to what a step must round. Of each bit: `sign` times the
    threshold is added, `spread` is its variance per frame's variance, `fading` its contrast relative to the coarse
    bits; `least_contrast` is the least contrast as a part of the threshold. Of a sweep: frames, centres, how far
    around the brightest the light is counted, and the standard deviation (lines) that its discrete lines cause.
    `bend` (J, levels of noise, 1 + places of a turn, 4) straightens phases: what is added (turns), by how much the next
    place's differs, the square of the slope, and the variance (turns²); the last place stands before the first, too.
    `joint` (J, 5, places of a turn), where bent waves are worth it, are the mean of the steps and the amplitude of
    their first harmonic over the phase, as parts of full light, the changes of both by the phase (turns), and the
    amplitude times the change of the measured phase; `mean_cofactor` (J,) is the mean's.
    `hat` (J, K, K) leads from the grey values of a period's entries in `fits` to those fitted; `rest` (J, K, places of
    a turn) is what bent waves show beyond that over the measured phase, as parts of the amplitude.
    `shade` (J, places of a turn), where it matters, says over the measured phase by how many amplitudes the steps that
    tell the phase are brighter than their mean: of three steps a phase is noisier where the bright ones tell it.
    `lift` and `contrast_lift` times the modulation are added to the code's threshold and half contrast: where these
    come from the mean of sine steps, a projector's response puts that off the middle.
    """

    start: int
    lines: np.float32
    rows: Rows
    fits: Fits
    has_threshold: bool
    has_contrast: bool
    lift: np.float32
    contrast_lift: np.float32
    covariance: Singles
    period: Singles
    bend: Singles
    joint: Singles
    mean_cofactor: Singles
    hat: Singles
    rest: Singles
    shade: Singles
    rim: np.float32
    steps: Singles
    step_period: Singles
    step_error: Singles
    gray: bool
    cell: np.float32
    sign: Singles
    spread: Singles
    fading: Singles
    least_contrast: np.float32
    phase_frames: Shorts
    line_frames: Shorts
    line_centre: Singles
    line_reach: np.float32
    line_open: NDArray[np.bool_]  # (2,), whether a sweep leaves lines out before its first and after its last
    line_ripple: np.float32
    black: Shorts


@dataclass(frozen=True)
class PhaseFit:
    """Least squares of one period: ``g = mean + c cos(phi) + s sin(phi)``, linear in the frames.

    `frames` (K,), `solution` (3, K) gives mean, c and s; `cofactors` (3,) are (cc, cs, ss); `hat` (K, K) leads to the
    fitted values. `even` says that the mean has no fringes: it is the scene lit evenly.
    """

    frames: Numbers
    solution: Array
    hat: Array
    cofactors: tuple[float, float, float]
    even: bool


@lru_cache(maxsize=512)
def fundamental(pattern: Phase) -> tuple[float, float, float]:
    """Mean, cosine and sine part of the first harmonic of a phase pattern over the projector's lines.

    A square wave is made of whole lines, so its edges and hence its first harmonic are not quite where `shift_rad` puts
    them; what the lines really show counts. The phase is ``2 pi (i + 1/2) / P``.

    Examples
    --------
    >>> mean, c, s = fundamental(Phase("x", 5, 4, 1, pi / 2, "square"))   # lines 0 and 1 of 5: centred on line 1/2
    >>> round(mean, 3), round(float(np.degrees(np.arctan2(s, c))), 6)
    (0.4, 72.0)
    """
    if pattern.profile == "sine":
        return 0.5, 0.5 * float(np.cos(pattern.shift_rad)), 0.5 * float(np.sin(pattern.shift_rad))
    cycles = np.arange(1, max(2, int(4096 / pattern.period)) + 1)
    lengths = cycles * pattern.period
    best = int(np.argmin(np.abs(lengths - np.round(lengths)).round(6)))
    lines = np.arange(max(1, round(float(lengths[best]))))
    light = brightness(pattern, lines)
    wave = np.exp(2j * pi * (lines + 0.5) / pattern.period)
    first = 2 * np.mean((light - light.mean()) * wave)
    return float(light.mean()), float(first.real), float(first.imag)


def fit_phase(phase: PhaseFrames, white: Numbers = (), black: Numbers = ()) -> PhaseFit:
    """Least-squares solution for one period, any number of steps and any shifts.

    Steps of unequal mean brightness (square waves of a few lines) need the contrast as a fourth unknown; the white
    and black frames then help.
    """
    parts = np.array([fundamental(pattern) for pattern in phase.patterns])
    scale = np.hypot(parts[:, 1], parts[:, 2]).mean()
    count, frames = len(parts), phase.frames
    design = np.column_stack([np.ones(count), parts[:, 1:] / scale])
    even = np.ptp(parts[:, 0]) < 1e-3
    if not even:
        level = parts[:, 0] - 0.5
        extra = [(1.0, 0.0, 0.0, 0.5)] * len(white) + [(1.0, 0.0, 0.0, -0.5)] * len(black)
        wide = np.vstack([np.column_stack([design, level]), np.reshape(extra, (-1, 4))])
        if np.linalg.matrix_rank(wide, tol=1e-3) == 4:
            design, frames = wide, (*frames, *white, *black)
    inverse = np.linalg.pinv(design)
    solution = inverse[:3]
    cofactors = solution @ solution.T
    light = [brightness(p, np.arange(int(8 * phase.period) + 8)) for p in phase.patterns]
    flat = bool(even and np.ptp(solution[0] @ np.array(light)) < 0.02)
    return PhaseFit(frames, solution, design @ inverse, (cofactors[1, 1], cofactors[1, 2], cofactors[2, 2]), flat)


def make_rows(rows: Iterable[dict[int, float]]) -> Rows:
    """Pack rows given as {frame: coefficient}."""
    first, column, value = [0], [], []
    for row in rows:
        for frame, coefficient in sorted(row.items()):
            if abs(coefficient) > NEGLIGIBLE:
                column.append(frame)
                value.append(coefficient)
        first.append(len(column))
    return Rows(np.array(first, np.int32), np.array(column, np.int32), np.array(value, np.float32))


def sums_of(rows: Rows, sample: Singles) -> Iterator[Singles]:
    """Give one row after the other times the frames of a sample, float32 (frames, n); a row without entries gives 0."""
    return (sum_of(rows, r, sample) for r in range(len(rows.first) - 1))


def sum_of(rows: Rows, number: int, sample: Singles) -> Singles:
    """One of these rows times the frames, float32 (n,)."""
    entries = slice(rows.first[number], rows.first[number + 1])
    # not by matrix product: for so little work its threads would only wait, and slow down the kernel's
    return np.asarray(np.einsum("f,fn", rows.value[entries], sample[rows.column[entries]]))


def lifted(table: AxisTable, sample: Singles, threshold: Singles, contrast: Singles) -> tuple[Singles, Singles]:
    """Threshold of a code and half its contrast in the pixels of a sample (frames, n), where bent waves lift them."""
    if table.lift == 0:
        return threshold, contrast
    entries = slice(table.fits.first[0], table.fits.first[1])
    c, s = np.einsum("rf,fn->rn", table.fits.value[1:, entries], sample[table.fits.frame[entries]])
    modulation = np.asarray(np.hypot(c, s), np.float32)  # of the finest period
    return threshold + table.lift * modulation, contrast + table.contrast_lift * modulation


def runs_of(table: AxisTable) -> list[float]:
    """Lines over which each bit of a code stays the same, the coarsest first."""
    bits = len(table.sign)
    return [float(table.cell) * 2.0 ** (bits - b - (0 if table.gray else 1)) for b in range(bits)]


def _pack_fits(fits: Sequence[PhaseFit]) -> Fits:
    """Pack the solutions, filled up with frames that count nothing."""
    first, frame, value = [0], [], [np.zeros((3, 0))]
    for fit in fits:
        more = -len(fit.frames) % TOGETHER
        frame += [*fit.frames, *fit.frames[-1:] * more]
        value.append(np.pad(fit.solution, ((0, 0), (0, more))))
        first.append(len(frame))
    return Fits(np.array(first, np.int32), np.array(frame, np.int32), np.hstack(value).astype(np.float32))


def _hats(fits: Sequence[PhaseFit]) -> Singles:
    size = max((len(fit.frames) + -len(fit.frames) % TOGETHER for fit in fits), default=1)
    found = np.zeros((len(fits), size, size), np.float32)
    for hat, fit in zip(found, fits, strict=True):
        hat[: len(fit.frames), : len(fit.frames)] = fit.hat
    return found


def mean_of(frames: Numbers, weight: float = 1.0) -> dict[int, float]:
    """The row that averages frames."""
    return dict.fromkeys(frames, weight / len(frames)) if frames else {}


def add(*rows: dict[int, float]) -> dict[int, float]:
    """The sum of rows."""
    total: dict[int, float] = {}
    for row in rows:
        for frame, value in row.items():
            total[frame] = total.get(frame, 0.0) + value
    return total


def image_row(frames: SortedFrames) -> dict[int, float]:
    """The row of the evenly lit image: white frames, means of steps, and bits plus inverses, each by its information.

    Every such combination sees the ambient light and a known share of the projector's; the weights make the one of
    least noise. Empty where no combination is even.
    """
    flat: list[tuple[dict[int, float], float]] = []  # combination of unit weight sum, projector's share
    if frames.white:
        flat.append((mean_of(frames.white), 1.0))
    for axis in frames.axes.values():
        for fit in (fit_phase(phase) for phase in axis.phases):
            if fit.even:
                flat.append((dict(zip(fit.frames, fit.solution[0], strict=True)), 0.5))
        for code in axis.codes:
            pairs = [(code.direct[bit], code.inverse[bit]) for bit in code.direct if bit in code.inverse]
            flat += [(add(mean_of(direct, 0.5), mean_of(inverse, 0.5)), 0.5) for direct, inverse in pairs]
    weights = [share / sum(value**2 for value in row.values()) for row, share in flat]
    total = sum(weight * share for weight, (_, share) in zip(weights, flat, strict=True))
    scaled = [{f: v * weight / total for f, v in row.items()} for weight, (row, _) in zip(weights, flat, strict=True)]
    return add(*scaled)


def axis_table(plan: Plan, axis: AxisFrames, frames: SortedFrames) -> AxisTable:
    """Make the tables of one axis."""
    fits = [fit_phase(phase, frames.white, frames.black) for phase in axis.phases] if not plan.sweep else []
    threshold, contrast = _threshold(plan.code, fits, frames)
    rows = [threshold, contrast]
    sign, spread = [], []
    if plan.code is not None:
        for direct, inverse in zip(plan.code.direct, plan.code.inverse, strict=True):
            share = 0.5 if direct and inverse else 1.0
            row = add(mean_of(direct, share), mean_of(inverse, -share))
            rows.append(row)
            sign.append(float(bool(inverse)) - float(bool(direct)))
            spread.append(sum(v * v for v in row.values()) + (sign[-1] != 0) * sum(v * v for v in threshold.values()))
    start = SWEEP if plan.sweep else CODE if plan.code else PHASES
    steps, step_period, step_error = _steps(plan, np.array([phase.period for phase in axis.phases]))
    lines = axis.lines if plan.sweep else None
    return AxisTable(
        start=start,
        lines=np.float32(plan.lines),
        rows=make_rows(rows),
        fits=_pack_fits(fits),
        has_threshold=bool(threshold),
        has_contrast=bool(contrast),
        lift=np.float32(0),
        contrast_lift=np.float32(0),
        covariance=np.array([fit.cofactors for fit in fits], np.float32).reshape(-1, 3),
        period=np.array([phase.period for phase in axis.phases][: len(fits)], np.float32),
        bend=np.zeros((0, 1, 1, 4), np.float32),
        joint=np.zeros((0, 5, 1), np.float32),
        mean_cofactor=np.array([fit.solution[0] @ fit.solution[0] for fit in fits], np.float32),
        hat=_hats(fits),
        rest=np.zeros((0, 1, 1), np.float32),
        shade=np.zeros((0, 1), np.float32),
        rim=np.float32(max(1.0, RIM * min(phase.period for phase in axis.phases)) if fits else 0),
        steps=steps,
        step_period=step_period,
        step_error=step_error,
        gray=bool(plan.code and plan.code.gray),
        cell=np.float32(plan.code.cell if plan.code else 1),
        sign=np.array(sign, np.float32),
        spread=np.array(spread, np.float32),
        fading=np.ones(len(sign), np.float32),
        least_contrast=np.float32(0),
        phase_frames=distinct(np.array([n for fit in fits for n in fit.frames], np.int32)),
        line_frames=np.array(lines.frames if lines else [], np.int32),
        line_centre=np.array(lines.centre if lines else [], np.float32),
        line_reach=np.float32(lines.width + 2 * lines.pitch + 3 if lines else 0),
        line_open=np.array(lines.open_ends(plan.lines) if lines else (False, False)),
        line_ripple=np.float32(0),
        black=np.array(frames.black[:1], np.int32),
    )


def no_axis() -> AxisTable:
    """Give the table of an axis without patterns."""
    plan = Plan(1, None, ())
    return axis_table(plan, AxisFrames("x", (), (), None), SortedFrames((), (), {}))._replace(start=NOTHING)


def _threshold(
    code: UsedCode | None, fits: Sequence[PhaseFit], frames: SortedFrames
) -> tuple[dict[int, float], dict[int, float]]:
    """Rows of the threshold between off and on, and of half their difference; empty where frames must tell."""
    if code is None:
        return {}, {}
    if frames.white and frames.black:
        return (
            add(mean_of(frames.white, 0.5), mean_of(frames.black, 0.5)),
            add(mean_of(frames.white, 0.5), mean_of(frames.black, -0.5)),
        )
    means = [dict(zip(fit.frames, fit.solution[0] / len(fits), strict=True)) for fit in fits]
    pairs = [(d, i) for d, i in zip(code.direct, code.inverse, strict=True) if d and i]
    if not means and pairs:
        half = 0.5 / len(pairs)
        means = [add(mean_of(direct, half), mean_of(inverse, half)) for direct, inverse in pairs]
    if not means:
        others = [fit_phase(phase) for axis in frames.axes.values() for phase in axis.phases]
        means = [dict(zip(fit.frames, fit.solution[0] / len(others), strict=True)) for fit in others]
    threshold = add(*means)
    if not threshold:
        return {}, {}
    opposite = {frame: -value for frame, value in threshold.items()}
    if frames.white:
        return threshold, add(mean_of(frames.white), opposite)
    if frames.black:
        return threshold, add(threshold, mean_of(frames.black, -1.0))
    return threshold, {}


def _steps(plan: Plan, periods: Array) -> tuple[Singles, Singles, Singles]:
    """Combinations, their periods and how the phases' variances enter what each step must round."""
    if not plan.steps:
        empty = np.zeros((0, 0), np.float32)
        return empty, np.zeros(0, np.float32), empty
    vectors = np.array(plan.steps, float)
    beat = 1 / (vectors @ (1 / periods))
    error = vectors.copy()
    error[1:] -= (beat[:-1] / beat[1:])[:, None] * vectors[:-1]
    return vectors.astype(np.float32), beat.astype(np.float32), (error**2).astype(np.float32)
