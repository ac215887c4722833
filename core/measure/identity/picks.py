"""The operator's picks: checked against the testfield, the image and each other, then moved onto their dots."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError, NotRecognisedError
from core.lazy import dataclass
from core.measure.board import Board
from core.measure.identity.blobs import Blobs
from core.model import Array, Note, Seed

Side = Literal["front", "back", "either"]  # of the board, that the camera sees
FEWEST = 3  # picks on dots that identification needs
NEARER = 0.5  # of the reach of a pick: four places at random have a dot within that once in 4,000 times
FLAT = 0.08  # triangles flatter than this (area over longest side squared) may turn over by lens distortion alone


@dataclass(frozen=True)
class Picks:
    """Picks that passed the checks: targets of the board and where they were clicked."""

    where: str
    target: NDArray[np.int64]  # (k,)
    uv: Array  # (k, 2) px as clicked
    affine: Array  # (2, 2) px per mm, the best single linear map from the board to the image

    def name(self, board: Board, k: int) -> str:
        """How pick k is called in messages."""
        return f"pick {k + 1} ({board.name(int(self.target[k]))}) at ({self.uv[k, 0]:.1f}, {self.uv[k, 1]:.1f}) px"


def check_picks(board: Board, seeds: Sequence[Seed], size: tuple[int, int], where: str, side: Side) -> Picks:
    """Refuse picks that cannot be right, whatever the image (its width and height in px) shows.

    InputError, naming the file `where`: fewer than 4 picks, a position that is not finite or outside the image, a
    target that the testfield does not have, a target or place picked twice, picks on one line, swapped or mirrored
    picks.
    """
    if len(seeds) < 4:
        raise InputError(where, f"{len(seeds)} picks", "pick 4 targets that do not lie on one line")
    target = []
    for k, s in enumerate(seeds):
        name = f"pick {k + 1} (row {s.row}, col {s.col})"
        if not (np.isfinite(s.u) and np.isfinite(s.v)):
            raise InputError(where, f"{name} is at ({s.u}, {s.v}) px", "pick it again")
        if not (-0.5 <= s.u <= size[0] - 0.5 and -0.5 <= s.v <= size[1] - 0.5):
            seen = f"{name} is at ({s.u:.1f}, {s.v:.1f}) px, outside the image of {size[0]} x {size[1]} px"
            raise InputError(where, seen, "pick a target inside the image")
        if (s.row, s.col) not in board.index:
            seen = f"{name} is not in the testfield, which has rows {_span(board.row)} and columns {_span(board.col)}"
            raise InputError(where, seen, "correct its row and column, or name the board that was captured")
        target.append(board.index[s.row, s.col])
    uv = np.array([[s.u, s.v] for s in seeds], np.float64)
    for i, k in combinations(range(len(seeds)), 2):
        if target[i] == target[k]:
            seen = f"picks {i + 1} and {k + 1} are both on target {board.name(target[i])}"
            raise InputError(where, seen, "give each pick a target of its own")
        if np.hypot(*(uv[i] - uv[k])) < 1.0:
            seen = f"picks {i + 1} and {k + 1} are at the same place ({uv[i, 0]:.1f}, {uv[i, 1]:.1f}) px"
            raise InputError(where, seen, "pick two different dots")
    picks = Picks(where, np.array(target), uv, _affine(board, np.array(target), uv, where))
    _check_order(board, picks, side)
    return picks


def check_excluded(board: Board, excluded: Collection[tuple[int, int]], where: str) -> set[int]:
    """Find the targets (indices into the board) that an operator excluded; one it does not have is an InputError."""
    for row, col in excluded:
        if (row, col) not in board.index:
            seen = f"excluded has row {row}, col {col}, which is not in the testfield"
            raise InputError(where, seen, "correct its row and column, or take it out")
    return {board.index[target] for target in excluded}


def snap(board: Board, picks: Picks, blobs: Blobs, size: tuple[int, int]) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """Find the spot that each pick means, (k,) indices into `blobs`, -1 where there is none; and what of those.

    A click may be off by 0.4 of the distance between targets; among the spots within reach the nearest of about the
    expected size is taken. One pick may be on a dot that is missing or cannot be measured. `size` is the image's width
    and height, px. NotRecognisedError for no spot near several picks, InputError for one spot for two picks.
    """
    chosen: list[int] = []
    notes: list[Note] = []
    for k, (best, reach) in enumerate(_spots(board, picks, blobs, picks.uv)):
        if best < 0:
            seen = f"{picks.name(board, k)} has no dot of the expected size within {reach:.0f} px"
            if notes or len(picks.target) <= FEWEST:
                raise NotRecognisedError(picks.where, seen, _slip(board, picks, blobs, np.array(size) - 1))
            notes.append(Note(f"{seen}: not used, the other picks tell", "pick"))
            chosen.append(-1)
            continue
        if best in chosen:
            seen = f"{picks.name(board, chosen.index(best))} and {picks.name(board, k)} are on the same dot"
            raise InputError(picks.where, seen, "pick two different dots")
        chosen.append(best)
    return np.array(chosen), tuple(notes)


def _slip(board: Board, picks: Picks, blobs: Blobs, last: Array) -> str:
    """What to do about picks without dots; `last` is u and v of the image's last pixel."""
    u, v = picks.uv.T
    tried = {
        "all have one if the image is turned by 180°: were its frames turned? Pick again, or turn back": last
        - picks.uv,
        "all have one if v is counted from below: count it from the top of the image": np.stack([u, last[1] - v], 1),
        "all have one if u is counted from the right: count it from the left, or mirror the image back": np.stack(
            [last[0] - u, v], 1
        ),
        "all have one if u and v are exchanged: u counts to the right, v downwards": picks.uv[:, ::-1],
        "all have one at half of u and v: were they picked in an image of twice the size?": picks.uv / 2,
        "all have one at twice u and v: were they picked in an image of half the size?": picks.uv * 2,
    }
    for told, uv in tried.items():
        at = [best for best, _ in _spots(board, picks, blobs, uv, NEARER)]
        if min(at) >= 0 and len(set(at)) == len(at):
            return told
    return "pick the middle of a dot, or correct its row or column, the board's polarity or diameter_mm"


