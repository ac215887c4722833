"""
A kind of pattern
=================

A ramp of light over all lines. With one record it can be read from ``capture.json``, shown and described, and a
black-and-white projector refuses it with the reason.
"""

from dataclasses import dataclass
from typing import ClassVar

import matplotlib.pyplot as plt
import numpy as np

from core.patterns import KINDS, Kind, describe, pattern_from_dict, pattern_image, pattern_to_dict


@dataclass(frozen=True)
class Ramp:
    """Brightness rises from line 0 to the last."""

    axis: str
    lines: int
    kind: ClassVar[str] = "ramp"


KINDS["ramp"] = Kind(
    "word",  # how a decoder uses it: only a look-up can identify its lines
    lambda fields: Ramp(fields.text("axis", among=("x", "y")), fields.integer("lines", 2)),
    lambda pattern, i: np.clip(i / (pattern.lines - 1), 0.0, 1.0),
    lambda pattern, along: f"ramp over {pattern.lines} {along}",
    lambda pattern: "the pattern is a ramp: use a code",
)

# %%
# As capture.json would contain it.
ramp = pattern_from_dict({"kind": "ramp", "axis": "x", "lines": 64}, "here")
assert pattern_to_dict(ramp) == {"kind": "ramp", "axis": "x", "lines": 64}
plt.figure(figsize=(4, 2))
plt.imshow(pattern_image(ramp, 64, 24), cmap="gray")
plt.title(describe(ramp))
plt.show()
