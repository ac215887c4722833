"""Holes and edges on a tilted plate: against a renderer of its own, with pixels sampled finely and another blur."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest

from core.errors import InputError
from core.geometry import project, ray_directions
from core.measure import find_circles, measure_feature
from core.model import AdjustedDevice, DeviceSpec, Feature, Interior, PhaseMap, PointCloud

SPEC = DeviceSpec(150, 120, (0.02, 0.02), 12.0)
CAMERA = AdjustedDevice(SPEC, Interior(12.0, 0.02, -0.01, (-1e-3, 0, 0, 0, 1e-4, 0), 1.0), np.zeros(9), (0, 0), 0)
NORMAL = np.array([0.42, -0.2, 0.88]) / np.linalg.norm([0.42, -0.2, 0.88])
MIDDLE = np.array([1.0, 2.0, -600.0])
ACROSS = np.linalg.svd(NORMAL[None])[2][1:]  # two directions in the plate
FINE, SIGMA, DEPTH_SIGMA = 5, 1.5, 0.04  # samples a pixel each way; grey values; mm of Z


@cache
def plate(interior: Interior) -> np.ndarray:
    """Where the rays of all samples meet it."""
    u, v = ((np.arange(n * FINE) - (FINE - 1) / 2) / FINE for n in (SPEC.width, SPEC.height))
    rays = ray_directions(SPEC, interior, np.stack(np.meshgrid(u, v), axis=-1))
    return rays * (NORMAL @ MIDDLE / (rays @ NORMAL))[..., None]


def seen(
    centre: np.ndarray,
    radius: float,
    dark: bool = True,
    half: bool = False,
    mark: bool = False,
    wall_mm: float = 0.0,
    wall_light: float = 190.0,
    blur_px: float = 0.0,
    strip_mm: float = np.inf,
    interior: Interior = CAMERA.interior,
):
    """The plate with a hole or, too dark to be decoded, with a mark, or a half or strip blackened: image and points.

    Through the hole a wall is seen, where light that came through it lies so far beside, mm.
    """
    h, w = SPEC.height, SPEC.width
    points = plate(interior)
    away = (points - centre) @ ACROSS.T
    strip = np.minimum(-away[..., 0], away[..., 0] + strip_mm)
    depth = strip if half else radius - np.hypot(*np.moveaxis(away, -1, 0))  # mm within the edge
    share = np.clip(depth * FINE + 0.5, 0, 1)  # of a sample, which is some mm / FINE wide: its edges are soft
    inside, white = depth > 0, 140.0 + 0.2 * away[..., 1]
    light = white + (share if dark else 1 - share) * (12.0 - white)
    if wall_mm:
        light = np.where(inside & (np.hypot(away[..., 0] - wall_mm, away[..., 1]) < radius), wall_light, light)
    light = cv2.GaussianBlur(light, (0, 0), blur_px * FINE) if blur_px else light
    for _ in range(2) if not blur_px else ():  # optics: two boxes of 1.1 px, a blur that is no Gaussian
        light = cv2.blur(light, (int(1.1 * FINE) | 1,) * 2, borderType=cv2.BORDER_CONSTANT)
    image = light.reshape(h, FINE, w, FINE).mean(axis=(1, 3))
    samples = (inside if mark else ~inside).reshape(h, FINE, w, FINE)
    decoded = np.broadcast_to(half, (h, w)) | samples.all(axis=(1, 3))
    whole = points.reshape(h, FINE, w, FINE, 3)[:, FINE // 2, :, FINE // 2]
    return image, whole, decoded


def noisy(made, rng: np.random.Generator) -> tuple[PhaseMap, PointCloud]:
    image, points, decoded = made
    nothing = np.full(image.shape, np.nan, np.float32)
    grey = (image + rng.normal(0, SIGMA, image.shape)).astype(np.float32)
    phase = PhaseMap(nothing, nothing, nothing, nothing, nothing, grey, np.zeros(image.shape, np.uint8))
    moved = points * (1 - rng.normal(0, DEPTH_SIGMA, image.shape) / points[..., 2])[..., None]
    moved[~decoded] = np.nan
    along = np.abs(points / points[..., 2:]) * DEPTH_SIGMA
    sigma = np.full(image.shape, DEPTH_SIGMA, np.float32)
    return phase, PointCloud(moved.astype(np.float32), along.astype(np.float32), sigma)


def errors(found: list[Feature], centre: np.ndarray) -> tuple[float, float, float]:
    """Of holes: r.m.s. error in px, over its sigma, and Mahalanobis' square of the centre in space over 3."""
    true = project(SPEC, CAMERA.interior, centre)
    off = np.array([f.uv - true for f in found])
    by_sigma = off / np.sqrt([np.diagonal(f.uv_cov) for f in found])
    apart = [d @ np.linalg.solve(f.cov_mm2, d) / 3 for f in found if (d := f.centre_mm - centre) is not None]
    return float(np.sqrt(np.mean(off**2))), float(np.sqrt(np.mean(by_sigma**2))), float(np.mean(apart))


