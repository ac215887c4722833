"""What the steps of a period show beside their wave: light of the frame after or before, or of another shift.

The coordinate bends by it, and contradicts no line of the projector. Each cause leaves a misfit of its own between the
steps, in proportion to light that is seen; a response of the light leaves harmonics of the wave. More or less light of
one step is a cause, too, which decoding takes out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import product
from math import degrees
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Array, Plan
from core.model.finding import Finding
from core.numerics import quantile_of, spaced
from core.patterns import Axis
from core.verify.overlapping import CURE
from core.verify.pixels import LEAST_LIT
from core.verify.quality import BRIGHT, Sampled
from core.verify.steps import ALL_ROUND, beside_waves, steps_of_periods

PIXELS = 1500  # looked at
LEAST = 0.04  # share, ratio or rad that is told: sound periods of real captures have 0.06 that explain nothing
LEFT = 0.5  # of the squared misfit, where a cause explains it; of those sound periods 0.9 and more
SHARES = (0.05, 0.1, 0.2, 0.3, 0.4)  # at which frames are taken apart that all hold light of others
ALIKE = 1.5, 0.02  # times what the best cause leaves, and more: others that leave less explain as much
MOST = 0.75  # of another frame's light, or of its own: more is no such cause
HARMONICS = (2, 3, 4)  # by which a response bends waves
TINY = 1e-12
HELD_BY_ALL = "held_by_all"  # of figures: the share of a neighbour's light, where every frame holds some

Kind = Literal["mixed", "shift", "light"]
KINDS: tuple[Kind, ...] = ("mixed", "shift")  # the likelier first; more or less light is taken out when decoding
CURES = {"mixed": CURE, "shift": "correct shift_rad, or see what the projector shows and whether something moves"}


@dataclass(frozen=True)
class Cause:
    """What may be wrong with some shots, in words, and the misfit (rows, n) that so `much` of it makes.

    It is a share of another frame's light, a part of the own light, or rad.
    """

    kind: Kind
    shots: tuple[int, ...]
    words: str
    misfit: Array
    much: float = 1.0

    @property
    def pair(self) -> bool:
        """Whether one frame holds light of one other."""
        return self.kind == "mixed" and len(self.shots) == 2


@dataclass(frozen=True)
class Likely:
    """A cause, by what factor its misfit is seen, and the part of the squared misfit that is left then."""

    cause: Cause
    factor: float
    left: float

    @property
    def much(self) -> float:
        """How much of it is seen."""
        return self.factor / (1 + self.factor) if self.cause.pair else self.factor * self.cause.much

    @property
    def possible(self) -> bool:
        """Whether there can be so much of it."""
        if self.cause.kind == "mixed":  # much of another's light is told by what is added, never taken away
            return self.factor > 0 and self.much <= MOST
        return abs(self.much) <= MOST

    def told(self, plan: Plan) -> str:
        """The cause in words."""
        size, more = abs(self.much), "more" if self.much > 0 else "less"
        frame, other = (plan.place(self.cause.shots[at]) for at in (0, -1))
        return self.cause.words.format(frame=frame, other=other, share=size, degrees=degrees(size), more=more)


def misfitting_steps(plan: Plan, sampled: Sampled) -> dict[Axis, Finding]:
    """Find what explains the misfit of the steps of a period, by axis: that which explains most of one."""
    found: dict[Axis, list[Likely]] = {}
    for axis, own, shifts in steps_of_periods(plan.patterns):
        if len(own) >= 3 and (likely := _likely(plan, sampled, shifts, [plan.own[k] for k in own])):
            found[axis] = min(found.get(axis, likely), likely, key=lambda told: told[0].left)
    return {axis: _finding(plan, axis, likely) for axis, likely in found.items()}


def _finding(plan: Plan, axis: Axis, likely: list[Likely]) -> Finding:
    """Say what is likely; frames that hold light of others are taken again."""
    kind, pairs = likely[0].cause.kind, {each.cause.shots for each in likely if each.cause.pair}
    told = []
    for each in likely:
        shots = each.cause.shots
        if not each.cause.pair or shots[::-1] not in pairs:
            told.append(each.told(plan))
        elif shots[0] > shots[1]:
            told.append(f"{each.told(plan)} or the other way round")
    words = "; ".join([told[0], *(f"or perhaps {text}" for text in told[1:])])
    text = f"{'steps across columns' if axis == 'x' else 'steps across rows'}: {words}: {CURES[kind]}"
    if kind != "mixed":
        return Finding("identity", "warning", text, names="mistake")
    figures = {} if likely[0].cause.pair else {HELD_BY_ALL: likely[0].much}
    again = sorted({shot for each in likely for shot in each.cause.shots})
    return Finding("identity", "bad", text, figures, tuple(again))


def _likely(plan: Plan, sampled: Sampled, shifts: NDArray[np.float64], own: list[int]) -> list[Likely]:
    """The causes that explain the misfit of the shots of a period as well as any, those by other light first."""
    bright = sampled.lit & (sampled.contrast > BRIGHT * quantile_of(sampled.contrast, 0.97))
    seen = np.flatnonzero(bright & (sampled.grey[own].max(axis=0) < sampled.full))
    if len(seen) < LEAST_LIT:
        return []
    seen = seen[spaced(len(seen), PIXELS // max(len(own) - 3, 1) + LEAST_LIT)]
    grey = sampled.grey[:, seen] / sampled.full
    fitted = np.linalg.pinv(np.stack([np.ones_like(shifts), np.cos(shifts), np.sin(shifts)], axis=1))
    mean, c, s = fitted @ grey[own]
    strength, off = np.hypot(c, s), np.arctan2(s, c) - shifts[:, None]
    if abs(np.mean(np.exp(1j * off[0]))) > ALL_ROUND:
        return []  # less than a period is seen
    beside, lights = beside_waves(shifts), [np.ones_like(mean)]
    if len(own) == 3:  # their mean is compared with that of the other frames
        beside = fitted[:1]
        lights += [sampled.contrast[seen], strength, np.delete(grey, own, axis=0).sum(axis=0)]
    known = [np.outer(row, light) for row in np.eye(len(beside)) for light in lights]
    for order, turn in product(HARMONICS, (np.cos, np.sin)):  # stronger and weaker, at any place of the response
        wave = strength * (beside @ turn(order * off))
        known += [wave * how for how in (1.0, strength, mean, strength * mean, mean * mean)]
    basis = np.linalg.qr(np.reshape(known, (len(known), -1)).T)[0]

    def unknown(misfits: Sequence[Array]) -> Array:
        flat = np.reshape(misfits, (len(misfits), -1))
        return np.asarray(flat - (flat @ basis) @ basis.T)

    causes = [*_causes(grey, own, beside, strength * np.sin(off), shifts)]
    made, misfit = unknown([cause.misfit for cause in causes]), unknown([beside @ grey[own]])[0]
    squares = np.maximum(np.sum(made**2, axis=1), TINY)
    factor = made @ misfit / squares
    left = 1 - factor**2 * squares / max(float(misfit @ misfit), TINY)
    return _best([Likely(*each) for each in zip(causes, factor.tolist(), left.tolist(), strict=True)])


def _best(found: Sequence[Likely]) -> list[Likely]:
    """Those that explain the misfit as well as the best, if that does; each once, at the share that fits best."""
    possible = sorted((each for each in found if each.possible), key=lambda each: each.left, reverse=True)
    if not possible or possible[-1].left > LEFT or possible[-1].cause.kind == "light":
        return []
    alike = {
        (each.cause.words, each.cause.shots): each
        for each in possible
        if each.left < ALIKE[0] * possible[-1].left + ALIKE[1] and each.cause.kind in KINDS
    }
    if all(abs(each.much) < LEAST for each in alike.values()):
        return []
    return sorted(alike.values(), key=lambda each: (KINDS.index(each.cause.kind), each.left))


def _causes(grey: Array, own: list[int], beside: Array, turned: Array, shifts: NDArray[np.float64]) -> Iterator[Cause]:
    """Causes of a misfit; `grey` (shots, n) of all shots, `turned` (k, n) is what `own` ones change by per rad."""
    for way, where in ((-1, "before"), (1, "after")):
        for k, row in zip(own, beside.T, strict=True):
            if 0 <= (j := k + way) < len(grey):
                words = "{frame} holds about {share:.0%} of {other}'s light"
                yield Cause("mixed", (k, j), words, np.outer(row, grey[j] - grey[k]))
        for share in SHARES:
            apart = grey[::-way].copy()
            for k in range(1, len(grey)):
                apart[k] -= share / (1 - share) * (apart[k - 1] - apart[k])
            words = f"each holds about {{share:.0%}} of the light of the one {where} it"
            yield Cause("mixed", tuple(own), words, beside @ (grey - apart[::-way])[own], share)
    for k, row, turn in zip(own, beside.T, turned, strict=True):
        yield Cause("light", (k,), "", np.outer(row, grey[k]))
        words = "{frame} is shifted by {degrees:.2g}° {more} than shift_rad says"
        yield Cause("shift", (k,), words, np.outer(row, turn))
    apart = (shifts - shifts.mean()) / np.ptp(shifts)
    words = "{frame} and {other} are shifted by {degrees:.2g}° {more} against each other than shift_rad says"
    yield Cause("shift", tuple(own), words, beside @ (turned * apart[:, None]))
