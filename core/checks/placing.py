"""Between which targets known lengths lie: a board that looks the same turned or mirrored may be named another way.

All images then agree on the other names, and no residual tells. What they do tell is how long everything is: where a
length that is laid between other targets would give another scale by more than its sigma, the scale is open.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from core.geometry import similarity_residual
from core.lazy import dataclass
from core.model import Adjustment, Array, Concern, ScaleBar, Testfield

LEAST = 6  # targets that tell the shape of a board
WORSE = 1.5  # times that a board's own places fit if targets have the other names: these are excluded
SIGNIFICANT = 3.3  # sigmas by which the scales of two placements differ, or known lengths exclude one of them
MIRRORS = [np.array(m) for m in ([[1, 0], [0, -1]], [[-1, 0], [0, 1]], [[0, 1], [1, 0]], [[0, -1], [-1, 0]])]

Naming = tuple[Array, Array]  # of targets in another way: (row, col) -> T (row, col) + shift, (2, 2) and (2,)


@dataclass(frozen=True)
class _Scale:
    """What known lengths say of the scale, over what the adjustment has: a factor, its sigma, vᵀPv of it."""

    factor: float
    sigma: float
    squares: float


def turned_concerns(
    adjustment: Adjustment, board: Testfield, bars: Sequence[ScaleBar], namings: Sequence[Naming]
) -> list[Concern]:
    """Tell lengths whose ends may be others; `namings` are those under which the board looks as before, turned."""
    if (other := _other_scale(adjustment, board, bars, namings)) is None:
        return []
    bar, ppm = other
    text = (
        f"nobody picked, and the board looks the same when turned: the length from {bar.start} to {bar.stop} may be "
        f"between other targets, which would change the scale by {ppm:.0f} ppm; pick 4 targets in one capture, or "
        "measure across the board's middle"
    )
    return [Concern("doubtful", text)]


def mirrored_concerns(
    adjustment: Adjustment, board: Testfield, bars: Sequence[ScaleBar], cameras: Collection[str]
) -> list[Concern]:
    """Tell picks that name targets in mirrored order: a length that is not symmetric lies between others then.

    Where they do not matter to the scale nothing is wrong: a board may be seen in a mirror, or through glass.
    """
    if not named_from_behind(adjustment, board, cameras):
        return []
    if (other := _other_scale(adjustment, board, bars, _mirrored(board))) is None:
        return []
    bar, ppm = other
    text = (
        "the boards are seen from behind, by the order in which the picks name targets: were rows or columns counted "
        f"from the wrong side? Then the length from {bar.start} to {bar.stop} is between other targets, which would "
        f"change the scale by {ppm:.0f} ppm; name the picks anew, or measure across the board's middle"
    )
    return [Concern("doubtful", text)]


def named_from_behind(adjustment: Adjustment, board: Testfield, cameras: Collection[str]) -> bool:
    """Whether cameras see a board from behind and its rows and columns run the other way round, too.

    The nominal z may well lead away from the viewer: y then runs downwards, and so do the rows.
    """
    poses = zip(adjustment.network.station_device, adjustment.station_from_object, strict=True)
    towards = np.array([pose.rotation[2, 2] for device, pose in poses if device in cameras])
    if not len(towards) or 2 * np.count_nonzero(towards < 0) <= len(towards):
        return False
    A = np.column_stack([board.col, board.row, np.ones(len(board.row))])
    along = np.linalg.lstsq(A, board.xyz_mm[:, :2], rcond=None)[0][:2]
    return bool(np.linalg.det(along) < 0)  # rows run against y, as those of a matrix do where y points up


def _mirrored(board: Testfield) -> list[Naming]:
    """The namings under which the board has the same rows and columns, seen from its other side."""
    cells = np.column_stack([board.row, board.col])
    found = []
    for turn in MIRRORS:
        to = cells @ turn.T
        shift = cells.min(axis=0) - to.min(axis=0)
        if {*map(tuple, (to + shift).tolist())} == {*board.keys}:
            found.append((turn, shift))
    return found


def _other_scale(
    adjustment: Adjustment, board: Testfield, bars: Sequence[ScaleBar], namings: Sequence[Naming]
) -> tuple[ScaleBar, float] | None:
    """Give a length that would be another by a naming, and the change of scale, ppm: the largest that is possible."""
    if not bars:
        return None
    given = _scale(adjustment, bars, [(bar.start, bar.stop) for bar in bars])
    worst: tuple[ScaleBar, float] | None = None
    for naming in namings:
        if _fits_worse(adjustment, board, naming):
            continue
        ends = _renamed(bars, naming)
        other = _scale(adjustment, bars, ends)
        if given is None or other is None or other.squares > given.squares + SIGNIFICANT**2:
            continue  # which lies outside of what was seen, or which the lengths themselves exclude
        off = abs(other.factor / given.factor - 1)
        if off > SIGNIFICANT * other.sigma and (worst is None or 1e6 * off > worst[1]):
            moved = [{*end} != {bar.start, bar.stop} for bar, end in zip(bars, ends, strict=True)]
            worst = bars[moved.index(True)], 1e6 * off
    return worst


def _fits_worse(adjustment: Adjustment, board: Testfield, naming: Naming) -> bool:
    """Whether a board's file, if it has true places and not those of a drawing, tells that targets are named right."""
    index, ids = board.index(), adjustment.network.point_ids
    turn, shift = naming
    named = np.array([[i.row, i.col] for i in ids]) @ turn.T + shift
    use = [k for k, (row, col) in enumerate(named.tolist()) if (row, col) in index]
    if len(use) < LEAST:
        return False
    own = board.xyz_mm[[index[ids[k].row, ids[k].col] for k in use]]
    other = board.xyz_mm[[index[row, col] for row, col in named[use].tolist()]]
    given, renamed = (similarity_residual(places, adjustment.points_mm[use]) for places in (own, other))
    return renamed > WORSE * given


def _renamed(bars: Sequence[ScaleBar], naming: Naming) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Ends of all lengths by another naming."""
    turn, shift = naming
    named = [(np.array([bar.start, bar.stop]) @ turn.T + shift).tolist() for bar in bars]
    return [((a[0], a[1]), (b[0], b[1])) for a, b in named]


def _scale(
    adjustment: Adjustment, bars: Sequence[ScaleBar], ends: Sequence[tuple[tuple[int, int], tuple[int, int]]]
) -> _Scale | None:
    """Scale by known lengths between those ends; None where one of these was not measured.

    The sigma is that of the lengths and of the adjusted points, as if these were independent.
    """
    index = {(i.row, i.col): k for k, i in enumerate(adjustment.network.point_ids)}
    if any(end not in index for pair in ends for end in pair):
        return None
    factors, variances = np.empty(len(bars)), np.empty(len(bars))
    for k, (bar, pair) in enumerate(zip(bars, ends, strict=True)):
        a, b = (index[end] for end in pair)
        apart = adjustment.points_mm[b] - adjustment.points_mm[a]
        length = float(np.linalg.norm(apart))
        cofactor = adjustment.point_cov_mm2[a] + adjustment.point_cov_mm2[b]
        factors[k] = bar.length_mm / length
        variances[k] = (bar.sigma_mm**2 + apart @ cofactor @ apart / length**2) / length**2
    weight = 1 / variances
    factor = float(weight @ factors / weight.sum())
    return _Scale(factor, float(weight.sum() ** -0.5), float(weight @ (factors - factor) ** 2))
