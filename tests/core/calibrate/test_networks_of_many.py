"""Networks beyond one free camera: other lenses, devices held rigid, what is known before, several distances."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.calibrate import AdjustOptions, adjust, calibrate_photogrammetric
from core.calibrate.approximate.initial import initial_state
from core.calibrate.solution.equations import linearise
from core.calibrate.solution.problem import problem_of
from core.calibrate.solution.state import Step, moved
from core.errors import AdjustmentError, InputError
from core.figures import adjustment_figures
from core.geometry import (
    Pose,
    fitted,
    lens_of,
    matrix_from_axis_angle,
    matrix_from_rotation_vector,
    pair_of,
    project,
    rotation_vector_from_matrix,
)
from core.model import (
    DeviceSpec,
    Interior,
    Network,
    NetworkDevice,
    NetworkScale,
    Rig,
    ScaleBar,
    TargetSet,
    Testfield,
)
from core.project import read_network, write_network
from tests.core.calibrate.conftest import CAMERA, CAMERA_TRUTH, PROJECTOR, PROJECTOR_TRUTH, camera_poses

BROWN = Interior(12.1, -0.08, 0.11, (-0.09, 0.07, 8e-4, -6e-4, -0.03, 0.0, 0.0, 0.0, 0.003), 0.0, "brown")
BROWN_CAMERA = replace(CAMERA, interior=Interior(12.0, a=(0.0,) * 9, model="brown"))
ROWS, COLS = 7, 9


def through_opencv(interior: Interior, spec: DeviceSpec, points: np.ndarray, pose: Pose) -> np.ndarray:
    """Pixels of points by cv2.projectPoints: shares no code with the lens model."""
    c, x0, y0, *k, b1 = interior.vector
    fx, fy = c * (1 + b1) / spec.pitch_mm[0], c / spec.pitch_mm[1]
    cx, cy = (spec.width - 1) / 2 + x0 / spec.pitch_mm[0], (spec.height - 1) / 2 - y0 / spec.pitch_mm[1]
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    return cv2.projectPoints(pose.apply(points) * [1, -1, -1], np.zeros(3), np.zeros(3), K, np.array(k))[0][:, 0]


def free_network(see, spec, seed=0, poses=12, sigma_px=0.02, noise=1.0, estimate=None):  # type: ignore[no-untyped-def]
    """A board of 12 x 9 points before one device; `see` gives its pixels."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-130, 130, 12), np.linspace(-95, 95, 9))
    points = np.stack([x.ravel(), y.ravel(), rng.normal(scale=4, size=x.size)], axis=1)
    rows = []
    for s, pose in enumerate(camera_poses(poses, 600.0, 30.0, True, rng)):
        uv = see(points, pose)
        seen = np.flatnonzero(np.all((uv > 0) & (uv < [spec.width - 1, spec.height - 1]), axis=1))
        uv = uv[seen] + noise * rng.normal(scale=sigma_px, size=(len(seen), 2))
        rows.append((np.full(len(seen), s), seen, uv))
    station, point, uv = (np.concatenate(part) for part in zip(*rows, strict=True))
    length = float(np.linalg.norm(points[13] - points[-14]))
    network = Network(
        devices={"cam": NetworkDevice(spec, estimate)},
        station_names=tuple(str(s) for s in range(poses)),
        station_device=("cam",) * poses,
        station_pose=tuple(range(poses)),
        point_names=tuple(f"P{i}" for i in range(len(points))),
        point_xyz_mm=points + rng.normal(scale=1.0, size=points.shape),
        observation_station=station,
        observation_point=point,
        observation_uv=uv,
        observation_sigma=np.full(uv.shape, sigma_px),
        scale=NetworkScale(13, len(points) - 14, length, 0.001),
    )
    return network, points


def brown_network(**more):  # type: ignore[no-untyped-def]
    return free_network(lambda p, pose: through_opencv(BROWN, CAMERA, p, pose), BROWN_CAMERA, **more)


def test_a_bundle_finds_the_lens_that_opencv_projected_with() -> None:
    network, _ = brown_network(noise=0.0)
    result = adjust(network)
    found = result.devices["cam"].interior
    assert found.model == "brown"
    # without noise what remains is the end of the iterations: a millionth of the sigmas
    used = result.devices["cam"].sigma > 0
    assert used.tolist() == [True] * 8 + [False] * 3 + [True]
    assert np.abs((found.vector - BROWN.vector)[used] / result.devices["cam"].sigma[used]).max() < 0.02 or (
        np.abs(found.vector - BROWN.vector).max() < 1e-6
    )
    uv = np.array([[30.0, 20.0], [700.0, 540.0]])
    rays = np.array([[-0.2, 0.15, -1.0], [0.2, -0.15, -1.0]])
    assert np.abs(project(CAMERA, found, rays) - through_opencv(BROWN, CAMERA, rays, Pose())).max() < 1e-4, uv


