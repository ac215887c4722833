"""The numbers that codes can tell against the lines of the projector that showed them."""

from pathlib import Path

import pytest

from core.checks import code_concerns
from core.model import Capture, DeviceSpec, Frame
from core.patterns import parse_sequence

LAMPS = {name: DeviceSpec(lines, 100, (0.1, 0.1), 50.0) for name, lines in (("narrow", 160), ("wide", 1280))}


@pytest.mark.parametrize("exchanged", [False, True])
def test_codes_are_held_against_the_projector_that_shows_them(exchanged: bool) -> None:
    """The wide one's code had room for six times the narrow one's lines, which project.json lists first."""
    frames = []
    for name, other in (("narrow", "wide"), ("wide", "narrow")):
        size = LAMPS[other if exchanged else name].width, 100
        for k, pattern in enumerate(parse_sequence("gray-sine").patterns(size)):
            frames.append(Frame(Path(f"{name}-{k}.png"), pattern, camera="left", projector=name))
    capture = Capture(Path("plane"), "plane", tuple(frames))
    told = [concern.text for concern in code_concerns([capture], LAMPS)]
    assert [text.partition("(")[2].partition(")")[0] for text in told] == (
        ["plane by narrow", "plane by wide"] if exchanged else []
    )
