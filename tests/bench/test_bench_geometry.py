"""Where things appear: axes, exact places on a wall, truth maps, spheres, blocks and shadows, circles."""

from dataclasses import replace

import numpy as np
import pytest

from core.bench import Block, Scene, Sphere, experiment, prepare, true_targets, truth_maps
from core.geometry import Pose, project, ray_directions
from core.patterns import Line


def test_a_wall_maps_to_exact_coordinates(ideal_rig, wall):
    truth = truth_maps(ideal_rig, wall)
    u, v = np.meshgrid(np.arange(120.0), np.arange(80.0))
    # x = 500 / 10 · 0.02 mm per pixel = 1 mm; the projector stands 100 mm to the right and has 1 mm per line
    lit = truth.lit
    expected_u, expected_v = (u - 59.5) - 100 + 47.5, (v - 39.5) + 31.5
    np.testing.assert_array_equal(
        lit, (expected_u > -0.5) & (expected_u < 95.5) & (expected_v > -0.5) & (expected_v < 63.5)
    )
    np.testing.assert_allclose(truth.u[lit], expected_u[lit], atol=1e-9)
    np.testing.assert_allclose(truth.v[lit], expected_v[lit], atol=1e-9)
    np.testing.assert_allclose(truth.xyz_mm[39, 60], [0.5, 0.5, -500.0], atol=1e-9)


def test_u_runs_right_and_v_down_in_camera_and_projector(ideal_rig, wall):
    rig = replace(ideal_rig, projector_from_camera=Pose())  # both at one place
    truth = truth_maps(rig, wall)
    assert np.all(np.diff(truth.u[40, 15:105]) > 0)
    assert np.all(np.diff(truth.v[10:70, 60]) > 0)
    assert truth.xyz_mm[40, 100, 0] > truth.xyz_mm[40, 20, 0]  # x right
    assert truth.xyz_mm[10, 60, 1] > truth.xyz_mm[70, 60, 1]  # y up
    prepared = prepare(rig, wall)
    column, row = prepared.frame(Line("x", 5)), prepared.frame(Line("y", 5))
    # camera pixel = projector line + 12 (columns) or + 8 (rows): the middles coincide
    assert np.argmax(column[40]) == 17
    assert np.argmax(row[:, 60]) == 13


def test_the_image_agrees_with_the_truth_map(ideal_rig):
    """Four sine steps of a noise-free tilted plane give the true coordinate."""
    e = experiment("paper")
    shot = e.shot("plane-15")
    rig = replace(e.rig, sensor=replace(e.rig.sensor, jitter_px=0.0))
    prepared, truth = prepare(rig, shot.scene), truth_maps(rig, shot.scene)
    for axis, true in (("x", truth.u), ("y", truth.v)):
        phases = [p for p in shot.patterns if p.kind == "phase" and p.axis == axis]
        total = np.zeros(true.shape, complex)
        for p in phases:
            lines = (p_columns(p, 640), np.zeros(640)) if axis == "x" else (np.zeros(640), p_columns(p, 640))
            total += prepared.light(*lines) * np.exp(1j * p.shift_rad)
        decoded = np.angle(total) * 4 / (2 * np.pi) - 0.5
        inner = truth.lit & (true > 5) & (true < 634) & (np.minimum(truth.u, truth.v) > 5)
        error = ((decoded - true + 2) % 4 - 2)[inner & (np.maximum(truth.u, truth.v) < 634)]
        # the noise of the scenario is 0.036 line; the harmonics that blur leaves and perspective stay far below
        assert np.sqrt(np.mean(error**2)) < 0.001
        assert np.abs(error).max() < 0.005


def p_columns(pattern, n):
    return (np.cos(2 * np.pi * (np.arange(n) + 0.5) / 4 - pattern.shift_rad) > 0).astype(float)


