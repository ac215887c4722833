"""The adjustment against the truth networks were made from: noise-free, far nominal values, many shapes of field."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibrate import AdjustOptions, adjust
from core.calibrate.solution.datum import datum_columns
from core.geometry import LENSES

NOISE_FREE = {"noise": 0.0, "poses": 8, "rows": 5, "cols": 7, "extent_mm": 190.0}


def assert_interiors_are_true(simulated, adjustment):
    for name, device in adjustment.devices.items():
        truth = simulated.interior[name].vector
        # a hundredth of what noise of the told sigma would leave
        sigma = device.sigma / adjustment.sigma0
        assert np.all(np.abs(device.interior.vector - truth) < 0.01 * sigma), name


@pytest.mark.parametrize("factor", [0.8, 1.2], ids=["nominal c 20 % short", "nominal c 20 % long"])
@pytest.mark.parametrize("rigid", [True, False], ids=["rigid", "free"])
def test_truth_is_found_from_nominal_values_that_are_far_off(simulate, factor, rigid):
    base = simulate(**NOISE_FREE)
    camera, projector = (d.spec for d in base.network.devices.values())
    simulated = simulate(
        **NOISE_FREE,
        rigid=rigid,
        camera=replace(camera, nominal_c_mm=12.1 * factor, r0_mm=camera.zero_radius_mm),
        projector=replace(projector, nominal_c_mm=182 * factor, r0_mm=projector.zero_radius_mm),
    )
    assert_interiors_are_true(simulated, adjust(simulated.network))


def test_truth_is_found_with_strong_distortion_and_a_principal_point_five_percent_off(simulate):
    truth = simulate(**NOISE_FREE).interior["camera"]
    # A1 moves the corner of the image by 4 %, the principal point lies 5 % of the width and height away
    strong = replace(truth, x0_mm=0.30, y0_mm=-0.23, a=(-3e-3, *truth.a[1:]))
    simulated = simulate(**NOISE_FREE, use=("camera",), camera_truth=strong)
    assert_interiors_are_true(simulated, adjust(simulated.network))


@pytest.mark.parametrize(("depth_mm", "approximation_mm"), [(0.0, None), (30.0, 2.0), (80.0, 5.0)])
def test_truth_is_found_on_flat_and_on_deep_fields(simulate, depth_mm, approximation_mm):
    simulated = simulate(**NOISE_FREE, depth_mm=depth_mm, approximation_mm=approximation_mm)
    assert_interiors_are_true(simulated, adjust(simulated.network))


def test_object_coordinates_far_from_the_origin_cost_no_digits(simulate):
    simulated = simulate(**NOISE_FREE)
    shift = np.array([4.5e6, 5.4e6, 300.0])
    far = replace(simulated.network, point_xyz_mm=simulated.network.point_xyz_mm + shift)
    near_points, adjustment = adjust(simulated.network).points_mm, adjust(far)
    assert_interiors_are_true(simulated, adjustment)
    # a coordinate of 5e6 mm has its last binary digit at 1e-9 mm
    np.testing.assert_allclose(adjustment.points_mm - shift, near_points, atol=1e-5)


def test_stations_are_returned_as_the_movement_from_object_to_device(simulate):
    simulated = simulate(**NOISE_FREE)
    adjustment = adjust(simulated.network)
    for station, truth in zip(adjustment.station_from_object, simulated.stations, strict=True):
        # the datum is another than the truth's: rays to the points agree instead
        there = [simulated.network.point_names.index(p) for p in adjustment.network.point_names]
        np.testing.assert_allclose(
            station.apply(adjustment.points_mm), truth.apply(simulated.points_mm[there]), atol=2e-4
        )


def test_held_parameters_stay_at_their_nominal_values(simulate):
    simulated = simulate(poses=6, use=("camera",), estimate=("c", "x0", "y0", "A1"))
    device = adjust(simulated.network).devices["camera"]
    held = [k for k, name in enumerate(LENSES["A1..A6"].names) if name not in ("c", "x0", "y0", "A1")]
    assert np.all(device.interior.vector[held] == 0)
    assert np.all(device.sigma[held] == 0)
    fixed = adjust(simulate(poses=6, use=("camera",), estimate=()).network)
    assert fixed.devices["camera"].interior.c_mm == 12.0


def test_fit_does_not_depend_on_r0_and_c_changes_with_it_as_the_model_says(simulate):
    simulated = simulate(seed=5, use=("camera",))
    spec = simulated.network.devices["camera"].spec
    at_r0 = adjust(simulated.network)
    device = replace(simulated.network.devices["camera"], spec=replace(spec, r0_mm=0.0))
    at_zero = adjust(replace(simulated.network, devices={"camera": device}))
    assert at_zero.sigma0 == pytest.approx(at_r0.sigma0, rel=1e-9)
    a, b = at_r0.devices["camera"].interior, at_zero.devices["camera"].interior
    # equal up to second order in the radial correction, here (0.002)² of c
    assert b.c_mm == pytest.approx(a.c_mm * (1 - a.a[0] * a.r0_mm**2 - a.a[1] * a.r0_mm**4), abs=2e-4)
    assert (a.r0_mm, b.r0_mm) == (spec.zero_radius_mm, 0.0)


def test_points_lie_on_their_approximate_coordinates_in_the_sense_of_least_squares(simulate):
    for scale, defect in ((True, 6), (False, 7)):
        adjustment = adjust(simulate(scale=scale).network)
        approximate = adjustment.network.point_xyz_mm
        difference = (adjustment.points_mm - approximate).ravel()
        # turning, shifting and stretching the result brings it no nearer: the differences have no such part
        G = datum_columns(adjustment.points_mm, np.eye(7)[:, :defect])
        assert np.abs(G.T @ difference).max() < 1e-9 * np.linalg.norm(approximate)


def test_covariance_has_the_least_trace_of_all_datums(simulate):
    """An S-transformation onto fewer points gives larger sigmas and the same interior orientation."""
    adjustment = adjust(simulate(scale=False, rigid=False).network)
    cov = adjustment.point_cov_mm2
    best = np.trace(cov.sum(axis=0))
    subset = adjust(simulate(scale=True, rigid=False).network)
    # a measured distance adds its own uncertainty to the scale of all points, and none to the interior orientation
    assert np.trace(subset.point_cov_mm2.sum(axis=0)) / subset.sigma0**2 > best / adjustment.sigma0**2
    for name in adjustment.devices:
        np.testing.assert_allclose(
            subset.devices[name].sigma / subset.sigma0, adjustment.devices[name].sigma / adjustment.sigma0, rtol=1e-5
        )


def test_a_coordinate_that_was_not_observed_is_nan_and_counts_for_nothing(simulate):
    network = simulate(poses=8).network
    uv = network.observation_uv.copy()
    projector = np.array([d == "projector" for d in network.station_device])[network.observation_station]
    lost = np.flatnonzero(projector)[::3]
    uv[lost, 1] = np.nan
    whole, part = adjust(network), adjust(replace(network, observation_uv=uv))
    assert part.redundancy == whole.redundancy - len(lost)
    assert np.isnan(part.residuals[lost, 1]).all()
    assert np.isfinite(part.residuals[lost, 0]).all()
    assert np.nansum(part.redundancy_numbers) == pytest.approx(part.redundancy, abs=1e-5)


def test_variance_components_find_the_noise_of_each_device(simulate):
    simulated = simulate(poses=12, sigma_px={"camera": 0.02, "projector": 0.03})
    network = simulated.network
    projector = np.array([d == "projector" for d in network.station_device])[network.observation_station]
    # the sigmas told are wrong: half for the camera, three times for the projector
    sigma = network.observation_sigma * np.where(projector, 3.0, 0.5)[:, None]
    adjustment = adjust(replace(network, observation_sigma=sigma), options=AdjustOptions(variance_components=True))
    # each group has a redundancy of some 700: a standard deviation of 5 % of its variance
    assert adjustment.variance_factors["camera"] == pytest.approx(4.0, rel=0.15)
    assert adjustment.variance_factors["projector"] == pytest.approx(1 / 9, rel=0.15)
    assert adjustment.sigma0 == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("noise", [0.0, 1e-6])
def test_variance_components_of_observations_without_noise_end_with_the_truth(simulate, noise):
    simulated = simulate(noise=noise)
    adjustment = adjust(simulated.network, options=AdjustOptions(variance_components=True, reject_beyond=6.0))
    for name, device in adjustment.devices.items():
        assert device.interior.c_mm == pytest.approx(simulated.interior[name].c_mm, rel=1e-6)
    assert not adjustment.warnings


def test_sigma0_is_that_of_the_given_weights_unless_variance_components_are_asked_for(simulate):
    network = simulate(poses=8, scale=False).network
    doubled = adjust(replace(network, observation_sigma=2 * network.observation_sigma))
    plain = adjust(network)
    assert doubled.sigma0 == pytest.approx(plain.sigma0 / 2, rel=1e-6)
    assert set(plain.variance_factors.values()) == {1.0}
    np.testing.assert_allclose(doubled.parameter_cov, plain.parameter_cov, atol=1e-5 * plain.parameter_cov.max())
