"""One relative orientation for all poses, and whether that was true."""

from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import least_squares

from core.calibrate import (
    AdjustOptions,
    adjust,
    calibrate_photogrammetric,
    leave_captures_out,
    network_from_targets,
    next_poses,
)
from core.calibrate.adjust import solve_network
from core.calibrate.diagnosis.next_pose import NextPose
from core.calibrate.diagnosis.rigid import rigidity_of
from core.calibrate.solution.datum import datum_columns
from core.errors import AdjustmentError, InputError
from core.geometry import Pose, matrix_from_rotation_vector, project, rotation_vector_from_matrix
from core.measure import View, eccentricity, unmeasured
from core.measure.centres.circles import tangents
from core.model import Interior, Rig, ScaleBar, TargetSet, Testfield
from core.pipeline.judge import judge_adjustment
from core.pipeline.methods import METHODS
from core.pipeline.options import CalibrateOptions
from core.pipeline.volumes import left_out_verdict
from core.progress import SILENT

ROWS, COLS = 6, 8


def rigidity_test(network):
    solved, _ = solve_network(network, AdjustOptions(), SILENT)
    return rigidity_of(solved, solved.network.station_pose)


@pytest.fixture
def loose(simulate):
    """Give the function that lets the projector move between poses by a shift in mm."""

    def build(shift_mm, seed=0):
        simulated = simulate(seed=seed, poses=10)
        network, rng = simulated.network, np.random.default_rng(seed)
        uv = network.observation_uv.copy()
        for s, name in enumerate(network.station_device):
            if name == "projector":
                moved = Pose(np.eye(3), rng.normal(scale=shift_mm, size=3)) @ simulated.stations[s]
                rows = network.observation_station == s
                points = simulated.points_mm[network.observation_point[rows]]
                spec, interior = network.devices[name].spec, simulated.interior[name]
                noise = uv[rows] - project(spec, interior, points, simulated.stations[s])
                uv[rows] = project(spec, interior, points, moved) + noise
        return replace(network, observation_uv=uv)

    return build


def test_a_loose_rig_is_recognised_and_its_looseness_measured(loose):
    result = rigidity_test(loose(0.5))
    assert not result.rigid
    assert result.statistic > 3 * result.critical
    assert "was not rigid" in str(result)
    # three components of 0.5 mm each, ten samples
    assert 0.5 < result.shift_rms_mm < 1.4


def test_a_network_of_others_is_told_when_what_it_holds_rigid_was_loose(loose):
    """Residuals were 1.3 times their sigmas, which may be off by a half: "nothing systematic"."""
    passed, doubtful = (judge_adjustment(adjust(loose(shift_mm))).verdict for shift_mm in (0.0, 0.03))
    assert passed.state == "passed"
    assert doubtful.state == "doubtful"
    assert doubtful.because[0].startswith("the rig was not rigid")
    assert 'leave "rigid_with" out' in doubtful.because[0]


def test_a_lens_model_without_a_shear_is_named_beside_the_looseness_it_looks_like(simulate):
    """The reference rig's devices have one; under `brown` a rig at rest was told to be mounted firmly, no more."""
    network = simulate(seed=0, poses=10).network
    brown = {
        name: replace(d, spec=replace(d.spec, interior=Interior(d.spec.nominal_c_mm, a=(0.0,) * 9, model="brown")))
        for name, d in network.devices.items()
    }
    told = adjust(replace(network, devices=brown)).warnings
    assert any(str(text).startswith("the rig was not rigid") for text in told)
    assert "camera, projector: what a lens model lacks can look like a loose rig, too: try A1..A6" in told
    assert not any("loose rig" in str(text) for text in adjust(network).warnings)


def test_what_is_significant_and_smaller_than_the_targets_own_errors_is_no_looseness(loose):
    large, small = rigidity_test(loose(0.5)), rigidity_test(loose(0.007))
    assert small.statistic > small.critical
    assert small.rigid
    # the same motion on a scale of 1:71. The small one's F of about 3 has 54 degrees of freedom and so a standard
    # deviation of sqrt(2 + 4 · 2) / sqrt(54) = 0.43: a fifth of its excess over 1, a tenth of the drift
    assert large.drift_sigmas / small.drift_sigmas == pytest.approx(0.5 / 0.007, rel=0.3)


