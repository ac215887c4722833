"""The camera by the depth plate's targets, when the targets are not where the drawing says."""

from __future__ import annotations

import numpy as np
import pytest

from core.calibrate.depth.camera import TargetPlane, _decorrelated, _derivatives, _sigmas, _unpack, orient_camera
from core.geometry import (
    Pose,
    matrix_from_rotation_vector,
    project,
    ray_directions,
    rotation_vector_from_matrix,
)
from core.model import DepthCalibration, DeviceSpec, Interior
from core.reconstruct.lookup import whole_sigma

SPEC = DeviceSpec(748, 576, (0.008, 0.008), 12.0)
COARSE = DeviceSpec(75, 58, (0.08, 0.08), 12.0)  # the same image in a hundredth of the pixels
CAMERA = Interior(12.1, -0.08, -0.11, (-6e-4, 3e-6, -1e-2, 3e-4, -1e-4, -8e-5), SPEC.zero_radius_mm)
POSE = Pose(matrix_from_rotation_vector([0.03, -0.04, 0.02]), np.array([3.0, -4.0, -600.0]))
AXIS = np.array([0.004, -0.003, 1.0]) / np.linalg.norm([0.004, -0.003, 1.0])


def test_residuals_that_a_target_shares_become_independent() -> None:
    rng = np.random.default_rng(3)
    target = rng.permutation(np.repeat(np.arange(400), rng.integers(1, 12, 400)))
    size = rng.uniform(0.9, 1.1, len(target))
    rest = rng.normal(0, 0.3, (len(target), 2)) + size[:, None] * rng.normal(0, 1.2, (400, 2))[target]
    own, shared = _sigmas(rest, target, size)
    assert own == pytest.approx(0.3, rel=0.04)  # 4000 residuals
    assert shared == pytest.approx(1.2, rel=0.08)  # 800 means
    unit = _decorrelated(rest, target, size, 0.3, 1.2)
    assert np.mean(unit**2) == pytest.approx(1, abs=0.06)
    # the sum of a target's k independent residuals has variance k
    sums = np.stack([np.bincount(target, column) for column in unit.T], axis=-1)
    assert np.mean(sums**2 / np.bincount(target)[:, None]) == pytest.approx(1, abs=4 * np.sqrt(2 / 800))


def test_targets_seen_once_share_nothing() -> None:
    rest = np.random.default_rng(4).normal(0, 0.5, (300, 2))
    own, shared = _sigmas(rest, np.arange(300), np.ones(300))
    assert own == pytest.approx(0.5, rel=0.08)
    assert shared == 0.0


def _plate_seen(
    rng: np.random.Generator, shape: tuple[int, int], pitch_mm: float, off_mm: float, noise_px: float
) -> list[TargetPlane]:
    """A plate of targets that are off their places, at eleven positions."""
    row, col = (a.ravel() for a in np.meshgrid(*map(np.arange, shape), indexing="ij"))
    middle = np.array(shape) // 2
    nominal = np.stack([(col - middle[1]) * pitch_mm, (middle[0] - row) * pitch_mm, 0.0 * row], axis=-1)
    true = nominal + rng.normal(0, off_mm, nominal.shape) * (1, 1, 0)
    planes = []
    for z in np.arange(-50, 51, 10.0):
        uv = project(SPEC, CAMERA, true + z * AXIS, POSE) + rng.normal(0, noise_px, (len(row), 2))
        seen = np.all((uv > 2) & (uv < (745, 573)), axis=-1)
        planes.append(TargetPlane(float(z), np.arange(len(row))[seen], nominal[seen], uv[seen]))
    return planes


def _oriented(seed: int, off_mm: float) -> np.ndarray:
    """Error of c, x0, y0 (mm) and the axis (rad) from one simulated plate with targets off their places."""
    found = orient_camera(SPEC, _plate_seen(np.random.default_rng(seed), (9, 13), 20.0, off_mm, 0.012))
    return np.array([*(found.interior.vector - CAMERA.vector)[:3], *(found.axis_direction - AXIS)[:2]])


@pytest.mark.parametrize(("off_mm", "noise_px"), [(0.02, 0.005), (0.05, 0.02)])
def test_a_plate_stands_as_surely_as_it_says(off_mm: float, noise_px: float) -> None:
    """Errors of tilt and distance were 1.7 to 2.7 sigmas while targets off their places were seen alike from all."""
    ratios = []
    for seed in range(24):
        planes = _plate_seen(np.random.default_rng(seed), (7, 9), 24.0, off_mm, noise_px)
        found = orient_camera(SPEC, planes, interior=(CAMERA, np.zeros((9, 9))))
        pose, spread = found.camera_from_plate, np.sqrt(np.diagonal(found.covariance)[-8:-2])
        turn = rotation_vector_from_matrix(pose.rotation) - rotation_vector_from_matrix(POSE.rotation)
        ratios.append(np.concatenate([turn, pose.translation_mm - POSE.translation_mm]) / spread)
    # 24 plates: each r.m.s. is known to 15 %
    assert np.sqrt(np.mean(np.square(ratios), axis=0)) == pytest.approx(np.ones(6), abs=0.45)


