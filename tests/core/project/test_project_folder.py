"""A folder written comes back, and everything wrong with one is told by file, value and remedy."""

from __future__ import annotations

import errno
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from core.atomic import check_place, write_json
from core.errors import InputError
from core.model import (
    DeviceSpec,
    Network,
    NetworkDevice,
    NetworkScale,
    Note,
    PhaseMap,
    ScaleBar,
    Seed,
    Subject,
    TargetSet,
    Testfield,
)
from core.patterns import reference_sequence
from core.pipeline.check import check_project
from core.pipeline.decode import read_phase, write_phase
from core.project import (
    add_capture,
    atomic_write,
    find_project,
    iterate_images,
    load_archive,
    read_capture,
    read_image,
    read_network,
    read_project,
    read_testfield,
    save_archive,
    write_image,
    write_network,
    write_project,
    write_testfield,
)
from tests.captures import write_capture

CAMERA = DeviceSpec(40, 30, (0.008, 0.008), 12.0)
PROJECTOR = DeviceSpec(64, 48, (0.09, 0.09), 182.0, r0_mm=3.0)
SCALE = ScaleBar((0, 0), (1, 1), 16.9, 0.005)
FIELD = Testfield(
    np.array([0, 0, 1, 1]),
    np.array([0, 1, 0, 1]),
    np.array([[0.0, 0, 0], [12, 0, 0.5], [0, -12, 0], [12, -12, 0]]),
    np.full(4, 5.0),
    "black-on-white",
)
SEEDS = tuple(Seed(int(r), int(c), 3.25, 7.5 + c) for r, c in zip(FIELD.row, FIELD.col, strict=True))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A small project with one capture, every part of it valid."""
    write_testfield(tmp_path / "testfield.csv", FIELD, "a board")
    rng = np.random.default_rng(0)
    frames = [(p, rng.integers(0, 255, (30, 40), dtype=np.uint8)) for p in reference_sequence(64, 48)]
    write_capture(tmp_path / "captures/tf-01", Subject("testfield", testfield="testfield.csv"), frames, SEEDS)
    write_project(tmp_path, "Prüfstand", CAMERA, PROJECTOR, SCALE, ["captures/tf-01"], reference="brenner1999")
    return tmp_path


def edit(path: Path, **changes: Any) -> None:
    """Change fields of a JSON file; None removes one."""
    data = json.loads(path.read_text())
    data.update(changes)
    path.write_text(json.dumps({k: v for k, v in data.items() if v is not None}))


def test_a_project_comes_back(folder: Path) -> None:
    project = read_project(folder)
    assert (project.name, project.camera, project.projector, project.scale) == ("Prüfstand", CAMERA, PROJECTOR, SCALE)
    assert project.reference == "brenner1999"
    capture = read_capture(project.captures[0], project)
    assert [f.pattern for f in capture.frames] == reference_sequence(64, 48)
    assert capture.seeds == SEEDS
    assert capture.testfield is not None
    np.testing.assert_array_equal(capture.testfield.xyz_mm, FIELD.xyz_mm)
    assert capture.testfield.polarity == "black-on-white"
    assert len(list(iterate_images(capture, project.camera))) == len(capture.frames)


def test_a_capture_finds_its_project(folder: Path) -> None:
    assert find_project(folder / "captures/tf-01") == folder.resolve()
    assert read_capture(folder / "captures/tf-01").testfield is not None


def test_a_capture_is_listed_once_and_unknown_keys_stay(folder: Path) -> None:
    edit(folder / "project.json", operator="Ute")
    add_capture(folder, "captures/tf-02")
    add_capture(folder, "captures/tf-02")
    data = json.loads((folder / "project.json").read_text())
    assert (data["captures"], data["operator"]) == (["captures/tf-01", "captures/tf-02"], "Ute")


def test_a_file_twice_under_one_pattern_is_taken_once_and_told(folder: Path) -> None:
    path = folder / "captures/tf-01/capture.json"
    frames = json.loads(path.read_text())["frames"]
    edit(path, frames=[*frames, frames[0]])
    capture = read_capture(path.parent, read_project(folder))
    assert len(capture.frames) == len(frames)
    name = frames[0]["file"]
    assert capture.notes == (f"capture.json: {name} stands 2 times under one pattern: taken once",)


def test_a_slip_in_a_key_is_told_and_another_programs_key_is_not(folder: Path) -> None:
    """Unknown keys are no error: the format allows them. One beside a missing key that is like it may be meant."""
    whole = read_project(folder)
    assert not whole.notes
    assert not read_capture(whole.captures[0], whole).notes
    device = json.loads((folder / "project.json").read_text())["camera"]
    edit(folder / "project.json", operator="Ute", scale=None, scales=1, camera={**device, "intereor": {}})
    assert read_project(folder).notes == (
        "project.json: 'scales' is not known and was ignored; is 'scale' meant?",
        "project.json, camera: 'intereor' is not known and was ignored; is 'interior' meant?",
    )
    frames = json.loads((folder / "captures/tf-01/capture.json").read_text())["frames"]
    edit(folder / "captures/tf-01/capture.json", frames=[{**frame, "exposure": 5} for frame in frames], angle=3)
    for _ in range(2):  # frames that were read before are told, too
        first, second = read_capture(folder / "captures/tf-01", read_project(folder)).notes
        assert first == "capture.json: 'angle' is not known and was ignored; is 'angle_deg' meant?"
        assert second.startswith("capture.json, frame 0: 'exposure' is not known")
    told = [str(item) for item in check_project(folder)]
    assert "project.json: 'scales' is not known and was ignored; is 'scale' meant?" in told
    assert "captures/tf-01/capture.json: 'angle' is not known and was ignored; is 'angle_deg' meant?" in told


def test_check_holds_the_scale_bar_against_the_board(folder: Path) -> None:
    """A board in cm was told after 46 s of calibrating, and `check` said that everything fits."""
    scale = json.loads((folder / "project.json").read_text())["scale"]
    assert not [item for item in check_project(folder) if "scale bar" in item.seen]
    edit(folder / "project.json", scale={**scale, "length_mm": 10 * scale["length_mm"]})
    (told,) = [item for item in check_project(folder) if "scale bar" in item.seen]
    assert "is it in cm" in told.seen


def test_check_tells_patterns_from_which_no_coordinate_follows(folder: Path) -> None:
    """Decoding refused such a capture, and `check` said that everything fits."""
    path = folder / "captures/tf-01/capture.json"
    frames = json.loads(path.read_text())["frames"]
    pattern = {"kind": "phase", "axis": "x", "period": 16, "steps": 4, "step": 0, "shift_rad": 0, "profile": "sine"}
    edit(path, frames=[{**frame, "pattern": {**pattern, "step": k}} for k, frame in enumerate(frames[:2])])
    told = [str(item) for item in check_project(folder)]
    assert any("captures/tf-01, axis x" in text for text in told), told


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"version": 3}, "version is 3"),
        ({"version": None}, "'version' is missing"),
        ({"format": "stripe-capture"}, "format is 'stripe-capture'"),
        ({"camera": None}, "'camera' is missing"),
        ({"camera": {"width": 0, "height": 30, "pitch_mm": [0.008, 0.008], "nominal_c_mm": 12}}, "width is 0"),
        ({"camera": {"width": 40, "height": 30, "pitch_mm": [0.008], "nominal_c_mm": 12}}, "pitch_mm is"),
        ({"projector": {"width": 40, "height": 30, "pitch_mm": [1, 1], "nominal_c_mm": "long"}}, "'long'"),
        ({"scale": {"from": [0, 0], "to": [0, 0], "length_mm": 9, "sigma_mm": 1}}, "two different"),
        ({"scale": {"from": [0, 0], "to": [0, 1], "length_mm": -9, "sigma_mm": 1}}, "length_mm is -9"),
        ({"scale": {"from": [0.5, 0], "to": [0, 1], "length_mm": 9, "sigma_mm": 1}}, "scale: from: row is 0.5"),
        (
            {"scale": {"from": [0, 0], "to": [0, 1], "length_mm": 190, "sigma_mm": 50}},
            "sigma_mm is 50.0; length_mm is 190",
        ),
        (
            {"scale": {"from": [0, 0], "to": [0, 1], "length_mm": 190, "sigma_mm": 1e-12}},
            "sigma_mm is 1e-12; no length of 190 mm is known so well",
        ),
        ({"captures": ["captures/none"]}, "captures/none"),
        ({"captures": "all"}, "'all'"),
        ({"captures": ["captures/tf-01", "captures/tf-01/"]}, "list every capture once"),
        ({"captures": ["captures/tf-01", "captures/../captures/tf-01"]}, "once; it is 'captures/tf-01' too"),
        ({"captures": ["x" * 5000]}, "which is not there"),
        ({"captures": ["nul\0"]}, "which is not there"),
        ({"version": 10**400}, "version is 1000"),
        ({"camera": {"width": 1e30, "height": 30, "pitch_mm": [1, 1], "nominal_c_mm": 12}}, "width is 1e"),
        ({"camera": {"width": 40, "height": 30, "pitch_mm": [1, 1], "nominal_c_mm": 10**400}}, "nominal_c_mm is 1000"),
        ({"camera": {"width": 40, "height": 30, "pitch_mm": [1, 1e-300], "nominal_c_mm": 12}}, "1 is 1e-300"),
    ],
)
def test_a_wrong_project_is_told(folder: Path, changes: dict[str, Any], told: str) -> None:
    edit(folder / "project.json", **changes)
    with pytest.raises(InputError, match=told) as caught:
        read_project(folder)
    assert "project.json" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", ["", "{", "[1, 2]", '{"format": NaN}', "\xff", "9" * 5000])
def test_a_file_that_is_no_project_is_told(folder: Path, content: str) -> None:
    (folder / "project.json").write_text(content, encoding="latin-1")
    with pytest.raises(InputError, match=r"project\.json"):
        read_project(folder)


def test_an_empty_folder_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"project\.json"):
        read_project(tmp_path)
    with pytest.raises(InputError, match=r"capture\.json"):
        read_capture(tmp_path)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"version": 9}, "version is 9"),
        ({"role": "portrait"}, "role is 'portrait'"),
        ({"frames": []}, "frames is"),
        ({"frames": [{"file": "999.png", "pattern": {"kind": "white"}}]}, r"999\.png"),
        ({"frames": [{"file": "000.png", "pattern": {"kind": "plaid"}}]}, "kind is 'plaid'"),
        ({"frames": [{"pattern": {"kind": "white"}}]}, "'file' is missing"),
        ({"testfield": "lost.csv"}, r"lost\.csv"),
        ({"testfield": "lost\0"}, "no file name"),
        ({"role": "depth"}, "'z_mm' is missing"),
        ({"role": "depth", "z_mm": float("nan")}, "z_mm is nan"),
    ],
)
def test_a_wrong_capture_is_told(folder: Path, changes: dict[str, Any], told: str) -> None:
    edit(folder / "captures/tf-01/capture.json", **changes)
    with pytest.raises(InputError, match=told):
        read_capture(folder / "captures/tf-01")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,0,0,0,5\n0,0,12,0,0,5\n", "row 0, col 0 is there already"),
        ("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,nan,0,0,5\n", "x_mm is 'nan'"),
        ("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,0,0,0,-5\n", "diameter_mm is -5"),
        ("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0.5,0,0,0,5\n", "col is 0.5"),
        ("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,0\n", "y_mm is ''"),
        ("row,col,x,y\n0,0,0,0\n", "'x_mm'"),
        ("row,col,x_mm,y_mm,z_mm,diameter_mm\n", "no rows"),
        ("", "empty"),
        ("# polarity: pink\nrow,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,0,0,0,5\n", "polarity is 'pink'"),
    ],
)
def test_a_wrong_testfield_is_told(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(InputError, match=told) as caught:
        read_testfield(tmp_path / "t.csv")
    assert "t.csv" in str(caught.value)


def test_comments_blank_lines_and_other_columns_do_not_matter(tmp_path: Path) -> None:
    text = "# made by hand\n\nname,row,col,x_mm,y_mm,z_mm,diameter_mm\na, 0, 1, 2, 3, 4, 5  # corner\n"
    (tmp_path / "t.csv").write_text("\ufeff" + text, encoding="utf-8")
    field = read_testfield(tmp_path / "t.csv")
    assert (field.row[0], field.col[0], *field.xyz_mm[0], field.diameter_mm[0]) == (0, 1, 2, 3, 4, 5)
    assert field.polarity == "white-on-black"


@pytest.mark.parametrize(
    "seeds", [[{"row": 0, "col": 0, "u": "left", "v": 1}], [{"row": 0, "col": 0, "u": float("nan"), "v": 1}], ["here"]]
)
def test_wrong_picks_are_told(folder: Path, seeds: list[Any]) -> None:
    edit(folder / "captures/tf-01/picks.json", seeds=seeds)
    with pytest.raises(InputError, match=r"picks\.json: seed 0"):
        read_capture(folder / "captures/tf-01")


# ----------------------------------------------------------------------------------------------------------- images


@pytest.mark.parametrize("name", ["frame.png", "frame.tif", "frame.tiff"])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_images_come_back(tmp_path: Path, name: str, dtype: type) -> None:
    image = np.random.default_rng(0).integers(0, np.iinfo(dtype).max, (31, 17)).astype(dtype)
    write_image(tmp_path / name, image)
    read = read_image(tmp_path / name)
    assert read.dtype == dtype
    np.testing.assert_array_equal(read, image)


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_colour_is_converted_to_grey(tmp_path: Path, channels: int, dtype: type) -> None:
    grey = np.arange(12, dtype=dtype).reshape(3, 4) * 20
    cv2.imwrite(str(tmp_path / "c.png"), np.dstack([grey] * channels))
    read = read_image(tmp_path / "c.png")
    assert read.dtype == dtype
    np.testing.assert_array_equal(read, grey)


@pytest.mark.parametrize("name", ["f.png", "f.tif"])
@pytest.mark.parametrize("keep", [0.0, 0.01, 0.5, 0.98])
def test_a_truncated_image_is_refused(
    tmp_path: Path, name: str, keep: float, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / name
    write_image(path, np.random.default_rng(0).integers(0, 255, (60, 80), dtype=np.uint8))
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * keep)])
    with pytest.raises(InputError, match=name):
        read_image(path)
    assert capfd.readouterr().err == ""


def test_a_damaged_png_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "f.png"
    write_image(path, np.random.default_rng(0).integers(0, 255, (60, 80), dtype=np.uint8))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 0x40
    path.write_bytes(bytes(data))
    with pytest.raises(InputError, match="checksum"):
        read_image(path)
    assert capfd.readouterr().err == ""


def test_text_and_floats_are_no_frames(tmp_path: Path) -> None:
    (tmp_path / "f.png").write_text("not an image")
    with pytest.raises(InputError, match="not a whole PNG or TIFF"):
        read_image(tmp_path / "f.png")
    cv2.imwrite(str(tmp_path / "f.tif"), np.zeros((4, 4), np.float32))
    with pytest.raises(InputError, match="float32"):
        read_image(tmp_path / "f.tif")


def test_frames_of_different_sizes_or_depths_are_refused(folder: Path) -> None:
    capture = read_capture(folder / "captures/tf-01")
    write_image(capture.frames[7].path, np.zeros((30, 41), np.uint8))
    with pytest.raises(InputError, match=r"007\.png.*41x30.*40x30"):
        list(iterate_images(capture))
    write_image(capture.frames[7].path, np.zeros((30, 40), np.uint16))
    with pytest.raises(InputError, match=r"007\.png.*uint16"):
        list(iterate_images(capture))
    with pytest.raises(InputError, match=r"000\.png.*project\.json"):
        list(iterate_images(capture, DeviceSpec(99, 30, (0.01, 0.01), 9.0)))


# ------------------------------------------------------------------------------------------------- atomic, archives


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    path.write_text("old")
    with pytest.raises(RuntimeError), atomic_write(path) as file:  # noqa: PT012
        file.write(b"new and half")
        raise RuntimeError
    assert [p.name for p in tmp_path.iterdir()] == ["result.json"]
    assert path.read_text() == "old"


def test_a_place_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"), atomic_write(tmp_path / "file" / "x"):
        pass


def test_a_disk_that_may_only_be_read_is_told_by_the_files_own_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such a disk refuses to take away what is not there, too: that error came instead, with a name of ours."""

    def refused(*_: Any, **__: Any) -> Any:
        raise OSError(errno.EROFS, "Read-only file system")

    monkeypatch.setattr(Path, "open", refused)
    monkeypatch.setattr(Path, "unlink", refused)
    with pytest.raises(InputError, match=r"x\.json: cannot be written \(Read-only"), atomic_write(tmp_path / "x.json"):
        pass