def test_rigid_rigs_pass_and_their_statistic_is_f_distributed(loose):
    found = [rigidity_test(loose(0.0, seed)) for seed in range(30)]
    assert all(result.rigid for result in found[:8])  # the critical value is exceeded by one in a thousand
    values = [result.statistic for result in found]
    # F with 54 degrees of freedom has mean 1 and standard deviation 0.19; the mean of 30 is good to 0.035
    assert np.mean(values) == pytest.approx(1.0, abs=0.12)


def test_a_single_camera_has_no_rig_to_test(simulate):
    with pytest.raises(InputError, match="no two devices"):
        rigidity_test(simulate(use=("camera",)).network)


def target_sets(simulated):
    """The observations of a simulated network as the measuring stage would return them."""
    network = simulated.network
    field = Testfield(
        np.arange(ROWS * COLS) // COLS, np.arange(ROWS * COLS) % COLS, network.point_xyz_mm, np.full(ROWS * COLS, 5.0)
    )
    sets = []
    for k in sorted(set(network.station_pose)):
        uv = {name: np.full((ROWS * COLS, 2), np.nan) for name in ("camera", "projector")}
        for s, name in enumerate(network.station_device):
            if network.station_pose[s] == k:
                rows = network.observation_station == s
                uv[name][network.observation_point[rows]] = network.observation_uv[rows]
        at = np.flatnonzero(np.isfinite(uv["camera"][:, 0]))
        sets.append(
            TargetSet(
                capture=f"testfield-{k + 1:02d}",
                row=field.row[at],
                col=field.col[at],
                camera_uv=uv["camera"][at],
                camera_cov=np.tile(np.eye(2) * 0.02**2, (len(at), 1, 1)),
                projector_uv=uv["projector"][at],
                projector_sigma=np.full((len(at), 2), 0.03),
                eccentricity_px=np.zeros((len(at), 2)),
                diameter_px=np.full(len(at), 9.0),
            )
        )
    bar = network.scale
    ends = [(int(field.row[i]), int(field.col[i])) for i in (bar.start, bar.stop)]
    return field, sets, ScaleBar(*ends, bar.length_mm, bar.sigma_mm)


@pytest.fixture
def measured(simulate):
    simulated = simulate(poses=10, rows=ROWS, cols=COLS)
    specs = {name: simulated.network.devices[name].spec for name in ("camera", "projector")}
    rig = Rig({"camera": specs["camera"]}, {"projector": specs["projector"]})
    return simulated, rig, *target_sets(simulated)


def test_network_of_targets_holds_every_measured_coordinate(measured):
    simulated, rig, field, sets, bar = measured
    network = network_from_targets(rig, field, sets, scale=bar)
    expected = simulated.network.observation_uv
    in_camera = {(s.capture, int(r), int(c)) for s in sets for r, c in zip(s.row, s.col, strict=True)}
    assert len(network.observation_uv) <= len(expected)
    assert np.count_nonzero(np.array(network.station_device) == "camera") == 10
    camera = np.array([d == "camera" for d in network.station_device])[network.observation_station]
    assert np.count_nonzero(camera) == len(in_camera)
    assert network.point_names[network.scale.start] == f"{bar.start[0]}/{bar.start[1]}"
    free = network_from_targets(rig, field, sets, scale=bar, rigid=False)
    assert len(set(free.station_pose)) == len(free.station_names) == 20


def test_targets_of_which_none_is_measured_are_refused_with_the_reason(measured):
    _, rig, field, *_ = measured
    for why, seen in (("no light", "hold no measured target: no light"), (None, "hold no measured target;")):
        sets = [unmeasured(field, "one", why)] if why else []
        with pytest.raises(InputError, match=seen):
            network_from_targets(rig, field, sets, scale=None)


