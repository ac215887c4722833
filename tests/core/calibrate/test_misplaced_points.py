"""Approximate coordinates that are wrong: in another unit, exchanged, zero, behind a camera."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from core.calibrate import adjust
from core.errors import AdjustmentError
from core.geometry import similarity
from core.model import DeviceSpec, Interior
from tests.core.calibrate.conftest import simulated_network

SHARE = 8  # one point in so many is misplaced


def seen(held):
    """A network, and the control points in its corners that give the datum where they are held."""
    network = simulated_network(seed=3).network
    if not held:
        return network, []
    nominal = network.point_xyz_mm
    corners = [np.argmin(nominal[:, :2] @ along) for along in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
    sigma = np.full(nominal.shape, np.inf)
    sigma[corners] = 0.05
    return replace(network, point_sigma_mm=sigma), corners


@cache
def rightly_told(held):
    return adjust(seen(held)[0])


@pytest.mark.parametrize(
    ("kind", "held"),
    [
        ("in micrometres", False), ("in metres", False), ("exchanged", False), ("far off", False),
        ("in micrometres", True), ("exchanged", True),
    ],
)  # fmt: skip
def test_points_told_at_wrong_places_change_nothing_and_are_named(kind, held):
    network, corners = seen(held)
    nominal, wrong = network.point_xyz_mm, np.arange(3, len(network.point_xyz_mm), SHARE)
    wrong = np.setdiff1d(wrong, corners)
    told, rng = nominal.copy(), np.random.default_rng(1)
    told[wrong] = {
        "in micrometres": nominal[wrong] * 1e3,
        "in metres": nominal[wrong] / 1e3,
        "exchanged": np.roll(nominal[wrong], len(wrong) // 2, axis=0),
        "far off": nominal[wrong] + np.ptp(nominal, axis=0).max() * rng.standard_normal((len(wrong), 3)),
    }[kind]
    right, result = rightly_told(held), adjust(replace(network, point_xyz_mm=told))
    assert result.sigma0 == pytest.approx(right.sigma0, rel=1e-3)
    for name, device in right.devices.items():
        assert np.abs((result.devices[name].interior.vector - device.interior.vector) / device.sigma)[:3].max() < 0.1
    if not held:  # from control points others are intersected anyway
        assert any("contradict the approximate coordinates" in w for w in result.warnings)
    assert not any("contradict the approximate" in w for w in right.warnings)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sigma_mm", [20.0, 40.0])
def test_a_board_that_is_roughly_known_is_taken_as_told(simulate, sigma_mm, seed):
    """The datum is free on all approximate coordinates: no shift, turn or scale is left to them (closed form)."""
    network = simulate(seed=4, scale=False).network
    rough = network.point_xyz_mm + np.random.default_rng(seed).normal(0, sigma_mm, network.point_xyz_mm.shape)
    result = adjust(replace(network, point_xyz_mm=rough))
    assert not any("contradict" in w for w in result.warnings)
    scale, R, shift = similarity(result.points_mm, rough)
    assert scale == pytest.approx(1, abs=1e-9)
    assert np.allclose(R, np.eye(3), atol=1e-9)
    assert np.allclose(shift, 0, atol=1e-6)


@pytest.mark.parametrize("seed", [3, 4, 6, 10])
def test_rough_points_of_a_flat_field_are_not_called_mirrored(simulate, seed):
    """Mirrored images fitted such points as well, and were blamed."""
    made = simulate(seed=seed, use=("camera",), depth_mm=0.0, scale=False)
    rough = made.points_mm + np.random.default_rng(seed).normal(0, 60.0, made.points_mm.shape)
    result = adjust(replace(made.network, point_xyz_mm=rough))
    assert result.sigma0 == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("seed", range(3))
def test_rough_points_of_a_flat_field_far_away_do_not_turn_stations_over(simulate, seed):
    """Seen within 4° each pose has a twin, inclined to the other side, that fits rough points as well."""
    camera = DeviceSpec(2448, 2048, (0.00345, 0.00345), 100.0)
    truth = Interior(101.0, 0.0, 0.0, (0.0,) * 6, camera.zero_radius_mm)
    far = {"distance_mm": 4500.0, "extent_mm": 300.0, "depth_mm": 0.0, "tilt_deg": 35.0, "poses": 20, "scale": False}
    lens = {"use": ("camera",), "camera": camera, "camera_truth": truth, "estimate": ("c", "A1")}
    result = adjust(simulate(seed=seed, approximation_mm=6.0, **far, **lens).network)
    assert result.sigma0 == pytest.approx(1.0, abs=0.1)  # redundancy of 1600: sigma 0.02


@pytest.mark.parametrize("known", [3, 0])
def test_points_without_approximate_coordinates_are_found_from_the_images_alone(simulate, known) -> None:
    """Three corners are held and all other points said to be at one place; or every point anywhere."""
    simulated = simulate(use=("camera",), poses=8, scale=False)
    n, rng = len(simulated.points_mm), np.random.default_rng(3)
    held = np.isin(np.arange(n), [0, 7, n - 1][:known])
    said = np.where(held[:, None], simulated.points_mm, 0.0 if known else rng.normal(scale=100, size=(n, 3)))
    sigma = np.where(held[:, None], 0.0, np.inf) * np.ones(3)
    found = adjust(replace(simulated.network, point_xyz_mm=said, point_sigma_mm=sigma if known else None))
    assert any("were intersected from the images alone" in warning for warning in found.warnings)
    camera, true = found.devices["camera"], simulated.interior["camera"].vector
    # nine parameters, and what 45 points leave of the truth in the datum of the held ones
    assert np.abs((camera.interior.vector - true) / camera.sigma).max() < 4
    if known:
        spread = np.sqrt(np.diagonal(found.point_cov_mm2, axis1=1, axis2=2))[~held]
        assert np.abs((found.points_mm - simulated.points_mm)[~held] / spread).max() < 5


@pytest.mark.parametrize("said", [np.zeros(3), np.array([50.0, 20.0, 10.0])])
def test_points_on_one_line_are_refused(simulate, said) -> None:
    network = simulate(use=("camera",), poses=4).network
    network = replace(network, point_xyz_mm=np.arange(len(network.point_names))[:, None] * said, scale=None)
    with pytest.raises(AdjustmentError, match="points lie on one line, or all at one place"):
        adjust(network)
