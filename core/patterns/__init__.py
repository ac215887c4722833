"""What the projector was meant to show: line by line, exactly as the interchange format defines it.

kinds/        the kinds of pattern, a file each, and their registry
pattern.py    what can be asked of any pattern: how bright it makes projector line i, its axis, its words
sequence.py   the orders of patterns that measuring uses: Gray code with phase steps, light sectioning, ...
lcd.py        what a line-addressed glass plate can show (one axis, or columns XOR rows), and what it refuses
"""

from core.patterns.kinds import KINDS, Axis, Black, Code, Kind, Level, Line, Lines, Pattern, Phase, White
from core.patterns.lcd import CrossPatternLcd, PlainLcd
from core.patterns.pattern import (
    axis_of,
    brightness,
    cycle_lines,
    describe,
    grey_reason,
    level_of,
    pattern_from_dict,
    pattern_image,
    pattern_to_dict,
    use_of,
)
from core.patterns.sequence import finest_steps, gray_and_phase, light_sections, reference_sequence

__all__ = [
    "KINDS",
    "Axis",
    "Black",
    "Code",
    "CrossPatternLcd",
    "Kind",
    "Level",
    "Line",
    "Lines",
    "Pattern",
    "Phase",
    "PlainLcd",
    "White",
    "axis_of",
    "brightness",
    "cycle_lines",
    "describe",
    "finest_steps",
    "gray_and_phase",
    "grey_reason",
    "level_of",
    "light_sections",
    "pattern_from_dict",
    "pattern_image",
    "pattern_to_dict",
    "reference_sequence",
    "use_of",
]
