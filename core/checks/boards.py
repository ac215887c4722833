"""Single targets whose place in a board's file is wrong: images have them elsewhere or nowhere, or it is another's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.checks.lengths import nominal_of
from core.checks.plates import Plates
from core.digits import fixed
from core.geometry import similarity
from core.model import Adjustment, Array, Concern, Note, TargetSet, Testfield
from core.numerics import median_of, nearest, row_median

FAR = 5.0  # times what half of the targets are off: of 250 with normal errors one is so far once in 10⁵ boards
OFF = 0.03  # of the spacing: single dots are printed better than that
EVEN, LEAST = 0.01, 12  # of the spacing, by which targets are off the even grid of a board of so many
UNSEEN = 0.08  # of the spacing: a target that is so far off the grid, and in none of
CAPTURES = 4  # or more captures
ASTRAY, FEW_ASTRAY = 0.5, 0.25  # of the spacing: another's place is nearer; a share of the targets
AROUND, MOST = 8, 3  # targets about each; and that may be wrong by mistake, but for those of one row or column
LITTLE = 1e-3  # of a distance, by which it has no part in a direction
SEVERAL = 3  # positions of a plate that tell a target's place and how surely


def misplaced_concerns(board: Testfield, adjustment: Adjustment, sets: Sequence[TargetSet]) -> list[Concern]:
    """Compare single targets with their adjusted places, and those that no capture has with their rows and columns."""
    nominal = nominal_of(adjustment, board)
    known = np.flatnonzero(np.isfinite(nominal).all(axis=1))
    sigma = np.sqrt(np.trace(adjustment.point_cov_mm2[known], axis1=1, axis2=2))
    off = _beside_others(nominal[known], adjustment.points_mm[known]) if len(known) >= LEAST else np.zeros((0, 3))
    places = [(i.row, i.col) for i in (adjustment.network.point_ids[k] for k in known)]
    spacing = _spacing(board.xyz_mm)
    told = [*_elsewhere("testfield", places, off, sigma, spacing)]
    told += _nowhere(board, sets, spacing) if len(sets) >= CAPTURES else []
    return [Concern("doubtful", text, "board") for text in told] if len(told) <= MOST else []


def misplaced_on_plate(board: Testfield, plates: Plates) -> list[Concern]:
    """Compare single targets of a plate with where they are seen on it, in the mean of its positions."""
    seen = [np.isfinite(xyz).all(axis=1) for xyz in plates.xyz_mm]
    off = np.full((len(seen), len(board.row), 3), np.nan)
    for own, use, xyz in zip(off, seen, plates.xyz_mm, strict=True):
        if use.sum() >= LEAST:
            own[use] = _beside_others(plates.nominal_mm[use], xyz[use])
    number = np.isfinite(off[..., 0]).sum(axis=0)
    often = np.flatnonzero(number >= SEVERAL)
    if len(often) < LEAST:
        return []
    mean, spread = np.nanmean(off[:, often], axis=0), np.nanstd(off[:, often], axis=0, ddof=1)
    sigma = np.linalg.norm(spread, axis=1) / np.sqrt(number[often])
    places = [board.keys[k] for k in often]
    told = _elsewhere("the plate's testfield file", places, mean, sigma, _spacing(board.xyz_mm))
    return [Concern("doubtful", text, "plates") for text in told]


def exchanged_notes(board: Testfield) -> tuple[Note, ...]:
    """Find targets of an even board that stand in each other's place: no image shows how targets are called."""
    if len(board.row) < LEAST:
        return ()
    off, astray = _off_grid(board), ASTRAY * _spacing(board.xyz_mm)
    lost = np.flatnonzero(np.linalg.norm(off, axis=1) > astray)
    if not 2 <= len(lost) <= FEW_ASTRAY * len(off):
        return ()
    apart = np.linalg.norm(board.xyz_mm[lost, None] - (board.xyz_mm - off)[lost], axis=2)
    if len({*apart.argmin(axis=1).tolist()}) < len(lost) or apart.min(axis=1).max() > astray:
        return ()
    names = [
        f"{row}/{col}" for row, col in sorted(zip(board.row[lost].tolist(), board.col[lost].tolist(), strict=True))
    ]
    named = f"{', '.join(names[:-1])} and {names[-1]}"
    text = f"targets {named} of its testfield file stand in each other's place: exchange their row and col"
    return (Note(text, "value"),)