@pytest.mark.parametrize("rigid", [True, False])
def test_calibration_finds_both_devices_and_their_relative_orientation(measured, rigid):
    simulated, rig, field, sets, bar = measured
    calibration, adjustment = calibrate_photogrammetric(rig, field, sets, scale=bar, rigid=rigid)
    found, true = calibration.projector_from_camera, simulated.projector_from_camera
    error = np.concatenate(
        [
            calibration.camera.interior.vector - simulated.interior["camera"].vector,
            calibration.projector.interior.vector - simulated.interior["projector"].vector,
            rotation_vector_from_matrix(found.rotation @ true.rotation.T),
            found.translation_mm - true.translation_mm,
        ]
    )
    sigma = np.sqrt(np.diagonal(calibration.covariance))
    # 24 normalised errors: the greatest exceeds 4 once in 600 experiments
    assert np.abs(error / sigma).max() < 4
    # all 24 together, correlations included: chi-square with 24 degrees of freedom, 60 once in 15 000
    assert error @ np.linalg.solve(calibration.covariance, error) < 60
    assert calibration.warnings == ()
    assert (calibration.stations, calibration.image_points) == (20, len(adjustment.residuals))


def test_free_stations_give_the_relative_orientation_of_the_rigid_rig_and_no_smaller_sigma(measured):
    _, rig, field, sets, bar = measured
    rigid, _ = calibrate_photogrammetric(rig, field, sets, scale=bar)
    free, _ = calibrate_photogrammetric(rig, field, sets, scale=bar, rigid=False)
    ratio = np.sqrt(np.diagonal(free.covariance) / np.diagonal(rigid.covariance))
    assert np.all(ratio > 0.97)  # the variance factors of the two differ by a few per cent
    # of ten poses; without one common roll and scale the projector's A4 and A3 lose most
    assert np.all(ratio < 4)
    assert np.all(ratio[-6:] < 1.6)


def test_dots_that_two_projectors_light_are_recentred_by_the_adjusted_camera(measured):
    """Middles of ellipses, up to 0.17 px off, put c 9 sigmas off."""
    simulated, rig, field, sets, bar = measured
    projectors = ("projector", "second")
    network, field = simulated.network, replace(field, diameter_mm=np.full(ROWS * COLS, 40.0))
    seen = []
    for k, t in enumerate(sets):
        station = network.station_device.index("camera", network.station_pose.index(k))
        view = View(rig.cameras["camera"], simulated.stations[station])
        at = [field.index()[key] for key in zip(t.row.tolist(), t.col.tolist(), strict=True)]
        shift = eccentricity(
            view,
            simulated.points_mm[at],
            field.diameter_mm[at] / 2,
            simulated.interior["camera"],
            tangents(field.xyz_mm)[at],
        )
        seen += [replace(t, camera_uv=t.camera_uv + shift, projector=name) for name in projectors]
    rig = replace(rig, projectors=dict.fromkeys(projectors, rig.projectors["projector"]))
    project = SimpleNamespace(rig=rig, scale=bar, lengths=())
    captures = [SimpleNamespace(name=t.capture, testfield=field, seeds=(0,), path=Path(t.capture)) for t in sets]
    found = (
        METHODS["photogrammetric"].calibrate(project, captures, CalibrateOptions(), SILENT, lambda: seen).calibration
    )
    camera = found.devices["camera"]
    error = camera.interior.vector - simulated.interior["camera"].vector
    assert np.abs(error / camera.sigma).max() < 4 * 2**0.5  # what two projectors are told is the same


def test_what_is_adjusted_anew_shows_its_course_from_the_first_initial_values(measured):
    _, rig, field, sets, bar = measured
    _, once = calibrate_photogrammetric(rig, field, sets, scale=bar)
    moved = [replace(t, camera_uv=t.camera_uv + 0.01) for t in sets]
    _, cold = calibrate_photogrammetric(rig, field, moved, scale=bar)
    _, again = calibrate_photogrammetric(rig, field, sets, scale=bar, recentred=lambda _: moved)
    assert again.convergence[: len(once.convergence)] == once.convergence
    assert again.convergence[-1] == pytest.approx(cold.convergence[-1])
    assert again.iterations == len(again.convergence) - 1 < once.iterations + cold.iterations
    np.testing.assert_allclose(again.points_mm, cold.points_mm, atol=1e-7)


