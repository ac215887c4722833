"""Why the frames of an axis contradict each other: mistakes that people make in describing patterns, tried in turn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from math import pi
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from core.model import Note, Plan
from core.numerics import median_of, spaced
from core.patterns import Code, Pattern, Phase, axis_of, describe
from core.verify.contradictions import PIXELS, Looked, contradicting, looks, unexplained
from core.verify.lookup import nearest
from core.verify.steps import exchanged_steps

Array = NDArray[np.float32]

FEW = 160  # pixels on which a mistake is tried
ALIKE = 0.04  # shares of contradictions that are no different
SURE = 0.06  # squared difference, white = 1, from what a frame is said to show
FITS = 0.3  # of the contradictions that may stay where a mistake explains them
EVEN_STEPS = 0.02  # mean of the steps as unit vectors; degrees taken for radians have 0.8 by their number
MOST_PIXELS = 0.8  # of them must fit
EVEN = 0.9  # of them where no edges are
INVERTED = "they fit if the code is inverted"
PLAIN = ("white", "black", "its inverse")  # what one frame alone may show by mistake, likelier than another pattern
BEYOND, LEFT = 0.02, 0.06  # of all pixels: explained by more lines at least, and left by them at most
MOST_BEYOND = 0.3  # of the pixels may lie beyond the declared lines: more lines explain them; of 24 sound axes none
NEAR = 0.05  # another period than described, relative: a slip, not a multiple
LEVELLING, LEAST_LEVEL = 3, 0.03  # rounds; share of the pixels that a frame must show bright, and dark
UNLIKE, MOST_GAIN = 0.2, 3.0  # gains or levels, white = 1, of frames; of one against the others
RESOLVED = 2.0  # px, of a period
LEVELLED = {  # bands of rows, and what they say
    1: ": they fit if every frame has a level and gain of its own: switch off automatic exposure and gain, and lamps "
    "of the room",
    12: ": they fit if every frame has a level and gain of its own in every band of rows: a lamp flickers while rows "
    "are read; expose for whole cycles, or switch it off",
}
MOST_FRAMES = 16  # beyond that pairs of frames are not tried


def explanation(plan: Plan, values: Array, looked: Looked, share: float) -> tuple[Note, int | None]:
    """Name the mistake that explains the contradictions, if one does, and the frame that is wrong, if it is one.

    `values`, (shots, n), are of all frames, for those that stand in another's place; `looked` is of one axis; `share`
    is that of pixels that contradict themselves as described.
    """
    most = FITS * share
    single = [
        (contradicting(np.delete(looked.values, j, axis=0), _without(looked.patterns, j), looked, FEW), j)
        for j in range(len(looked.shots))
    ]
    alone = [j for left, j in single if left <= most] if len(looked.shots) >= 5 else []
    # a frame that shows what it claims is not at fault, though the others get on without it
    off = {j: (misfit, name) for j in alone for own, misfit, name in [_shown(looked, j)] if own > min(misfit, SURE)}
    alone = list(off)
    shown = [(misfit, name, j) for j, (misfit, name) in off.items() if misfit < SURE]
    tried = [(contradicting(v, p, looked, FEW), text, p) for text, v, p in _descriptions(plan, values, looked)]
    least = min(left for left, _, _ in tried)
    if plain := [entry for entry in shown if entry[1] in PLAIN and single[entry[2]][0] <= least + ALIKE]:
        found, shot = _one(looked, min(plain)[2], min(plain)[1])
        inverted = next((text for left, text, _ in tried if text == INVERTED and left <= least + ALIKE), "")
        return (Note(f"{found}; or {inverted}", "mistake"), shot) if inverted and least <= most else (found, shot)
    wider = 1.0
    if looked.lines < _room(looked):
        wider = contradicting(looked.values, looked.patterns, replace(looked, lines=_room(looked)), FEW)
    if wider <= most and wider + ALIKE < least:  # more lines allow for more
        word = "width" if looked.axis == "x" else "height"
        why = f": they fit if the projector has more than {looked.lines} lines: {word} in project.json"
        also = "; they fit if columns and rows are exchanged: axis" if looked.lines < looked.across else ""
        return Note(why + also, "mistake"), None
    if least <= most:  # several may fit: of those that change the same the plain ones come first
        plainest: dict[tuple[str, ...], str] = {}
        for left, text, described in tried:
            changed = {type(p).__name__ for p, own in zip(described, looked.patterns, strict=True) if p != own}
            # a period that is no whole number of lines looks like more than frames can, and fits with any shift
            if left <= (most if _slipped(looked.patterns, described) else least + min(ALIKE, share / 10)):
                plainest.setdefault(tuple(sorted(changed)), text)
        return Note(f": {'; '.join(plainest.values())}", "mistake"), None
    everywhere = np.ones(looked.values.shape[1], np.bool_)
    if (steps := exchanged_steps(looked.patterns, looked.values, everywhere, np.inf)) and steps[0].shots:
        return _exchange(*(looked.shots[i] for i in steps[0].shots))
    for bands, why in LEVELLED.items():
        levelled = _levelled(looked, bands)
        if levelled is not None and contradicting(levelled, looked.patterns, looked, FEW) <= max(most, LEFT):
            return Note(why, "mistake"), None
    if shown:
        _, name, j = min(shown)
        twins = [k for k, p in enumerate(looked.patterns) if describe(p) == name]
        if taken := [k for k in twins if _exchanged(looked, j, k) <= most]:
            return _exchange(looked.shots[j], looked.shots[taken[0]])
        return _one(looked, j, name)
    if len(looked.shots) <= MOST_FRAMES:
        kinds = [type(p) for p in looked.patterns]
        alike = [(i, k) for i, k in combinations(range(len(looked.shots)), 2) if kinds[i] == kinds[k]]
        left, i, k = min((_exchanged(looked, i, k), i, k) for i, k in alike)
        if left <= most:
            return _exchange(looked.shots[i], looked.shots[k])
    tries = [(j, i) for j in alone or range(len(looked.shots)) for i in _across(plan, looked, j)]
    if len(tries) <= MOST_FRAMES**2:
        left, j, i = min(((_replaced(looked, j, values[i]), j, i) for j, i in tries), default=(1.0, 0, 0))
        if left <= most:
            return _exchange(looked.shots[j], i)
    if alone:
        return _one(looked, min(single)[1], "something else, a frame of another capture?")
    why = (
        "frames are of another capture or sequence, something moved, the light changed, grey values were edited, or "
        "the patterns are not what was shown"
    )
    return Note(f": {why}"), None


def _levelled(looked: Looked, bands: int) -> Array | None:
    """Values (k, n) without level and gain that every frame has of its own in each band of rows; None without any."""
    values, uneven = looked.values.copy(), False
    for some in np.array_split(np.argsort(looked.at[0], kind="stable"), bands):
        found = _of_band(looked, looked.values[:, some])
        if found is not None:
            values[:, some], differ = found
            uneven |= differ
    return values if uneven else None


def _of_band(looked: Looked, seen_there: Array) -> tuple[Array, bool] | None:
    """Values (k, n) without level and gain of each frame, by the lines told, and whether these differ."""
    possible, _ = looks(looked.patterns, looked.lines)
    values = seen_there
    for _ in range(LEVELLING):
        light = possible[:, nearest(values, possible)[1]]
        levelled, gains, levels = [], [], []
        for shown, seen in zip(light, seen_there, strict=True):
            ends = [w for w in (shown < 0.3, shown > 0.7) if w.sum() >= LEAST_LEVEL * len(shown)]
            if not ends:
                return None
            told, here = ([median_of(each[w]) for w in ends] for each in (shown, seen))
            if len(ends) == 1:  # dark or bright all over: a level or a gain
                told, here = (
                    ([0.0, *told], [0.0, *here]) if told[0] > 0.5 else ([*told, 1 + told[0]], [*here, 1 + here[0]])
                )
            gain = (here[1] - here[0]) / (told[1] - told[0])
            if not 1 / MOST_GAIN < gain < MOST_GAIN:
                return None
            levelled.append((seen - here[0]) / gain + told[0])
            gains.append(gain)
            levels.append(here[0] - gain * told[0])
        values = np.array(levelled, np.float32)
    return values, max(np.ptp(gains), np.ptp(levels)) >= UNLIKE


def left_unexplained(looked: Looked, few: int = PIXELS) -> tuple[float, float]:
    """Shares of pixels that no declared line explains, and none that the code can tell."""
    some = spaced(looked.values.shape[1], few)
    bad, straight = unexplained(looked.values[:, some], looked.patterns, looked, 2 if few == PIXELS else 0)
    left = bad.copy()
    if _room(looked) > looked.lines and bad.any():
        left[bad] = unexplained(straight[:, bad], looked.patterns, replace(looked, lines=_room(looked)), 0)[0]
    return float(bad.mean()), float(left.mean())


def _room(looked: Looked) -> int:
    """How many lines the code can tell."""
    return max((p.cell << p.bits for p in looked.patterns if isinstance(p, Code)), default=0)


def told_otherwise(plan: Plan, values: Array, looked: Looked, left: float) -> bool:
    """Whether a mistake in the description fits as well as more lines, which leave this share of the pixels.

    A code that is read wrongly tells lines that are not there, too. The arguments are as of `explanation`.
    """
    most = left + ALIKE / 2
    return any(contradicting(v, p, looked, FEW) <= most for _, v, p in _descriptions(plan, values, looked))


def more_lines(looked: Looked, share: float, left: float) -> str:
    """Say that the projector has more lines than declared, where these explain what contradicts; else nothing."""
    if share - left <= BEYOND or share >= MOST_BEYOND:
        return ""
    left = contradicting(looked.values, looked.patterns, replace(looked, lines=_room(looked)))  # now with all pixels
    if share - left <= BEYOND or left > max(FITS * share, LEFT):
        return ""
    along, word = ("columns", "width") if looked.axis == "x" else ("rows", "height")
    return (
        f"frames across {along} contradict each other in {share:.0%} of the pixels: they fit if the projector has more "
        f"than {looked.lines} lines: {word} in project.json"
    )


def too_fine(looked: Looked) -> str:
    """Say that the finest stripes are narrower than pixels resolve, by the lines that the pixels are told."""
    periods = [p.period for p in looked.patterns if isinstance(p, Phase)]
    if not periods or not any(isinstance(p, Code) for p in looked.patterns):
        return ""
    possible, line = looks(looked.patterns, looked.lines)
    told = line[nearest(looked.values, possible)[1]].astype(np.float64)
    A = np.column_stack([*looked.at, np.ones_like(told)])
    keep = np.ones(len(told), bool)
    for _ in range(4):
        across = np.linalg.lstsq(A[keep], told[keep], rcond=None)[0]
        off = np.abs(told - A @ across)
        keep = off <= 3 * median_of(off) + 1e-6
    width = min(periods) / max(float(np.hypot(*across[:2])), 1e-9)
    if width >= RESOLVED:
        return ""
    along = "columns" if looked.axis == "x" else "rows"
    return (
        f"frames across {along}: stripes of {min(periods):g} lines are {width:.1f} px wide in the camera, which "
        f"resolves {RESOLVED:g} at best: show longer periods and wider cells, or let the camera come nearer"
    )


def degrees(looked: Looked) -> str:
    """Say that shifts are degrees, where as such the steps of every period are evenly spaced and make a wave."""
    phases = [(p, seen) for p, seen in zip(looked.patterns, looked.values, strict=True) if isinstance(p, Phase)]
    for period in {p.period for p, _ in phases}:
        given = np.array([p.shift_rad for p, _ in phases if p.period == period])
        seen = np.array([seen for p, seen in phases if p.period == period])
        (uneven, rest), (even, left) = (_steps(given, seen), _steps(np.radians(given), seen))
        if even > EVEN_STEPS or uneven < 2 * EVEN_STEPS or (len(given) > 3 and left > 0.8 * rest):
            return ""
    if not phases:
        return ""
    least, most = (choose(p.shift_rad for p, _ in phases) for choose in (min, max))
    along = "columns" if looked.axis == "x" else "rows"
    return f"shift_rad of frames across {along} is in degrees ({least:g} to {most:g}): give it in radians"


def _steps(shifts: NDArray[np.float64], seen: Array) -> tuple[float, float]:
    """How unevenly steps are spaced, 0 to 1, and the r.m.s. that a wave leaves of their grey values (k, n)."""
    design = np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)
    rest = seen - design @ np.linalg.lstsq(design, seen, rcond=None)[0]
    return float(abs(np.exp(1j * shifts).mean())), float(np.sqrt(np.mean(rest**2)))


def _descriptions(plan: Plan, values: Array, looked: Looked) -> Iterator[tuple[str, Array, Sequence[Pattern]]]:
    """Other descriptions of the same frames: words, values and patterns."""
    own, patterns = looked.values, looked.patterns
    yield "they fit if all frames are inverted: bright and dark are exchanged", 1 - own, patterns
    yield "they fit in reverse order", values[::-1][list(looked.shots)], patterns
    for k in (1, -1, 2, -2):
        moved = np.roll(values, k, axis=0)[list(looked.shots)]
        yield f"they fit if every frame stands {abs(k)} {'later' if k < 0 else 'earlier'} in the list", moved, patterns
    for first in (0, 1):
        as_text = np.argsort([str(k + first) for k in range(len(values))])
        if (as_text != np.arange(len(values))).any():
            text = "they fit if their files are sorted by number: now 10 stands before 2, as in a sorted text"
            yield text, values[np.argsort(as_text)][list(looked.shots)], patterns
    if (beside := _beside(plan, looked)) is not None:
        text = "they fit if the phase steps of columns and rows are exchanged: axis"
        yield text, values[beside], patterns
    phases = [p for p in patterns if isinstance(p, Phase)]
    codes = [p for p in patterns if isinstance(p, Code)]
    for period, other in combinations(sorted({p.period for p in phases}), 2):
        text = f"they fit if the periods of {period:g} and {other:g} lines are exchanged"
        yield text, own, _of_periods(patterns, {period: other, other: period})
    others = [
        (p, q, abs(q / p - 1) < NEAR) for p in sorted({p.period for p in phases}) for q in _other_periods(p, codes)
    ]
    for period, other, near in others:
        if near:  # before shifts, which explain half of the field
            yield _of_period(period, other, own, patterns)
    if phases:
        yield "they fit if the phase steps run the other way: the sign of shift_rad", own, _phases(patterns, sign=-1)
        for sign, way in ((1, ""), (-1, " and run the other way")):
            for turn in _turns(phases):
                when = f"{abs(turn):g}° {'later' if turn > 0 else 'earlier'}"
                words = f"they fit if the phase steps begin {when}{way}"
                yield f"{words}: shift_rad", own, _phases(patterns, sign=sign, shift=turn * pi / 180)
    for period, other, near in others:
        if not near:
            yield _of_period(period, other, own, patterns)
    if codes:
        own_cell, cells = codes[0].cell, 1 << codes[0].bits
        for cell in (own_cell / 2, own_cell * 2, own_cell / 4, own_cell * 4, own_cell - 1, own_cell + 1):
            tells = cell * cells >= min(looked.lines, own_cell * cells)  # decoding refuses what does not
            if tells and cell % 1 == 0 and all(p.cell == own_cell for p in codes):
                changed = [replace(p, cell=int(cell)) if isinstance(p, Code) else p for p in patterns]
                yield f"they fit with a cell of {cell:.0f} lines, not {own_cell}", own, changed
        kind: Literal["gray", "binary"] = "binary" if codes[0].kind == "gray" else "gray"
        changed = [replace(p, kind=kind) if isinstance(p, Code) else p for p in patterns]
        yield f"they fit as {kind} code, not {codes[0].kind}", own, changed
        changed = [replace(p, bit=p.bits - 1 - p.bit) if isinstance(p, Code) else p for p in patterns]
        yield "they fit with the bits in reverse order", own, changed
        changed = [replace(p, inverse=not p.inverse) if isinstance(p, Code) else p for p in patterns]
        yield INVERTED, own, changed


def _of_period(
    period: float, other: float, own: Array, patterns: Sequence[Pattern]
) -> tuple[str, Array, Sequence[Pattern]]:
    text = f"they fit with a period of {other:g} lines, not {period:g}"
    return text, own, _of_periods(patterns, {period: other})


def _of_periods(patterns: Sequence[Pattern], others: Mapping[float, float]) -> list[Pattern]:
    return [replace(p, period=others.get(p.period, p.period)) if isinstance(p, Phase) else p for p in patterns]


def _slipped(patterns: Sequence[Pattern], described: Sequence[Pattern]) -> bool:
    """Whether periods are others than described, and near them."""
    pairs = [(p, own) for p, own in zip(described, patterns, strict=True) if p != own]
    return bool(pairs) and all(
        isinstance(p, Phase) and isinstance(own, Phase) and 0 < abs(p.period / own.period - 1) < NEAR
        for p, own in pairs
    )


def _beside(plan: Plan, looked: Looked) -> list[int] | None:
    """Numbers of the frames with the same phase steps along the other axis in the place of these; None without."""
    shown = [(i, p) for i, p in enumerate(plan.shots) if isinstance(p, Phase) and p.axis != looked.axis]
    other = {replace(p, axis=looked.axis): i for i, p in shown}
    shots = [
        other.get(p, -1) if isinstance(p, Phase) else i for i, p in zip(looked.shots, looked.patterns, strict=True)
    ]
    return None if shots == [*looked.shots] or -1 in shots else shots


def _other_periods(period: float, codes: Sequence[Code]) -> list[float]:
    """Periods that sequences usually have beside a code, near ones first."""
    usual = {c.cell * n for c in codes for n in (1, 2, 4, 8)} | {period / 2, period * 2, round(period)}
    return sorted((p for p in usual if p >= 2 and abs(p / period - 1) > 1e-6), key=lambda p: abs(np.log(p / period)))


def _turns(phases: Sequence[Phase]) -> list[float]:
    """Degrees by which steps may begin wrongly: half a line, a step, sine taken for cosine, or half a period."""
    own = {round(360 / p.steps, 1) for p in phases} | {round(180 / p.period, 1) for p in phases}
    return [sign * turn for turn in sorted({*own, 90.0}) for sign in (1, -1)] + [180.0]


def _phases(patterns: Sequence[Pattern], sign: int = 1, shift: float = 0.0) -> list[Pattern]:
    return [replace(p, shift_rad=sign * p.shift_rad + shift) if isinstance(p, Phase) else p for p in patterns]


def _without(patterns: Sequence[Pattern], j: int) -> list[Pattern]:
    return [p for k, p in enumerate(patterns) if k != j]


def _exchanged(looked: Looked, i: int, k: int) -> float:
    """Share of pixels that contradict themselves with two frames in each other's place."""
    swapped = looked.values.copy()
    swapped[[i, k]] = swapped[[k, i]]
    return contradicting(swapped, looked.patterns, looked, FEW)


