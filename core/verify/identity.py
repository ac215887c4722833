"""Does every frame show the pattern that it claims? Told from the images alone.

A pixel that sees projector line u must see, frame by frame, the brightness that every pattern gives line u. The
sequences used for measuring say more than they need to: of the many combinations of bright and dark that the frames
could make, only as many as there are lines are possible. (In the reference sequence the phase repeats the parity of all
Gray bits.) So the line that fits all frames best is looked up for a few thousand pixels, and where frames contradict
each other nothing fits. Leaving out one frame at a time then tells which one is wrong, and what it shows instead.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.algebra import on_own_threads
from core.model import Plan
from core.model.finding import Finding
from core.numerics import distinct, spaced
from core.patterns import Axis, Pattern, Phase, axis_of, describe, level_of, use_of
from core.verify.contradictions import Looked, unexplained
from core.verify.lookup import (
    CONTRADICTION,
    LEAST,
    Fit,
    Numbers,
    as_blurred,
    dictionary,
    leave_one_out,
    nearest,
    nearest_within,
    some,
)
from core.verify.quality import LIT, Sampled

Array = NDArray[np.float32]

SHARE = 0.02  # of the pixels that may contradict: depth edges and interreflections do
LOCAL = 0.5  # a part of the image or of the lines is wrong when half of it contradicts
EDGES = 0.3  # of a code frame's edges contradict when it was exchanged; on the virtual bench none when it was not
EDGED = 0.03  # of squared distance, for every frame that has an edge near each line: the blur is known roughly only
_PIXELS = 9000  # looked up
BRIGHTEST, LEAST_BRIGHT = 2000, 150  # of them, for a response; least
CURVED = 0.1  # of the pixels: where more contradict, a response must explain nine tenths of them, else two thirds
FOLLOWS = 0.8  # least correlation of a step with what the others make it; its neighbour has the cosine of their shift
FINE = 0.25  # of the lines: longer periods are not seen whole
SCATTERED = 0.8  # of the pixels: so many contradict where light is scattered, which moves the levels at edges, too


@on_own_threads()
def identity(plan: Plan, sampled: Sampled, lines: tuple[int, int]) -> list[Finding]:
    """See that every shot shows its pattern, in a finding for the plain frames and one for each axis.

    Samples are of all shots, guards included; `lines` are the projector's columns and rows. A finding is bad, with the
    shots to take again, where frames contradict each other.
    """
    lit = np.flatnonzero(sampled.lit)
    if len(lit) < LIT * len(sampled.lit):
        return []  # the check of the modulation says so
    lit = lit[spaced(len(lit), _PIXELS)]
    values = sampled.between(lit)
    tolerance = (sampled.noise / sampled.contrast[lit]).astype(np.float32)
    bright = np.flatnonzero(sampled.bright[lit])
    bright = bright[spaced(len(bright), BRIGHTEST)]

    def of_axis(axis: Axis) -> Finding | None:
        shots = tuple(i for i, p in enumerate(plan.shots) if axis_of(p) == axis)
        if not shots:
            return None
        patterns, count = [plan.shots[i] for i in shots], lines[0 if axis == "x" else 1]
        possible, at = dictionary(patterns, count)
        weight = np.array([1 / patterns.count(p) for p in patterns], np.float32)
        fit = Fit(shots, values[list(shots)], possible, at, weight)
        return _axis(plan, fit, tolerance, sampled.at[:, lit], sampled.shape, lines, bright)

    axes: tuple[Axis, ...] = ("x", "y")
    with ThreadPoolExecutor(len(axes)) as pool:  # the work is in array operations, which leave the interpreter free
        found = [finding for finding in pool.map(of_axis, axes) if finding is not None]
    return [_plain(plan, values), *found]


def coordinates(plan: Plan, sampled: Sampled, lines: tuple[int, int]) -> tuple[Array, Array, Array]:
    """Look up which projector column and row the lit pixels see, roughly, and how well the frames agree; each (n,).

    Lines are NaN for an axis without patterns; the misfit is the r.m.s. difference from the patterns of that column and
    row, white = 1.
    """
    lit = np.flatnonzero(sampled.lit)
    values = sampled.between(lit)
    found, cost, shown = [], np.zeros(len(lit), np.float32), 0
    for axis, count in (("x", lines[0]), ("y", lines[1])):
        shots = [i for i, p in enumerate(plan.shots) if axis_of(p) == axis]
        if not shots:
            found.append(np.full(len(lit), np.nan, np.float32))
            continue
        possible, at = dictionary([plan.shots[i] for i in shots], count)
        distance, best = nearest(values[shots], possible)
        found.append(at[best])
        cost, shown = cost + np.maximum(distance, 0.0), shown + len(shots)
    return found[0], found[1], np.sqrt(cost / max(shown, 1))


def _plain(plan: Plan, values: Array) -> Finding:
    wrong = []
    for i, pattern in enumerate(plan.shots):
        level = level_of(pattern)
        if level in (0, 1):  # between them a response may bend what is seen
            off = np.abs(values[i] - level) > 0.4
            if off.mean() > SHARE:
                wrong.append(i)
    if wrong:
        names = ", ".join(f"{plan.place(i)} ({describe(plan.shots[i])})" for i in wrong)
        return Finding("identity", "bad", f"not evenly white or black as claimed: {names}", shots=tuple(wrong))
    return Finding("identity", "good", "white and black frames are what they claim")


def _axis(
    plan: Plan,
    fit: Fit,
    tolerance: Array,
    at: NDArray[np.intp],
    shape: tuple[int, int],
    lines: tuple[int, int],
    bright: Numbers,
) -> Finding:
    k, along = len(fit.shots), "rows" if axis_of(plan.shots[fit.shots[0]]) == "y" else "columns"
    words = sum(use_of(plan.shots[i]) == "word" for i in fit.shots)
    limit = max(CONTRADICTION, 0.01 * float(fit.weight.sum()), EDGED * words) + 2 * k * tolerance**2
    root = np.sqrt(fit.weight)[:, None]
    cost, best = nearest_within(root * fit.values, root * fit.possible, limit)
    bad = cost > limit
    share = float(bad.mean())
    patterns, lit = [plan.shots[s] for s in fit.shots], replace(fit, values=fit.values[:, bright])
    bent = _bent(lit, patterns, lines, at[:, bright], limit[bright], share) if share > SHARE else None
    if bent is not None and _strange_step(lit.values, patterns, lines, float(np.median(tolerance[bright]))):
        bent = None
    place = _local(bad, at, shape) or _local_lines(bad, fit.lines[best], lines[along == "rows"], along)
    figures = {"contradicting": share, "pixels": float(len(bad))}
    few = some(len(bad), k)
    sharp = as_blurred(fit, best)
    left = leave_one_out(sharp, few, limit[few], tolerance[few], at[0, few])
    misplaced = _misplaced_edges(patterns, fit.values, bad)
    unlike = [j for j in range(k) if left.wrong[j] or j in misplaced]
    if bent is not None or (share <= SHARE and place is None and not unlike):
        if not all(left.judged):
            # guards show some of them again
            open_ = ", ".join(dict.fromkeys(describe(patterns[j]) for j in range(k) if not left.judged[j]))
            text = f"frames across {along} agree, but nothing in the sequence repeats what these say: {open_}"
            return Finding("identity", "warning", text + "; add phase steps or inverse frames", figures)
        text = f"all frames across {along} show their pattern ({share if bent is None else bent:.2%} differ)"
        return Finding("identity", "good", text, figures)
    explained = [j for j in range(k) if left.share[j] <= max(SHARE, 0.25 * share)]
    culprits = explained if len(explained) == 1 else unlike if share <= SHARE and unlike else list(range(k))
    if len(culprits) == 1:
        j = culprits[0]
        shown = _shown(plan, sharp, few, left.best[j], j)
        text = f"{plan.place(fit.shots[j])} claims {describe(plan.shots[fit.shots[j]])} and shows {shown}"
    else:
        text = f"frames across {along} contradict each other in {share:.1%} of the pixels"
        if share <= SHARE and place is None:
            names = ", ".join(f"{plan.place(fit.shots[j])} ({describe(plan.shots[fit.shots[j]])})" for j in culprits)
            text = f"frames across {along} do not show what they claim: {names}"
        text += f", most of all {place}" if place else ""
    return Finding("identity", "bad", text, figures, tuple(fit.shots[j] for j in culprits))


def _bent(
    fit: Fit, patterns: list[Pattern], lines: tuple[int, int], at: NDArray[np.intp], limit: Array, share: float
) -> float | None:
    """Give what still contradicts if a response or scattered light explains the rest and no edge is misplaced."""
    if fit.values.shape[1] < LEAST_BRIGHT:
        return None
    few = share <= CURVED
    looked = Looked.of(fit.shots, patterns, fit.values, fit.values, lines, at)
    bad, straight = unexplained(fit.values, patterns, replace(looked, limit=limit) if few else looked)
    if (left := float(bad.mean())) > share / (3 if few else 10):
        return None
    edges = _misplaced_edges(patterns, straight, bad)
    if not few:
        narrow = nearest(straight, fit.possible)[0] > CONTRADICTION + 0.01 * len(patterns)
        near = _misplaced_edges(patterns, straight, narrow)
        edges = near & edges if share > SCATTERED else near
    return None if edges else left


def _strange_step(values: Array, patterns: list[Pattern], lines: tuple[int, int], tolerance: float) -> bool:
    """Whether a step of a fine wave is not what the other steps make it.

    A curve of grey values keeps the order of brightness, so the wave is made anew of ranks: the phases of a fine one
    are spread evenly.
    """
    for period in {p.period for p in patterns if isinstance(p, Phase)}:
        steps = [k for k, p in enumerate(patterns) if isinstance(p, Phase) and p.period == period]
        if period > FINE * lines[axis_of(patterns[steps[0]]) == "y"]:
            continue
        ranks = np.argsort(np.argsort(values[steps], axis=None)).reshape(len(steps), -1)
        wave = -np.cos(np.pi * (ranks + 0.5) / ranks.size)
        shifts = np.array([p.shift_rad for p in patterns if isinstance(p, Phase) and p.period == period])
        A = np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)
        limit = min(FOLLOWS, 0.5 + 0.5 * np.cos(2 * np.pi / len(distinct(shifts)))) - 5 * tolerance
        for k in range(len(steps)):
            others = np.arange(len(steps)) != k
            made, _, rank, _ = np.linalg.lstsq(A[others], wave[others], rcond=1e-6)
            if rank == 3 and np.corrcoef(A[k] @ made, wave[k])[0, 1] < limit:
                return True
    return False


def _misplaced_edges(patterns: list[Pattern], values: Array, bad: NDArray[np.bool_]) -> set[int]:
    """Find code frames whose edges lie where the other frames allow none: two that were exchanged.

    The parity of all bits does not tell these. At an edge of a Gray code one frame alone is half bright; where several
    are, the pixel sees two surfaces.
    """
    codes = [j for j, p in enumerate(patterns) if use_of(p) == "code"]
    half = np.abs(values - 0.5) < 0.25
    distinct = [j for i, j in enumerate(codes) if patterns[j] not in [patterns[c] for c in codes[:i]]]
    alone = half[distinct].sum(axis=0) == 1
    found = set()
    for j in codes:
        edges = half[j] & alone
        if edges.sum() >= LEAST // 2 and float(bad[edges].mean()) > EDGES:
            found.add(j)
    return found


def _local(bad: NDArray[np.bool_], at: NDArray[np.intp], shape: tuple[int, int]) -> str | None:
    """Name the part of the image where most pixels contradict."""
    rows, cols = at[0] * 6 // shape[0], at[1] * 6 // shape[1]
    total = np.bincount(rows * 6 + cols, minlength=36)
    wrong = np.bincount(rows * 6 + cols, weights=bad, minlength=36)
    share = np.where(total >= LEAST, wrong / np.maximum(total, 1), 0.0)
    worst = int(np.argmax(share))
    if share[worst] <= LOCAL:
        return None
    return f"around row {(worst // 6 + 0.5) * shape[0] / 6:.0f}, column {(worst % 6 + 0.5) * shape[1] / 6:.0f}"


def _local_lines(bad: NDArray[np.bool_], lines: Array, count: int, along: str) -> str | None:
    """Name the projector lines where most pixels contradict."""
    cells = np.clip(lines // 8, 0, count // 8).astype(int)
    total, wrong = np.bincount(cells), np.bincount(cells, weights=bad)
    share = np.where(total >= LEAST, wrong / np.maximum(total, 1), 0.0)
    worst = int(np.argmax(share))
    return f"at projector {along} {8 * worst} to {8 * worst + 7}" if share[worst] > LOCAL else None


def _shown(plan: Plan, fit: Fit, few: NDArray[np.intp], best: NDArray[np.intp], j: int) -> str:
    """Name the pattern that a frame shows instead of its own."""
    seen = fit.values[j, few]
    misfit = {
        describe(plan.shots[s]): float(np.mean((seen - fit.possible[i, best]) ** 2)) for i, s in enumerate(fit.shots)
    }
    misfit |= {"white": float(np.mean((seen - 1) ** 2)), "black": float(np.mean(seen**2))}
    name, value = min(misfit.items(), key=lambda item: item[1])
    if name == describe(plan.shots[fit.shots[j]]):
        return "it in part only"
    return name if value < 0.1 else "something else"
