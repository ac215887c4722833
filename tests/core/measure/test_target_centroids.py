"""Centroids against the true images of the circles' centres, and the errors they predict."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.measure import measure_targets, recentred
from core.model import DeviceSpec, PhaseMap, Seed, Testfield


@pytest.mark.parametrize("diameter_mm", [2.2, 5.0, 9.0])
@pytest.mark.parametrize("tilt_deg", [0, 45])
@pytest.mark.parametrize("blur_px", [0.5, 1.5])
def test_centroids_are_within_two_hundredths_of_a_pixel(bench, diameter_mm, tilt_deg, blur_px):
    # 0.02 px r.m.s. is what this project demands of itself at the published noise of 2 grey values
    field = bench.grid(7, 9, pitch=max(14.0, 2.2 * diameter_mm), diameter=diameter_mm)
    truth = bench.scene(
        bench.look(tilt_deg, 30, 200, 620), bench.part, field=field, blur=blur_px, noise=2.0, off_mm=0.1
    )
    found = measure_targets(truth.phase(), field, truth.seeds(((1, 2), (1, 6), (5, 6), (5, 2))), truth.spec)
    which, error = bench.compare(found, truth)
    assert len(which) > 0.9 * np.sum(_inside(truth, 15))
    # a dot of 3.7 x 5.2 px at 45 degrees is half noise: its own prediction allows up to 0.03 px
    assert np.sqrt(np.mean(error**2)) < (0.02 if diameter_mm > 3 or (tilt_deg == 0 and blur_px < 1) else 0.035)


def test_predicted_covariance_is_the_scatter_of_repeated_images(bench):
    truth = bench.scene(bench.look(30, 40, 10), bench.part, field=bench.grid(7, 9), samples=4)
    clean, phase = truth.image(bits=False), truth.phase(bits=False)
    seeds = truth.seeds(((1, 2), (1, 6), (5, 6), (5, 2)))
    rng = np.random.default_rng(1)
    found = []
    for _ in range(20):
        noisy = (clean + rng.normal(0, 3.0, clean.shape)).astype(np.float32)
        found.append(measure_targets(replace(phase, image=noisy), truth.field, seeds, truth.spec))
    assert {len(f.row) for f in found} == {63}
    scatter = np.var([f.camera_uv for f in found], axis=0, ddof=1).mean(axis=0)
    predicted = np.mean([np.diagonal(f.camera_cov, axis1=1, axis2=2) for f in found], axis=(0, 1))
    # 63 targets x 19 degrees of freedom give the ratio to 2 %; the floor for what does not scatter adds up to 15 %
    assert np.all(np.abs(np.sqrt(scatter / predicted) - 0.95) < 0.12)


def test_errors_over_predicted_sigmas_are_near_one(bench):
    squares = []
    for k, tilt in enumerate((0, 20, 40)):
        truth = bench.scene(
            bench.look(tilt, 77 * k, 50 * k), bench.part, field=bench.grid(7, 9), noise=3.0, samples=5, seed=k
        )
        found = measure_targets(truth.phase(k), truth.field, truth.seeds(((1, 2), (1, 6), (5, 6), (5, 2))), truth.spec)
        _, error = bench.compare(found, truth)
        squares.append(np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.camera_cov), error) / 2)
    # 378 coordinates: a ratio known to 4 %; twice that each way, and what the nominal camera makes of the eccentricity
    assert 0.85 < np.sqrt(np.mean(np.concatenate(squares))) < 1.2


def test_dark_dots_are_as_good_as_bright_ones(bench):
    for polarity in ("white-on-black", "black-on-white"):
        truth = bench.scene(bench.look(25, 10, 0), bench.part, field=bench.grid(7, 9, polarity=polarity), noise=2.0)
        found = measure_targets(truth.phase(), truth.field, truth.seeds(((1, 2), (1, 6), (5, 6), (5, 2))), truth.spec)
        which, error = bench.compare(found, truth)
        assert len(which) == 63
        assert np.sqrt(np.mean(error**2)) < 0.02


@pytest.mark.parametrize("polarity", ["white-on-black", "black-on-white"])
def test_uneven_light_does_not_move_large_dots(bench, polarity):
    # 0.1 % per px over a dot of radius 15 px moves its plain grey centroid by g r² / 4 = 0.056 px
    field = bench.grid(7, 9, pitch=30.0, diameter=12.0, polarity=polarity)
    truth = bench.scene(bench.look(20, 30, 0, 620), field=field, light=(0.001, -0.0005), samples=8)
    found = measure_targets(truth.phase(bits=False), field, truth.seeds(((1, 2), (1, 6), (5, 6), (5, 2))), truth.spec)
    _, error = bench.compare(found, truth)
    assert np.sqrt(np.mean(error**2)) < 0.01


@pytest.mark.parametrize("polarity", ["white-on-black", "black-on-white"])
def test_light_that_falls_to_a_fifth_moves_no_dot_and_costs_none(bench, polarity):
    # at the corner the light changes by 1.4 % per px: a plain centroid of 20 px is 0.3 px off, its contour 0.15 px
    camera, lens = DeviceSpec(480, 360, (0.007, 0.007), 6.0), bench.interior(6.0)
    field = bench.grid(8, 11, pitch=50.0, diameter=22.7, polarity=polarity)
    truth = bench.scene(bench.look(12, 50, 0, 950), camera, lens, field, fall=0.8, blur=0.7, white=220, black=14)
    noisy = truth.phase(bits=False)
    noisy.image[:] += np.random.default_rng(0).normal(0, 1.0, noisy.image.shape)
    found = measure_targets(noisy, field, truth.seeds(((1, 1), (1, 9), (6, 9), (6, 1))), camera)
    _, error = bench.compare(found, truth)
    assert {m.reason for m in found.missing} == {"cut by the image border"}
    square = np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.camera_cov), error) / 2
    assert 0.8 < np.sqrt(np.mean(square)) < 1.25  # 160 coordinates; logarithms of the light left 2.3


def test_diameters_are_those_of_the_projected_circles(bench):
    truth = bench.scene(bench.look(0, 0, 0, 600), interior=bench.interior(12.0), noise=1.0)
    found = measure_targets(truth.phase(), truth.field, truth.seeds(bench.middle), truth.spec)
    assert np.allclose(found.diameter_px, 5.0 / 600 * 12.0 / 0.008, rtol=0.02)


def test_where_in_its_pixel_a_dot_lies_hardly_matters(bench):
    """Sharp discs without noise: what is left is the pixels' doing, and the drawing's."""
    truth = bench.scene(bench.look(30, 0, 7), bench.part, field=bench.grid(7, 9), blur=0.35, samples=10)
    seeds = truth.seeds(((1, 2), (1, 6), (5, 6), (5, 2)))
    found = measure_targets(truth.phase(bits=False), truth.field, seeds, truth.spec)
    found = recentred(found, truth.field, truth.spec, truth.interior, truth.pose)
    _, error = bench.compare(found, truth)
    # 0.01 px² per px of diameter is stated, 0.0008 px; weights cut at 5 % of the contrast leave 0.0026 px
    assert np.sqrt(np.mean(error**2)) < 0.0015


@pytest.mark.parametrize("polarity", ["white-on-black", "black-on-white"])
@pytest.mark.parametrize(("tilt_deg", "blur_px"), [(0, 1.4), (0, 2.0), (30, 2.0), (0, 2.5)])
def test_dots_that_reach_into_each_other_are_not_drawn_by_the_side_without_a_neighbour(
    bench, polarity, tilt_deg, blur_px
):
    """Edges 9 px apart: at a blur of 2.5 px the outermost dots were 0.033 px farther out on average."""
    field = bench.grid(7, 9, pitch=6.8, diameter=3.2, polarity=polarity)
    truth = bench.scene(bench.look(tilt_deg, 30, 10), bench.part, field=field, blur=blur_px, noise=1.0, samples=4)
    found = measure_targets(truth.phase(), field, truth.seeds(((1, 2), (1, 6), (5, 6), (5, 2))), truth.spec)
    which, error = bench.compare(recentred(found, field, truth.spec, truth.interior, truth.pose), truth)
    assert len(which) == 63
    outwards = truth.true_uv[which] - truth.true_uv.mean(axis=0)
    outwards /= np.linalg.norm(outwards, axis=1)[:, None] + 1e-9
    rim = np.isin(field.row[which], (0, 6)) | np.isin(field.col[which], (0, 8))
    assert abs(np.mean(np.sum(error * outwards, axis=1)[rim])) < 0.006
    z = np.sqrt(np.mean(error**2 / np.diagonal(found.camera_cov, axis1=1, axis2=2)))
    assert 0.5 < z < 1.3


def _inside(truth, margin):
    size = np.array([truth.spec.width, truth.spec.height])
    return np.all((truth.true_uv > margin) & (truth.true_uv < size - margin), axis=1)


def test_dots_that_saturate_are_measured_with_what_clipping_leaves() -> None:
    """Retro-reflective dots at six times full scale: blurred discs, clipped, on a black ground."""
    rng = np.random.default_rng(4)
    row, col = (a.ravel() for a in np.mgrid[0:7, 0:9])
    field = Testfield(row, col, np.column_stack([20.0 * col, -20.0 * row, 0.0 * row]), np.full(63, 8.0))
    turn = np.array([[np.cos(0.2), -np.sin(0.2)], [np.sin(0.2), np.cos(0.2)]])
    truth = np.column_stack([20.3 * col, 20.3 * row]) @ turn.T + (60.37, 25.81)
    v, u = (np.mgrid[0 : 230 * 4, 0 : 260 * 4] + 0.5) / 4 - 0.5
    place = np.stack([u - 60.37, v - 25.81], axis=-1) @ turn / 20.3  # columns and rows of the board
    away = 20.3 * np.linalg.norm(place - np.clip(np.rint(place), 0, (8, 6)), axis=-1)  # from the nearest dot
    light = np.clip((4.0 - away) * 4 + 0.5, 0, 1).reshape(230, 4, 260, 4).mean(axis=(1, 3))
    light = cv2.GaussianBlur(light, (0, 0), 0.9)
    image = np.clip(np.rint(4 + 6 * 255 * light + rng.normal(0, 1, light.shape)), 0, 255).astype(np.float32)
    nothing = np.full(image.shape, np.nan, np.float32)
    phase = PhaseMap(nothing, nothing, nothing, nothing, 0 * image, image, np.zeros(image.shape, np.uint8))
    at = [0, 8, 62, 54]
    seeds = [Seed(int(row[k]), int(col[k]), *truth[k]) for k in at]
    found = measure_targets(phase, field, seeds, DeviceSpec(260, 230, (0.01, 0.01), 12.0))
    assert len(found.row) == 63
    error = found.camera_uv - truth
    # small dots, hardly any noise: the stated 0.01 px, found on dots of 12 px and more, is half of it
    assert np.sqrt(np.mean(error**2)) < 0.03
    assert 0.5 < np.sqrt(np.mean(error**2 / np.diagonal(found.camera_cov, axis1=1, axis2=2))) < 2.5