def test_sigmas_of_the_brown_lens_hold() -> None:
    """Squared Mahalanobis distances of nine parameters over 12 seeds: mean 9, standard deviation sqrt(18 / 12)."""
    distances = []
    for seed in range(12):
        result = adjust(brown_network(seed=seed)[0])
        assert result.sigma0 == pytest.approx(1.0, abs=0.08)  # redundancy of some 2000: sigma 0.016
        used = [i for i, n in enumerate(result.parameter_names) if result.parameter_cov[i, i] > 0]
        error = (result.devices["cam"].interior.vector - BROWN.vector)[used]
        distances.append(float(error @ np.linalg.solve(result.parameter_cov[np.ix_(used, used)], error)))
    assert len(used) == 9
    assert np.mean(distances) == pytest.approx(9, abs=3 * np.sqrt(18 / 12))


def test_derivatives_through_another_lens_are_those_of_differences() -> None:
    network, _ = brown_network(poses=4)
    problem = problem_of(network)
    state = initial_state(network, problem)
    state = replace(state, interior=np.array([BROWN.vector]))
    J = linearise(problem, state).J
    G, P, n = problem.globals, problem.poses, problem.points
    for j, place in enumerate(problem.interior_columns[0]):
        if place < 0:
            continue
        h = 1e-6 * max(1.0, abs(BROWN.vector[j]))
        ends = []
        for sign in (1, -1):
            z = np.zeros(G)
            z[place] = sign * h
            ends.append(linearise(problem, moved(problem, state, Step(z, np.zeros((P, 6)), np.zeros((n, 3)), 0))).w)
        difference = -(ends[0] - ends[1]) / (2 * h)
        assert np.abs(difference - J[:, :, 15 + j]).max() < 1e-5 * np.abs(difference).max(), j


def test_rig_of_both_lens_models() -> None:
    """Camera after Brown, projector with A1..A6, rigid: the projector's parameters and the pose come out."""
    network, _, projector_from_camera = rigid_pair(BROWN_CAMERA, BROWN)
    result = adjust(network)
    assert result.sigma0 == pytest.approx(1.0, abs=0.08)
    projector = result.devices["projector"]
    assert np.abs((projector.interior.vector - PROJECTOR_TRUTH.vector) / projector.sigma).max() < 4.5
    off = result.relative["projector"].translation_mm - projector_from_camera.translation_mm
    sigma = np.sqrt(np.diagonal(result.parameter_cov)[-3:])
    assert np.abs(off / sigma).max() < 4.5


def rigid_pair(camera, interior, seed=3, known=None):  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(seed)
    relative = Pose(matrix_from_axis_angle([0.05, 1.0, 0.02], -0.42), np.array([-240.0, 15.0, -80.0]))
    x, y = np.meshgrid(np.linspace(-110, 110, 11), np.linspace(-90, 90, 9))
    points = np.stack([x.ravel(), y.ravel(), rng.normal(scale=3, size=x.size)], axis=1)
    specs = {"camera": (camera, interior), "projector": (PROJECTOR, PROJECTOR_TRUTH)}
    rows, owners, groups = [], [], []
    for k, pose in enumerate(camera_poses(10, 600.0, 28.0, True, rng)):
        for name, (spec, inner) in specs.items():
            uv = project(spec, inner, points, pose if name == "camera" else relative @ pose)
            seen = np.flatnonzero(np.all((uv > 0) & (uv < [spec.width - 1, spec.height - 1]), axis=1))
            uv = uv[seen] + rng.normal(scale=0.02, size=(len(seen), 2))
            rows.append((np.full(len(seen), len(owners)), seen, uv))
            owners.append(name)
            groups.append(k)
    station, point, uv = (np.concatenate(part) for part in zip(*rows, strict=True))
    network = Network(
        devices={name: NetworkDevice(spec) for name, (spec, _) in specs.items()},
        station_names=tuple(f"{k}/{n}" for k, n in zip(groups, owners, strict=True)),
        station_device=tuple(owners),
        station_pose=tuple(groups),
        point_names=tuple(f"P{i}" for i in range(len(points))),
        point_xyz_mm=points + rng.normal(scale=1.0, size=points.shape),
        observation_station=station,
        observation_point=point,
        observation_uv=uv,
        observation_sigma=np.full(uv.shape, 0.02),
        scale=NetworkScale(12, 86, float(np.linalg.norm(points[12] - points[86])), 0.001),
    )
    return network, points, relative


