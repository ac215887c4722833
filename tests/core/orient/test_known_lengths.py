"""Known lengths and points of a scene: balls and steps in closed form, what is none, and what all say of a rig."""

from __future__ import annotations

import re

import numpy as np
import pytest

from core.errors import InputError
from core.geometry import project, ray_directions
from core.model import KnownLength, Pair, PhaseMap
from core.orient import OrientOptions, find_motion
from tests.core.orient import test_rig_motion as plate
from tests.core.orient.test_rig_motion import CAMERA, SIGMA, TRUE, Array

CENTRES = np.array([[-50.0, 8.0, -600.0], [45.0, -12.0, -585.0]])
RADIUS, HEIGHT = 30.0, 20.0  # of balls and of a step, mm


def rays() -> Array:
    pixels = np.stack(np.meshgrid(np.arange(CAMERA.width), np.arange(CAMERA.height)), axis=-1)
    return ray_directions(CAMERA, TRUE.camera.interior, pixels)


def balls() -> Array:
    """Where rays meet two balls before a wall."""
    d = rays()
    found = d * 640.0
    for centre in CENTRES:
        b, c, a = d @ centre, centre @ centre - RADIUS**2, np.sum(d * d, axis=-1)
        hit = b**2 > a * c
        found = np.where(hit[..., None], d * ((b - np.sqrt(np.maximum(b**2 - a * c, 0))) / a)[..., None], found)
    return found


def step(tilt: float = 0.0) -> Array:
    """Where rays meet two planes, of which the right one is nearer, and may be tilted about the vertical."""
    d = rays()
    return d * np.where(d[..., 0] > 0, 620.0 - HEIGHT, 620.0)[..., None] / (1 + tilt * np.maximum(d[..., :1], 0))


def captured(seen: Array, seed: int = 2) -> PhaseMap:
    uv = project(TRUE.projector.spec, TRUE.projector.interior, seen, TRUE.projector_from_camera)
    u, v = np.float32(uv + np.random.default_rng(seed).normal(0, SIGMA, uv.shape)).transpose(2, 0, 1)
    s, nothing = np.full(u.shape, SIGMA, np.float32), np.zeros(u.shape, np.float32)
    return PhaseMap(u, v, s, s, nothing, nothing, nothing.astype(np.uint8))


def ends(*places: tuple[float, float], radius_px: float) -> tuple[tuple[float, float, float], ...]:
    return tuple((u, v, radius_px) for u, v in places)


MIDDLES = [tuple(uv) for uv in project(CAMERA, TRUE.camera.interior, CENTRES)]
APART = float(np.linalg.norm(CENTRES[1] - CENTRES[0]))
FACES = (45.0, 72.0), (140.0, 72.0)
EDGE = (90.0, 72.0), FACES[1]


def measured(known: KnownLength, seen: Array, seed: int = 2) -> float:
    return find_motion(captured(seen, seed), TRUE, lengths=[known]).lengths_mm[0][0]


@pytest.mark.parametrize("radius_px", [5.0, 12.0])
def test_balls_and_steps_are_as_far_apart_as_they_are(radius_px: float) -> None:
    """A ball's radius is 18 px."""
    known = KnownLength("balls", ends(*MIDDLES, radius_px=radius_px), APART, 0.01)
    found = [measured(known, balls(), seed) for seed in range(4)]
    # centres along rays that differ by 9°: noise of 0.05 mm in depth, of 80 and 450 pixels, at a cap of 16° and 42°
    assert abs(np.mean(found) - APART) < (0.3 if radius_px < 10 else 0.03)
    known = KnownLength("planes", ends(*FACES, radius_px=radius_px), HEIGHT, 0.01)
    assert abs(measured(known, step()) - HEIGHT) < 0.04


