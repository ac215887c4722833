"""Rigs of several cameras and projectors, devices known before, frames that name theirs: version 2 of the files."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from core.errors import InputError
from core.model import DeviceSpec, Interior, ScaleBar, Seed, Subject
from core.patterns import Black, White
from core.project import read_capture, read_project, write_picks, write_project
from core.project.captures import write_capture_json
from core.project.images import write_image

CAMERA = DeviceSpec(8, 6, (0.01, 0.01), 12.0)
PROJECTOR = DeviceSpec(16, 16, (0.09, 0.09), 182.0)
LEFT_RIGHT = {"left": CAMERA, "right": DeviceSpec(10, 6, (0.01, 0.01), 16.0)}


def entry(**more: Any) -> dict[str, Any]:
    return {"width": 8, "height": 6, "pitch_mm": [0.01, 0.01], "nominal_c_mm": 12, **more}


def project_json(folder: Path, **keys: Any) -> Path:
    data = {"format": "stripe-project", "version": 2, "name": "x", "captures": [], **keys}
    (folder / "project.json").write_text(json.dumps(data))
    return folder


def test_two_cameras_are_written_and_read(tmp_path: Path) -> None:
    bar = ScaleBar((0, 0), (0, 5), 100.0, 0.01)
    write_project(tmp_path, "two", LEFT_RIGHT, PROJECTOR, bar, lengths=[ScaleBar((1, 0), (1, 5), 100.1, 0.01)])
    data = json.loads((tmp_path / "project.json").read_text())
    assert data["version"] == 2
    assert list(data["cameras"]) == ["left", "right"]
    project = read_project(tmp_path)
    assert project.rig.cameras == LEFT_RIGHT
    assert project.rig.projectors == {"projector": PROJECTOR}
    assert project.rig.pairs == (("left", "projector"), ("right", "projector"))
    assert (project.camera, project.projector) == (CAMERA, PROJECTOR)
    assert [bar.length_mm for bar in project.lengths] == [100.1]


def test_a_plain_rig_stays_version_1(tmp_path: Path) -> None:
    write_project(tmp_path, "one", CAMERA, PROJECTOR)
    data = json.loads((tmp_path / "project.json").read_text())
    assert data["version"] == 1
    assert {"camera", "projector"} <= data.keys()
    assert "cameras" not in data


def test_short_and_long_form_together(tmp_path: Path) -> None:
    project_json(tmp_path, camera=entry(), cameras={"second": entry(nominal_c_mm=16)}, projectors={"lamp": entry()})
    rig = read_project(tmp_path).rig
    assert list(rig.cameras) == ["second", "camera"]
    assert (rig.camera_name, rig.projector_name) == ("camera", "lamp")


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"cameras": {"a": entry()}}, "projector"),
        ({"cameras": {"a": entry()}, "projectors": {"a": entry()}}, "name of its own"),
        (
            {"cameras": {"a": entry(), "a-b": entry()}, "projectors": {"c": entry(), "b-c": entry()}},
            "means two pairs of camera",
        ),
        ({"cameras": {"a/b": entry()}, "projector": entry()}, "a device is named 'a/b'"),
        ({"cameras": {"a": {"width": 0}}, "projector": entry()}, "cameras: a"),
        ({"camera": entry(interior={"model": "fish"}), "projector": entry()}, "model is 'fish'"),
        ({"camera": entry(interior={"sigma": {"k1": 1}}), "projector": entry()}, "name parameters of A1..A6"),
        ({"camera": entry(interior={"c_mm": 1200.0}), "projector": entry()}, "c_mm is 1200; nominal_c_mm is 12"),
        ({"camera": entry(interior={"c_mm": 182.0}), "projector": entry()}, "give both of this device"),
        ({"camera": entry(interior={"A2": 1e9, "A1": 0.001}), "projector": entry()}, "interior: A2 is 1e+09: a corner"),
        ({"camera": entry(interior={"x0_mm": 4.0}), "projector": entry()}, "the principal point in mm"),
        ({"camera": entry(interior={"A1": "x"}), "projector": entry()}, "A1 is 'x'"),
        ({"camera": entry(pitch_mm=[1e-5, 1e-5]), "projector": entry()}, "neither in µm or m"),
        ({"camera": entry(), "projector": entry(response=[[1, 0], [0, 1]])}, "rising levels"),
        ({"camera": entry(), "projector": entry(response=[[0, 1], [1, 0]])}, "light that rises"),
        ({"camera": entry(), "projector": entry(response=[[0, -1], [1, 1]])}, "light that rises"),
        ({"camera": entry(), "cameras": {"camera": entry()}, "projector": entry()}, "given twice"),
        ({"camera": entry(), "projector": entry(), "version": 3}, "versions 1 and 2"),
    ],
)
def test_what_is_wrong_with_a_rig_is_told(tmp_path: Path, keys: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError) as refusal:
        read_project(project_json(tmp_path, **keys))
    assert words in str(refusal.value)
    assert "project.json" in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_known_interior_orientation(tmp_path: Path) -> None:
    known = {"model": "brown", "c_mm": 12.3, "k1": -0.1, "sigma": {"c_mm": 0.01, "k1": 0}}
    light = [[0, 0], [1, 0.9]]
    result = {"c_mm": {"value": 180.0, "sigma": 0.02}, "A1": {"value": 1e-6, "sigma": 0.0}, "r0_mm": 20.0, "hold": True}
    project_json(
        tmp_path,
        camera=entry(interior=known),
        projector=entry(pitch_mm=[0.09, 0.09], nominal_c_mm=182, interior=result, response=light),
    )
    project = read_project(tmp_path)
    camera, projector = project.camera, project.projector
    assert camera.interior is not None
    assert camera.interior.vector.tolist() == [12.3, 0, 0, -0.1, *[0] * 8]
    assert camera.interior_sigma[:4] == (0.01, math.inf, math.inf, 0)
    assert projector.interior == Interior(180.0, a=(1e-6, 0, 0, 0, 0, 0), r0_mm=20.0)
    assert set(projector.interior_sigma) == {0.0}
    assert projector.response == ((0.0, 0.0), (1.0, 0.9))
    write_project(tmp_path, "again", camera, projector)
    assert read_project(tmp_path).rig == project.rig
    assert json.loads((tmp_path / "project.json").read_text())["version"] == 2


def capture(folder: Path, *frames: dict[str, Any]) -> None:
    captures = folder / "captures" / "one"
    captures.mkdir(parents=True, exist_ok=True)
    for k in range(len(frames)):
        write_image(captures / f"{k}.png", np.zeros((6, 8), np.uint8))
    patterns = [(f"{k}.png", White() if k % 2 else Black()) for k in range(len(frames))]
    write_capture_json(captures, Subject("object"), patterns, more=frames)


def test_frames_name_their_devices(tmp_path: Path) -> None:
    write_project(tmp_path, "two", LEFT_RIGHT, PROJECTOR, captures=["captures/one"])
    capture(tmp_path, {"camera": "left"}, {"camera": "right", "exposure_ms": 12.5})
    one = read_capture(tmp_path / "captures" / "one", read_project(tmp_path))
    assert one.pairs == (("left", "projector"), ("right", "projector"))
    assert [f.exposure_ms for f in one.frames] == [None, 12.5]
    capture(tmp_path, {"camera": "left"}, {"camera": "top"})
    with pytest.raises(InputError, match=r'frame 1: camera is .top..*"left" or "right"'):
        read_capture(tmp_path / "captures" / "one", read_project(tmp_path))
    capture(tmp_path, {})
    with pytest.raises(InputError, match=r"frame 0: names no camera.*left, right"):
        read_capture(tmp_path / "captures" / "one", read_project(tmp_path))


def test_frames_of_the_only_device_need_no_name(tmp_path: Path) -> None:
    write_project(tmp_path, "one", {"eye": CAMERA}, {"lamp": PROJECTOR}, captures=["captures/one"])
    capture(tmp_path, {}, {})
    assert read_capture(tmp_path / "captures" / "one", read_project(tmp_path)).pairs == (("eye", "lamp"),)


def test_picks_of_several_cameras(tmp_path: Path) -> None:
    write_project(tmp_path, "two", LEFT_RIGHT, PROJECTOR, captures=["captures/one"])
    capture(tmp_path, {"camera": "left"}, {"camera": "right"})
    seeds = (Seed(0, 0, 1.0, 2.0), Seed(0, 1, 3.0, 4.0, "right"))
    write_picks(tmp_path / "captures" / "one" / "picks.json", seeds)
    one = read_capture(tmp_path / "captures" / "one", read_project(tmp_path))
    assert one.seeds == seeds
    assert (one.seeds_in("left"), one.seeds_in("right")) == (seeds[:1], seeds[1:])
