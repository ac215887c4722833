"""One capture measured from the window: its targets join those of the others, and exclusions take them out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from core.errors import InputError
from core.pipeline import calibrate_project, measure_project
from core.pipeline.picking import current_target_sets, measure_one
from core.project import read_picks, read_project, write_picks


def picks_of(folder: Path, name: str) -> Path:
    return folder / "captures" / name / "picks.json"


def test_captures_measured_one_by_one_are_those_measured_together(quick: Path, edit_json) -> None:
    few = ("testfield-01", "testfield-02", "testfield-03", "depth-03")
    edit_json(quick / "project.json", captures=[f"captures/{name}" for name in few])
    project = read_project(quick)
    together = {t.capture: t for t in measure_project(project)}
    (quick / "results" / "targets.npz").unlink()
    for name in ("testfield-02", "depth-03", "testfield-01"):
        measure_one(project, name)
    kept = {t.capture: t for t in current_target_sets(project)}
    assert list(kept) == ["testfield-01", "testfield-02", "depth-03"]
    for name, targets in kept.items():
        np.testing.assert_array_equal(targets.camera_uv, together[name].camera_uv)
        assert targets.made_from == together[name].made_from


def test_kept_targets_whose_picks_have_changed_are_dropped(quick: Path) -> None:
    project = read_project(quick)
    measure_one(project, "testfield-01")
    measure_one(project, "testfield-02")
    path = picks_of(quick, "testfield-01")
    write_picks(path, read_picks(path)[0], [(3, 3)])
    assert [t.capture for t in current_target_sets(project)] == ["testfield-02"]
    measure_one(project, "testfield-03")
    assert [t.capture for t in current_target_sets(project)] == ["testfield-02", "testfield-03"]


def test_an_excluded_target_is_missing_with_its_reason_and_comes_back(quick: Path) -> None:
    project, path = read_project(quick), picks_of(quick, "testfield-01")
    seeds, _ = read_picks(path)
    before = measure_one(project, "testfield-01")
    gone = ((3, 3), (seeds[0].row, seeds[0].col))  # a pick may be excluded: it still says who is who
    write_picks(path, seeds, gone)
    without = measure_one(project, "testfield-01")
    assert {(m.row, m.col): m.reason for m in without.missing} == dict.fromkeys(gone, "excluded by the operator")
    left = [key not in gone for key in zip(before.row.tolist(), before.col.tolist(), strict=True)]
    assert len(without.row) == len(before.row) - 2
    # the light's gradient and the eccentricity's view are fitted to the rest: thousandths of a pixel
    np.testing.assert_allclose(without.camera_uv, before.camera_uv[left], atol=2e-3)
    write_picks(path, seeds)
    np.testing.assert_array_equal(measure_one(project, "testfield-01").camera_uv, before.camera_uv)


def test_an_excluded_target_takes_no_part_in_the_calibration(calibrated: Path) -> None:
    project = read_project(calibrated)
    for name in ("testfield-01", "testfield-05"):
        path = picks_of(calibrated, name)
        write_picks(path, read_picks(path)[0], [(3, 3)])
    calibration = calibrate_project(project, "photogrammetric")["photogrammetric"]
    seen = sum(len(measure_one(project, f"testfield-{i:02d}").row) for i in range(1, 9))
    assert calibration.camera.image_points == seen


def test_an_unknown_excluded_target_is_refused_and_nothing_changes(quick: Path) -> None:
    project, path = read_project(quick), picks_of(quick, "testfield-01")
    measure_one(project, "testfield-02")
    write_picks(path, read_picks(path)[0], [(3, 99)])
    with pytest.raises(InputError, match="excluded has row 3, col 99"):
        measure_one(project, "testfield-01")
    assert [t.capture for t in current_target_sets(project)] == ["testfield-02"]


def test_a_capture_without_picks_is_refused(quick: Path) -> None:
    picks_of(quick, "testfield-01").unlink()
    with pytest.raises(InputError, match=r"testfield-01.*no picks"):
        measure_one(read_project(quick), "testfield-01")


def test_frames_of_another_capture_are_named_before_picks_that_do_not_fit(calibrated: Path) -> None:
    here, other = (calibrated / "captures" / name for name in ("testfield-03", "testfield-05"))
    for k in range(12, 24):
        file = here / f"{k:03d}.png"
        file.unlink()  # which may be the same file as that of another copy
        file.write_bytes((other / file.name).read_bytes())
    with pytest.raises(
        InputError, match=r"testfield-03/picks.json: .* First see to this: testfield-03: 012\.png, .*in testfield-05"
    ):
        measure_project(read_project(calibrated))
