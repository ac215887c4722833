"""Lens models: against OpenCV, by finite differences, there and back, and one added from outside."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from core.geometry import LENSES, distort, fitted, lens_of, project, ray_directions, regular, undistort
from core.model import DeviceSpec, Interior

SPEC = DeviceSpec(748, 576, (0.008, 0.0083), 12.0)
EXAMPLES = {
    "A1..A6": (12.1, -0.08, -0.11, -6e-4, 3e-6, -0.0143, 3e-5, -1.2e-4, -7.6e-5),
    "brown": (12.1, -0.08, 0.11, -0.09, 0.07, 8e-4, -6e-4, -0.03, 0.02, -0.01, 0.005, 0.003),
}


def example(name: str) -> Interior:
    return Interior.from_vector(np.array(EXAMPLES[name]), SPEC.zero_radius_mm, name)


def places() -> np.ndarray:
    return np.random.default_rng(5).uniform([-2.9, -2.3], [2.9, 2.3], (400, 2))


def test_every_model_of_the_folder_is_tried_here() -> None:
    assert set(LENSES) == set(EXAMPLES)


@pytest.mark.parametrize("name", EXAMPLES)
def test_what_is_usual_of_a_lens_does_not_depend_on_r0(name: str) -> None:
    """A project may put it in the middle of the image."""
    usual = LENSES[name].usual_sigma
    np.testing.assert_array_equal(usual(replace(SPEC, r0_mm=0.0)), usual(SPEC))


def test_brown_is_what_opencv_projects() -> None:
    interior = example("brown")
    rng = np.random.default_rng(1)
    points = rng.uniform([-130, -90, -700], [130, 90, -500], (500, 3))
    c, x0, y0, *k, b1 = interior.vector
    K = np.array(
        [
            [c * (1 + b1) / SPEC.pitch_mm[0], 0, (SPEC.width - 1) / 2 + x0 / SPEC.pitch_mm[0]],
            [0, c / SPEC.pitch_mm[1], (SPEC.height - 1) / 2 - y0 / SPEC.pitch_mm[1]],
            [0, 0, 1],
        ]
    )
    expected = cv2.projectPoints(points * [1, -1, -1], np.zeros(3), np.zeros(3), K, np.array(k))[0][:, 0]
    assert np.abs(project(SPEC, interior, points) - expected).max() < 1e-9


@pytest.mark.parametrize("name", EXAMPLES)
def test_derivatives_are_those_of_finite_differences(name: str) -> None:
    interior, xy, lens = example(name), places(), LENSES[name]
    by_xy, by_parameter = lens.derivatives(interior, xy)
    for j, step in enumerate(np.eye(2) * 1e-4):
        numeric = (lens.distort(interior, xy + step) - lens.distort(interior, xy - step)) / 2e-4
        assert np.abs(by_xy[..., j] - numeric).max() < 1e-8  # the cubic term of the differences
    for j in range(len(lens.names)):
        h = 1e-5 * max(abs(interior.vector[j]), 1e-3)
        ends = []
        for sign in (1, -1):
            moved = Interior.from_vector(interior.vector + sign * h * np.eye(len(lens.names))[j], interior.r0_mm, name)
            ends.append(lens.distort(moved, xy / interior.c_mm * moved.c_mm))  # the point stands still
        numeric = (ends[0] - ends[1]) / (2 * h)
        assert np.abs(by_parameter[..., j] - numeric).max() < 1e-6 * max(1, np.abs(numeric).max()), lens.names[j]


@pytest.mark.parametrize("name", EXAMPLES)
def test_there_and_back(name: str) -> None:
    interior, xy = example(name), places()
    assert np.abs(undistort(interior, distort(interior, xy)) - xy).max() < 1e-9
    assert regular(SPEC, interior)
    uv = np.array([[0.0, 0.0], [747.0, 575.0], [400.25, 200.5]])
    assert np.abs(project(SPEC, interior, 600 * ray_directions(SPEC, interior, uv)) - uv).max() < 1e-6


@pytest.mark.parametrize("name", EXAMPLES)
def test_sizes_names_and_units_agree(name: str) -> None:
    lens = LENSES[name]
    k = len(lens.names)
    assert len(lens.units) == len(lens.keys) == len(lens.usual_sigma(SPEC)) == k == len(EXAMPLES[name])
    assert lens.names[:3] == ("c", "x0", "y0")
    assert set(lens.usual) <= set(lens.names)
    assert np.all(lens.usual_sigma(SPEC) > 0)


def test_a_lens_that_folds_is_not_regular() -> None:
    assert not regular(SPEC, replace(example("A1..A6"), a=(-0.05, 0.0, 0.0, 0.0, 0.0, 0.0)))


def test_one_model_said_by_the_other() -> None:
    """A1..A6 without shear lies within what k1 to b1 can say; what remains is the order of the affine step."""
    camera = example("A1..A6")
    other, rms_px = fitted(SPEC, camera, "brown")
    assert rms_px < 0.02  # k1 k2 p1 p2 k3 reached 0.012 px on the demo's camera
    rays = ray_directions(SPEC, camera, np.array([[100.0, 80.0], [600.0, 500.0]]))
    assert np.abs(project(SPEC, other, 600 * rays) - [[100, 80], [600, 500]]).max() < 0.06


def test_all_parameters_of_a_rational_lens_are_found_again() -> None:
    every = LENSES["brown"].names
    assert fitted(SPEC, example("brown"), "brown", every)[1] < 1e-6
    assert fitted(SPEC, example("A1..A6"), "brown", every)[1] < 0.02


def test_a_model_from_outside_is_used_like_the_others(extension) -> None:
    """Division model with one parameter: x / (1 + q r²)."""
    extension("lens_model", LENSES)
    interior = Interior(12.0, 0.01, -0.02, (1e-3,), model="division")
    assert lens_of(interior) is LENSES["division"]
    assert np.abs(undistort(interior, distort(interior, places())) - places()).max() < 1e-9
    found, rms_px = fitted(SPEC, interior, "A1..A6")
    assert rms_px < 0.01
    assert abs(found.x0_mm - 0.01) < 1e-3