def test_a_loose_rig_is_said_in_the_calibration(loose, simulate, measured):
    simulated, rig, *_ = measured
    field, sets, bar = target_sets(replace(simulated, network=loose(0.5)))
    calibration, _ = calibrate_photogrammetric(rig, field, sets, scale=bar)
    assert any("not rigid" in w for w in calibration.warnings)


def test_captures_without_projector_coordinates_are_refused(measured):
    _, rig, field, sets, bar = measured
    blind = [replace(s, projector_uv=s.projector_uv * np.nan) for s in sets]
    with pytest.raises(AdjustmentError, match="camera and projector at once"):
        calibrate_photogrammetric(rig, field, blind, scale=bar)


def test_a_rig_that_cannot_be_tested_is_calibrated_and_that_is_said(measured):
    """Two columns and rows of one capture's projector do not orient it without the rig."""
    _, rig, field, sets, bar = measured
    few = sets[3].projector_uv.copy()
    few[2:] = np.nan
    sets[3] = replace(sets[3], projector_uv=few)
    calibration, _ = calibrate_photogrammetric(rig, field, sets, scale=bar)
    (told,) = (w for w in calibration.warnings if "rigid" in w)
    assert told.startswith("whether the rig was rigid cannot be tested: station testfield-04/projector: its orient")


def test_one_device_alone_can_be_adjusted_from_targets(measured):
    simulated, rig, field, sets, bar = measured
    for name in ("camera", "projector"):
        network = network_from_targets(rig, field, sets, scale=bar, use=(name,))
        device = adjust(network).devices[name]
        error = (device.interior.vector - simulated.interior[name].vector) / device.sigma
        assert np.abs(error).max() < 4


def test_bad_targets_are_refused_by_name(measured):
    _, rig, field, sets, bar = measured
    twice = replace(sets[0], row=np.full_like(sets[0].row, 1), col=np.full_like(sets[0].col, 1))
    with pytest.raises(InputError, match=r"testfield-01.*\(1, 1\) twice"):
        network_from_targets(rig, field, [twice], scale=bar)
    strange = replace(sets[0], row=sets[0].row + 90)
    with pytest.raises(InputError, match=r"testfield-01.*has target"):
        network_from_targets(rig, field, [strange], scale=bar)
    with pytest.raises(InputError, match=r"scale.*\(99, 0\)"):
        network_from_targets(rig, field, sets, scale=replace(bar, start=(99, 0)))


def test_relative_orientation_of_a_rig_scales_with_a_free_network(simulate):
    """Without measured distance the base follows the approximate points, and its sigma says so."""
    simulated = simulate(scale=False)
    wide = replace(simulated.network, point_xyz_mm=2 * simulated.network.point_xyz_mm)
    single, double = adjust(simulated.network), adjust(wide)
    for a, b in ((single.relative["projector"], double.relative["projector"]),):
        np.testing.assert_allclose(b.translation_mm, 2 * a.translation_mm, rtol=1e-6)
        np.testing.assert_allclose(
            matrix_from_rotation_vector(rotation_vector_from_matrix(a.rotation)), b.rotation, atol=1e-7
        )
    np.testing.assert_allclose(
        np.sqrt(np.diagonal(double.parameter_cov)[-3:]), 2 * np.sqrt(np.diagonal(single.parameter_cov)[-3:]), rtol=1e-4
    )


