"""How the absolute coordinate of one axis follows from its frames, or why it does not.

A coordinate starts from what is known at first: the cell of a code, or merely that it lies on the projector. Phases
then sharpen it step by step. A step uses an integer combination of the phases, ``psi = sum_j a_j phi_j``: again a
phase, of period ``Q = 1 / sum_j (a_j / P_j)``. Single phases, beats (heterodyne) and longer combinations are all of
this form. A step is safe when the error of what is known before it is well below Q / 2; the plan is the sequence whose
least safe step is the safest.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product
from math import ceil

import numpy as np
from numpy.typing import NDArray

from core.decode.frames import AxisFrames, CodeFrames, Numbers
from core.errors import InputError
from core.lazy import dataclass
from core.numerics import distinct

MAX_BITS = 24  # cell numbers must be exact in single precision
SEARCH = {1: 1, 2: 9, 3: 5, 4: 3}  # largest |a_j| by number of periods; more periods: single phases and beats
SAFE = 0.125  # a step this safe bears phases known to 0.17 rad; safer ones need not be sought
TOLERANCE = 1e-6
SHORT = 0.01  # of the extent, by which waves drawn from the first line to the last repeat too early: 911 of 912 lines


@dataclass(frozen=True)
class UsedCode:
    """The bits that name a cell, most significant first: frames of each bit, frames of its inverse."""

    gray: bool
    cell: int
    direct: tuple[Numbers, ...]
    inverse: tuple[Numbers, ...]


@dataclass(frozen=True)
class Plan:
    """The way to an axis' absolute coordinate.

    `lines` is the extent within which it is unique, `code` the start (None: the whole extent), `steps` the integer
    combinations of the phases in the order of their use, the last being the finest phase itself. `sweep` says that the
    coordinate comes from light sections instead.
    """

    lines: int
    code: UsedCode | None
    steps: tuple[tuple[int, ...], ...]
    sweep: bool = False


def plan_axis(frames: AxisFrames, lines: int | None, where: str) -> Plan:
    """Find the way to the absolute coordinate of an axis.

    Without the projector's number of lines, over the extent that the code or the longest beat covers. InputError when
    frames are missing or do not tell one line from another.
    """
    where = f"{where}, axis {frames.axis}"
    reasons = [*_phase_reasons(frames)]
    if not reasons:
        used: UsedCode | None = None
        extent = lines
        for code in frames.codes:
            candidate, reason = _usable(code, lines)
            if candidate is None:
                reasons.append(reason)
            elif used is None or candidate.cell < used.cell:
                used, extent = candidate, lines or code.cell << min(code.bits, MAX_BITS)
                shortfall = reason
        if used is None and frames.codes and lines is None:  # so many lines at least has the projector
            extent = max(code.cell << min(code.bits, MAX_BITS) for code in frames.codes)
        plan = _combine(frames, used, extent)
        if plan is not None and not (used and not frames.phases and shortfall):
            return plan
        if used is not None and shortfall:
            reasons.append(shortfall)
    if frames.lines is not None:
        reach = int(frames.lines.centre[-1] + (frames.lines.width + 1) / 2)
        # where nobody knows how many there are, the last section may not be the last line's
        return Plan(max(lines, reach) if lines else reach + 1, None, (), sweep=True)
    raise InputError(where, *_refusal(frames, reasons, lines))


def _phase_reasons(frames: AxisFrames) -> list[str]:
    reasons = []
    for phase in frames.phases:
        shifts = np.array([p.shift_rad for p in phase.patterns])
        different = len(distinct(np.round(np.exp(1j * shifts), 6)))
        if different < 3:
            text = f"{len(shifts)} frames of period {phase.period:g} have {different} different shift_rad"
            reasons.append(f"{text}, three are the least")
    return reasons


def _usable(code: CodeFrames, lines: int | None) -> tuple[UsedCode | None, str]:
    """The bits from the most significant down to the first gap, and what is missing beyond it."""
    reach = code.cell << code.bits
    if lines is not None and reach < lines:
        told = f"{code.bits} bits in cells of {code.cell} tell {reach} lines apart"
        return None, f"{told}, by project.json the projector has {lines}"
    extent = lines or code.cell << min(code.bits, MAX_BITS)
    # a bit that stays 0 over the whole projector need not be seen
    first = sum((code.cell << (code.bits - 1 - bit)) >= extent for bit in range(code.bits))
    present = [bit in code.direct or bit in code.inverse for bit in range(code.bits)]
    last = first
    while last < code.bits and present[last]:
        last += 1
    gap = "" if last == code.bits else f"bit {last} of the {code.name} is missing"
    if last == first:
        return None, gap or f"the {code.name} has one cell for all {extent} lines"
    cell = code.cell << (code.bits - last)
    direct = tuple(code.direct.get(bit, ()) for bit in range(first, last))
    inverse = tuple(code.inverse.get(bit, ()) for bit in range(first, last))
    return UsedCode(code.kind == "gray", cell, direct, inverse), gap


def _combine(frames: AxisFrames, code: UsedCode | None, extent: int | None) -> Plan | None:
    periods = tuple(phase.period for phase in frames.phases)
    if not periods:
        return None if code is None or extent is None else Plan(extent, code, ())
    if extent is None:
        extent = ceil(longest_beat(periods) - TOLERANCE)
    for part in (1.0, 1.0 - SHORT):
        safety, steps = safest_steps(periods, part * extent, False)
        if code is not None:
            coded_safety, coded_steps = safest_steps(periods, part * code.cell, True)
            if coded_safety >= safety and coded_steps:
                return Plan(extent, code, coded_steps)
        if steps:
            return Plan(extent, None, steps)
    return None


def combinations(periods: tuple[float, ...]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Integer combinations of phases, shape (n, J), and their periods Q, none below the finest phase's."""
    count = len(periods)
    reach = SEARCH.get(count)
    if reach is not None:
        vectors = np.array(list(product(range(-reach, reach + 1), repeat=count)))
    else:
        unit = np.eye(count, dtype=np.int64)
        vectors = np.array([*unit, *(unit[i] - unit[j] for i in range(count) for j in range(count) if i != j)])
    frequency = vectors @ (1 / np.array(periods))
    keep = (frequency > 1e-9) & (frequency <= (1 + TOLERANCE) / min(periods))
    return vectors[keep], 1 / frequency[keep]


