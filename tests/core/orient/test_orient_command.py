"""`stripe-core orient` on the virtual bench: a projector that was knocked after its calibration."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from core.bench.experiment import Experiment
from core.bench.scenarios import experiment
from core.cli import main
from core.model import Subject
from core.pipeline.orient import drift_of
from core.pipeline.report import report_data
from core.project import read_project
from core.report.chapters import CHAPTERS, tables
from tests.captures import write_capture


@pytest.fixture(scope="module")
def bench() -> Experiment:
    return experiment("quick", seed=3)  # as the project of the fixtures


def run(*arguments: object, tmp_path: Path) -> dict[str, Any]:
    out = tmp_path / "figures.json"
    assert main([*(str(a) for a in arguments), "--json", str(out)]) == 0
    return json.loads(out.read_text())


def knocked(bench: Experiment, project: Path) -> Path:
    """A plane captured after the projector was knocked."""
    folder = project / "captures" / "knocked"
    frames = bench.take(bench.shot("plane+15"), ["knocked"])
    write_capture(folder, Subject("plane", angle_deg=15.0), frames)
    return folder


def plane_error_mm(cloud: Path, truth: list[float]) -> float:
    xyz = np.load(cloud)["xyz"]
    points = xyz[np.isfinite(xyz).all(axis=-1)]
    return float(np.median(points @ truth[:3] - truth[3]))


def test_a_knocked_projector_is_told_and_depth_is_corrected(
    calibrated: Path, bench: Experiment, tmp_path: Path, quick_truth: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = knocked(bench, calibrated)
    still = run("orient", calibrated, "plane+15", tmp_path=tmp_path)
    assert not still["moved"]
    found = run("orient", calibrated, folder, "--correct", tmp_path=tmp_path)
    assert found["moved"]
    assert found["p"] < 1e-6
    assert "the projector has moved" in capsys.readouterr().out
    turn = np.abs(np.array(found["rotation_urad"]) - [200, 300, 150])
    assert (turn < 5 * np.array(found["sigma_urad"])).all()  # three normal deviates, and a bench that is not a formula
    assert found["unobserved"] == ["base length", "c"]
    true_plane = quick_truth["captures"]["plane+15"]["plane"]
    errors = []
    for options in ([], ["--orient"]):
        out = tmp_path / f"points{len(options)}.npz"
        assert main(["reconstruct", str(calibrated), str(folder), "--out", str(out), *options]) == 0
        errors.append(abs(plane_error_mm(out, true_plane)))
    assert errors[0] > 0.3  # 0.3 mrad about Y alone is 0.5 mm of depth at 600 mm and a base of 250 mm
    # a single plane and the small rig's calibration show the pan poorly, and the figures say so
    assert errors[1] < 3 * found["depth_sigma_mm"] < 3.0


def test_a_capture_without_board_has_no_targets(calibrated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for known in (["--length", "targets", "0,0", "1,1", "5", "0.1"], ["--points"]):
        assert main(["orient", str(calibrated), "plane+15", *known]) == 2
        assert "plane+15: shows no testfield; take a capture of role testfield" in capsys.readouterr().err


def test_a_point_twice_in_a_table_is_refused(
    calibrated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "known.csv"
    table.write_text("point,x_mm,y_mm,z_mm\n0/0,0,0,0\n0/1,9,0,0\n0/0,1,0,0\n")
    assert main(["orient", str(calibrated), "testfield-02", "--points", str(table)]) == 2
    assert "known.csv: line 4: point '0/0' is there already" in capsys.readouterr().err


def test_a_board_that_nobody_picked_lies_as_the_calibration_has_it(calibrated: Path, tmp_path: Path) -> None:
    picked = calibrated / "captures" / "testfield-02"
    alone = shutil.copytree(picked, tmp_path / "alone", ignore=shutil.ignore_patterns("picks.json"))
    one, other = (run("orient", calibrated, folder, "--points", tmp_path=tmp_path) for folder in (picked, alone))
    assert one["points"] == other["points"] > 40
    assert other["rotation_urad"] == pytest.approx(one["rotation_urad"])


def test_what_captures_show_is_kept_for_the_chart_and_the_report(calibrated: Path, tmp_path: Path) -> None:
    for name in ("plane+00", "plane+15"):
        run("orient", calibrated, name, tmp_path=tmp_path)
    project = read_project(calibrated)
    (chart,) = drift_of(project, kept=True).values()
    assert [point.capture for point in chart] == ["plane+00", "plane+15"]
    assert "action" not in {point.state for point in chart}
    # what the calibration leaves uncertain is the same in both: another plane of the same rig is foretold better
    assert (chart[1].sigma < chart[0].sigma).all()
    data = report_data(project, ())
    assert [table.title for table in tables(data)][-1].startswith("Control chart")
    assert [drawing.key for drawing in CHAPTERS["drift"].drawings[0](data)] == ["drift-camera-projector"]
    assert main(["calibrate", str(calibrated), "--method", "photogrammetric", "--without", "testfield-08"]) == 0
    assert not drift_of(project, kept=True)


def test_a_correction_by_other_frames_is_refused(
    calibrated: Path, bench: Experiment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """New frames in the folder show another pose, and where they show none the correction before stayed in use."""
    folder = knocked(bench, calibrated)
    command = ["reconstruct", str(calibrated), str(folder), "--orient", "--out", str(tmp_path / "points.npz")]
    assert main(["orient", str(calibrated), str(folder), "--correct"]) == 0
    assert main(command) == 0
    nowhere = ["--length", "points", "3,3,2", "9,3,2", "5", "0.1"]
    assert main(["orient", str(calibrated), str(folder), "--correct", *nowhere]) == 2
    kept = calibrated / "results" / "orientations" / f"{folder.name}.npz"
    told = f"(the earlier correction stays in use for --orient: delete {kept} to be rid of it); "
    assert told in capsys.readouterr().err
    for frame in json.loads((folder / "capture.json").read_text())["frames"]:
        image = cv2.imread(str(folder / frame["file"]), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(folder / frame["file"]), np.full_like(image, 20))
    assert main(["orient", str(calibrated), str(folder), "--correct"]) == 2
    assert "stays in use" not in capsys.readouterr().err
    assert main(command) == 2
    assert "from other frames; run `stripe-core orient" in capsys.readouterr().err


def test_a_correction_of_another_calibration_is_refused(
    calibrated: Path, bench: Experiment, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = knocked(bench, calibrated)
    points = tmp_path / "points.npz"
    command = ["reconstruct", str(calibrated), str(folder), "--orient", "--out", str(points)]
    assert main(command) == 2
    assert "orient" in capsys.readouterr().err
    assert main(["orient", str(calibrated), str(folder), "--correct"]) == 0
    assert main(["calibrate", str(calibrated), "--method", "photogrammetric", "--without", "testfield-08"]) == 0
    assert main(command) == 2
    assert "another calibration" in capsys.readouterr().err
    assert not points.exists()