def test_a_projector_that_codes_columns_only_is_calibrated_without_what_columns_cannot_tell(simulate):
    simulated = simulate(poses=12)
    network = simulated.network
    uv = network.observation_uv.copy()
    projector = np.array([d == "projector" for d in network.station_device])[network.observation_station]
    uv[projector, 1] = np.nan
    adjustment = adjust(replace(network, observation_uv=uv))
    assert any("v was never observed: y0, A3, A4, A5" in w for w in adjustment.warnings)
    device, truth = adjustment.devices["projector"], simulated.interior["projector"]
    assert device.interior.y0_mm == 0
    assert device.sigma[2] == 0
    # what tells x y A5 from a tilt is its square: without it the others have the sigmas of parameters that are seen
    assert np.abs((device.interior.vector - truth.vector)[[3, 4, 8]] / device.sigma[[3, 4, 8]]).max() < 4
    assert adjustment.iterations < 20  # a place known to 13 mm is not linear; where A5 was free there were 60
    # the projection centre's height is told by the distortion, to 5 to 15 mm, and reaches the rest through it only
    assert abs(device.interior.c_mm - truth.c_mm) < 5 * device.sigma[0]
    found = adjustment.relative["projector"].translation_mm
    sigma = np.sqrt(adjustment.parameter_cov.diagonal())[adjustment.parameter_names.index("projector.ty")]
    assert abs(found[1] - simulated.projector_from_camera.translation_mm[1]) < 4 * sigma < 4 * 30
    np.testing.assert_allclose(found[[0, 2]], simulated.projector_from_camera.translation_mm[[0, 2]], atol=0.5)
    camera = adjustment.devices["camera"]
    assert np.abs((camera.interior.vector - simulated.interior["camera"].vector) / camera.sigma).max() < 4


def numerical_design(adjustment, bar):
    """Derivatives of all observations by interior and relative orientations, poses and points, from differences."""
    network, poses = adjustment.network, sorted(set(adjustment.network.station_pose))
    first = [network.station_pose.index(k) for k in poses]
    start = [d.interior.vector for d in adjustment.devices.values()]
    sizes = np.cumsum([0, 9, 9, 6, 6 * len(poses), adjustment.points_mm.size])

    def moved(pose, change):
        return Pose(matrix_from_rotation_vector(change[:3]) @ pose.rotation, pose.translation_mm + change[3:])

    def predicted(change):
        camera, projector, relative, places, xyz = np.split(change, sizes[1:-1])
        points = adjustment.points_mm + xyz.reshape(-1, 3)
        uv = np.zeros((len(network.observation_uv), 2))
        for s, name in enumerate(network.station_device):
            k = poses.index(network.station_pose[s])
            stand = moved(adjustment.station_from_object[first[k]], places[6 * k : 6 * k + 6])
            if name == "projector":
                stand = moved(adjustment.relative["projector"], relative) @ stand
            own = network.observation_station == s
            device = adjustment.devices[name]
            vector = start[name == "projector"] + (projector if name == "projector" else camera)
            interior = Interior.from_vector(vector, device.interior.r0_mm)
            uv[own] = project(device.spec, interior, points[network.observation_point[own]], stand)
        length = np.linalg.norm(points[network.scale.start] - points[network.scale.stop])
        return np.append(uv.ravel(), length)

    steps = np.concatenate([[1e-4, 1e-4, 1e-4, 1e-7, 1e-9, 1e-7, 1e-7, 1e-7, 1e-7] * 2, np.full(sizes[-1] - 18, 1e-5)])
    columns = [(predicted(h) - predicted(-h)) / (2 * h.sum()) for h in np.diag(steps)]
    return np.array(columns).T / np.append(network.observation_sigma.ravel(), bar.sigma_mm)[:, None]


def in_rows(t):
    """Covariances (n, n, 4, 4) of two targets in one row that is shifted by 1: what is seen of both moves alike."""
    (image, u, v), along = t.row_shifts, t.gradient[:, :, 0]
    moves = [(1.0, 0.0, a, b) for a, b in along], [(0.0, 0.0, a, 0.0) for a, _ in along]
    moves = [np.array(m) for m in (*moves, [(0.0, 0.0, 0.0, b) for _, b in along])]
    pairs = [(moves[i], row[j] * moves[j]) for i, row in enumerate((image, u, v)) for j in range(3)]
    return sum(np.einsum("ia,jb->ijab", one, other) for one, other in pairs)