@pytest.mark.parametrize(
    ("seen", "places", "radius_px"),
    [
        (step(), FACES, 12.0),  # bends with a radius of many metres
        (step(), FACES, 2.0),  # noise alone
        (step(), EDGE, 12.0),  # an edge
        (balls(), MIDDLES, 26.0),  # with the wall around them
    ],
)
def test_what_is_no_ball_is_refused(seen: Array, places: tuple[tuple[float, float], ...], radius_px: float) -> None:
    """On a plane 122304.6273 mm were taken for 50."""
    known = KnownLength("balls", ends(*places, radius_px=radius_px), 100.0, 0.01)
    told = f"--length: no ball is seen within {radius_px:g} px of {places[0][0]:g},"
    with pytest.raises(InputError, match=f"^{re.escape(told)}.* or measure between points or planes$"):
        measured(known, seen)


@pytest.mark.parametrize(("seen", "places"), [(balls(), MIDDLES), (step(0.8), FACES), (step(), EDGE)])
def test_what_is_no_pair_of_planes_is_refused(seen: Array, places: tuple[tuple[float, float], ...]) -> None:
    known = KnownLength("planes", ends(*places, radius_px=12.0), HEIGHT, 0.01)
    with pytest.raises(InputError, match=r"^--length: the surfaces within 12 px of .* are no parallel planes"):
        measured(known, seen)


@pytest.mark.parametrize(
    ("factor", "told"), [(1.06, "known as 106 mm"), (0.94, ""), (0.1, r"is it in cm instead of mm\?"), (1000, "µm")]
)
def test_a_length_that_is_another_one_is_refused(factor: float, told: str) -> None:
    """By more than a twentieth no rig drifts: it is between other places, or in another unit."""
    known = KnownLength("planes", ends(*FACES, radius_px=12.0), factor * HEIGHT, 0.01)
    told = told.replace("106", f"{factor * HEIGHT:g}")
    with pytest.raises(InputError, match=rf"^--length: 45,72 to 140,72 is .* mm as calibrated, but .*{told}.*; check"):
        measured(known, step())


def told(now: Pair, rng: np.random.Generator) -> tuple[float, float, float]:
    """Probabilities that a rig is at rest: by a capture alone, with 20 known points, and with a known length."""
    pixels = np.stack(np.meshgrid(np.linspace(40, 140, 5), np.linspace(20, 120, 4)), axis=-1).reshape(-1, 2)
    places = np.array([[50.0, 35.0], [135.0, 110.0]])
    mm = float(np.linalg.norm(np.diff(plate.points_of(now, places), axis=0))) + rng.normal(0, 0.005)
    length = KnownLength("points", ends(*places, radius_px=4.0), mm, 0.005)
    points = plate.known_points(now, pixels, rng)
    calibration, phase, few = plate.mistaken(rng), plate.captured(now, rng), OrientOptions(most_places=1000)
    return (
        find_motion(phase, calibration, options=few).p,
        find_motion(phase, calibration, options=few, points=points).p,
        find_motion(phase, calibration, options=few, lengths=[length]).p,
    )


def test_a_longer_base_is_told_by_what_is_known_of_the_scene() -> None:
    """Its residuals show nothing: "no sign that the projector has moved" stood above a shift of ten sigmas."""
    rng = np.random.default_rng(5)
    longer = plate.turned(TRUE, np.zeros(3), np.array([1.5, 0.0, 0.0]))
    alone, *known = zip(*(told(longer, rng) for _ in range(6)), strict=True)
    assert np.min(alone) > 1e-3
    assert np.max(known) < 1e-6  # the calibrations know the base to 0.17 mm: nine sigmas of one of six


def test_known_points_and_lengths_call_a_rig_at_rest_moved_as_rarely_as_stated() -> None:
    rng = np.random.default_rng(6)
    p = np.array([told(TRUE, rng) for _ in range(60)])
    assert (np.abs(np.mean(p, axis=0) - 0.5) < 4 * np.sqrt(1 / 12 / 60)).all()  # evenly between 0 and 1
    assert (np.sum(p < 0.05, axis=0) <= 8).all()  # 3 expected; more than 8 once in 250 times
    assert (p > 1e-4).all()
