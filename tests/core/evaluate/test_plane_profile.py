"""Profiles along a line: against surfaces that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from core.errors import InputError
from core.evaluate import evaluate_plane, interpolate, points_on_plane, read_profile
from core.geometry import ray_directions
from core.model import DeviceSpec, Interior, PhaseMap, PlaneEvaluation, PointCloud

H, W = 90, 120
SPEC = DeviceSpec(W, H, (0.008, 0.008), 12.0)
PINHOLE = Interior(12.0)
DISTORTED = Interior(12.0, 0.02, -0.01, (-6e-4, 3e-6, -0.0143, 3e-5, -1.2e-4, -7.6e-5), 0.4)


def evaluation(deviation: np.ndarray, sigma: np.ndarray | None = None, plane=(0.0, 0.0, 1.0, -600.0), camera=PINHOLE):
    sigma = np.zeros((0, 0)) if sigma is None else sigma
    return PlaneEvaluation(
        "p", 0.0, "photogrammetric", 1, 1.0, 1.0, -1.0, None, 0, "", np.array(plane), deviation, sigma, camera
    )


def grid() -> tuple[np.ndarray, np.ndarray]:
    return np.meshgrid(np.arange(W, dtype=float), np.arange(H, dtype=float))


def test_on_an_inclined_surface_interpolation_is_exact() -> None:
    u, v = grid()
    found = read_profile(evaluation(0.002 * u - 0.003 * v + 0.1), SPEC, (3.3, 80.9), (110.2, 7.4))
    np.testing.assert_allclose(found.deviation_mm, 0.002 * found.uv[:, 0] - 0.003 * found.uv[:, 1] + 0.1, atol=1e-12)
    np.testing.assert_allclose(found.uv[[0, -1]], [(3.3, 80.9), (110.2, 7.4)])
    assert np.hypot(*np.diff(found.uv, axis=0)[0]) == pytest.approx(1.0, abs=0.01)  # about one point a pixel


def test_on_waves_the_error_stays_below_that_of_linear_interpolation() -> None:
    u, v = grid()
    k, amplitude = 2 * np.pi / 25, 0.05
    found = read_profile(evaluation(amplitude * np.sin(k * u) * np.cos(k * v)), SPEC, (2.6, 4.1), (115.0, 83.7))
    truth = amplitude * np.sin(k * found.uv[:, 0]) * np.cos(k * found.uv[:, 1])
    assert np.abs(found.deviation_mm - truth).max() <= 2 * amplitude * k**2 / 8  # h² f″ / 8 in each direction, h = 1


def test_length_runs_along_the_plane_in_mm() -> None:
    """A plane square to a pinhole camera at 600 mm: a pixel of 8 µm at c = 12 mm covers 0.4 mm."""
    found = read_profile(evaluation(np.zeros((H, W))), SPEC, (10.0, 20.0), (90.0, 80.0))
    assert found.length_mm[0] == 0
    assert found.length_mm[-1] == pytest.approx(100 * 0.4)
    np.testing.assert_allclose(np.diff(found.length_mm), 0.4, rtol=1e-9)


def test_on_a_tilted_plane_the_length_is_that_between_the_points_in_space() -> None:
    """At 40° the plane is Z = -600 - X tan 40°: the ray X = t s, Z = -s meets it at s = 600 / (1 - t tan 40°)."""
    slope = np.tan(np.radians(40))
    normal = np.array([slope, 0, 1]) / np.hypot(slope, 1)
    found = read_profile(
        evaluation(np.zeros((H, W)), plane=(*normal, -600 * normal[2])), SPEC, (0, 44.5), (W - 1, 44.5)
    )
    t = (np.array([0, W - 1]) - (W - 1) / 2) * 0.008 / 12
    s = 600 / (1 - t * slope)
    assert found.length_mm[-1] == pytest.approx(np.diff(t * s)[0] / np.cos(np.radians(40)))


def test_points_on_the_plane_lie_on_their_rays_with_distortion_too() -> None:
    normal = np.array([0.2, -0.1, 0.97])
    normal /= np.linalg.norm(normal)
    uv = np.array([[0.0, 0.0], [60.3, 30.7], [119.0, 89.0]])
    points = points_on_plane([*normal, -580.0], SPEC, DISTORTED, uv)
    np.testing.assert_allclose(points @ normal, -580.0)
    rays = ray_directions(SPEC, DISTORTED, uv)
    np.testing.assert_allclose(np.cross(points, rays), 0, atol=1e-9)


def test_a_ray_that_never_meets_the_plane_has_no_point() -> None:
    assert np.isnan(points_on_plane([0, 0, 1.0, 600.0], SPEC, PINHOLE, [[5.0, 5.0]])).all()  # behind the camera
    assert np.isnan(points_on_plane([0, 1.0, 0, -50.0], SPEC, PINHOLE, [[5.0, 44.5]])).all()  # parallel to the ray


def test_pixels_without_point_and_places_outside_the_image_leave_gaps() -> None:
    deviation = np.ones((H, W))
    deviation[40, 50] = np.nan
    found = read_profile(evaluation(deviation), SPEC, (-5.0, 40.0), (W + 4.0, 40.0))
    u = found.uv[:, 0]
    gap = (u < 0) | (u > W - 1) | (np.abs(u - 50) < 1)
    np.testing.assert_array_equal(np.isnan(found.deviation_mm), gap)
    assert np.isfinite(found.length_mm).all()


def test_sigma_is_that_of_the_mean_of_four_pixels() -> None:
    value, _ = interpolate(np.full((H, W), 0.04), [[10.0, 10.0], [10.5, 10.0], [10.5, 10.5]])
    np.testing.assert_allclose(value, 0.04)
    found = read_profile(evaluation(np.zeros((H, W)), np.full((H, W), 0.04)), SPEC, (10.0, 10.0), (11.5, 11.5))
    np.testing.assert_allclose(found.uv[1], (10.75, 10.75))
    weights = np.outer([0.25, 0.75], [0.25, 0.75])
    np.testing.assert_allclose(found.sigma_mm[:2], [0.04, 0.04 * np.sqrt((weights**2).sum())])


def test_the_predicted_sigma_of_noise_is_met_along_a_profile() -> None:
    """Noise of σ = 0.03 mm along the rays: the profile's values have the sigma predicted for them, 2 % off at 1σ."""
    rng = np.random.default_rng(3)
    uv = np.stack(grid(), axis=-1)
    rays = ray_directions(SPEC, PINHOLE, uv)
    ratios = []
    for _ in range(30):
        cloud = rays * (600 + rng.normal(0, 0.03, (H, W)))[..., None]
        one = np.ones((H, W), np.float32)
        phase = PhaseMap(one, one, one, one, one, one, np.zeros((H, W), np.uint8))
        points = PointCloud(cloud, None, np.full((H, W), 0.03, np.float32))
        judged = evaluate_plane(phase, points, capture="p", angle_deg=0, method="photogrammetric", camera=PINHOLE)
        found = read_profile(judged, SPEC, (4.3, 80.6), (115.1, 5.2))
        ratios.append(found.deviation_mm / found.sigma_mm)
    # 30 profiles of 134 points, neighbours correlated by interpolation: about 2000 independent values
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.05)


def test_without_sigma_or_camera_these_are_unknown_and_the_rest_is_there() -> None:
    found = read_profile(evaluation(np.zeros((H, W)), camera=None), SPEC, (10, 10), (20, 10))
    assert np.isnan(found.sigma_mm).all()
    assert np.isnan(found.length_mm).all()
    assert (found.deviation_mm == 0).all()


def test_a_line_of_no_length_is_refused() -> None:
    with pytest.raises(InputError, match=r"0\.50 px apart"):
        read_profile(evaluation(np.zeros((H, W))), SPEC, (10, 10), (10.5, 10))
