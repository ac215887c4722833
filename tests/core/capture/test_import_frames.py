"""Frames that came from elsewhere: ordered, checked, copied whole or not at all; and patterns written as images."""

from __future__ import annotations

import errno
import json
import os
import re
from dataclasses import replace
from itertools import chain
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

import core.atomic
from core.bench import experiment
from core.capture.importing import import_frames, natural, sequence_of
from core.cli import main
from core.decode import decode
from core.errors import InputError
from core.model import DeviceSpec, Subject
from core.patterns import Black, Phase, White, axis_of, brightness, gray_and_phase, parse_sequence, pattern_to_dict
from core.project import create_project, read_capture, read_project
from core.project.made import FILE as MADE
from core.project.made import note_made
from core.verify.quality import noise_of_one
from core.verify.recognise import recognise
from tests.core.verify.test_stored_frames import LINES, render

A = Subject("object", "a")
SIZE = (64, 48)  # of the projector
CAMERA = (120, 90)


def places() -> tuple[NDArray, ...]:
    """Projector coordinates of the scene, and those of the camera."""
    y, x = np.mgrid[0 : CAMERA[1], 0 : CAMERA[0]].astype(float)
    bump = 2.5 * np.exp(-(((x - 70) / 18) ** 2) - ((y - 40) / 15) ** 2)
    return 1.0 + 0.5 * x + 0.02 * y + bump, 1.5 + 0.49 * y - 0.01 * x, x, y


