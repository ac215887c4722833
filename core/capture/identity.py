"""Does every frame show the pattern that it claims? Told from the images alone.

A pixel that sees projector line u must see, frame by frame, the brightness that every pattern gives line u. The
sequences used for measuring say more than they need to: of the many combinations of bright and dark that the frames
could make, only as many as there are lines are possible. (In the reference sequence the phase repeats the parity of all
Gray bits.) So the line that fits all frames best is looked up for a few thousand pixels, and where frames contradict
each other nothing fits. Leaving out one frame at a time then tells which one is wrong, and what it shows instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from core.capture.finding import Finding
from core.capture.plan import Plan, describe
from core.capture.quality import LIT, Sampled
from core.patterns import Axis, Black, Pattern, White, brightness

Array = NDArray[np.float32]

BLURS_LINES = (0.35, 0.6, 0.9, 1.3, 1.8, 2.6)  # from sharp to a period of 4 lines that is nearly gone
CONTRADICTION = (
    0.12  # squared distance, white = 1: a right frame leaves below 0.05 on the virtual bench, one wrong bit 1
)
SHARE = 0.02  # of the pixels that may contradict: depth edges and interreflections do
LOCAL = 0.5  # a part of the image or of the lines is wrong when half of it contradicts
LEAST = 12  # pixels in a part for a judgement
AGREEMENT = 0.9  # share of pixels at which a frame is bright or dark as the others say; wrong frames have 0.5
_PIXELS = 6000  # looked up
_LEAVE_ONE = 600  # pixels for the search of the wrong frame


@dataclass(frozen=True)
class _Fit:
    """The frames of one axis: their numbers, normalised values (k, n) and the possible ones (k, m) for lines (m,).

    Shots of the same pattern share its `weight` (k,).
    """

    shots: tuple[int, ...]
    values: Array
    possible: Array
    lines: Array
    weight: Array


def identity(plan: Plan, sampled: Sampled, lines: tuple[int, int]) -> list[Finding]:
    """See that every shot shows its pattern, in a finding for the plain frames and one for each axis.

    Parameters
    ----------
    plan : Plan
    sampled : Sampled
        Of all shots, guards included.
    lines : (int, int)
        The projector's columns and rows.

    Returns
    -------
    findings : list of Finding
        Level bad with the shots to take again where frames contradict each other.
    """
    lit = np.flatnonzero(sampled.lit)
    if len(lit) < LIT * len(sampled.lit):
        return []  # the check of the modulation says so
    lit = lit[np.linspace(0, len(lit) - 1, min(len(lit), _PIXELS)).astype(int)]
    contrast = (sampled.white - sampled.black)[lit]
    values = ((sampled.grey[:, lit] - sampled.black[lit]) / contrast).astype(np.float32)
    tolerance = (sampled.noise / contrast).astype(np.float32)
    findings = [_plain(plan, values)]
    for axis, count in (("x", lines[0]), ("y", lines[1])):
        shots = tuple(i for i, p in enumerate(plan.shots) if getattr(p, "axis", None) == axis)
        if shots:
            patterns = [plan.shots[i] for i in shots]
            possible, at = dictionary(patterns, axis, count)  # type: ignore[arg-type]
            weight = np.array([1 / patterns.count(p) for p in patterns], np.float32)
            fit = _Fit(shots, values[list(shots)], possible, at, weight)
            findings.append(_axis(plan, fit, tolerance, sampled.at[:, lit], sampled.shape, count))
    return findings


def coordinates(plan: Plan, sampled: Sampled, lines: tuple[int, int]) -> tuple[Array, Array]:
    """Look up which projector column and row the lit pixels see, roughly: shape (n,) each, in lines.

    NaN for an axis without patterns.
    """
    lit = np.flatnonzero(sampled.lit)
    contrast = (sampled.white - sampled.black)[lit]
    values = ((sampled.grey[:, lit] - sampled.black[lit]) / contrast).astype(np.float32)
    found = []
    for axis, count in (("x", lines[0]), ("y", lines[1])):
        shots = [i for i, p in enumerate(plan.shots) if getattr(p, "axis", None) == axis]
        if not shots:
            found.append(np.full(len(lit), np.nan, np.float32))
            continue
        possible, at = dictionary([plan.shots[i] for i in shots], axis, count)  # type: ignore[arg-type]
        found.append(at[_nearest(values[shots], possible)[1]])
    return found[0], found[1]


def dictionary(patterns: list[Pattern], axis: Axis, count: int) -> tuple[Array, Array]:
    """Give what patterns look like on every half line, sharp to blurred: (k, m), and those lines (m,)."""
    reach = int(np.ceil(3 * BLURS_LINES[-1]))
    fine = np.arange(-reach * 4, (count + reach) * 4)  # quarters of a line
    inside = np.clip(fine // 4, 0, count - 1)
    stack = np.array([brightness(p, np.arange(count))[inside] for p in patterns], dtype=np.float32)
    keep = np.arange(reach * 4, (count + reach) * 4, 2)
    blurred = []
    for blur in BLURS_LINES:
        offsets = np.arange(-4 * reach, 4 * reach + 1)
        kernel = np.exp(-0.5 * (offsets / (4 * blur)) ** 2)
        kernel /= kernel.sum()
        blurred.append([np.convolve(line, kernel, mode="same")[keep] for line in stack])
    at = (fine[keep] + 0.5) / 4 - 0.5
    return np.concatenate(np.asarray(blurred, np.float32), axis=1), np.tile(at, len(BLURS_LINES)).astype(np.float32)


def _plain(plan: Plan, values: Array) -> Finding:
    wrong = []
    for i, pattern in enumerate(plan.shots):
        if isinstance(pattern, White | Black):
            off = np.abs(values[i] - (1.0 if isinstance(pattern, White) else 0.0)) > 0.4
            if off.mean() > SHARE:
                wrong.append(i)
    if wrong:
        names = ", ".join(f"{_place(plan, i)} ({describe(plan.shots[i])})" for i in wrong)
        return Finding("identity", "bad", f"not evenly white or black as claimed: {names}", shots=tuple(wrong))
    return Finding("identity", "good", "white and black frames are what they claim")


def _axis(plan: Plan, fit: _Fit, tolerance: Array, at: NDArray[np.intp], shape: tuple[int, int], count: int) -> Finding:
    k, along = len(fit.shots), "columns" if getattr(plan.shots[fit.shots[0]], "axis", "x") == "x" else "rows"
    limit = max(CONTRADICTION, 0.01 * float(fit.weight.sum())) + 2 * k * tolerance**2
    root = np.sqrt(fit.weight)[:, None]
    cost, best = _nearest(root * fit.values, root * fit.possible)
    bad = cost > limit
    share = float(bad.mean())
    place = _local(bad, at, shape) or _local_lines(bad, fit.lines[best], count, along)
    figures = {"contradicting": share, "pixels": float(len(bad))}
    few = np.linspace(0, len(bad) - 1, min(len(bad), _LEAVE_ONE, max(200, 20_000 // k))).astype(int)
    sharp = _as_blurred(fit, best)
    left = _leave_one_out(sharp, few, limit[few])
    unlike = [j for j in range(k) if left.judged[j] and left.agreement[j] < AGREEMENT]
    if share <= SHARE and place is None and not unlike:
        if not all(left.judged):
            open_ = ", ".join(describe(plan.shots[fit.shots[j]]) for j in range(k) if not left.judged[j])
            text = f"frames across {along} agree, but nothing in the sequence repeats what these say: {open_}"
            return Finding("identity", "warning", text + "; add phase steps or inverse frames", figures)
        return Finding(
            "identity", "good", f"all frames across {along} show their pattern ({share:.2%} differ)", figures
        )
    explained = [j for j in range(k) if left.share[j] <= max(SHARE, 0.25 * share)]
    culprits = explained if len(explained) == 1 else unlike if share <= SHARE and unlike else list(range(k))
    if len(culprits) == 1:
        j = culprits[0]
        shown = _shown(plan, sharp, few, left.best[j], j)
        text = f"{_place(plan, fit.shots[j])} claims {describe(plan.shots[fit.shots[j]])} and shows {shown}"
    else:
        text = f"frames across {along} contradict each other in {share:.1%} of the pixels"
        text += f", most of all {place}" if place else ""
    return Finding("identity", "bad", text, figures, tuple(fit.shots[j] for j in culprits))


@dataclass(frozen=True)
class _LeftOut:
    """For every frame: what the others say without it."""

    share: list[float]  # of pixels at which the others contradict each other
    agreement: list[float]  # share of pixels at which the frame is bright or dark as the others say
    judged: list[bool]  # whether the others say anything about it
    best: list[NDArray[np.intp]]


def _nearest(values: Array, possible: Array) -> tuple[Array, NDArray[np.intp]]:
    """Find the possible column nearest to each column of values: squared distance (n,) and number (n,)."""
    power = np.sum(possible**2, axis=0)
    cost, best = [], []
    for part in np.array_split(values, max(1, values.shape[1] // 500), axis=1):
        distance = power[None, :] - 2 * (part.T @ possible)
        number = np.argmin(distance, axis=1)
        best.append(number)
        cost.append(distance[np.arange(len(number)), number] + np.sum(part**2, axis=0))
    return np.concatenate(cost), np.concatenate(best)


def _as_blurred(fit: _Fit, best: NDArray[np.intp]) -> _Fit:
    """Keep those blurs that the image has."""
    m = fit.possible.shape[1] // len(BLURS_LINES)
    used = np.bincount(best // m, minlength=len(BLURS_LINES)) > 0.05 * len(best)
    keep = np.repeat(used, m)
    return _Fit(fit.shots, fit.values, fit.possible[:, keep], fit.lines[keep], fit.weight)


def _leave_one_out(fit: _Fit, few: NDArray[np.intp], limit: Array) -> _LeftOut:
    """Look every pixel up again without frame j, for every j: its part is taken back from the whole distance.

    The others say whether frame j is bright at a pixel where the lines that make it bright fit clearly better than
    those that make it dark, or the reverse.
    """
    result = _LeftOut([], [], [], [])
    values, weight = fit.values[:, few], fit.weight[:, None]
    whole = np.sum(weight * fit.possible**2, axis=0)[None, :] - 2 * ((weight * values).T @ fit.possible)
    whole += np.sum(weight * values**2, axis=0)[:, None]
    for seen, possible, own in zip(values, fit.possible, fit.weight, strict=True):
        distance = whole - own * (seen[:, None] - possible[None, :]) ** 2
        best = np.argmin(distance, axis=1)
        bright, dark = (
            np.min(distance[:, chosen], axis=1, initial=np.inf) for chosen in (possible > 0.5, possible <= 0.5)
        )
        clear = (np.abs(bright - dark) > CONTRADICTION) & (np.abs(seen - 0.5) > 0.15)
        right = (seen > 0.5) == (bright < dark)
        result.share.append(float(np.mean(np.minimum(bright, dark) > limit)))
        result.judged.append(bool(clear.sum() >= max(LEAST, 0.03 * len(few))))
        result.agreement.append(float(right[clear].mean()) if clear.any() else 1.0)
        result.best.append(best)
    return result


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


def _shown(plan: Plan, fit: _Fit, few: NDArray[np.intp], best: NDArray[np.intp], j: int) -> str:
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


def _place(plan: Plan, shot: int) -> str:
    return f"frame {shot - plan.own.start}" if shot in plan.own else "a guard frame"
