"""Forward intersection against true surfaces, an independent least-squares solver and Monte Carlo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from core.errors import InputError
from core.geometry import Pose, matrix_from_rotation_vector, ray_directions
from core.model import Interior, PhaseMap, PhotogrammetricCalibration
from core.reconstruct import reconstruct, sigma_table
from tests.calibrated import calibration_of_pair

# u, v are stored as float32: at 640 lines that is 3e-5 lines, and 1.4 lines are 1 mm here; Z itself is float32 too
EXACT_MM = 2e-4


def _compare(found: np.ndarray, points: np.ndarray, phase: PhaseMap) -> None:
    """Points wherever a coordinate was decoded, and only there, each in its place."""
    lit = np.isfinite(phase.u) | np.isfinite(phase.v)
    assert lit.mean() > 0.4
    np.testing.assert_array_equal(np.isfinite(found), np.repeat(lit[..., None], 3, axis=-1))
    np.testing.assert_allclose(found[lit], points[lit], atol=EXACT_MM)


def test_points_of_a_tilted_plane_come_back_with_4_and_with_3_observations(rig, without) -> None:
    points = rig.plane()
    phase = rig.phase(points)
    for observed in (phase, without(phase, "v")):
        _compare(reconstruct(observed, rig.calibration).xyz_mm, points, phase)


def test_row_patterns_alone_serve_a_projector_that_stands_above(make_rig, without) -> None:
    rig = make_rig(place=(10.0, 250.0, 0.0))
    points = rig.plane()
    phase = without(rig.phase(points), "u")
    _compare(reconstruct(phase, rig.calibration).xyz_mm, points, phase)


@pytest.mark.parametrize(("turn", "behind"), [(0.0, 0.0), (0.15, 0.0), (0.4, 0.0), (2.5, 0.0), (0.0, 300.0)])
def test_the_depths_at_which_rays_are_lit_are_those_of_the_projected_points(rig, turn, behind) -> None:
    calibration = rig.calibration
    pose = calibration.projector_from_camera
    stands = np.array([0.0, 0.0, behind]) if behind else pose.translation_mm
    turned = Pose(matrix_from_rotation_vector(np.array([0.3 * turn, turn, 0.0])) @ pose.rotation, stands)
    camera, projector = ((d.spec, d.interior) for d in (calibration.camera, calibration.projector))
    devices = sigma_table.Devices(camera, projector, turned)
    rays, tried = ray_directions(*camera, sigma_table._camera_nodes(devices)), sigma_table._tried(devices)
    rays[0, 0] = np.nan  # where a lens sees nothing
    lit = sigma_table._lit(projector[0], sigma_table._pinhole(devices, rays, tried), sigma_table.MARGIN)
    depths = np.where(lit, tried, np.nan)
    assert lit.any() == (turn < 1)
    with np.errstate(all="ignore"):
        ends = np.fmin.reduce(depths, axis=-1), np.fmax.reduce(depths, axis=-1)
    np.testing.assert_array_equal(sigma_table._lit_depths(devices, rays), ends)


def test_points_of_a_sphere_come_back(rig) -> None:
    rays = rig.rays() / np.linalg.norm(rig.rays(), axis=-1, keepdims=True)
    centre, radius = np.array([10.0, -5.0, -600.0]), 80.0
    along = rays @ centre
    root = along**2 - centre @ centre + radius**2
    points = rays * (along - np.sqrt(np.where(root > 0, root, np.nan)))[..., None]
    phase = rig.phase(points)
    cloud = reconstruct(phase, rig.calibration)
    hit = np.isfinite(cloud.xyz_mm[..., 0])
    assert hit.sum() > 0.9 * (root > 0).sum()
    np.testing.assert_allclose(np.linalg.norm(cloud.xyz_mm[hit] - centre, axis=-1), radius, atol=EXACT_MM)


def test_strong_distortion_of_both_lenses_is_undone(make_rig) -> None:
    # 5 % at the camera's corner (3.8 mm), 3 % at the projector's (41 mm): cheap wide-angle lenses
    rig = make_rig(
        camera_a=(-3.5e-3, 2e-5, 2e-3, 1e-3, 1e-3, -1e-3), projector_a=(-1.8e-5, 1e-9, -2e-3, 1e-3, 2e-5, 5e-5)
    )
    points = rig.plane()
    phase = rig.phase(points)
    _compare(reconstruct(phase, rig.calibration).xyz_mm, points, phase)


def test_noisy_observations_give_the_weighted_least_squares_point(make_rig) -> None:
    rig = make_rig(place=(200.0, 150.0, 30.0))  # u and v both matter
    rng = np.random.default_rng(3)
    phase = rig.phase(rig.plane(), sigma=0.2, noise=rng)
    phase = replace(phase, sigma_v=rng.uniform(0.05, 0.5, phase.v.shape).astype(np.float32))
    cloud = reconstruct(phase, rig.calibration)
    rays = rig.rays()
    for r, c in rng.permutation(np.argwhere(np.isfinite(phase.u)))[:40]:
        observed = np.array([phase.u[r, c], phase.v[r, c]], np.float64)
        sigma = np.array([phase.sigma_u[r, c], phase.sigma_v[r, c]], np.float64)

        def residuals(depth, ray=rays[r, c], observed=observed, sigma=sigma):
            return (rig.lines(ray * depth[0]) - observed) / sigma

        found = least_squares(residuals, [550.0], x_scale=100.0, xtol=1e-14, ftol=1e-14, gtol=1e-14)
        np.testing.assert_allclose(cloud.xyz_mm[r, c], rays[r, c] * found.x[0], atol=1e-3)
        expected = 1 / np.linalg.norm(found.jac)
        np.testing.assert_allclose(cloud.sigma_depth_mm[r, c], expected, rtol=1e-3)


def test_a_pixel_without_the_other_coordinate_still_has_its_point(rig) -> None:
    points = rig.plane()
    phase = rig.phase(points)
    phase.v[33, 44] = phase.sigma_v[33, 44] = np.nan
    cloud = reconstruct(phase, rig.calibration)
    np.testing.assert_allclose(cloud.xyz_mm[33, 44], points[33, 44], atol=EXACT_MM)
    assert np.isfinite(cloud.sigma_mm[33, 44]).all()


def test_pixels_without_the_leading_coordinate_have_no_point(rig) -> None:
    phase = rig.phase(rig.plane())
    phase.u[30:40, 45] = np.nan
    assert np.isfinite(phase.v[30:40, 45]).all()
    cloud = reconstruct(phase, rig.calibration)
    lost = ~np.isfinite(cloud.xyz_mm).all(axis=-1)
    np.testing.assert_array_equal(lost, np.isnan(phase.u))
    for values in (cloud.sigma_mm[..., 0], cloud.sigma_depth_mm):
        np.testing.assert_array_equal(np.isnan(values), lost)


def test_rays_that_meet_behind_the_camera_have_no_point(rig, without) -> None:
    phase = without(rig.phase(rig.plane()), "v")
    lit = np.isfinite(phase.u).sum()
    phase.u[35, 45] = 640.0 * 20  # the stripe's plane leaves the camera's ray backwards
    phase.u[36, 46] = np.inf
    cloud = reconstruct(phase, rig.calibration)
    assert np.isnan(cloud.xyz_mm[35, 45]).all()
    assert np.isnan(cloud.xyz_mm[36, 46]).all()
    assert np.isfinite(cloud.xyz_mm).all(axis=-1).sum() == lit - 2


def test_sigma_zero_or_missing_does_not_lose_the_point(rig) -> None:
    points = rig.plane()
    phase = rig.phase(points)
    phase.sigma_u[30, 40] = 0
    phase.sigma_u[31, 41] = np.nan
    _compare(reconstruct(phase, rig.calibration).xyz_mm, points, phase)


def test_phase_noise_scatters_the_points_as_their_sigma_says(rig, without) -> None:
    rng = np.random.default_rng(11)
    points = rig.plane()
    for drop in (None, "v"):
        errors = []
        for _ in range(40):
            phase = rig.phase(points, sigma=0.05, noise=rng)
            cloud = reconstruct(phase if drop is None else without(phase, drop), rig.calibration)
            errors.append((cloud.xyz_mm[..., 2] - points[..., 2]) / cloud.sigma_mm[..., 2])
        # about 40 x 4400 independent values: their r.m.s. has a standard deviation of 0.0017
        assert np.sqrt(np.nanmean(np.square(errors))) == pytest.approx(1.0, abs=0.006)


def test_two_coordinates_are_at_least_as_good_as_one(make_rig, without) -> None:
    rig = make_rig(place=(200.0, 150.0, 30.0))
    phase = rig.phase(rig.plane())
    both = reconstruct(phase, rig.calibration)
    one = reconstruct(without(phase, "v"), rig.calibration)
    gain = both.sigma_depth_mm / one.sigma_depth_mm
    assert np.nanmax(gain) <= 1.00001
    assert np.nanmedian(gain) < 0.9


def _covariance(rng: np.random.Generator) -> np.ndarray:
    """A full covariance of the size a calibration has, correlated at random."""
    camera = [3e-3, 3e-3, 3e-3, 1e-5, 1e-6, 1e-4, 1e-4, 1e-5, 1e-5]
    projector = [5e-2, 5e-2, 5e-2, 1e-7, 1e-10, 1e-4, 1e-4, 1e-6, 1e-6]
    sigma = np.array(camera + projector + [2e-4] * 3 + [5e-2] * 3)
    mix = rng.normal(size=(24, 24)) + 2 * np.eye(24)
    correlation = mix @ mix.T
    root = np.sqrt(np.diag(correlation))
    return correlation / np.outer(root, root) * np.outer(sigma, sigma)


def _wrong(c: PhotogrammetricCalibration, change: np.ndarray) -> PhotogrammetricCalibration:
    """The calibration with its 24 parameters changed, and held for certain."""
    cam, proj = (
        replace(d, interior=Interior.from_vector(d.interior.vector + part, d.interior.r0_mm))
        for d, part in ((c.camera, change[:9]), (c.projector, change[9:18]))
    )
    pose = Pose(
        matrix_from_rotation_vector(change[18:21]) @ c.projector_from_camera.rotation,
        c.projector_from_camera.translation_mm + change[21:],
    )
    return calibration_of_pair(cam, proj, pose, np.zeros((24, 24)))


def test_errors_of_the_calibration_scatter_the_points_as_their_sigma_says(make_rig, without) -> None:
    rng = np.random.default_rng(7)
    covariance = _covariance(rng)
    rig = make_rig(covariance=covariance)
    points = rig.plane()
    phase = rig.phase(points, sigma=1e-4)  # next to no noise: the calibration's part alone
    c = rig.calibration
    draws = 200
    for drop in (None, "v"):
        observed = phase if drop is None else without(phase, drop)
        told = reconstruct(observed, c).sigma_mm
        squares = np.zeros(points.shape)
        for change in rng.multivariate_normal(np.zeros(24), covariance, draws):
            squares += (reconstruct(observed, _wrong(c, change)).xyz_mm - points) ** 2
        ratio = np.sqrt(squares / draws) / told
        # a standard deviation from 200 draws is itself known to 5 %, and neighbouring pixels share their error
        assert np.nanmin(ratio) > 0.84
        assert np.nanmax(ratio) < 1.16


def test_the_sigma_table_repeats_the_covariance_propagated_at_every_pixel(make_rig, without) -> None:
    rng = np.random.default_rng(8)
    # as it is, and with distortion that no board ever reached: towards the edges sigmas grow a hundredfold
    for far, cases in ((1.0, ((-600.0, None), (-450.0, "v"), (-900.0, None))), (30.0, ((-600.0, None),))):
        covariance = _covariance(rng) * np.outer(grown := np.where(np.isin(np.arange(24), (12, 13)), far, 1.0), grown)
        _sigmas_repeat(make_rig(covariance=covariance), covariance, cases, 0.005 if far == 1 else 0.1, without)


def test_a_parameter_known_alone_leaves_what_it_does_not_move_certain(make_rig) -> None:
    rig = make_rig(covariance=np.diag([0.05**2 if p == 9 else 0.0 for p in range(24)]))  # the projector's c
    cloud = reconstruct(rig.phase(rig.plane(), sigma=1e-4), rig.calibration)
    assert np.isfinite(cloud.sigma_mm[np.isfinite(cloud.xyz_mm)]).all()


def _sigmas_repeat(rig, covariance, cases, off: float, without) -> None:
    for z, drop in cases:
        phase = rig.phase(rig.plane(z=z), sigma=1e-4)
        observed = phase if drop is None else without(phase, drop)
        G = []
        for p, sigma in enumerate(np.sqrt(np.diag(covariance))):
            ends = [reconstruct(observed, _wrong(rig.calibration, s * sigma * np.eye(24)[p])).xyz_mm for s in (1, -1)]
            G.append((ends[0].astype(np.float64) - ends[1]) / (2 * sigma))
        exact = np.sqrt(np.einsum("ihwk,ij,jhwk->hwk", np.array(G), covariance, np.array(G)))
        ratio = reconstruct(observed, rig.calibration).sigma_mm / exact
        # linear interpolation of the polynomials between 25 x 25 nodes
        assert np.nanmin(ratio) > 1 - off
        assert np.nanmax(ratio) < 1 + off


def test_column_patterns_are_asked_for_where_rows_say_nothing_about_depth(make_rig, without) -> None:
    rig = make_rig(place=(250.0, 0.0, 0.0))
    with pytest.raises(InputError, match="hardly changes with depth"):
        reconstruct(without(rig.phase(rig.plane()), "u"), rig.calibration)


def test_a_phase_map_without_any_coordinate_is_refused(rig, without) -> None:
    phase = without(without(rig.phase(rig.plane()), "u"), "v")
    with pytest.raises(InputError, match="no pixel has a projector coordinate"):
        reconstruct(phase, rig.calibration)


def test_a_phase_map_of_another_camera_is_refused(rig) -> None:
    phase = rig.phase(rig.plane())
    smaller = replace(phase, u=phase.u[:50], v=phase.v[:50])
    with pytest.raises(InputError, match="94×50"):
        reconstruct(smaller, rig.calibration)