@pytest.mark.parametrize("by_points", [False, True])
def test_errors_that_targets_share_are_in_the_covariance(measured, monkeypatch, by_points):
    _, rig, field, sets, bar = measured
    if by_points:
        monkeypatch.setattr("core.calibrate.solution.problem.MOST_REDUCED", 0)
    for k in (1, 4):
        gradient = np.tile([[0.9, 0.1], [-0.1, 1.1]], (len(sets[k].row), 1, 1))
        shifts = np.array([[16, -6, 0], [-6, 9, 2], [0, 2, 4]]) * 1e-4
        rows = replace(sets[k], gradient=gradient, row_shifts=shifts, height_px=np.full(len(gradient), 30.0))
        cov, own = rows.camera_cov + np.array([[0.0, 1e-4], [1e-4, 0.0]]), np.diagonal(rows.row_share)
        by_centre = gradient @ cov @ gradient.transpose(0, 2, 1)
        cov[:, 0, 0] += own * shifts[0, 0]
        by_row = own[:, None, None] * np.einsum("iiab->iab", in_rows(rows))
        sigma = np.sqrt(0.02**2 + np.diagonal(by_centre + by_row[:, 2:, 2:], axis1=1, axis2=2))
        sets[k] = replace(rows, camera_cov=cov, projector_sigma=sigma)
    options = AdjustOptions(variance_components=False)
    calibration, adjustment = calibrate_photogrammetric(rig, field, sets, scale=bar, options=options)
    network, A = adjustment.network, numerical_design(adjustment, bar)
    S = np.eye(len(A))
    place = {
        (network.station_names[s], network.point_names[p]): o
        for o, (s, p) in enumerate(zip(network.observation_station, network.observation_point, strict=True))
    }
    for k in (1, 4):
        t, rows, shared = sets[k], sets[k].row_share, in_rows(sets[k])
        key = [f"{r}/{c}" for r, c in zip(t.row, t.col, strict=True)]
        at = [[place.get((f"{t.capture}/{name}", p)) for name in ("camera", "projector")] for p in key]
        for i, one in enumerate(at):
            for j, other in enumerate(at):
                block = t.cov[i] if i == j else rows[i, j] * shared[i, j]
                for a, b in np.ndindex(2, 2):
                    if one[a] is not None and other[b] is not None:
                        part = block[2 * a : 2 * a + 2, 2 * b : 2 * b + 2]
                        unit = np.outer(network.observation_sigma[one[a]], network.observation_sigma[other[b]])
                        S[2 * one[a] : 2 * one[a] + 2, 2 * other[b] : 2 * other[b] + 2] = part / unit
    inverse = np.linalg.pinv(A, rcond=1e-11)
    rest = np.eye(len(A)) - A @ inverse
    left = np.trace(rest @ S @ rest.T) / adjustment.redundancy  # of vᵀPv, which the unknowns follow more than usual
    assert left < 0.995
    back = inverse[:18]  # interior orientations do not depend on the datum
    true, plain = back @ S @ back.T / left, back @ back.T
    unit = np.sqrt(np.diagonal(true))
    found = calibration.covariance[:18, :18] / adjustment.sigma0**2
    assert np.abs((found - true) / np.outer(unit, unit)).max() < 1e-4
    assert np.abs((plain - true) / np.outer(unit, unit)).max() > 0.05  # what is shared counts
    points = adjustment.points_mm
    D = datum_columns(points - points.mean(axis=0), np.eye(7)[:, :6])
    of_points = inverse[-points.size :]
    free = of_points - D @ np.linalg.lstsq(D, of_points, rcond=None)[0]  # inner constraints: no part of a movement
    true, plain = free @ S @ free.T / left, free @ free.T
    for i, found in enumerate(adjustment.point_cov_mm2 / adjustment.sigma0**2):
        own = slice(3 * i, 3 * i + 3)
        # what the datum makes points share is left out where they are eliminated
        assert np.abs(found - true[own, own]).max() < (0.02 if by_points else 1e-3) * np.abs(true[own, own]).max()
    assert np.trace(true) > 1.02 * np.trace(plain)
    asked, again = calibrate_photogrammetric(
        rig, field, sets, scale=bar, options=AdjustOptions(variance_components=True)
    )
    squares = np.nansum((again.residuals / network.observation_sigma) ** 2)
    by_redundancy = sum(
        factor
        * np.nansum(again.redundancy_numbers[[network.station_device[s] == name for s in network.observation_station]])
        for name, factor in again.variance_factors.items()
    )
    assert by_redundancy == pytest.approx(squares / left, rel=2e-3)
    assert asked.sigma0 == pytest.approx(1.0, abs=1e-3)


