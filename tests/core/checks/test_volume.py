"""Uncertainty and differences over the working volume, against closed forms and drawn errors."""

from dataclasses import replace

import numpy as np
import pytest

from core.checks.plates import intersect_targets
from core.checks.volume import (
    bend_of_plane,
    difference,
    fields_at,
    form_of_fields,
    image_fields,
    point_fields,
    sigmas_of,
    volume_of,
)
from core.errors import InputError
from core.geometry import Pose, pair_of, perturbed, project, ray_directions
from core.model import AdjustedDevice, DeviceSpec, Interior
from tests.calibrated import calibration_of_pair

DEPTHS = np.array([420.0, 480.0, 540.0])


@pytest.fixture(scope="module")
def pair():
    """A short camera and a long projector 150 mm beside it, turned towards the same place."""
    turn = np.deg2rad(17)
    R = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    centre = np.array([-150.0, 10.0, -5.0])
    interiors = [
        Interior(c, 0.02, -0.01, (a1, 0, 0, 0, 0, 0), r0) for c, a1, r0 in ((6.0, -1e-3, 2.0), (7.5, 4e-4, 2.1))
    ]
    devices = [
        AdjustedDevice(DeviceSpec(500, 400, (0.01, 0.01), i.c_mm), i, np.zeros(9), (0.1, 0.1), 9) for i in interiors
    ]
    sigma = np.array([*[2e-3, 2e-3, 2e-3, 3e-5, 3e-6, 2e-5, 2e-5, 2e-5, 2e-5] * 2, 3e-5, 3e-5, 3e-5, 0.02, 0.02, 0.02])
    L = np.random.default_rng(1).normal(size=(24, 24)) / 8 + np.eye(24)
    return pair_of(calibration_of_pair(*devices, Pose(R, -R @ centre), (sigma[:, None] * L) @ (sigma[:, None] * L).T))


def without_sigmas(pair):
    return replace(pair, covariance=np.zeros((24, 24)))


def test_a_longer_base_scales_all_points_and_bends_none_beside_it(pair):
    pose = pair.projector_from_camera
    longer = replace(without_sigmas(pair), projector_from_camera=Pose(pose.rotation, pose.translation_mm * 1.001))
    found = difference(pair, longer, DEPTHS)
    assert found.shift_mm == pytest.approx(0.001 * found.volume.xyz_mm, abs=1e-5)
    local = 0.001 * (found.volume.xyz_mm - found.volume.xyz_mm.mean(axis=0))  # what no movement takes off
    assert found.form_mm == pytest.approx(local, abs=1e-5)
    assert found.volume.grid(found.sigma_mm).shape == (3, 10, 13)


def test_drawn_errors_are_as_large_as_the_sigmas_say(pair):
    values, vectors = np.linalg.eigh(pair.covariance)
    rng, ratios, statistics = np.random.default_rng(2), [], []
    for _ in range(16):
        other = perturbed(without_sigmas(pair), vectors @ (np.sqrt(np.maximum(values, 0)) * rng.normal(size=24)))
        found = difference(pair, other, DEPTHS)
        ratios.append([
            np.mean(np.sum(found.shift_mm**2, axis=1) / found.sigma_mm**2),
            np.mean(np.sum(found.form_mm**2, axis=1) / found.form_sigma_mm**2),
        ])  # fmt: skip
        statistics.append(found.statistic)
    # a few errors of 24 carry most of it: 16 draws of about 4 degrees of freedom each are good to 18 %
    assert np.mean(ratios, axis=0) == pytest.approx([1.0, 1.0], abs=0.45)
    # the mean of 16 chi-squares of about 20 degrees of freedom is good to 1.6
    assert np.mean(statistics) == pytest.approx(found.dof, abs=5)
    assert np.max(statistics) < found.limit
    far = perturbed(without_sigmas(pair), 5 * vectors @ np.sqrt(np.maximum(values, 0)))
    assert difference(pair, far, DEPTHS).significant


def test_drawn_errors_bend_a_plane_by_as_much_as_is_said(pair):
    normal = np.array([0.3, -0.1, 1.0]) / np.linalg.norm([0.3, -0.1, 1.0])
    uv = np.stack(np.meshgrid(np.linspace(60, 440, 9), np.linspace(60, 340, 7)), axis=-1).reshape(-1, 2)
    rays = ray_directions(pair.camera.spec, pair.camera.interior, uv)
    xyz = rays * (-480 * normal[2] / (rays @ normal))[:, None]
    lines = project(pair.projector.spec, pair.projector.interior, xyz, pair.projector_from_camera)
    values, vectors = np.linalg.eigh(pair.covariance)
    rng, squares = np.random.default_rng(3), []
    for _ in range(40):
        other = perturbed(without_sigmas(pair), vectors @ (np.sqrt(np.maximum(values, 0)) * rng.normal(size=24)))
        seen = intersect_targets(other, uv, lines, np.ones(lines.shape), xyz)[0]
        about = seen - seen.mean(axis=0)
        squares.append(np.linalg.svd(about)[1][2] ** 2 / len(about))  # about the plane that fits best
    # of 40 draws of a few degrees of freedom each
    assert bend_of_plane(fields_at(pair, uv, xyz), xyz, normal) == pytest.approx(np.mean(squares) ** 0.5, rel=0.15)


def test_sigmas_of_points_follow_from_one_parameter_in_closed_form(pair):
    covariance = np.zeros((24, 24))
    covariance[21:, 21:] = 0.03**2 * np.outer(t := pair.projector_from_camera.translation_mm, t)
    scaled = replace(pair, covariance=covariance)  # the base's length alone
    volume = volume_of(scaled, DEPTHS)
    fields = point_fields(scaled, volume)
    assert sigmas_of(fields) == pytest.approx(0.03 * np.linalg.norm(volume.xyz_mm, axis=1), rel=0.04)
    assert np.all(sigmas_of(form_of_fields(fields, volume.xyz_mm)) < sigmas_of(fields))


def test_a_wrong_focal_length_is_hidden_by_one_plane_and_shown_by_two(pair):
    covariance = np.diag([0.01**2, *[0.0] * 8])
    plain = replace(pair.camera, interior=Interior(6.0, 0.0, 0.0, (0.0,) * 6, 2.0))
    y, x = np.mgrid[-100:101:25.0, -120:121:30.0]
    plane = np.stack([x.ravel(), y.ravel(), np.full(x.size, -450.0)], axis=1)
    assert sigmas_of(image_fields(plain, covariance, plane)).max() < 1e-6
    both = np.concatenate([plane, plane * [1, 1, 1.2]])
    assert sigmas_of(image_fields(plain, covariance, both)).max() > 0.02


def test_calibrations_without_sigmas_have_no_test_and_strange_rigs_no_volume(pair):
    found = difference(without_sigmas(pair), without_sigmas(pair), DEPTHS)
    assert found.significant is None
    assert np.abs(found.shift_mm).max() < 2e-5
    away = replace(pair, projector_from_camera=Pose(np.diag([-1.0, 1.0, -1.0]), np.zeros(3)))
    with pytest.raises(InputError, match="lights nothing"):
        volume_of(away, DEPTHS)


def test_a_camera_that_is_held_moves_no_image(pair):
    xyz = volume_of(pair, np.array([500.0, 600.0])).xyz_mm
    k = len(pair.camera.interior.vector)
    assert np.all(sigmas_of(image_fields(pair.camera, np.zeros((k, k)), xyz)) == 0)
