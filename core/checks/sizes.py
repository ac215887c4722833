"""The dots' size as seen against the one that their board's file says: eccentricities go with its square."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from core.model import Concern, TargetSet, Testfield

FEWEST = 8  # dots of a capture
OFF = 1.25  # prints and blur change diameters by less; of six sound projects all were 0.98 to 1.00
RADIUS = 1.7, 2.4  # times as large: diameter_mm is the radius


def size_concerns(targets: Sequence[TargetSet], boards: Mapping[str, Testfield | None]) -> list[Concern]:
    """Compare diameters with the dots' distances from each other, by boards (by capture) of one file."""
    found = {t.capture: size for t in targets if (size := _size(t, boards.get(t.capture))) is not None}
    size = float(np.median([*found.values()])) if found else 1.0
    if 1 / OFF <= size <= OFF:
        return []
    names = f"{min(found)} and {len(found) - 1} more" if len(found) > 1 else min(found)
    remedy = "is it the radius?" if RADIUS[0] < size < RADIUS[1] else "correct it, or name the board that was captured"
    text = f"{names}: dots are seen {size:.2f} times as large as diameter_mm of their testfield file says; {remedy}"
    return [Concern("doubtful", text)]


def _size(t: TargetSet, board: Testfield | None) -> float | None:
    """Seen over nominal diameter, by the affinity from the board to the image."""
    if board is None or board.kind != "dots" or len(t.row) < FEWEST:
        return None
    at = [board.index()[key] for key in zip(t.row.tolist(), t.col.tolist(), strict=True)]
    A = np.column_stack([board.xyz_mm[at, :2] - board.xyz_mm[at, :2].mean(axis=0), np.ones(len(at))])
    area = abs(np.linalg.det(np.linalg.lstsq(A, t.camera_uv, rcond=None)[0][:2]))
    return float(np.median(t.diameter_px / board.diameter_mm[at]) / np.sqrt(area)) if area > 0 else None
