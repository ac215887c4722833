"""Guesses of picks, profiles, tables, kept runs and the sign-off from the command line, without a window."""

from __future__ import annotations

import csv
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from core.cli import main
from core.evaluate import line_across
from core.geometry import Pose, project
from core.model import Interior, PointCloud
from core.pipeline import evaluate_project, load_calibrations, project_states, update_project
from core.pipeline.evaluate import load_evaluation
from core.pipeline.judge import bend_rms
from core.pipeline.signed import load_sign_off
from core.project import read_capture, read_project
from core.project.made import FILE as MADE
from tests.copies import copied

NEAR_PX = 3.0  # dots of the small rig are about 20 px apart


@pytest.fixture(scope="session")
def evaluated_original(calibrated_original: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = copied(calibrated_original, tmp_path_factory.mktemp("evaluated") / "quick")
    evaluate_project(read_project(folder))
    return folder


@pytest.fixture
def evaluated(evaluated_original: Path, tmp_path: Path) -> Path:
    return copied(evaluated_original, tmp_path / "evaluated")


def figures(tmp_path: Path, *arguments: str | Path) -> dict[str, Any]:
    """Run a command; give what it writes as JSON."""
    out = tmp_path / "figures.json"
    assert main([*map(str, arguments), "--json", str(out)]) == 0
    return json.loads(out.read_text())


def rows_of(path: Path) -> list[dict[str, str]]:
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    return list(csv.DictReader(line for line in lines if not line.startswith("#")))


def true_places(folder: Path, truth: dict[str, Any], capture: str, board: str) -> dict[tuple[int, int], np.ndarray]:
    """Where the camera truly sees the targets of a board, in px."""
    pose, camera = truth["captures"][capture]["camera_from_board"], truth["camera"]
    additional = tuple(camera[f"A{i}"] for i in range(1, 7))
    interior = Interior(camera["c_mm"], camera["x0_mm"], camera["y0_mm"], additional, camera["r0_mm"])
    targets = truth["testfields"][board]
    placed = Pose(np.array(pose["rotation"]), np.array(pose["translation_mm"]))
    places = project(read_project(folder).camera, interior, np.array([t["xyz_mm"] for t in targets]), placed)
    return {(t["row"], t["col"]): uv for t, uv in zip(targets, places, strict=True)}


def test_a_guess_names_dots_that_are_there_and_can_be_kept(quick: Path, quick_truth, tmp_path: Path) -> None:
    """One of the guesses is the truth: a regular board allows some, such as half a turn."""
    (quick / "captures" / "testfield-02" / "picks.json").unlink()
    found = figures(tmp_path, "guess-picks", quick)
    assert list(found["captures"]) == ["testfield-02"]
    at = true_places(quick, quick_truth, "testfield-02", "testfield.csv")
    right = [
        all(np.hypot(*(at[s["row"], s["col"]] - (s["u"], s["v"]))) < NEAR_PX for s in guess)
        for guess in found["captures"]["testfield-02"]
    ]
    assert sum(right) == 1
    number = right.index(True) + 1
    kept = figures(tmp_path, "guess-picks", quick, "--accept", str(number))
    assert kept["kept"] == ["testfield-02"]
    assert len(read_capture(quick / "captures" / "testfield-02", read_project(quick)).seeds) == 4
    assert figures(tmp_path, "guess-picks", quick)["captures"] == {}


def test_dots_of_a_plate_are_features_as_sure_as_they_say(calibrated: Path, quick_truth, tmp_path: Path) -> None:
    told = figures(tmp_path, "features", calibrated, "depth-03")
    assert told["verdict"] == {"state": "passed", "because": []}
    found = told["features"]
    true = np.array(list(true_places(calibrated, quick_truth, "depth-03", "plate.csv").values()))
    off = np.array([min(true - f["uv"], key=np.linalg.norm) for f in found])
    assert len(found) > 20
    assert 0.6 < np.sqrt(np.mean((off / [f["uv_sigma"] for f in found]) ** 2)) < 1.5
    radius = read_capture(calibrated / "captures" / "depth-03", read_project(calibrated)).testfield.diameter_mm[0] / 2
    beside = [(f["size_mm"]["value"] - radius) / f["size_mm"]["sigma"] for f in found]
    assert 0.6 < np.sqrt(np.mean(np.square(beside))) < 1.6


def test_one_that_is_not_there_does_not_refuse_other_features(calibrated: Path, quick_truth, tmp_path, capsys) -> None:
    """One that could not be measured refused all others."""
    at = true_places(calibrated, quick_truth, "depth-03", "plate.csv")
    places = sorted(at.values(), key=lambda uv: np.hypot(*(uv - (160, 120))))[:2]  # in the middle of the image
    nowhere = "--circle", "4,4,3"
    named = [word for u, v in places for word in ("--circle", f"{u:.1f},{v:.1f},5")]
    out = tmp_path / "some.json"
    assert main(["features", str(calibrated), "depth-03", *named, *nowhere, "--json", str(out)]) == 1
    told = json.loads(out.read_text())
    off = np.array([f["uv"] for f in told["features"]]) - places
    assert np.abs(off / [f["uv_sigma"] for f in told["features"]]).max() < 4
    assert list(told["untold"]) == ["--circle 4,4,3"]
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("stripe-core: --circle 4,4,3: ")
    assert main(["features", str(calibrated), "depth-03", *nowhere, "--circle", "5,5,3"]) == 2


def test_of_features_that_are_not_found_the_reason_is_told(calibrated: Path, capsys) -> None:
    assert main(["features", str(calibrated), "object-sphere"]) == 2
    assert "the surface beside the edge is off a smooth one" in capsys.readouterr().err


def test_a_guess_for_what_is_no_board_is_refused(quick: Path, capsys) -> None:
    assert main(["guess-picks", str(quick), "plane+15"]) == 2
    assert "testfield-01" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "told"),
    [
        ("guess-picks P", "no capture names a testfield"),
        ("measure P", "no capture names a testfield"),
        ("calibrate P", "no capture of a testfield"),
        ("reconstruct P plane+00 --out a.ply", "no calibration"),
        ("evaluate P", "no calibration"),
        ("report P", "no calibration"),
        ("next-pose P", "no calibration"),
        ("orient P plane+00", "no calibration"),
        ("export P a.yml --to opencv", "no calibration"),
    ],
)
def test_a_project_of_planes_alone_is_told_what_it_lacks(quick: Path, capsys, command: str, told: str) -> None:
    project = json.loads((quick / "project.json").read_text())
    (quick / "project.json").write_text(json.dumps({**project, "captures": ["captures/plane+00"]}))
    assert main([str(quick) if word == "P" else word for word in command.split()]) == 2
    assert told in capsys.readouterr().err
    assert not (quick / "results").exists()
    assert main(["runs", str(quick)]) == 0
    assert capsys.readouterr().out == "no calibration is kept\n"


