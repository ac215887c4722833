"""Sequences as data: presets for any size, lists, files; what is wrong is refused by name."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from core.decode import decode
from core.errors import InputError
from core.patterns import (
    PRESETS,
    CrossPatternLcd,
    Lines,
    SequenceSpec,
    White,
    axis_of,
    brightness,
    default_sequence,
    grey_reason,
    parse_sequence,
    pattern_image,
    pattern_to_dict,
    read_sequence,
    reference_sequence,
)

FAMILIES = [name for name in PRESETS if name != "dense"]


def shown(patterns, width: int, height: int) -> list[np.ndarray]:
    """The frames of a camera that looks at every line with one pixel, without blur or noise."""
    return [np.uint8(np.rint(20 + 200 * pattern_image(p, width, height))) for p in patterns]


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize(("width", "height"), [(640, 31), (33, 480), (641, 47), (29, 479), (1279, 5)])
def test_every_preset_tells_all_lines_apart_at_any_size(name: str, width: int, height: int) -> None:
    """Sharp lines, one pixel each: u is the column's number and v the row's; sizes that are no multiple of a period."""
    patterns = parse_sequence(name).patterns((width, height))
    phase = decode(patterns, shown(patterns, width, height), lines=(width, height))
    # square steps of the paper and the edges of the field: a quarter line; 8-bit sines are much better
    assert np.nanmax(np.abs(phase.u - np.arange(width))) < 0.3
    assert np.nanmax(np.abs(phase.v - np.arange(height)[:, None])) < 0.3
    assert np.isfinite(phase.u).mean() > min(0.98, 1 - 2.1 / width)  # the first and last line end with the image
    assert np.isfinite(phase.v).mean() > min(0.98, 1 - 2.1 / height)


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("axis", ["x", "y"])
def test_one_axis_alone(name: str, axis: str) -> None:
    patterns = parse_sequence(f"{name}:axes={axis}").patterns((40, 30))
    assert {axis_of(p) for p in patterns} == {axis, None}


def test_the_papers_preset_is_the_reference_sequence() -> None:
    assert parse_sequence("paper").patterns((640, 640)) == tuple(reference_sequence())


def test_options_have_defaults_and_do_what_they_say() -> None:
    plain = parse_sequence("gray-sine").patterns((640, 640))
    assert plain == read_sequence({"preset": "gray-sine"}, "here").patterns((640, 640))
    assert [p.period for p in plain if p.kind == "phase"] == [16.0] * 8
    eight = parse_sequence("gray-sine:steps=8,period=24,inverse=true,axes=x,plain=false").patterns((640, 480))
    assert [p.kind for p in eight] == ["gray"] * 12 + ["phase"] * 8  # 54 cells of 12 lines: 6 bits and their inverses
    assert {p.period for p in eight if p.kind == "phase"} == {24.0}
    code = parse_sequence("gray-inverse:steps=0").patterns((640, 480))
    assert {p.kind for p in code} == {"gray", "white", "black"}
    assert all(p.cell == 1 for p in code if p.kind == "gray")
    listed = parse_sequence("multi-frequency:periods=[16,18.5,21],axes=x").patterns((640, 480))
    assert [p.period for p in listed if p.kind == "phase"] == [16.0] * 4 + [18.5] * 4 + [21.0] * 4


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("plaid", "multi-frequency"),
        ("gray-sine:colour=3", "period, steps"),
        ("gray-sine:steps=2", "steps is 2"),
        ("gray-sine:period=-4", "period is -4"),
        ("gray-sine:period", "period=24"),
        ("gray-sine:axes=z", "axes is 'z'"),
        ("gray-sine:profile=saw", "profile is 'saw'"),
        ("paper:period=16", "no option 'period'"),
        ("gray-sine:steps=3,steps=4", "'steps' after gray-sine twice"),
        ("dense:frames=0", "frames is 0"),
        ('{"preset": "gray"}', "preset is 'gray'"),
        ("[]", "empty"),
        ('[{"kind": "plaid"}]', "pattern 0"),
        ("{", "not JSON"),
        ("missing.json", "missing.json"),
    ],
)
def test_what_is_wrong_is_refused_with_what_is_known(text: str, named: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_sequence(text)
    assert named in str(caught.value)


def test_a_list_for_another_size_is_refused() -> None:
    spec = read_sequence([{"kind": "lines", "axis": "x", "values": "0110"}], "here")
    assert spec.patterns((4, 9)) == (Lines("x", "0110"),)
    with pytest.raises(InputError, match="4 entries"):
        spec.patterns((5, 9))


def test_a_sequence_survives_the_file(tmp_path: Path) -> None:
    specs = (
        SequenceSpec("gray-sine", {"steps": 8, "axes": "x"}),
        SequenceSpec(listed=(White(), Lines("y", "0110"))),
    )
    for spec in specs:
        assert read_sequence(json.loads(json.dumps(spec.data)), "here").patterns((9, 4)) == spec.patterns((9, 4))
        (tmp_path / "s.json").write_text(json.dumps(spec.data))
        assert parse_sequence(str(tmp_path / "s.json")).patterns((9, 4)) == spec.patterns((9, 4))
    capture = {"frames": [{"file": f"{i}.png", "pattern": pattern_to_dict(White())} for i in range(2)]}
    (tmp_path / "capture.json").write_text(json.dumps(capture))
    read = parse_sequence(str(tmp_path / "capture.json"))
    assert (read.listed, read.files) == ((White(), White()), ("0.png", "1.png"))


def test_who_can_show_grey_gets_sines_and_the_lcd_squares() -> None:
    assert any(grey_reason(p) for p in default_sequence(grey=True).patterns((640, 480)))
    lcd = CrossPatternLcd(640, 480)
    for pattern in default_sequence(grey=False).patterns((640, 480)):
        lcd.switch(pattern)


@pytest.mark.parametrize(("lines", "frames"), [(200, 14), (97, 8), (31, 3)])
def test_half_the_frames_of_dense_words_switch_after_runs_of_one_to_three(lines: int, frames: int) -> None:
    patterns = parse_sequence(f"dense:frames={2 * frames}").patterns((lines, 64))
    assert len(patterns) == 2 * frames
    words = np.array([brightness(p, range(lines)) for p in patterns[:frames]])
    switched = np.abs(np.diff(words, axis=1)).sum(axis=0)
    assert abs(switched.mean() / frames - 0.5) < 0.1
    for row in words:
        edges = np.flatnonzero(np.diff(row))
        assert np.diff(edges).max() <= 3
        assert edges[0] < 3
        assert len(row) - 1 - edges[-1] <= 3
    lcd = CrossPatternLcd(lines, 64)
    for pattern in patterns:
        assert (lcd.image(*lcd.switch(pattern)) == pattern_image(pattern, lines, 64)).all()


def test_dense_words_are_unlike_at_any_two_lines() -> None:
    """14 frames, 300 lines: two lines that are no neighbours differ in several frames, as random words would not."""
    words = np.array([brightness(p, range(300)) for p in parse_sequence("dense:axes=x,frames=14").patterns((300, 9))]).T
    differ = np.abs(words[:, None] - words[None]).sum(axis=2)
    far = np.abs(np.subtract.outer(range(300), range(300))) > 1
    assert differ[far].min() >= 1  # 300 of 16384 words
    assert (differ[far] <= 1).mean() < 1e-3
