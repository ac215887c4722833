"""Phases that stand beside the code, or run away from it or from each other: every coordinate is off by a little.

No frame contradicts another one then. Shifts that begin wrongly are off alike all over, periods in proportion to the
line. The edges of the code are lines that are known: where they lie by the decoded phases is seen along rows and
columns of the image. A response of the light moves rising and falling edges apart, by the same to either side. Without
a code the phases of two periods are compared, over lengths in which a response of the light is evened out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import pi

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Array
from core.model.finding import Finding
from core.numerics import sigma_about_median
from core.patterns import Axis, Code, Pattern, Phase, brightness
from core.verify.edges import SECTIONS, code_edges
from core.verify.turns import turning

CODES = 3  # finest frames of the code
LEAST, FEWEST = 8, 5  # pixels that tell an edge or a cycle, and such edges or cycles that tell something
SCATTER = 0.25  # of a cell or period, beyond which pixels of one edge or cycle are in doubt
CYCLES = 2  # of the longer period in the field, over which lengths are compared; fewer are taken as they are
BESIDE, AWAY = 0.25, 0.2  # lines: all over, and over the field; 38 sound captures of 19 rigs have below 0.05
SIGMAS = 7.0  # of what edges or cycles scatter about a steady change
STRONG, BRIGHT = 0.5, 0.9  # of the strength of fringes that a quantile of the pixels does not reach
MORE = 0.02  # correlation with another profile, of 0.1 that sharp waves have
PIXELS = 500  # on which periods are tried
CHANCE = 0.25  # of the way from one place to the next: how far chance is from the nearer, in the median
UNLIKE, LEFT = 0.5, 0.35  # of what chance leaves, where phases belong to no line; of that, and in turns, if right
MOST_SLOPE = 0.05  # by which a period may be off
PARTS = 8  # of the field, each a finest period, by which such few cycles are told apart from a response
PLAIN = 3.0  # times what is left, that phases run apart; indirect light gave 1.0, a period 2 % off 5
FROM_0 = 0.3  # of the change, that it may be off where line 0 would be: other periods agree there


@dataclass(frozen=True)
class Off:
    """How far phases are off, in lines: all over, over the field, and per line; 0 where that is chance."""

    beside: float
    away: float
    slope: float


def beside_code(
    patterns: Sequence[Pattern],
    images: Sequence[NDArray],
    maps: Sequence[tuple[Axis, NDArray, str]],
    lines: tuple[int, int],
) -> list[Finding]:
    """Compare phases with the code, or with each other; `maps` are decoded coordinates (H, W) and what they count.

    `lines` are the projector's columns and rows.
    """
    found, looked_at = [], 0
    for axis, places, along in maps:
        steps: dict[float, list[int]] = {}
        for k, p in enumerate(patterns):
            if isinstance(p, Phase) and p.axis == axis:
                steps.setdefault(p.period, []).append(k)
        steps = {period: steps[period] for period in sorted(steps) if len(steps[period]) >= 3}
        codes = [(p.bit, k) for k, p in enumerate(patterns) if isinstance(p, Code) and p.axis == axis and not p.inverse]
        if not steps or (codes and not np.isfinite(places).any()):
            continue
        if codes:
            finest = [k for _, k in sorted(codes)[-CODES:]]
            text = _of_code(patterns, images, places, finest, steps[min(steps)])
        else:
            text = _of_periods(patterns, images, places, steps, lines[axis == "y"])
        looked_at += 1
        if text:
            found.append(Finding("identity", "bad", f"frames across {along}: {text}", names="mistake"))
    if looked_at > len(found) == 1:  # patterns are described alike along both axes
        found = [replace(f, text=f"{f.text}; or what is seen moved between them") for f in found]
    return found


def _of_code(
    patterns: Sequence[Pattern], images: Sequence[NDArray], lines: NDArray, codes: Sequence[int], steps: Sequence[int]
) -> str:
    ways = [code_edges(patterns, images, lines, codes, steps, turned) for turned in (False, True)]
    cell = min(p.cell for k in codes if isinstance(p := patterns[k], Code))
    wave = patterns[steps[0]]
    assert isinstance(wave, Phase)
    turns = turning(patterns, images, ways, steps, cell)
    found = turns and _steady(np.asarray(turns.key // 2 - 0.5), turns.off, turns.key % 2 > 0)
    if turns and turns.far and found:
        return (
            f"from edge to edge of the code the phase turns {1 + found.slope:.4g} times as often as it should: they "
            f"fit with a period of {wave.period / (1 + found.slope):.5g} lines, not {wave.period:g}"
        )
    if found and found.away:
        return (
            f"the phase runs away from the code, by {abs(found.away):.2f} lines over the field: they fit with a period "
            f"of {wave.period / (1 + found.slope):.5g} lines, not {wave.period:g}"
        )
    key, off = (np.concatenate([getattr(edges, name) for edges in ways]) for name in ("key", "off"))
    place, middle = _medians(key[np.isfinite(off)], off[np.isfinite(off)], SCATTER * cell)
    found = _steady(np.asarray(place // 2 - 0.5, np.float64), middle, place % 2 > 0)
    if found is None or not found.beside:
        return ""
    way, when = ("before", "later") if found.beside < 0 else ("behind", "earlier")
    turn = abs(found.beside) * 360 / wave.period
    return (
        f"the phase of period {wave.period:g} stands {abs(found.beside):.2f} lines {way} the edges of the code, all "
        f"over: they fit if the phase steps begin {turn:.3g}° {when}: shift_rad"
        f"{_other_profile(patterns, images, lines, steps)}"
    )


def _other_profile(patterns: Sequence[Pattern], images: Sequence[NDArray], lines: NDArray, steps: Sequence[int]) -> str:
    """Say that steps look more like waves of the other profile, at the lines decoded."""
    thin = tuple(slice(None, None, -(-n // (4 * SECTIONS))) for n in lines.shape)
    valid = np.isfinite(lines[thin])
    seen = np.array([images[k][thin][valid] for k in steps], np.float64)
    seen -= seen.mean(axis=0)
    at = np.rint(lines[thin][valid]).astype(np.int64)
    alike = {}
    for profile in ("sine", "square"):
        waves = [replace(p, profile=profile) for k in steps if isinstance(p := patterns[k], Phase)]
        shown = np.array([brightness(wave, at) for wave in waves], np.float64)
        shown -= shown.mean(axis=0)
        alike[profile] = float(np.sum(seen * shown) / np.sqrt(np.sum(seen**2) * np.sum(shown**2)))
    said = next(p.profile for k in steps if isinstance(p := patterns[k], Phase))
    other = "sine" if said == "square" else "square"
    if alike[other] < alike[said] + MORE:
        return ""
    return f"; or their profile is {other}, which they look like, not {said}"


def _of_periods(
    patterns: Sequence[Pattern],
    images: Sequence[NDArray],
    lines: NDArray,
    steps: Mapping[float, Sequence[int]],
    count: int,
) -> str:
    """Compare the finest period with the next one."""
    if len(steps) < 2:
        return ""
    finest, other = list(steps)[:2]
    few = count < CYCLES * other
    thin = tuple(slice(None, None, -(-n // (4 * SECTIONS))) for n in lines.shape)
    (turn, strong), (beside, _) = (
        _turns(patterns, [images[k][thin] for k in steps[p]], steps[p]) for p in steps if p <= other
    )

    def told(how: str, slope: float) -> str:
        return (
            f"the phases of periods {finest:g} and {other:g} {how}: they fit with a period of "
            f"{finest / (1 + slope):.5g} lines, not {finest:g}, or of {other * (1 + slope):.5g}, not {other:g}"
        )

    if not few and (slope := _unlike(finest, turn[strong], other, beside[strong], count)) is not None:
        return told("agree on no line", slope)
    u = np.asarray(lines[thin], np.float64)
    valid = np.isfinite(u)
    if not valid.any():
        return ""
    u = u[valid]
    places = [p * (t + np.round((u + 0.5) / p - t)) for p, t in ((finest, turn[valid]), (other, beside[valid]))]
    if few:
        part, middle = _medians(np.floor(places[0] / finest).astype(np.int64), places[0] - places[1], finest)
        wave = 2 * pi * len(steps[other]) / other  # of the errors by a response
        slope = _running_apart(np.asarray((part + 0.5) * finest, np.float64), middle, wave)
        bent = f"; or light by a second way bends those of period {other:g}"
        return told(f"run apart, by {abs(slope) * count:.2g} lines over the field", slope) + bent if slope else ""
    length = max(finest, other / len(steps[other]))  # of which the errors by a response are a whole part
    part = np.floor((u + 0.5) / length).astype(np.int64)
    own = (part > part.min()) & (part < part.max())  # whole ones
    place, middle = _medians(part[own], (places[0] - places[1])[own], SCATTER * finest)
    found = _steady(np.asarray((place + 0.5) * length - 0.5, np.float64), middle, np.ones(len(place), bool))
    if found is None or not found.away:
        return ""
    return told(f"run apart, by {abs(found.away):.2f} lines over the field", found.slope)


def _running_apart(place: Array, off: Array, wave: float) -> float:
    """Slope of what grows from line 0 beside an error that repeats, at so many rad a line, as a response makes it.

    Indirect light bends the phases of a long period, too; but neither evenly nor from line 0. What is not plain is 0.
    """
    if len(place) < PARTS:
        return 0.0
    A = np.stack([place, np.cos(wave * place), np.sin(wave * place)], axis=1)
    found = np.linalg.lstsq(A, off, rcond=None)[0]
    rest = float(np.sqrt(np.sum((off - A @ found) ** 2) / (len(place) - A.shape[1])))
    slope, sigma = float(found[0]), rest * float(np.linalg.inv(A.T @ A)[0, 0]) ** 0.5
    plain = abs(slope) > SIGMAS * sigma and abs(slope) * np.sqrt(np.mean(place**2)) > PLAIN * max(rest, AWAY)
    return slope if plain else 0.0


def _turns(
    patterns: Sequence[Pattern], images: Sequence[NDArray], steps: Sequence[int]
) -> tuple[Array, NDArray[np.bool_]]:
    """Phases (H, W) of a period, in turns, and where its fringes are strong."""
    shifts = np.array([p.shift_rad for k in steps if isinstance(p := patterns[k], Phase)])
    A = np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1)
    _, c, s = np.tensordot(np.linalg.pinv(A), np.array(images, np.float64), 1)
    strength = np.hypot(c, s)
    return np.arctan2(s, c) / (2 * pi), strength > STRONG * np.quantile(strength, BRIGHT)


def _unlike(finest: float, turn: Array, other: float, beside: Array, count: int) -> float | None:
    """Relative error of a period where, with it, phases (n,) of both belong to no line, and corrected they do."""
    some = slice(None, None, max(1, len(turn) // PIXELS))
    turn, beside = turn[some], beside[some]
    orders = np.arange(-1, int(count / finest) + 1)

    def apart(slope: float) -> Array:
        """How far the nearest lines of both phases are from each other, by chance and in turns; medians."""
        away = finest / (1 + slope) * (turn[:, None] + orders) / other - beside[:, None]
        above = (away - np.floor(away)).min(axis=1)
        below = (np.ceil(away) - away).min(axis=1)
        nearest = np.minimum(above, below)
        return np.median([nearest / np.maximum(above + below, 1e-9) / CHANCE, nearest], axis=1)

    if len(turn) < PIXELS or (described := apart(0.0))[0] < UNLIKE:
        return None
    slopes = np.arange(-MOST_SLOPE, MOST_SLOPE, SCATTER / 2 / count)
    left = [float(np.max(apart(slope) / described)) for slope in slopes]
    best = int(np.argmin(left))
    return float(slopes[best]) if left[best] < LEFT else None


def _medians(key: NDArray[np.int64], values: Array, most: float) -> tuple[NDArray[np.int64], Array]:
    """Medians of the values of each key, where enough of them agree to `most`."""
    order = np.lexsort((values, key))
    key, values = key[order], values[order]
    first = np.flatnonzero(np.diff(key, prepend=-1))
    count = np.diff(first, append=len(key))
    use = count >= LEAST
    first, count = first[use], count[use]
    low, high = values[first + count // 4], values[first + 3 * count // 4]
    agree = high - low < most
    return key[first[agree]], values[first + count // 2][agree]


def _steady(line: Array, off: Array, rising: NDArray[np.bool_]) -> Off | None:
    """Fit a straight change, beside what rising and falling edges differ; what is not significant is 0."""
    if len(line) < FEWEST or (not rising.all() and min(rising.sum(), (~rising).sum()) < 2):
        return None
    centre = line.mean()
    A = np.stack([line - centre, np.ones(len(line)), np.where(rising, 0.5, -0.5)], axis=1)[:, : 2 + (not rising.all())]
    use = np.ones(len(line), bool)
    for _ in range(3):
        found = np.linalg.lstsq(A[use], off[use], rcond=None)[0]
        rest = off - A @ found
        use = np.abs(rest) <= 4 * max(sigma_about_median(rest), 1e-3)
        if use.sum() < FEWEST:
            return None
    sigma = np.sqrt(
        np.sum(rest[use] ** 2) / max(use.sum() - A.shape[1], 1) * np.diag(np.linalg.pinv(A[use].T @ A[use]))
    )
    slope, middle = found[:2]
    away, from_0 = float(slope * np.ptp(line)), float(slope * (centre + 0.5))
    runs = abs(away) > AWAY and abs(slope) > SIGMAS * sigma[0] and abs(middle - from_0) < FROM_0 * abs(from_0)
    beside = abs(middle) > BESIDE and abs(middle) > SIGMAS * sigma[1]
    return Off(float(middle) * beside, away * runs, float(slope))
