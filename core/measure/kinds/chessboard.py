"""Chessboards: the targets are the corners where four squares meet, `diameter_mm` is the side of a square.

A chessboard is recognised where corners of all its rows and columns are seen, and looks the same half a turn round.
Rows and columns count the corners as OpenCV does. How corners are found outwards from picks and measured is the same
for boards of tags.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import chain

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import NotRecognisedError
from core.lazy import dataclass
from core.measure.board import Board, board_from_testfield
from core.measure.centres.corners import fit_corners
from core.measure.centres.crossings import blocks_of_crossings
from core.measure.identity.picks import check_picks
from core.measure.identity.places import noise_of
from core.measure.identity.view import View, first_view, fit_both_tilts
from core.measure.kinds.kind import Guesses, Marks, Patch, Sight, TargetKind
from core.measure.missing import EXCLUDED, OUTSIDE
from core.model import Array, DeviceSpec, Seed, Testfield
from core.numerics import from_neighbours, nearest

PLAIN = 0.35  # radius that counts, in squares: beyond it are the next corners
REACH = 2.3  # squares from measured corners at which the next ones are looked for
OFF = 0.25  # squares that a corner may be off its prediction
CATCH = 0.3  # squares from the prediction that are looked at first
AROUND = 8  # known corners whose places foretell another one
ASIDE = 0.5  # radii from a corner along both its edges, where the squares are looked at
LEAST_CONTRAST = 5.0  # of the noise
LEAST_SHARE = 0.05  # of the usual contrast: less is none
APART = 0.3  # of the mean difference between dark and bright quadrants: where one alone differs, noise is left of it
IN_TURN = 0.5  # mean sign of corners that change places in turn; where some are passed over it is near 0
FAINT = 0.25  # of the usual contrast: light may fall to a third
TRIES = 4  # of blocks of corners that no board found before holds: some 0.05 s each
NOTHING = np.zeros((0, 0, 2))
LEAST_OF_LINE = 2  # corners that make the outermost row or column of a board seen in part
SMEARED = 1.5  # blur over the usual one from which something else lies across an edge
LEAST_RADIUS_PX, MOST_RADIUS_PX = 2.6, 10.0


@dataclass(frozen=True)
class CornerShape:
    """Corners of a kind: the radius on the board that counts, mm, and whether one quadrant alone is dark.

    That is the one towards the other corner of the same two rows and two columns. `rough` are residuals over the
    contrast that a clean corner may show beyond the usual noise.
    """

    radius_mm: Callable[[Board], Array]
    single: bool = False
    rough: float = 0.025


def eight_bits(image: NDArray) -> NDArray[np.uint8]:
    """Stretch grey values to what OpenCV's functions take."""
    low, high = np.percentile(image[::3, ::3], [0.5, 99.5])
    return np.asarray(np.clip((image - low) * (255 / max(high - low, 1e-6)), 0, 255), np.uint8)


# ------------------------------------------------------------------------------------------------------ who is who


def _guess_plain(
    image: NDArray, testfield: Testfield, camera: DeviceSpec, known: Sequence[Seed], side: str
) -> tuple[Array, Guesses]:
    """Look for the whole board, or for a part that reaches to all its sides; either way round, as the side allows."""
    rows, cols = int(testfield.row.max()) + 1, int(testfield.col.max()) + 1
    if len(testfield.row) != rows * cols:
        return np.zeros((0, 2)), ()
    grey = eight_bits(image)
    blocks = blocks_of_crossings(grey)
    first = next(blocks, None)
    if first is None and min(rows, cols) > 2:
        return np.zeros((0, 2)), ()
    found, corners = cv2.findChessboardCornersSB(grey, (cols, rows), flags=cv2.CALIB_CB_EXHAUSTIVE)
    uv = np.asarray(corners, np.float64).reshape(rows, cols, 2) if found else NOTHING
    found = found and _in_turn(grey, uv)
    if not found:
        uv = _seen_in_part(image, grey, camera, chain([] if first is None else [first], blocks), (rows, cols))
    if uv.shape[:2] != (rows, cols) or (found and _goes_on(grey, uv)):
        return uv[np.isfinite(uv[..., 0])], ()
    row, col = np.mgrid[0:rows, 0:cols]
    ways = [(row, col), (row[::-1, ::-1], col[::-1, ::-1]), (row, col[:, ::-1]), (row[::-1], col)]
    if rows == cols:
        ways += [(c, r) for r, c in ways]
    at = np.isfinite(uv[..., 0])
    cells = np.argwhere(at)
    chosen = [tuple(cells[k]) for k in spread(cells[:, ::-1].astype(np.float64))]
    guesses = [tuple(Seed(int(r[e]), int(c[e]), float(uv[e][0]), float(uv[e][1])) for e in chosen) for r, c in ways]
    usual = [_first_dark(grey, uv, r, c) for r, c in ways]
    possible = [k for k, g in enumerate(guesses) if testfield.side_seen(g) == side]
    return uv[at], tuple(guesses[k] for k in [k for k in possible if usual[k]] or possible)


