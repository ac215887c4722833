"""Pixels without light from the projector stay without coordinates, whatever their noise is."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from core.decode import Flag, decode
from core.decode.surface.islands import drop_islands
from core.patterns import Black, SequenceSpec, White, brightness, gray_and_phase

LINES, SHAPE = (256, 192), (240, 320)


@pytest.mark.parametrize(("preset", "peak", "ambient"), [("gray-sine", 0.55, 0.0), ("paper", 0.2, 0.1)])
def test_a_camera_that_is_noisiest_in_the_dark_sees_nothing_there(preset: str, peak: float, ambient: float) -> None:
    draw = np.random.default_rng(3)
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    place = {"x": 10 + 0.71 * columns + 0.02 * rows, "y": 8 + 0.7 * rows}
    lit = (np.abs(columns - 160) < 110) & (np.abs(rows - 120) < 85)
    patterns = SequenceSpec(preset, {"period": 16, "steps": 4} if preset == "gray-sine" else {}).patterns(LINES)
    frames = []
    for pattern in patterns:
        light = (
            np.where(lit, peak * brightness(pattern, place[getattr(pattern, "axis", None) or "x"]) + ambient, 0) + 0.004
        )
        light = np.clip(light + draw.normal(0, 0.004, SHAPE), 0, 1)
        grey = np.where(light < 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)  # IEC 61966-2-1
        frames.append(np.round(255 * grey).astype(np.uint8))
    found = decode(patterns, frames, lines=LINES)
    beside = np.isfinite(found.u) & (np.abs(found.u - place["x"]) > 3)
    assert np.isfinite(found.u[lit]).mean() > 0.99
    assert np.count_nonzero(beside) == 0
    assert np.count_nonzero(np.isfinite(found.u[~lit])) <= 2  # of 38,000; 5 sigma of the noise there


def test_a_dim_surface_beside_a_bright_one_is_no_noisy_dark() -> None:
    """What bent waves leave of a dim surface's light is alike in neighbours, and no noise."""
    draw = np.random.default_rng(3)
    rows, columns = np.mgrid[: SHAPE[0], : SHAPE[1]]
    place = {"x": 10 + 0.71 * columns + 0.02 * rows, "y": 8 + 0.7 * rows}
    albedo = np.where(columns < 120, 0.06, 1.0)
    frames, patterns = [], SequenceSpec("gray-inverse", {"period": 16, "steps": 3}).patterns(LINES)
    for pattern in patterns:
        axis = getattr(pattern, "axis", None) or "x"
        lines = gaussian_filter1d(np.repeat(brightness(pattern, np.arange(LINES[axis == "y"])) ** 2.2, 16), 0.8 * 16)
        light = np.interp(place[axis], (np.arange(len(lines)) + 0.5) / 16 - 0.5, lines)
        frames.append(np.clip(np.rint(1 + 230 * albedo * light + draw.normal(0, 0.5, SHAPE)), 0, 255).astype(np.uint8))
    found = decode(patterns, frames, lines=LINES)
    dim = np.s_[:, 4:116]
    assert np.isfinite(found.u[dim]).mean() > 0.99
    assert np.isfinite(found.v[dim]).mean() > 0.99
    scores = ((found.u - place["x"]) / found.sigma_u)[dim], ((found.v - place["y"]) / found.sigma_v)[dim]
    assert all(0.85 < np.sqrt(np.nanmean(np.square(score))) < 1.15 for score in scores)


def test_a_pixel_without_a_decoded_neighbour_is_dropped_and_others_stay() -> None:
    u = np.full((9, 12), np.nan, np.float32)
    u[2:4, 2:5] = 100.0
    u[6, 7] = u[7, 8] = 101.0  # side by side across a corner
    u[0, 11] = 37.0  # where the light ends, 64 lines off
    sigma, flags = u / 1000, np.where(np.isnan(u), np.uint8(Flag.LOW_MODULATION | Flag.NO_U), np.uint8(0))
    kept = np.isfinite(u)
    kept[0, 11] = False
    drop_islands(u, sigma, flags, Flag.NO_U, 8.0)
    assert np.array_equal(np.isfinite(u), kept)
    assert np.array_equal(np.isfinite(sigma), kept)
    assert flags[0, 11] == Flag.UNSURE | Flag.NO_U
    single, all_there = np.ones((1, 1), np.float32), np.zeros((1, 1), np.uint8)
    drop_islands(single, single, all_there, Flag.NO_U, 8.0)
    assert single[0, 0] == 1.0  # an image of one pixel has no neighbours to ask


def test_pixels_without_an_unsaturated_step_have_no_modulation() -> None:
    rows, columns = np.mgrid[:60, :80]
    place = {"x": 10 + 0.7 * columns, "y": 8 + 0.7 * rows}
    patterns = SequenceSpec("paper", {}).patterns(LINES)
    frames = []
    for n, pattern in enumerate(patterns):
        light = 20 + 150 * brightness(pattern, place[getattr(pattern, "axis", None) or "x"]) + (rows + columns + n) % 3
        light[:, 40:] *= np.where(columns[:, 40:] % 2, 1.9, 30)  # a step or none of four below full scale
        frames.append(np.clip(light, 0, 255).astype(np.uint8))
    found = decode(patterns, frames, lines=LINES)
    assert np.isfinite(found.u[:, :38]).mean() > 0.9
    assert np.isfinite(found.modulation).all()
    assert found.modulation.max() < 255
    assert found.modulation[:, 40::2].max() < 1.0  # all at full scale


def test_frames_without_any_light_tell_nothing() -> None:
    """A camera that was off: every value is the same, and the noise was a mean without weights."""
    patterns = [
        *gray_and_phase("x", 64, cell=8, periods=(16.0,), steps=8, profile="sine"),
        *gray_and_phase("y", 64, cell=8, periods=(16.0,), steps=8, profile="sine"),
        White(),
        Black(),
    ]
    phase = decode(patterns, [np.full((48, 64), 8, np.uint8) for _ in patterns], lines=(64, 64))
    assert not np.isfinite(phase.u).any()
    assert not np.isfinite(phase.v).any()
    assert phase.notes


def test_flat_frames_of_a_small_image_have_one_coordinate_at_most() -> None:
    """No wave is left of which harmonics could be told: their equations were singular."""
    patterns = SequenceSpec("multi-frequency", {"period": 16, "axes": "x"}).patterns(LINES)
    for seed in range(8):
        levels = np.random.default_rng(seed).integers(0, 256, len(patterns))
        found = decode(patterns, [np.full((12, 13), level, np.uint8) for level in levels], lines=LINES)
        assert len(np.unique(found.u[np.isfinite(found.u)])) <= 1