# ------------------------------------------------------------------------------------------------- what is known before


def with_points(network: Network, xyz: np.ndarray, sigma: np.ndarray | float) -> Network:
    sigmas = np.broadcast_to(np.asarray(sigma, float), xyz.shape).copy()
    return replace(network, point_xyz_mm=xyz, point_sigma_mm=sigmas, scale=None)


def a_camera(**more):  # type: ignore[no-untyped-def]
    return free_network(lambda p, pose: project(CAMERA, CAMERA_TRUTH, p, pose), CAMERA, **more)


def test_a_known_board_is_held() -> None:
    network, points = a_camera()
    result = adjust(with_points(network, points, 0.0))
    assert np.array_equal(result.points_mm, points)
    assert not result.point_cov_mm2.any()
    assert result.sigma0 == pytest.approx(1.0, abs=0.08)
    camera = result.devices["cam"]
    assert np.abs((camera.interior.vector - CAMERA_TRUTH.vector) / camera.sigma).max() < 4.5
    free = adjust(network)
    observed = 2 * len(network.observation_uv)
    assert result.redundancy == observed - 9 - 6 * 12
    assert np.all(camera.sigma < free.devices["cam"].sigma)  # more is known


@pytest.mark.parametrize("by_points", [False, True])
def test_weighted_points_are_what_a_dense_adjustment_makes_of_them(monkeypatch, by_points: bool) -> None:
    """The same normal equations written out, solved from the solution: no step is left."""
    if by_points:
        monkeypatch.setattr("core.calibrate.solution.problem.MOST_REDUCED", 0)
    rng = np.random.default_rng(8)
    network, points = a_camera(poses=8)
    sigma = np.full(points.shape, 0.05)
    sigma[5:60] = np.inf  # some are not known
    sigma[0, 2] = 0.0
    told = points + np.where(
        np.isfinite(sigma), rng.normal(size=points.shape) * np.where(np.isfinite(sigma), sigma, 0), 0
    )
    result = adjust(with_points(network, told, sigma))
    interior, poses, xyz = result.devices["cam"].interior, result.station_from_object, result.points_mm
    station, point = network.observation_station, network.observation_point

    def misclosure(shift: np.ndarray) -> np.ndarray:
        moved_ = xyz + shift
        seen = np.concatenate([project(CAMERA, interior, moved_[point[station == s]], poses[s]) for s in range(8)])
        order = np.concatenate([np.flatnonzero(station == s) for s in range(8)])
        return (network.observation_uv[order] - seen) / 0.02

    # stationary in the points: the images' pull balances the pull of what was known
    base = misclosure(np.zeros_like(xyz))
    free = np.isfinite(sigma) & (sigma > 0)
    for i in (3, 30, 70):
        for axis in range(3):
            shift = np.zeros_like(xyz)
            shift[i, axis] = 1e-3
            slope = (misclosure(shift) - misclosure(-shift)) / 2e-3
            pull = -float(np.sum(slope * base))
            known = (told[i, axis] - xyz[i, axis]) / sigma[i, axis] ** 2 if free[i, axis] else 0.0
            size = np.sqrt(np.sum(slope**2))
            assert abs(pull + known) < 1e-3 * size, (i, axis)  # in sigmas of that coordinate
    assert result.points_mm[0, 2] == told[0, 2]


def test_an_orientation_known_before_is_held_or_weighted() -> None:
    network, _ = a_camera(poses=8)
    truth = CAMERA_TRUTH
    held = replace(CAMERA, interior=truth, interior_sigma=(0.0,) * 9)
    result = adjust(replace(network, devices={"cam": NetworkDevice(held)}))
    assert result.devices["cam"].interior == truth
    assert not result.devices["cam"].sigma.any()
    assert result.sigma0 == pytest.approx(1.0, abs=0.08)

    free = adjust(network).devices["cam"]
    sigma = tuple((0.3 * free.sigma).tolist())  # better known than the images tell
    weighted = adjust(replace(network, devices={"cam": NetworkDevice(replace(held, interior_sigma=sigma))}))
    found = weighted.devices["cam"]
    assert np.all(found.sigma < 0.31 * free.sigma)
    assert weighted.redundancy == adjust(network).redundancy + 9
    off = adjust(replace(network, devices={"cam": NetworkDevice(replace(held, interior_sigma=(1e3,) * 9))}))
    # hardly known: as not known, but for sigma0, which nine good observations more have lowered
    np.testing.assert_allclose(off.devices["cam"].sigma / off.sigma0, free.sigma / adjust(network).sigma0, rtol=1e-3)


