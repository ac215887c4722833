"""Views of one object from several stations, in closed form: poses and joined points against truth."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.api import merge_phases
from core.bench import experiment
from core.cli import main
from core.errors import InputError
from core.geometry import Pose, rotation_vector_from_matrix
from core.numerics import chi_square_limit
from core.orient import View, apart, register, starts_of
from core.pipeline.report import report_data
from core.project import read_project
from core.reconstruct import at_stations, joined, reconstruct
from core.report.chapters import tables
from tests.core.orient.views import Observed, calibration, draw, observe, relief, station

FOUND = calibration()
STATIONS = (station((0, 0, 0)), station((8, 25, 3)), station((-10, -20, 60)))


def views_of(seen: Sequence[Observed], marked: bool = True) -> list[View]:
    clouds = [reconstruct(one.phase, FOUND) for one in seen]
    return [
        View(one.phase, cloud, one.targets if marked else None, f"view {k}")
        for k, (one, cloud) in enumerate(zip(seen, clouds, strict=True))
    ]


def error(found: Pose, true: Pose) -> np.ndarray:
    turn = rotation_vector_from_matrix(found.rotation @ true.rotation.T)
    return np.concatenate([turn, found.translation_mm - true.translation_mm])


def test_poses_and_joined_points_are_as_good_as_they_say() -> None:
    """Six rigs that the calibration may have come from, two stations each.

    Errors of poses against their covariance: limits of chi-square of 36, one in a thousand either way. Points of one
    rig share its errors, some five directions a rig, so that the mean of six scatters by 0.18: three of these. Of
    100 rigs and three stations poses come to 0.95 ± 0.10 and points to 1.01 ± 0.08.
    """
    true_pose = STATIONS[1] @ STATIONS[0].inverse()
    rng, squares, points = np.random.default_rng(11), [], []
    for _ in range(6):
        rig = draw(FOUND, rng)
        seen = [observe(rig, pose, rng) for pose in STATIONS[:2]]
        views = views_of(seen)
        found = register(views, FOUND, [Pose(), true_pose.changed(np.array([4e-3, -3e-3, 4e-3, 0.8, -0.6, 0.9]))])
        spread = found.covariance + found.by_calibration @ FOUND.covariance @ found.by_calibration.T
        off = error(found.poses[1], true_pose)
        squares.append(off @ np.linalg.solve(spread, off))
        assert all(overlap.misfit < 1.2 for overlap in found.overlaps)
        cloud, _, sources = joined([[one.phase] for one in seen], found.captures, at_stations(FOUND, found, "camera"))
        kept = [np.isfinite(view.cloud.xyz_mm[..., 2]) for view in views]
        assert [name for _, name in sources] == ["view 0", "view 1", "view 0 + view 1"]
        alone, other, both = np.bincount(cloud.source.ravel())
        assert alone + both == kept[0].sum()  # each place once, from the first that sees it
        assert other < 0.1 * kept[1].sum()  # beside what the first sees
        first = cloud.source[0] != 1
        error_mm = cloud.xyz_mm[0][first] - STATIONS[0].apply(seen[0].truth[kept[0]])
        points.append(np.mean((error_mm / cloud.sigma_mm[0][first]) ** 2))
    assert 15.3 < sum(squares) < chi_square_limit(36, 1e-3)
    assert np.sqrt(np.mean(points)) == pytest.approx(1.0, abs=0.54)


def test_an_object_that_moved_against_its_board_is_told() -> None:
    """Targets and surface each fit to their noise, and their poses were the mean of both, in no doubt."""
    rng = np.random.default_rng(4)
    rig, pose = draw(FOUND, rng), STATIONS[1] @ STATIONS[0].inverse()
    first, second = (observe(rig, each, rng) for each in STATIONS[:2])
    aside = STATIONS[1] @ Pose(np.eye(3), np.array([0.6, -0.8, 0.0]))
    for board, off in ((second, None), (observe(rig, aside, rng), 1.0)):
        for by in ("targets", "both"):
            views = views_of([first, replace(second, targets=board.targets)])
            told = apart(views, FOUND, register(views, FOUND, [Pose(), pose], by=by))
            assert list(told) == ([] if off is None else ["view 1"])
            assert all(mm == pytest.approx(off, abs=4 * sigma) and sigma < 0.1 for mm, sigma in told.values())


def test_views_are_joined_by_a_calibration_without_sigmas() -> None:
    """As imports of other programs are: the poses alone are uncertain then."""
    rng, known = np.random.default_rng(2), replace(FOUND, covariance=np.zeros_like(FOUND.covariance))
    views = views_of([observe(FOUND, pose, rng) for pose in STATIONS[:2]])
    found = register(views, known, [Pose(), STATIONS[1] @ STATIONS[0].inverse()])
    cloud, *_ = joined([[view.phase] for view in views], found.captures, at_stations(known, found, "camera"))
    ratio = np.linalg.norm(cloud.sigma_mm, axis=-1) / cloud.sigma_depth_mm  # along the ray, and the second pose's
    assert 0.99 < ratio.min() <= ratio.max() < 3


def test_three_views_hold_one_another() -> None:
    """Noise alone, of the surface alone: 24 sums of six squares, at one in a thousand. Means have less of it."""
    rng, squares = np.random.default_rng(3), []
    exact = replace(FOUND, covariance=np.zeros_like(FOUND.covariance))
    true = [pose @ STATIONS[0].inverse() for pose in STATIONS]
    for _ in range(4):
        seen = [observe(draw(exact, rng), pose, rng) for pose in STATIONS]
        found = register(views_of(seen), exact, true, by="surface")
        off = np.concatenate([error(a, b) for a, b in zip(found.poses[1:], true[1:], strict=True)])
        squares.append(off @ np.linalg.solve(found.covariance, off))
    sure = at_stations(replace(FOUND, covariance=1e-8 * FOUND.covariance), found, "camera")
    cloud, _, sources = joined([[one.phase] for one in seen], found.captures, sure)
    (all_three,) = [k for k, (_, name) in enumerate(sources) if name.count("view") == 3]
    by_three = cloud.source[0] == all_three
    truth = STATIONS[0].apply(seen[0].truth[np.isfinite(seen[0].truth[..., 2])])
    error_mm = (cloud.xyz_mm[0][: len(truth)] - truth)[by_three[: len(truth)], 2]
    sigma = cloud.sigma_depth_mm[0][by_three]
    assert np.sqrt(np.mean((error_mm / sigma) ** 2)) == pytest.approx(1.0, abs=0.15)  # poses, bent surfaces: 1.06
    alone = reconstruct(seen[0].phase, exact).sigma_depth_mm
    assert np.sqrt(np.mean(sigma**2)) < 0.65 * np.sqrt(np.nanmean(alone**2))  # 1 / sqrt 3 of alike views
    assert 48 * 0.4 < sum(squares) < chi_square_limit(48, 1e-3)  # by tiles, noise is a little overestimated


def test_views_find_each_other_by_targets_and_by_what_they_show() -> None:
    rng = np.random.default_rng(5)
    near, beside, far = station((3, 9, 2)), station((4, 38, 15)), STATIONS[2]
    for pose, marked, within_mm in ((far, True, 2.0), (near, False, 2.0), (beside, False, 2.0)):
        seen = [observe(draw(FOUND, rng), one, rng) for one in (STATIONS[0], pose)]
        start = starts_of(views_of(seen, marked), FOUND)[1]
        true = pose @ STATIONS[0].inverse()
        middle = np.array([0.0, 0.0, -600.0])
        assert np.linalg.norm(start.apply(middle) - true.apply(middle)) < within_mm


def test_a_turned_object_is_joined_from_arrays() -> None:
    """No targets, 35 degrees between the first two and 70 to the third; sigmas as `views.calibration` draws them."""
    rng, turns = np.random.default_rng(8), (0, 35, 70)
    rig = draw(FOUND, rng)
    seen = [observe(rig, station((5, turn, 0)), rng) for turn in turns]
    cloud, made_by, found = merge_phases([one.phase for one in seen], FOUND)
    spread = found.sigmas(FOUND.covariance)
    for pose, sigma, turn in zip(found.poses[1:], spread, turns[1:], strict=True):
        off = error(pose, station((5, turn, 0)) @ station((5, 0, 0)).inverse())
        assert np.abs(off / sigma).max() < 4.0  # twelve normal deviates: one in 1,300
    assert {"0", "0 + 1"} < set(made_by)
    X = station((5, 0, 0)).inverse().apply(cloud.xyz_mm[0].astype(float))
    assert np.sqrt(np.mean((X[:, 2] - relief(*X[:, :2].T)) ** 2)) < 3 * np.sqrt(np.mean(cloud.sigma_mm**2))
    with pytest.raises(InputError, match="1 phase maps"):
        merge_phases([seen[0].phase], FOUND)


def test_nothing_in_common_and_surfaces_that_slide_are_refused() -> None:
    rng = np.random.default_rng(6)
    rig, true = draw(FOUND, rng), STATIONS[1] @ STATIONS[0].inverse()
    flat = views_of([observe(rig, pose, rng, lambda x, _y: 0 * x) for pose in STATIONS[:2]])
    with pytest.raises(InputError, match="view 1: could slide along"):
        register(flat, FOUND, [Pose(), true], by="surface")
    far = Pose(np.eye(3), np.array([400.0, 0.0, 0.0]))
    with pytest.raises(InputError, match="sees nothing that the others see"):
        register(views_of([observe(rig, pose, rng) for pose in STATIONS[:2]], marked=False), FOUND, [Pose(), far])
    blank = [replace(view, phase=replace(view.phase, image=np.ones_like(view.phase.image))) for view in flat]
    with pytest.raises(InputError, match="view 1: shares neither 3 targets nor"):
        starts_of([replace(view, targets=None) for view in blank], FOUND)


def test_captures_of_a_project_are_merged_by_a_command(calibrated: Path) -> None:
    """The bench's board at two places; its centroids are worse than they say, by 1.4, and five sigmas are asked for."""
    names = ["testfield-01", "testfield-05"]
    out, said = calibrated / "merged.npz", calibrated / "merged.json"
    assert main(["merge", str(calibrated), *names, "--by", "targets", "--out", str(out), "--json", str(said)]) == 0
    (view,) = json.loads(said.read_text())["views"]
    first, second = (experiment("quick", 3).shot(name).scene.camera_from_board for name in names)
    off = error(Pose(np.array(view["rotation"]), np.array(view["translation_mm"])), second @ first.inverse())
    sigma = np.array([*np.array(view["sigma_rotation_urad"]) * 1e-6, *view["sigma_translation_mm"]])
    assert np.abs(off / sigma).max() < 1.4 * 5
    (table,) = [t for t in tables(report_data(read_project(calibrated), ())) if t.title.startswith("Captures merged")]
    assert [row[0] for row in table.rows] == names[1:]
    with np.load(out) as stored:
        points, source = stored["xyz"][0].astype(float), stored["source"][0]
    on_board = first.inverse().apply(points)
    alone = [source == k for k in (0, 1)]  # the third kind is of both
    assert set(source) == {0, 1, 2}
    assert abs(np.median(on_board[alone[1], 2]) - np.median(on_board[alone[0], 2])) < 0.3  # sigma is 0.08
    assert main(["merge", str(calibrated), names[0], "--out", str(out)]) == 2
