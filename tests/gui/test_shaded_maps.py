"""Light on a surface, and heights over the mean plane: against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from core.evaluate import heights
from stripe_gui.presenters.maps import LIGHT, hill_shade, lit_colours
from stripe_gui.presenters.reconstruct import Points, space_of

LIGHT_UNIT = np.array(LIGHT) / np.linalg.norm(LIGHT)


def surface(z) -> np.ndarray:
    """Points on a grid of 0.5 mm at 600 mm; z(x, y) is added."""
    x, y = np.meshgrid(np.arange(60) * 0.5 - 15, 10 - np.arange(40) * 0.5)
    return np.stack([x, y, -600 + z(x, y)], axis=-1).astype(np.float32)


@pytest.mark.parametrize(("slope_x", "slope_y"), [(0, 0), (0.4, 0), (0, -0.7), (0.3, 0.2), (-1.5, 1.0)])
def test_a_tilted_plane_is_lit_by_the_cosine_of_its_angle_to_the_light(slope_x: float, slope_y: float) -> None:
    shade = hill_shade(surface(lambda x, y: slope_x * x + slope_y * y))
    normal = np.array([-slope_x, -slope_y, 1]) / np.sqrt(1 + slope_x**2 + slope_y**2)
    np.testing.assert_allclose(shade[1:-1, 1:-1], max(normal @ LIGHT_UNIT, 0), atol=1e-3)  # float32 at 600 mm


def test_a_sphere_is_lit_by_its_own_normals() -> None:
    radius = 30.0
    xyz = surface(lambda x, y: np.sqrt(radius**2 - x**2 - y**2) - radius)
    normal = (xyz - (0, 0, -600 - radius)) / radius
    expected = np.clip(normal @ LIGHT_UNIT, 0, 1)
    # central differences of step h are off by h² f‴ / 6; f‴ stays below 0.01 / mm² here, and h is 0.5 mm
    np.testing.assert_allclose(hill_shade(xyz)[1:-1, 1:-1], expected[1:-1, 1:-1], atol=2e-3)


def test_slopes_turned_away_from_the_light_are_dark_and_gaps_stay_gaps() -> None:
    assert np.nanmax(hill_shade(surface(lambda x, y: 5 * x - 5 * y))) > 0.5
    assert np.nanmax(hill_shade(surface(lambda x, y: -5 * x + 5 * y))) == 0
    holed = surface(lambda x, y: 0 * x)
    holed[20, 30] = np.nan
    shade = hill_shade(holed)
    assert np.isnan(shade[[20, 20, 19, 21], [29, 31, 30, 30]]).all()
    assert np.isfinite(shade[18, 30])


def test_colours_are_those_of_the_scale_and_darker_in_shadow() -> None:
    table = np.tile(np.arange(256, dtype=np.uint8)[:, None], (1, 3))
    image = np.array([[0.0, 1.0, 2.0, np.nan]])
    lit = lit_colours(image, (0.0, 2.0), table, np.ones((1, 4)))
    assert lit[0, :, 0].tolist() == [0, 127, 255, 0]
    assert lit[0, :, 3].tolist() == [255, 255, 255, 0]
    dark = lit_colours(image, (0.0, 2.0), table, np.zeros((1, 4)))
    assert dark[0, 2, 0] == 63  # a quarter: shadows keep their colour


def test_heights_are_measured_from_the_mean_plane_towards_the_camera() -> None:
    xyz = surface(lambda x, y: 0.3 * x - 0.1 * y)
    assert np.abs(heights(xyz)).max() < 2e-4
    xyz[20, 30, 2] += 2.0  # towards the camera; along the normal it is the cosine of the tilt less
    cosine = 1 / np.sqrt(1 + 0.3**2 + 0.1**2)
    assert heights(xyz)[20, 30] == pytest.approx(2.0 * cosine, abs=0.01)
    xyz[5, 5] = np.nan
    assert np.isnan(heights(xyz)[5, 5])


def test_the_cloud_keeps_shape_and_is_seen_right_way_up() -> None:
    xyz = surface(lambda x, y: 0.1 * x * y)
    cloud = space_of(Points(xyz, None))
    assert len(cloud.places_mm) == xyz.shape[0] * xyz.shape[1]
    away = cloud.places_mm.reshape(40, 60, 3)
    assert away[0, 1, 0] > away[0, 0, 0]  # right stays right
    assert away[0, 0, 2] > away[1, 0, 2]  # up stays up
    np.testing.assert_allclose(np.ptp(cloud.places_mm[:, 1]), np.ptp(xyz[..., 2]), rtol=1e-4)
    np.testing.assert_allclose(
        np.linalg.norm(cloud.places_mm[0] - cloud.places_mm[-1]), np.linalg.norm(xyz[0, 0] - xyz[-1, -1]), rtol=1e-4
    )
    assert cloud.spacing_mm == pytest.approx(0.5, rel=0.5)


def test_a_space_of_nothing_is_empty() -> None:
    cloud = space_of(Points(np.full((4, 5, 3), np.nan, np.float32), None))
    assert len(cloud.places_mm) == len(cloud.colours) == 0
