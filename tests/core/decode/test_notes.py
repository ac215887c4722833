"""A capture that decodes nowhere, or far less than its light promises, says so with the cause and the remedy."""

from __future__ import annotations

import numpy as np
import pytest

from core.decode import DecodeOptions, decode
from core.model import named_by
from core.patterns import Black, Phase, White, gray_and_phase

PATTERNS = [*gray_and_phase("x", 640, cell=8, periods=[16]), White(), Black()]


def noted(bench, change=lambda images: images, **more: object) -> str:
    b = bench(blur=1.0, **more)
    return " ".join(decode(PATTERNS, change(b.take(PATTERNS)), lines=(640, 640)).notes)


def test_a_sound_capture_needs_no_note(bench) -> None:
    assert noted(bench) == ""


def test_shadow_is_no_fault(bench) -> None:
    assert noted(bench, gain=np.where(np.arange(1000) < 300, 70.0, 0.0)[None, :]) == ""


def test_what_the_lamp_of_the_room_lights_alone_is_no_light_of_the_projector(bench) -> None:
    """Its noise was taken to be that of grey values as low as what its frames differ by."""
    across = np.arange(1000)[None, :]
    lit, room = np.where(across < 300, 100.0, 0.0), np.where(across < 350, 71.0, 150.0)
    b = bench(blur=1.0, gain=lit, ambient=room, dark=-35.0, shot=0.5)  # of a camera whose black is at 70
    patterns = gray_and_phase("x", 640, cell=8, periods=[16], steps=24)
    assert not decode(patterns, b.take(patterns), lines=(640, 640)).notes


def test_a_projector_that_lights_nothing(bench) -> None:
    assert "lights no pixel" in noted(bench, gain=0.0)


def test_ambient_light_that_flickers_is_no_light_of_the_projector(bench) -> None:
    def flicker(images: list) -> list:
        return [image + np.uint8(n % 3 * 4) for n, image in enumerate(images)]

    assert "lights no pixel" in noted(bench, flicker, gain=0.0)


def test_noise_that_hides_the_light_of_a_pixel_is_named(bench) -> None:
    """Frames of a lit pixel differ by 100 grey values, by 12 standard deviations of their noise only from 240."""
    note = noted(bench, gain=100.0, ambient=70.0, dark=400.0)
    before, _, named = note.partition("too weak for the noise of ")
    assert float(named.split()[0]) == pytest.approx(20, rel=0.05)
    assert "lights no pixel" not in before


def test_overexposure(bench) -> None:
    note = noted(bench, gain=400.0)
    assert "full scale (255)" in note
    assert "shorter" in note


def test_grey_values_are_those_of_the_frames_where_decoding_makes_finer_steps_of_them(bench) -> None:
    finer = [16 * image.astype(np.uint16) for image in bench(blur=1.0, gain=400.0).take(PATTERNS)]
    phase = decode(PATTERNS, finer, lines=(640, 640), options=DecodeOptions().in_steps(16, 16 * 255.0))
    assert "full scale (255)" in phase.notes[0]


def test_frames_at_full_scale_all_over_are_not_called_dark(bench) -> None:
    note = noted(bench, gain=900.0, ambient=300.0)
    assert "at full scale (255) all over" in note
    assert "Expose shorter" in note


def test_overexposure_accuses_no_frames(bench) -> None:
    """White is saturated all over: it shows no noise, and bits contradict phases that are cut off."""
    seen = np.where(np.arange(1000) < 700, np.linspace(200, 420, 1000), 0.0)[None, :]
    note = noted(bench, gain=seen, ambient=60.0)
    assert "full scale (255)" in note
    assert "Take the capture again" not in note


@pytest.mark.parametrize("change", [lambda images: images[::-1], lambda images: [*images[3:], *images[:3]]])
def test_frames_in_the_wrong_place(bench, change) -> None:
    b = bench(blur=1.0)
    phase = decode(PATTERNS, change(b.take(PATTERNS)), lines=(640, 640))
    note = " ".join(phase.notes)
    assert "light" not in map(named_by, phase.notes)
    assert note.startswith("Only ")
    assert "Take the capture again" in note


def test_white_at_full_scale_hides_no_frames_in_the_wrong_place(bench) -> None:
    """Of the stripes none is saturated: what they contradict is no light."""

    def wrong(images: list) -> list:
        return [*images[3:-2], *images[:3], np.full_like(images[-2], 255), images[-1]]

    note = noted(bench, wrong)
    assert "Take the capture again" in note
    assert "full scale" not in note


def test_a_dark_board_accuses_no_frames(bench) -> None:
    """Shot noise is far larger in white dots than in the dark between them, where fringes are too weak for it."""
    seen = np.where(np.arange(1000) % 40 < 8, 180.0, 12.0)[None, :]
    patterns = [*gray_and_phase("x", 640, cell=2, periods=[4]), White(), Black()]
    b = bench(blur=1.4, gain=seen, ambient=1.0, dark=0.1, shot=0.05)
    phase = decode(patterns, b.take(patterns), lines=(640, 640))
    assert ["too weak for the noise" in note for note in phase.notes] == [True]
    assert {named_by(note) for note in phase.notes} == {"light"}


def test_fringes_that_do_not_show(bench) -> None:
    """The bits are seen, the fringes of four lines are not: out of focus."""
    patterns = [*gray_and_phase("x", 640, cell=4, periods=[4]), White(), Black()]
    b = bench(blur=2.2)
    (note, *_) = decode(patterns, b.take(patterns), lines=(640, 640)).notes
    assert "too weak for the noise" in note
    assert "Focus" in note


def test_bits_that_do_not_show_are_no_fringes(bench) -> None:
    """A code alone has no fringes: its stripes are dim all over."""
    patterns = [*gray_and_phase("x", 640, cell=4, periods=[]), White(), Black()]
    b = bench(gain=14.0, dark=30.0)
    (note, *_) = decode(patterns, b.take(patterns), lines=(640, 640)).notes
    assert "the stripes are too weak for the noise" in note
    assert "fringes" not in note


def test_periods_that_noise_makes_ambiguous_are_not_said_to_contradict(bench) -> None:
    patterns = [Phase("x", period, 3, k, 2 * np.pi * k / 3, "sine") for period in (16.0, 17.0, 18.0) for k in range(3)]
    b = bench(dark=30.0, gain=60.0)
    phase = decode(patterns, b.take(patterns), lines=(640, 640))
    (note,) = phase.notes
    assert named_by(note) == "light"
    assert "noise of 5.5 grey values" in note  # sqrt(30)
    assert "contradict" not in note