def _replaced(looked: Looked, j: int, seen: Array) -> float:
    """Share of pixels that contradict themselves with other values in a frame's place."""
    values = looked.values.copy()
    values[j] = seen
    return contradicting(values, looked.patterns, looked, FEW)


def _across(plan: Plan, looked: Looked, j: int) -> list[int]:
    """Numbers of the other axis' frames of the kind of one of these: it may stand for one of them."""
    other = (i for i, p in enumerate(plan.shots) if axis_of(p) not in (looked.axis, None))
    return [i for i in other if type(plan.shots[i]) is type(looked.patterns[j])]


def _exchange(*shots: int) -> tuple[Note, int]:
    first, second = sorted(shots)
    return Note(f": frames {first} and {second} were exchanged", "mistake"), first


def _one(looked: Looked, j: int, shows: str) -> tuple[Note, int]:
    shot = looked.shots[j]
    return Note(f": frame {shot} claims {describe(looked.patterns[j])} and shows {shows}", "value"), shot


def _shown(looked: Looked, j: int) -> tuple[float, float, str]:
    """How far a frame is off what it claims, by the lines that others tell, squared, and off what it shows; that."""
    some = spaced(looked.values.shape[1], FEW)
    possible, _ = looks(looked.patterns, looked.lines)
    others = [k for k in range(len(looked.patterns)) if k != j]
    _, best = nearest(looked.values[others][:, some], possible[others])
    seen = looked.values[j, some]
    misfit = {describe(p): _unlike(seen, possible[k, best]) for k, p in enumerate(looked.patterns)}
    own = misfit.pop(describe(looked.patterns[j]))
    misfit |= {"its inverse": _unlike(looked.inverted[j, some], possible[j, best])}
    misfit["white"] = _unlike(seen, np.ones_like(seen), EVEN)
    misfit["black"] = _unlike(np.maximum(seen, 0), np.zeros_like(seen), EVEN)  # may be darker than ambient light
    name, value = min(misfit.items(), key=lambda item: item[1])
    _, best = nearest(looked.values[:, some], possible)  # without it two lines may look the same
    return min(own, _unlike(seen, possible[j, best])), value, name


def _unlike(seen: Array, light: Array, most: float = MOST_PIXELS) -> float:
    """Mean squared difference of the pixels that fit best: at edges the others may tell the line wrongly."""
    return float(np.mean(np.sort((seen - light) ** 2)[: int(most * len(seen)) + 1]))