def _spots(board: Board, picks: Picks, blobs: Blobs, uv: Array, within: float = 1.0) -> list[tuple[int, float]]:
    """Of each pick, were it at uv (k, 2), the spot that it means, -1 where there is none; and how far it may be, px.

    `within` is the part of the usual reach that is looked at.
    """
    least = np.linalg.svd(picks.affine, compute_uv=False)[1]
    stretch = abs(np.linalg.det(picks.affine))
    found = []
    for target, place in zip(picks.target, uv, strict=True):
        reach = within * max(0.4 * board.spacing_mm[target] * least, 3.0)
        distance = np.hypot(*(blobs.uv - place).T)
        size = np.log(blobs.area_px / (np.pi * board.radius_mm[target] ** 2 * stretch))
        score = np.where((distance < reach) & (np.abs(size) < 1.6), distance / reach + 0.3 * np.abs(size), np.inf)
        best = int(np.argmin(score)) if len(score) else -1
        found.append((best if best >= 0 and np.isfinite(score[best]) else -1, reach))
    return found


def _span(values: NDArray[np.int64]) -> str:
    return f"{values.min()} to {values.max()}"


def _affine(board: Board, target: NDArray[np.int64], uv: Array, where: str) -> Array:
    """Least-squares linear map (2, 2) from the board to the image, px per mm."""
    xy = board.xyz_mm[target, :2]
    centred = xy - xy.mean(axis=0)
    if np.linalg.svd(centred, compute_uv=False)[1] < 0.3 * board.spacing_mm[target].min():
        raise InputError(where, "all picks lie on one line of the testfield", "pick at least one target off that line")
    linear = np.linalg.lstsq(centred, uv - uv.mean(axis=0), rcond=None)[0].T
    return np.asarray(linear)


def _check_order(board: Board, picks: Picks, side: str) -> None:
    """Refuse picks whose order round the board no camera can see."""
    xy = board.xyz_mm[picks.target, :2]
    turns = _turns(xy, picks.uv)
    if np.any(turns > 0) and np.any(turns < 0):
        for i, k in combinations(range(len(xy)), 2):
            swapped = picks.uv.copy()
            swapped[[i, k]] = swapped[[k, i]]
            again = _turns(xy, swapped)
            if abs(int(again.sum())) == np.count_nonzero(again):
                seen = f"{picks.name(board, i)} and {picks.name(board, k)} look swapped: the picks cross over"
                raise InputError(picks.where, seen, "correct their rows and columns")
        raise InputError(picks.where, "the picks cross over: no view of the board has them in this order", "pick again")
    long, short = np.linalg.svd(picks.affine, compute_uv=False)
    if short < 0.05 * long:
        seen = "the picks lie on one line of the image, but not of the testfield"
        raise InputError(picks.where, seen, "correct the rows and columns of the picks")
    seen_side = "front" if np.linalg.det(picks.affine) < 0 else "back"  # v points down: a front view turns round
    if board.has_front and side not in ("either", seen_side):
        seen = f"the picks are in mirrored order: they show the board from its {seen_side}"
        raise InputError(
            picks.where, seen, "correct their rows and columns, or u and v: u counts to the right, v downwards"
        )


def _turns(xy: Array, uv: Array) -> NDArray[np.int64]:
    """For all triples: +1 where board and image turn the same way, -1 where opposite, 0 where too flat to tell."""
    result = []
    for triple in combinations(range(len(xy)), 3):
        a, b = _turn(xy[list(triple)]), _turn(uv[list(triple)])
        result.append(0 if abs(a) < FLAT or b == 0 else int(np.sign(a * b)))
    return np.array(result)


def _turn(p: Array) -> float:
    """Signed area of a triangle over its longest side squared."""
    a, b, c = p[1] - p[0], p[2] - p[0], p[2] - p[1]
    return float(0.5 * (a[0] * b[1] - a[1] * b[0]) / max(a @ a, b @ b, c @ c))
