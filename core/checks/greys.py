"""The grey values of captures held against each other: those of one camera by the same settings are alike."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.model import Concern, TargetSet

FEWEST = 4  # captures that tell what is usual
FEW = 0.25  # of the captures may be unlike the others; more are another setting, by choice
GAPS, USUAL_GAPS = 0.1, 0.02  # of the grey values; brighter by a tenth leaves out a tenth


def grey_concerns(sets: Sequence[TargetSet]) -> list[Concern]:
    """Find captures whose frames leave grey values out that those of the others of the same camera take."""
    concerns = []
    for camera in dict.fromkeys(t.camera for t in sets):
        gaps = {t.capture: t.gaps for t in sets if t.camera == camera and t.gaps is not None}
        usual = float(np.quantile([*gaps.values()], 1 - FEW)) if len(gaps) >= FEWEST else 1.0
        for name, share in gaps.items():
            if usual < USUAL_GAPS and share > GAPS:
                text = (
                    f"{name}: its frames leave out {share:.0%} of the grey values, those of the other captures "
                    f"{usual:.0%}: they were brightened, given a gamma or cut to fewer bits after the camera; record "
                    "it with the settings of the others"
                )
                concerns.append(Concern("doubtful", text))
    return concerns
