"""Frames that hold light of the pattern after or before: exposed over a change of patterns, or shown with a lag."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.model import Plan
from core.numerics import median_of, normal_equations, quantile_of, spaced
from core.patterns import Code, level_of
from core.verify.contradictions import Looked, contradicting, looks
from core.verify.lookup import nearest_within

Array = NDArray[np.float32]

PIXELS = 200  # looked up
HALF = np.float32(0.5)  # of its neighbour's light, which a frame may hold: lines are told without it, and with it
DARK, BRIGHT = 0.1, 0.9  # of full light, beyond which a line is off or on: at edges a response of the light shows
LEAST, MOST = 0.06, 0.75  # of its neighbour's light: sound captures of two rigs have 0.006; more is that itself
FEW, ALIKE = 0.2, 0.05  # of the frames may be off by more; wrong lines that agree with themselves: 0.07 and more
FRAMES = 4  # that tell it
SAME = 0.9  # correlation of two frames' light, beyond which one cannot be told from the other
LEFT, FEW_LEFT = 0.35, 0.18  # of the contradictions that may stay; of all pixels, where there are few

CURE = (
    "exposed over two patterns, or the projector's picture lags; let the projector trigger the camera, expose for less "
    "time than a pattern stands, or wait longer after each pattern (settle_ms)"
)


def overlapping(plan: Plan, looked: Looked, share: float, most: float) -> str:
    """Say that every frame of an axis holds light of its neighbour in time; nothing where they do not.

    Code frames tell it, by what they are off the lines told: steps of one period that hold some of the next one are
    steps of another shift. `share` of the pixels contradict themselves as described, of sound captures `most`.
    """
    codes = [j for j, p in enumerate(looked.patterns) if isinstance(p, Code)]
    if len(codes) < FRAMES:
        return ""
    possible, _ = looks(looked.patterns, looked.lines)
    values = looked.values[:, spaced(looked.values.shape[1], PIXELS)]
    plain = nearest_within(values, possible, looked.limit)[1]
    found = []
    for way in (1, -1):
        near = {j: _light(plan, looked, possible, k + way) for j, k in enumerate(looked.shots)}
        beside = {j: light for j, light in near.items() if light is not None}
        keep = [*beside]
        own, other = possible[keep], np.array([*beside.values()], np.float32).reshape(-1, possible.shape[1])
        of = [j for j in codes if j in beside]
        if len(of) < FRAMES:
            continue
        for best in (plain, None) if share > most else (plain,):
            if best is None:
                best = nearest_within(values[keep], own + HALF * (other - own), looked.limit)[1]
            told = _held(values[of], possible[of][:, best], np.array([beside[j][best] for j in of]))
            if len(told) < FRAMES or quantile_of(told, 1 - FEW) - quantile_of(told, FEW) > ALIKE:
                continue
            if LEAST < (held := median_of(told)) < MOST:
                apart = values[keep] - np.float32(held) * (other - own)[:, best]
                found.append((contradicting(apart, [looked.patterns[j] for j in keep], looked, PIXELS), held, way))
    left, held, way = min(found, default=(1.0, 0.0, 0))
    if left > max(LEFT * share, FEW_LEFT):
        return ""
    along, which = "columns" if looked.axis == "x" else "rows", "after" if way > 0 else "before"
    return f"frames across {along}: every frame holds about {held:.0%} of the light of the one {which} it: " + CURE


def _light(plan: Plan, looked: Looked, possible: Array, shot: int) -> Array | None:
    """Light of a frame, of this axis or even, on the lines looked up; None of any other."""
    if shot in looked.shots:
        return possible[looked.shots.index(shot)]
    level = level_of(plan.shots[shot]) if 0 <= shot < len(plan.shots) else None
    return None if level is None else np.full(possible.shape[1], level, np.float32)


def _held(seen: Array, own: Array, other: Array) -> NDArray[np.float64]:
    """Shares of another light that frames hold, from what is seen (k, n) and both lights; not where these are alike."""
    sure = (own < DARK) | (own > BRIGHT)
    lights = np.stack([own, other])
    apart = np.min(
        np.max(lights, axis=2, where=sure, initial=0) - np.min(lights, axis=2, where=sure, initial=1), axis=0
    )
    A = np.stack([np.ones_like(own), own, other], axis=2).astype(np.float64)
    N, b = normal_equations(A, sure.astype(np.float64), seen[..., None].astype(np.float64))
    count = np.maximum(N[:, :1, :1], 1)
    spread = N[:, 1:, 1:] / count - N[:, 1:, :1] * N[:, :1, 1:] / count**2
    alike = spread[:, 0, 1] ** 2 > SAME**2 * spread[:, 0, 0] * spread[:, 1, 1]
    tells = (N[:, 0, 0] >= own.shape[1] / 4) & (apart >= HALF) & ~alike
    light, held = np.linalg.solve(N[tells], b[tells])[:, 1:, 0].T
    lit = light + held > DARK
    return np.asarray(held[lit] / (light + held)[lit])
