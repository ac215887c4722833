"""Observations hundreds of pixels off are named, whether plain least squares solves the network or not."""

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from core.calibrate import AdjustOptions, adjust
from core.calibrate.approximate.resection import resect_despite_errors
from core.calibrate.selection import selected
from core.checks import adjustment_concerns
from core.errors import AdjustmentError
from core.geometry import Pose, matrix_from_axis_angle, project


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
@pytest.mark.parametrize(("size_px", "seed"), [(20.0, 1), (200.0, 2), (2000.0, 0)])
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


def test_a_refusal_names_the_observation_and_the_remedy(simulate, monkeypatch):
    # what fits without it is not tried mirrored, which takes seconds
    monkeypatch.delattr(import_module("core.calibrate.adjust"), "_fits")
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


REJECTING = AdjustOptions(variance_components=True, reject_beyond=6.0)


def left_out(network, adjustment):
    """Observations by station that the adjusted network no longer has, where it lacks any."""
    kept = adjustment.network
    left = dict(zip(kept.station_names, np.bincount(kept.observation_station), strict=True))
    of = dict(zip(network.station_names, np.bincount(network.observation_station), strict=True))
    return {name: n - left.get(name, 0) for name, n in of.items() if n > left.get(name, 0)}


@pytest.mark.parametrize(
    ("shift", "device"), [((2.0, 0.0), "camera"), ((0.0, 8.0), "projector"), ((0.2, 0.2), "camera")]
)
def test_a_capture_that_moved_is_left_out_as_a_whole_and_nothing_else_is(simulate, shift, device):
    """Nothing says which of two devices moved: both images of the capture go, in one adjustment more."""
    network = simulate(poses=12, seed=5).network
    station = network.station_names.index(f"5/{device}")
    rows = np.flatnonzero(network.observation_station == station)
    adjustment = adjust(spoilt(network, rows, [shift]), options=REJECTING)
    counts = dict(zip(network.station_names, np.bincount(network.observation_station), strict=True))
    assert left_out(network, adjustment) == {name: counts[name] for name in ("5/camera", "5/projector")}
    assert any(w.startswith("5/camera and 5/projector left out as a whole") for w in adjustment.warnings)
    expected = adjust(without_stations(network, ("5/camera", "5/projector")), options=REJECTING)
    assert np.allclose(adjustment.points_mm, expected.points_mm, atol=1e-5)


def without_stations(network, names):
    keep = ~np.isin(network.observation_station, [network.station_names.index(name) for name in names])
    return selected(network, keep)


def test_of_a_capture_only_the_image_that_is_wrong_is_left_out(simulate):
    """Points confused in the camera's image: no pose explains it, and the projector's fits the others."""
    network = simulate(poses=12, seed=6).network
    rows = np.flatnonzero(network.observation_station == network.station_names.index("4/camera"))
    uv = network.observation_uv.copy()
    rng = np.random.default_rng(1)
    uv[rows] += rng.uniform(-5, 5, (len(rows), 2))
    adjustment = adjust(replace(network, observation_uv=uv), options=REJECTING)
    assert left_out(network, adjustment) == {"4/camera": len(rows)}


def test_a_station_that_no_pose_explains_is_left_out_and_named(simulate):
    """Its points lie anywhere, as of frames in a wrong order."""
    network = simulate(poses=12, seed=4).network
    rows = np.flatnonzero(network.observation_station == network.station_names.index("7/projector"))
    uv = network.observation_uv.copy()
    uv[rows] = np.random.default_rng(3).uniform(0, 500, (len(rows), 2))
    wrong = replace(network, observation_uv=uv)
    with pytest.raises(AdjustmentError, match="station 7/projector: no pose explains its"):
        adjust(wrong, options=replace(REJECTING, reject_beyond=None))
    adjustment = adjust(wrong, options=REJECTING)
    assert left_out(network, adjustment) == {"7/projector": len(rows)}
    assert any(w.startswith("left out, no pose explains its") and "7/projector" in w for w in adjustment.warnings)
    expected = adjust(without_stations(network, ("7/projector",)), options=REJECTING)
    assert np.allclose(adjustment.points_mm, expected.points_mm, atol=1e-5)


def test_of_two_stations_the_one_that_no_pose_explains_is_named(simulate):
    """Not what would be missing without it: without any other, no point is seen by two rays."""
    network = simulate(poses=2, use=("camera",), seed=4).network
    uv, name = network.observation_uv.copy(), network.station_names[-1]
    rows = np.flatnonzero(network.observation_station == len(network.station_names) - 1)
    uv[rows] = np.random.default_rng(3).uniform(0, 500, (len(rows), 2))
    with pytest.raises(AdjustmentError, match=f"station {name}: no pose explains its"):
        adjust(replace(network, observation_uv=uv), options=REJECTING)


