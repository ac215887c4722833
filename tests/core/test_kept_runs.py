"""Runs of a calibration are kept, compared and brought back; what has not changed is not measured again."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.cli import main
from core.errors import AdjustmentError, Cancelled, InputError
from core.geometry import LENSES, matrix_from_rotation_vector
from core.model import Adjustment, PhotogrammetricCalibration
from core.pipeline import CalibrateOptions, calibrate_project, runs
from core.pipeline.calibrate import chosen_calibration
from core.pipeline.methods import METHODS
from core.pipeline.runs import (
    Run,
    calibration_file,
    compare_runs,
    current_runs,
    delete_run,
    list_runs,
    make_current,
    rename_run,
)
from core.pipeline.signing import save_sign_off
from core.progress import Progress
from core.project import load_archive, read_capture, read_image, read_project, write_image, write_picks
from core.report import SignOff
from tests.copies import copied


def decoded(project, **choices) -> list[str]:
    """Calibrate and give the captures that were decoded for it."""
    seen: list[str] = []
    progress = Progress(report=lambda _, message: seen.append(message))
    calibrate_project(project, progress=progress, **choices)
    return sorted({m.removeprefix("decoding ") for m in seen if m.startswith("decoding ")})


def exclude(folder: Path, capture: str, *targets: tuple[int, int]) -> None:
    """Exclude targets of a capture, as an operator does."""
    picks = folder / "captures" / capture
    write_picks(picks / "picks.json", read_capture(picks).seeds, targets)


def result(folder: Path, name: str = "photogrammetric.npz") -> PhotogrammetricCalibration:
    return load_archive(calibration_file(read_project(folder), name), PhotogrammetricCalibration)


def network_of(folder: Path):
    return load_archive(calibration_file(read_project(folder), "adjustment.npz"), Adjustment).network


def change_frame(folder: Path, capture: str, file: str) -> None:
    """Change one grey value of a frame."""
    path = folder / "captures" / capture / file
    image = read_image(path).copy()
    image[0, 0] ^= 1
    write_image(path, image)


def test_a_calibration_is_kept_with_its_options_captures_and_figures(calibrated: Path) -> None:
    project = read_project(calibrated)
    (run,) = list_runs(project)
    assert run.number == 1
    assert run.options == CalibrateOptions()
    assert current_runs(project) == {"photogrammetric": 1, "polynomial": 1}
    names = [folder.name for folder in project.captures]
    assert run.captures["photogrammetric"] == tuple(n for n in names if n.startswith("testfield"))
    assert run.captures["polynomial"] == tuple(n for n in names if n.startswith("depth"))
    assert run.figures["photogrammetric"]["sigma0"] == result(calibrated).sigma0


def test_nothing_is_decoded_again_where_nothing_has_changed(calibrated: Path) -> None:
    before = result(calibrated)
    project = read_project(calibrated)
    assert decoded(project) == []
    after = result(calibrated)
    assert np.array_equal(after.camera.interior.vector, before.camera.interior.vector)
    first, second = list_runs(project)
    assert (first.number, second.number) == (1, 2)
    calibrate_project(project)
    # what was not computed anew takes no room
    assert {p.parent.name for p in (calibrated / "results" / "runs").glob("*/*.npz")} == {"0001"}
    assert [list_runs(project)[-1].holder(method) for method in ("photogrammetric", "polynomial")] == [1, 1]
    delete_run(project, first)
    assert [run.number for run in list_runs(project)] == [2, 3]
    assert calibration_file(project, "polynomial.npz").parent.name == "0001"  # as long as another needs it


def test_only_what_changed_is_measured_again(calibrated: Path) -> None:
    project, plates = read_project(calibrated), [f"depth-0{i}" for i in range(1, 6)]
    exclude(calibrated, "testfield-03", (3, 4))
    assert decoded(project) == [*plates, "testfield-03"]  # the depth's camera follows from the testfields
    change_frame(calibrated, "testfield-05", "000.png")
    assert decoded(project) == [*plates, "testfield-05"]
    board = calibrated / "testfield.csv"
    board.write_text(board.read_text().replace("# polarity", "# seen\n# polarity", 1))
    assert decoded(project) == []  # a comment changes no target
    change_frame(calibrated, "depth-02", "003.png")
    assert decoded(project) == plates
    assert decoded(project, options=CalibrateOptions(degree=2), method="photogrammetric") == []


def test_a_rig_that_changed_is_measured_again(calibrated: Path, edit_json) -> None:
    rig = json.loads((calibrated / "project.json").read_text())["camera"]
    edit_json(calibrated / "project.json", camera={**rig, "nominal_c_mm": rig["nominal_c_mm"] + 0.01})
    assert len(decoded(read_project(calibrated), method="photogrammetric")) == 8


def test_an_excluded_target_is_left_out_of_that_capture_alone(calibrated: Path) -> None:
    exclude(calibrated, "testfield-03", (3, 4))
    project = read_project(calibrated)
    calibrate_project(project, "photogrammetric")
    network = network_of(calibrated)
    point = network.point_names.index("3/4")
    stations = {network.station_names[s] for s in network.observation_station[network.observation_point == point]}
    assert not any(s.startswith("testfield-03/") for s in stations)
    assert any(s.startswith("testfield-04/") for s in stations)
    assert list_runs(project)[-1].excluded == {"testfield-03": ((3, 4),)}


def test_captures_may_be_left_out_by_name(calibrated: Path, capsys) -> None:
    assert main(["calibrate", str(calibrated), "--method", "photogrammetric", "--without", "testfield-04"]) == 0
    network = network_of(calibrated)
    assert not any(name.startswith("testfield-04") for name in network.station_names)
    run = list_runs(read_project(calibrated))[-1]
    assert run.options.without == ("testfield-04",)
    assert main(["calibrate", str(calibrated), "--without", "testfield-99"]) == 2
    assert "no capture 'testfield-99' to leave out" in capsys.readouterr().err


def test_few_plates_lower_the_usual_degree_and_a_single_one_does_not_stop_the_rest(calibrated: Path, capsys) -> None:
    project = read_project(calibrated)
    plates = [path.name for path in project.captures if read_capture(path, project).role == "depth"]
    done = calibrate_project(project, "polynomial", CalibrateOptions(without=tuple(plates[3:])))
    assert done["polynomial"].degree == 2
    assert "degree 2, not 3: only 3 plate positions" in done["polynomial"].warnings[0]
    assert set(calibrate_project(project, "all", CalibrateOptions(without=tuple(plates[1:])))) == {"photogrammetric"}
    with pytest.raises(InputError, match="needs 5"):
        calibrate_project(project, "polynomial", CalibrateOptions(degree=4, without=tuple(plates[3:])))


def test_held_parameters_stay_where_they_are_and_have_no_sigma(calibrated: Path, capsys) -> None:
    hold = ["--hold", "projector.c", "--hold", "camera.A5"]
    assert main(["calibrate", str(calibrated), "--method", "photogrammetric", *hold]) == 0
    found, project = result(calibrated), read_project(calibrated)
    assert (found.projector.interior.c_mm, found.projector.sigma[0]) == (project.projector.nominal_c_mm, 0.0)
    assert (found.camera.interior.a[4], found.camera.sigma[7]) == (0.0, 0.0)
    assert found.camera.sigma[0] > 0
    assert main(["calibrate", str(calibrated), "--hold", "camera.K1"]) == 2
    assert "'camera.K1' is none" in capsys.readouterr().err


@pytest.mark.parametrize(("limit", "seen"), [("1.5", "is 1.5"), ("-1", "is -1")])
def test_a_limit_that_good_observations_exceed_is_refused(calibrated: Path, limit: str, seen: str, capsys) -> None:
    assert main(["calibrate", str(calibrated), "--reject", limit]) == 2
    assert seen in capsys.readouterr().err


def test_an_earlier_run_can_be_put_in_use_again(calibrated: Path) -> None:
    project = read_project(calibrated)
    before = result(calibrated).camera.interior
    calibrate_project(project, "photogrammetric", CalibrateOptions(without=("testfield-02",)))
    first, second = list_runs(project)
    assert result(calibrated).camera.interior != before
    make_current(project, first)
    assert result(calibrated).camera.interior == before
    assert current_runs(project) == {"photogrammetric": 1, "polynomial": 1}
    make_current(project, second)
    assert current_runs(project) == {"photogrammetric": 2, "polynomial": 1}


def test_a_run_whose_files_are_gone_is_not_put_in_use(calibrated: Path) -> None:
    project = read_project(calibrated)
    calibrate_project(project, "photogrammetric", CalibrateOptions(without=("testfield-02",)))
    (calibrated / "results" / "runs" / "0001" / "adjustment.npz").unlink()
    in_use = result(calibrated).camera.interior
    with pytest.raises(InputError, match="not there"):
        make_current(project, list_runs(project)[0])
    assert result(calibrated).camera.interior == in_use
    assert current_runs(project)["photogrammetric"] == 2


def test_a_run_in_use_is_not_deleted_another_is(calibrated: Path) -> None:
    project = read_project(calibrated)
    calibrate_project(project)
    first, second = list_runs(project)
    with pytest.raises(InputError, match="in use"):
        delete_run(project, second)
    delete_run(project, first)
    assert [run.number for run in list_runs(project)] == [2]
    calibrate_project(project, options=CalibrateOptions(degree=2, reject_beyond=7.0))
    delete_run(project, second)
    assert [path.name for path in (calibrated / "results" / "runs").iterdir()] == ["0003"]
    assert second.figures
    second = list_runs(project)[0]
    assert result(calibrated).sigma0 == second.figures["photogrammetric"]["sigma0"]


def test_a_run_may_be_named(calibrated: Path) -> None:
    project = read_project(calibrated)
    rename_run(project, list_runs(project)[0], " before the knock ")
    assert list_runs(project)[0].name == "before the knock"


def test_the_oldest_runs_go_beyond_a_number_those_in_use_stay(calibrated: Path, monkeypatch) -> None:
    monkeypatch.setattr(runs, "MOST_RUNS", 2)
    project = read_project(calibrated)
    for _ in range(3):
        calibrate_project(project, "photogrammetric")
    assert [run.number for run in list_runs(project)] == [1, 3, 4]  # run 1 holds the depth calibration in use


def test_named_and_signed_runs_stay(calibrated: Path, monkeypatch) -> None:
    monkeypatch.setattr(runs, "MOST_RUNS", 2)
    project = read_project(calibrated)
    for _ in range(2):
        calibrate_project(project, "photogrammetric")
    rename_run(project, list_runs(project)[1], "keep")
    save_sign_off(project, SignOff("E. Abbe"), ())
    for _ in range(4):
        calibrate_project(project, "photogrammetric")
    assert [run.number for run in list_runs(project)] == [1, 2, 3, 6, 7]
    assert list_runs(project)[1].name == "keep"


def test_a_cancelled_calibration_keeps_no_run(calibrated: Path) -> None:
    project = read_project(calibrated)
    seen: list[str] = []
    progress = Progress(lambda _, message: seen.append(message), lambda: "iteration 3" in seen)
    with pytest.raises(Cancelled):
        calibrate_project(project, options=CalibrateOptions(reject_beyond=7.0), progress=progress)
    assert [run.number for run in list_runs(project)] == [1]
    assert [p.name for p in (calibrated / "results" / "runs").iterdir()] == ["0001"]


def test_a_run_that_cannot_be_read_is_passed_over(calibrated: Path) -> None:
    project = read_project(calibrated)
    (calibrated / "results" / "runs" / "0001" / "run.json").write_text("{")
    assert list_runs(project) == ()
    calibrate_project(project, "photogrammetric")
    assert [run.number for run in list_runs(project)] == [2]  # a number is not given twice


def test_a_course_is_told_at_every_iteration(calibrated: Path) -> None:
    told: list[tuple[str, int, float]] = []
    progress = Progress(course=lambda *figure: told.append(figure))
    calibrate_project(read_project(calibrated), "photogrammetric", CalibrateOptions(reject_beyond=7.0), progress)
    sigma0 = [(step, value) for name, step, value in told if name == "sigma0"]
    assert [step for step, _ in sigma0][:4] == [0, 1, 2, 3]
    assert sigma0[0][1] > 10 * sigma0[-1][1]
    corrections = [value for name, _, value in told if name == "correction"]
    assert corrections[-1] < 1e-3  # sigmas: a last step leaves a hundredth of itself or less, and that is the tolerance


def run_with(number: int, c_mm: float, sigma: float, turn: np.ndarray, shift: np.ndarray) -> Run:
    """A run with just the figures that are compared."""

    def device(first: float) -> dict:
        keys = [n if n.startswith("A") else f"{n}_mm" for n in LENSES["A1..A6"].names]
        values = {key: {"value": 0.0, "sigma": 0.0} for key in keys}
        return {"model": "A1..A6", **values, "c_mm": {"value": first, "sigma": sigma}, "r0_mm": 2.5}

    relative = {
        "rotation": matrix_from_rotation_vector(turn).tolist(),
        "translation_mm": shift.tolist(),
        "rotation_sigma_rad": [1e-4] * 3,
        "translation_sigma_mm": [0.01] * 3,
    }
    devices = {"camera": device(c_mm), "projector": device(180.0)}
    network = {"devices": devices, "orientations": {"projector": {"from": "camera", **relative}}}
    return Run(number, "", CalibrateOptions(), {"photogrammetric": ()}, {}, {}, {"photogrammetric": network})


def test_runs_are_compared_in_units_of_the_greater_sigma() -> None:
    first = run_with(1, 12.000, 0.002, np.array([0.1, 0.2, -0.1]), np.array([-240.0, 10.0, 5.0]))
    turned = matrix_from_rotation_vector([0.0, 3e-4, 0.0]) @ matrix_from_rotation_vector([0.1, 0.2, -0.1])
    second = run_with(2, 12.010, 0.004, np.zeros(3), np.array([-240.0, 10.02, 5.0]))
    second.figures["photogrammetric"]["orientations"]["projector"]["rotation"] = turned.tolist()
    found = {d.name: d for d in compare_runs(first, second)}
    c = found["camera c"]
    assert (c.first, c.second, c.unit) == ((12.0, 0.002), (12.010, 0.004), "mm")
    assert c.in_sigmas == pytest.approx(0.010 / 0.004)
    assert found["projector A3"].in_sigmas is None  # held in both
    assert [found[f"turn about {axis}"].difference for axis in "XYZ"] == pytest.approx(
        [0.0, 0.3, 0.0], abs=1e-9
    )  # mrad
    assert found["turn about Y"].in_sigmas == pytest.approx(3.0)
    assert found["shift Y"].in_sigmas == pytest.approx(2.0)


def test_parameters_with_other_zero_radii_are_not_set_against_each_other() -> None:
    first = run_with(1, 12.000, 0.002, np.zeros(3), np.zeros(3))
    second = run_with(2, 12.010, 0.002, np.zeros(3), np.zeros(3))
    second.figures["photogrammetric"]["devices"]["camera"]["r0_mm"] = 3.0
    assert {d.name: d for d in compare_runs(first, second)}["camera c"].in_sigmas is None


def test_all_devices_of_two_runs_are_compared() -> None:
    """Only the first camera's pair was, and nothing where cameras alone were calibrated."""
    first, second = (run_with(n, 12.000, 0.002, np.zeros(3), np.array([-n, 0.0, 0.0])) for n in (1, 2))
    for run, at in ((first, 10.0), (second, 10.05)):
        placed = run.figures["photogrammetric"]["orientations"]
        placed["right"] = {**placed["projector"], "translation_mm": [0.0, 0.0, at], "translation_sigma_mm": [None] * 3}
    found = {d.name: d for d in compare_runs(first, second)}
    assert found["projector shift X"].difference == -1
    assert found["right shift Z"].difference == pytest.approx(0.05)
    assert found["right shift Z"].in_sigmas is None  # held in both
    second.figures["photogrammetric"]["orientations"]["right"]["from"] = "projector"
    assert not [d for d in compare_runs(first, second) if d.name.startswith("right")]


