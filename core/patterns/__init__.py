"""What the projector was meant to show: line by line, exactly as the interchange format defines it.

kinds/        the kinds of pattern, a file each, and their registry
pattern.py    what can be asked of any pattern: how bright it makes projector line i, its axis, its words
sequence.py   the orders of patterns that measuring uses: Gray code with phase steps, light sectioning, ...
presets.py    the sequences that have a name, with their options, for any projector size
dense.py      words in which about half the frames switch at every line
spec.py       a sequence as data: a preset or a list, from project.json, a file or a command's argument
lcd.py        what a line-addressed glass plate can show (one axis, or columns XOR rows), and what it refuses
"""

from core.patterns.kinds import KINDS, Axis, Black, Code, Kind, Level, Line, Lines, Pattern, Phase, White
from core.patterns.lcd import CrossPatternLcd
from core.patterns.pattern import (
    alike,
    axis_of,
    brightness,
    cycle_lines,
    describe,
    grey_reason,
    level_of,
    pattern_from_dict,
    pattern_image,
    pattern_to_dict,
    refuse_beyond,
    use_of,
)
from core.patterns.presets import PRESETS
from core.patterns.sequence import finest_steps, gray_and_phase, light_sections, reference_sequence
from core.patterns.spec import (
    SequenceSpec,
    default_sequence,
    like,
    parse_sequence,
    read_sequence,
    read_sequence_file,
    shows_grey,
    uses_version_2,
)

__all__ = [
    "KINDS", "PRESETS", "Axis", "Black", "Code", "CrossPatternLcd", "Kind", "Level", "Line", "Lines", "Pattern",
    "Phase", "SequenceSpec", "White", "alike", "axis_of", "brightness", "cycle_lines", "default_sequence", "describe",
    "finest_steps", "gray_and_phase", "grey_reason", "level_of", "light_sections", "like", "parse_sequence",
    "pattern_from_dict", "pattern_image", "pattern_to_dict", "read_sequence", "read_sequence_file",
    "reference_sequence", "refuse_beyond", "shows_grey", "use_of", "uses_version_2",
]  # fmt: skip
