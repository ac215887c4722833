"""Small groups of pixels that lie periods from all around are dropped; small surfaces are not."""

from __future__ import annotations

import numpy as np
import pytest

from core.decode import Flag, decode
from core.decode.surface.islands import drop_islands
from core.patterns import SequenceSpec
from tests.core.decode.conftest import Bench

LINES = (512, 384)
SIDES = 3, 4, 6  # px


def test_groups_of_up_to_four_pixels_torn_off_are_dropped() -> None:
    u = np.tile(np.linspace(100, 140, 40, dtype=np.float32), (30, 1))
    off = np.zeros(u.shape, bool)
    off[3, 5] = off[10:12, 8:10] = off[20, 30] = off[21, 31] = off[0, 20] = off[29, 0:3] = True
    u[off] += 16
    kept = ~off
    u[14:19, 20:21] += 16  # a wire of five pixels stays
    sigma, flags = np.full_like(u, 0.1), np.zeros(u.shape, np.uint8)
    drop_islands(u, sigma, flags, Flag.NO_U, 8.0)
    assert np.array_equal(np.isfinite(u), kept)
    assert np.array_equal(flags == Flag.UNSURE | Flag.NO_U, off)


def test_coordinates_that_their_sigmas_allow_are_no_islands() -> None:
    u = np.tile(np.linspace(100, 140, 40, dtype=np.float32), (30, 1))
    sigma, flags = np.full_like(u, 0.1), np.zeros(u.shape, np.uint8)
    u[10, 10] += 9
    sigma[10, 10] = 3.5
    drop_islands(u, sigma, flags, Flag.NO_U, 8.0)
    assert np.isfinite(u).all()


@pytest.mark.parametrize("preset", ["gray-sine", "paper", "multi-frequency", "dense"])
def test_small_things_before_a_wall_stay_measured(preset: str) -> None:
    rows, columns = np.mgrid[:120, :160].astype(float)
    u, v = 30 + 1.2 * columns + 0.1 * rows, 20 + 1.1 * rows
    thing, lift = np.zeros(u.shape, bool), np.random.default_rng(2).uniform(20, 80, (6, 8))
    for number, away in np.ndenumerate(lift):
        side = SIDES[sum(number) % len(SIDES)]
        at = tuple(slice(20 * k + 8, 20 * k + 8 + side) for k in number)
        thing[at] = True
        u[at] += away
        v[at] += away / 3
    patterns = SequenceSpec(preset, {}).patterns(LINES)
    bench = Bench(u, v, LINES, ambient=12, gain=120, dark=1.5)
    found = decode(patterns, bench.take(patterns), lines=LINES)
    right = (np.abs(found.u - u) < 1) & (np.abs(found.v - v) < 1)
    assert right[thing].mean() > 0.98
    assert right[~thing].mean() > 0.98


def test_words_that_noise_makes_are_dropped() -> None:
    """Binary code, dim: of the coordinates that passed, 3,400 in a million were 16 and more lines off."""
    rows, columns = np.mgrid[:300, :400].astype(float)
    u, v = 10 + 1.2 * columns + 0.1 * rows, 8 + 1.1 * rows
    patterns = SequenceSpec("gray-sine", {"code": "binary"}).patterns(LINES)
    bench = Bench(u, v, LINES, blur=1.2, ambient=3.0, gain=24.0, dark=5.0)
    found = decode(patterns, bench.take(patterns), lines=LINES)
    off = np.fmax(np.abs(found.u - u), np.abs(found.v - v))
    assert np.isfinite(off).mean() > 0.98
    assert np.sum(off > 8) <= 2
