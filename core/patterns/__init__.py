"""What the projector was meant to show: line by line, exactly as the interchange format defines it.

pattern.py    the kinds of pattern and how bright each makes projector line i
sequence.py   the orders of patterns that measuring uses: Gray code with phase steps, light sectioning, ...
lcd.py        what a line-addressed glass plate can show (one axis, or columns XOR rows), and what it refuses
"""

from core.patterns.lcd import CrossPatternLcd, PlainLcd
from core.patterns.pattern import (
    Axis,
    Black,
    Code,
    Line,
    Pattern,
    Phase,
    White,
    brightness,
    pattern_from_dict,
    pattern_image,
    pattern_to_dict,
)
from core.patterns.sequence import gray_and_phase, light_sections, reference_sequence

__all__ = [
    "Axis",
    "Black",
    "Code",
    "CrossPatternLcd",
    "Line",
    "Pattern",
    "Phase",
    "PlainLcd",
    "White",
    "brightness",
    "gray_and_phase",
    "light_sections",
    "pattern_from_dict",
    "pattern_image",
    "pattern_to_dict",
    "reference_sequence",
]
