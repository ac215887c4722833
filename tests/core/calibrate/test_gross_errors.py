"""Observations hundreds of pixels off are named, whether plain least squares solves the network or not."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibrate import AdjustOptions, adjust
from core.calibrate.resection import resect_despite_errors
from core.errors import AdjustmentError
from core.geometry import Pose, matrix_from_axis_angle


def spoilt(network, rows, shifts):
    uv = network.observation_uv.copy()
    uv[rows] += shifts
    return replace(network, observation_uv=uv)


def told(network):
    """All that an adjustment says of gross errors, whether it solves the network or refuses it."""
    try:
        return " ".join(w for w in adjust(network).warnings if "gross errors" in w)
    except AdjustmentError as error:
        return str(error)


@pytest.mark.parametrize("rigid", [True, False], ids=["rigid", "free"])
@pytest.mark.parametrize("size_px", [20.0, 200.0, 2000.0])
@pytest.mark.parametrize("seed", range(3))
def test_observations_far_off_are_named_and_no_others(simulate, rigid, size_px, seed):
    network = simulate(seed=seed, poses=10, rigid=rigid).network
    rng = np.random.default_rng(seed)
    rows = rng.choice(len(network.observation_uv), 4, replace=False)
    angle = rng.uniform(0, 2 * np.pi, len(rows))
    text = told(spoilt(network, rows, size_px * np.stack([np.cos(angle), np.sin(angle)], axis=1)))
    assert text.count("point P") == len(rows)
    for row in rows:
        station, point = network.observation_station[row], network.observation_point[row]
        assert f"station {network.station_names[station]} point {network.point_names[point]} " in text


def test_a_refusal_names_the_observation_and_the_remedy(simulate):
    network = simulate(poses=7, rows=5, cols=7, extent_mm=190.0, seed=11).network
    row = int(np.flatnonzero(network.observation_station == 4)[19])
    with pytest.raises(AdjustmentError) as refusal:
        adjust(spoilt(network, [row], [[1500.0, 500.0]]))
    point = network.point_names[network.observation_point[row]]
    assert refusal.value.where.startswith(f"station {network.station_names[4]} point {point} ")
    assert "leave them out" in refusal.value.remedy


def test_a_whole_wrong_image_is_named_as_one(simulate):
    network = simulate(poses=10, use=("camera",)).network
    rng = np.random.default_rng(0)
    rows = np.flatnonzero(network.observation_station == 4)
    point = network.observation_point.copy()
    point[rows] = rng.permutation(point[rows])
    text = told(replace(network, observation_point=point))
    assert f"station {network.station_names[4]}" in text
    assert text.count("station ") - text.count("leave the station") == 1


def test_what_keeps_a_network_from_being_solved_is_left_out_where_that_is_wished(simulate):
    network = simulate(poses=10, seed=2).network
    rows = np.array([30, 200, 350])
    bad = spoilt(network, rows, [[900.0, 100.0], [-300.0, 1200.0], [40.0, -700.0]])
    adjustment = adjust(bad, options=AdjustOptions(reject_beyond=6.0))
    assert len(adjustment.residuals) == len(network.observation_uv) - len(rows)
    assert adjustment.sigma0 == pytest.approx(1.0, abs=0.1)
    assert any(w.startswith(f"{len(rows)} of") and "rejected" in w for w in adjustment.warnings)


def test_resection_finds_the_pose_on_which_most_points_agree():
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.linspace(-100, 100, 8), np.linspace(-70, 70, 6))
    points = np.stack([x.ravel(), y.ravel(), rng.normal(scale=15, size=x.size)], axis=1)
    pose = Pose(matrix_from_axis_angle([1, 0.3, 0.1], 0.5), np.array([10.0, -5.0, -600.0]))
    X, Y, Z = pose.apply(points).T
    tangents = np.stack([-X / Z, -Y / Z], axis=1) + rng.normal(scale=1e-6, size=(len(points), 2))
    wrong = rng.choice(len(points), 12, replace=False)
    tangents[wrong] = rng.uniform(-0.4, 0.4, (len(wrong), 2))
    found = resect_despite_errors(points, tangents)
    # a millionth of the distance in each of 36 points
    assert min(float(np.abs(p.apply(points) - pose.apply(points)).max()) for p in found) < 0.05