def test_a_run_without_a_photogrammetric_calibration_is_not_compared() -> None:
    first = run_with(1, 12.000, 0.002, np.zeros(3), np.zeros(3))
    assert compare_runs(first, replace(first, figures={"polynomial": {}})) == ()


def test_a_calibration_stays_where_another_method_fails(calibrated: Path, capsys, monkeypatch) -> None:
    def fails(*_: object) -> None:
        raise AdjustmentError("depth captures", "no pixel sees the plate move", "look at them")

    monkeypatch.setitem(METHODS, "polynomial", replace(METHODS["polynomial"], calibrate=fails, reused=False))
    before = current_runs(read_project(calibrated))
    document = json.loads((calibrated / "project.json").read_text())
    document["scale"]["sigma_mm"] = 0.006
    (calibrated / "project.json").write_text(json.dumps(document))
    assert main(["calibrate", str(calibrated)]) == 1
    told = capsys.readouterr().err
    assert "no pixel sees the plate move" in told
    assert "the photogrammetric calibration is kept" in told
    after = current_runs(read_project(calibrated))
    assert after["photogrammetric"] != before["photogrammetric"]
    assert after["polynomial"] == before["polynomial"]


def test_a_plate_without_targets_is_named_where_no_pixel_sees_the_plates_move(
    calibrated: Path, edit_json, capsys, monkeypatch
) -> None:
    def fails(*_: object, **__: object) -> None:
        raise AdjustmentError("depth captures", "no pixel sees the plate move", "look at them")

    monkeypatch.setattr("core.calibrate.calibrate_depth", fails)
    picks = calibrated / "captures/depth-02/picks.json"
    seeds = [{**s, "u": s["u"] + 13, "v": s["v"] + 9} for s in json.loads(picks.read_text())["seeds"]]
    edit_json(picks, seeds=seeds)
    assert main(["calibrate", str(calibrated), "--method", "polynomial"]) == 1
    assert "First see to this: depth-02: none of its targets was measured: pick" in capsys.readouterr().err


def test_a_calibration_of_another_camera_is_left_out_beside_a_new_one(
    calibrated_original: Path, tmp_path: Path, capsys, caplog
) -> None:
    folder = copied(calibrated_original, tmp_path / "project")
    data = json.loads((folder / "project.json").read_text())
    data["camera"]["pitch_mm"] = [1.1 * pitch for pitch in data["camera"]["pitch_mm"]]
    data["camera"]["nominal_c_mm"] *= 1.1
    (folder / "project.json").write_text(json.dumps(data))
    assert main(["evaluate", str(folder)]) == 2  # both are of the other
    assert main(["calibrate", str(folder), "--method", "photogrammetric"]) == 0
    assert "kept as run 2" in capsys.readouterr().out
    assert "polynomial.npz: is of a camera of" in caplog.text
    assert main(["evaluate", str(folder), "--json", str(tmp_path / "e.json")]) == 0
    assert {row["method"] for row in json.loads((tmp_path / "e.json").read_text())["planes"]} == {"photogrammetric"}
    assert chosen_calibration(read_project(folder))[0] == "photogrammetric"
    with pytest.raises(InputError, match=r"calibrate by polynomial again"):
        chosen_calibration(read_project(folder), "polynomial")