def frame(pattern, rng: np.random.Generator, gain: float = 1.0) -> NDArray[np.uint8]:
    """A scene of its own: a board askew with a bump and patches of albedo, lines blurred, noise of one grey value."""
    u, v, x, y = places()
    axis = axis_of(pattern) or "x"
    count, place = (SIZE[0], u) if axis == "x" else (SIZE[1], v)
    fine = np.repeat(brightness(pattern, np.arange(count)), 16)
    kernel = np.exp(-0.5 * (np.arange(-32, 33) / 8) ** 2)
    soft = np.convolve(np.pad(fine, 32, mode="edge"), kernel / kernel.sum(), mode="valid")
    light = np.interp(place, (np.arange(len(fine)) + 0.5) / 16 - 0.5, soft)
    albedo = 0.6 + 0.4 * ((x // 20 + y // 15) % 2)
    return np.uint8(np.clip(np.rint(12 + gain * 150 * albedo * light + rng.normal(size=x.shape)), 0, 255))


@pytest.fixture
def project(tmp_path: Path) -> Path:
    spec = [DeviceSpec(*size, (0.01, 0.01), 12.0) for size in (CAMERA, SIZE)]
    create_project(tmp_path / "p", "p", spec[0], spec[1], {})
    return tmp_path / "p"


def take(folder: Path, sequence: str, names=lambda k: f"img{k}.png") -> list:
    """Write the frames of a sequence; names such as img2 and img10 sort wrongly as text."""
    folder.mkdir()
    rng = np.random.default_rng(4)
    patterns = parse_sequence(sequence).patterns(SIZE)
    for k, pattern in enumerate(patterns):
        cv2.imwrite(str(folder / names(k)), frame(pattern, rng))
    return list(patterns)


def command(project: Path, tmp_path: Path) -> list[str]:
    return ["import-frames", str(tmp_path / "in"), str(project), "a", "--role", "object"]


def shown(project: Path, name: str) -> list:
    return [f.pattern for f in read_capture(project / "captures" / name).frames]


def test_fringes_are_not_taken_for_noise() -> None:
    """Where no frame is white all are striped: fringes of 20 pixels were called noise, and hardly anything lit."""
    place = np.linspace(0, 1000, 1000) + np.linspace(0, 30, 50)[:, None]
    rows = 120 + 60 * np.cos(2 * np.pi * place / 20) + np.random.default_rng(1).normal(size=place.shape)
    assert noise_of_one(rows) == pytest.approx(1, rel=0.1)


def test_frames_in_the_order_of_their_names(project: Path, tmp_path: Path) -> None:
    patterns = take(tmp_path / "in", "gray-sine")
    (tmp_path / "in" / "._img3.png").write_bytes(b"\0\5\x16\7")  # as macOS leaves them on other disks
    code = main(
        ["import-frames", str(tmp_path / "in"), str(project), "a", "--role", "object", "--sequence", "gray-sine"]
    )
    assert code == 0
    assert shown(project, "a") == patterns
    assert [p.name for p in read_project(project).captures] == ["a"]
    first = read_capture(project / "captures" / "a").frames[2].path
    assert first.read_bytes() == (tmp_path / "in" / "img2.png").read_bytes()
    assert sorted(["b10", "b9", "B1"], key=lambda n: natural(Path(n))) == ["B1", "b9", "b10"]


@pytest.mark.parametrize("sequence", ["gray-sine", "paper"])
def test_frames_are_recognised_by_content(project: Path, tmp_path: Path, sequence: str) -> None:
    """Shuffled names: every frame is found by what it shows, and decodes to the coordinates of the scene."""
    shuffled = np.random.default_rng(9).permutation(200)
    patterns = take(tmp_path / "in", sequence, lambda k: f"{shuffled[k]:03d}.png")
    report = import_frames(
        read_project(project),
        tmp_path / "in",
        Subject("object", "c"),
        sequence=parse_sequence(sequence),
        order="content",
    )
    assert list(report.files) == [f"{shuffled[k]:03d}.png" for k in range(len(patterns))]
    assert shown(project, "c") == patterns


def test_a_list_names_the_frames(project: Path, tmp_path: Path) -> None:
    patterns = take(tmp_path / "in", "gray-sine", lambda k: f"{99 - k}.png")
    listed = [{"file": f"{99 - k}.png", "pattern": pattern_to_dict(p)} for k, p in enumerate(patterns)]
    (tmp_path / "list.json").write_text(json.dumps({"frames": listed[::-1]}))
    report = import_frames(
        read_project(project),
        tmp_path / "in",
        Subject("object", "l"),
        sequence=parse_sequence(str(tmp_path / "list.json")),
    )
    assert report.order == "list"
    assert shown(project, "l") == patterns[::-1]
    assert len(report.files) == len(patterns)


def test_exposures_of_a_list_are_kept_and_joined(project: Path, tmp_path: Path, capsys) -> None:
    """They were dropped: frames of one pattern contradicted each other, and nothing decoded."""
    rng, gains, frames = np.random.default_rng(5), {4.0: 0.6, 16.0: 2.4}, []
    (tmp_path / "in").mkdir()
    for pattern in parse_sequence("gray-sine").patterns(SIZE):
        for ms, gain in gains.items():  # the longer one saturates the white patches
            name = f"{len(frames):03d}.png"
            cv2.imwrite(str(tmp_path / "in" / name), frame(pattern, rng, gain))
            frames.append({"file": name, "exposure_ms": ms, "pattern": pattern_to_dict(pattern)})
    listed = {"format": "stripe-capture", "version": 2, "role": "object", "frames": frames}
    (tmp_path / "in" / "capture.json").write_text(json.dumps(listed))
    assert main(command(project, tmp_path)) == 0
    told = capsys.readouterr().out
    assert "the patterns come in their order" in told
    assert "decode" not in told
    assert [f.exposure_ms for f in read_capture(project / "captures" / "a").frames] == len(frames) // 2 * [4.0, 16.0]
    assert main(["decode", str(project / "captures" / "a"), "--out", str(tmp_path / "a.npz")]) == 0
    with np.load(tmp_path / "a.npz") as found:
        error = (found["u"] - places()[0]) / found["sigma_u"]
    assert np.isfinite(error).mean() > 0.95
    assert 0.6 < np.sqrt(np.nanmean(error**2)) < 1.4
    assert main([*command(project, tmp_path)[:3], "b", "--role", "object", "--order", "content"]) == 2
    assert "the list gives frames 2 exposures" in capsys.readouterr().err


@pytest.mark.parametrize(("dead", "told"), [((2,), "red is 0 in every pixel"), ((), ""), ((0, 1), "")])
def test_a_dead_colour_is_told(project: Path, tmp_path: Path, dead: tuple[int, ...], told: str) -> None:
    """One of three; where two are dead, the light may be of the third's colour."""
    take(tmp_path / "in", "gray-sine")
    for path in (tmp_path / "in").iterdir():
        colours = cv2.cvtColor(cv2.imread(str(path), -1), cv2.COLOR_GRAY2BGR)
        colours[..., dead] = 0
        cv2.imwrite(str(path), colours)
    spec = parse_sequence("gray-sine")
    report = import_frames(read_project(project), tmp_path / "in", Subject("object", "a"), sequence=spec)
    assert [words for words in report.words if "every pixel of the colour frames" in words] == [
        words for words in report.words if told and words.startswith(told)
    ]
    assert bool(told) == any(f.check == "colour" for f in report.findings)


def spoil_count(folder: Path) -> str:
    (folder / "img3.png").unlink()
    return "holds 15 images, the sequence has 16 patterns"


def spoil_size(folder: Path) -> str:
    cv2.imwrite(str(folder / "img4.png"), np.zeros((10, 10), np.uint8))
    return "10x10 px"


def spoil_twice(folder: Path) -> str:
    (folder / "img7.png").write_bytes((folder / "img5.png").read_bytes())
    return "the same image as img5.png"


def spoil_depth(folder: Path) -> str:
    cv2.imwrite(str(folder / "img6.png"), np.zeros((CAMERA[1], CAMERA[0]), np.uint16))
    return "uint16"


def spoil_file(folder: Path) -> str:
    (folder / "img6.png").write_bytes((folder / "img6.png").read_bytes()[:90])
    return "img6.png"


@pytest.mark.parametrize("spoil", [spoil_count, spoil_size, spoil_twice, spoil_depth, spoil_file])
def test_wrong_frames_are_told_in_one_line_and_nothing_is_written(
    project: Path, tmp_path: Path, spoil, capsys: pytest.CaptureFixture[str]
) -> None:
    take(tmp_path / "in", "gray-sine")
    said = spoil(tmp_path / "in")
    before = (project / "project.json").read_bytes()
    arguments = [
        "import-frames",
        str(tmp_path / "in"),
        str(project),
        "a",
        "--role",
        "object",
        "--sequence",
        "gray-sine",
    ]
    assert main(arguments) == 2
    message = capsys.readouterr().err
    assert said in message
    assert message.count("\n") == 1
    assert (project / "project.json").read_bytes() == before
    assert not list((project / "captures").glob("*")) if (project / "captures").exists() else True


def test_frames_of_several_cameras_stay_theirs(project: Path, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    document = json.loads((project / "project.json").read_text())
    camera = document.pop("camera")
    document |= {"version": 2, "cameras": {"left": camera, "right": camera}}
    (project / "project.json").write_text(json.dumps(document))
    patterns = take(tmp_path / "in", "gray-sine")
    entries = []
    for k, pattern in enumerate(patterns):
        own = tmp_path / "in" / f"img{k}.png"
        image = cv2.imread(str(own), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(tmp_path / "in" / f"right{k}.png"), image[:, ::-1])
        entries += [
            {"file": name, "camera": camera, "pattern": pattern_to_dict(pattern)}
            for name, camera in ((own.name, "left"), (f"right{k}.png", "right"))
        ]
    words = ["import-frames", str(tmp_path / "in"), str(project), "both", "--role", "object"]
    (tmp_path / "list.json").write_text(json.dumps([entry["pattern"] for entry in entries[::2]]))
    assert main([*words, "--sequence", str(tmp_path / "list.json")]) == 2  # whose are they?
    assert "the rig has left, right" in capsys.readouterr().err
    (tmp_path / "in" / "capture.json").write_text(json.dumps({"frames": entries}))
    assert main(words) == 0
    assert "left with projector: the patterns come in their order" in capsys.readouterr().out
    series = read_capture(project / "captures" / "both", read_project(project)).series
    assert [(s.camera, [f.pattern for f in s.frames]) for s in series] == [("left", patterns), ("right", patterns)]
    left, right = (cv2.imread(str(s.frames[5].path), cv2.IMREAD_UNCHANGED) for s in series)
    assert np.array_equal(left, right[:, ::-1])
    words[3] = "one"
    assert main([*words, "--camera", "right"]) == 0
    assert read_capture(project / "captures" / "one", read_project(project)).pairs == (("right", "projector"),)
    # without a list, the sequence that one camera saw last
    assert len(sequence_of(read_project(project)).listed) == len(patterns)


def test_a_full_disk_leaves_no_half_capture(project: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    take(tmp_path / "in", "gray-sine")
    order = [*command(project, tmp_path), "--sequence", "gray-sine"]
    before = set(project.rglob("*"))
    (project / "captures").mkdir(exist_ok=True)
    (project / "captures" / ".other.part").mkdir()  # left by a program that was killed

    def full(source: Path, target: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr("core.capture.importing.shutil.copyfile", full)
        assert main(order) == 1
    assert "captures/a: cannot be written (No space left on device); make room" in capsys.readouterr().err
    assert set(project.rglob("*")) - before <= {project / "captures"}
    assert main(order) == 0


def test_an_import_killed_before_its_capture_was_listed_is_mended_as_said(
    project: Path, tmp_path: Path, capsys
) -> None:
    take(tmp_path / "in", "gray-sine")
    order = [*command(project, tmp_path), "--sequence", "gray-sine"]
    before = (project / "project.json").read_bytes()
    assert main(order) == 0
    (project / "project.json").write_bytes(before)  # the listing comes last
    assert main(order) == 2
    told = capsys.readouterr().err
    assert (
        f"captures/a: is there already, but project.json does not list it; list it with `stripe-core check {project} -"
        in told
    )
    main(["check", str(project), "--repair"])
    assert read_project(project).captures == (project / "captures" / "a",)


def test_a_disk_that_fails_after_the_capture_was_listed_keeps_it(project: Path, tmp_path: Path, monkeypatch) -> None:
    """project.json has taken its place, and only then the names in its folder could not be flushed."""
    take(tmp_path / "in", "gray-sine")
    flush = core.atomic.flush_folder

    def failing(folder: Path) -> None:
        flush(folder)
        if folder == project:
            raise OSError(errno.EIO, os.strerror(errno.EIO))

    with monkeypatch.context() as patch:
        patch.setattr("core.atomic.flush_folder", failing)
        assert main([*command(project, tmp_path), "--sequence", "gray-sine"]) == 1
    assert [read_capture(folder).name for folder in read_project(project).captures] == ["a"]


def test_the_later_of_two_imports_to_one_name_is_told_so(project: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    take(tmp_path / "in", "gray-sine")

    def quicker(part: Path, *rest: object, **named: object) -> None:
        (project / "captures" / "a").mkdir()
        (project / "captures" / "a" / "capture.json").write_text("the other's")

    monkeypatch.setattr("core.capture.importing.write_capture_json", quicker)
    assert main([*command(project, tmp_path), "--sequence", "gray-sine"]) == 2
    assert "captures/a: is there already; choose another name" in capsys.readouterr().err
    assert [path.name for path in (project / "captures").rglob("*")] == ["a", "capture.json"]


def test_colour_files_are_converted_and_it_is_said(project: Path, tmp_path: Path) -> None:
    patterns = take(tmp_path / "in", "gray-sine")
    for path in (tmp_path / "in").iterdir():
        grey = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(path), cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))
    report = import_frames(read_project(project), tmp_path / "in", A, sequence=parse_sequence("gray-sine"))
    assert report.words[0].startswith(f"{len(patterns)} of {len(patterns)} files were converted")
    stored = cv2.imread(str(project / "captures" / "a" / "000.png"), cv2.IMREAD_UNCHANGED)
    assert stored.ndim == 2


def test_frames_in_a_wrong_order_are_noticed(project: Path, tmp_path: Path) -> None:
    take(tmp_path / "in", "paper", lambda k: f"{(k * 7) % 22:03d}.png")
    report = import_frames(read_project(project), tmp_path / "in", A, sequence=parse_sequence("paper"))
    assert any("--order content" in words for words in report.words)


def test_periods_that_contradict_each_other_are_not_said_to_be_in_order(project: Path, tmp_path: Path, capsys) -> None:
    """Two steps of one period exchanged: no code tells that, and far fewer than half of the pixels decode."""
    swapped = {0: 1, 1: 0}
    take(tmp_path / "in", "two-period:steps=3", lambda k: f"{swapped.get(k, k):03d}.png")
    command = ["import-frames", tmp_path / "in", project, "a", "--role", "object", "--sequence", "two-period:steps=3"]
    assert main([str(word) for word in command]) == 0
    told = capsys.readouterr().out
    assert "come in their order" not in told
    assert "frames are not those listed" in told


def test_without_a_sequence_the_project_must_know_one(project: Path, tmp_path: Path) -> None:
    take(tmp_path / "in", "gray-sine")
    with pytest.raises(InputError, match="gives no sequence"):
        import_frames(read_project(project), tmp_path / "in", A)


def test_patterns_are_written_pixel_for_pixel(project: Path, tmp_path: Path) -> None:
    """The images decode to their own columns and rows; a second call replaces the first."""
    out = tmp_path / "out"
    for sequence in ("gray-inverse", "paper:axes=x"):
        assert main(["patterns", str(project), "--out", str(out), "--sequence", sequence]) == 0
    assert main(["patterns", str(project), "--out", str(out), "--sequence", "gray-sine"]) == 0
    capture = read_capture(out)
    assert [f.pattern for f in capture.frames] == list(parse_sequence("gray-sine").patterns(SIZE))
    images = [cv2.imread(str(f.path), cv2.IMREAD_UNCHANGED) for f in capture.frames]
    assert {i.shape for i in images} == {(SIZE[1], SIZE[0])}
    assert {p.name for p in out.iterdir()} == {f.path.name for f in capture.frames} | {"capture.json", MADE}
    phase = decode([f.pattern for f in capture.frames], images, lines=SIZE)
    assert np.nanmax(np.abs(phase.u - np.arange(SIZE[0]))) < 0.05
    assert np.nanmax(np.abs(phase.v - np.arange(SIZE[1])[:, None])) < 0.05


def test_patterns_are_those_of_the_projector_that_is_named(project: Path, tmp_path: Path, edit_json, capsys) -> None:
    spec, out = json.loads((project / "project.json").read_text())["projector"], tmp_path / "out"
    edit_json(project / "project.json", version=2, projectors={"second": {**spec, "width": 2 * SIZE[0]}})
    command = ["patterns", str(project), "--out", str(out), "--sequence", "gray-sine", "--projector"]
    assert main([*command, "third"]) == 2
    assert "project.json: has no projector 'third'" in capsys.readouterr().err
    assert main([*command, "second"]) == 0
    assert cv2.imread(str(next(out.glob("*.png"))), cv2.IMREAD_UNCHANGED).shape == (SIZE[1], 2 * SIZE[0])


def test_patterns_undo_the_response(project: Path, tmp_path: Path) -> None:
    """A projector whose light is its level squared: written levels are the roots of what is meant."""
    arguments = ["patterns", str(project), "--out", str(tmp_path / "out"), "--sequence", "gray-sine", "--linearise"]
    assert main(arguments) == 2  # no response yet
    data = json.loads((project / "project.json").read_text())
    data["projector"]["response"] = [[level / 64, 200 * (level / 64) ** 2] for level in range(65)]
    (project / "project.json").write_text(json.dumps({**data, "version": 2}))
    assert main(arguments) == 0
    sine = next(
        f for f in read_capture(tmp_path / "out").frames if f.pattern.kind == "phase" and axis_of(f.pattern) == "x"
    )
    levels = cv2.imread(str(sine.path), cv2.IMREAD_UNCHANGED)[0] / 255
    # a table of 65 levels, 8 bits: light to half a per cent
    assert levels**2 == pytest.approx(brightness(sine.pattern, np.arange(SIZE[0])), abs=0.006)


def test_a_folder_of_something_else_is_left_alone(project: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.txt").write_text("x")
    assert main(["patterns", str(project), "--out", str(tmp_path / "out"), "--sequence", "paper"]) == 2
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["thesis.txt"]


def test_patterns_do_not_go_among_other_files_that_the_program_wrote(project: Path, capsys) -> None:
    """Those of a simulated project are as they were written, and 25 files came to lie in its folder."""
    note_made(project, {})
    own = sorted(p.name for p in project.iterdir())
    assert main(["patterns", str(project), "--out", str(project)]) == 2
    assert "not as `patterns` wrote it; choose a new or empty folder" in capsys.readouterr().err
    assert sorted(p.name for p in project.iterdir()) == own


def test_patterns_never_replace_the_frames_of_a_capture(project: Path, tmp_path: Path, capsys) -> None:
    """Imported frames have the names of patterns, and were deleted for these."""
    take(tmp_path / "in", "gray-sine")
    assert main([*command(project, tmp_path), "--sequence", "gray-sine"]) == 0
    own = {path: path.read_bytes() for path in (project / "captures" / "a").iterdir()}
    capsys.readouterr()
    assert main(["patterns", str(project), "--out", str(project / "captures" / "a")]) == 2
    assert re.search(r"captures/a: holds \S+, not as `patterns` wrote it; choose", capsys.readouterr().err)
    assert {path: path.read_bytes() for path in (project / "captures" / "a").iterdir()} == own


@pytest.mark.parametrize("sequence", ["paper", "gray-sine", "gray-inverse", "multi-frequency", "two-period"])
def test_an_order_found_by_content_is_right_or_refused(project: Path, tmp_path: Path, sequence: str) -> None:
    """Whatever is taken decodes to the coordinates of the frames in their true order."""
    shuffled = np.random.default_rng(7).permutation(200)
    patterns = take(tmp_path / "in", sequence, lambda k: f"{shuffled[k]:03d}.png")
    code = main([*command(project, tmp_path), "--sequence", sequence, "--order", "content"])
    if code == 2:
        assert not (project / "captures" / "a").exists()
        return
    true = [cv2.imread(str(tmp_path / "in" / f"{shuffled[k]:03d}.png"), -1) for k in range(len(patterns))]
    found = read_capture(project / "captures" / "a").frames
    taken = decode([f.pattern for f in found], [cv2.imread(str(f.path), -1) for f in found], lines=SIZE)
    truth = decode(patterns, true, lines=SIZE)
    both = np.isfinite(taken.u) & np.isfinite(truth.u) & np.isfinite(taken.v) & np.isfinite(truth.v)
    assert both.sum() > 0.9 * np.isfinite(truth.u).sum()
    assert np.quantile(np.hypot(taken.u - truth.u, taken.v - truth.v)[both], 0.99) < 0.5


def test_steps_whose_last_edge_lies_beyond_the_lines_are_put_in_order() -> None:
    """Of the steps of a period some have an edge less; they are exchanged with the others all the same."""
    each = (gray_and_phase(axis, 160, cell=8, periods=[16.0], steps=4) for axis in "xy")  # type: ignore[arg-type]
    patterns = [*chain(*each), White(), Black()]
    shuffled = np.random.default_rng(5).permutation(len(patterns))
    images = render(patterns, 5)
    found = recognise([images[k] for k in shuffled], patterns, LINES, "test")
    steps = [k for k, p in enumerate(patterns) if isinstance(p, Phase)]
    assert [shuffled[found[k]] for k in steps] == steps


def test_codes_with_inverses_are_put_in_order() -> None:
    """A bit turned over, or two exchanged, makes words of the same code: the lines' course over a plane tells."""
    patterns = parse_sequence("gray-inverse").patterns(LINES)
    bench = experiment("quick", 3)
    images = [image for _, image in bench.take(replace(bench.shot("plane+00"), patterns=patterns))]
    shuffled = np.random.default_rng(4).permutation(len(patterns))
    found = recognise([images[k] for k in shuffled], patterns, LINES, "test")
    assert shuffled[found].tolist() == list(range(len(patterns)))


@pytest.mark.parametrize("seed", [0, 2])
def test_codes_with_inverses_of_all_lines_run_as_in_the_camera(seed: int) -> None:
    """Where numbers fill all bits, every exchange leaves words, and the lines may run backwards as steadily."""
    rng, (v, u) = np.random.default_rng(seed), np.mgrid[:100, :120]
    patterns = parse_sequence("gray-inverse:steps=0,cell=1").patterns((64, 64))
    places = {"x": u / 2 + 2 + 0.05 * v + 3e-4 * (u - 60) ** 2, "y": 0.6 * v + 5 - 0.03 * u}
    lines = np.arange(64)
    images = []
    for p in patterns:
        light = np.convolve(np.pad(brightness(p, lines), 1), [0.15, 0.7, 0.15], "same")[1:-1]
        grey = 20 + 150 * np.interp(places[axis_of(p) or "x"], lines, light) + rng.normal(0, 1.5, u.shape)
        images.append(np.clip(grey, 0, 255).astype(np.uint8))
    shuffled = np.random.default_rng(seed).permutation(len(patterns))
    found = recognise([images[k] for k in shuffled], patterns, (64, 64), "test")
    assert shuffled[found].tolist() == list(range(len(patterns)))


@pytest.mark.parametrize(
    ("level", "told"), [(0, "nothing is saturated"), (255, "100.0% of the lit pixels are saturated")]
)
def test_frames_of_one_grey_value_are_not_said_to_be_in_order(
    level: int, told: str, project: Path, tmp_path: Path, capsys
) -> None:
    """White all over was said to be dark, with nothing saturated; and noise to show the patterns in their order."""
    take(tmp_path / "in", "gray-sine")
    rng = np.random.default_rng(1)
    for file in (tmp_path / "in").iterdir():
        shape = cv2.imread(str(file), cv2.IMREAD_UNCHANGED).shape
        image = np.full(shape, level) if level else rng.integers(0, 9, shape)
        cv2.imwrite(str(file), image.astype(np.uint8))
    assert main([*command(project, tmp_path), "--sequence", "gray-sine"]) == 0
    said = capsys.readouterr().out
    assert told in said
    assert "in their order" not in said