def test_covariances_stay_positive_where_what_is_shared_was_given_too_large(measured):
    """Sigmas of the camera twice too large, u and v said to err nearly alike: residuals show that they do not."""
    _, rig, field, sets, bar = measured
    alike = 4 * np.array([[1.0, 0.95], [0.95, 1.0]])
    sets = [replace(t, camera_cov=alike * t.camera_cov[:, :1, :1]) for t in sets]
    half = sets[2].projector_sigma.copy(), sets[2].projector_uv.copy()
    half[0][::3, 0] = half[1][::3, 0] = np.nan  # one axis is not decoded everywhere
    sets[2] = replace(sets[2], projector_sigma=half[0], projector_uv=half[1])
    calibration, adjustment = calibrate_photogrammetric(rig, field, sets, scale=bar)
    assert adjustment.variance_factors["camera"] < 0.3
    unit = np.sqrt(np.diagonal(calibration.covariance[:18, :18]))
    assert np.linalg.eigvalsh(calibration.covariance[:18, :18] / np.outer(unit, unit)).min() > 0


def residuals_of_a_placed_board(t, points, adjusted, start, sigma):
    """Observed less predicted of a capture by devices and points as adjusted, its board where it fits best."""

    def off(x):
        stand = Pose(matrix_from_rotation_vector(x[:3]) @ start.rotation, start.translation_mm + x[3:])
        views = ("camera", t.camera_uv, stand), ("projector", t.projector_uv, adjusted.relative["projector"] @ stand)
        return {
            name: uv - project(adjusted.devices[name].spec, adjusted.devices[name].interior, points, pose)
            for name, uv, pose in views
        }

    def whitened(x):
        every = np.concatenate([r.ravel() / sigma[n] for n, r in off(x).items()])
        return every[np.isfinite(every)]

    return off(least_squares(whitened, np.zeros(6), x_scale=1e-3).x)


def test_what_the_other_captures_foresee_is_what_an_adjustment_without_one_foresees(measured):
    """Once by the normal equations; once by adjusting without a capture, and placing its board by least squares."""
    _, rig, field, sets, bar = measured
    sets[3] = replace(sets[3], camera_uv=sets[3].camera_uv + [[0.3, -0.2]] * (np.arange(len(sets[3].row)) < 9)[:, None])
    network, options = network_from_targets(rig, field, sets, scale=bar), AdjustOptions(variance_components=True)
    found = {one.capture: one for one in leave_captures_out(network)}
    assert [one.capture for one in found.values() if one.off] == ["testfield-04"]
    verdict = left_out_verdict([{**asdict(one), "off": one.off} for one in found.values()])
    assert verdict.state == "doubtful"
    assert [text.split(" does not fit the others")[0] for text in verdict.because] == ["testfield-04"]
    with_all = adjust(network, options=options)
    sigma = {n: with_all.variance_factors[n] ** 0.5 * s for n, s in (("camera", 0.02), ("projector", 0.03))}
    for k in (0, 3):
        one, t = found[sets[k].capture], sets[k]
        rest = network_from_targets(rig, field, [s for s in sets if s is not t], scale=bar)
        without = adjust(rest, options=options)
        number = {(p.row, p.col): i for i, p in enumerate(rest.point_ids)}
        points = without.points_mm[[number[key] for key in zip(t.row.tolist(), t.col.tolist(), strict=True)]]
        start = with_all.station_from_object[with_all.network.station_names.index(f"{t.capture}/camera")]
        for name, residual in residuals_of_a_placed_board(t, points, without, start, sigma).items():
            # without the wrong capture the variance factors are others, which the normal equations do not know
            assert one.foreseen_px[name] == pytest.approx(np.sqrt(np.nanmean(residual**2)), rel=0.05)
            assert one.foreseen_px[name] > one.fitted_px[name]


