"""Bad input: one line that names the file and the value, exit code 2, and nothing written."""

from __future__ import annotations

import json
import os
import resource
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from core.cli import main
from core.pipeline.check import check_project
from tests.copies import own

pytestmark = pytest.mark.usefixtures("plain_reports")

Edit = Callable[..., None]


def files_of(folder: Path) -> dict[str, tuple[int, ...]]:
    """What tells that a file was written, even with the same content: its number, size and time."""
    found = (os.path.join(at, name) for at, _, names in os.walk(folder) for name in names)
    return {name: ((s := os.stat(name)).st_ino, s.st_size, s.st_mtime_ns) for name in found}


@pytest.fixture
def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run a command that must be refused; give its one line."""

    def run(*arguments: object) -> str:
        before = files_of(tmp_path)
        assert main([str(a) for a in arguments]) == 2
        told = capsys.readouterr().err
        assert len(told.splitlines()) == 1, told
        assert files_of(tmp_path) == before
        return told

    return run


PLANE = "captures/plane+00"
DECODE, CALIBRATE = f"decode {PLANE} --out f.npz", "calibrate ."
BOMB = b"P5 100000 100000 255\n" + bytes(1000)


def frames_of(capture: Path, kept: Callable[[dict[str, Any]], bool]) -> None:
    """Leave those frames of a capture whose patterns are to be kept."""
    data = json.loads((capture / "capture.json").read_text())
    left = [f for f in data["frames"] if kept(f["pattern"])]
    assert len(left) < len(data["frames"])
    (capture / "capture.json").write_text(json.dumps({**data, "frames": left}))


def one_file_twice(capture: Path) -> None:
    data = json.loads((capture / "capture.json").read_text())
    data["frames"][4]["file"] = data["frames"][3]["file"]
    (capture / "capture.json").write_text(json.dumps(data))


def one_bit(path: Path) -> None:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(own(path)), 255 * (image > 60).astype(np.uint8), [cv2.IMWRITE_PNG_BILEVEL, 1])


def steps_up_to(count: int) -> Callable[[dict[str, Any]], bool]:
    return lambda pattern: pattern.get("axis") != "x" or pattern.get("step", 0) < count


@pytest.mark.parametrize(
    ("command", "file", "spoil", "words"),
    [
        (DECODE, f"{PLANE}/003.png", Path.unlink, ["003.png"]),
        (DECODE, f"{PLANE}/003.png", lambda path: own(path).write_bytes(BOMB), ["003.png: 1021 bytes"]),
        (DECODE, PLANE, lambda path: frames_of(path, lambda p: p.get("bit") != 0 or p["axis"] != "x"), ["plane+00"]),
        (DECODE, PLANE, lambda path: frames_of(path, steps_up_to(2)), ["plane+00"]),
        (DECODE, PLANE, one_file_twice, ["capture.json", "003.png stands under two patterns"]),
        (DECODE, f"{PLANE}/003.png", one_bit, ["003.png: has 1 bit a pixel", "8 or 16 bit"]),
        (
            CALIBRATE,
            "captures/testfield-02/005.png",
            lambda path: cv2.imwrite(str(own(path)), np.zeros((10, 12), np.uint8)),
            ["005.png", "12x10"],
        ),
        (
            CALIBRATE,
            "captures/testfield-07/011.png",
            lambda path: os.truncate(own(path), 2000),
            ["testfield-07/011.png"],
        ),
        (
            CALIBRATE,
            "testfield.csv",
            lambda path: path.write_text(path.read_text() + path.read_text().splitlines()[-1] + "\n"),
            ["testfield.csv: line"],
        ),
    ],
    ids=["missing", "claims", "bits", "steps", "named twice", "one bit", "sizes", "truncated", "duplicate"],
)
def test_spoiled_files(
    quick: Path,
    refused: Callable[..., str],
    monkeypatch: pytest.MonkeyPatch,
    command: str,
    file: str,
    spoil: Callable[[Path], object],
    words: list[str],
) -> None:
    monkeypatch.chdir(quick)
    spoil(quick / file)
    told = refused(*command.split())
    assert all(word in told for word in words)


def test_three_phase_steps_are_enough(quick: Path) -> None:
    frames_of(quick / PLANE, steps_up_to(3))
    assert main(["decode", str(quick / PLANE), "--out", str(quick / "f.npz")]) == 0


def test_an_unknown_pattern_kind(quick: Path, refused: Callable[..., str], edit_json: Edit) -> None:
    edit_json(quick / PLANE / "capture.json", frames=[{"file": "000.png", "pattern": {"kind": "moire"}}])
    assert "'moire'" in refused("decode", quick / PLANE, "--out", quick / "f.npz")


@pytest.mark.parametrize(
    "change",
    [
        lambda seeds: [*seeds[:3], {**seeds[3], "row": seeds[0]["row"], "col": seeds[0]["col"]}],  # one name twice
        lambda seeds: [*seeds[:3], {**seeds[3], "u": seeds[0]["u"], "v": seeds[0]["v"]}],  # one dot twice
        lambda seeds: [*seeds[:3], {**seeds[3], "u": 5000.0}],  # outside the image
        lambda seeds: [*seeds[:3], {**seeds[3], "row": 99}],  # not on the board
        lambda seeds: seeds[:3],
        lambda seeds: [seeds[1], seeds[0], *seeds[2:]][:2] + seeds[2:3],
        lambda seeds: [{**seeds[0], "col": seeds[0]["col"] + 1}, *seeds[1:]],  # one column beside
        lambda seeds: [
            {**s, "row": t["row"], "col": t["col"]}
            for s, t in zip(seeds, [seeds[1], seeds[0], *seeds[2:]], strict=True)
        ],
    ],
)
def test_picks_that_contradict(
    quick: Path, refused: Callable[..., str], edit_json: Edit, change: Callable[..., Any]
) -> None:
    picks = quick / "captures/testfield-03/picks.json"
    seeds = json.loads(picks.read_text())["seeds"]
    edit_json(picks, seeds=change(seeds))
    edit_json(quick / "project.json", captures=["captures/testfield-03"])
    told = refused("measure", quick)
    assert "testfield-03" in told


def test_check_tells_of_picks_that_measure_refuses(quick: Path, refused: Callable[..., str], edit_json: Edit) -> None:
    name = "captures/testfield-03/picks.json"
    seeds = json.loads((quick / name).read_text())["seeds"]
    edit_json(quick / name, seeds=[{**seeds[0], "v": -3.0}, *seeds[1:]])
    assert not [item for item in check_project(quick) if item.where != name]
    (told,) = check_project(quick)
    assert f"{told.seen}; {told.remedy}" in refused("measure", quick)


def test_nan_in_the_picks(quick: Path, refused: Callable[..., str]) -> None:
    picks = quick / "captures/testfield-01/picks.json"
    data = json.loads(picks.read_text())
    data["seeds"][2]["u"] = float("nan")
    picks.write_text(json.dumps(data))
    assert "seed 2: u is nan" in refused("measure", quick)


@pytest.mark.parametrize("command", ["measure", "calibrate", "evaluate", "report"])
def test_an_empty_folder(tmp_path: Path, refused: Callable[..., str], command: str) -> None:
    assert "project.json" in refused(command, tmp_path)


def test_an_empty_network(tmp_path: Path, refused: Callable[..., str]) -> None:
    assert "network.json" in refused("adjust", tmp_path)


@pytest.mark.parametrize(
    ("command", "file"), [("calibrate", "project.json"), ("calibrate", "captures/testfield-04/capture.json")]
)
def test_a_foreign_version(quick: Path, refused: Callable[..., str], edit_json: Edit, command: str, file: str) -> None:
    edit_json(quick / file, version=7)
    told = refused(command, quick)
    assert file in told
    assert "version is 7" in told


def test_no_captures_to_calibrate_from(quick: Path, refused: Callable[..., str], edit_json: Edit) -> None:
    edit_json(quick / "project.json", captures=[])
    for method in ("photogrammetric", "polynomial", "all"):
        refused("calibrate", quick, "--method", method)


def test_no_calibration_yet(quick: Path, refused: Callable[..., str]) -> None:
    assert "calibrate" in refused("evaluate", quick)
    assert "calibrate" in refused("reconstruct", quick, "plane+00", "--out", quick / "f.ply")
    assert "'all' is unknown" in refused("reconstruct", quick, "plane+00", "--method", "all", "--out", quick / "f.ply")


def test_an_unknown_capture_scenario_or_ending(calibrated: Path, refused: Callable[..., str]) -> None:
    assert "'plane+99'" in refused("reconstruct", calibrated, "plane+99", "--out", calibrated / "f.ply")
    assert "'.xyzzy'" in refused("reconstruct", calibrated, "plane+00", "--out", calibrated / "f.xyzzy")
    assert "'wonderland'" in refused("simulate", calibrated / "new", "--scenario", "wonderland")


def test_a_folder_with_something_in_it_is_not_overwritten(quick: Path, refused: Callable[..., str]) -> None:
    """What a user added is named and stays; what the bench itself wrote may be replaced."""
    (quick / "captures" / "mine").mkdir()
    (quick / "captures" / "mine" / "capture.json").write_text("{}")
    assert "captures/mine/capture.json" in refused("simulate", quick, "--scenario", "quick")
    assert "captures/mine/capture.json" in refused("demo", quick, "--scenario", "quick")


def test_wrong_arguments(refused: Callable[..., str]) -> None:
    assert "frobnicate" in refused("frobnicate")
    assert "--out" in refused("decode", "somewhere")


def test_figures_that_cannot_be_written_are_told_before_the_work(calibrated: Path, refused: Callable[..., str]) -> None:
    nowhere = calibrated / "project.json" / "figures.json"
    for command in ("measure", "calibrate", "evaluate", "report"):
        assert "figures.json: cannot be written" in refused(command, calibrated, "--json", nowhere)
    assert "is a folder" in refused("evaluate", calibrated, "--json", calibrated)


def test_a_report_that_cannot_be_written_leaves_the_evaluation(calibrated: Path, refused: Callable[..., str]) -> None:
    assert "cannot be written" in refused("report", calibrated, "--out", calibrated / "project.json")
    own(calibrated / "results" / "runs" / "0001" / "adjustment.npz").write_bytes(b"no archive")
    assert "adjustment.npz: damaged" in refused("report", calibrated)


@pytest.mark.parametrize("value", ["elsewhere", 7, {"by": "another program"}])
def test_keys_of_other_programs_are_no_error(whole: Path, edit_json: Edit, value: object) -> None:
    edit_json(whole / "project.json", reference=value, truth=value)
    (whole / "truth.json").write_text(json.dumps({"format": "of another program", "camera": value}))
    assert main(["report", str(whole)]) == 0


def test_a_plane_that_shows_nothing_is_named(calibrated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for frame in (calibrated / PLANE).glob("[0-9]*"):
        image = cv2.imread(str(frame), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(own(frame)), np.full_like(image, 5))
    for command in ("evaluate", "report"):
        assert main([command, str(calibrated)]) == 2
        assert "plane+00: no pixel has a projector coordinate" in capsys.readouterr().err


def test_a_calibration_of_another_projector(calibrated: Path, refused: Callable[..., str], edit_json: Edit) -> None:
    other = {"width": 200, "height": 160, "pitch_mm": [0.3, 0.36], "nominal_c_mm": 182}
    edit_json(calibrated / "project.json", projector=other)
    for command in (["evaluate"], ["reconstruct", "plane+00", "--out", "x.npz"]):
        told = refused(command[0], calibrated, *command[1:])
        assert "photogrammetric.npz: is of a projector of 160 x 160 px" in told
        assert "200 x 160 px" in told


def test_a_refused_demo_keeps_the_one_before(tmp_path: Path, refused: Callable[..., str]) -> None:
    (tmp_path / ".stripe-demo").touch()
    (tmp_path / "project.json").write_text("of the demo before")
    assert "'zz'" in refused("demo", tmp_path, "--scenario", "zz")
    assert "seed: is -1" in refused("demo", tmp_path, "--scenario", "quick", "--seed", "-1")


@pytest.mark.parametrize("value", ["inf", "nan", "-1", "1e20"])
def test_options_beyond_all_measure(quick: Path, refused: Callable[..., str], value: str) -> None:
    assert "--low-pass" in refused("calibrate", quick, f"--low-pass={value}")
    if value != "1e20":
        assert "--reject" in refused("calibrate", quick, f"--reject={value}")


@pytest.mark.parametrize("name", ["x" * 300, "ä" * 60, "a\x1b[31mb", "a\udcffb", "../p", ""])
def test_names_that_no_folder_can_have(quick: Path, refused: Callable[..., str], name: str) -> None:
    assert "capture: " in refused("capture", quick, "--role", "object", "--", name)
    if len(name) > 255:
        refused("simulate", quick / name, "--scenario", "quick")
        refused("demo", quick / name, "--scenario", "quick")
        refused("reconstruct", quick, name, "--out", quick / "f.npz")
        assert "cannot be written" in refused("decode", quick / "captures/plane+00", "--out", quick / f"{name}.npz")


def test_names_cannot_move_the_cursor(quick: Path, refused: Callable[..., str], edit_json: Edit) -> None:
    edit_json(quick / "captures/testfield-01/capture.json", testfield="\x1b[2J\u202e.csv")
    told = refused("measure", quick)
    assert "\\x1b[2J\\u202e.csv" in told
    assert told[:-1].isprintable()


@pytest.mark.parametrize(
    ("file", "command"),
    [
        ("project.json", "measure"),
        ("testfield.csv", "measure"),
        ("captures/testfield-01/capture.json", "measure"),
        ("captures/testfield-01/picks.json", "measure"),
        ("captures/testfield-01/003.png", "measure"),
        ("results/runs/0001/photogrammetric.npz", "evaluate"),
    ],
)
@pytest.mark.timeout(60)
def test_a_pipe_or_a_device_in_place_of_a_file(
    calibrated: Path, refused: Callable[..., str], file: str, command: str
) -> None:
    """A reader of a pipe would wait for ever, one of /dev/zero never come to an end."""
    path = calibrated / file
    for put in (os.mkfifo, lambda p: p.symlink_to("/dev/zero")):
        path.unlink()
        put(path)
        assert Path(file).name in refused(command, calibrated)


@pytest.mark.parametrize(
    "file",
    ["project.json", "testfield.csv", "captures/testfield-01/capture.json", "captures/testfield-01/picks.json"],
)
def test_a_file_of_gigabytes_is_not_read(quick: Path, capsys: pytest.CaptureFixture[str], file: str) -> None:
    """A gap of 8 GB takes no place on the disk, and more memory than there may be."""
    os.truncate(quick / file, 8 << 30)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert main(["measure", str(quick)]) == 2
    told = capsys.readouterr().err
    assert Path(file).name in told
    assert str(8 << 30) in told
    assert len(told.splitlines()) == 1
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 500_000  # kB: a sixteenth of the file


def test_a_long_value_is_told_in_part(quick: Path, refused: Callable[..., str]) -> None:
    (quick / "testfield.csv").write_text("row" + "\0" * 100_000)
    assert len(refused("measure", quick)) < 2000


@pytest.mark.timeout(60)
def test_a_pipe_in_place_of_what_is_brought_or_kept(
    calibrated: Path, refused: Callable[..., str], capsys: pytest.CaptureFixture[str]
) -> None:
    for form in ("opencv", "ros", "agisoft"):
        os.mkfifo(calibrated / form)
        assert form in refused("import", calibrated / form, "--from", form, calibrated)
        (calibrated / form).unlink()
    for file in ("current.json", "runs/0001/run.json", "evaluation.json"):
        path = calibrated / "results" / file
        path.unlink(missing_ok=True)
        os.mkfifo(path)
        assert main(["check", str(calibrated)]) in (0, 1)
        path.unlink()
    capsys.readouterr()


@pytest.mark.parametrize("damaged", ["", '{"photogr', '{"photogrammetric": 7}'])
def test_a_damaged_pointer_to_the_runs_in_use_is_named(
    damaged: str, calibrated: Path, refused: Callable[..., str]
) -> None:
    (calibrated / "results" / "current.json").write_text(damaged)
    said = refused("evaluate", calibrated)
    assert "current.json" in said
    assert "--use N" in said


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """Let no file grow beyond a size, as on a disk that becomes full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_leaves_nothing_half_written(calibrated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    commands = [
        ["simulate", calibrated / "new", "--scenario", "quick"],
        ["demo", calibrated / "new", "--scenario", "quick"],
        ["decode", calibrated / "captures/plane+00", "--out", calibrated / "f.npz"],
        ["reconstruct", calibrated, "plane+00", "--out", calibrated / "f.npz"],
        ["reconstruct", calibrated, "plane+00", "--out", calibrated / "f.ply"],
        ["measure", calibrated],
        ["evaluate", calibrated],
        ["report", calibrated],
        ["calibrate", calibrated],
    ]
    before = files_of(calibrated)
    for command in commands:
        with files_up_to(1000):
            code = main([str(a) for a in command])
        told = capsys.readouterr().err
        assert code == 1  # what was asked for is right
        assert len(told.splitlines()) == 1, told
        assert "cannot be written" in told
        assert "make room" in told
        assert files_of(calibrated) == before
        assert not (calibrated / "new").exists()


def test_a_plate_saved_twice_is_named_where_depth_cannot_be_calibrated(
    quick: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folders = sorted((quick / "captures").glob("depth-*"))
    for earlier, later in reversed([*pairwise(folders[1:])]):
        for path in later.iterdir():
            if path.name != "capture.json":
                path.unlink()  # what is copied shares its files with the original
                shutil.copy(earlier / path.name, path)
    assert main(["calibrate", str(quick), "--method", "polynomial"]) == 1
    assert "First see to this: depth-03 has the same targets as depth-02" in capsys.readouterr().err
