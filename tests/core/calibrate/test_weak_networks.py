"""Networks that do not determine what is asked are refused or warned of, with the parameter and the remedy named."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from core.calibrate import AdjustOptions, adjust
from core.calibrate.approximate.initial import initial_state
from core.calibrate.diagnosis.weakness import UndeterminedError, singular_error
from core.calibrate.solution.normals import SingularNormalsError
from core.calibrate.solution.problem import problem_of
from core.calibrate.solution.solve import settled
from core.errors import AdjustmentError, InputError
from core.geometry import Pose, matrix_from_axis_angle
from core.model import Interior, NetworkScale
from tests.core.calibrate.conftest import CAMERA, camera_poses


def with_rows(network, keep):
    return replace(
        network,
        observation_station=network.observation_station[keep],
        observation_point=network.observation_point[keep],
        observation_uv=network.observation_uv[keep],
        observation_sigma=network.observation_sigma[keep],
    )


def test_missing_rolls_are_named_and_cost_what_theory_says(simulate):
    setup = {"use": ("camera",), "poses": 20, "rows": 13, "cols": 19}
    rolled, straight = adjust(simulate(**setup).network), adjust(simulate(**setup, rolled=False).network)
    assert not [w for w in rolled.warnings if "roll" in w]
    warning = next(w for w in straight.warnings if "roll" in w)
    assert "A3" in warning
    assert "x0" in warning
    growth = straight.devices["camera"].sigma / rolled.devices["camera"].sigma
    # of the reference network: sixfold for A3, fourfold for x0
    assert growth[5] > 4
    assert growth[1] > 3


def test_parallel_views_of_a_flat_field_leave_c_undetermined(simulate):
    views = [
        Pose(matrix_from_axis_angle([0, 0, 1], k * np.pi / 2), np.array([5.0 * k, 3.0 * k, -600.0 - 4 * k]))
        for k in range(6)
    ]
    network = simulate(camera_poses_given=views, use=("camera",), depth_mm=0.0).network
    with pytest.raises(AdjustmentError, match=r"camera\.c.*cannot be estimated.*convergent"):
        adjust(network)


def test_hardly_convergent_images_are_warned_of(simulate):
    adjustment = adjust(simulate(tilt_deg=6.0, poses=12).network)
    assert any("convergent" in w and w.startswith("camera") for w in adjustment.warnings)
    assert not any("convergent" in w for w in adjust(simulate(poses=12).network).warnings)


def test_two_images_do_not_calibrate_a_camera(simulate, monkeypatch):
    monkeypatch.setattr(sys.modules["core.calibrate.starts"], "robust_state", None)  # they fit: nothing else is tried
    with pytest.raises(AdjustmentError, match=r"camera\.\w+.*cannot be estimated"):
        adjust(simulate(poses=2, use=("camera",)).network)


def test_one_pose_of_a_rig_is_refused(simulate):
    with pytest.raises(AdjustmentError):
        adjust(simulate(poses=1).network)


def test_a_point_with_one_ray_is_left_out_and_named(simulate):
    network = simulate(poses=6, use=("camera",)).network
    keep = (network.observation_point != 20) | (network.observation_station == 2)
    adjustment = adjust(with_rows(network, keep))
    assert "P20" not in adjustment.network.point_names
    assert any("two rays" in w and "P20" in w for w in adjustment.warnings)


@pytest.mark.parametrize("seed", [0, 3])
def test_points_seen_from_one_place_only_are_left_out_and_named(simulate, seed):
    """By two images of one station, rolled: how far away the points are is open, and no iteration ended."""
    views = camera_poses(10, 600.0, 32.0, True, np.random.default_rng(seed))
    rolled = Pose(matrix_from_axis_angle([0, 0, 1], np.pi / 2)) @ views[-1]
    network = simulate(seed=seed, camera_poses_given=[*views, rolled], use=("camera",)).network
    loose = np.isin(network.observation_point, [8, 19, 30])
    found = adjust(with_rows(network, ~loose | (network.observation_station >= 9)))
    left_out = [w for w in found.warnings if w.startswith("left out")]
    assert any("seen from one place only" in w for w in left_out)
    assert all(any(name in w for w in left_out) for name in ("P8", "P19", "P30"))
    without = adjust(with_rows(network, ~loose))
    np.testing.assert_allclose(
        found.devices["camera"].interior.vector, without.devices["camera"].interior.vector, atol=1e-6
    )


def test_a_station_with_three_points_is_left_out_and_named(simulate):
    network = simulate(poses=7, use=("camera",)).network
    third = np.flatnonzero(network.observation_station == 3)
    keep = np.ones(len(network.observation_point), bool)
    keep[third[3:]] = False
    adjustment = adjust(with_rows(network, keep))
    assert "4/camera" not in adjustment.network.station_names
    assert any("4/camera" in w for w in adjustment.warnings)


def test_a_disconnected_network_is_refused_and_the_strangers_named(simulate):
    network = simulate(poses=8, use=("camera",)).network
    left = network.observation_point < len(network.point_names) // 2
    keep = np.where(network.observation_station < 4, left, ~left)
    with pytest.raises(AdjustmentError, match=r"station 5/camera.*disconnected"):
        adjust(with_rows(network, keep))


def test_an_end_of_the_distance_that_no_image_determines_is_named(simulate):
    network = simulate(poses=6, use=("camera",)).network
    keep = network.observation_point != network.scale.start
    with pytest.raises(AdjustmentError, match=f"point P{network.scale.start}: an end of the measured distance"):
        adjust(with_rows(network, keep))


def test_a_gross_error_is_reported_and_kept_unless_rejection_is_asked_for(simulate):
    network = simulate(poses=8).network
    uv = network.observation_uv.copy()
    uv[100] += [0.0, 1.5]
    spoilt = replace(network, observation_uv=uv)
    station, point = network.observation_station[100], network.observation_point[100]
    name = f"station {network.station_names[station]} point {network.point_names[point]}"
    reported = adjust(spoilt)
    assert len(reported.residuals) == len(uv)
    assert any("gross errors" in w and name in w for w in reported.warnings)
    rejecting = adjust(spoilt, options=AdjustOptions(reject_beyond=6.0))
    assert len(rejecting.residuals) == len(uv) - 1
    assert any(w.startswith("1 of") and "rejected" in w for w in rejecting.warnings)
    assert rejecting.sigma0 < 1.1 < reported.sigma0


def test_swapped_points_are_no_fault_of_the_geometry(simulate):
    """Plain least squares solves such a network; only its sigmas are large."""
    network = simulate(poses=10, rows=5, cols=8, use=("camera",)).network
    point = network.observation_point.copy()
    first, second = np.flatnonzero(network.observation_station == 3)[[0, 2]]
    point[[first, second]] = point[[second, first]]
    adjustment = adjust(replace(network, observation_point=point))
    assert adjustment.sigma0 > 50
    named = next(w for w in adjustment.warnings if "gross errors" in w)
    station = network.station_names[3]
    for swapped in (first, second):
        assert f"station {station} point {network.point_names[network.observation_point[swapped]]}" in named


def test_a_network_of_one_observation_is_refused_in_words(simulate):
    network = simulate(poses=10, rows=5, cols=8).network
    with pytest.raises(AdjustmentError, match="no point is seen by two rays"):
        adjust(with_rows(network, [0]))


def test_good_observations_raise_no_warning(simulate):
    assert adjust(simulate(seed=3, poses=12).network).warnings == ()


def test_mistaken_identities_are_rejected_where_they_are_few(simulate):
    network = simulate(poses=10, rows=6, cols=8, extent_mm=190.0).network
    point = network.observation_point.copy()
    swapped = np.flatnonzero(network.observation_station == 4)[[3, 4]]
    point[swapped] = point[swapped[::-1]]
    adjustment = adjust(replace(network, observation_point=point), options=AdjustOptions(reject_beyond=6.0))
    assert len(adjustment.residuals) == len(point) - 2
    assert adjustment.sigma0 == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda n: replace(n, observation_sigma=0 * n.observation_sigma),
            r"station 1/camera, point P\d+: has sigma \[0.0, 0.0\]",
        ),
        (lambda n: replace(n, observation_uv=n.observation_uv * np.nan), "neither u nor v"),
        (lambda n: replace(n, point_xyz_mm=n.point_xyz_mm * np.nan), "no approximate coordinates"),
        (lambda n: replace(n, observation_point=0 * n.observation_point), "observed twice"),
        (lambda n: with_rows(n, np.zeros(len(n.observation_point), bool)), "no observations"),
        (lambda n: replace(n, scale=replace(n.scale, stop=n.scale.start)), "two different points"),
        (
            lambda n: replace(n, devices={k: replace(d, estimate=("c", "K1")) for k, d in n.devices.items()}),
            "estimate names 'K1'",
        ),
    ],
)
def test_numbers_that_mean_nothing_are_refused(simulate, change, message):
    with pytest.raises(InputError, match=message):
        adjust(change(simulate(poses=4).network))


@pytest.mark.parametrize("seed", [1, 2])
def test_a_principal_point_that_is_hardly_known_is_given_with_its_sigma(simulate, seed):
    drawn = simulate(use=("camera",), poses=8, seed=seed, sigma_px={"camera": 4.0})
    adjustment = adjust(drawn.network)
    device = adjustment.devices["camera"]
    off = device.interior.vector - drawn.interior["camera"].vector
    assert np.abs(off / device.sigma).max() < 4.5
    assert any("weakly determined: camera." in warning for warning in adjustment.warnings)


@pytest.mark.parametrize(
    "change",
    [
        lambda n: replace(n, observation_uv=[1, -1] * n.observation_uv + [0, n.devices["camera"].spec.height - 1]),
        lambda n: replace(n, observation_uv=n.observation_uv[:, ::-1].copy()),
        lambda n: replace(n, point_xyz_mm=n.point_xyz_mm * [1, 1, -1]),
    ],
    ids=["v upwards", "u and v exchanged", "points left-handed"],
)
def test_mirrored_images_of_points_in_space_are_named(simulate, change):
    network = simulate(use=("camera",), depth_mm=80.0, approximation_mm=0.5).network
    with pytest.raises(AdjustmentError, match="camera: images fit the points only when they are mirrored"):
        adjust(change(network))


def test_a_flat_field_seen_in_images_that_are_mirrored_by_all_devices_is_told(simulate):
    """The images fit its back as well: nothing else tells that the second device stands on the wrong side."""
    network = simulate().network
    device = np.array(network.station_device)[network.observation_station]
    last = np.array([network.devices[name].spec.height - 1 for name in device])
    upwards = np.stack([network.observation_uv[:, 0], last - network.observation_uv[:, 1]], axis=1)
    right, mirrored = adjust(network), adjust(replace(network, observation_uv=upwards))
    assert mirrored.sigma0 == pytest.approx(right.sigma0, rel=1e-3)
    behind = [[w for w in found.warnings if "seen from behind" in str(w)] for found in (right, mirrored)]
    assert (len(behind[0]), len(behind[1])) == (0, 1)


def test_a_station_without_observations_is_told_once(simulate):
    network = simulate(use=("camera",), poses=6).network
    idle = replace(
        network,
        station_names=(*network.station_names, "idle"),
        station_device=(*network.station_device, "camera"),
        station_pose=(*network.station_pose, max(network.station_pose) + 1),
    )
    assert [w for w in adjust(idle).warnings if "idle" in w] == ["left out, no observations: station idle"]


@pytest.mark.parametrize(("ratio", "contradict"), [(2.0, False), (40.0, True)])
def test_images_that_contradict_each_other_are_told_from_weak_geometry(ratio: float, contradict: bool) -> None:
    told = str(settled(UndeterminedError("the network", "c cannot be estimated", "roll the camera"), ratio**2))
    words = (
        "its images contradict each other: residuals are 40 times what their sigmas allow, and c cannot be estimated"
    )
    assert (words in told, "roll the camera" in told) == (contradict, not contradict)


def test_an_adjustment_that_leaves_all_numbers_names_no_point(simulate):
    network = simulate(use=("camera",), poses=6, rows=5, cols=7).network
    problem = problem_of(network)
    state = initial_state(network, problem)
    nowhere = replace(state, xyz=np.nan * state.xyz)
    direction = np.ones(problem.globals + state.xyz.size)
    told = str(singular_error(network, problem, nowhere, SingularNormalsError(direction=direction)))
    assert told.startswith("the network: its images contradict each other")


def test_rejecting_does_not_use_up_the_redundancy(simulate):
    """Of six points whose places are rough, a robust start calls so many wrong that nothing is left over."""
    setup = {"use": ("camera",), "seed": 2, "rows": 2, "cols": 3, "approximation_mm": 15.0}
    truth = Interior(12.1, 0.0, 0.0, (0.0,) * 6, CAMERA.zero_radius_mm)
    made = simulate(**setup, poses=10, depth_mm=40.0, estimate=("c",), camera_truth=truth, scale=False)
    bar = NetworkScale(0, 5, float(np.linalg.norm(made.points_mm[0] - made.points_mm[5])), 0.05)
    found = adjust(replace(made.network, scale=bar))
    assert abs(found.devices["camera"].interior.c_mm - 12.1) < 5 * found.devices["camera"].sigma[0]