def longest_beat(periods: tuple[float, ...]) -> float:
    """The longest period (lines) of small combinations: the extent to assume where the projector is unknown."""
    vectors, beat = combinations(periods)
    small = np.abs(vectors).max(axis=1) <= 2
    return float(min(beat[small].max(), 2.0**16))


@lru_cache(maxsize=64)
def safest_steps(periods: tuple[float, ...], known: float, coded: bool) -> tuple[float, tuple[tuple[int, ...], ...]]:
    """From a position known to within `known` lines to the finest phase: the fewest steps that are safe enough.

    The periods are in lines, the finest first. The width is a `coded` cell's, whose edges are blurred, or the whole
    projector's, beyond which there is nothing. The safety is half a cycle by the factor with which the least safe step
    magnifies the errors of the phases. No steps where there is no way.
    """
    vectors, beat = combinations(periods)
    order = np.argsort(-beat, kind="stable")
    vectors, beat = vectors[order], beat[order]
    length = np.linalg.norm(vectors, axis=1)
    start = np.where(coded, (np.maximum(0.5 - known / (2 * beat), 0.05) + 0.1) / length, 10 / length)
    start = np.where(beat >= known * (1 - TOLERANCE), start, 0.0)
    # steps lead from longer to shorter beats only: one pass in that order finds the safest way to each
    safety = start.copy()
    for node in range(len(beat)):
        through = np.minimum(_step_safety(vectors, beat, node), safety[:node])
        safety[node] = max(safety[node], through.max(initial=0.0))
    goal = int(np.flatnonzero((length == 1) & (vectors[:, 0] == 1))[0])
    least = min(0.9 * float(safety[goal]), SAFE)
    if least == 0:
        return 0.0, ()
    count, origin = np.where(start >= least, 1.0, np.inf), np.full(len(beat), -1)
    for node in range(len(beat)):
        ways = np.where(_step_safety(vectors, beat, node) >= least, count[:node] + 1, np.inf)
        if ways.min(initial=np.inf) < count[node]:
            origin[node] = int(ways.argmin())
            count[node] = ways.min()
    steps: list[tuple[int, ...]] = []
    while goal >= 0:
        steps.insert(0, tuple(int(a) for a in vectors[goal]))
        goal = int(origin[goal])
    return least, tuple(steps)


def _step_safety(vectors: NDArray[np.int64], beat: NDArray[np.float64], node: int) -> NDArray[np.float64]:
    """Safety of the step to a combination from each of the longer ones before it, shape (node,)."""
    error = vectors[node] - (beat[:node] / beat[node])[:, None] * vectors[:node]
    return 0.5 / np.maximum(np.linalg.norm(error, axis=1), TOLERANCE)


def _refusal(frames: AxisFrames, reasons: list[str], lines: int | None) -> tuple[str, str]:
    """What was seen and what to do, for frames that give no absolute coordinate."""
    if reasons:
        return "; ".join(reasons), "add the missing frames or leave this axis out"
    periods = tuple(phase.period for phase in frames.phases)
    if not periods:
        return "no code, phase or line frames", "add the frames of a code, of phase steps or of a line sweep"
    named = "period " + ", ".join(f"{p:g}" for p in periods)
    if not frames.codes:
        beat = combinations(periods)[1].max()
        seen = f"phase steps of {named} tell {beat:.6g} of {lines} lines apart and there is no code"
        return seen, "add Gray-code frames or phase steps of a longer period"
    cells = ", ".join(str(code.cell) for code in frames.codes)
    seen = f"code cells of {cells} lines are wider than the phase steps of {named} resolve"
    return seen, "use cells no wider than the period, or add phase steps of a longer period"
