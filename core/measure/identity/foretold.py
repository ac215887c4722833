"""Where targets should be by identified ones around them, and which spots are there; for many targets at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.compiling import njit
from core.measure.centres.kernels import inverted
from core.model import Array, Ints

CHOICES = 4  # spots looked at round a prediction
NEAR_FEW, NEAR = 0.35, 0.20  # how far a dot may lie from its prediction, in target spacings, by 1-2 and 3+ neighbours
ALONE, APART = 2.5, 0.15  # times its distance, and spacings, within which no other dot may lie
FAINT = 0.35  # of the neighbours' contrast
LONG = 1.8  # a spot's axis over the other, on the board
SMALL, LARGE = 0.6, 1.6  # times the usual diameter
STIFF = 0.03  # of the neighbours' weight, by which slopes of what a view misses are held near zero
WHY = (
    "",
    "its contrast is unlike its neighbours'",
    "its shape is not the expected ellipse: covered or lit in part",
    "its size is not the expected one: covered, lit in part or not a target",
    "cut by the image border",
    "ambiguous: two dots near the predicted place",
)  # a target has no spot


def foretell(
    targets: Ints, neighbours: Ints, blob: Ints, spots: Array, base: Array, xyz: Array, spacing: Array
) -> tuple[Array, Ints]:
    """Predict targets (m,): where a view has them, `base` (n, 2) px, and what it misses of their neighbours (n, k).

    What it misses is carried on linearly: a weighted fit of a line, its slopes held near zero by a little so that few
    neighbours suffice. `blob` (n,) numbers the spot of every target, -1 where none; `spots` (s, 2) px; `xyz` (n, 3) and
    `spacing` (n,) are the board's, mm. Places (m, 2) are NaN where the view sees nothing; (m,) neighbours told them.
    """
    place, support = np.empty((len(targets), 2)), np.empty(len(targets), np.int64)
    _carry_on(targets, neighbours, blob, spots, base, xyz, spacing, place, support)
    return place, support


@njit(cache=True, nogil=True, error_model="numpy")
def _carry_on(
    targets: Ints,
    neighbours: Ints,
    blob: Ints,
    spots: Array,
    base: Array,
    xyz: Array,
    spacing: Array,
    place: Array,
    support: Ints,
) -> None:  # pragma: no cover  compiled
    N, b, term = np.empty((3, 3)), np.empty((3, 2)), np.ones(3)
    for m in range(len(targets)):
        t, known = targets[m], 0
        N[:], b[:] = 0.0, 0.0
        for i in range(neighbours.shape[1]):
            n = neighbours[t, i]
            if blob[n] < 0 or not np.isfinite(base[n, 0]):
                continue
            known += 1
            term[1], term[2] = (xyz[n, 0] - xyz[t, 0]) / spacing[t], (xyz[n, 1] - xyz[t, 1]) / spacing[t]
            weight = 1 / (0.3 + term[1] * term[1] + term[2] * term[2]) ** 2
            for j in range(3):
                for k in range(3):
                    N[j, k] += weight * term[j] * term[k]
                for k in range(2):
                    b[j, k] += weight * term[j] * (spots[blob[n], k] - base[n, k])
        usual = max(N[0, 0], 1e-12)
        N[0, 0] += 1e-9 * usual
        N[1, 1] += STIFF * usual
        N[2, 2] += STIFF * usual
        inverted(N)
        support[m] = known
        for k in range(2):
            place[m, k] = base[t, k] + N[0, 0] * b[0, k] + N[0, 1] * b[1, k] + N[0, 2] * b[2, k]


@njit(cache=True, nogil=True, error_model="numpy")
def choose(
    targets: Ints,
    uv: Array,
    support: Ints,
    jacobian: Array,
    radius: Array,
    spacing: Array,
    neighbours: Ints,
    blob: Ints,
    spots: Array,
    area: Array,
    cov: Array,
    contrast: Array,
    border: NDArray[np.bool_],
    usual: float,
    chosen: Ints,
    why: Ints,
) -> None:  # pragma: no cover  compiled
    """Choose the spot of targets (m,) foretold at `uv` (m, 2) px: near, alone there, and as their neighbours' are.

    Of all n targets: `jacobian` (n, 2, 2) px per mm on the board, `radius` and `spacing` (n,) mm, `neighbours` (n, k),
    `blob` (n,) as in `foretell`. Of the s spots: `area` (s,) px, `cov` (s, 2, 2) px, `contrast`, `border`; `usual` is
    the identified ones' diameter over the expected one. Fills `chosen` (m,), -1 where none, and `why` (m,) not.
    """
    found, off, around = np.empty(CHOICES, np.int64), np.empty(CHOICES), np.empty(neighbours.shape[1])
    for m in range(len(targets)):
        t, known = targets[m], 0
        for i in range(neighbours.shape[1]):
            if blob[neighbours[t, i]] >= 0:
                around[known] = contrast[blob[neighbours[t, i]]]
                known += 1
        typical = np.median(around[:known]) if known else np.nan
        count = 0
        for s in range(len(spots)):
            away = (spots[s, 0] - uv[m, 0]) ** 2 + (spots[s, 1] - uv[m, 1]) ** 2
            if count == CHOICES and away >= off[count - 1]:
                continue
            k = min(count, CHOICES - 1)
            while k > 0 and off[k - 1] > away:
                off[k], found[k] = off[k - 1], found[k - 1]
                k -= 1
            off[k], found[k] = away, s
            count = min(count + 1, CHOICES)
        a, b, c, d = jacobian[t, 0, 0], jacobian[t, 0, 1], jacobian[t, 1, 0], jacobian[t, 1, 1]
        det = a * d - b * c
        first, second, nearest = np.inf, np.inf, np.inf
        chosen[m], why[m], within = -1, 0, False
        for k in range(count):
            s = found[k]
            du, dv = spots[s, 0] - uv[m, 0], spots[s, 1] - uv[m, 1]
            x, y = (d * du - b * dv) / det, (a * dv - c * du) / det
            distance = np.sqrt(x * x + y * y) / spacing[t]
            # its second moments, mapped back to the board in radii
            r2 = (radius[t] * det) ** 2
            xx = (d * d * cov[s, 0, 0] - 2 * b * d * cov[s, 0, 1] + b * b * cov[s, 1, 1]) / r2
            yy = (c * c * cov[s, 0, 0] - 2 * a * c * cov[s, 0, 1] + a * a * cov[s, 1, 1]) / r2
            xy = ((a * d + b * c) * cov[s, 0, 1] - c * d * cov[s, 0, 0] - a * b * cov[s, 1, 1]) / r2
            half, apart = (xx + yy) / 2, np.sqrt(((xx - yy) / 2) ** 2 + xy * xy)
            shape = np.sqrt((half + apart) / max(half - apart, 1e-12))
            size = np.sqrt(area[s] / (np.pi * abs(det))) / radius[t] / usual
            bright = contrast[s] / typical
            fault = 0
            if not bright > FAINT:
                fault = 1
            if not shape < LONG:
                fault = 2
            if not SMALL < size < LARGE:
                fault = 3
            if border[s]:
                fault = 4
            if distance < nearest:
                nearest, why[m] = distance, fault
            if distance < (NEAR if support[m] >= 3 else NEAR_FEW):
                within = True
                if fault == 0 and distance < first:
                    first, second, chosen[m] = distance, first, s
                elif fault == 0 and distance < second:
                    second = distance
        if chosen[m] < 0:
            why[m] = why[m] if within else 0
        elif second < max(ALONE * first, APART):
            chosen[m], why[m] = -1, 5
