"""How evenly phases lie over their period: bent ones are denser where the phase runs slowly.

How uneven the scene's own phases are is seen in harmonics that the steps cannot bend.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.decode.curves import PARAMETERS
from core.decode.harmonics import GRID, correction
from core.decode.response import LARGEST, STEP, Array, Response, Terms, Wave

CROWDED = 6  # rounds
MULTIPLES = 2  # of the number of steps, harmonics of the phases' density that are looked at
NEIGHBOURS = 4  # harmonics on either side that tell how uneven the scene is
SIGNIFICANT = 15.0  # times what is usual, power of a harmonic that shows a curve


class Crowd:
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


def crowded(crowds: Sequence[Crowd], r: Response) -> bool:
    """Whether phases crowd beyond what the scene and `r` explain, at as many places of their period as steps."""
    for crowd in crowds:
        crowding, usual = (np.abs(each) ** 2 for each in crowd.densities(r))
        if crowding.max() > SIGNIFICANT * max(float(usual.mean()), 1 / crowd.count):
            return True
    return False


def explained(crowds: Sequence[Crowd], base: Response) -> tuple[Array, Array]:
    """Values of the response, and the inverse of their covariance, that explain the crowding of phases as well."""
    found = base
    for _ in range(CROWDED):
        found = _use_crowding(crowds, base, found)
    return found.values, found.normal


def _use_crowding(crowds: Sequence[Crowd], base: Response, r: Response) -> Response:
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
