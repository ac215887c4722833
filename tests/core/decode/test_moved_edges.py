"""Edges of a code beside their place tell of a second light, and of nothing else."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from core.decode.pairs import TILES
from core.decode.surface.moved import moved_edges

SIDE = 5 * TILES
TABLE = SimpleNamespace(sign=np.ones(7), cell=8, gray=True, fading=np.ones(7), period=np.array([16.0]))


def levels_of(place, offset):
    """Levels of bits that pass evenly from off to on within a line of their edges; those lie `offset` lines beside."""

    def levels(at, bit):
        run = 8.0 * 2.0 ** (7 - bit)
        edge = (place.ravel()[at] + 0.5) / run - 0.5
        number = np.rint(edge)
        away = (edge - number) * run - offset.ravel()[at]
        noise = np.random.default_rng(2).normal(0, 0.02, len(at))
        return (np.where(number % 2 == 0, 1, -1) * np.clip(away, -1, 1) + noise).astype(np.float32)

    return levels


def test_pixels_in_step_with_the_lines_show_no_second_light() -> None:
    draw = np.random.default_rng(1)
    aside = draw.choice([-2.0, 0.0, 2.0], (SIDE, SIDE)) + draw.uniform(0, 0.4, (SIDE, SIDE))
    place = 16 * draw.integers(0, 38, (SIDE, SIDE)) + 7.5 + aside
    # a pixel sees hardly more than one line, wherever in it the phase lies
    offset = np.where(np.abs(aside) < 1, aside - (0.3 + 0.1 * aside), 0)
    assert moved_edges(place, np.ones(place.shape, bool), TABLE, levels_of(place, offset)) is None


def test_edges_beside_their_place_all_over_an_image_do() -> None:
    place = np.random.default_rng(1).uniform(0, 600, (SIDE, SIDE))
    found = moved_edges(place, np.ones(place.shape, bool), TABLE, levels_of(place, np.full(place.shape, 0.2)))
    assert found is not None
    assert np.median(found) == pytest.approx(0.2 * 8**0.5 * np.pi / 16, rel=0.05)