def test_a_profile_reads_the_deviations_along_its_line(evaluated: Path, tmp_path: Path) -> None:
    plane = next(e for e in load_evaluation(read_project(evaluated)) if e.method == "photogrammetric")
    (u0, v0), (u1, _) = line_across([plane.deviation_mm])
    found = figures(tmp_path, "profile", evaluated, plane.capture, "--out", tmp_path / "profile.csv")
    values = plane.deviation_mm[int(v0), int(u0) : int(u1) + 1]  # the line runs along a row, through pixels' centres
    known = values[np.isfinite(values)]
    told = found["profiles"]["photogrammetric"]
    assert told["n"] == len(known)
    assert told["rms_mm"] == pytest.approx(np.sqrt(np.mean(known**2)), rel=1e-6)
    written = [row["deviation, photogrammetric [µm]"] for row in rows_of(tmp_path / "profile.csv")]
    assert np.allclose([float(x) for x in written if x], 1000 * known, atol=0.006)  # two decimals


def test_a_profile_of_a_plane_that_was_not_evaluated_names_those_that_were(evaluated: Path, capsys) -> None:
    assert main(["profile", str(evaluated), "nothing"]) == 2
    assert "plane+15" in capsys.readouterr().err


def test_all_tables_are_written_as_csv(evaluated: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    files = {Path(f).name for f in figures(tmp_path, "tables", evaluated, "--out", out, "--deviations")["files"]}
    assert files == {p.name for p in out.iterdir() if p.name != MADE}
    assert {"table-1a.csv", "table-1b.csv", "table-2.csv", "table-3.csv", "targets.csv"} <= files
    for e in load_evaluation(read_project(evaluated)):
        assert f"profile-{e.capture}.csv" in files
        rows = rows_of(out / f"deviations-{e.capture}-{e.method}.csv")
        assert len(rows) == np.count_nonzero(np.isfinite(e.deviation_mm))
    targets = rows_of(out / "targets.csv")
    counted = figures(tmp_path, "measure", evaluated)
    assert sum(not row["missing because"] for row in targets) == sum(len(c["targets"]) for c in counted["captures"])


def test_a_report_that_is_not_written_is_not_handed_over(evaluated: Path, tmp_path: Path, capsys) -> None:
    assert main(["tables", str(evaluated), "--out", str(tmp_path / "out"), "--report"]) == 2
    assert "not written" in capsys.readouterr().err


def test_a_plane_fitted_through_the_camera_has_a_form(evaluated: Path) -> None:
    """As points of rows alone give one: half of the rays miss it, and `evaluate` ended with a traceback."""
    project = read_project(evaluated)
    found = load_calibrations(project)
    assert len(found) == 2
    for method, calibration in found.items():
        e = next(e for e in load_evaluation(project) if e.method == method)
        edge = replace(e, plane=np.array([0.0, 1.0, 1e-3, -5.0]))
        assert np.isfinite(bend_rms(edge, PointCloud(np.zeros((1, 1, 3), np.float32)), calibration))


def test_signing_and_withdrawing(evaluated: Path, tmp_path: Path) -> None:
    told = figures(
        tmp_path, "sign", evaluated, "--operator", "A. Operator", "--tolerance", "1", "--date", "2026-01-02",
        "--remark", "as agreed",
    )  # fmt: skip
    assert told["passed"] is True
    loaded = read_project(evaluated)
    signed = load_sign_off(loaded, load_evaluation(loaded))
    assert signed is not None
    assert (signed.operator, signed.date, signed.remark) == ("A. Operator", "2026-01-02", "as agreed")
    assert figures(tmp_path, "sign", evaluated, "--withdraw") == {"signed": False}
    assert load_sign_off(loaded, load_evaluation(loaded)) is None


def test_withdrawing_says_where_nothing_was_signed(evaluated: Path, capsys) -> None:
    assert main(["sign", str(evaluated), "--operator", "A. Operator", "--date", "2026-01-02"]) == 0
    capsys.readouterr()
    for told in ("withdrawn", "nothing was signed"):
        assert main(["sign", str(evaluated), "--withdraw"]) == 0
        assert capsys.readouterr().out.strip() == told


def test_tables_of_a_line_that_is_none_are_not_half_written(evaluated: Path, tmp_path: Path, capsys) -> None:
    assert main(["tables", str(evaluated), "--out", str(tmp_path / "out"), "--line", "5", "5", "5", "5"]) == 2
    assert "profile: its ends are 0.00 px apart" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("command", "told"),
    [
        (["calibrate", "--table", "--degree", "2"], "--table: does not go with --degree 2"),
        (["reconstruct", "plane+00", "--extrapolate", "--out", "a.npz"], "--extrapolate: does not go with the photog"),
        (["profile", "plane+00", "--line", "0", "0", "inf", "0"], "profile: its ends are inf px apart"),
        (["profile", "plane+00", "--line", *4 * ["inf"]], "profile: its ends are nan px apart"),
        (["profile", "plane+00", "--line", "0", "nan", "9", "0"], "profile: its ends are nan px apart"),
        (["profile", "plane+00", "--line", "0", "0", "1e12", "0"], "profile: its ends are 1e+12 px apart"),
    ],
)
def test_what_an_option_cannot_do_is_refused(evaluated: Path, command, told, capsys) -> None:
    assert main([command[0], str(evaluated), *command[1:]]) == 2
    assert told in capsys.readouterr().err


