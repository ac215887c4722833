"""One relative orientation for all poses, and whether that was true."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibrate import adjust, calibrate_photogrammetric, network_from_targets, rigidity_test
from core.errors import AdjustmentError, InputError
from core.geometry import Pose, matrix_from_rotation_vector, project, rotation_vector_from_matrix
from core.model import Rig, ScaleBar, TargetSet, Testfield

ROWS, COLS = 6, 8


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


def test_a_rigid_rig_passes(loose):
    # the critical value is exceeded by one rigid rig in a thousand
    assert all(rigidity_test(loose(0.0, seed)).rigid for seed in range(8))


def test_a_loose_rig_is_recognised_and_its_looseness_measured(loose):
    result = rigidity_test(loose(0.5))
    assert not result.rigid
    assert result.statistic > 3 * result.critical
    assert "was not rigid" in str(result)
    # three components of 0.5 mm each, ten samples
    assert 0.5 < result.shift_rms_mm < 1.4


def test_what_is_significant_and_smaller_than_the_targets_own_errors_is_no_looseness(loose):
    large, small = rigidity_test(loose(0.5)), rigidity_test(loose(0.007))
    assert small.statistic > small.critical
    assert small.rigid
    # the same motion on a scale of 1:71. The small one's F of about 3 has 54 degrees of freedom and so a standard
    # deviation of sqrt(2 + 4 · 2) / sqrt(54) = 0.43: a fifth of its excess over 1, a tenth of the drift
    assert large.drift_sigmas / small.drift_sigmas == pytest.approx(0.5 / 0.007, rel=0.3)


def test_statistic_of_rigid_rigs_is_f_distributed(loose):
    values = [rigidity_test(loose(0.0, seed)).statistic for seed in range(30)]
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
    assert any("v was never observed" in w and "A3" in w for w in adjustment.warnings)
    device, truth = adjustment.devices["projector"], simulated.interior["projector"]
    assert device.interior.y0_mm == 0
    assert device.sigma[2] == 0
    # the projection centre's height, 15 mm in truth, is held at 0 and reaches the rest through the distortion only
    assert abs(device.interior.c_mm - truth.c_mm) < 5 * device.sigma[0]
    found = adjustment.relative["projector"].translation_mm
    assert found[1] == 0
    np.testing.assert_allclose(found[[0, 2]], simulated.projector_from_camera.translation_mm[[0, 2]], atol=0.5)
    camera = adjustment.devices["camera"]
    assert np.abs((camera.interior.vector - simulated.interior["camera"].vector) / camera.sigma).max() < 4
