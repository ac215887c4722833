"""Projectors declared otherwise than captures show them; measured distances that contradict each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.calibrate import calibrate_photogrammetric
from core.checks import bar_notes, end_notes, length_concerns, light_end, response_concerns
from core.errors import InputError
from core.fields import read_document
from core.model import DeviceSpec, NetworkScale, ScaleBar
from tests.core.checks.rigs import simulate

SHAPE = (120, 160)


def seen(begin: float, last: float, *, slope: float = 1.2, edge: float = 1e9) -> np.ndarray:
    """Lines over an image: rising along rows, lit up to `last`, cut along a slanted edge of the object."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    lines = begin + slope * x + 0.05 * y
    return np.where((lines <= last) & (x + 0.4 * y < edge) & (lines >= 0), lines, np.nan).astype(np.float32)


def test_the_end_of_the_light_is_found_and_nothing_else() -> None:
    line, at = light_end(seen(20, 159))
    assert abs(line - 159) <= 1
    assert abs(at - 115 / 160) < 0.03
    assert light_end(seen(20, 159)[:, ::-1])[0] == line  # whichever way the lines run
    assert light_end(seen(20, 159).T)[0] == line
    assert light_end(seen(-30, 1e9)) is None  # it goes on to the image's edge
    assert light_end(seen(20, 1e9, edge=110)) is None  # an object that does not lie along the stripes


@pytest.mark.parametrize(("width", "told"), [(160, False), (165, False), (176, True), (200, True)])
def test_a_projector_declared_too_wide_is_named(width: int, told: bool) -> None:
    spec = DeviceSpec(width, 160, (0.1, 0.1), 100.0)
    ends = {name: (light_end(seen(begin, 159)), None) for name, begin in (("plane+00", 20.0), ("plane+15", 40.0))}
    notes = end_notes(ends, spec)
    assert set(notes) == (set(ends) if told else set())
    assert all(f"width is {width}: correct width" in text for text in notes.values())
    # an edge that stays where it is in the image may be the object's
    assert not end_notes({"a": ends["plane+00"], "b": ends["plane+00"]}, spec)


@pytest.mark.parametrize("gamma", [0.5, 1.05, 1.6, 2.2])
def test_a_response_with_its_columns_exchanged_is_named(gamma: float) -> None:
    """Captures show a power law to 0.03 of the light, or a straight line where levels were chosen by the response."""
    level, rng = np.linspace(0, 1, 11), np.random.default_rng(0)
    target = simulate("modern", 3).fields[0]

    def shown(power: float) -> list:
        bend = 0.03 * rng.uniform(-1, 1, 4)[:, None] * np.sin(np.pi * level)
        return [replace(target, response=np.column_stack([level, level**power + b])) for b in bend]

    said = DeviceSpec(640, 480, (0.01, 0.01), 20.0, response=tuple(zip(level, level**gamma, strict=True)))
    turned = replace(said, response=tuple(zip(level**gamma, level, strict=True)))
    for power in (gamma, 1.0):
        assert not response_concerns(shown(power), {"projector": said})
    for power in (gamma, gamma**2):  # and where levels were chosen by the wrong one
        told = response_concerns(shown(power), {"projector": turned})
        assert [("columns exchanged" in c.text) for c in told] == [True] * (gamma != 1.05)


def test_measured_distances_that_contradict_each_other_are_named() -> None:
    p = simulate("modern", 3)
    _, adjustment = calibrate_photogrammetric(p.rig, p.board, p.fields, scale=p.scale)
    bar = adjustment.network.scale
    assert bar is not None
    for factor, told in ((1.0, 0), (1.02, 1)):
        other = NetworkScale(bar.start, bar.stop, factor * bar.length_mm, bar.sigma_mm)
        network = replace(adjustment.network, lengths=(other,))
        both = replace(adjustment, network=network, length_sigma_mm=(0.0, 0.0))
        texts = [c.text for c in length_concerns(both, p.board, p.scale, None, False)]
        assert sum("lengths, entry 0" in text and "disagree" in text for text in texts) == told, texts
    # a board that the printer stretched: the remedy is a factor, and with it the board agrees with the bar
    drawn = replace(p.board, xyz_mm=p.board.xyz_mm / 1.004)
    (text,) = (c.text for c in length_concerns(adjustment, drawn, p.scale, None, False))
    factor = float(text.split()[-1])
    assert text.endswith(f"multiply the coordinates in testfield.csv by {factor:.4f}")
    assert factor == pytest.approx(1.004, abs=3e-4)
    assert not length_concerns(adjustment, replace(drawn, xyz_mm=factor * drawn.xyz_mm), p.scale, None, False)


def test_a_bar_in_metres_is_said_where_nothing_can_be_adjusted() -> None:
    p = simulate("modern", 3)
    assert bar_notes(p.scale, p.board) == ()
    (text,) = bar_notes(ScaleBar(p.scale.start, p.scale.stop, p.scale.length_mm / 1000, 0.001), p.board)
    assert "is it in m instead of mm?" in text


def test_a_field_twice_is_refused(tmp_path) -> None:
    path = tmp_path / "project.json"
    path.write_text('{"format": "x", "version": 1, "camera": {"width": 640, "width": 320}}')
    with pytest.raises(InputError, match="field 'width' is there twice"):
        read_document(path, "x")