def test_a_place_is_tried_beforehand_and_left_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("old")
    check_place(tmp_path / "file")
    check_place(tmp_path / "new" / "folder" / "x.json")
    for wrong in (tmp_path, tmp_path / "file" / "x", tmp_path / ("x" * 300)):
        with pytest.raises(InputError):
            check_place(wrong)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "old"


def test_a_name_as_long_as_names_can_be_is_written(tmp_path: Path) -> None:
    for name in ("x" * 255, "\U0001d54a" * 63):
        check_place(tmp_path / name)
        write_json(tmp_path / name, [1])
    with pytest.raises(InputError, match="give a shorter name"):
        check_place(tmp_path / ("x" * 256))


def test_links_and_pipes_stay_what_they_are(tmp_path: Path) -> None:
    link, pipe = tmp_path / "link.json", tmp_path / "pipe"
    link.symlink_to("target.json")
    write_json(link, [1])
    assert link.is_symlink()
    assert json.loads((tmp_path / "target.json").read_text()) == [1]
    os.mkfifo(pipe)
    check_place(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_json(pipe, [2])
        assert json.loads(os.read(reader, 100)) == [2]
    finally:
        os.close(reader)
    assert pipe.is_fifo()


@pytest.mark.parametrize("tree", ["[]", '"text"', "[" * 100_000, '{"version": 1, "value": {"class": [], "fields": 3}}'])
def test_a_foreign_archive_is_told(tmp_path: Path, tree: str) -> None:
    path = tmp_path / "result.npz"
    np.savez(path, tree=np.array(tree))
    with pytest.raises(InputError, match=r"result\.npz: damaged"):
        load_archive(path, PhaseMap)


def test_what_is_no_archive_is_not_said_to_hold_anything(tmp_path: Path) -> None:
    for start in (b"\x80\x04", b"", b"\x93NUMPY"):
        (tmp_path / "result.npz").write_bytes(start + b"a" * 90)
        with pytest.raises(InputError, match=r"result\.npz: damaged \(no archive\)"):
            load_archive(tmp_path / "result.npz", PhaseMap)


def test_an_archive_with_an_unknown_compression_is_told(tmp_path: Path) -> None:
    path = tmp_path / "result.npz"
    np.savez(path, tree=np.array("{}"))
    data = bytearray(path.read_bytes())
    data[data.rindex(b"PK\x01\x02") + 10] = 99  # the method, in the directory of the zip file
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"result\.npz: damaged"):
        load_archive(path, PhaseMap)