def test_outdated_figures_are_signed_only_with_a_reason(evaluated: Path, tmp_path: Path, capsys) -> None:
    """They were signed without a word, and the report then said that nobody had."""
    rig = evaluated / "project.json"
    data = json.loads(rig.read_text())
    data["scale"]["length_mm"] *= 1.01
    rig.write_text(json.dumps(data))
    assert main(["sign", str(evaluated), "--operator", "A"]) == 2
    assert "the evaluation is outdated" in (told := capsys.readouterr().err)
    assert "scale.length_mm" in told
    assert not list(evaluated.glob("results/**/sign-off.json"))
    figures(tmp_path, "sign", evaluated, "--operator", "A", "--despite", "the scale is another board's")
    signed = load_sign_off(read_project(evaluated), load_evaluation(read_project(evaluated)))
    assert signed is not None
    assert signed.despite == "the scale is another board's"


def test_figures_for_other_programs_that_were_deleted_come_back(evaluated: Path) -> None:
    results = evaluated / "results"
    for name, stage in (("targets.json", "measure"), ("evaluation.json", "evaluate")):
        held = json.loads((results / name).read_text())
        (results / name).unlink()
        project = read_project(evaluated)
        assert project_states(project).stages[stage].state == "outdated"
        update_project(project)
        assert json.loads((results / name).read_text()).keys() == held.keys()
        assert project_states(read_project(evaluated)).stages[stage].state == "current"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["--operator", " "], "--operator"),
        (["--operator", "A", "--date", "yesterday"], "--date"),
        (["--operator", "A", "--tolerance", "-1"], "--tolerance"),
    ],
)
def test_a_sign_off_that_says_nothing_is_refused(evaluated: Path, arguments: list[str], named: str, capsys) -> None:
    assert main(["sign", str(evaluated), *arguments]) == 2
    assert named in capsys.readouterr().err
    assert not list(evaluated.glob("results/**/sign-off.json"))


