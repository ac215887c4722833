"""Points are no better than their capture and their calibration, and every command that makes points says so."""

import json
import os
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from core.batch import run_batch
from core.bench.scenarios import experiment
from core.cli import main
from core.errors import StripeError
from core.geometry import Pose, matrix_from_rotation_vector
from core.model import Note, PhaseMap, PointCloud, Verdict, named_by
from core.patterns import White
from core.pipeline import calibrate_project, decode_capture, load_calibrations, reconstruct_capture
from core.pipeline.evaluate import evaluate_project, load_evaluation
from core.pipeline.evidence import is_white_of, shared_frames
from core.pipeline.folders import find_capture
from core.pipeline.judge import judge_points, said_of
from core.pipeline.merge import merge_captures
from core.pipeline.options import CalibrateOptions
from core.pipeline.update import keep_points
from core.project import contents, read_capture, read_project
from core.report.numbers import plane_table

OBJECT = "plane+00"
Disturb = Callable[[list[np.ndarray]], list[np.ndarray]]


def told(words: list[str], tmp_path: Path) -> dict[str, Any]:
    figures = tmp_path / "figures.json"
    assert main([*words, "--json", str(figures)]) == 0
    return dict(json.loads(figures.read_text()))


def disturb(project: Path, change: Disturb, capture: str = OBJECT) -> None:
    files = sorted((project / "captures" / capture).glob("[0-9]*"))
    for file, image in zip(files, change([cv2.imread(str(file), cv2.IMREAD_UNCHANGED) for file in files]), strict=True):
        file.unlink()  # which may be the same file as that of another copy
        cv2.imwrite(str(file), image)


def exchanged(images: list[np.ndarray]) -> list[np.ndarray]:
    images[3], images[-5] = images[-5], images[3]
    return images


def shifted(images: list[np.ndarray]) -> list[np.ndarray]:
    return [np.roll(image, 2, axis=0) for image in images]


def turned(images: list[np.ndarray]) -> list[np.ndarray]:
    """The projector turned by 1 mrad in the plane of both axes: depths err by 2 mm, epipolar residuals by a tenth."""
    e = experiment("quick", 3)
    pose, turn = e.rig.projector_from_camera, matrix_from_rotation_vector([0.0, 1e-3, 0.0])
    R = pose.rotation @ turn.T
    rig = replace(e.rig, projector_from_camera=Pose(R, -R @ pose.origin_mm))
    e = replace(e, plan=replace(e.plan, rig=rig))
    return [image for _, image in e.take(e.shot(OBJECT))]


@pytest.mark.parametrize(
    ("change", "state", "why"),
    [
        (lambda images: images, "passed", ""),
        (exchanged, "doubtful", "contradict each other"),
        (shifted, "doubtful", "do not see it as they were calibrated: epipolar residuals"),
        (turned, "doubtful", "depths change by"),
    ],
)
def test_what_speaks_against_a_capture_speaks_against_its_points(
    calibrated: Path, tmp_path: Path, change: Disturb, state: str, why: str, capsys: pytest.CaptureFixture[str]
) -> None:
    disturb(calibrated, change)
    verdict = told(["reconstruct", str(calibrated), OBJECT, "--out", str(tmp_path / "a.npz")], tmp_path)["verdict"]
    assert verdict["state"] == state
    assert why in " ".join(verdict["because"])
    assert f"{OBJECT}: {state}" in capsys.readouterr().out
    by_depth = ["reconstruct", str(calibrated), OBJECT, "--method", "polynomial", "--out", str(tmp_path / "p.npz")]
    assert told(by_depth, tmp_path)["verdict"]["state"] == state  # told by the calibration of devices of the same run
    capsys.readouterr()
    batch = told(["batch", str(calibrated), OBJECT, "--do", "reconstruct", "--out", str(tmp_path / "b")], tmp_path)
    assert batch["captures"][0]["reconstruct"]["verdict"] == verdict
    assert (f"{OBJECT}: {state}" in capsys.readouterr().out) == (state != "passed")
    kept = keep_points(read_project(calibrated), OBJECT, "photogrammetric")
    assert json.loads(kept.with_suffix(".json").read_text())["verdict"] == verdict