def test_results_come_back(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    ones = np.ones((2, 2))
    targets = TargetSet(
        "tf", np.arange(2), np.arange(2), rng.normal(size=(2, 2)), np.ones((2, 2, 2)), ones, ones, ones, ones[0]
    )
    targets = replace(targets, notes=(Note("two", "mistake"), Note("one")))
    save_archive(tmp_path / "t.npz", (targets, targets))
    back = load_archive(tmp_path / "t.npz", tuple)
    assert len(back) == 2
    np.testing.assert_array_equal(back[1].camera_uv, targets.camera_uv)
    assert [(note, note.names) for note in back[1].notes] == [("two", "mistake"), ("one", "capture")]
    whole = PhaseMap(*(np.ones((2, 2), np.float32) for _ in range(6)), np.ones((2, 2), np.uint8), notes=targets.notes)
    write_phase(tmp_path / "p.npz", whole)
    assert [note.names for note in read_phase(tmp_path / "p.npz").notes] == ["mistake", "capture"]
    with pytest.raises(InputError, match="holds tuple"):
        load_archive(tmp_path / "t.npz", TargetSet)
    (tmp_path / "t.npz").write_bytes((tmp_path / "t.npz").read_bytes()[:200])
    with pytest.raises(InputError, match="damaged"):
        load_archive(tmp_path / "t.npz", tuple)
    with pytest.raises(InputError, match="not there"):
        load_archive(tmp_path / "none.npz", tuple)


# --------------------------------------------------------------------------------------------------------- networks


@pytest.fixture
def network_folder(tmp_path: Path) -> Path:
    network = Network(
        {"cam": NetworkDevice(DeviceSpec(748, 576, (0.008, 0.008), 12.0, 3.0), ("c", "A1"))},
        ("1", "2"),
        ("cam", "cam"),
        (0, 1),
        ("a", "b", "c"),
        np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0.25]]),
        np.array([0, 0, 1]),
        np.array([0, 1, 2]),
        np.array([[1.5, 2.5], [3, 4], [5, 6]]),
        np.full((3, 2), 0.05),
        NetworkScale(0, 1, 1.0, 0.01),
    )
    write_network(tmp_path, network)
    return tmp_path