def test_the_side_of_the_board_that_a_pose_names_is_the_nearest():
    """Eight axes across the view: the camera looks along -Z, so the greatest Z of the board's rim is nearest."""
    angles = np.radians(np.arange(0, 360, 45))
    rim = np.stack([np.cos(angles), np.sin(angles), np.zeros(8)], axis=1)  # from the right anticlockwise, Y up
    sides = (
        "right side",
        "upper right",
        "upper edge",
        "upper left",
        "left side",
        "lower left",
        "lower edge",
        "lower r",
    )
    for about in np.arange(0.0, 360.0, 45.0):
        tilt = matrix_from_rotation_vector(0.5 * np.array([np.cos(np.radians(about)), np.sin(np.radians(about)), 0]))
        nearest = sides[int(np.argmax((rim @ tilt.T)[:, 2]))]
        words = NextPose(30.0, about, 90.0, 600.4, 0.1, "camera.c", 0.2).words
        assert words.startswith(f"tilted by 30°, its {nearest}")
        assert words.endswith("towards the camera; rolled by 90°; 600 mm away")


def test_poses_for_a_projector_that_shows_columns_alone_bring_nothing_of_its_rows(measured):
    """They ended with an IndexError: what was never observed was taken for observed in the pose to come."""
    _, rig, field, sets, bar = measured
    columns = [replace(t, projector_uv=t.projector_uv * (1.0, np.nan)) for t in sets[:6]]
    for best in next_poses(network_from_targets(rig, field, columns, scale=bar), 2):
        assert 0 < best.gain < 1
        assert best.parameter != "projector.y0"


def test_what_one_more_pose_brings_is_what_an_adjustment_with_it_has(measured):
    _, rig, field, sets, bar = measured
    options = AdjustOptions(variance_components=True)
    network = network_from_targets(rig, field, sets[:6], scale=bar)
    best, second = next_poses(network, 2)
    before = adjust(network, options=options)
    across = [np.cos(np.radians(best.about_deg)), np.sin(np.radians(best.about_deg)), 0.0]
    tilt = matrix_from_rotation_vector(np.radians(best.tilt_deg) * np.array(across))
    turned = tilt @ matrix_from_rotation_vector(np.radians([0, 0, best.roll_deg]))
    own = [p for n, p in zip(before.network.station_names, before.station_from_object, strict=True) if "camera" in n]
    middle = np.mean([p.apply(before.points_mm.mean(axis=0)[None])[0] for p in own], axis=0)
    stand = Pose(turned, middle * best.distance_mm / -middle[2] - turned @ before.points_mm.mean(axis=0))
    rng, t = np.random.default_rng(0), sets[0]
    views = {"camera": (stand, 0.02), "projector": (before.relative["projector"] @ stand, 0.03)}
    uv = {}
    for name, (pose, sigma) in views.items():
        device = before.devices[name]
        seen = project(device.spec, device.interior, before.points_mm, pose)
        inside = np.all((seen > 0) & (seen < [device.spec.width - 1, device.spec.height - 1]), axis=1)
        uv[name] = np.where(inside[:, None], seen + rng.normal(scale=sigma, size=seen.shape), np.nan)
    at = np.isfinite(uv["camera"][:, 0])
    ids = [(p.row, p.col) for p, use in zip(before.network.point_ids, at, strict=True) if use]
    row, col = np.array(ids).T
    like = {n: getattr(t, n)[:1].repeat(len(row), axis=0) for n in ("camera_cov", "projector_sigma", "eccentricity_px")}
    more = TargetSet(
        "next", row, col, uv["camera"][at], projector_uv=uv["projector"][at], diameter_px=np.full(len(row), 9.0), **like
    )
    after = adjust(network_from_targets(rig, field, [*sets[:6], more], scale=bar), options=options)
    place = before.parameter_names.index(best.parameter)
    sigmas = [np.sqrt(np.diagonal(a.parameter_cov) / a.sigma0**2) for a in (before, after)]
    # with the variance factors as they are estimated with and without it
    assert 1 - sigmas[1][place] / sigmas[0][place] == pytest.approx(best.most, abs=0.05)
    assert 0.05 < best.gain < best.most
    # the second brings what one more brings after the first; beside the first, alone, it would bring nearly as much
    again = next_poses(after.network, 1)[0]
    assert second.gain == pytest.approx(again.gain, rel=0.1)  # at other distances: the mean of those captured moved
    assert second.gain < 0.8 * best.gain