def test_frontal_images_end_in_a_result_or_the_reason() -> None:
    """Eight square images of a flat board: c cannot be told from the distance, and that is said; held, it works."""
    rng = np.random.default_rng(2)
    x, y = np.meshgrid(np.linspace(-130, 130, 12), np.linspace(-95, 95, 9))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    poses = [Pose(matrix_from_axis_angle([0, 0, 1], 0.4 * k), np.array([0.0, 0.0, -600.0])) for k in range(8)]
    rows = []
    for s, pose in enumerate(poses):
        uv = project(CAMERA, CAMERA_TRUTH, points, pose)
        seen = np.flatnonzero(np.all((uv > 0) & (uv < [747, 575]), axis=1))
        rows.append((np.full(len(seen), s), seen, uv[seen] + rng.normal(scale=0.02, size=(len(seen), 2))))
    station, point, uv = (np.concatenate(part) for part in zip(*rows, strict=True))
    network = Network(
        {"cam": NetworkDevice(CAMERA)},
        tuple("abcdefgh"),
        ("cam",) * 8,
        tuple(range(8)),
        tuple(f"P{i}" for i in range(len(points))),
        points,
        station,
        point,
        uv,
        np.full(uv.shape, 0.02),
    )
    with pytest.raises(AdjustmentError) as refusal:
        adjust(network)
    assert any(word in str(refusal.value) for word in ("cam.c", "cannot be determined", "convergent"))
    held = replace(CAMERA, interior=CAMERA_TRUTH, interior_sigma=(0.0,) * 9)
    result = adjust(replace(with_points(network, points, 0.0), devices={"cam": NetworkDevice(held)}))
    assert result.sigma0 == pytest.approx(1.0, abs=0.08)


def test_further_distances_take_part() -> None:
    network, points = a_camera(poses=8)
    second = NetworkScale(2, 100, float(np.linalg.norm(points[2] - points[100])), 0.001)
    both = adjust(replace(network, lengths=(second,)))
    assert both.redundancy == adjust(network).redundancy + 1
    ends = both.points_mm[[2, 100]]
    assert abs(np.linalg.norm(ends[0] - ends[1]) - second.length_mm) < 0.003  # three sigmas
    wrong = replace(second, length_mm=second.length_mm + 1.0)  # a thousand sigmas
    assert adjust(replace(network, lengths=(wrong,))).sigma0 > 3
    rejecting = adjust(replace(network, lengths=(wrong,)), options=AdjustOptions(reject_beyond=5.0))
    assert rejecting.sigma0 > 3  # all images of an end were rejected, one by one, and the end was called unseen


# ------------------------------------------------------------------------------------------------------------- on files


def test_a_rigid_network_there_and_back(tmp_path: Path) -> None:
    network, *_ = rigid_pair(CAMERA, CAMERA_TRUTH)
    known = np.full(network.point_xyz_mm.shape, np.inf)
    known[3] = [0.0, 0.1, np.inf]
    spec = replace(CAMERA, interior=CAMERA_TRUTH, interior_sigma=(0.1, *[np.inf] * 8))
    network = replace(network, point_sigma_mm=known, devices={**network.devices, "camera": NetworkDevice(spec)})
    write_network(tmp_path, network)
    assert '"version": 2' in (tmp_path / "network.json").read_text()
    again = read_network(tmp_path)
    assert again.station_pose == network.station_pose
    assert again.devices == network.devices
    np.testing.assert_array_equal(again.point_sigma_mm, known)


def test_poses_points_and_residuals_are_those_of_one_geometry() -> None:
    network, *_ = rigid_pair(CAMERA, CAMERA_TRUTH)
    adjusted = adjust(network)
    figures = json.loads(json.dumps(adjustment_figures(adjusted)))
    points = np.array([figures["points"][name]["xyz_mm"] for name in network.point_names])
    for k, (name, device) in enumerate(zip(network.station_names, network.station_device, strict=True)):
        mine = network.observation_station == k
        pose = Pose(np.array(figures["poses"][name]["rotation"]), np.array(figures["poses"][name]["translation_mm"]))
        spec, interior = network.devices[device].spec, adjusted.devices[device].interior
        there = project(spec, interior, points[network.observation_point[mine]], pose)
        np.testing.assert_allclose(network.observation_uv[mine] - there, adjusted.residuals[mine], atol=1e-6)