def test_a_network_comes_back(network_folder: Path) -> None:
    network = read_network(network_folder)
    assert network.devices["cam"].estimate == ("c", "A1")
    assert network.devices["cam"].spec.zero_radius_mm == 3.0
    assert (network.station_names, network.point_names) == (("1", "2"), ("a", "b", "c"))
    np.testing.assert_array_equal(network.observation_uv, [[1.5, 2.5], [3, 4], [5, 6]])
    assert network.scale == NetworkScale(0, 1, 1.0, 0.01)


@pytest.mark.parametrize(
    ("file", "old", "new", "told"),
    [
        ("observations.csv", "2,c,", "7,c,", "station is '7'"),
        ("observations.csv", "2,c,", "2,z,", "point is 'z'"),
        ("observations.csv", "1,b,", "1,a,", "there already"),
        ("observations.csv", "1,a,1.5", "1,a,nan", "u is 'nan'"),
        ("observations.csv", "1,a,1.5", "1,a,1_5", "u is '1_5'"),
        ("observations.csv", "1,a,1.5", "1,a,1e300", "u is 1e"),
        ("observations.csv", "1,a,1.5", "1,a," + 200_000 * "5", "field larger than"),
        ("observations.csv", "1,a,1.5", "1,a,1,5", "6 fields, and the header 5"),
        ("observations.csv", "u,v", "u,u,v", "'u' 2 times"),
        ("observations.csv", ",0.05", ",0", "sigma_px is 0"),
        ("points.csv", "b,", "a,", "there already"),
        ("network.json", '"device": "cam"', '"device": "eye"', "device is 'eye'"),
        ("network.json", '"A1"', '"A9"', "estimate is 'A9'"),
        ("network.json", '"from": "a"', '"from": "q"', "from is 'q'"),
        ("network.json", '"version": 1', '"version": 3', "version is 3"),
    ],
)
def test_a_wrong_network_is_told(network_folder: Path, file: str, old: str, new: str, told: str) -> None:
    path = network_folder / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=told) as caught:
        read_network(network_folder)
    assert file in str(caught.value)


def test_points_at_one_place_are_no_network(network_folder: Path) -> None:
    """Zeros for coordinates that nobody knows: no adjustment begins there."""
    path = network_folder / "points.csv"
    head, *rows = path.read_text().splitlines()
    path.write_text("\n".join([head, *(f"{row.split(',')[0]},0,0,0" for row in rows)]) + "\n")
    with pytest.raises(InputError, match=r"points\.csv: all \d points are at one place"):
        read_network(network_folder)
