"""A guess of the picks: the dots of an image put in order, and the order laid onto the testfield.

A regular testfield looks the same half a turn round, and where its outermost lines are hidden, or lie beyond the light
or the image, also some rows or columns further. The board's edges decide where they are seen: a dot where no target
should be, even a faint one beside the light, speaks against a guess, and so does bare ground where a target should be.
What is neither may be covered, and says nothing. Among guesses that are equally good the one nearest to an image picked
before comes first. An operator looks at each of them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.lazy import dataclass
from core.measure.identity.blobs import Blobs, find_blobs
from core.measure.identity.places import bare_ground, dots_at, reduced, reduced_to
from core.measure.identity.single import predicted_view
from core.measure.identity.view import View, first_view, fit_both_tilts
from core.model import Array, DeviceSpec, Floats, Ints, Seed, Testfield
from core.numerics import quantile_of
from core.numerics.places import kd_tree

WIDTH = 1000  # px that an image is reduced to: enough to see dots
LEAST, MOST = 4.0, 60.0  # diameter of dots looked for, px of the reduced image
NEAR = 0.25  # how far from its place the next dot of a line may lie, in steps
FEWEST = 9  # dots in order that a guess needs
OFF = 0.15  # how far dots may lie off the view of a regular field, in spacings (root mean square)
STRAY = 0.2  # of the dots that lines usually have: fewer on an outermost line beyond the field are no dots of it
DOUBT = 0.1  # share of dots that may speak against the best guess
TURNS = ([[1, 0], [0, 1]], [[0, 1], [-1, 0]], [[-1, 0], [0, -1]], [[0, -1], [1, 0]])


@dataclass(frozen=True)
class Order:
    """Dots numbered along two directions: cells (n, 2), centres (n, 2) px and areas (n,) px²."""

    cell: Ints
    uv: Array
    area_px: Array


@dataclass(frozen=True)
class _Laid:
    """An order laid onto a testfield: targets (n,) as indices, and what speaks against it."""

    target: Ints
    against: int  # dots without a target, and targets where the board's bare ground is seen
    absent: int  # targets without a dot within the image, whatever hides them
    moved_px: float


def find_dots(image: NDArray, *, dark: bool) -> Order:
    """Find the dots of an evenly lit board and put them in order, knowing neither their size nor the board.

    Dark dots are darker than the board. The order is empty where there are no dots in lines.
    """
    grey = np.nan_to_num(np.asarray(image, dtype=np.float32))
    blobs = bright_spots(-grey if dark else grey)
    use = _alike(blobs, LEAST * _factor(grey))
    uv = blobs.uv[use]
    cell, which = _in_order(uv @ _rounded(blobs.cov_px2[use]))
    return Order(cell, uv[which], blobs.area_px[use][which])


def bright_spots(grey: Floats) -> Blobs:
    """Find spots of all sizes that dots may have, in an image that nothing is known of."""
    small = reduced(grey, _factor(grey))
    height, width = small.shape
    across, down = np.linspace(0.1, 0.9, 7) * width, np.linspace(0.1, 0.9, 7) * height
    places = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
    blobs = find_blobs(small, (LEAST, MOST), places)
    scale = grey.shape[1] / width
    return replace(
        blobs, uv=(blobs.uv + 0.5) * scale - 0.5, area_px=blobs.area_px * scale**2, cov_px2=blobs.cov_px2 * scale**2
    )


def _factor(grey: Floats) -> int:
    return max(1, round(grey.shape[1] / WIDTH))


def propose_picks(
    image: NDArray,
    order: Order,
    testfield: Testfield,
    camera: DeviceSpec,
    known: Sequence[Seed] = (),
    side: str = "front",
) -> tuple[tuple[Seed, ...], ...]:
    """Guess the picks of an image, four at the corners of what is seen, the likeliest first.

    Empty where the dots, in the order of `find_dots`, have none that the testfield has. `known` are picks of an image
    taken before or after, where the board may have been nearby; `side`, "front" or "back", is as for `measure_targets`.
    """
    steps = _steps(testfield)
    if len(order.cell) < FEWEST or steps is None:
        return ()
    order = _without_strays(order, testfield)
    before = _before(testfield, camera, known)
    grey = np.nan_to_num(np.asarray(image, dtype=np.float32))
    grey = -grey if testfield.polarity == "black-on-white" else grey
    laid: list[_Laid] = []
    for turn in TURNS:
        mirror = _handedness(order, np.array(turn), steps) != side
        cells = order.cell @ (np.array(turn) @ np.diag([1, -1 if mirror else 1])).T
        view = _view(cells, order.uv, testfield, steps, camera)
        if view is not None:
            laid += _placements(cells, order, view, grey, testfield, steps, before)
    if not laid:
        return ()
    least = min(guess.against for guess in laid)
    # where most of the field is in the dark, nothing tells how far it reaches
    telling = least <= 2 + DOUBT * len(order.cell)
    laid = [guess for guess in laid if guess.against <= least + 2 or not telling]
    laid.sort(key=lambda guess: (guess.against if telling else 0, guess.moved_px, guess.absent))
    corners = _corners(order)
    return tuple(
        tuple(
            Seed(int(testfield.row[g.target[k]]), int(testfield.col[g.target[k]]), *np.round(order.uv[k], 3).tolist())
            for k in corners
        )
        for g in laid
    )


def _without_strays(order: Order, field: Testfield) -> Order:
    """Leave out outermost lines of a few spots where an order has more lines than the field."""
    most = sorted(int(np.ptp(lines)) for lines in (field.row, field.col))
    keep = np.arange(len(order.cell))
    while True:
        cell = order.cell[keep]
        if not np.any(np.sort(np.ptp(cell, axis=0)) > most):
            break
        on = [cell[:, axis] == end(cell[:, axis]) for axis in (0, 1) for end in (np.min, np.max)]
        weakest = min(on, key=np.count_nonzero)
        if np.count_nonzero(weakest) > STRAY * np.sqrt(len(keep)):
            break
        keep = keep[~weakest]
    return Order(order.cell[keep], order.uv[keep], order.area_px[keep])


def _alike(blobs: Blobs, least: float) -> Ints:
    """Which spots are whole ellipses of about the size that most have."""
    with np.errstate(all="ignore"):
        fill = blobs.area_px / (4 * np.pi * np.sqrt(np.linalg.det(blobs.cov_px2)))
    whole = (blobs.area_px >= least**2 * np.pi / 4) & (fill > 0.85) & (fill < 1.2) & ~blobs.on_border
    if not whole.any():
        return np.zeros(0, np.int64)
    bright = whole & (blobs.contrast > 0.25 * quantile_of(blobs.contrast[whole], 0.9))
    usual = float(np.median(blobs.area_px[bright]))
    return np.flatnonzero(bright & (blobs.area_px > usual / 3) & (blobs.area_px < 3 * usual))


def _rounded(cov: Array) -> Array:
    """The map (2, 2) of the image that makes spots with these moments round: a tilted lattice is upright again."""
    if not len(cov):
        return np.eye(2)
    values, vectors = np.linalg.eigh(cov.mean(axis=0))
    return np.asarray(vectors / np.sqrt(values) @ vectors.T)


def _in_order(uv: Array) -> tuple[Ints, Ints]:
    """Number dots along two directions, from one in the middle outwards: cells (m, 2) and which dots (m,) they are."""
    none = np.zeros((0, 2), np.int64), np.zeros(0, np.int64)
    if len(uv) < FEWEST:
        return none
    tree = kd_tree(uv)
    best = none
    for start in tree.query(np.median(uv, axis=0), k=3)[1].tolist():
        steps = _first_steps(uv, tree, start)
        if steps is not None:
            found = _walk(uv, tree, start, *steps)
            best = found if len(found[1]) > len(best[1]) else best
    return _square(best[0], uv[best[1]]), best[1]


def _first_steps(uv: Array, tree: Any, start: int) -> tuple[Array, Array] | None:
    """The steps to the nearest dot and to the nearest one across that direction, turned like the image's u and v."""
    near = uv[tree.query(uv[start], k=min(9, len(uv)))[1][1:]] - uv[start]
    first = near[0]
    across = np.abs(first[0] * near[:, 1] - first[1] * near[:, 0])
    length = np.hypot(*near.T)
    sine = across / np.maximum(length * np.hypot(*first), 1e-9)
    if not np.any(sine > 0.5):
        return None
    second = near[int(np.argmin(np.where(sine > 0.5, length / np.maximum(sine, 0.5), np.inf)))]
    return first, second if first[0] * second[1] - first[1] * second[0] > 0 else -second


