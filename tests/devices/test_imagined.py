"""Profiles written, as by an operator, from the terse manuals of controllers that err; whole captures through them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from core.capture import run_capture
from core.devices import open_camera
from core.devices.scene import FlatScene
from core.errors import DeviceError
from core.model import Subject
from core.patterns import axis_of, brightness, parse_sequence
from core.project import read_capture, read_image
from tests.devices.campaign import make_project
from tests.devices.imagined import LINES, Errors, Fringer, Imagined, Stepper, Window, plugged

HEAD = 'format = "stripe-projector-profile"\nversion = 1\n[device]\ncolumns = 64\nrows = 64\n'
TIMING = "[timing]\nanswer_ms = 60\ngap_ms = 15\nsettle_ms = 1\nretries = 4\n"

WINDOW = (
    HEAD
    + """slots = 255
first_slot = 1
plates = ["X"]
[port]
byte_ms = 0.3
[framing]
kind = "text"
ending = "\\r"
answer_ending = "\\r\\n"
echo = true
prompt = "> "
[lines]
lit = 0
backward = true
chunk = 3
check = { kind = "sum", bits = 8, xor = 0xFF }
"""
    + TIMING
    + """
[commands.load]
send = "W {slot:02X} {offset:02X} {lines}"
expect = "{check:02X}"
[commands.select]
send = "D {slot:02X}"
expect = "D{slot:02X}"
[refusal]
expect = "E{code}"
[refusal.codes]
damaged = 1
empty = 2
"""
)
FRINGER = (
    HEAD
    + """[framing]
kind = "frame"
start = "7E"
end = "7E"
escapes = { 7E = "7D 5E", 7D = "7D 5D" }
check = { bits = 16, poly = 0x1021, init = 0xFFFF, reflect = true, xor = 0xFFFF }
check_order = "low"
[words.axis]
x = 0
y = 1
"""
    + TIMING
    + """
[[commands.show-gray]]
send = "{tag:u8} 10 {axis:u8} {bit:u8} {bits:u8} {inverse:u8}"
expect = "{tag:u8} 06"
[[commands.show-gray]]
expect = "{tag:u8} 0A"
[[commands.show-phase]]
send = "{tag:u8} 11 {axis:u8} {period*16:u16le} {shift_deg*1000:u24le}"
expect = "{tag:u8} 06"
[[commands.show-phase]]
expect = "{tag:u8} 0A"
[[commands.show-level]]
send = "{tag:u8} 12 {level:u8}"
expect = "{tag:u8} 06"
[[commands.show-level]]
expect = "{tag:u8} 0A"
[[commands.show-white]]
send = "{tag:u8} 12 FF"
expect = "{tag:u8} 06"
[[commands.show-white]]
expect = "{tag:u8} 0A"
[[commands.show-black]]
send = "{tag:u8} 12 00"
expect = "{tag:u8} 06"
[[commands.show-black]]
expect = "{tag:u8} 0A"
[refusal]
expect = "{tag:u8} 15"
"""
)
STEPPER = (
    HEAD
    + """[port]
open_ms = 600
[framing]
kind = "text"
ending = "\\r"
answer_ending = "\\r\\n"
[stored]
sequence = "gray-sine:period=8"
first_slot = 1
"""
    + TIMING
    + """
[commands.rewind]
send = "H"
expect = "={slot:02d}"
[commands.step]
send = "N"
expect = "={slot:02d}"
[refusal]
expect = "!"
"""
)


def light(pattern: object) -> tuple[list[float], list[float]]:
    shown = brightness(pattern, np.arange(LINES)).tolist()
    return ([0.0] * LINES, shown) if axis_of(pattern) == "y" else (shown, [0.0] * LINES)


def stepper(shine) -> Imagined:
    return Stepper(shine, [light(p) for p in parse_sequence("gray-sine:period=8").patterns((LINES, LINES))])


CONTROLLERS = {"window": (WINDOW, Window), "fringer": (FRINGER, Fringer), "stepper": (STEPPER, stepper)}
SEQUENCES = {"window": "paper:axes=x", "fringer": "gray-sine:period=8", "stepper": None}


def captured(folder: Path, name: str, rate: float, seed: int) -> tuple[str, dict[str, int], list[dict]]:
    """Capture through a controller that errs; give what became of it, what went wrong, and what was told."""
    text, make = CONTROLLERS[name]
    (folder / "mine.toml").write_text(text)
    project, errors, scene = make_project(folder), Errors(rate, seed), FlatScene(noise=0.0)
    wanted = SEQUENCES[name] and parse_sequence(SEQUENCES[name]).patterns((LINES, LINES))
    with_camera = open_camera("virtual:flat")
    stage = with_camera.stage  # type: ignore[attr-defined]

    def shine(columns: list[float], rows: list[float]) -> None:
        stage.switch((np.array(columns), np.array(rows)))

    try:
        with plugged(make(shine), errors, folder) as port:
            report = run_capture(
                project, Subject("object", "a"), f"serial:{port}?profile={folder / 'mine.toml'}", "virtual:flat",
                patterns=wanted,
            )  # fmt: skip
        became = "right"
        for frame in read_capture(report.folder).frames:
            if np.abs(read_image(frame.path).astype(float) - scene.frame(frame.pattern, 0)).mean() > 1.5:
                became = "mislabelled"
    except DeviceError as error:
        became = f"refused: {error}"
    finally:
        with_camera.close()
    transcript = folder / "captures/a/transcript.jsonl"
    told = [json.loads(line) for line in transcript.read_text().splitlines()] if transcript.exists() else []
    return became, errors.counts, told


@pytest.mark.parametrize("name", CONTROLLERS)
def test_a_capture_through_a_controller_that_does_not_err(tmp_path: Path, name: str) -> None:
    became, _, told = captured(tmp_path, name, 0.0, 0)
    assert became == "right"
    assert not [entry for entry in told if entry["event"] in ("failed", "rejected", "device")]


@pytest.mark.parametrize("name", CONTROLLERS)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_capture_through_a_controller_that_errs(tmp_path: Path, name: str, seed: int) -> None:
    became, counts, told = captured(tmp_path, name, 0.04, seed)
    assert became == "right"
    assert counts
    assert told


def test_a_profile_of_one_plate_is_emulated_and_captured_with_its_own_axis_alone(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(WINDOW)
    scene, url = FlatScene(noise=0.0), f"emulated:flat?profile={tmp_path / 'mine.toml'}"
    report = run_capture(make_project(tmp_path), Subject("object", "a"), url, "virtual:flat")
    frames = read_capture(report.folder).frames
    assert {axis_of(frame.pattern) for frame in frames} == {None, "x"}
    for frame in frames:
        assert np.abs(read_image(frame.path).astype(float) - scene.frame(frame.pattern, 0)).mean() < 1.5