_WAYS = np.array([(-1.0, -1.01), (1.0, -1.01), (1.0, 1.01), (-1.0, 1.01)])


def spread(places: Array) -> list[int]:
    """Which places (n, 2) on the board to start from: four ends of what is seen, then its middle and those halfway."""
    ends = list(dict.fromkeys(np.argmax(places @ _WAYS.T, axis=0).tolist()))
    middle = places[ends].mean(axis=0)
    between = np.vstack([middle, (places[ends] + middle) / 2])
    return list(dict.fromkeys([*ends, *nearest(places, of=between)[:, 0].tolist()]))


def _seen_in_part(
    image: NDArray, grey: NDArray[np.uint8], camera: DeviceSpec, blocks: Iterable[Array], size: tuple[int, int]
) -> Array:
    """Corners (rows, cols, 2), NaN where none is seen; of another shape unless corners of all rows and columns are."""
    done, tries, most = np.zeros((0, 2)), 0, NOTHING
    for block in blocks:
        middle = block[1, 1]
        if np.linalg.norm(done - middle, axis=1).min(initial=np.inf) < OFF * np.linalg.norm(middle - block[1, 0]):
            continue
        uv = _round_block(image, grey, camera, block, max(size))
        if sorted(uv.shape[:2]) == sorted(size):
            return uv if uv.shape[:2] == size else uv.swapaxes(0, 1)
        done = np.vstack([done, middle, uv[np.isfinite(uv[..., 0])]])
        most = max(most, uv, key=np.size)
        tries += 1
        if tries == TRIES:
            break
    return most


def _in_turn(grey: NDArray[np.uint8], uv: Array) -> bool:
    """Whether dark and bright change places from each corner (rows, cols, 2) to the next: none is passed over."""
    arms = PLAIN * np.stack([np.gradient(uv, axis=1), np.gradient(uv, axis=0)], axis=-1)
    swing = np.sign(_apart(grey, uv.reshape(-1, 2), arms.reshape(-1, 2, 2))).reshape(uv.shape[:2])
    swing[1::2] *= -1
    swing[:, 1::2] *= -1
    return bool(abs(swing.mean()) > IN_TURN)


def _goes_on(grey: NDArray[np.uint8], uv: Array) -> bool:
    """Whether the corners (rows, cols, 2) of a board go on beyond one of its sides: they are part of a larger one."""
    for lines in (uv, uv[::-1], uv.swapaxes(0, 1), uv.swapaxes(0, 1)[::-1]):
        edge, out = lines[0], lines[0] - lines[1]
        arms = PLAIN * np.stack([np.gradient(edge, axis=0), out], axis=2)
        next_one = edge + out
        use = np.all((next_one > 3) & (next_one < np.array(grey.shape[::-1]) - 4), axis=1)
        if np.count_nonzero(use) <= len(edge) / 2:
            continue
        at = refined(grey, next_one[use], int(np.clip(CATCH * np.median(np.linalg.norm(out, axis=1)), 2, 40)))
        near = np.linalg.norm(at - next_one[use], axis=1) < OFF * np.linalg.norm(out[use], axis=1)
        here, there = _apart(grey, edge[use], arms[use]), _apart(grey, at, arms[use])
        if np.count_nonzero(near & (here * there < 0) & (np.abs(there) > FAINT * np.abs(here))) > len(edge) / 2:
            return True
    return False