def _square(cell: Ints, uv: Array) -> Ints:
    """Number dots anew where a step went along a diagonal, as it does where dots in the middle are covered."""
    while len(cell):
        a, b = np.linalg.lstsq(np.column_stack([cell, np.ones(len(cell))]), uv, rcond=None)[0][:2]
        along = np.array([np.rint(a @ b / (a @ a)), np.rint(a @ b / (b @ b))]).astype(np.int64)
        if not along.any():
            break
        cell = cell + np.outer(cell[:, 1], (along[0], 0)) if along[0] else cell + np.outer(cell[:, 0], (0, along[1]))
    return cell


def _walk(uv: Array, tree: Any, start: int, a: Array, b: Array) -> tuple[Ints, Ints]:
    """Go from dot to dot; each step says where the next one in its direction will be."""
    at: dict[tuple[int, int], int] = {(0, 0): start}
    taken, waiting = {start}, deque([((0, 0), a, b)])
    while waiting:
        (i, j), a, b = waiting.popleft()
        for di, dj in ((1, 0), (-1, 0), (0, 1), (0, -1)):
            cell, step = (i + di, j + dj), di * a + dj * b
            if cell in at:
                continue
            here = uv[at[i, j]]
            distance, nearest = tree.query(here + step)
            if distance > NEAR * np.hypot(*step) or nearest in taken:
                continue
            at[cell] = int(nearest)
            taken.add(int(nearest))
            made = (uv[nearest] - here) * (di + dj)
            waiting.append((cell, (a + made) / 2 if di else a, (b + made) / 2 if dj else b))
    return np.array(list(at), np.int64), np.array(list(at.values()), np.int64)


