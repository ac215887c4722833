"""The device's equations against the definition written out, and against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from core.geometry import (
    Pose,
    distort,
    image_to_pixel,
    matrix_from_axis_angle,
    matrix_from_rotation_vector,
    pixel_to_image,
    project,
    ray_directions,
    rotation_vector_from_matrix,
    undistort,
)
from core.model import DeviceSpec, Interior

SPEC = DeviceSpec(748, 576, (0.008, 0.008), 12.0)
# the camera of Brenner, Böhm, Gühring (1999)
A = (-0.603793e-3, 0.308968e-5, -0.143177e-1, 0.308307e-4, -0.121978e-3, -0.757670e-4)
CAMERA = Interior(12.102765, -0.081293, -0.114492, A, SPEC.zero_radius_mm)


def definition(interior: Interior, x: float, y: float) -> tuple[float, float]:
    """The six additional parameters, written as the format defines them, one scalar at a time."""
    a1, a2, a3, a4, a5, a6 = interior.a
    r, r0 = (x**2 + y**2) ** 0.5, interior.r0_mm
    d = a1 * (r**2 - r0**2) + a2 * (r**4 - r0**4)
    x1 = x + x * d + 2 * a5 * x * y + a6 * (r**2 + 2 * x**2) + interior.x0_mm
    y1 = y + y * d + 2 * a6 * x * y + a5 * (r**2 + 2 * y**2) + interior.y0_mm
    return x1 + a3 * x1 + a4 * y1, y1 + a4 * x1 - a3 * y1


def test_distortion_is_the_definition() -> None:
    for x, y in [(0.0, 0.0), (2.9, -2.2), (-2.9, 2.2), (1.0, 0.0), (0.0, -1.5)]:
        assert distort(CAMERA, [x, y]) == pytest.approx(definition(CAMERA, x, y), abs=1e-14)


def test_undistortion_inverts_distortion_over_the_image() -> None:
    u, v = np.meshgrid(np.linspace(0, 747, 30), np.linspace(0, 575, 30))
    measured = pixel_to_image(SPEC, np.stack([u, v], -1))
    assert np.abs(distort(CAMERA, undistort(CAMERA, measured)) - measured).max() < 1e-9


def test_undistortion_says_nan_where_the_polynomial_has_no_inverse() -> None:
    barrel = Interior(10.0, a=(-0.02, 0.0, 0.0, 0.0, 0.0, 0.0))  # x + A1 x³ has its maximum, 2.72, at 4.08
    x, beyond = undistort(barrel, [[2.0, 0.0], [3.5, 0.0]])
    assert x[0] + -0.02 * x[0] ** 3 == pytest.approx(2.0)
    assert np.isnan(beyond).all()


def test_axes_point_where_the_format_says() -> None:
    assert pixel_to_image(SPEC, [0, 0]) == pytest.approx([-373.5 * 0.008, 287.5 * 0.008])
    simple = Interior(12.0)
    centre = project(SPEC, simple, [0.0, 0.0, -600.0])
    right = project(SPEC, simple, [10.0, 0.0, -600.0])
    up = project(SPEC, simple, [0.0, 10.0, -600.0])
    assert centre == pytest.approx([373.5, 287.5])
    assert right - centre == pytest.approx([12 * 10 / 600 / 0.008, 0.0])
    assert up - centre == pytest.approx([0.0, -12 * 10 / 600 / 0.008])


def test_a_point_behind_the_device_has_no_image() -> None:
    assert np.isnan(project(SPEC, CAMERA, [[0.0, 0.0, 100.0], [0.0, 0.0, 0.0]])).all()


def test_a_ray_passes_through_the_points_it_images() -> None:
    points = np.random.default_rng(1).uniform([-100, -80, -700], [100, 80, -500], (50, 3))
    rays = ray_directions(SPEC, CAMERA, project(SPEC, CAMERA, points))
    assert rays * -points[:, 2:] == pytest.approx(points, abs=1e-6)


def test_pixels_and_image_coordinates_are_inverse() -> None:
    uv = np.array([[0.0, 0.0], [747.0, 575.0], [12.25, 400.5]])
    assert image_to_pixel(SPEC, pixel_to_image(SPEC, uv)) == pytest.approx(uv, abs=1e-10)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-5, 0.7, 2.0, np.pi - 1e-7, np.pi])
@pytest.mark.parametrize("axis", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (1, 2, -3)])
def test_rotation_vectors_come_back(angle: float, axis: tuple[float, float, float]) -> None:
    R = matrix_from_axis_angle(axis, angle)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert np.linalg.norm(rotation_vector_from_matrix(R)) == pytest.approx(angle, abs=1e-7)
    assert matrix_from_rotation_vector(rotation_vector_from_matrix(R)) == pytest.approx(R, abs=1e-8)


def test_rotations_are_right_handed() -> None:
    assert matrix_from_axis_angle([0, 0, 2], np.pi / 2) @ [1, 0, 0] == pytest.approx([0, 1, 0], abs=1e-15)


def test_poses_chain_and_invert() -> None:
    a_from_b = Pose(matrix_from_rotation_vector([0.3, -0.2, 0.9]), np.array([1.0, 2.0, 3.0]))
    b_from_c = Pose(matrix_from_rotation_vector([-1.3, 0.4, 0.1]), np.array([-4.0, 0.5, 9.0]))
    X = np.random.default_rng(2).normal(size=(7, 3))
    assert (a_from_b @ b_from_c).apply(X) == pytest.approx(a_from_b.apply(b_from_c.apply(X)))
    assert a_from_b.inverse().apply(a_from_b.apply(X)) == pytest.approx(X)
    assert a_from_b.apply(a_from_b.origin_mm) == pytest.approx(np.zeros(3), abs=1e-14)


def test_the_default_zero_radius_is_two_thirds_of_half_the_diagonal() -> None:
    assert SPEC.zero_radius_mm == pytest.approx(2 / 3 * np.hypot(748, 576) * 0.008 / 2)
    assert DeviceSpec(748, 576, (0.008, 0.008), 12.0, r0_mm=0.0).zero_radius_mm == 0.0