def _beside_others(nominal: Array, found: Array) -> Array:
    """How far each target is from where a board has it, (n, 3) mm, against those around: boards bend."""
    scale, R, shift = similarity(nominal, found)
    off = (found - shift) @ R / scale - nominal
    around = np.swapaxes(off[nearest(nominal, AROUND + 1)[:, 1:]], 1, 2)
    return np.asarray(off - row_median(around.reshape(off.size, -1)).reshape(off.shape))


def _elsewhere(file: str, places: Sequence[tuple[int, int]], off: Array, sigma: Array, spacing: float) -> list[str]:
    """Tell of targets that are seen elsewhere than a file has them: few, or those of one row or column."""
    if not len(off):
        return []
    size = np.linalg.norm(off, axis=1)
    usual = median_of(size)
    far = np.flatnonzero(size > np.maximum(max(FAR * usual, OFF * spacing), FAR * sigma)).tolist()
    named = [(f"target {row}/{col}", [k]) for k in far for row, col in [places[k]]]
    if len(far) > MOST:
        rows, columns = ({places[k][axis] for k in far} for axis in (0, 1))
        named = [(f"row {min(rows)}", far)] if len(rows) == 1 else []
        named += [(f"column {min(columns)}", far)] if len(columns) == 1 else []
    told = []
    for name, own in named:
        far_off, by = median_of(size[own]), [median_of(column) for column in off[own].T]
        away = ", ".join(fixed(x if abs(x) > LITTLE * far_off else 0.0, 2, "+") for x in by)
        told.append(
            f"{file}: {name} is seen {far_off:.2g} mm from where the file has it ({away}), half of the others within "
            f"{usual:.2g} mm: correct x_mm, y_mm and z_mm there"
        )
    return told


def _nowhere(board: Testfield, sets: Sequence[TargetSet], spacing: float) -> list[str]:
    """Tell targets that no capture has, and that the file has beside their row and column, where the others are not."""
    seen = {key for t in sets for key in t.keys}
    off = _off_grid(board)
    size = np.linalg.norm(off, axis=1)
    if len(size) < LEAST or median_of(size) > EVEN * spacing:
        return []
    return [
        f"testfield: target {row}/{col} is seen nowhere, and the file has it {size[k]:.3g} mm beside its row and "
        f"column ({', '.join(fixed(x, 2, '+') for x in off[k])}): correct its x_mm, y_mm and z_mm in the "
        "testfield file"
        for (row, col), k in board.index().items()
        if (row, col) not in seen and size[k] > UNSEEN * spacing
    ]


def _spacing(xyz: Array) -> float:
    """Median distance of a target from the nearest other one."""
    return median_of(np.linalg.norm(xyz - xyz[nearest(xyz, 2)[:, 1]], axis=1)) if len(xyz) > 1 else np.inf


def _off_grid(board: Testfield) -> Array:
    """How far each target is off its place in an even grid of rows and columns, (n, 3), mm."""
    A = np.column_stack([board.row, board.col, np.ones(len(board.row))])
    use = np.ones(len(A), bool)
    for _ in range(4):
        off = board.xyz_mm - A @ np.linalg.lstsq(A[use], board.xyz_mm[use], rcond=None)[0]
        size = np.linalg.norm(off, axis=1)
        use = size <= max(FAR * median_of(size[use]), 1e-6)
    return np.asarray(off)