def _steps(field: Testfield) -> Array | None:
    """Origin, step of a row and step of a column (3, 3) mm of a regular field; None where it is not one."""
    A = np.stack([np.ones(len(field.row)), field.row, field.col], axis=1)
    steps, *_ = np.linalg.lstsq(A, field.xyz_mm, rcond=None)
    spacing = min(np.linalg.norm(steps[1]), np.linalg.norm(steps[2]))
    off = np.linalg.norm(A @ steps - field.xyz_mm, axis=1)
    return np.asarray(steps) if spacing > 0 and off.max() < 0.25 * spacing else None


def _xyz(steps: Array, cells: Ints) -> Array:
    """Nominal places (n, 3) of cells (n, 2), row and column, in the field or beyond it."""
    return steps[0] + cells @ steps[1:]


def _handedness(order: Order, turn: Ints, steps: Array) -> str:
    """The side of the board that an order shows when its cells, turned, are taken for rows and columns."""
    cells = order.cell @ turn.T
    A = np.stack([np.ones(len(cells)), cells[:, 0], cells[:, 1]], axis=1)
    across = np.linalg.lstsq(A, order.uv, rcond=None)[0][1:]
    board = steps[1, 0] * steps[2, 1] - steps[1, 1] * steps[2, 0]
    return "front" if np.linalg.det(across) * board < 0 else "back"


def _view(cells: Ints, uv: Array, field: Testfield, steps: Array, camera: DeviceSpec) -> View | None:
    """The view in which dots are the given cells; None where they do not fit."""
    xyz = _xyz(steps, cells - _middle(cells, field))
    view = first_view(camera, xyz, uv)
    if view is None:
        return None
    view = fit_both_tilts(view, xyz, uv, radial=len(cells) >= 12)
    off = np.sqrt(np.mean(np.sum((view.project(xyz) - uv) ** 2, axis=1)))
    one = np.sqrt(np.median(np.abs(np.linalg.det(view.jacobian(xyz))))) * np.linalg.norm(steps[1:], axis=1).min()
    return view if off < OFF * one else None


