"""The commands on a small experiment: the figures they write, and how close these are to the bench's truth."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from core.cli import _HEAP, _keep_freed, main, parser
from core.project.made import note_made, read_made
from tests.copies import copied


def run(*arguments: object, tmp_path: Path) -> dict[str, Any]:
    """Run a command that must succeed, and read its figures."""
    out = tmp_path / "figures.json"
    assert main([*(str(a) for a in arguments), "--json", str(out)]) == 0
    return json.loads(out.read_text())


@pytest.fixture(scope="module")
def calibration(calibrated_original: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Figures of the second calibration of the same measurements."""
    folder = tmp_path_factory.mktemp("commands")
    return run("calibrate", copied(calibrated_original, folder / "quick"), tmp_path=folder)


def test_calibrate_finds_the_true_rig_within_its_sigmas(
    calibration: dict[str, Any], quick_truth: dict[str, Any]
) -> None:
    deviations = []
    for device in ("camera", "projector"):
        found, true = calibration["photogrammetric"][device], quick_truth[device]
        assert found["r0_mm"] == pytest.approx(true["r0_mm"])
        for name in ("c_mm", "x0_mm", "y0_mm", "A1", "A2", "A3", "A4", "A5", "A6"):
            deviations.append((found[name]["value"] - true[name]) / found[name]["sigma"])
    # 18 correlated normal deviates: a root mean square of 2 has a probability below 1e-6 if they were independent
    assert np.sqrt(np.mean(np.square(deviations))) < 2.0


def test_calibrate_writes_the_figures_of_the_format(calibration: dict[str, Any]) -> None:
    found = calibration["photogrammetric"]
    assert found["stations"] == 2 * 8
    assert found["image_points"] == found["camera"]["image_points"] + found["projector"]["image_points"]
    assert len(found["camera"]["residual_rms_um"]) == 2
    assert len(found["object_sigma_rms_um"]) == 3
    R = np.array(found["projector_from_camera"]["rotation"])
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    depth = calibration["polynomial"]
    assert len(depth["depths_mm"]) == 5
    assert {"degree", "residual_rms_mm", "valid_pixels"} <= set(depth)


def test_evaluate_reports_every_plane_by_every_method(calibrated: Path, tmp_path: Path) -> None:
    planes = run("evaluate", calibrated, tmp_path=tmp_path)["planes"]
    names = {f.name for f in (calibrated / "captures").iterdir() if f.name.startswith("plane")}
    assert {(p["capture"], p["method"]) for p in planes} == {
        (name, method) for name in names for method in ("photogrammetric", "polynomial")
    }
    for plane in planes:
        assert plane["min_mm"] < 0 < plane["rms_mm"] < plane["max_mm"]
        assert plane["max_mm"] >= -plane["min_mm"]
        assert plane["excluded"] == 0 or plane["excluded_rule"]
        if plane["method"] == "photogrammetric":
            # noise of the phase explains the deviations: the bench's planes are flat to a few µm
            assert plane["rms_mm"] == pytest.approx(plane["predicted_rms_mm"], rel=0.25)


def test_decode_writes_the_arrays_of_the_format(quick: Path, tmp_path: Path) -> None:
    out = tmp_path / "phase.npz"
    run("decode", quick / "captures/plane+00", "--out", out, tmp_path=tmp_path)
    with np.load(out) as stored:
        shape = stored["u"].shape
        for name in ("u", "v", "sigma_u", "sigma_v", "modulation"):
            assert stored[name].shape == shape
            assert stored[name].dtype == np.float32
        assert np.isfinite(stored["u"]).mean() > 0.2


def test_a_capture_decodes_without_a_project(quick: Path, tmp_path: Path) -> None:
    capture = (quick / "captures/plane+00").rename(tmp_path / "alone")
    run("decode", capture, "--out", tmp_path / "phase.npz", tmp_path=tmp_path)


def test_measure_tells_every_target_or_why_not(quick: Path, tmp_path: Path) -> None:
    captures = run("measure", quick, tmp_path=tmp_path)["captures"]
    field = [c for c in captures if c["capture"].startswith("testfield")]
    assert len(field) == 8
    for capture in field:
        found = {(t["row"], t["col"]) for t in capture["targets"]}
        missing = {(m["row"], m["col"]) for m in capture["missing"] if m["reason"]}
        assert len(found) + len(missing) == len(found | missing) == 7 * 9