def _round_block(image: NDArray, grey: NDArray[np.uint8], camera: DeviceSpec, block: Array, most: int) -> Array:
    """All corners (h, w, 2), lines of `most`, of the board that a block (3, 3, 2) is a part of; NaN where unseen."""
    side = len(block) + 2 * (most - 1)  # the block may be any part of the board, either way round
    row, col = (x.ravel() for x in np.mgrid[0:side, 0:side])
    xyz = np.column_stack([col, -row, 0 * row]).astype(np.float64)
    start = np.flatnonzero(np.all(np.abs(np.stack([row, col]) - side // 2) <= 1, axis=0))
    start_uv = block.reshape(-1, 2)
    view = first_view(camera, xyz[start], start_uv)
    if view is None:
        return NOTHING
    arms = np.full((len(row), 2), PLAIN)
    sure = is_corner(grey, start_uv, view.jacobian(xyz[start]) * PLAIN)
    start, start_uv = start[sure], start_uv[sure]
    view = first_view(camera, xyz[start], start_uv) if len(start) >= 4 else None
    if view is None:
        return NOTHING
    around = board_from_testfield(Testfield(row, col, xyz, np.ones(len(row)), kind="chessboard"))
    uv, _, axes = _outwards(grey, around, view, start, start_uv, arms, single=False)
    seen = np.flatnonzero(np.isfinite(uv[:, 0]))
    if len(seen) < 4:
        return NOTHING
    fit = fit_corners(np.asarray(image, np.float32), uv[seen], _area(axes[seen], arms[seen]))
    contrast = np.where((row + col)[seen] % 2 == 0, fit.contrast, -fit.contrast)  # squares are dark in turn
    usual = float(np.nanmedian(contrast[np.isin(seen, start)]))  # beyond the board, noise looks like corners
    with np.errstate(invalid="ignore"):
        seen = seen[contrast / usual > FAINT]
    uv = np.where(np.isin(np.arange(len(row)), seen)[:, None], uv, np.nan).reshape(side, side, 2)
    there = [np.flatnonzero(np.isfinite(uv[..., 0]).sum(axis=axis) >= LEAST_OF_LINE) for axis in (1, 0)]
    if not all(len(lines) for lines in there):
        return NOTHING
    (top, foot), (left, right) = ((int(lines[0]), int(lines[-1]) + 1) for lines in there)
    return np.asarray(uv[top:foot, left:right])


def _first_dark(grey: NDArray[np.uint8], uv: Array, row: NDArray[np.int64], col: NDArray[np.int64]) -> bool:
    """Whether the square beside the first corner is dark, as boards are usually printed."""
    middle = (uv[1:, 1:] + uv[:-1, :-1] + uv[1:, :-1] + uv[:-1, 1:]) / 4
    whole = np.isfinite(middle[..., 0])
    u, v = np.rint(middle[whole]).astype(int).T
    first = np.minimum(row[1:, 1:], row[:-1, :-1]) + np.minimum(col[1:, 1:], col[:-1, :-1])
    even = first[whole] % 2 == 0
    value = grey[v, u].astype(float)
    return bool(value[even].mean() < value[~even].mean())


# ------------------------------------------------------------------------------------------------------ measuring


def measure_corners(kind: CornerShape, sight: Sight, seeds: Sequence[Seed]) -> Marks:
    """Find all corners outwards from the picks, and fit them."""
    board, camera = sight.board, sight.camera
    picks = check_picks(board, seeds, (camera.width, camera.height), sight.where, sight.side)
    view = first_view(camera, board.xyz_mm[picks.target], picks.uv)
    if view is None:
        raise NotRecognisedError(sight.where, "no view of the board has the picks where they are", "correct them")
    arms = kind.radius_mm(board)[:, None] * _inwards(board) if kind.single else np.tile(kind.radius_mm(board), (2, 1)).T
    uv, view, axes = _outwards(eight_bits(sight.image), board, view, picks.target, picks.uv, arms, kind.single)
    known = np.flatnonzero(np.isfinite(uv[:, 0]))
    if len(known) < 4:
        seen = f"{len(known)} corners where the picks predict them"
        raise NotRecognisedError(sight.where, seen, "pick corners where four squares meet")
    area = _area(axes[known], arms[known])
    fit = fit_corners(sight.image, uv[known], area, kind.single)
    missing = _missing(sight, view, np.setdiff1d(np.arange(len(board.row)), known))
    with np.errstate(invalid="ignore"):
        usual = float(np.median(fit.rest))  # noise, and what sharpening in the camera adds
        dim = ~(np.abs(fit.contrast) > LEAST_CONTRAST * min(usual, noise_of(sight.image[::4])))
        dim |= np.abs(fit.contrast) < LEAST_SHARE * np.median(np.abs(fit.contrast))
        rough = ~(fit.rest < 1.6 * usual + kind.rough * np.abs(fit.contrast)) | ~np.isfinite(fit.uv[:, 0])
        if np.any(clear := ~rough & ~dim):
            rough |= fit.blur > SMEARED * float(np.median(fit.blur[clear]))
    for bad, why in ((dim, "no contrast"), (rough, "it is not a corner of four even squares: covered or disturbed")):
        missing |= dict.fromkeys(known[bad].tolist(), why)
    good = ~(dim | rough) & ~np.isin(known, list(sight.unwanted))
    one = np.ones(int(good.sum()))
    return Marks(
        known[good], fit.uv[good], fit.cov[good], area[good], one, fit.blur[good], 0 * fit.uv[good],
        missing | dict.fromkeys(sorted(sight.unwanted), EXCLUDED),
    )  # fmt: skip


def _area(axes: Array, arms: Array) -> Array:
    """The pixels that count for corners with arms (n, 2) mm along both edges, as `fit_corners` takes them."""
    U, radii_px, Vt = np.linalg.svd(axes * arms[:, None, :])
    return np.asarray((U * np.clip(radii_px, LEAST_RADIUS_PX, MOST_RADIUS_PX)[:, None, :]) @ Vt)


def _outwards(
    grey: NDArray[np.uint8],
    board: Board,
    view: View,
    start: NDArray[np.int64],
    start_uv: Array,
    arms: Array,
    single: bool,
) -> tuple[Array, View, Array]:
    """Corners (n, 2) to about a tenth of a pixel, NaN where there is none; the view that fits them; px (n, 2, 2) a mm.

    What the view leaves over at known corners moves the prediction: a lens is smooth.
    """
    height, width = grey.shape
    uv = np.full((len(board.row), 2), np.nan)
    reached = np.zeros(len(board.row), bool)
    reached[start] = True
    known, known_uv = start, start_uv
    fourth = board.neighbours[:, min(3, board.neighbours.shape[1] - 1)]
    spacing = float(np.median(np.linalg.norm(board.xyz_mm[fourth] - board.xyz_mm, axis=1)))
    before = -1
    while before < (before := int(np.isfinite(uv[:, 0]).sum())) or before == 0:
        expected, axes = _predicted(view, board.xyz_mm, known, known_uv, spacing)
        # of nothing beyond the horizon
        square = 2 * board.radius_mm * np.linalg.svd(np.nan_to_num(axes), compute_uv=False)[:, 1]
        with np.errstate(invalid="ignore"):
            inside = np.all((expected > 3) & (expected < np.array([width, height]) - 4), axis=1)
        tried = np.flatnonzero(reached & inside & (square > 4))
        uv[:] = np.nan
        if not len(tried):
            break
        at = expected[tried]
        for share, most in ((CATCH, 40), (0.2, 8)):
            at = refined(grey, at, int(np.clip(np.median(square[tried]) * share, 2, most)))
        near = np.linalg.norm(at - expected[tried], axis=1) < OFF * square[tried]
        keep = near & is_corner(grey, at, axes[tried] * arms[tried, None, :], single)
        if known is start and near.sum() >= 3:  # few for the view that this looks by, and one may be covered
            keep, at = near | True, np.where(near[:, None], at, expected[tried])
        if keep.sum() < 4:
            break
        uv[tried[keep]] = at[keep]
        known = np.flatnonzero(np.isfinite(uv[:, 0]))
        known_uv = uv[known]
        view = fit_both_tilts(view, board.xyz_mm[known], known_uv, radial=len(known) >= 12)
        reached |= (
            np.linalg.norm(board.xyz_mm[:, None] - board.xyz_mm[known][None], axis=2).min(axis=1) < REACH * spacing
        )
    return uv, view, axes


def _predicted(
    view: View, xyz_mm: Array, known: NDArray[np.int64], known_uv: Array, spacing_mm: float
) -> tuple[Array, Array]:
    """Places (n, 2) px and their slopes (n, 2, 2) px per mm, by the view and what it leaves at known corners nearby."""
    expected, axes = view.project(xyz_mm), view.jacobian(xyz_mm)
    rest = known_uv - expected[known]
    off, slope = from_neighbours(xyz_mm[known, :2] / spacing_mm, rest, xyz_mm[:, :2] / spacing_mm, AROUND)
    return expected + off, axes + np.swapaxes(slope, 1, 2) / spacing_mm


def refined(grey: NDArray[np.uint8], uv: Array, half: int) -> Array:
    """Move places (n, 2) onto the corners next to them."""
    if not len(uv):
        return uv
    start = np.ascontiguousarray(uv, np.float32).reshape(-1, 1, 2).copy()
    moved = cv2.cornerSubPix(grey, start, (half, half), (-1, -1), (3, 30, 0.005))
    return np.asarray(moved, np.float64).reshape(-1, 2)


def is_corner(grey: NDArray[np.uint8], uv: Array, arms: Array, single: bool = False) -> NDArray[np.bool_]:
    """Whether the four quadrants between arms (n, 2, 2) are dark and bright in turn, or the first alone is dark."""
    a, b, c, d = _quadrants(grey, uv, arms)
    if single:
        return np.asarray(a < np.minimum(np.minimum(b, c), d))
    return np.abs(_apart(grey, uv, arms)) > APART * np.abs(a + c - b - d) / 2


def _apart(grey: NDArray[np.uint8], uv: Array, arms: Array) -> Array:
    """By how much the first and third quadrants are brighter than both others, or, below 0, darker; 0 where neither."""
    a, b, c, d = _quadrants(grey, uv, arms)
    brighter, darker = np.minimum(a, c) - np.maximum(b, d), np.minimum(b, d) - np.maximum(a, c)
    return np.asarray(np.where(brighter > darker, np.maximum(brighter, 0), -np.maximum(darker, 0)))


def _quadrants(grey: NDArray[np.uint8], uv: Array, arms: Array) -> list[Array]:
    """Grey values (n,) between the arms (n, 2, 2) of corners, one quadrant after the other."""
    values = []
    for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        u, v = (uv + ASIDE * (arms @ np.array([x, y], np.float64))).astype(np.float32).T
        values.append(cv2.remap(grey, u[:, None].copy(), v[:, None].copy(), cv2.INTER_LINEAR).ravel().astype(float))
    return values


def _inwards(board: Board) -> Array:
    """Signs (n, 2) of board X and Y from each corner into its tag."""
    other = [board.index.get((r ^ 1, c ^ 1), i) for i, (r, c) in enumerate(board.index)]
    return np.asarray(np.where(board.xyz_mm[other, :2] < board.xyz_mm[:, :2], -1.0, 1.0))


def _missing(sight: Sight, view: View, rest: NDArray[np.int64]) -> dict[int, str]:
    expected = view.project(sight.board.xyz_mm[rest])
    with np.errstate(invalid="ignore"):
        inside = np.all((expected > 3) & (expected < [sight.camera.width - 4, sight.camera.height - 4]), axis=1)
    words = (OUTSIDE, "no corner where its neighbours predict it: covered, or without contrast")
    return {int(t): words[int(there)] for t, there in zip(rest, inside, strict=True)}


def nearest_corner(
    image: NDArray, testfield: Testfield, uv: tuple[float, float], reach_px: float
) -> tuple[float, float] | None:
    """Move a place that an operator points at onto the corner there."""
    window = int(np.clip(reach_px, 2, 8))
    if not (window < uv[0] < image.shape[1] - window - 1 and window < uv[1] < image.shape[0] - window - 1):
        return None
    at = refined(eight_bits(image), np.array([uv], np.float64), window)[0]
    return (float(at[0]), float(at[1])) if np.hypot(at[0] - uv[0], at[1] - uv[1]) <= reach_px else None


def drawn_squares(testfield: Testfield) -> tuple[Patch, ...]:
    """The dark squares round all corners, the first one dark."""
    corner = np.column_stack([testfield.col, testfield.row, np.ones(len(testfield.row))])
    to_mm = np.linalg.lstsq(corner, testfield.xyz_mm[:, :2], rcond=None)[0]
    ends = [(-1, -1, 1), (0, -1, 1), (0, 0, 1), (-1, 0, 1)]
    dark = [(x, y, 0) for y in range(int(corner[:, 1].max()) + 2) for x in range(int(corner[:, 0].max()) + 2)]
    return tuple(Patch((np.array(ends) + place) @ to_mm, True) for place in dark if (place[0] + place[1]) % 2 == 0)


PLAIN_SHAPE = CornerShape(lambda board: 2 * PLAIN * board.radius_mm)
CHESSBOARD = TargetKind(
    "corners", _guess_plain, partial(measure_corners, PLAIN_SHAPE), nearest_corner, drawn=drawn_squares, round=False
)
