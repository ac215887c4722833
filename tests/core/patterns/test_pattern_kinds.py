"""The registry of kinds: the two of version 2 word for word, and one that is added from outside."""

from __future__ import annotations

import numpy as np
import pytest

from core.capture import make_plan
from core.decode import decode
from core.errors import InputError, PatternRefusedError
from core.model import DeviceSpec, Project, Rig, Subject
from core.patterns import (
    KINDS,
    Black,
    CrossPatternLcd,
    Level,
    Lines,
    White,
    brightness,
    describe,
    gray_and_phase,
    level_of,
    pattern_from_dict,
    pattern_image,
    pattern_to_dict,
)


def test_a_level_lights_the_whole_field() -> None:
    level = pattern_from_dict({"kind": "level", "value": 0.25}, "here")
    assert level == Level(0.25)
    assert pattern_image(level, 3, 2).tolist() == [[0.25] * 3] * 2
    assert pattern_to_dict(level) == {"kind": "level", "value": 0.25}
    assert (level_of(level), level_of(White()), level_of(Black())) == (0.25, 1.0, 0.0)


@pytest.mark.parametrize(
    ("values", "light"),
    [("0110", [0, 1, 1, 0]), ([0, 1, 1, 0], [0, 1, 1, 0]), ([0.0, 0.25, 1.0, 0.5], [0, 0.25, 1, 0.5])],
)
def test_lines_have_one_entry_a_line(values: object, light: list[float]) -> None:
    pattern = pattern_from_dict({"kind": "lines", "axis": "y", "values": values}, "here")
    assert brightness(pattern, range(4)).tolist() == light
    assert brightness(pattern, [-1, 4, 99]).tolist() == [0, 0, 0]  # nothing lights what the pattern does not name
    assert pattern_image(pattern, 2, 4)[:, 0].tolist() == light
    assert pattern_from_dict(pattern_to_dict(pattern), "here") == pattern


def test_lines_of_0_and_1_are_one_pattern_however_they_were_written() -> None:
    as_text, as_list = ({"kind": "lines", "axis": "x", "values": v} for v in ("0110", [0, 1, 1.0, 0]))
    assert pattern_from_dict(as_text, "a") == pattern_from_dict(as_list, "b") == Lines("x", "0110")


@pytest.mark.parametrize(
    ("data", "named"),
    [
        ({"kind": "level"}, "value"),
        ({"kind": "level", "value": 1.5}, "1.5"),
        ({"kind": "level", "value": True}, "True"),
        ({"kind": "lines", "values": "01"}, "axis"),
        ({"kind": "lines", "axis": "x"}, "values"),
        ({"kind": "lines", "axis": "x", "values": ""}, "values"),
        ({"kind": "lines", "axis": "x", "values": "012"}, "012"),
        ({"kind": "lines", "axis": "x", "values": []}, "values"),
        ({"kind": "lines", "axis": "x", "values": [0, 2]}, r"values\[1\]"),
        ({"kind": "lines", "axis": "x", "values": [0, "1"]}, "line 1"),
        ({"kind": "lines", "axis": "x", "values": 7}, "7"),
    ],
)
def test_bad_levels_and_lines_are_refused_by_field(data: dict[str, object], named: str) -> None:
    with pytest.raises(InputError, match=named) as caught:
        pattern_from_dict(data, "capture.json: frame 3")
    assert str(caught.value).startswith("capture.json: frame 3")


def test_the_lcd_shows_lines_and_refuses_grey() -> None:
    lcd = CrossPatternLcd(4, 3)
    for pattern in (Lines("x", "0110"), Lines("y", "101"), Level(1.0), Level(0.0)):
        assert (lcd.image(*lcd.switch(pattern)) == pattern_image(pattern, 4, 3)).all()
    for grey in (Lines("x", (0.0, 0.5, 1.0, 0.0)), Level(0.5)):
        with pytest.raises(PatternRefusedError, match="use"):
            lcd.switch(grey)


def test_decoding_passes_over_levels_it_cannot_use() -> None:
    patterns = gray_and_phase("x", 64, cell=4, periods=[8])
    with_levels = [Level(0.5), *patterns, Level(0.1), Level(1.0), Level(0.0)]
    plain, more = (
        decode(p, [np.uint8(np.rint(40 + 150 * pattern_image(q, 64, 9))) for q in p], lines=(64, 9))
        for p in ([*patterns, White(), Black()], with_levels)
    )
    assert np.abs(plain.u - np.arange(64))[:, 1:-1].max() < 0.05  # the first and last line end with the image
    assert np.array_equal(plain.u, more.u, equal_nan=True)


def test_a_kind_is_added_from_outside(extension) -> None:
    """One record makes it readable, shown, described, planned and refused; nothing in the core names it."""
    extension("pattern_kind", KINDS)
    ramp = pattern_from_dict({"kind": "ramp", "axis": "x", "lines": 5}, "here")
    assert pattern_image(ramp, 5, 1).tolist() == [[0, 0.25, 0.5, 0.75, 1]]
    assert pattern_to_dict(ramp) == {"kind": "ramp", "axis": "x", "lines": 5}
    assert describe(ramp) == "ramp over 5 columns"
    with pytest.raises(PatternRefusedError, match="use a code"):
        CrossPatternLcd(5, 5).switch(ramp)


RIG = Rig({"camera": DeviceSpec(9, 9, (1, 1), 1)}, {"projector": DeviceSpec(5, 5, (1, 1), 1)})


def test_a_kind_from_outside_is_planned(extension, tmp_path) -> None:
    ramp = extension("pattern_kind", KINDS).Ramp("x", 5)
    project = Project(tmp_path, "p", RIG, None, ())
    plan = make_plan(project, Subject("object", "a"), [ramp])
    assert plan.guards == (White(), ramp, Black())