def _placements(
    cells: Ints, order: Order, view: View, grey: Floats, field: Testfield, steps: Array, before: Array | None
) -> list[_Laid]:
    """All ways to lay cells onto the field by whole rows and columns, and what speaks against each."""
    low, high = cells.min(axis=0), cells.max(axis=0)
    first, last = np.array([field.row.min(), field.col.min()]), np.array([field.row.max(), field.col.max()])
    room = (last - first) - (high - low)
    if np.any(room < 0):
        return []
    top, index, middle = low - room, field.index(), _middle(cells, field)
    shape = tuple((high + room - top + 1).tolist())  # the field, and as much round it as it could be shifted
    around = _xyz(steps, np.stack(np.unravel_index(np.arange(shape[0] * shape[1]), shape), axis=-1) + top - middle)
    radius_mm = float(np.median(field.diameter_mm)) / 2
    unit = view.jacobian(around) * radius_mm
    radius_px = float(np.nanmedian(np.sqrt(np.abs(np.linalg.det(unit)))))
    image = reduced_to(grey, radius_px, dark=field.polarity == "black-on-white")
    there, told = (x.reshape(shape) for x in dots_at(image, view.project(around), unit))
    there[tuple((cells - top).T)] = told[tuple((cells - top).T)] = True
    step_mm = np.linalg.norm(steps[1:], axis=1).min()
    bare = bare_ground(image, lambda c: view.project(_xyz(steps, c + top - middle)), there, radius_mm / step_mm)
    found = []
    for row, col in np.ndindex(*(room + 1).tolist()):
        shift = first - low + (row, col)
        target = np.array([index.get((r, c), -1) for r, c in (cells + shift).tolist()])
        if target.min() < 0:
            continue
        expected = np.zeros(shape, bool)
        expected[tuple((np.stack([field.row, field.col], axis=1) - shift - top).T)] = True
        moved = 0.0 if before is None else float(np.median(np.hypot(*(before[target] - order.uv).T)))
        against = int(np.count_nonzero(there & ~expected) + np.count_nonzero(bare & expected))
        absent = int(np.count_nonzero(told & expected & ~there))
        found.append(_Laid(target, against, absent, np.nan_to_num(moved, nan=np.inf)))
    return found


def _middle(cells: Ints, field: Testfield) -> Ints:
    """What to take from cells so that their middle is the field's."""
    of_field = np.array([field.row.min() + field.row.max(), field.col.min() + field.col.max()]) // 2
    return np.asarray((cells.min(axis=0) + cells.max(axis=0)) // 2 - of_field)


def _before(testfield: Testfield, camera: DeviceSpec, known: Sequence[Seed]) -> Array | None:
    """Where all targets (n, 2) were in an image picked before; None where there is none."""
    try:
        return predicted_view(testfield, camera, known).project(testfield.xyz_mm)
    except InputError:
        return None


def _corners(order: Order) -> list[int]:
    """Four whole dots near the corners of what is seen, round it."""
    A = np.column_stack([np.ones(len(order.cell)), order.cell])
    size = np.log(order.area_px)
    size = size - A @ np.linalg.lstsq(A, size, rcond=None)[0]  # perspective changes it steadily across the field
    near = np.abs(size - np.median(size))
    whole = np.flatnonzero(near <= max(3 * float(np.median(near)), 0.05))
    from_middle = order.cell[whole] - order.cell[whole].mean(axis=0)
    chosen: list[int] = []
    for down, right in ((-1, -1), (-1, 1), (1, 1), (1, -1)):
        ranked = whole[np.argsort(-(from_middle @ (down, right)), kind="stable")].tolist()
        chosen.append(next(k for k in ranked if k not in chosen))
    return chosen
