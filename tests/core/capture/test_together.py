"""Several cameras on one pattern: each camera's frames are of its own view, verified, taken again together."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from core.bench import experiment
from core.capture import Store, run_capture
from core.cli import main
from core.devices.scene import FlatScene
from core.errors import DeviceError, InputError
from core.geometry import project, ray_directions
from core.model import DeviceSpec, Project, Subject
from core.pipeline import decode_capture
from core.project import read_capture, read_image, read_project, write_project
from tests.core.capture.test_power_cuts import FLAT, PATTERNS, run_and_kill


@pytest.fixture
def stereo(tmp_path: Path) -> Project:
    """An empty project of the virtual rig with two cameras."""
    views = experiment("stereo").views

    def described(spec) -> dict:
        return {
            "width": spec.width,
            "height": spec.height,
            "pitch_mm": list(spec.pitch_mm),
            "nominal_c_mm": spec.nominal_c_mm,
        }

    document = {
        "format": "stripe-project",
        "version": 2,
        "name": "two",
        "cameras": {name: described(view.rig.camera) for name, view in views.items()},
        "projector": described(views["left"].rig.projector),
        "captures": [],
    }
    (tmp_path / "project.json").write_text(json.dumps(document))
    return read_project(tmp_path)


def faulty(camera: str, faults: str) -> str:
    return f"{camera}=virtual:stereo?shot=plane%2B00&camera={camera}{faults}"


@pytest.mark.parametrize("period_ms", [0, 1])  # pattern by pattern, and by the projector's clock
def test_all_cameras_take_each_pattern_and_wrong_frames_are_found_in_any(stereo: Project, period_ms: int) -> None:
    command = ["capture", str(stereo.path), "both", "--role", "plane"]
    command += ["--projector", f"virtual:stereo?shot=plane%2B00&period_ms={period_ms}", "--camera", faulty("left", "")]
    command += ["--camera", faulty("right", "&faults=stale-frame:0.04&fault_seed=3")]
    figures = stereo.path / "figures.json"
    assert main([*command, "--json", str(figures)]) == 0
    told = json.loads(figures.read_text())
    assert told["frames"] == 2 * 24
    assert period_ms or told["retakes"] > 0
    assert any(words.startswith("right: ") for words in told["findings"])
    for name, view in experiment("stereo").views.items():
        phase = decode_capture(read_project(stereo.path).captures[0], camera=name)
        rig, board = view.rig, view.shot("plane+00").scene.camera_from_board
        v, u = np.nonzero(np.isfinite(phase.u) & np.isfinite(phase.v))
        assert len(u) > 0.3 * phase.u.size
        rays, normal = ray_directions(rig.camera, rig.camera_interior, np.stack([u, v], axis=1)), board.rotation[:, 2]
        points = rays * (normal @ board.translation_mm / (rays @ normal))[:, None]
        lines = project(rig.projector, rig.projector_interior, points, rig.projector_from_camera)
        off = np.hypot(*(lines - np.stack([phase.u[v, u], phase.v[v, u]], axis=1)).T)
        assert np.median(off) < 0.1  # the noise is 0.03 lines; the other camera's coordinates are tens of lines off


GAINS = {"left": 0.8, "right": 1.2}


def take_both(project: Project, **more: object) -> None:
    urls = {name: f"{FLAT}?gain={gain}" for name, gain in GAINS.items()}
    run_capture(project, Subject("object", "a"), FLAT, urls, **{"patterns": PATTERNS, **more})


@pytest.fixture
def two(tmp_path: Path) -> Project:
    """An empty project of two cameras that look at the flat scene."""
    camera, projector = DeviceSpec(96, 72, (0.01, 0.01), 12.0), DeviceSpec(64, 64, (0.09, 0.09), 100.0)
    write_project(tmp_path, "two", dict.fromkeys(GAINS, camera), projector)
    return read_project(tmp_path)


def check_both(project: Project) -> None:
    """Both cameras' frames are listed, each of them its own."""
    folder, scene = project.path / "captures/a", FlatScene(noise=0.0)
    frames = read_capture(folder, project).frames
    assert [(f.camera, f.pattern) for f in frames] == [(name, p) for name in GAINS for p in PATTERNS]
    for frame in frames:
        seen = read_image(frame.path).astype(float) / GAINS[frame.camera]
        assert np.abs(seen - scene.frame(frame.pattern, 0)).mean() < 1.5
    assert read_project(project.path).captures == (folder,)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_two_cameras_killed_at_many_writes_go_on(two: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    number, killed, document = 0, True, (two.path / "project.json").read_text()
    while killed:
        shutil.rmtree(two.path / "captures", ignore_errors=True)
        (two.path / "project.json").write_text(document)
        killed = run_and_kill(two, monkeypatch, number, take_both)
        if not read_project(two.path).captures:
            take_both(two)
        check_both(two)
        number += 59  # before and after in turn
    assert number > 150


def test_where_one_cameras_folder_is_complete_and_the_others_not_it_goes_on(
    two: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    def finish(store: Store, *told: object) -> None:
        if store.folder.name == "right":
            raise DeviceError("disk", "gone", "put it back")
        whole(store, *told)

    whole = Store.finish
    with monkeypatch.context() as patch:
        patch.setattr(Store, "finish", finish)
        with pytest.raises(DeviceError, match="gone"):
            take_both(two)
    states = [json.loads(p.read_text())["state"] for p in sorted(two.path.glob("captures/a/*/capture.json"))]
    assert states == ["complete", "taking"]
    with pytest.raises(InputError, match="another plan"):
        take_both(two, patterns=PATTERNS[::-1])
    take_both(two)
    check_both(two)
    with pytest.raises(InputError, match="this capture is complete"):
        take_both(two)


def test_an_interrupted_capture_of_one_camera_is_no_capture_of_two(two: Project) -> None:
    with pytest.raises(DeviceError):
        run_capture(two, Subject("object", "a"), FLAT, f"{FLAT}?faults=no-frame:1", patterns=PATTERNS)
    with pytest.raises(InputError, match="of one camera"):
        take_both(two)


@pytest.mark.parametrize("faults", ["no-frame:1", "torn-frame:1"])
def test_the_camera_that_fails_is_named(two: Project, faults: str) -> None:
    """Nothing is listed; the next call goes on with what both have."""
    urls = {"left": FLAT, "right": f"{FLAT}?faults={faults}"}
    with pytest.raises(DeviceError) as error:
        run_capture(two, Subject("object", "a"), FLAT, urls, patterns=PATTERNS)
    said = str(error.value)
    if faults == "no-frame:1":
        assert said.startswith("right, virtual camera: no image within")
    else:
        assert said.startswith(f"{two.path / 'captures' / 'a'}: after")
        assert "right: " in said
        assert "left" not in said
    assert read_project(two.path).captures == ()
    take_both(two)
    check_both(two)


def test_the_projector_that_is_named_shows_the_patterns(stereo: Project, edit_json, capsys) -> None:
    """Of two of different sizes; without a name the first one is meant."""
    document = json.loads((stereo.path / "project.json").read_text())
    spec = document["projector"]
    edit_json(stereo.path / "project.json", projector=None, projectors={"lamp": {**spec, "width": 100}, "second": spec})
    url, command = "virtual:stereo?shot=plane%2B00", ["capture", str(stereo.path), "new", "--role", "object"]
    camera = ["--camera", f"left={url}&camera=left"]
    assert main([*command, "--projector", url, *camera]) == 2
    assert f"projector is 100x{spec['height']}, the device has" in capsys.readouterr().err
    assert main([*command, "--projector", f"second={url}", *camera]) == 0
    assert read_capture(stereo.path / "captures" / "new", read_project(stereo.path)).pairs == (("left", "second"),)