def test_targets_off_their_places_do_not_spoil_the_focal_length() -> None:
    errors = np.sqrt(np.mean([_oriented(seed, 0.05) ** 2 for seed in range(10)], axis=0))
    # 0.05 mm is 0.1 px, eight times the image noise; c follows from the change with z, in which places cancel.
    # Twelve such plates gave 0.010 mm; with the places taken as exact 0.019 mm.
    assert errors[0] < 0.015
    # principal point and axis are told apart only by what one knows beforehand: 0.19 mm and 0.02 rad
    assert errors[1:3].max() < 0.19
    assert errors[3:].max() < 0.02


def _misplaced(seed: int) -> np.ndarray:
    """Errors over sigmas of points on the plate at z = 30 mm, by an interior orientation known with its covariance."""
    rng = np.random.default_rng([seed, 1])
    sigma = np.array([2e-3, 3e-3, 3e-3, 2e-6, 2e-8, 5e-6, 5e-6, 3e-6, 3e-6])
    turn = np.eye(9)
    turn[1, 8] = turn[2, 7] = -0.6  # as principal point and decentring go together
    root = sigma[:, None] * turn
    known = Interior.from_vector(CAMERA.vector + root @ rng.normal(size=9), CAMERA.r0_mm)
    row, col = (a.ravel() for a in np.meshgrid(np.arange(9), np.arange(13), indexing="ij"))
    plate = np.stack([(col - 6) * 20.0, (4 - row) * 20.0, 0.0 * row], axis=-1)
    planes = []
    for z in (-50.0, -20.0, 0.0, 20.0, 50.0):
        uv = project(COARSE, CAMERA, plate + z * AXIS, POSE) + rng.normal(0, 0.002, (len(row), 2))
        planes.append(TargetPlane(z, np.arange(len(row)), plate, uv))
    found = orient_camera(COARSE, planes, interior=(known, root @ root.T))
    assert not found.warnings
    one = np.zeros((1, COARSE.height, COARSE.width), np.float32)
    calibration = DepthCalibration(
        "u", np.array([-50.0, 50.0]), 0, one, one, 0.0, 1, COARSE, found.interior, found.camera_from_plate,
        found.axis_direction, covariance=found.covariance,
    )  # fmt: skip
    v, u = np.mgrid[: COARSE.height, : COARSE.width].astype(float)
    true, seen = (
        _on_plate(np.stack([u, v], axis=-1), interior, pose, axis)
        for interior, pose, axis in (
            (CAMERA, POSE, AXIS),
            (found.interior, found.camera_from_plate, found.axis_direction),
        )
    )
    sigmas = whole_sigma(calibration, seen.astype(np.float32), np.zeros(u.shape, np.float32))
    assert sigmas is not None
    return ((seen - true) / sigmas)[10:50:15, 10:70:20]


@pytest.mark.parametrize(("turn", "sign"), [([0.03, -0.04, 0.02], 1.0), ([0.6, -0.9, 1.1], -1.0), ([0, 0, 0], 1.0)])
def test_derivatives_are_those_of_the_image(turn: list[float], sign: float) -> None:
    rng = np.random.default_rng(6)
    places, z = rng.normal(0, 40, (20, 3)), rng.normal(0, 30, 20)
    parameters = np.array([*CAMERA.vector, *turn, *POSE.translation_mm, 0.02, -0.03, sign])
    steps = np.array([1e-3, 1e-3, 1e-3, 1e-7, 1e-9, *[1e-6] * 4, *[1e-6] * 3, *[1e-3] * 3, 1e-5, 1e-5])

    def seen(change: np.ndarray) -> np.ndarray:
        interior, pose, axis = _unpack(SPEC, parameters + np.append(change, 0.0))
        return project(SPEC, interior, places + z[:, None] * axis, pose)

    found = _derivatives(SPEC, parameters, places, z) * steps
    for k, step in enumerate(np.diag(steps)):
        # central differences of so small steps are right to their square, and to the rounding of 400 px
        assert found[..., k] == pytest.approx((seen(step) - seen(-step)) / 2, rel=1e-6, abs=1e-9)


def _on_plate(uv: np.ndarray, interior: Interior, pose: Pose, axis: np.ndarray) -> np.ndarray:
    rays, normal = ray_directions(COARSE, interior, uv), pose.rotation[:, 2]
    return rays * (normal @ (pose.translation_mm + pose.rotation @ axis * 30.0) / (rays @ normal))[..., None]


def test_points_are_as_far_off_as_their_sigmas_say() -> None:
    squares = np.array([np.mean(_misplaced(seed) ** 2, axis=(0, 1)) for seed in range(30)])
    # X, Y and Z of 30 calibrations; the pixels of one share most of their error: r.m.s. known to about 13 %
    assert np.sqrt(squares.mean(axis=0)) == pytest.approx([1, 1, 1], abs=0.35)


def test_a_plate_alone_says_that_its_camera_is_hardly_known() -> None:
    plate = np.stack(
        [*(a.ravel() for a in np.meshgrid(np.arange(-5, 6) * 20.0, np.arange(-4, 5) * 20.0)), np.zeros(99)], 1
    )
    rng, planes = np.random.default_rng(5), []
    for z in (-40.0, 0.0, 40.0):
        uv = project(SPEC, CAMERA, plate + z * AXIS, POSE) + rng.normal(0, 0.02, (99, 2))
        planes.append(TargetPlane(z, np.arange(99), plate, uv))
    found = orient_camera(SPEC, planes)
    assert any("alone" in warning for warning in found.warnings)
    assert found.covariance is not None
    assert np.sqrt(found.covariance[1, 1]) > 5 * SPEC.pitch_mm[0]  # of x0; the prior's is 0.19 mm, 24 pixels
