"""From the picks to a lattice that all picks agree on, or the reason why there is none."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.measure.board import Board
from core.measure.identity.blobs import Blobs
from core.measure.identity.grow import Lattice, grow, predict, prune
from core.measure.identity.picks import FEWEST, Picks
from core.measure.identity.view import View, first_view, no_view
from core.model import Array, DeviceSpec, Ints, Note
from core.numerics import distinct, inverse_2x2, nearest

LEFT_OVER = 0.15  # share of dots among the identified ones that may belong to no target (reflections, other boards)
REACHED = 0.3  # spacings within which a lattice must foretell a pick that it could not grow to
DIM = 0.35  # contrast of a dot over that of others from which it lies in the same light; growing stops there, too
BENT = 0.45  # ... and beyond which a dot has a wrong name: at the rim of fields of 100 degrees right ones have 0.36
ANOTHER = 0.7  # beyond which such a pick is another target: what foretells it may err far from the dots it grew to


def identify(
    board: Board, camera: DeviceSpec, blobs: Blobs, picks: Picks, spots: Ints, coded: bool = False
) -> tuple[Lattice, tuple[Note, ...]]:
    """Grow the lattice from one pick and demand that it meets all others with the identities they were given.

    Picks that dots do not lead to, on a part without light, need not be met; what was not used is told beside it. A
    pick without a spot (-1) lets only the view start from where it was clicked. Where codes lie between the targets,
    dots that belong to none say nothing. Picks that contradict the lattice of dots between them are an InputError.
    """
    view = first_view(camera, board.xyz_mm[picks.target], np.where(spots[:, None] < 0, picks.uv, blobs.uv[spots]))
    if view is None:
        raise no_view(picks.where)
    picks = replace(picks, target=picks.target[spots >= 0], uv=picks.uv[spots >= 0])
    spots = spots[spots >= 0]
    middle = np.array([camera.width - 1, camera.height - 1]) / 2
    starts = np.argsort(np.hypot(*(blobs.uv[spots] - middle).T))
    tried: dict[int, Lattice] = {}
    notes: tuple[Note, ...] = ()
    for start in starts.tolist():
        lattice = _grown_from(board, blobs, view, picks, spots, [start])
        tried[start] = lattice
        if np.all(lattice.blob[picks.target] == spots):
            # a lattice that bends to meet a wrong pick is smaller than the one that passes it by
            if any(len(other.conflicts) and other.known.sum() >= lattice.known.sum() for other in tried.values()):
                _refuse_contradiction(tried, picks, spots)
            break
    else:
        lattice, notes = _bridged(tried, picks, spots)
    left, absent, among = 0 if coded else _left_over(lattice), _absent(lattice), int(lattice.known.sum())
    pruned = prune(lattice)
    # dots that are no targets are no fault, nor are targets without a dot; both together are a lattice that skips rows
    if left >= 3 and left > LEFT_OVER * among and (pruned or absent > LEFT_OVER * among):
        seen = f"{left} dots lie between the {among} that fit the picks best and belong to no target"
        raise InputError(picks.where, seen, "correct the rows and columns of the picks")
    most = BENT if len(pruned) < LEFT_OVER * among else REACHED  # a wrong name bends many
    for k in np.flatnonzero(np.isin(picks.target, list(pruned))).tolist():
        if pruned[int(picks.target[k])] < most:
            continue  # a dot that is cut or covered, or at the rim of a wide field, not one with a wrong name
        seen = (
            f"{picks.name(board, k)} lies {pruned[int(picks.target[k])]:.2f} spacings off what the dots around it say"
        )
        raise InputError(picks.where, seen, "correct its row and column, or pick another target")
    if np.count_nonzero(lattice.known) < len(picks.target):
        seen = "no lattice of dots continues the picks as their rows and columns say"
        raise InputError(picks.where, seen, "correct the rows and columns of the picks, or pick other targets")
    if not coded:
        _refuse_if_shifted(lattice, picks)
    return lattice, notes


def _grown_from(board: Board, blobs: Blobs, view: View, picks: Picks, spots: Ints, starts: list[int]) -> Lattice:
    """Grow from some of the picks; the spots of the others stay reserved for them."""
    blob = np.full(len(board.row), -1)
    blob[picks.target[starts]] = spots[starts]
    reserved = dict(zip(spots.tolist(), picks.target.tolist(), strict=True))
    lattice = Lattice(board, blobs, view, blob, reserved)
    grow(lattice)
    return lattice


def _bridged(tried: dict[int, Lattice], picks: Picks, spots: Ints) -> tuple[Lattice, tuple[Note, ...]]:
    """Join what grew apart, where the larger part foretells the other picks; else say which pick contradicts.

    A pick without light that is foretold badly, but as no other target, is not used.
    """
    board = next(iter(tried.values())).board
    start = max(tried, key=lambda k: int(tried[k].known.sum()))
    lattice = tried[start]
    _refuse_contradiction(tried, picks, spots)
    met = lattice.blob[picks.target] == spots
    if lattice.known.sum() < 6 + np.count_nonzero(met):
        seen = f"no lattice of dots continues {picks.name(board, start)} as the rows and columns of the picks say"
        raise InputError(picks.where, seen, "correct the rows and columns of the picks")
    joined = _grown_from(board, lattice.blobs, lattice.view, picks, spots, np.flatnonzero(met).tolist())
    notes: list[Note] = []
    agreeing = np.count_nonzero(met)
    for k in np.flatnonzero(~met).tolist():
        uv, jacobian, _ = predict(lattice, picks.target[k : k + 1])
        there = np.isfinite(uv).all() and np.isfinite(jacobian).all()  # a lens that turns round tells nothing
        places = np.stack([lattice.blobs.uv[spots[k]], picks.uv[k]], axis=1) - uv.T
        offsets = np.linalg.solve(jacobian[0], places) if there else np.full((2, 2), np.nan)
        off, clicked = np.hypot(*offsets) / float(board.spacing_mm[picks.target[k]])
        contrast = lattice.blobs.contrast
        dim = contrast[spots[k]] < DIM * np.median(contrast[lattice.blob[lattice.known]])
        if off >= ANOTHER or not (min(off, clicked) < REACHED or dim):
            name = picks.name(board, k)
            seen = f"{name} lies {off:.1f} target spacings from where the other picks expect it"
            seen = seen if there else f"{name} lies far from where the other picks expect it"
            raise InputError(picks.where, seen, "correct its row and column, or pick targets with dots between them")
        agreeing += there
        if off < REACHED:
            joined.blob[picks.target[k]] = spots[k]
        else:
            seen = f"{picks.name(board, k)} is on a dot that is cut or covered, or that no lit dots lead to"
            notes.append(Note(f"{seen}: not used, the other picks tell", "pick"))
    if agreeing < FEWEST:
        seen = f"only {agreeing} picks are on dots that lead to each other"
        raise InputError(picks.where, seen, "pick targets with dots between them")
    grow(joined)
    return joined, tuple(notes)


def _refuse_contradiction(tried: dict[int, Lattice], picks: Picks, spots: Ints) -> None:
    """Raise if a lattice grown from one pick gives the dot of another pick a different identity."""
    at = {int(spot): k for k, spot in enumerate(spots)}
    against: dict[int, list[tuple[int, int]]] = {}
    for start, lattice in tried.items():
        for spot, target in lattice.conflicts.items():
            against.setdefault(at[spot], []).append((start, target))
    if not against:
        return
    board = next(iter(tried.values())).board
    culprit = max(against, key=lambda k: len(against[k]))
    start, target = against[culprit][0]
    right = f"counting dots from there it is {board.name(target)}"
    seen = f"{picks.name(board, culprit)} contradicts pick {start + 1}: {right}"
    raise InputError(picks.where, seen, "correct the row and column of the wrong one")


def _left_over(lattice: Lattice) -> int:
    """How many dots like targets lie among the identified ones, and where no target is foretold."""
    known = lattice.uv()[lattice.known].astype(np.float32)
    if len(known) < 4:
        return 0
    hull = cv2.convexHull(known)
    free = lattice.blobs.uv[_free(lattice, alike=True)]
    among = [cv2.pointPolygonTest(hull, (float(u), float(v)), False) > 0 for u, v in free]
    return int(np.count_nonzero(~_foretold(lattice, free[among])))


def _foretold(lattice: Lattice, places: Array) -> NDArray[np.bool_]:
    """Which places lie where a target without a dot is expected: its dot may be dim or cut."""
    targets = np.flatnonzero(~lattice.known)
    uv, jacobian, _ = predict(lattice, targets)
    sane = np.isfinite(uv).all(axis=1) & np.isfinite(jacobian).all(axis=(1, 2))
    if not (len(places) and np.any(sane)):
        return np.zeros(len(places), bool)
    target = np.flatnonzero(sane)[nearest(uv[sane], of=places)[:, 0]]
    unit = jacobian[target] * lattice.board.spacing_mm[targets[target], None, None]
    away = inverse_2x2(unit) @ (places - uv[target])[..., None]
    return np.asarray(np.hypot(away[:, 0, 0], away[:, 1, 0]) < REACHED)


def _absent(lattice: Lattice) -> int:
    """How many targets inside the image have no dot."""
    uv, _, _ = predict(lattice, np.flatnonzero(~lattice.known))
    spec = lattice.view.spec
    return int(np.count_nonzero(np.all((uv > 0) & (uv < np.array([spec.width - 1, spec.height - 1])), axis=1)))


def _refuse_if_shifted(lattice: Lattice, picks: Picks) -> None:
    """Raise if dots go on beyond one edge of the testfield while targets are absent along another.

    So it looks when all picks are wrong by the same rows or columns: each fits the others, and only the edges tell.
    """
    board = lattice.board
    edges = [(values, *pair) for values in (board.row, board.col) for pair in _edges(values)]
    absent = max((_bare(lattice, np.flatnonzero(values == edge)) for values, edge, _ in edges), default=0)
    if absent < 3:
        return
    for values, edge, inner in edges:
        beyond = _ghosts(lattice, np.flatnonzero(values == edge), inner, values)
        if beyond >= 3:
            line = f"{'row' if values is board.row else 'col'} {edge}"
            seen = f"{beyond} dots go on beyond {line}, while {absent} targets along another edge have no dot"
            raise InputError(picks.where, seen, "correct the rows and columns of all picks: they look shifted")


def _edges(values: Ints) -> list[tuple[int, int]]:
    """(outermost, next inner) line at both ends."""
    lines = distinct(values)
    return [(int(lines[0]), int(lines[1])), (int(lines[-1]), int(lines[-2]))] if len(lines) > 1 else []


def _bare(lattice: Lattice, on: Ints) -> int:
    """How many targets of an edge line lie inside the image among identified ones and have no spot at all."""
    uv, jacobian, support = predict(lattice, on)
    spec = lattice.view.spec
    inside = np.all((uv > 0) & (uv < np.array([spec.width - 1, spec.height - 1])), axis=1) & (support >= 3)
    near = _spots_at(lattice, uv, jacobian * lattice.board.spacing_mm[on, None, None])
    return int(np.count_nonzero(inside & ~lattice.known[on] & ~near))


def _ghosts(lattice: Lattice, on: Ints, inner: int, values: Ints) -> int:
    """How many dots lie where a line of targets beyond the edge would be, in steps like the last one inside."""
    board, other = lattice.board, lattice.board.col if values is lattice.board.row else lattice.board.row
    inside = {int(other[i]): int(i) for i in np.flatnonzero(values == inner)}
    pairs = [(int(i), inside[int(other[i])]) for i in on if int(other[i]) in inside]
    pairs = [(i, j) for i, j in pairs if lattice.blob[i] >= 0 and lattice.blob[j] >= 0]
    if not pairs:
        return 0
    edge, before = np.array(pairs).T
    step = board.xyz_mm[edge] - board.xyz_mm[before]
    seen = lattice.blobs.uv[lattice.blob[edge]]
    ahead = lattice.view.project(board.xyz_mm[edge] + step) - lattice.view.project(board.xyz_mm[edge])
    jacobian = lattice.view.jacobian(board.xyz_mm[edge] + step)
    return int(np.count_nonzero(_spots_at(lattice, seen + ahead, jacobian * board.spacing_mm[edge, None, None], True)))


def _spots_at(lattice: Lattice, uv: Array, unit: Array, alike: bool = False) -> NDArray[np.bool_]:
    """Where a spot not identified yet lies within a fifth of a spacing; `alike`: of a target's usual area only."""
    free = _free(lattice, alike)
    sane = np.all(np.isfinite(uv), axis=1) & np.all(np.isfinite(unit), axis=(1, 2))
    found = np.zeros(len(uv), bool)
    if np.any(free) and np.any(sane):
        near = lattice.blobs.uv[free][nearest(lattice.blobs.uv[free], of=uv[sane])[:, 0]]
        away = inverse_2x2(unit[sane]) @ (near - uv[sane])[..., None]
        found[sane] = np.hypot(away[:, 0, 0], away[:, 1, 0]) < 0.2
    return found


def _free(lattice: Lattice, alike: bool) -> NDArray[np.bool_]:
    """Which spots are not identified; `alike`: and have the size and contrast that targets have."""
    blobs, own = lattice.blobs, lattice.blob[lattice.known]
    free = np.ones(len(blobs.uv), bool)
    free[own] = False
    if alike:
        for value, low, high in ((np.sqrt(blobs.area_px), 0.8, 1.25), (blobs.contrast, 0.6, 1.6)):
            free &= (value > low * value[own].min()) & (value < high * value[own].max())
    return free