def test_stations_of_rigid_devices_belong_together_in_their_order(tmp_path: Path) -> None:
    network, _, relative = rigid_pair(CAMERA, CAMERA_TRUTH)
    write_network(tmp_path, network)
    path = tmp_path / "network.json"

    data = json.loads(path.read_text())
    assert data["devices"]["projector"]["rigid_with"] == "camera"
    for station in data["stations"].values():
        del station["pose"]
    path.write_text(json.dumps(data))
    assert read_network(tmp_path).station_pose == network.station_pose
    found = adjustment_figures(adjust(read_network(tmp_path)))["orientations"]
    assert {name: pose["from"] for name, pose in found.items()} == {"projector": "camera"}
    own = found["projector"]
    off = (
        np.array(own["translation_mm"]) - relative.translation_mm,
        rotation_vector_from_matrix(np.array(own["rotation"]) @ relative.rotation.T),
    )
    ratio = np.concatenate(off) / np.concatenate([own["translation_sigma_mm"], own["rotation_sigma_rad"]])
    assert 0.3 < np.sqrt(np.mean(ratio**2)) < 2
    data["stations"]["3/camera"]["device"] = "projector"
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match="11 stations of projector, 9 of camera"):
        read_network(tmp_path)
    data["devices"]["projector"]["rigid_with"] = "lamp"
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match="rigid_with is 'lamp'"):
        read_network(tmp_path)


# ------------------------------------------------------------------------------------------------- a rig of two cameras


