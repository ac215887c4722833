"""Frames from which no absolute coordinate follows are refused with the place, the value and the remedy."""

from __future__ import annotations

import numpy as np
import pytest

from core.decode import decode
from core.errors import Cancelled, InputError
from core.patterns import Black, Code, Line, Lines, Phase, White, brightness, gray_and_phase, light_sections
from core.progress import Progress


def shown(patterns, lines=64, dtype=np.uint8):
    """A pixel per line, without blur or noise."""
    return [np.tile(20 + 100 * brightness(p, np.arange(lines)), (4, 1)).astype(dtype) for p in patterns]


def refused(patterns, lines=(64, 64), images=None) -> str:
    with pytest.raises(InputError) as caught:
        decode(patterns, shown(patterns) if images is None else images, lines=lines, where="captures/plane")
    message = str(caught.value)
    assert message.startswith("captures/plane")
    assert "\n" not in message
    return message


FULL = gray_and_phase("x", 64, cell=2, periods=[4])


def test_too_few_bits() -> None:
    message = refused(gray_and_phase("x", 32, cell=2, periods=[4]))
    assert "axis x" in message
    assert "4 bits in cells of 2" in message
    assert "32" in message
    assert "64" in message


@pytest.mark.parametrize("bit", [0, 2, 3])
@pytest.mark.parametrize("kind", ["gray", "binary"])
def test_a_missing_bit(bit, kind) -> None:
    patterns = gray_and_phase("x", 64, cell=2, periods=[4], kind=kind)
    rest = [p for p in patterns if not (isinstance(p, Code) and p.bit == bit)]
    assert f"bit {bit} " in refused(rest)
    assert f"bit {bit} " in refused(rest, lines=None)  # without the first bit all lines were of one period


def test_phases_alone_say_how_far_they_tell_places_apart_where_nobody_knows_the_lines() -> None:
    steps = [Phase("x", 16.0, 4, k, k * np.pi / 2) for k in range(4)]
    (note,) = decode(steps, shown(steps)).notes
    assert "u within 16 lines" in note
    assert not decode(steps, shown(steps, 16), lines=(16, 16)).notes
    assert not decode(FULL, shown(FULL)).notes


@pytest.mark.parametrize("bit", [0, 3, 5])
def test_a_missing_bit_of_code_alone(bit) -> None:
    patterns = gray_and_phase("x", 64, cell=1, periods=[])
    assert f"bit {bit} " in refused([p for p in patterns if p.bit != bit])


@pytest.mark.parametrize("count", [4, 120])
def test_words_of_another_projector(count: int) -> None:
    """They were decoded: lines without an entry were taken for dark, entries without a line left out."""
    words = [Lines("x", "".join("01"[c == "1"] for c in f"{k:0{count}b}"[:count])) for k in (5, 9, 12)]
    message = refused([*FULL, *words])
    assert f"pattern {len(FULL)}: " in message
    assert f"{count} entries, the projector 64 lines" in message


@pytest.mark.parametrize(
    ("pattern", "told"),
    [
        (Line("x", 64), "index is 64, the projector has 64 lines; give a line from 0 to 63"),
        (Line("x", 3, 65), "width is 65"),
        (Code("gray", "x", 0, 3, 641), "cell is 641"),
        (Phase("x", 641.0, 4, 0, 0.0), "period is 641"),
    ],
)
def test_patterns_beyond_the_projector(pattern, told) -> None:
    assert told in refused([*FULL, pattern])
    assert f"pattern {len(FULL)}: " in refused([*FULL, pattern])


def test_one_period_without_code() -> None:
    message = refused([p for p in FULL if isinstance(p, Phase)])
    assert "period 4" in message
    assert "Gray" in message


def test_periods_whose_beat_is_shorter_than_the_projector() -> None:
    patterns = [p for p in gray_and_phase("x", 64, cell=1, periods=[8, 12]) if isinstance(p, Phase)]
    assert "24 of 64 lines" in refused(patterns)


def test_cells_wider_than_the_period() -> None:
    assert "wider" in refused(gray_and_phase("x", 64, cell=8, periods=[4]))


def test_two_steps_of_a_period() -> None:
    assert "2 frames of period 4 have 2 different shift_rad" in refused(FULL[:-2])


def test_three_steps_of_one_shift() -> None:
    steps = [Phase("x", 64, 3, k, 2 * np.pi * k) for k in range(3)]
    assert "of period 64 have 1 different shift_rad" in refused(steps)


def test_the_broken_axis_is_named_though_the_other_is_sound() -> None:
    broken = gray_and_phase("y", 16, cell=2, periods=[4])
    images = [*shown(FULL), *shown(broken)]
    assert "axis y" in refused([*FULL, *broken], images=images)


def test_nothing_but_white_and_black() -> None:
    assert "no code, phase or line frames" in refused([White(), Black()])


def test_no_frames() -> None:
    assert "no frames" in refused([])


def test_fewer_images_than_patterns() -> None:
    assert "8 images but 9 patterns" in refused(FULL, images=shown(FULL)[:-1])


def test_images_of_different_sizes() -> None:
    images = shown(FULL)
    images[3] = images[3][:, :50]
    message = refused(FULL, images=images)
    assert "frame 3" in message
    assert "50 × 4 px" in message


@pytest.mark.parametrize("dtype", [np.float32, np.int32, bool])
def test_images_that_are_not_grey_values(dtype) -> None:
    assert np.dtype(dtype).name in refused(FULL, images=shown(FULL, dtype=dtype))


def test_images_of_different_depths() -> None:
    images = shown(FULL)
    images[2] = images[2].astype(np.uint16)
    assert "frame 2" in refused(FULL, images=images)


def test_colour_images() -> None:
    images = [np.stack([i] * 3, axis=-1) for i in shown(FULL)]
    assert "single-channel" in refused(FULL, images=images)


def test_two_different_frames_of_one_pattern() -> None:
    patterns = [*FULL, FULL[1]]
    message = refused(patterns, images=[*shown(FULL), *shown(FULL[:1])])
    assert "frames 1 and 9 have the same pattern" in message


def test_the_user_can_cancel() -> None:
    with pytest.raises(Cancelled):
        decode(FULL, shown(FULL), progress=Progress(cancelled=lambda: True))


def test_a_sound_set_is_not_refused() -> None:
    for patterns in (FULL, light_sections("x", 64), gray_and_phase("x", 64, cell=1, periods=[])):
        u = decode(patterns, shown(patterns), lines=(64, 64)).u[0]
        good = np.isfinite(u)
        assert good.mean() > 0.95  # a word of equal bits in all frames does not tell light from dark
        assert np.abs(u - np.arange(64))[good].max() < 0.1
