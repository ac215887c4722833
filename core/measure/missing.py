"""Why a target was not measured, in words."""

from __future__ import annotations

import numpy as np

from core.measure.centres.rays import Rays
from core.measure.identity.grow import Lattice, predict
from core.model import Array, PhaseMap

EXCLUDED = "excluded by the operator"
OUTSIDE = "outside the image"


def reasons(phase: PhaseMap, lattice: Lattice, faults: dict[int, str]) -> dict[int, str]:
    """Reasons by target for all that are not measured.

    `faults` has the identified targets (indices into the board) whose dots must not be used, and why.
    """
    unknown = np.flatnonzero(~lattice.known)
    uv, jacobian, support = predict(lattice, unknown)
    ellipse = jacobian * lattice.board.radius_mm[unknown, None, None]
    height, width = phase.image.shape
    share_lit = _share_lit(phase, np.nan_to_num(uv, nan=-1e4), ellipse, _darkness(phase, lattice))
    result = dict(faults)
    for k, target in enumerate(unknown.tolist()):
        half = np.linalg.norm(ellipse[k], axis=1)
        beyond = np.array([-0.5, -0.5]) - uv[k], uv[k] - np.array([width - 0.5, height - 0.5])
        if not np.all(np.isfinite(uv[k])) or max(np.max(b - half) for b in beyond) > 0:
            result[target] = OUTSIDE
        elif max(np.max(b + half) for b in beyond) > 0:
            result[target] = "cut by the image border"
        elif lattice.notes.get(target):
            result[target] = lattice.notes[target]
        elif share_lit[k] < 0.5:
            result[target] = "not lit"
        elif support[k] == 0:
            result[target] = "ambiguous: too far from all identified targets to be sure"
        else:
            result[target] = "no dot where its neighbours predict it: covered, or without contrast"
    return dict(sorted(result.items()))


def _darkness(phase: PhaseMap, lattice: Lattice) -> float:
    """Grey value that only lit things exceed: a third of the brighter of dot and board at identified targets."""
    known = np.flatnonzero(lattice.known)
    if not len(known):
        return 0.0
    ellipse = lattice.view.jacobian(lattice.board.xyz_mm[known]) * lattice.board.radius_mm[known, None, None]
    rays = Rays(lattice.blobs.uv[lattice.blob[known]], ellipse)
    value = np.nan_to_num(rays.sample(phase.image, np.array([0.0, 1.8])))
    return float(np.median(value.max(axis=(1, 2)))) / 3


def _share_lit(phase: PhaseMap, uv: Array, ellipse: Array, dark: float) -> Array:
    """Share (m,) of targets' surroundings with a decoded phase or the brightness of a lit dot."""
    rays, radius = Rays(uv, ellipse), np.array([0.0, 0.5, 1.0, 1.5])
    decoded = np.isfinite(rays.sample(phase.u, radius)) | np.isfinite(rays.sample(phase.v, radius))
    bright = rays.sample(phase.image, radius) > dark
    return np.asarray(np.mean(decoded | bright, axis=(1, 2)))
