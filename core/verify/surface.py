"""What projector coordinates say of a capture: the image's hand, and whether a plane is one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.model import Capture, PhaseMap
from core.model.finding import Finding
from core.numerics import quantile_of, ranked, scattered
from core.patterns import Code
from core.verify.pixels import LEAST_LIT

OFF_PLANE = 0.35  # share of the pixels that no projective map holds
PLANE_LINES = 3.0
LEAST_OF_PLANE = 0.3  # share of the pixels by which a plane is found
DRAWS = (60, 300, 300, 300)  # of five pixels: for the only plane, and for those that may be lit behind a board
WRONG_HAND = 0.5


def hand(phase: PhaseMap) -> list[Finding]:
    """Camera and projector see a surface from the same side: their images of it are never mirror images."""
    d = max(3, min(phase.u.shape) // 80)
    thin = max(1, d // 3)

    def slopes(values: NDArray) -> tuple[NDArray, NDArray]:
        corner = values[:-d:thin, :-d:thin]
        return values[:-d:thin, d::thin] - corner, values[d::thin, :-d:thin] - corner

    (ux, uy), (vx, vy) = slopes(phase.u), slopes(phase.v)
    det = ux * vy - uy * vx
    det = det[np.isfinite(det)]
    if len(det) < LEAST_LIT // 3:
        return []
    share = float(np.mean(det < 0))
    if share <= WRONG_HAND + 0.2:
        return []
    text = (
        "columns and rows of the projector are exchanged, or one of them is reversed: the camera's image is mirrored "
        "against the projector's; correct axis in the patterns, or mirror the frames back"
    )
    return [Finding("axes", "bad", text, {"mirrored": share}, names="mistake")]


def planes(capture: Capture, phase: PhaseMap) -> list[Finding]:
    """On a plane each projector coordinate is a projective function of the camera's; few planes may be lit.

    Pieces of a mistaken binary code may look like planes, those of a Gray code are told by their jumps.
    """
    binary = {f.pattern.axis for f in capture.frames if isinstance(f.pattern, Code) and f.pattern.kind == "binary"}
    found = []
    for axis, values, along in (("x", phase.u, "columns"), ("y", phase.v, "rows")):
        valid = np.flatnonzero(np.isfinite(values))
        if len(valid) < 2000:
            continue
        chosen = valid[scattered(len(valid), 600)]
        y, x = np.divmod(chosen, values.shape[1])
        lines = values.ravel()[chosen].astype(np.float64)
        limit = max(PLANE_LINES, 0.02 * (quantile_of(lines, 0.95) - quantile_of(lines, 0.05)))
        off = np.ones(len(lines), bool)
        for draws in DRAWS[:1] if axis in binary else DRAWS:
            if off.mean() > OFF_PLANE:
                at = x[off] / values.shape[1], y[off] / values.shape[1]
                off[off] = _off_projective(*at, lines[off], draws) > limit
        share = float(off.mean())
        if share > OFF_PLANE:
            text = (
                f"{along} do not rise steadily over the plane ({share:.0%} of the pixels are off): code frames were "
                "exchanged, or cell, bits or period of the patterns are wrong"
            )
            found.append(Finding("order", "bad", text, {f"off_{axis}": share}, names="mistake"))
    return found


def _off_projective(x: NDArray, y: NDArray, u: NDArray, count: int) -> NDArray:
    """Distances in lines from the projective function that the most pixels agree on."""
    one = np.ones_like(x)
    A = np.stack([one, x, y, -u * x, -u * y], axis=1)
    draws = scattered(len(u), 5 * count).reshape(count, 5)
    try:
        p = np.linalg.solve(A[draws], u[draws][..., None])[..., 0]
    except np.linalg.LinAlgError:  # five on one line
        p = (np.linalg.pinv(A[draws]) @ u[draws][..., None])[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.abs(p[:, :3] @ A[:, :3].T / (1 + p[:, 3:] @ A[:, 1:3].T) - u)
    off = np.nan_to_num(off, nan=np.inf)
    best = off[np.argmin(ranked(off, LEAST_OF_PLANE))]
    for _ in range(3):  # least squares over those that agree, for distortion bends the map a little
        near = best <= max(4.0 * float(ranked(best, LEAST_OF_PLANE)), 0.5)
        A = np.stack([one, x, y, -u * x, -u * y, x * x, x * y, y * y], axis=1)
        p, *_ = np.linalg.lstsq(A[near], u[near], rcond=None)
        curved = p[0] + p[1] * x + p[2] * y + p[5] * x * x + p[6] * x * y + p[7] * y * y
        best = np.minimum(best, np.abs(curved / (1 + p[3] * x + p[4] * y) - u))
    return best