def test_nothing_can_be_signed_before_it_is_evaluated(calibrated: Path, capsys) -> None:
    assert main(["sign", str(calibrated), "--operator", "A"]) == 2
    assert "evaluate" in capsys.readouterr().err


def test_runs_are_listed_named_and_compared(calibrated: Path, tmp_path: Path, capsys) -> None:
    assert main(["calibrate", str(calibrated), "--method", "photogrammetric", "--free-stations"]) == 0
    told = figures(tmp_path, "runs", calibrated, "--name", "1", "first", "--compare", "1", "2")
    assert [(r["run"], r["name"]) for r in told["runs"]] == [(1, "first"), (2, "")]
    assert "photogrammetric" in told["runs"][1]["in_use"]
    entry = next(d for d in told["compared"] if d["parameter"] == "camera c")
    assert entry["difference"] == pytest.approx(entry["second"][0] - entry["first"][0])
    told = figures(tmp_path, "runs", calibrated, "--use", "1", "--delete", "2")
    assert [r["run"] for r in told["runs"]] == [1]
    assert main(["runs", str(calibrated), "--use", "9"]) == 2
    assert "no run 9" in capsys.readouterr().err


def test_calibrations_over_the_working_volume(tmp_path, calibrated_original, capsys):
    sure = figures(tmp_path, "uncertainty", calibrated_original, "--out", tmp_path / "maps.npz")
    with np.load(tmp_path / "maps.npz") as maps:
        layer = maps["form_sigma_mm"][sure["depths"][2]["layer"]]
        assert np.sqrt(np.nanmean(layer**2)) == pytest.approx(sure["depths"][2]["form_sigma_mm"])
        assert maps["xyz_mm"].shape == (*maps["uv"].shape[:3], 3)
    # the quick rig's targets are 600 mm away; a point moves with the base's length, 0.1 % of it at the very most
    assert all(
        500 < row["depth_mm"] < 700 and 0 < row["form_sigma_mm"] < row["sigma_mm"] < 0.6 for row in sure["depths"]
    )
    same = figures(tmp_path, "compare", calibrated_original, "1")
    assert same["significant"] is False
    assert max(row["difference_mm_max"] for row in same["depths"]) < 1e-4
    left_out = figures(tmp_path, "cross-validate", calibrated_original)["captures"]
    assert len(left_out) == 8
    assert not any(one["off"] for one in left_out)
    assert all(one["foreseen_px"][name] > fitted for one in left_out for name, fitted in one["fitted_px"].items())
    poses = figures(tmp_path, "next-pose", calibrated_original)["poses"]
    assert [one["gain"] for one in poses] == sorted((one["gain"] for one in poses), reverse=True)
    assert all(0 < one["gain"] < one["most"] < 0.6 for one in poses)  # one pose beside eight
    assert main(["compare", str(calibrated_original), "7"]) == 2
    assert "no photogrammetric calibration of run 7" in capsys.readouterr().err


@pytest.mark.usefixtures("plain_reports")
def test_a_project_that_may_only_be_read_is_judged(evaluated: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    """Nothing is written into it, `report` takes a place elsewhere, and a dead lock is in nobody's way."""
    (evaluated / "results" / ".lock").write_text("{}")
    before = {path: path.stat().st_mtime_ns for path in evaluated.rglob("*")}
    monkeypatch.setattr("os.access", lambda path, mode: mode != os.W_OK)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    planes = figures(tmp_path, "evaluate", evaluated)["planes"]
    assert [p["rms_mm"] for p in planes] == [e.rms_mm for e in load_evaluation(read_project(evaluated))]
    written = figures(tmp_path, "report", evaluated, "--out", tmp_path / "elsewhere")
    assert all(Path(written[kind]).is_file() for kind in ("html", "pdf"))
    assert main(["check", str(evaluated)]) == 0
    assert {path: path.stat().st_mtime_ns for path in evaluated.rglob("*")} == before
    monkeypatch.undo()
    assert main(["check", str(evaluated)]) == 0  # and goes where it can
    assert not (evaluated / "results" / ".lock").exists()
