"""What the images of every device say of the form of its lens, and of what changed between them."""

from __future__ import annotations

import numpy as np

from core.checks.changed import change_concerns, changes
from core.checks.lacking import Lacking, lacking
from core.checks.lens import POWERS, lens_concerns, radial
from core.geometry import Projection
from core.model import AdjustedDevice, Adjustment, Array, Concern


def form_concerns(adjustment: Adjustment) -> list[Concern]:
    """H0: what was adjusted is of the right form, for every device, and the same in all images."""
    concerns: list[Concern] = []
    for name, device in adjustment.devices.items() if len(adjustment.points_mm) else ():
        found = lacking_terms(adjustment, name, device)
        if found is not None:
            concerns += change_concerns(adjustment, name, device, found, len(POWERS))
            concerns += lens_concerns(name, device, found)
    return concerns


def lacking_terms(adjustment: Adjustment, name: str, device: AdjustedDevice) -> Lacking | None:
    """The radial terms of `core.checks.lens`, and behind them those of `core.checks.changed`."""
    since = changes(adjustment)

    def terms(number: int, count: int, found: Projection, xyz: Array, seen: Array) -> Array:
        return np.concatenate([radial(device, seen), since(number, count, found, xyz)], axis=-1)

    return lacking(adjustment, name, device, terms, len(POWERS))
