"""Which way round a board was held: the turns of all images are told together.

A regular board looks the same half a turn round, so that one image alone does not tell its turn. But no board is as
regular as its drawing. Every dot lies a little off its nominal place, by the same amount in every image and by far more
than a centroid's error. What a smooth view leaves of one image's dots repeats in the others, turned as the board is.

Notes
-----
The deviations e of an image's dots from a homography and a polynomial over the board are noise plus the board's own δ.
Images join one after the other, the clearest first. For each possible labelling the log-likelihood of its deviations is
taken, given δ as those before show it, and noise as the image itself shows it: beyond their sigmas centroids have
errors of their own, of pixels and of uneven light, which would pass for a shape where the board is as regular as its
drawing. The labelling that is best by `SURE` is the image's; if none is, the turn cannot be told, and it is not
guessed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.measure.board import board_from_testfield
from core.model import Array, Ints, TargetSet, Testfield
from core.numerics import median_of, nearest, polynomial

SURE = 12.0  # log-likelihood by which a labelling must be better than the next: one error in 160,000
OVERRULED = 36.0  # the same against an operator's pick, which lens and light repeated from image to image must not do
REGULAR = 0.1  # share of the spacing by which a board that is turned may lie off its own places
DEGREES = ((150, 6), (90, 5), (50, 4), (30, 3), (0, 2))  # targets from which a polynomial stands for lens and bend
FEWEST = 12  # targets of an image that tell anything
NEIGHBOURS = 5  # a dot and those next to it
TURNS = [np.array(t) for t in ([[1, 0], [0, 1]], [[0, -1], [1, 0]], [[-1, 0], [0, -1]], [[0, 1], [-1, 0]])]

Labelling = tuple[tuple[tuple[int, int], tuple[int, int]], tuple[int, int]]  # (row, col) -> T (row, col) + shift
SAME: Labelling = (((1, 0), (0, 1)), (0, 0))


@dataclass(frozen=True)
class Turned:
    """What became of one image: its targets as labelled now, which labelling that is, and whether it was told."""

    targets: TargetSet
    choice: int  # of the labellings offered
    told: bool


def symmetries(field: Testfield) -> tuple[Labelling, ...]:
    """Give the other labellings under which the whole board looks as before when turned in its plane."""
    index, board = field.index(), board_from_testfield(field)
    cells = np.stack([field.row, field.col], axis=1)
    found = []
    for turn in TURNS[1:]:
        to = cells @ turn.T
        shift = cells.min(axis=0) - to.min(axis=0)
        at = [index.get((r, c), -1) for r, c in (to + shift).tolist()]
        if min(at) >= 0 and _is_turn(board.xyz_mm[:, :2], board.xyz_mm[at, :2], float(board.spacing_mm.min())):
            found.append(_labelling(turn, shift))
    return tuple(found)


def placed(ways: Sequence[Labelling], field: Testfield) -> bool:
    """Whether labellings turn the whole board and no more: none moves it by rows or columns."""
    return {SAME, *symmetries(field)}.issuperset(ways)


def labelling_between(first: Sequence[tuple[int, int]], second: Sequence[tuple[int, int]]) -> Labelling | None:
    """Give the labelling that turns the names of some targets into others; None where there is none."""
    a, b = np.array(first), np.array(second)
    for turn in TURNS:
        shift = b[0] - turn @ a[0]
        if np.array_equal(a @ turn.T + shift, b):
            return _labelling(turn, shift)
    return None


def relabelled(targets: TargetSet, labelling: Labelling, field: Testfield) -> TargetSet | None:
    """Give other names to the targets of an image; None where the board has no such targets."""
    if labelling == SAME:
        return targets
    turn, shift = np.array(labelling[0]), np.array(labelling[1])
    index = field.index()
    named = np.stack([targets.row, targets.col], axis=1) @ turn.T + shift
    if any((r, c) not in index for r, c in named.tolist()):
        return None
    missing = []
    for m in targets.missing:
        row, col = (int(x) for x in turn @ (m.row, m.col) + shift)
        if (row, col) in index:
            missing.append(replace(m, row=row, col=col))
    known = {*map(tuple, named.tolist()), *((m.row, m.col) for m in missing)}
    beyond = [key for key in index if key not in known]
    if beyond and targets.missing:
        missing += [replace(targets.missing[0], row=r, col=c, reason="outside what was looked at") for r, c in beyond]
    return replace(targets, row=named[:, 0].copy(), col=named[:, 1].copy(), missing=tuple(missing))


def unturned(image: TargetSet, ways: Sequence[Labelling], beside: TargetSet, field: Testfield) -> TargetSet | None:
    """Label an image of a board that was only shifted since another one: named as there, it is not turned in the image.

    None where not exactly one of the labellings says so.
    """
    same = [t for of in ways if (t := relabelled(image, of, field)) is not None and _upright(t, beside)]
    return same[0] if len(same) == 1 else None


def _upright(a: TargetSet, b: TargetSet) -> bool:
    """Whether the targets that two images share lie the same way round in both, to an eighth of a turn."""
    common = sorted({*a.keys}.intersection(b.keys))
    if len(common) < 2:
        return False
    p, q = (t.camera_uv[[t.keys.index(key) for key in common]] for t in (a, b))
    (x, y), (u, v) = (p - p.mean(axis=0)).T, (q - q.mean(axis=0)).T
    return bool(x @ u + y @ v > abs(x @ v - y @ u))


def solve_turns(
    images: Sequence[TargetSet],
    offered: Sequence[Sequence[Labelling]],
    field: Testfield,
    picked: Sequence[bool] | None = None,
) -> list[Turned]:
    """Tell the labellings of images of one board together.

    Parameters
    ----------
    images : sequence of TargetSet
        Labelled somehow.
    offered : sequence of sequence of Labelling
        What each image's labels may have to be turned by; the first is kept where the image has only that.
    picked : sequence of bool, optional
        Which images an operator labelled: the board's whole turn is that of most of them. Without any it is that of
        the image with most targets among those that `placed` allows: where none is, nothing tells which rows and
        columns are seen.
    """
    tried = [
        [(k, t) for k, of in enumerate(labels) if (t := relabelled(image, of, field)) is not None]
        for image, labels in zip(images, offered, strict=True)
    ]
    result = [Turned(image, 0, len(of) <= 1) for image, of in zip(images, tried, strict=True)]
    if all(len(of) <= 1 for of in tried):
        return result
    seen = [[_deviations(t, field) for _, t in of] for of in tried]
    usable = [k for k, of in enumerate(seen) if any(d is not None for d in of)]
    if not usable:
        return result
    known = [k for k in usable if placed([offered[k][j] for j, _ in tried[k]], field)]
    if not known:
        return result
    # the first only gives the names; of several labellings it takes the one with which the board is least irregular
    first = max(known, key=lambda k: (len(tried[k]) == 1, len(images[k].row)))
    best = min(range(len(tried[first])), key=lambda j: _size(seen[first][j]))
    choice, sure = {first: best}, {first: np.inf}
    size = _common_size(seen)
    waiting = [k for k in usable if k != first]
    while waiting:
        shape = _shape_of([seen[k][j] for k, j in choice.items()], len(field.row), size)
        margins = {k: _best(seen[k], shape, size) for k in waiting}
        k = max(waiting, key=lambda i: margins[i][1])
        if margins[k][1] < SURE:
            break
        choice[k], sure[k] = margins[k]
        waiting.remove(k)
    for k in list(choice):  # each again, against all the others
        others = [seen[i][j] for i, j in choice.items() if i != k]
        if k == first or len(choice) < 3:
            continue
        choice[k] = _best(seen[k], _shape_of(others, len(field.row), size), size)[0]
    back = _most_picked([offered[k][tried[k][j][0]] for k, j in choice.items() if picked and picked[k]])
    for k, j in choice.items():
        if len(choice) > 1 or len(tried[k]) == 1:
            number, found = tried[k][j]
            whole = relabelled(found, back, field)
            result[k] = Turned(found if whole is None else whole, number, True)
            if whole is not None and back != SAME:  # the choice is told against the labels that the image came with
                same = (whole.row[0], whole.col[0]) == (images[k].row[0], images[k].col[0])
                result[k] = replace(result[k], choice=0 if same else max(number, 1))
            if picked and picked[k] and result[k].choice and sure[k] < OVERRULED:
                result[k] = Turned(images[k], 0, False)
    return result


def _most_picked(labellings: Sequence[Labelling]) -> Labelling:
    """Give the way back from the labelling that most picked images were given."""
    most = max(labellings, key=labellings.count, default=SAME)
    if labellings.count(most) <= labellings.count(SAME):
        return SAME
    turn = np.array(most[0]).T
    return _labelling(turn, -turn @ np.array(most[1]))


@dataclass(frozen=True)
class _Deviations:
    """What a smooth view leaves of an image's dots, on the board: targets (n,), offsets (n, 2) mm, variances (n,).

    `independent` is how many dots they are worth: those of a lens go on from dot to dot, a board's do not.
    """

    target: Ints
    offset: Array
    variance: Array
    independent: float

    @cached_property
    def size(self) -> float:
        """How far a dot usually lies off, mm² in both axes."""
        return float(np.median(np.sum(self.offset**2, axis=1)))


def _deviations(targets: TargetSet, field: Testfield) -> _Deviations | None:
    index = field.index()
    at = np.array([index[key] for key in targets.keys], np.int64)
    if len(at) < FEWEST:
        return None
    board = board_from_testfield(field)
    xy = board.xyz_mm[at, :2]
    H, _ = cv2.findHomography(targets.camera_uv, xy)  # what the camera saw, laid onto the board
    if H is None:
        return None
    seen = cv2.perspectiveTransform(targets.camera_uv[:, None, :], H)[:, 0]
    off = seen - xy
    middle, half = xy.mean(axis=0), np.abs(xy - xy.mean(axis=0)).max() + 1e-9
    x, y = ((xy - middle) / half).T
    degree = next(d for least, d in DEGREES if len(at) >= least)
    A = polynomial(x, y, degree)
    weight, ridge = np.ones(len(at)), 1e-13 * len(at) * np.eye(A.shape[1])  # few rows do not tell all terms
    for _ in range(4):
        weighted = (A * weight[:, None] ** 2).T
        fit = np.linalg.solve(weighted @ A + ridge, weighted @ off)
        rest = np.hypot(*(off - A @ fit).T)
        weight = 1 / np.maximum(rest / (2 * median_of(rest) + 1e-12), 1.0)
    # px to mm by what neighbours on the board lie apart in the image
    scale = float(np.median(half / (np.abs(targets.camera_uv - targets.camera_uv.mean(axis=0)).max() + 1e-9)))
    variance = np.einsum("nii->n", targets.camera_cov) / 2 * (1.5 * scale) ** 2
    return _Deviations(at, off - A @ fit, variance, _independent(off - A @ fit, xy))


def _independent(offset: Array, xy_mm: Array) -> float:
    near = nearest(xy_mm, NEIGHBOURS)[:, 1:]
    usual = np.sqrt(np.median(np.sum(offset**2, axis=1)))
    o = offset / np.maximum(np.hypot(*offset.T) / (3 * usual + 1e-30), 1.0)[:, None]
    alike = float(np.sum(o[:, None] * o[near]) / (near.shape[1] * np.sum(o**2) + 1e-30))
    return len(o) * ((1 - max(alike, 0.0)) / (1 + max(alike, 0.0))) ** 2


def _size(of: _Deviations | None) -> float:
    return np.inf if of is None else of.size


def _common_size(seen: Sequence[Sequence[_Deviations | None]]) -> float:
    """How far a board's dots usually lie off their places beyond what noise explains, mm² per axis."""
    best = [min((d for d in of if d is not None), key=_size, default=None) for of in seen]
    # the median of a sum of two squares is 1.386 of their variance
    beyond = [_size(d) / 1.386 - float(np.median(d.variance)) for d in best if d is not None]
    noise = [float(np.median(d.variance)) for d in best if d is not None]
    return max(float(np.median(beyond)), 1e-3 * float(np.median(noise)))