@pytest.mark.parametrize(("radius", "dark", "mark"), [(8.0, True, False), (4.0, False, False), (7.0, False, True)])
def test_holes_are_found_in_space_as_surely_as_they_say(radius: float, dark: bool, mark: bool) -> None:
    rng = np.random.default_rng(3)
    found: list[Feature] = []
    centre = MIDDLE + np.array([-3.3, 2.7]) @ ACROSS
    made = seen(centre, radius, dark, mark=mark)
    u, v = project(SPEC, CAMERA.interior, centre)
    for _ in range(20):
        start = np.array([u, v, radius]) + rng.normal(0, 0.7, 3)
        found.append(measure_feature("circle", start, *noisy(made, rng), CAMERA))
    px, ratio, apart = errors(found, centre)
    assert px < 0.02
    assert 0.7 < ratio < 1.3  # 40 deviates: 1 +- 0.11
    assert 0.55 < apart < 1.55  # 60 of them, squared: 1 +- 0.18
    sizes = np.array([(f.size_mm[0] - radius) / f.size_mm[1] for f in found])
    assert 0.6 < np.sqrt(np.mean(sizes**2)) < 1.5  # 20 deviates
    assert np.mean([f.sigma_mm.min() / f.size_mm[1] for f in found]) > 1.2  # a noisy circle's axes say less than both
    axes = np.array([np.linalg.norm(f.axes_mm, axis=1) for f in found])
    # the surface's part of the radius is along the line of sight; a bias of 0.01 px would be 0.01 mm
    assert np.abs(axes.mean(axis=0) - radius).max() < 0.02
    assert found[0].normal @ NORMAL > 0.999


@pytest.mark.parametrize(("radius", "blur_px"), [(2.5, 0.7), (3.0, 0.9), (4.0, 1.3)])
def test_small_blurred_holes_have_their_size(radius: float, blur_px: float) -> None:
    """By a straight edge, put back by the blur's variance over the mean radius, all are 0.013 to 0.039 mm too large."""
    rng = np.random.default_rng(9)
    centre = MIDDLE + np.array([-3.3, 2.7]) @ ACROSS
    made = seen(centre, radius, blur_px=blur_px)
    start = np.array([*project(SPEC, CAMERA.interior, centre), radius])
    found = [measure_feature("circle", start, *noisy(made, rng), CAMERA) for _ in range(8)]
    assert abs(np.mean([f.size_mm[0] for f in found]) - radius) < 0.01


@pytest.mark.parametrize("wall_mm", [10.0, 13.0])
def test_a_lit_wall_behind_a_hole_does_not_draw_it(wall_mm: float) -> None:
    """A lens of the wall is brighter than the plate: where it meets the edge, that is not seen."""
    rng = np.random.default_rng(8)
    centre, found = MIDDLE + np.array([-3.3, 2.7]) @ ACROSS, []
    made = seen(centre, 8.0, wall_mm=wall_mm)
    u, v = project(SPEC, CAMERA.interior, centre)
    for _ in range(8):
        found.append(
            measure_feature("circle", np.array([u, v, 8.0]) + rng.normal(0, 0.7, 3), *noisy(made, rng), CAMERA)
        )
    px, ratio, _ = errors(found, centre)
    assert px < 0.05  # 0.03 and 0.011 when written; 1.5 and 0.64 where all pixels count
    assert ratio < 1.5  # 16 deviates: 1 +- 0.18


@pytest.mark.parametrize(("wall_mm", "light"), [(6.0, 75.0), (3.0, 100.0), (6.0, 40.0)])
def test_what_a_dim_wall_close_behind_leaves_of_an_edge_is_in_its_sigma(wall_mm: float, light: float) -> None:
    """It fits neither side by less than a bright one, so that part of it stays: 2 to 8 sigmas were off."""
    rng, off = np.random.default_rng(3), []
    centre = MIDDLE + np.array([-3.3, 2.7]) @ ACROSS
    made, (u, v) = seen(centre, 8.0, wall_mm=wall_mm, wall_light=light), project(SPEC, CAMERA.interior, centre)
    for _ in range(6):
        with suppress(InputError):
            found = measure_feature("circle", np.array([u, v, 8.0]), *noisy(made, rng), CAMERA)
            off.append((found.size_mm[0] - 8.0) / found.size_mm[1])
    assert len(off) >= 3
    assert np.sqrt(np.mean(np.square(off))) < 1.8


