"""The `fringes` package: its own default sequence of 16 frames for both axes."""

from __future__ import annotations

import fringes
import numpy as np
from serving import Arrays, serve


def prepare(data: Arrays):
    """Show the sequence on a screen of square size and look at it along the projector coordinates given."""
    device = fringes.Fringes()
    device.X = device.Y = int(data["lines"])
    shown = device.encode()
    seen = np.ascontiguousarray(shown[:, data["v"], data["u"]])
    return lambda: device.decode(seen)


def answer(decoded) -> Arrays:
    """Give the registration: u and v."""
    coordinates = np.asarray(decoded[2], np.float32)
    return {"uv": coordinates.reshape(2, *coordinates.shape[-3:-1])}


serve(prepare, answer)
