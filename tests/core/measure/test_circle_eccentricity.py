"""The correction of the circle's eccentricity against its closed form and against a circle cut into pieces."""

import numpy as np
import pytest

from core.geometry import Pose, matrix_from_axis_angle, matrix_from_rotation_vector, project
from core.measure import View, eccentricity, recentred
from core.model import DeviceSpec, Interior, TargetSet, Testfield

SPEC = DeviceSpec(748, 576, (0.008, 0.006), 12.0)


@pytest.mark.parametrize("tilt_deg", [0, 10, 30, 45, 60])
@pytest.mark.parametrize(("radius_mm", "distance_mm"), [(2.5, 1000.0), (20.0, 200.0)])
def test_it_is_the_closed_form_where_the_camera_looks_at_the_circle(tilt_deg, radius_mm, distance_mm):
    a = np.radians(tilt_deg)
    pose = Pose(matrix_from_axis_angle([0, 1, 0], a), np.array([0.0, 0.0, -distance_mm]))
    got = eccentricity(View(SPEC, pose), np.zeros((1, 3)), np.array([radius_mm]))[0]
    c, r, D = SPEC.nominal_c_mm, radius_mm, distance_mm
    expected = c * r**2 * np.sin(a) * np.cos(a) / (D**2 - r**2 * np.sin(a) ** 2) / SPEC.pitch_mm[0]
    assert np.hypot(*got) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert got[1] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("a1", [0.0, -6e-4, 2e-3])
def test_it_is_the_centroid_of_the_pieces_of_a_circle(a1):
    rng = np.random.default_rng(4)
    for _ in range(5):
        R = matrix_from_rotation_vector(rng.uniform(-0.6, 0.6, 3))
        view = View(SPEC, Pose(R, np.array([*rng.uniform(-60, 60, 2), -300.0])), a1)
        r, centre = 6.0, np.array([*rng.uniform(-20, 20, 2), 0.0])
        # equal areas on the board, each with the area of its image as weight
        ring, angle = (g.ravel() for g in np.meshgrid((np.arange(40) + 0.5) / 40, np.arange(48) * 2 * np.pi / 48))
        radius = r * np.sqrt(ring)
        pieces = centre + np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(len(ring))], axis=1)
        weight = np.abs(np.linalg.det(view.jacobian(pieces)))
        expected = weight @ view.project(pieces) / weight.sum() - view.project(centre[None])[0]
        got = eccentricity(view, centre[None], np.array([r]))[0]
        assert np.allclose(got, expected, atol=1e-4)


def test_jacobian_is_that_of_the_projection():
    view = View(SPEC, Pose(matrix_from_rotation_vector([0.3, -0.5, 1.0]), np.array([5.0, -8.0, -300.0])), 1e-3)
    at, step = np.array([[10.0, -20.0, 3.0]]), 1e-4
    for k, axis in enumerate(np.eye(3)[:2]):
        slope = (view.project(at + step * axis) - view.project(at - step * axis)) / (2 * step)
        assert np.allclose(view.jacobian(at)[:, :, k], slope, rtol=1e-6)


@pytest.mark.parametrize("bend_mm", [0.0, 4.0])
def test_targets_are_recentred_by_an_adjusted_camera_with_unequal_pitches(bend_mm):
    """Also on a dome, where every circle lies in a plane of its own: 3° off the others' at the rim."""
    interior = Interior(12.4, 0.08, -0.1, (-2.6e-3, 4e-5, -0.014, 0.002, 1e-4, -2e-4), 3.0)
    spec = DeviceSpec(748, 576, (0.008, 0.008), 12.0)
    pose = Pose(matrix_from_axis_angle([0.3, 1, 0], np.radians(32)), np.array([5.0, -8.0, -620.0]))
    row, col = (x.ravel() for x in np.mgrid[0:3, 0:4])
    x, y = 40.0 * col - 60, 40.0 * row - 40
    bend = -bend_mm / (60**2 + 40**2)
    field = Testfield(row, col, np.stack([x, y, bend * (x**2 + y**2)], axis=1), np.full(12, 6.0))
    angle = np.linspace(0, 2 * np.pi, 721)[:-1]
    normal = np.stack([-2 * bend * x, -2 * bend * y, np.ones(12)], axis=1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    across = np.cross(normal, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across, axis=1)[:, None]
    up = np.cross(normal, across)
    turn = 3.0 * (np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * up[:, None])
    rim = field.xyz_mm[:, None] + turn
    seen = project(spec, interior, rim, pose)  # the true outline, whose area's centroid is what is measured
    a, b = seen, np.roll(seen, -1, axis=1)
    cross = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    centroid = ((a + b) * cross[..., None]).sum(axis=1) / (3 * cross.sum(axis=1))[:, None]
    J = np.tile([[0.5, 0.0], [0.0, 2.0]], (12, 1, 1))
    none = np.zeros((12, 2))
    cov = np.tile(np.eye(2) * 1e-4, (12, 1, 1))
    targets = TargetSet("", row, col, centroid, cov, none, none, none, np.full(12, 15.0), gradient=J)
    found = recentred(targets, field, spec, interior, pose)
    truth = project(spec, interior, field.xyz_mm, pose)
    assert np.abs(centroid - truth).max() > 0.01
    assert np.abs(found.camera_uv - truth).max() < 1e-5
    assert np.allclose(found.projector_uv, (found.camera_uv - centroid) * [0.5, 2.0])