@pytest.mark.parametrize(("radius", "dark"), [(8.0, True), (4.0, False), (3.0, True)])
def test_holes_are_found_without_their_place(radius: float, dark: bool) -> None:
    rng = np.random.default_rng(6)
    centre = MIDDLE + np.array([-3.3, 2.7]) @ ACROSS
    phase, cloud = noisy(seen(centre, radius, dark), rng)
    (place,) = find_circles(phase.image)
    hole = measure_feature("circle", place, phase, cloud, CAMERA)
    off = hole.uv - project(SPEC, CAMERA.interior, centre)
    assert np.abs(off).max() < 0.02
    assert np.abs(off / np.sqrt(np.diagonal(hole.uv_cov))).max() < 4
    nothing, _ = noisy(seen(MIDDLE + 500 * ACROSS[0], 1.0), rng)
    assert len(find_circles(nothing.image)) == 0


def test_a_straight_edge_is_found_in_space() -> None:
    rng = np.random.default_rng(4)
    made = seen(MIDDLE, 0.0, half=True)
    ends = project(SPEC, CAMERA.interior, MIDDLE + np.array([[0.0, -15.0], [0.0, 15.0]]) @ ACROSS)
    off = []
    for _ in range(12):
        line = measure_feature("line", (ends + rng.normal(0, 0.5, (2, 2))).ravel(), *noisy(made, rng), CAMERA)
        away = (line.centre_mm - MIDDLE) @ ACROSS[0]
        off.append(away / np.sqrt(ACROSS[0] @ line.cov_mm2 @ ACROSS[0]))
        assert abs(line.axes_mm[0] @ ACROSS[0]) < 0.003 * np.linalg.norm(line.axes_mm)
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 1.6  # 12 normal deviates


@pytest.mark.parametrize("bend", [-6e-3, 6e-3, -3e-2])
def test_an_edge_that_the_lens_bends_is_straight_in_space(bend: float) -> None:
    """Its sagitta is 0.17 and 0.85 px. Straight in the image it lay 0.11 and 0.78 mm beside, 8 and 19 sigmas."""
    bent = replace(CAMERA, interior=Interior(12.0, 0.02, -0.01, (bend, 0, 0, 0, 1e-4, 0), 1.0))
    rng = np.random.default_rng(14)
    middle, found = MIDDLE + 42 * ACROSS[0], []
    made = seen(middle, 0.0, half=True, interior=bent.interior)
    ends = project(SPEC, bent.interior, middle + np.array([[0.0, -50.0], [0.0, 40.0]]) @ ACROSS)
    for _ in range(12):
        found.append(measure_feature("line", (ends + rng.normal(0, 0.5, (2, 2))).ravel(), *noisy(made, rng), bent))
    for axis in (ACROSS[0], NORMAL):
        off = np.array([(line.centre_mm - middle) @ axis for line in found])
        sigma = np.sqrt([axis @ line.cov_mm2 @ axis for line in found])
        assert abs(off.mean()) < 0.01  # the renderer's own edge is off by 0.004 px, also where nothing bends it
        assert 0.5 < off.std() / sigma.mean() < 1.6  # 12 normal deviates
    assert max(abs(line.axes_mm[0] @ ACROSS[0]) / np.linalg.norm(line.axes_mm) for line in found) < 5e-4


def test_a_plate_is_flat_however_the_lens_bends_it() -> None:
    """By inverse depths that are linear in the distorted image the radius was 0.0125 mm too large, six sigmas."""
    bent = replace(CAMERA, interior=Interior(12.0, 0.02, -0.01, (-3e-2, 0, 0, 0, 1e-4, 0), 1.0))
    rng = np.random.default_rng(14)
    middle = MIDDLE + 25 * ACROSS[0]
    made = seen(middle, 20.0, interior=bent.interior)
    start = np.array([*project(SPEC, bent.interior, middle), 20.0])
    found = [measure_feature("circle", start, *noisy(made, rng), bent) for _ in range(8)]
    assert abs(np.mean([f.size_mm[0] for f in found]) - 20.0) < 0.004  # its sigma is 0.0007