def test_points_are_no_better_than_their_calibration(calibrated: Path) -> None:
    cloud = PointCloud(np.zeros((2, 2, 3), np.float32))
    calibration = load_calibrations(read_project(calibrated))["photogrammetric"]
    said = {"a": (Note("not used", "pick"),)}
    sound, slipped = Verdict("passed", ("noise",)), Verdict("failed", ("it slipped",))
    for verdict, state in ((sound, "passed"), (slipped, "failed"), (None, "doubtful")):
        judged = judge_points(cloud, said, "photogrammetric", replace(calibration, verdict=verdict)).verdict
        assert judged is not None
        assert judged.state == state
        assert ("its photogrammetric calibration is failed: it slipped" in judged.because) == (state == "failed")


def test_what_is_made_with_a_calibration_that_failed_says_so(calibrated: Path, tmp_path: Path) -> None:
    board = calibrated / "testfield.csv"
    lines = board.read_text().splitlines()
    table = [line.split(",") for line in lines if line[0].isdigit()]
    for entry in table:
        entry[2] = str(1.2 * float(entry[2]))  # x alone
    board.write_text("\n".join([line for line in lines if not line[0].isdigit()] + [",".join(e) for e in table]))
    first = told(["calibrate", str(calibrated), "--method", "photogrammetric"], tmp_path)["photogrammetric"]["verdict"]
    assert first["state"] != "passed"
    of_points = told(["reconstruct", str(calibrated), OBJECT, "--out", str(tmp_path / "a.npz")], tmp_path)["verdict"]
    assert of_points["state"] == first["state"]
    assert first["because"][0] in of_points["because"][0]
    assert told(["export", str(calibrated), "--to", "ros", str(tmp_path / "a.yaml")], tmp_path)["verdict"] == first
    assert told(["uncertainty", str(calibrated)], tmp_path)["verdict"] == first


def test_what_frames_say_names_the_camera_where_there_are_several(calibrated: Path) -> None:
    project = read_project(calibrated)
    capture, of_depths = find_capture(project, OBJECT), load_calibrations(project)["polynomial"]
    nothing = np.zeros((2, 2), np.float32)
    said = (Note("a frame is black", "value"), Note("a pick is not used", "pick"))
    left = PhaseMap(*[nothing] * 7, notes=said, camera="left")
    assert said_of(capture, [left], of_depths) == said
    notes = said_of(capture, [left, replace(left, camera="right")], of_depths)
    assert notes == tuple(f"{camera}: {note}" for camera in ("left", "right") for note in said)
    assert [named_by(note) for note in notes] == ["value", "pick"] * 2


def test_captures_that_cannot_be_merged_say_what_is_wrong_with_them(calibrated: Path) -> None:
    def early(images: list[np.ndarray]) -> list[np.ndarray]:
        images[1], images[2] = images[2], images[1]
        return images

    disturb(calibrated, early, "testfield-02")
    with pytest.raises(StripeError, match=r"do not settle .*First see to this: testfield-02: frames across columns"):
        merge_captures(read_project(calibrated), ["testfield-01", "testfield-02"])