@pytest.mark.parametrize("size_px", [0.5, 200.0])
def test_several_single_errors_in_one_image_do_not_take_the_image_with_them(simulate, size_px):
    network = simulate(poses=9, seed=3).network
    rng = np.random.default_rng(8)
    rows = rng.choice(np.flatnonzero(network.observation_station == 6), 12, replace=False)
    angle = rng.uniform(0, 2 * np.pi, len(rows))
    bad = spoilt(network, rows, size_px * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    adjustment = adjust(bad, options=REJECTING)
    assert left_out(network, adjustment)[network.station_names[6]] == len(rows)
    assert not any("as a whole" in w for w in adjustment.warnings)


def test_a_rig_that_moved_half_way_is_not_taken_apart(simulate):
    """Half of the captures against the other half: no gross errors, and the test of rigidity says what it is."""
    network = simulate(poses=12, seed=2).network
    late = np.array([s.endswith("projector") and int(s.split("/")[0]) > 6 for s in network.station_names])
    rows = np.flatnonzero(late[network.observation_station])
    adjustment = adjust(spoilt(network, rows, [(0.0, 3.0)]), options=REJECTING)
    assert not any("as a whole" in w for w in adjustment.warnings)
    assert len(adjustment.residuals) > 0.9 * len(network.observation_uv)


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


def test_large_residuals_that_no_parameter_explains_do_not_keep_it_from_converging(simulate, monkeypatch):
    """An affinity of 1.4 % held at zero, rolled images: whole steps overshoot; 500 of those end where a few do."""
    network = simulate(seed=3, poses=8).network
    names = tuple(p for p in ("c", "x0", "y0", "A1", "A2", "A4", "A5", "A6"))
    devices = {**network.devices, "camera": replace(network.devices["camera"], estimate=names)}
    held = replace(network, devices=devices)
    quick = adjust(held, options=AdjustOptions(max_iterations=60))
    monkeypatch.setattr("core.calibrate.solution.iterate.SLOW", 2.0)
    slow = adjust(held, options=AdjustOptions(max_iterations=500))
    assert quick.iterations < 40 < slow.iterations
    # both within 1e-5 sigma of the same solution, as the tolerance says
    sigma = np.sqrt(np.diagonal(quick.point_cov_mm2, axis1=1, axis2=2))
    assert np.max(np.abs(quick.points_mm - slow.points_mm) / sigma) < 1e-3
    assert quick.sigma0 == pytest.approx(slow.sigma0, rel=1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_an_image_whose_sigmas_hold_is_not_accused_where_those_of_others_are_too_large(simulate, seed):
    network = simulate(seed=seed, poses=10).network
    good = np.isin(network.observation_station, [3, 4])
    sigma = network.observation_sigma * np.where(good, 1.0, 2.0)[:, None]
    found = adjust(replace(network, observation_sigma=sigma), options=AdjustOptions(variance_components=True))
    assert not [w for w in found.warnings if "gross errors" in w]


@pytest.mark.parametrize("seed", range(2))
def test_an_image_whose_sigmas_are_too_small_is_no_wrong_one(simulate, seed):
    """Twice as noisy as the others, and said to be four times better."""
    network = simulate(poses=12, seed=seed).network
    rows = np.flatnonzero(network.observation_station == network.station_names.index("6/projector"))
    sigma, rng = network.observation_sigma.copy(), np.random.default_rng(seed)
    noisy = spoilt(network, rows, rng.normal(0, np.sqrt(3), (len(rows), 2)) * sigma[rows])
    sigma[rows] /= 4
    adjustment = adjust(replace(noisy, observation_sigma=sigma), options=REJECTING)
    assert not any("as a whole" in w for w in adjustment.warnings)
    assert sum(left_out(network, adjustment).values()) < 0.1 * len(rows)


def test_a_point_whose_rays_meet_behind_a_camera_is_left_out_and_told(simulate):
    """Station 9, 300 mm further back than 1, sees it where it would be 5 mm behind that: between the two."""
    size = {"use": ("camera",), "rows": 10, "cols": 12, "scale": False, "sigma_px": {"camera": 0.5}, "noise": 0.2}
    views = list(simulate(poses=8, **size).stations)
    views.append(replace(views[0], translation_mm=views[0].translation_mm + np.array([20.0, 10.0, -300.0])))
    simulated = simulate(poses=9, camera_poses_given=views, **size)
    network, spec = simulated.network, simulated.network.devices["camera"].spec
    seen = simulated.points_mm[[65]] @ views[0].rotation.T + views[0].translation_mm
    behind = seen * 5.0 / seen[:, 2:] + [20.0, 10.0, -300.0]
    uv, own = network.observation_uv.copy(), network.observation_point == 65
    uv[own & (network.observation_station == 8)] = project(spec, simulated.interior["camera"], behind, Pose())
    keep = ~own | np.isin(network.observation_station, [0, 8])
    adjustment = adjust(selected(replace(network, observation_uv=uv), keep))
    expected = adjust(selected(network, ~own))
    assert "left out, rays meet behind a device, not before it: point P65" in adjustment.warnings
    assert adjustment.sigma0 == pytest.approx(expected.sigma0, rel=1e-6)
    assert adjustment_concerns(adjustment)[0].state == "doubtful"
