"""`stripe-core create`: a project from the makers' values, checked as its files would be."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from core.cli import main
from core.project import read_project, read_testfield

PAIR = ("--camera", "748x576,0.008,12", "--projector", "640x640,0.09,182")


def test_what_was_given_is_what_the_files_say(tmp_path: Path) -> None:
    folder = tmp_path / "a rig"
    boards = ("--board", "5x7,20,8", "--plate", "4x6,30.5,4", "--black-on-white")
    scale = ("--scale", "0,0", "4,6", "144.2", "0.02")
    assert main(["create", str(folder), *PAIR, *boards, *scale, "--sequence", "gray-sine:period=24"]) == 0
    data = json.loads((folder / "project.json").read_text())
    assert data["camera"] == {"width": 748, "height": 576, "pitch_mm": [0.008, 0.008], "nominal_c_mm": 12}
    assert data["projector"] == {"width": 640, "height": 640, "pitch_mm": [0.09, 0.09], "nominal_c_mm": 182}
    assert data["scale"] == {"from": [0, 0], "to": [4, 6], "length_mm": 144.2, "sigma_mm": 0.02}
    assert (data["name"], data["sequence"]["period"], data["captures"]) == ("a rig", 24, [])
    field, plate = (read_testfield(folder / name) for name in ("testfield.csv", "plate.csv"))
    assert (field.polarity, len(field.row), len(plate.row)) == ("black-on-white", 35, 24)
    first, last = field.index()[0, 0], field.index()[4, 6]
    np.testing.assert_allclose(field.xyz_mm[last] - field.xyz_mm[first], [120, -80, 0])
    assert set(plate.diameter_mm) == {4.0}


def test_a_board_comes_from_a_file_with_its_kind(tmp_path: Path) -> None:
    rows = "\n".join(f"{k // 4},{k % 4},{k % 4 * 30},{-(k // 4) * 30},0,30" for k in range(12))
    (tmp_path / "squares.csv").write_text(f"# kind: chessboard\nrow,col,x_mm,y_mm,z_mm,diameter_mm\n{rows}\n")
    assert main(["create", str(tmp_path / "p"), *PAIR, "--board", str(tmp_path / "squares.csv")]) == 0
    assert read_testfield(tmp_path / "p" / "testfield.csv").kind == "chessboard"


def test_a_name_of_several_lines_says_nothing_of_the_board(tmp_path: Path) -> None:
    assert main(["create", str(tmp_path / "p"), *PAIR, "--name", "A rig\nkind: rings\npolarity: black-on-white"]) == 0
    field = read_testfield(tmp_path / "p" / "testfield.csv")
    assert (field.kind, field.polarity) == ("dots", "white-on-black")


def test_several_cameras_and_a_projector_that_labels_places(tmp_path: Path) -> None:
    cameras = ("--camera", "left=1280x1024,0.0048,8", "--camera", "right=1280x1024,0.0048x0.005,8.5")
    assert main(["create", str(tmp_path / "p"), *cameras, "--projector", "lamp=912x1140", "--name", "Two"]) == 0
    project = read_project(tmp_path / "p")
    assert project.name == "Two"
    assert {name: device.pitch_mm for name, device in project.rig.cameras.items()} == {
        "left": (0.0048, 0.0048),
        "right": (0.0048, 0.005),
    }
    assert project.rig.projectors["lamp"].labels_only


@pytest.mark.parametrize(
    ("given", "named"),
    [
        (("--camera", "748x576,0.008", *PAIR[2:]), "--camera: 748x576,0.008"),
        (("--camera", "748,0.008,12", *PAIR[2:]), "--camera: 748,0.008,12"),
        (("--camera", "748x576,8,12", *PAIR[2:]), "neither in µm"),
        (("--camera", "748x576,nan,12", *PAIR[2:]), "pitch_mm"),
        (("--camera", "0x576,0.008,12", *PAIR[2:]), "width is 0"),
        ((*PAIR, "--camera", "b=748x576,0.008,12"), "name each"),
        (("--camera", "a=9x9,0.1,1", "--camera", "a=9x9,0.1,1", *PAIR[2:]), "a is there already"),
        (("--camera", "lamp=748x576,0.008,12", "--projector", "lamp=640x640,0.09,182"), "lamp"),
        ((*PAIR, "--board", "13x19,5,12"), "13x19,5,12"),
        ((*PAIR, "--board", "1x19,12,5"), "1x19,12,5"),
        ((*PAIR, "--board", "90000x90000,12,5"), "8100000000 targets"),
        ((*PAIR, "--plate", "missing.csv"), "missing.csv"),
        ((*PAIR, "--scale", "0,0", "12,19", "258", "0.02"), "row 12, col 19"),
        ((*PAIR, "--scale", "0,0", "here", "258", "0.02"), "here"),
        ((*PAIR, "--scale", "0,0", "12,18", "258", "0"), "sigma_mm"),
        ((*PAIR, "--sequence", "grey"), "grey"),
    ],
)
def test_what_cannot_be_is_named_and_nothing_is_left(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], given: tuple[str, ...], named: str
) -> None:
    assert main(["create", str(tmp_path / "deep" / "p"), *given]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert named in line
    assert list(tmp_path.iterdir()) == []