def test_a_capture_without_coordinates_is_named(
    calibrated: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    disturb(calibrated, lambda images: [np.full_like(image, 20) for image in images], "testfield-02")
    for command in (
        ["merge", str(calibrated), "testfield-01", "testfield-02"],
        ["reconstruct", str(calibrated), "testfield-02"],
    ):
        assert main([*command, "--out", str(tmp_path / "a.ply")]) == 2
        assert "captures/testfield-02: no pixel has a projector coordinate" in capsys.readouterr().err


def test_frames_that_another_capture_holds_are_told_with_coordinates_and_points(
    calibrated: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = calibrated / "captures"
    for name in ("005.png", "006.png"):
        (folder / OBJECT / name).unlink()
        shutil.copy(folder / "plane+15" / name, folder / OBJECT / name)
    shutil.copy(folder / "plane+15" / "023.png", folder / OBJECT / "new.png")  # no frame
    said = "005.png, 006.png also stand in plane+15: files of another capture"
    assert said in decode_capture(folder / OBJECT).notes[0]
    assert named_by(decode_capture(folder / OBJECT).notes[0]) == "mistake"
    monkeypatch.chdir(folder)  # a capture was held against itself where its path was written otherwise
    assert decode_capture(Path(OBJECT)).notes == decode_capture(folder / OBJECT).notes
    assert find_capture(read_project(calibrated), os.path.relpath(folder / OBJECT)).path == folder / OBJECT
    assert said in " ".join(reconstruct_capture(read_project(calibrated), OBJECT)[1].verdict.because)
    own = next(e for e in evaluate_project(read_project(calibrated)) if e.capture == "plane+15")
    assert any("also stand in " + OBJECT in text for text in own.verdict.because)
    for names in ([OBJECT], [OBJECT, "plane+15"]):  # what was made of other captures is left as it is
        run_batch(read_project(calibrated), calibrated / "out", names, workers=1)
    summary = json.loads((calibrated / "out" / "summary.json").read_text())["captures"]
    assert said in " ".join(summary[0]["reconstruct"]["verdict"]["because"])
    assert [row["state"] for row in summary] == ["left", "done"]
    assert all("also stand in " + OBJECT in " ".join(p["verdict"]["because"]) for p in summary[1]["evaluate"])
    options = CalibrateOptions(without=("depth-01",))  # it failed for a frame that captures beside it share
    found = calibrate_project(read_project(calibrated), "polynomial", options)["polynomial"]
    assert not any("also stand" in text for text in found.verdict.because)
    (folder / "depth-01" / "capture.json").write_text("{")
    assert not any("also stands" in note for note in decode_capture(folder / "testfield-01").notes)


def test_a_white_frame_is_that_of_its_capture_where_nothing_moved(calibrated: Path) -> None:
    folder = calibrated / "captures"
    capture = read_capture(folder / "testfield-02", read_project(calibrated))
    white = next(frame for frame in capture.frames if frame.pattern == White())
    assert is_white_of(capture, white)
    Path(white.place).unlink()
    shutil.copy(folder / "testfield-01" / white.path.name, white.place)
    assert not is_white_of(capture, white)


def test_a_capture_that_has_two_names_by_a_link_keeps_the_one_that_was_given(calibrated: Path) -> None:
    project, folder = read_project(calibrated), calibrated / "captures"
    (folder / "link").symlink_to(folder / OBJECT)
    linked = replace(project, captures=(folder / "link", *project.captures))
    names = (OBJECT, f"captures/{OBJECT}", "link")
    assert [find_capture(linked, name).name for name in names] == [OBJECT, OBJECT, "link"]


def test_files_of_one_size_are_not_hashed_to_tell_whether_captures_share_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames that are not compressed all have one size: of 40 captures 0.7 GB were read to decode one."""
    rng = np.random.default_rng(0)
    device = {"width": 64, "height": 48, "pitch_mm": [0.01, 0.01], "nominal_c_mm": 1.0}
    frames = [{"file": f"{k}.tif", "pattern": {"kind": "level", "value": k / 8}} for k in range(1, 8)]
    head = {"format": "stripe-capture", "version": 2, "role": "object", "frames": frames}
    names = ["captures/a", "captures/b", "captures/c"]
    for name in names:
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "capture.json").write_text(json.dumps(head))
        for frame in frames:
            grey = rng.integers(0, 256, (48, 64), dtype=np.uint8)
            cv2.imwrite(str(tmp_path / name / str(frame["file"])), grey, [cv2.IMWRITE_TIFF_COMPRESSION, 1])
    shutil.copy(tmp_path / "captures/a/3.tif", tmp_path / "captures/c/5.tif")
    rig = {"camera": device, "projector": device, "captures": names}
    (tmp_path / "project.json").write_text(json.dumps({"format": "stripe-project", "version": 1, "name": "p", **rig}))
    project = read_project(tmp_path)
    hashed: list[str] = []
    monkeypatch.setattr(contents, "hash_file", lambda name, by=contents.hash_file: hashed.append(name) or by(name))
    own = tmp_path / "captures/c"
    assert [str(note) for note in shared_frames(project, [read_capture(own, project)])["c"]] == [
        "5.tif also stands in a: a file of another capture; record it again"
    ]
    assert [name for name in hashed if Path(name).parent != own] == [str(tmp_path / "captures/a/3.tif")]
    # `batch` reads captures by their resolved place, whatever the project is called by: each was another beside itself
    (tmp_path / "linked").symlink_to(tmp_path)
    linked = read_project(tmp_path / "linked")
    assert shared_frames(linked, [read_capture(tmp_path / "captures/b", linked)]) == {"b": ()}


def test_code_frames_without_noise_that_are_lit_all_over_are_one_image(tmp_path: Path) -> None:
    """A rendered camera sees lines 0 to 15 of 64, whose first two bits are off, and their inverses on."""
    lines = np.tile(np.arange(16).repeat(4), (48, 1))
    frames = []
    for bit in range(6):
        for inverse in (False, True):
            on = ((lines ^ lines >> 1) >> (5 - bit) & 1) ^ inverse
            cv2.imwrite(str(tmp_path / f"{len(frames)}.png"), (20 + np.arange(64) + 100 * on).astype(np.uint8))
            pattern = {"kind": "gray", "axis": "x", "bit": bit, "bits": 6, "cell": 1, "inverse": inverse}
            frames.append({"file": f"{len(frames)}.png", "pattern": pattern})
    head = {"format": "stripe-capture", "version": 1, "role": "object", "frames": frames}
    (tmp_path / "capture.json").write_text(json.dumps(head))
    device = {"width": 64, "height": 48, "pitch_mm": [0.01, 0.01], "nominal_c_mm": 1.0}
    rig = {"camera": device, "projector": device, "captures": ["."]}
    (tmp_path / "project.json").write_text(json.dumps({"format": "stripe-project", "version": 1, "name": "p", **rig}))
    project = read_project(tmp_path)

    def told() -> list[str]:
        return [str(note) for note in shared_frames(project, [read_capture(tmp_path, project)])[tmp_path.name]]

    assert told() == []
    shutil.copy(tmp_path / "9.png", tmp_path / "1.png")
    shutil.copy(tmp_path / "9.png", tmp_path / "3.png")
    assert told() == ["1.png and 3.png are the same image under two patterns and 2 pairs more: record one again"]


def beyond(calibrations: dict[str, Any]) -> dict[str, Any]:
    """The same with a depth calibration of plates that stood where none of the planes does."""
    depth = calibrations["polynomial"]
    return {**calibrations, "polynomial": replace(depth, u_range=depth.u_range + 2000)}


def test_planes_beyond_the_calibrated_depths_leave_the_other_method_its_figures(
    calibrated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog, capsys
) -> None:
    found = load_calibrations(read_project(calibrated))
    monkeypatch.setattr("core.pipeline.evaluate.load_calibrations", lambda project: beyond(found))
    planes = told(["evaluate", str(calibrated)], tmp_path)["planes"]
    assert {plane["method"] for plane in planes} == {"photogrammetric"}
    assert "0 valid points" in caplog.text
    assert "outside the calibrated depths or field" in caplog.text
    assert "not judged by polynomial" in caplog.text
    alone = {"polynomial": beyond(found)["polynomial"]}
    monkeypatch.setattr("core.pipeline.evaluate.load_calibrations", lambda project: alone)
    capsys.readouterr()
    assert main(["evaluate", str(calibrated)]) == 1
    assert "outside the calibrated depths or field" in capsys.readouterr().err


def test_a_table_names_the_planes_that_one_method_has_no_points_of(whole_original: Path) -> None:
    rows = load_evaluation(read_project(whole_original))
    lost = next(row for row in rows if row.method == "polynomial")
    notes = plane_table(tuple(row for row in rows if row is not lost), None).notes
    assert f"Not judged by polynomial, which has no points there: {lost.capture}." in notes
    assert not any("Not judged" in note for note in plane_table(rows, None).notes)


def test_no_points_at_all_are_no_passed_ones(calibrated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    project, words = read_project(calibrated), ["--method", "polynomial", "--out", str(tmp_path / "p.npz")]
    depth = load_calibrations(project)["polynomial"]
    nowhere = beyond(load_calibrations(project))["polynomial"]
    monkeypatch.setattr("core.pipeline.reconstruct.chosen_calibration", lambda project, method: (method, nowhere))
    verdict = told(["reconstruct", str(calibrated), OBJECT, *words], tmp_path)["verdict"]
    assert verdict["state"] == "failed"
    assert "no points: outside the calibrated depths" in verdict["because"][0]
    # half of what was calibrated: the points beyond are counted, by the ranges of their own pixels
    phase = decode_capture(calibrated / "captures" / OBJECT)
    middle = depth.u_range.mean(axis=0)
    narrow = replace(depth, u_range=np.stack([depth.u_range[0], middle]))
    monkeypatch.setattr("core.pipeline.reconstruct.chosen_calibration", lambda project, method: (method, narrow))
    verdict = told(["reconstruct", str(calibrated), OBJECT, "--extrapolate", *words], tmp_path)["verdict"]
    off = (phase.u < depth.u_range[0]) | (phase.u > middle)
    assert verdict["state"] == "doubtful"
    count, total = (int(n) for n in re.match(r"(\d+) of (\d+) points lie beyond", verdict["because"][0]).groups())
    assert count == pytest.approx(np.count_nonzero(off), rel=0.01)
    assert total >= count
