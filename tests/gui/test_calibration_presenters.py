"""Coverage, correlations, sigmas and contributions against closed forms; no window is needed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.geometry import Pose, matrix_from_axis_angle, project
from core.measure import predicted_view
from core.model import Adjustment, DeviceSpec, Interior, Seed, Testfield
from core.pipeline import CalibrateOptions
from core.project import load_archive
from core.report.adjusted import correlations, covered, point_sigmas
from stripe_gui.presenters.runs import options_words

CAMERA = DeviceSpec(748, 576, (0.008, 0.008), 12.0)


def test_the_hull_of_a_grid_is_its_rectangle() -> None:
    u, v = (x.ravel() for x in np.meshgrid(np.linspace(100, 500, 9), np.linspace(50, 350, 7)))
    found = covered("camera", (800, 600), np.stack([u, v], axis=1))
    assert found.hull_share == pytest.approx(400 * 300 / (800 * 600))
    assert found.counts.sum() == 63
    assert len(found.hull) == 5


def test_the_hull_of_many_points_in_a_circle_is_the_circle() -> None:
    angle = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    ring = 400 + 200 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inside = np.random.default_rng(0).uniform(300, 500, (500, 2))
    found = covered("camera", (800, 800), np.concatenate([ring, inside]))
    assert found.hull_share == pytest.approx(np.pi * 200**2 / 800**2, rel=1e-4)  # of 720 corners: 1 - 1.3e-5


@pytest.mark.parametrize("points", [np.zeros((0, 2)), np.array([[5.0, 5.0]]), np.array([[1.0, 1], [2, 2], [3, 3]])])
def test_points_on_a_line_cover_nothing(points) -> None:
    assert covered("camera", (100, 100), points).hull_share == 0.0


def test_every_point_is_counted_in_its_cell() -> None:
    found = covered("projector", (120, 60), np.array([[0.0, 0.0], [9.4, 9.4], [9.6, 0.0], [119.0, 59.0]]))
    assert found.counts.shape == (6, 12)  # square cells, twelve along the longer side
    assert found.counts[0, 0] == 2
    assert found.counts[0, 1] == 1
    assert found.counts[5, 11] == 1
    assert found.map().shape == (60, 120)
    assert found.map()[9, 9] == 2
    assert found.filled == pytest.approx(3 / 72)


def test_correlations_are_those_of_the_covariance_without_held_parameters(finished: Path) -> None:
    adjustment = load_archive(finished / "results" / "runs" / "0001" / "adjustment.npz", Adjustment)
    covariance = np.array([[4.0, 0.0, -3.0], [0.0, 0.0, 0.0], [-3.0, 0.0, 9.0]])
    made = replace(adjustment, parameter_names=("camera.c", "camera.A3", "camera.x0"), parameter_cov=covariance)
    found = correlations(made)
    assert found.names == ("camera.c", "camera.x0")
    assert found.values == pytest.approx(np.array([[1.0, -0.5], [-0.5, 1.0]]))
    assert found.strongest() == [("camera.c", "camera.x0", pytest.approx(-0.5))]
    assert found.describe(0, 1) == "camera.c, camera.x0: -0.500"


def test_sigmas_of_points_are_the_roots_of_their_variances(finished: Path) -> None:
    adjustment = load_archive(finished / "results" / "runs" / "0001" / "adjustment.npz", Adjustment)
    count = len(adjustment.points_mm)
    cov = np.broadcast_to(np.diag([4e-6, 9e-6, 36e-6]), (count, 3, 3))
    found = point_sigmas(replace(adjustment, point_cov_mm2=cov))
    assert found.sigma_um[0] == pytest.approx([2.0, 3.0, 6.0])
    assert found.of("Z")[0] == pytest.approx(6.0)
    assert found.of("XYZ")[0] == pytest.approx(7.0)
    assert found.images.sum() == len(adjustment.residuals)


@pytest.mark.parametrize(("roll", "tilt"), [(0, 5), (90, 30), (-90, 20), (180, 40), (37, 25)])
@pytest.mark.parametrize("back", [False, True])
def test_roll_and_tilt_of_a_board_follow_from_four_picks(roll: float, tilt: float, back: bool) -> None:
    row, col = (x.ravel() for x in np.mgrid[0:7, 0:9])
    down = -1.0 if back else 1.0  # the nominal frame of a board seen from its back has y down and z away
    xyz = np.stack([20.0 * col, down * 20.0 * row, 0.0 * row], axis=1)
    field = Testfield(row, col, xyz, np.full(63, 6.0))
    towards = matrix_from_axis_angle([0, 0, 1], np.radians(roll)) @ matrix_from_axis_angle([0, 1, 0], np.radians(tilt))
    R = towards @ (np.diag([1.0, -1.0, -1.0]) if back else np.eye(3))
    pose = Pose(R, np.array([0.0, 0.0, -600.0]) - R @ xyz.mean(axis=0))
    corners = [0, 8, 54, 62]
    uv = project(CAMERA, Interior(12.0), xyz[corners], pose)
    seeds = tuple(Seed(int(row[i]), int(col[i]), *map(float, p)) for i, p in zip(corners, uv, strict=True))
    found = predicted_view(field, CAMERA, seeds).angles_deg
    assert abs((found[0] - roll + 180) % 360 - 180) < 0.01
    assert found[1] == pytest.approx(tilt, abs=0.01)


def test_unusual_options_are_told_usual_ones_are_not() -> None:
    both = ("photogrammetric", "polynomial")
    assert options_words(CalibrateOptions(), both) == "rigid rig; degree 3"
    chosen = CalibrateOptions(False, None, 0.0, ("testfield-04",), ("camera.A5",), None)
    assert options_words(chosen, both) == (
        "free stations; held: camera.A5; gross errors kept; depth table; low-pass 0 px; without testfield-04"
    )