@pytest.mark.parametrize(
    ("method", "ending"), [("photogrammetric", "npz"), ("photogrammetric", "ply"), ("polynomial", "npz")]
)
def test_reconstruct_writes_points(calibrated: Path, tmp_path: Path, method: str, ending: str) -> None:
    out = tmp_path / f"cloud.{ending}"
    points = run("reconstruct", calibrated, "plane+00", "--method", method, "--out", out, tmp_path=tmp_path)["points"]
    assert points > 1000
    if ending == "npz":
        with np.load(out) as stored:
            assert stored["xyz"].shape[2] == 3
            assert np.isfinite(stored["xyz"][..., 2]).sum() == points
            assert ("sigma" in stored.files) == (method == "photogrammetric")
    else:
        assert f"element vertex {points}\n".encode() in out.read_bytes()[:2000]


@pytest.mark.usefixtures("plain_reports")
def test_report_writes_html_and_pdf(calibrated: Path, tmp_path: Path) -> None:
    paths = run("report", calibrated, "--out", tmp_path / "report", tmp_path=tmp_path)
    assert "<table" in Path(paths["html"]).read_text(encoding="utf-8")
    assert Path(paths["pdf"]).read_bytes().startswith(b"%PDF")


@pytest.mark.usefixtures("plain_reports")
def test_the_demo_takes_the_place_of_an_earlier_one(
    calibrated: Path, few_captures: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It begins as from an empty folder, which the fixtures and `make setup` do."""
    made = read_made(calibrated)
    note_made(
        calibrated, {key: made[key] for key in ("scenario", "seed", "sequence", "captures")} | {"demo": "complete"}
    )
    before = {file: file.read_bytes() for file in (calibrated / "captures").rglob("*.png")}
    figures = run("demo", calibrated, "--scenario", "quick", "--seed", 4, tmp_path=tmp_path)
    assert set(figures) == {"photogrammetric", "polynomial", "planes"}
    assert "Table 3" in capsys.readouterr().out
    now = {file: file.read_bytes() for file in (calibrated / "captures").rglob("*.png")}
    assert len({file.parent for file in now}) == few_captures
    assert all(before[file] != image for file, image in now.items())


def test_the_module_is_the_command(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-m", "core", "decode", str(tmp_path)], capture_output=True, text=True)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1


def test_the_parser_of_one_command_is_that_among_all() -> None:
    """Only one is made for a command: all take 12 to 30 ms."""

    def commands(whole: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
        (found,) = (action.choices for action in whole._actions if action.nargs == argparse.PARSER)
        return found

    every = commands(parser())
    for name, among in every.items():
        ((alone, made),) = commands(parser(name)).items()
        assert (alone, made.format_help()) == (name, among.format_help())
        assert made.get_default("run").__qualname__ == among.get_default("run").__qualname__
    assert list(commands(parser("nonsense"))) == list(every)


def mirrored_frames(folder: Path, y: int, z: int) -> Path:
    """Write the nominal boards with y down, or count the plate's position the other way: other labs' conventions."""
    for name in ("testfield.csv", "plate.csv"):
        lines = []
        for line in (folder / name).read_text().splitlines():
            cells = line.split(",")
            if cells[0].lstrip("-").isdigit():
                cells[3] = str(y * float(cells[3]))
            lines.append(",".join(cells))
        (folder / name).write_text("\n".join(lines))
    for path in folder.glob("captures/depth*/capture.json"):
        data = json.loads(path.read_text())
        path.write_text(json.dumps({**data, "z_mm": z * data["z_mm"]}))
    return folder


@pytest.mark.parametrize(("y", "z"), [(-1, 1), (1, -1)])
def test_boards_may_be_described_with_y_down_and_plates_counted_backwards(
    calibrated: Path, calibration: dict[str, Any], tmp_path: Path, y: int, z: int
) -> None:
    other = run("calibrate", mirrored_frames(calibrated, y, z), tmp_path=tmp_path)
    for device in ("camera", "projector"):
        for name in ("c_mm", "x0_mm", "y0_mm", "A3"):
            was, now = calibration["photogrammetric"][device][name], other["photogrammetric"][device][name]
            assert now["value"] == pytest.approx(was["value"], abs=0.02 * was["sigma"])  # the same observations
    was, now = calibration["polynomial"]["residual_rms_mm"], other["polynomial"]["residual_rms_mm"]
    assert now == pytest.approx(was, rel=1e-3)


@pytest.mark.parametrize(
    ("option", "role"),
    [("--z-mm", "object"), ("--z-mm", "testfield"), ("--angle-deg", "depth"), ("--angle-deg", "object")],
)
def test_a_position_is_for_its_role(
    quick_original: Path, capsys: pytest.CaptureFixture[str], option: str, role: str
) -> None:
    assert main(["capture", str(quick_original), "new", "--role", role, option, "5"]) == 2
    assert f"{option}: 5, with role {role}" in capsys.readouterr().err


def test_capture_runs_the_virtual_rig_of_the_project(quick: Path, tmp_path: Path) -> None:
    figures = run("capture", quick, "plane-new", "--role", "plane", "--angle-deg", 5, tmp_path=tmp_path)
    assert figures["findings"]
    assert json.loads((quick / "project.json").read_text())["captures"][-1] == "captures/plane-new"
    capture = json.loads((quick / "captures/plane-new/capture.json").read_text())
    assert (capture["role"], capture["angle_deg"], len(capture["frames"])) == ("plane", 5, figures["frames"])
    run("decode", quick / "captures/plane-new", "--out", tmp_path / "phase.npz", tmp_path=tmp_path)


def test_figures_on_standard_output_stand_alone(calibrated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("status", "runs", "check"):
        for here in (["--json", "-"], ["--json"]):
            assert main([command, str(calibrated), *here]) == 0
            told = capsys.readouterr()
            assert json.loads(told.out)
            assert told.err  # the words


def test_a_project_that_may_only_be_read_is_oriented(calibrated: Path, tmp_path: Path) -> None:
    (calibrated / "results" / "drift").touch()  # nothing can be kept there
    assert run("orient", calibrated, "plane+00", tmp_path=tmp_path)["moved"] is False


def test_a_reader_that_has_seen_enough_is_no_failure_to_tell(calibrated: Path) -> None:
    command = [sys.executable, "-m", "core", "status", str(calibrated)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""


def test_figures_are_written_though_nobody_reads_the_text(calibrated: Path, tmp_path: Path) -> None:
    figures = tmp_path / "runs.json"
    command = [sys.executable, "-m", "core", "runs", str(calibrated), "--json", str(figures)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0
    assert json.loads(figures.read_text())["runs"]


def test_points_that_are_not_written_need_no_place(calibrated: Path, tmp_path: Path, monkeypatch) -> None:
    """The working folder was asked for one, and may be read-only, or hold a folder of that name."""
    (tmp_path / "0001.ply").mkdir()
    monkeypatch.chdir(tmp_path)
    assert main(["live", str(calibrated), "--count", "1"]) == 0


def test_a_format_of_points_that_is_none_is_refused_without_a_file(calibrated: Path, capsys) -> None:
    assert main(["live", str(calibrated), "--count", "1", "--format", "jpeg"]) == 2
    assert "ends in '.jpeg'; give a file name ending in one of .e57" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["features", "object-step", "--circle=100,100,-3"],
        ["features", "object-step", "--line=10,10,10,10"],
        ["live", "--count=0"],
        ["preflight", "--depth=nan"],
    ],
)
def test_numbers_that_measure_or_count_nothing_are_refused(words: list[str], calibrated: Path, capsys) -> None:
    assert main([words[0], str(calibrated), *words[1:]]) == 2
    option, value = words[-1].split("=")
    assert capsys.readouterr().err.startswith(
        (f"stripe-core: {option}: is {value};", f"stripe-core: {option} {value}: is no {option[2:]};")
    )


def test_names_of_captures_may_follow_options(calibrated: Path, tmp_path: Path) -> None:
    out = tmp_path / "points"
    assert main(["batch", str(calibrated), "--do", "reconstruct", "--out", str(out), "plane+00", "plane+15"]) == 0
    assert {path.name for path in out.iterdir() if path.is_dir()} == {"plane+00", "plane+15"}


def test_memory_is_kept_where_the_c_library_can(monkeypatch) -> None:
    told: list[tuple[int, int]] = []
    monkeypatch.setattr("ctypes.CDLL", lambda name: SimpleNamespace(mallopt=lambda *option: told.append(option)))
    _keep_freed()
    assert dict(told) == (_HEAP if sys.platform == "linux" else {})
    monkeypatch.setattr("ctypes.CDLL", lambda name: object())  # as of musl
    _keep_freed()