def _shape_of(images: Sequence[_Deviations | None], count: int, size: float) -> tuple[Array, Array]:
    """The board's own deviations (count, 2) as some images show them, and their variances (count,)."""
    total, weight = np.zeros((count, 2)), np.full(count, 1 / max(size, 1e-12))
    for d in images:
        if d is not None:
            total[d.target] += d.offset / d.variance[:, None]  # an image has a target once
            weight[d.target] += 1 / d.variance
    return total / weight[:, None], 1 / weight


def _best(of: Sequence[_Deviations | None], shape: tuple[Array, Array], size: float) -> tuple[int, float]:
    """Which labelling fits a board's shape best, and by how much in log-likelihood."""
    squares = [None if d is None else _misfits(d, shape, size) for d in of]
    independent = [d.independent for d in of if d is not None]
    unit = min(median_of(square) for square in squares if square is not None) / 1.386 + 1e-30
    likelihood = []
    for square in squares:
        if square is None:
            likelihood.append(-np.inf)
            continue
        # a wrong dot is no reason to turn a board
        heavy = np.minimum(square / unit, 9 + np.log1p(np.maximum(square / unit - 9, 0)))
        likelihood.append(-sum(independent) / len(independent) * float(np.log(np.mean(heavy))))
    order = np.argsort(likelihood)[::-1]
    margin = likelihood[order[0]] - likelihood[order[1]] if len(order) > 1 else np.inf
    return int(order[0]), float(margin)


