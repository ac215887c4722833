"""The orthogonal plane fit on planes that are known."""

from __future__ import annotations

import numpy as np
import pytest

from core.errors import StripeError
from core.evaluate import fit_plane


def _grid(normal: np.ndarray, distance: float, n: int = 15) -> np.ndarray:
    """Points (n², 3) on normal · X = -distance, symmetrical about the foot of the perpendicular."""
    a = np.cross(normal, [0.0, 1.0, 0.0] if abs(normal[1]) < 0.9 else [1.0, 0.0, 0.0])
    a /= np.linalg.norm(a)
    b = np.cross(normal, a)
    s = np.linspace(-100, 100, n)
    return -distance * normal + (np.multiply.outer(s, a)[:, None] + np.multiply.outer(s, b)).reshape(-1, 3)


def test_exact_planes_come_back_however_steep() -> None:
    rng = np.random.default_rng(2)
    along_axes = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (0, 1) if x or y or z]
    for normal in np.vstack([along_axes, rng.uniform((-1, -1, 0), 1, (60, 3))]):
        distance = rng.uniform(100, 2000)
        normal /= np.linalg.norm(normal)
        plane = fit_plane(_grid(normal, distance))
        np.testing.assert_allclose(plane.normal, normal, atol=1e-12)  # towards the camera at the origin
        np.testing.assert_allclose(plane.offset_mm, -distance, rtol=1e-12)
        np.testing.assert_allclose(plane.deviations(_grid(normal, distance)), 0, atol=1e-9)


def test_a_plane_on_edge_is_fitted_where_a_depth_fit_would_fail() -> None:
    plane = fit_plane(_grid(np.array([1.0, 0.0, 0.0]), 30.0))
    np.testing.assert_allclose(plane.normal, [1, 0, 0], atol=1e-12)


def test_deviations_are_positive_towards_the_camera() -> None:
    points = _grid(np.array([0.0, 0.0, 1.0]), 600.0)
    points[len(points) // 2, 2] += 0.5  # the middle point; 1/225 of it goes into the fit
    deviations = fit_plane(points).deviations(points)
    assert deviations[len(points) // 2] == pytest.approx(0.5 * (1 - 1 / 225), rel=1e-9)


def test_fitted_planes_scatter_as_theory_says() -> None:
    rng = np.random.default_rng(5)
    normal = np.array([0.3, -0.2, 0.9]) / np.linalg.norm([0.3, -0.2, 0.9])
    points = _grid(normal, 600.0)
    sigma, squares = 0.05, []
    for _ in range(200):
        noisy = points + rng.normal(0, sigma, (len(points), 1)) * normal
        squares.append(np.sum(fit_plane(noisy).deviations(noisy) ** 2) / sigma**2)
    # chi² with n - 3 = 222 degrees of freedom; the mean of 200 has a standard deviation of 1.5
    assert np.mean(squares) == pytest.approx(len(points) - 3, abs=5)


@pytest.mark.parametrize("n", [0, 1, 3])
def test_too_few_points_are_refused(n: int) -> None:
    with pytest.raises(StripeError, match=f"plane-20: {n} valid points"):
        fit_plane(_grid(np.array([0.0, 0.0, 1.0]), 600.0)[:n], where="plane-20")


def test_points_on_a_line_are_refused() -> None:
    with pytest.raises(StripeError, match="on one line"):
        fit_plane(np.outer(np.arange(10.0), [1, 2, 3]) - (0, 0, 600))