def two_cameras(seed: int = 1):  # type: ignore[no-untyped-def]
    """Targets of a board before two cameras and a projector, and the truth."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-100, 100, COLS), np.linspace(-75, 75, ROWS))
    nominal = np.stack([x.ravel(), -y.ravel(), np.zeros(x.size)], axis=1)
    true = nominal + rng.normal(scale=0.1, size=nominal.shape)
    field = Testfield(
        np.repeat(np.arange(ROWS), COLS), np.tile(np.arange(COLS), ROWS), nominal, np.full(ROWS * COLS, 5.0)
    )
    right_from_left = Pose(matrix_from_axis_angle([0.0, 1.0, 0.05], -0.75), np.array([-430.0, 5.0, -150.0]))
    projector_from_left = Pose(matrix_from_axis_angle([0.05, 1.0, 0.02], -0.42), np.array([-240.0, 15.0, -80.0]))
    right = replace(CAMERA, nominal_c_mm=12.5)
    right_truth = replace(CAMERA_TRUTH, c_mm=12.6, x0_mm=0.05)
    cameras = {"left": (CAMERA, CAMERA_TRUTH, Pose()), "right": (right, right_truth, right_from_left)}
    sets = []
    for k, pose in enumerate(camera_poses(12, 600.0, 24.0, True, rng)):
        lines = project(PROJECTOR, PROJECTOR_TRUTH, true, projector_from_left @ pose)
        for name, (spec, interior, camera_from_left) in cameras.items():
            uv = project(spec, interior, true, camera_from_left @ pose)
            seen = np.flatnonzero(
                np.all((uv > 0) & (uv < [747, 575]), axis=1) & np.all((lines > 0) & (lines < 639), axis=1)
            )
            m = len(seen)
            sets.append(
                TargetSet(
                    f"field-{k:02d}",
                    field.row[seen],
                    field.col[seen],
                    uv[seen] + rng.normal(scale=0.02, size=(m, 2)),
                    np.tile(np.eye(2) * 0.02**2, (m, 1, 1)),
                    lines[seen] + rng.normal(scale=0.03, size=(m, 2)),
                    np.full((m, 2), 0.03),
                    np.zeros((m, 2)),
                    np.full(m, 9.0),
                    camera=name,
                    projector="lamp",
                )
            )
    rig = Rig({"left": CAMERA, "right": right}, {"lamp": PROJECTOR})
    length = float(np.linalg.norm(true[0] - true[-1]))
    bar = ScaleBar((0, 0), (ROWS - 1, COLS - 1), length, 0.002)
    return rig, field, sets, bar, (right_from_left, projector_from_left)


def test_two_cameras_and_a_projector_in_one_bundle() -> None:
    rig, field, sets, bar, (right_from_left, projector_from_left) = two_cameras()
    calibration, adjustment = calibrate_photogrammetric(rig, field, sets, scale=bar)
    assert calibration.cameras == ("left", "right")
    assert calibration.projectors == ("lamp",)
    assert {n: o.base for n, o in calibration.orientations.items()} == {"right": "left", "lamp": "left"}
    assert calibration.covariance.shape == (3 * 9 + 2 * 6,) * 2
    assert calibration.sigma0 == pytest.approx(1.0, abs=0.08)
    # one matrix: what any two devices share is in it, both cameras through the board too
    names = list(calibration.parameter_names)
    cross = calibration.covariance[names.index("left.c"), names.index("right.c")]
    assert cross != 0
    error = np.concatenate(
        [
            calibration.orientations["right"].device_from_base.translation_mm - right_from_left.translation_mm,
            calibration.orientations["lamp"].device_from_base.translation_mm - projector_from_left.translation_mm,
        ]
    )
    at = [names.index(f"{d}.t{axis}") for d in ("right", "lamp") for axis in "xyz"]
    distance = error @ np.linalg.solve(calibration.covariance[np.ix_(at, at)], error)
    assert distance < 22.5  # chi-square of 6, once in a thousand
    stations = {str(s) for s in adjustment.network.station_ids}
    assert "field-00/lamp by left" in stations
    assert "field-00/left" in stations


def test_the_pair_of_the_second_camera_has_its_own_covariance() -> None:
    """Against differences: the parameters of both are moved, the relative orientation of the pair follows."""
    rig, field, sets, bar, (right_from_left, projector_from_left) = two_cameras()
    calibration, _ = calibrate_photogrammetric(rig, field, sets, scale=bar)
    pair = pair_of(calibration, "right", "lamp")
    expected = projector_from_left @ right_from_left.inverse()
    assert np.abs(pair.projector_from_camera.translation_mm - expected.translation_mm).max() < 0.3
    assert pair.covariance.shape == (24, 24)
    names = list(calibration.parameter_names)
    rng = np.random.default_rng(0)
    draws = rng.multivariate_normal(np.zeros(len(names)), calibration.covariance, 4000, method="eigh")

    def turned(pose: Pose, change: np.ndarray) -> Pose:
        return Pose(matrix_from_rotation_vector(change[:3]) @ pose.rotation, pose.translation_mm + change[3:])

    at = {d: [names.index(f"{d}.{p}") for p in ("rx", "ry", "rz", "tx", "ty", "tz")] for d in ("right", "lamp")}
    poses = {d: calibration.orientations[d].device_from_base for d in at}
    found = []
    for draw in draws:
        both = turned(poses["lamp"], draw[at["lamp"]]) @ turned(poses["right"], draw[at["right"]]).inverse()
        turn = rotation_vector_from_matrix(both.rotation @ pair.projector_from_camera.rotation.T)
        found.append([*turn, *(both.translation_mm - pair.projector_from_camera.translation_mm)])
    ratio = np.std(found, axis=0) / np.sqrt(np.diagonal(pair.covariance)[-6:])
    assert np.abs(ratio - 1).max() < 0.05  # 4000 draws: 1.1 % each


def test_a_projector_that_no_camera_shares_is_named() -> None:
    rig, field, sets, bar, _ = two_cameras()
    apart = [
        replace(
            s, capture=f"{s.capture}-{s.camera}", projector_uv=s.projector_uv * (1 if s.camera == "left" else np.nan)
        )
        for s in sets
    ]
    with pytest.raises(AdjustmentError, match="to left and right at once"):
        calibrate_photogrammetric(rig, field, apart, scale=bar)


def test_one_lens_said_by_another_begins_the_adjustment() -> None:
    spec = replace(CAMERA, interior=fitted(CAMERA, CAMERA_TRUTH, "brown")[0])
    assert lens_of(spec).name == "brown"


def test_observations_in_mm_are_refused(simulate, tmp_path: Path) -> None:
    """They took minutes to adjust, into nothing."""
    network = simulate(seed=3).network
    write_network(tmp_path, network)
    read_network(tmp_path)
    write_network(tmp_path, replace(network, observation_uv=0.008 * network.observation_uv))
    with pytest.raises(InputError, match=r"observations.csv: u and v of device 'camera' .* not in mm"):
        read_network(tmp_path)