def test_beyond_what_the_lens_is_known_for_no_edge_is_looked_for() -> None:
    bent = replace(CAMERA, interior=Interior(12.0, 0.02, -0.01, (-3e-2, 0, 0, 0, 1e-4, 0), 1.0))
    phase, cloud = noisy(seen(MIDDLE, 8.0), np.random.default_rng(5))
    with pytest.raises(InputError, match="the lens of the camera does not reach so far; give places inside the image"):
        measure_feature("line", np.array([70.0, 60.0, 70.0, 1e7]), phase, cloud, bent, "edge")


def test_the_other_edge_of_a_strip_does_not_draw_one() -> None:
    """By 0.12 mm where pixels beyond the middle take part."""
    rng, off = np.random.default_rng(12), []
    made = seen(MIDDLE, 0.0, half=True, blur_px=1.0, strip_mm=4.0)
    ends = project(SPEC, CAMERA.interior, MIDDLE + np.array([[0.0, -15.0], [0.0, 15.0]]) @ ACROSS)
    for _ in range(8):
        line = measure_feature("line", (ends + rng.normal(0, 0.3, (2, 2))).ravel(), *noisy(made, rng), CAMERA)
        off.append((line.centre_mm - MIDDLE) @ ACROSS[0])
    assert np.sqrt(np.mean(np.square(off))) < 0.07, np.round(off, 3)


def test_where_no_edge_is_none_is_found() -> None:
    rng = np.random.default_rng(5)
    phase, cloud = noisy(seen(MIDDLE + 500 * ACROSS[0], 1.0), rng)
    with pytest.raises(InputError, match="edge"):
        measure_feature("circle", np.array([70.0, 60.0, 8.0]), phase, cloud, CAMERA)


@pytest.mark.parametrize(
    ("kind", "given", "sentence"),
    [
        ("circle", [20, 20, 0], "is no circle; give U,V,RADIUS in px"),
        ("circle", [20, 20, -8], "is no circle; give U,V,RADIUS in px"),
        ("circle", [20, np.nan, 8], "is no circle; give U,V,RADIUS in px"),
        ("circle", [20, 20], "is no circle; give U,V,RADIUS in px"),
        ("line", [20, 20, 20, 20], "is no line; give U,V,U,V in px"),
        ("line", [20, 20, np.inf, 20], "is no line; give U,V,U,V in px"),
        ("slot", [20, 20, 8], "'slot' is no kind of feature; choose among circle, line"),
    ],
)
def test_what_is_no_place_of_a_feature_is_told(kind: str, given: list[float], sentence: str) -> None:
    """Before, a singular matrix, a division by zero, or a key that is missing."""
    phase, cloud = noisy(seen(MIDDLE, 8.0), np.random.default_rng(5))
    with pytest.raises(InputError, match=f"^hole: {re.escape(sentence)}$"):
        measure_feature(kind, np.array(given, float), phase, cloud, CAMERA, "hole")


def test_points_that_cannot_be_are_none() -> None:
    """In front of the wrong side of the camera, or with a sigma of zero; or they are of another image."""
    phase, cloud = noisy(seen(MIDDLE, 8.0), np.random.default_rng(5))
    place = np.array([*project(SPEC, CAMERA.interior, MIDDLE), 8.0])
    for wrong in (replace(cloud, xyz_mm=-cloud.xyz_mm), replace(cloud, sigma_depth_mm=0 * cloud.sigma_depth_mm)):
        with pytest.raises(InputError, match="0 points lie on the surface beside the edge"):
            measure_feature("circle", place, phase, wrong, CAMERA)
    with pytest.raises(InputError, match="150 x 60 points, 150 x 120 px"):
        measure_feature("circle", place, phase, PointCloud(cloud.xyz_mm[:60]), CAMERA)


def test_grey_values_of_two_levels_tell_no_edge() -> None:
    """The few pixels that any ellipse fits put it 1 px beside, with a sigma of 0.0001."""
    phase, cloud = noisy(seen(MIDDLE + np.array([-3.3, 2.7]) @ ACROSS, 8.0), np.random.default_rng(5))
    u, v = project(SPEC, CAMERA.interior, MIDDLE + np.array([-3.3, 2.7]) @ ACROSS)
    y, x = np.indices(phase.image.shape)
    two = replace(phase, image=np.where(np.hypot(x - u, y - v) < 8, 0, 255).astype(np.float32))
    with pytest.raises(InputError, match="edge"):
        measure_feature("circle", np.array([u, v, 8.0]), two, cloud, CAMERA)
