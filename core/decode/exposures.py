"""Several exposures in one capture: the frames of a pattern made one, of more depth than any of them.

Grey values above the camera's black level grow with the exposure. What is saturated in a long exposure is seen in a
shorter one, what is dark in that one in the longer: every sample counts by the square of its exposure, none that is
saturated counts.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.decode.frames import Image
from core.errors import InputError
from core.patterns import Pattern

DEEPEST = 65535
FINEST = 16  # steps that one grey value is divided into
SAME = 1e-6  # part by which equal exposures may differ


def fuse_exposures(
    patterns: Sequence[Pattern],
    images: Sequence[Image],
    exposures_ms: Sequence[float | None],
    saturation: float | None,
    where: str,
) -> tuple[list[Pattern], list[Image], int] | None:
    """Make one image of all exposures of a pattern.

    Parameters
    ----------
    images : sequence of arrays (H, W)
        One for each pattern.
    exposures_ms : sequence of float or None
        Exposure of every frame.
    saturation : float, optional
        Grey value from which a sample is saturated; by default the largest of the container.
    where : str
        What messages call the capture.

    Returns
    -------
    fused : (patterns, images, steps), optional
        Each pattern once, uint16 images of `steps` to a grey value of the longest exposure, where all samples are
        saturated 65535; None where there is but one exposure.

    Raises
    ------
    InputError
        Where some frames have no exposure, and others have.
    """
    known = [e for e in exposures_ms if e is not None]
    if not known or (max(known) - min(known) <= SAME * max(known) and len(known) == len(exposures_ms)):
        return None
    if len(known) < len(exposures_ms):
        missing = list(exposures_ms).index(None)
        raise InputError(f"{where}, frame {missing}", 'no "exposure_ms", which other frames have', "give it to all")
    longest = max(known)
    full = float(np.iinfo(images[0].dtype).max) if saturation is None else saturation
    groups: dict[Pattern, list[int]] = defaultdict(list)
    for n, pattern in enumerate(patterns):
        groups[pattern].append(n)
    ground = _black_level(list(groups.values()), images, known, full)
    steps = max(1, min(FINEST, int(DEEPEST / (full * longest / min(known)))))
    fused: list[Image] = []
    for numbers in groups.values():
        total = np.zeros(images[0].shape, np.float32)
        weights = np.zeros_like(total)
        for n in numbers:
            weight = np.where(images[n] < full, np.float32(known[n] ** 2), np.float32(0))
            total += weight * (images[n].astype(np.float32) - np.float32(ground)) * np.float32(longest / known[n])
            weights += weight
        light = np.divide(total, weights, out=np.full_like(total, np.inf), where=weights > 0) + np.float32(ground)
        fused.append(np.clip(np.rint(light * steps), 0, DEEPEST).astype(np.uint16))
    return list(groups), fused, steps


def _black_level(groups: list[list[int]], images: Sequence[Image], exposures: list[float], full: float) -> float:
    """Grey value that needs no light, where two exposures of a pattern tell it; else 0."""
    found: list[NDArray[np.float64]] = []
    for numbers in groups:
        short, long = min(numbers, key=lambda n: exposures[n]), max(numbers, key=lambda n: exposures[n])
        if exposures[long] <= (1 + SAME) * exposures[short]:
            continue
        a, b = (images[n][::8, ::8].astype(float).ravel() for n in (short, long))
        level = (a * exposures[long] - b * exposures[short]) / (exposures[long] - exposures[short])
        found.append(level[b < full])
    levels = np.concatenate(found) if found else np.zeros(0)
    return float(np.median(levels)) if len(levels) else 0.0
