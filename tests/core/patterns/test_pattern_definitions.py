"""Patterns against the definitions of the interchange format, and the LCD against what glass can do."""

from __future__ import annotations

import numpy as np
import pytest

from core.errors import InputError, PatternRefusedError
from core.patterns import (
    Black,
    Code,
    CrossPatternLcd,
    Line,
    Phase,
    White,
    brightness,
    gray_and_phase,
    light_sections,
    pattern_from_dict,
    pattern_image,
    pattern_to_dict,
    reference_sequence,
)


def code_words(kind: str, lines: int, bits: int, cell: int) -> np.ndarray:
    """The code word of every line, shape (lines, bits)."""
    return np.stack([brightness(Code(kind, "x", b, bits, cell), range(lines)) for b in range(bits)], axis=1)


def test_binary_words_count_the_cells() -> None:
    words = code_words("binary", 40, 4, 3)
    assert (words @ [8, 4, 2, 1]).tolist() == [i // 3 for i in range(40)]


def test_gray_neighbours_differ_in_one_bit_and_all_cells_in_some() -> None:
    words = code_words("gray", 640, 9, 2)[::2]
    assert (np.abs(np.diff(words, axis=0)).sum(axis=1) == 1).all()
    assert len({tuple(w) for w in words}) == 320


def test_the_first_bit_is_the_most_significant() -> None:
    assert brightness(Code("gray", "y", 0, 3), range(8)).tolist() == [0, 0, 0, 0, 1, 1, 1, 1]


def test_an_inverse_frame_is_the_complement() -> None:
    on, off = (brightness(Code("gray", "x", 2, 5, 3, inverse), range(96)) for inverse in (False, True))
    assert (on + off == 1).all()


@pytest.mark.parametrize("period", [2.0, 3.0, 16.0, 17.31, 640.0, 700.0])
@pytest.mark.parametrize("shift", [-10.0, 0.0, 0.7, np.pi])
def test_a_sine_is_the_cosine_of_the_definition(period: float, shift: float) -> None:
    i = np.arange(640)
    expected = 0.5 + 0.5 * np.cos(2 * np.pi * (i + 0.5) / period - shift)
    assert brightness(Phase("x", period, 3, 0, shift, "sine"), i) == pytest.approx(expected)


def test_reference_steps_light_two_lines_in_four_and_move_by_one() -> None:
    steps = [p for p in reference_sequence() if isinstance(p, Phase) and p.axis == "x"]
    shown = np.stack([brightness(p, range(16)) for p in steps])
    assert (shown.sum(axis=1) == 8).all()
    for k in range(3):
        assert (np.roll(shown[k], 1) == shown[k + 1]).all()


def test_the_reference_sequence_has_28_frames() -> None:
    kinds = [p.kind for p in reference_sequence()]
    assert [kinds.count(k) for k in ("gray", "phase", "white", "black")] == [18, 8, 1, 1]


def test_a_line_lights_width_lines_from_index_on() -> None:
    assert np.flatnonzero(brightness(Line("y", 5, 3), range(20))).tolist() == [5, 6, 7]
    assert len(light_sections("x", 64, width=2, pitch=2)) == 33


def test_images_run_along_their_axis() -> None:
    x = pattern_image(Code("binary", "x", 0, 1), 2, 3)
    assert x.shape == (3, 2)
    assert x.tolist() == [[0, 1]] * 3
    assert pattern_image(Code("binary", "y", 0, 1), 3, 2).tolist() == [[0, 0, 0], [1, 1, 1]]


@pytest.mark.parametrize(
    "pattern", [*reference_sequence()[:12], White(), Black(), Line("y", 3, 2), Phase("y", 17.3, 5, 2, 1.1)]
)
def test_patterns_survive_the_file(pattern: object) -> None:
    assert pattern_from_dict(pattern_to_dict(pattern), "here") == pattern  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("data", "field"),
    [
        ({"kind": "plaid"}, "kind"),
        ({"kind": "gray", "axis": "z", "bit": 0, "bits": 9}, "axis"),
        ({"kind": "gray", "axis": "x", "bit": 9, "bits": 9}, "bit"),
        ({"kind": "gray", "axis": "x", "bits": 9}, "bit"),
        ({"kind": "gray", "axis": "x", "bit": 0, "bits": 9, "cell": 0}, "cell"),
        ({"kind": "phase", "axis": "x", "period": -4, "steps": 4, "step": 0, "shift_rad": 0}, "period"),
        ({"kind": "phase", "axis": "x", "period": float("nan"), "steps": 4, "step": 0, "shift_rad": 0}, "period"),
        ({"kind": "phase", "axis": "x", "period": 4, "steps": 2, "step": 0, "shift_rad": 0}, "steps"),
        ({"kind": "phase", "axis": "x", "period": 4, "steps": 4, "step": 0, "profile": "saw"}, "profile"),
        ({"kind": "line", "axis": "x", "index": 1.5}, "index"),
        ("white", "white"),
        (None, "None"),
    ],
)
def test_a_bad_pattern_is_refused_by_file_and_field(data: object, field: str) -> None:
    with pytest.raises(InputError, match=field) as caught:
        pattern_from_dict(data, "capture.json: frame 3")
    assert str(caught.value).startswith("capture.json: frame 3")


def test_unknown_keys_are_ignored() -> None:
    assert pattern_from_dict({"kind": "white", "gamma": 2.2}, "here") == White()


def test_the_cross_pattern_lcd_shows_columns_xor_rows() -> None:
    lcd = CrossPatternLcd(8, 6)
    for pattern in gray_and_phase("x", 8, cell=2, periods=[4], profile="square"):
        assert (lcd.image(*lcd.switch(pattern)) == pattern_image(pattern, 8, 6)).all()
    for pattern in (*gray_and_phase("y", 6, cell=2, periods=[4], profile="square"), White(), Black()):
        assert (lcd.image(*lcd.switch(pattern)) == pattern_image(pattern, 8, 6)).all()
    columns = np.array([1, 0, 1, 0, 0, 0, 0, 0], bool)
    rows = np.array([1, 0, 0, 0, 0, 0], bool)
    assert not lcd.image(columns, rows)[0, 0]  # both switched: dark


def test_an_lcd_refuses_grey_values() -> None:
    with pytest.raises(PatternRefusedError, match="square"):
        CrossPatternLcd().switch(Phase("x", 16, 4, 0, 0.0, "sine"))


def test_what_was_read_before_does_not_let_its_equals_of_another_kind_pass():
    good = {"kind": "gray", "axis": "x", "bit": 1, "bits": 4}
    assert pattern_from_dict(good, "capture.json") == pattern_from_dict(dict(good), "capture.json")
    with pytest.raises(InputError, match="bit is True"):
        pattern_from_dict({**good, "bit": True}, "capture.json")
