"""The types of arrays that travel."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Ints = NDArray[np.int64]

Figures = dict[str, Any]  # what `--json` writes: plain numbers, strings, lists and dictionaries
