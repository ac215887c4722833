"""What a line-addressed LCD can show.

The cross-pattern projector has one glass plate with column electrodes and a second one turned by 90° (Brenner, Böhm,
Gühring 1999, section 2): light passes where exactly one of the two is switched, so it shows any column pattern XOR any
row pattern, in black and white, and nothing else.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.errors import PatternRefusedError
from core.lazy import dataclass
from core.patterns.kinds import Pattern
from core.patterns.pattern import axis_of, brightness, describe, grey_reason

Lines = NDArray[np.bool_]


@dataclass(frozen=True)
class CrossPatternLcd:
    """Columns XOR rows.

    Examples
    --------
    >>> from core.patterns import Phase
    >>> lcd = CrossPatternLcd(4, 2)
    >>> columns, rows = lcd.switch(Phase("x", 4, 4, 0, np.pi / 2, "square"))
    >>> lcd.image(columns, rows).astype(int)
    array([[1, 1, 0, 0],
           [1, 1, 0, 0]])
    """

    width: int = 640
    height: int = 640

    def switch(self, pattern: Pattern) -> tuple[Lines, Lines]:
        """Give the column lines (width,) and row lines (height,) that show a pattern; greys are refused."""
        if reason := grey_reason(pattern):
            raise PatternRefusedError("projector", describe(pattern), f"this LCD is black or white, and {reason}")
        columns, rows = np.zeros(self.width, bool), np.zeros(self.height, bool)
        if axis_of(pattern) == "y":
            rows = brightness(pattern, np.arange(self.height)) > 0.5
        else:
            columns = brightness(pattern, np.arange(self.width)) > 0.5
        return columns, rows

    def image(self, columns: Lines, rows: Lines) -> Lines:
        """What is seen, shape (height, width), when these lines are switched."""
        return rows[:, None] ^ columns[None, :]
