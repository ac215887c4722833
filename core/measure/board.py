"""The nominal testfield made ready for identification: checked, in its own plane, with who is whose neighbour."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.lazy import dataclass
from core.model import Array, Testfield
from core.numerics import nearest

NEIGHBOURS = 24  # the 5 x 5 surroundings of a target in a regular grid
_known: dict[int, tuple[Testfield, Board]] = {}  # by identity: many captures share a board


@dataclass(frozen=True)
class Board:
    """A testfield in a frame whose XY plane is the board's, with its neighbourhoods; one row per target."""

    row: NDArray[np.int64]
    col: NDArray[np.int64]
    xyz_mm: Array  # (n, 3)
    radius_mm: Array  # (n,)
    spacing_mm: Array  # (n,) to the nearest other target
    neighbours: NDArray[np.int64]  # (n, k) nearest first, the target itself left out
    index: dict[tuple[int, int], int]
    has_front: bool  # the nominal Z axis is the board's normal, so that its front and back can be told

    def name(self, i: int) -> str:
        """How target i is called in messages."""
        return f"row {self.row[i]}, col {self.col[i]}"


def board_from_testfield(field: Testfield) -> Board:
    """Check a testfield and find the neighbours of every target.

    InputError: fewer than 4 targets, a number that is not finite, a diameter of 0 or less, a (row, col) or a place
    given twice, all targets on one line.
    """
    same, board = _known.get(id(field), (None, None))
    if board is not None and same is field:
        return board
    board = _checked(field)
    if not any(values.flags.writeable for values in (field.row, field.col, field.xyz_mm, field.diameter_mm)):
        while len(_known) > 7:
            del _known[next(iter(_known))]
        _known[id(field)] = field, board
    return board


def _checked(field: Testfield) -> Board:
    where = field.file
    # a copy, as fields may be read-only: compiled loops then see arrays of one kind
    xyz, diameter = np.array(field.xyz_mm, np.float64, order="C"), np.asarray(field.diameter_mm, np.float64)
    n = len(field.row)
    if n < 4:
        raise InputError(where, f"{n} targets", "a testfield needs at least 4")
    finite = np.isfinite(xyz).all(axis=1) & np.isfinite(diameter)
    for i in np.flatnonzero(~finite | (diameter <= 0))[:1]:
        name = f"target row {field.row[i]}, col {field.col[i]}"
        if not finite[i]:
            raise InputError(
                where, f"{name} has coordinates {xyz[i]} and diameter {diameter[i]}", "give finite numbers"
            )
        raise InputError(where, f"{name} has diameter {diameter[i]} mm", "give the dot's diameter in mm")
    index: dict[tuple[int, int], int] = {}
    for i, key in enumerate(field.keys):
        if key in index:
            raise InputError(where, f"target row {key[0]}, col {key[1]} stands there twice", "remove one of the two")
        index[key] = i
    order = nearest(xyz, min(NEIGHBOURS + 1, n))
    distance = np.linalg.norm(xyz[order[:, 1]] - xyz, axis=1)
    overlap = np.flatnonzero(distance < 0.5 * diameter)
    if len(overlap):
        i, j = int(overlap[0]), int(order[overlap[0], 1])
        raise InputError(
            where,
            f"targets row {field.row[i]}, col {field.col[i]} and row {field.row[j]}, col {field.col[j]} "
            f"are {distance[i]:.3g} mm apart and overlap",
            "correct their coordinates or diameter_mm",
        )
    flat, has_front = _in_its_plane(xyz, where)
    return Board(
        row=field.row,
        col=field.col,
        xyz_mm=flat,
        radius_mm=diameter / 2,
        spacing_mm=distance,
        neighbours=np.ascontiguousarray(order[:, 1:]),
        index=index,
        has_front=has_front,
    )


def _in_its_plane(xyz: Array, where: str) -> tuple[Array, bool]:
    """Coordinates of a board turned so that its best plane is XY, and whether it lay so already."""
    centred = xyz - xyz.mean(axis=0)
    singular, axes = np.linalg.svd(centred, full_matrices=False)[1:]
    if singular[1] < 1e-3 * singular[0]:
        raise InputError(where, "all targets lie on one line", "identification needs a field, not a row")
    normal = np.cross(axes[0], axes[1])
    if abs(normal[2]) > 0.9:
        return xyz, True
    return centred @ np.stack([axes[0], np.cross(normal, axes[0]), normal], axis=1), False
