"""How evenly phases lie over their period: bent ones are denser where the phase runs slowly.

How uneven the scene's own phases are is seen in harmonics that the steps cannot bend.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.decode.waves.curves import PARAMETERS
from core.decode.waves.harmonics import GRID, correction
from core.decode.waves.response import LARGEST, STEP, Array, Response, Terms, Wave

CROWDED = 6  # rounds
TILES = 4  # of the image in either direction, whose densities are held against each other
MULTIPLES = 2  # of the number of steps, harmonics of the phases' density that are looked at
NEIGHBOURS = 4  # harmonics on either side that tell how uneven the scene is
SIGNIFICANT = 15.0  # times what is usual, power of a harmonic that shows a curve


class Crowd:
    """Harmonics of the density of a wave's phases (turns), whatever they are straightened by.

    A straightening is a table over `GRID` parts of a turn: sums over the phases of each part are enough.
    """

    def __init__(self, wave: Wave, turns: Array, tile: NDArray[np.intp]) -> None:
        self.wave, self.count = wave, max(len(turns), 1)
        steps = len({round(p.shift_rad, 6) for p in wave.frames.patterns})
        self.made = steps * np.arange(1, MULTIPLES + 1)  # harmonics that bending makes
        others = np.arange(max(2, steps - NEIGHBOURS), self.made[-1] + NEIGHBOURS + 1)
        self.others = others[others % steps != 0]  # of the same kind, that it does not
        at = np.minimum(((turns + 0.5) * GRID).astype(np.intp), GRID - 1)
        total = np.bincount(at, minlength=GRID)
        middle = (np.arange(GRID) + 0.5) / GRID - 0.5
        self.place = middle + np.bincount(at, turns - middle[at], minlength=GRID) / np.maximum(total, 1)
        number = np.bincount(at + GRID * tile, minlength=GRID * TILES**2).reshape(-1, GRID)
        self.number: Terms = number[number.sum(axis=1) > 0].astype(complex)

    def densities(self, r: Response) -> tuple[Terms, Array]:
        """Harmonics that bending makes, of the phases as a response straightens them, and by how much (variance) the
        scene's own harmonics and pixels that are in step with the fringes may change each."""
        found = self._straightened(r) @ self.number.T / self.count
        made, share = found[self.made].sum(axis=1), self.number.sum(axis=1).real / self.count
        apart = np.abs(found[self.made] - made[:, None] * share) ** 2
        others = np.abs(found[self.others].sum(axis=1)) ** 2
        return made, np.maximum(apart.sum(axis=1), max(float(others.mean()), 0.25 / self.count))

    def bent(self, r: Response) -> Terms:
        """The first of these alone."""
        return self._straightened(r)[self.made] @ self.number.sum(axis=0) / self.count

    def _straightened(self, r: Response) -> Terms:
        """Waves along the parts of a turn, (harmonics, GRID), at the phases that a response makes of them."""
        first = np.exp(2j * np.pi * (self.place + correction(self.wave.spectrum(r))))
        powers = np.ones((int(self.others[-1]) + 1, GRID), complex)
        powers[1:] = first  # a power of a complex number takes many times as long as a product
        return np.asarray(np.multiply.accumulate(powers, axis=0))


def crowded(crowds: Sequence[Crowd], r: Response) -> bool:
    """Whether phases crowd beyond what the scene and `r` explain, at as many places of their period as steps."""
    for crowd in crowds:
        crowding, usual = crowd.densities(r)
        if np.any(np.abs(crowding) ** 2 > SIGNIFICANT * np.maximum(usual, 1 / crowd.count)):
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
        seen, usual = crowd.densities(r)
        weight = 2 / usual
        slopes = np.zeros((len(r.values), len(seen)), complex)
        for k in (*range(PARAMETERS), PARAMETERS + crowd.wave.axis):
            slopes[k] = (crowd.bent(r.moved(k)) - seen) / STEP
        full += (weight * slopes @ slopes.conj().T).real
        right -= (weight * slopes @ seen.conj()).real
    change = np.linalg.solve(full, right)
    values = r.values + change * min(1.0, LARGEST / np.abs(change).max())
    return Response(values, full)