def _misfits(d: _Deviations, shape: tuple[Array, Array], size: float) -> Array:
    """Weighted squares (n,) that the board's shape, by as much of it as the image shows, leaves of its deviations."""
    there, spread = shape[0][d.target], shape[1][d.target]
    weight = 1 / (spread + d.variance + 0.1 * size)
    near = weight / np.maximum(np.sum(d.offset**2, axis=1) / (9 * d.size + 1e-30), 1.0)
    gain = (near @ np.sum(d.offset * there, axis=1)) / (near @ np.sum(there**2, axis=1) + 1e-30)
    return weight * np.sum((d.offset - np.clip(gain, 0, 1) * there) ** 2, axis=1)


def _labelling(turn: NDArray[np.int64], shift: NDArray[np.int64]) -> Labelling:
    (a, b), (c, d) = turn.tolist()
    return ((a, b), (c, d)), (int(shift[0]), int(shift[1]))


def _is_turn(a: Array, b: Array, spacing: float) -> bool:
    """Whether places (n, 2) become others by a turn in the plane, to a share of the spacing."""
    p, q = a - a.mean(axis=0), b - b.mean(axis=0)
    U, _, Vt = np.linalg.svd(p.T @ q)
    R = Vt.T @ U.T
    return bool(np.linalg.det(R) > 0 and np.linalg.norm(p @ R.T - q, axis=1).max() < REGULAR * spacing)