def test_truth_on_a_sphere_and_its_shadow(ideal_rig, wall):
    sphere = Sphere((-40.0, 0.0, 20.0), 15.0)
    scene = replace(wall, spheres=(sphere,))
    near = replace(ideal_rig, projector_from_camera=Pose(np.eye(3), np.array([-40.0, 0.0, 0.0])))
    truth = truth_maps(near, scene)
    board = scene.camera_from_board.inverse().apply(truth.xyz_mm)
    distance = np.linalg.norm(board - sphere.centre_mm, axis=-1)
    on_sphere = np.abs(distance - 15) < 1e-6
    assert on_sphere.sum() > 200
    np.testing.assert_allclose(board[~on_sphere][:, 2], 0.0, atol=1e-9)
    # a point is dark exactly where the line to the projector passes the sphere: marched with small steps
    lamp = (near.projector_from_camera @ scene.camera_from_board).origin_mm
    steps = np.linspace(1e-3, 0.2, 2000)
    wrong = 0
    for i in range(22, 58, 3):
        for j in range(2, 40):
            p = board[i, j]
            path = p + steps[:, None] * (lamp - p)
            hidden = bool(np.any(np.linalg.norm(path - sphere.centre_mm, axis=1) < 15 - 1e-3))
            within = bool(truth.gain[i, j] > 0)
            uv = project(
                near.projector, near.projector_interior, p, near.projector_from_camera @ scene.camera_from_board
            )
            inside = bool(np.all((uv > -0.5) & (uv < [95.5, 63.5])))
            wrong += within != (inside and not hidden)
    assert wrong <= 2  # grazing rays


def test_a_block_stands_on_the_board_and_shades_it(ideal_rig, wall):
    near = replace(ideal_rig, projector_from_camera=Pose(np.eye(3), np.array([-40.0, 0.0, 0.0])))
    scene = replace(wall, blocks=(Block((0.0, -20.0, 0.0), (20.0, 20.0, 10.0)),))
    truth = truth_maps(near, scene)
    assert truth.xyz_mm[39, 70, 2] == pytest.approx(-490.0)  # on top, at x = 10
    assert truth.lit[39, 70]
    # light from x = 40 passes the edge at x = 0, z = 10 and reaches the board at x = -40 · 10 / 490 = -0.82
    assert not truth.lit[39, 59]
    assert truth.lit[39, 57]


def test_targets_appear_where_they_are_computed(ideal_rig):
    e = experiment("paper")
    shot = e.shot("testfield-06")
    rig, scene = e.rig, shot.scene
    image = np.asarray(prepare(rig, scene).room, np.float64)
    uv = np.stack(np.meshgrid(np.arange(748.0), np.arange(576.0)), axis=-1)
    rays = ray_directions(rig.camera, rig.camera_interior, uv)
    image *= (rays[..., 0] ** 2 + rays[..., 1] ** 2 + 1) ** 2  # the falloff would pull the centroids
    true, made = true_targets(rig, scene), scene.board.targets
    angle = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    rim = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    error = []
    for k in np.flatnonzero(true.visible)[::4]:
        p = project(rig.camera, rig.camera_interior, made.xyz_mm[k] + 2.5 * rim, scene.camera_from_board)
        cross = p[:, 0] * np.roll(p[:, 1], -1) - np.roll(p[:, 0], -1) * p[:, 1]
        centroid = ((p + np.roll(p, -1, 0)) * cross[:, None]).sum(0) / (3 * cross.sum())
        (u0, v0), (u1, v1) = np.floor(p.min(0)).astype(int) - 4, np.ceil(p.max(0)).astype(int) + 5
        window = image[v0:v1, u0:u1] - image[v0, u0]
        v, u = np.mgrid[v0:v1, u0:u1]
        error.append([(window * u).sum() / window.sum() - centroid[0], (window * v).sum() / window.sum() - centroid[1]])
    # measuring is to reach 0.02 px: the bench must be far better
    assert np.sqrt(np.mean(np.square(error))) < 0.002


def test_a_target_is_visible_only_if_all_of_it_is_seen_and_lit(ideal_rig):
    e = experiment("paper")
    scene = e.shot("testfield-03").scene
    t = true_targets(e.rig, scene)
    for uv, spec in ((t.camera_uv, e.rig.camera), (t.projector_uv, e.rig.projector)):
        inside = np.all((uv > 0) & (uv < [spec.width - 1, spec.height - 1]), axis=1)
        assert not np.any(t.visible & ~inside)
    dark = Scene(scene.board, Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, -600.0])))
    assert not true_targets(e.rig, dark).visible.any()  # the board's back
