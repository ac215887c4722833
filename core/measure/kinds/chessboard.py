"""Chessboards: the targets are the corners where four squares meet, `diameter_mm` is the side of a square.

A plain chessboard is recognised where all its corners are seen, and looks the same half a turn round. A ChArUco board
has a coded tag in every white square: each tag tells where it is, so that any part of the board with four tags will do.
Rows and columns count the corners as OpenCV does, from the corner of the board where the first tag is.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import NotRecognisedError
from core.measure.board import Board
from core.measure.corners import fit_saddles
from core.measure.kinds.kind import Guesses, Marks, Sight, TargetKind
from core.measure.missing import EXCLUDED
from core.measure.picks import check_picks, side_seen
from core.measure.view import View, first_view, fit_both_tilts
from core.model import DeviceSpec, Seed, Testfield

Array = NDArray[np.float64]

FAMILIES = ("5X5_{}", "4X4_{}", "6X6_{}", "7X7_{}", "APRILTAG_36h11")
SIZES = (50, 100, 250, 1000)  # of dictionaries: each begins with the smaller ones, and takes longer to look through
LEAST_TAGS = 4
ENOUGH_TAGS = 10  # that fit one board: no other family is looked for
PLAIN, TAGGED = 0.35, 0.17  # radius that counts, in squares: beyond it are the next corners, or the tags
REACH = 2.3  # squares from measured corners at which the next ones are looked for
OFF = 0.25  # squares that a corner may be off its prediction
LEAST_CONTRAST = 5.0  # of the noise
ROUGH = 0.25  # residuals over the contrast that a clean corner may show
LEAST_RADIUS_PX, MOST_RADIUS_PX = 2.6, 10.0


def _eight_bits(image: NDArray) -> NDArray[np.uint8]:
    low, high = np.percentile(image[::3, ::3], [0.5, 99.5])
    return np.asarray(np.clip((image - low) * (255 / max(high - low, 1e-6)), 0, 255), np.uint8)


# ------------------------------------------------------------------------------------------------------ who is who


def _guess_plain(
    image: NDArray, testfield: Testfield, camera: DeviceSpec, known: Sequence[Seed], side: str
) -> tuple[Array, Guesses]:
    """Look for the whole board; either way round, as the nominal side allows."""
    rows, cols = int(testfield.row.max()) + 1, int(testfield.col.max()) + 1
    grey = _eight_bits(image)
    found, corners = cv2.findChessboardCornersSB(grey, (cols, rows), flags=cv2.CALIB_CB_EXHAUSTIVE)
    if not found or len(testfield.row) != rows * cols:
        return np.zeros((0, 2)), ()
    uv = corners.reshape(rows, cols, 2).astype(np.float64)
    row, col = np.mgrid[0:rows, 0:cols]
    ways = [(row, col), (row[::-1, ::-1], col[::-1, ::-1]), (row, col[:, ::-1]), (row[::-1], col)]
    if rows == cols:
        ways += [(c, r) for r, c in ways]
    ends = [(0, 0), (0, cols - 1), (rows - 1, cols - 1), (rows - 1, 0)]
    guesses = [tuple(Seed(int(r[e]), int(c[e]), float(uv[e][0]), float(uv[e][1])) for e in ends) for r, c in ways]
    usual = [_first_dark(grey, uv, r, c) for r, c in ways]
    possible = [k for k, g in enumerate(guesses) if side_seen(testfield, g) == side]
    return uv.reshape(-1, 2), tuple(guesses[k] for k in [k for k in possible if usual[k]] or possible)


def _first_dark(grey: NDArray[np.uint8], uv: Array, row: NDArray[np.int64], col: NDArray[np.int64]) -> bool:
    """Whether the square beside the first corner is dark, as boards are usually printed."""
    middle = (uv[1:, 1:] + uv[:-1, :-1] + uv[1:, :-1] + uv[:-1, 1:]) / 4
    u, v = np.rint(middle).astype(int).reshape(-1, 2).T
    first = np.minimum(row[1:, 1:], row[:-1, :-1]) + np.minimum(col[1:, 1:], col[:-1, :-1])
    even = (first % 2 == 0).ravel()
    value = grey[v, u].astype(float)
    return bool(value[even].mean() < value[~even].mean())


def _guess_tagged(
    image: NDArray, testfield: Testfield, camera: DeviceSpec, known: Sequence[Seed], side: str
) -> tuple[Array, Guesses]:
    """Place the board by its tags."""
    grey = _eight_bits(image)
    best: tuple[int, Array, Array] | None = None
    seen: Array = np.zeros((0, 2))
    size = next((n for n in SIZES if n >= len(_tagged_squares(testfield, False))), SIZES[-1])
    for family in FAMILIES:
        if best is not None and best[0] >= ENOUGH_TAGS:
            break
        tags, ids, _ = _detector(family.format(size)).detectMarkers(grey)
        if ids is None or len(ids) < max(LEAST_TAGS, 0 if best is None else best[0]):
            continue
        centres = np.array([_crossing(tag.reshape(4, 2)) for tag in tags])
        for first_black in (True, False):
            squares = _tagged_squares(testfield, first_black)
            use = np.flatnonzero(ids.ravel() < len(squares))
            if len(use) < LEAST_TAGS:
                continue
            places = squares[ids.ravel()[use]]
            H, fits = cv2.findHomography(places, centres[use], cv2.RANSAC, _square_px(centres[use], places) * 0.3)
            if H is None or fits.sum() < LEAST_TAGS:
                continue
            if best is None or fits.sum() > best[0]:
                best, seen = (int(fits.sum()), np.asarray(H, np.float64), places[fits.ravel() > 0]), centres
    if best is None:
        return seen, ()
    _, H, near = best
    corner = np.column_stack([testfield.col, testfield.row]).astype(np.float64)
    uv = _mapped(H, corner)
    inside = np.all((uv > 4) & (uv < np.array([camera.width, camera.height]) - 5), axis=1)
    beside = np.min(np.linalg.norm(corner[:, None] - near[None], axis=2), axis=1) < 0.8
    usable = np.flatnonzero(inside & beside)
    fine = _refined(grey, uv[usable], 3)
    half = np.stack([_mapped(H, corner[usable] + step) - uv[usable] for step in ((0.5, 0.0), (0.0, 0.5))], axis=2)
    near = np.linalg.norm(fine - uv[usable], axis=1) < 2 * OFF * np.linalg.svd(half, compute_uv=False)[:, 1]
    clear = near & _alternates(grey, fine, half)  # not covered
    usable, fine = usable[clear], fine[clear]
    if len(usable) < 4:
        return seen, ()
    at = corner[usable]
    chosen = list(dict.fromkeys(int(np.argmax(a * at[:, 0] + b * at[:, 1])) for a, b in _CORNERS))
    seeds = tuple(
        Seed(int(testfield.row[usable[k]]), int(testfield.col[usable[k]]), float(fine[k, 0]), float(fine[k, 1]))
        for k in chosen
    )
    return seen, (seeds,) if len(seeds) == 4 else ()


_CORNERS = ((-1.0, -1.01), (1.0, -1.01), (1.0, 1.01), (-1.0, 1.01))


@cache
def _detector(name: str) -> Any:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}"))
    return cv2.aruco.ArucoDetector(dictionary)


def _mapped(H: Array, at: Array) -> Array:
    return np.asarray(cv2.perspectiveTransform(at.reshape(-1, 1, 2), H), np.float64).reshape(-1, 2)


def _crossing(tag: Array) -> Array:
    """Where the diagonals of a tag cross: the image of its centre."""
    a, b, c, d = tag.astype(np.float64)
    share = np.linalg.solve(np.column_stack([c - a, b - d]), b - a)[0]
    return np.asarray(a + share * (c - a))


def _tagged_squares(testfield: Testfield, first_black: bool) -> Array:
    """Middles (k, 2) of the white squares by the tags' numbers, in columns and rows of corners."""
    rows, cols = int(testfield.row.max()) + 2, int(testfield.col.max()) + 2
    black = 0 if first_black else 1
    return np.array([(x - 0.5, y - 0.5) for y in range(rows) for x in range(cols) if (x + y) % 2 != black])


def _square_px(uv: Array, places: Array) -> float:
    """Side of a square in px, about."""
    linear = np.linalg.lstsq(np.column_stack([places, np.ones(len(places))]), uv, rcond=None)[0][:2]
    return float(max(np.sqrt(abs(np.linalg.det(linear))), 4.0))


# ------------------------------------------------------------------------------------------------------ measuring


def _measure(radius: float, sight: Sight, seeds: Sequence[Seed]) -> Marks:
    """Find all corners outwards from the picks, and fit them."""
    board, camera = sight.board, sight.camera
    picks = check_picks(board, seeds, (camera.width, camera.height), sight.where, sight.options.side)
    view = first_view(camera, board.xyz_mm[picks.target], picks.uv)
    if view is None:
        raise NotRecognisedError(sight.where, "no view of the board has the picks where they are", "correct them")
    uv, view = _outwards(_eight_bits(sight.image), board, view, picks.target, picks.uv)
    known = np.flatnonzero(np.isfinite(uv[:, 0]))
    if len(known) < 4:
        seen = f"{len(known)} corners where the picks predict them"
        raise NotRecognisedError(sight.where, seen, "pick corners where four squares meet")
    side = 2 * board.radius_mm[known]
    axes = view.jacobian(board.xyz_mm[known])
    square_px = side * np.linalg.svd(axes, compute_uv=False)[:, 1]
    radius_px = np.clip(radius * square_px, LEAST_RADIUS_PX, MOST_RADIUS_PX)
    fit = fit_saddles(sight.image, uv[known], axes, radius_px)
    missing = _missing(sight, view, np.setdiff1d(np.arange(len(board.row)), known))
    with np.errstate(invalid="ignore"):
        noise = float(np.median(fit.rest))
        dim = ~(np.abs(fit.contrast) > LEAST_CONTRAST * noise)
        rough = ~(fit.rest < ROUGH * np.abs(fit.contrast)) | ~np.isfinite(fit.uv[:, 0])
    for bad, why in ((dim, "no contrast"), (rough, "it is not a corner of four even squares: covered or disturbed")):
        missing |= dict.fromkeys(known[bad].tolist(), why)
    good = ~(dim | rough) & ~np.isin(known, list(sight.unwanted))
    area = axes * (radius_px / square_px * side)[:, None, None]
    one = np.ones(int(good.sum()))
    return Marks(
        known[good], fit.uv[good], fit.cov[good], area[good], one, fit.blur[good], 0 * fit.uv[good],
        missing | dict.fromkeys(sorted(sight.unwanted), EXCLUDED),
    )  # fmt: skip


def _outwards(
    grey: NDArray[np.uint8], board: Board, view: View, start: NDArray[np.int64], start_uv: Array
) -> tuple[Array, View]:
    """Corners (n, 2) to about a tenth of a pixel, NaN where there is none; the view that fits them.

    What the view leaves over at the nearest known corner moves the prediction: a lens is smooth.
    """
    height, width = grey.shape
    uv = np.full((len(board.row), 2), np.nan)
    reached = np.zeros(len(board.row), bool)
    reached[start] = True
    known, known_uv = start, start_uv
    spacing = float(np.median(board.spacing_mm))
    before = -1
    while before < (before := int(np.isfinite(uv[:, 0]).sum())) or before == 0:
        expected, axes = view.project(board.xyz_mm), view.jacobian(board.xyz_mm)
        gap = np.linalg.norm(board.xyz_mm[:, None] - board.xyz_mm[known][None], axis=2)
        expected += (known_uv - expected[known])[gap.argmin(axis=1)]
        square = 2 * board.radius_mm * np.linalg.svd(axes, compute_uv=False)[:, 1]
        with np.errstate(invalid="ignore"):
            inside = np.all((expected > 3) & (expected < np.array([width, height]) - 4), axis=1)
        tried = np.flatnonzero(reached & inside & (square > 4))
        uv[:] = np.nan
        if not len(tried):
            break
        half = int(np.clip(np.median(square[tried]) * 0.2, 2, 8))
        at = _refined(grey, expected[tried], half)
        near = np.linalg.norm(at - expected[tried], axis=1) < OFF * square[tried]
        keep = near & _alternates(grey, at, axes[tried] * board.radius_mm[tried, None, None])
        if known is start:  # four picks are few for the view that this looks by
            keep = near
        if keep.sum() < 4:
            break
        uv[tried[keep]] = at[keep]
        known = np.flatnonzero(np.isfinite(uv[:, 0]))
        known_uv = uv[known]
        view = fit_both_tilts(view, board.xyz_mm[known], known_uv, radial=len(known) >= 12)
        reached |= (
            np.linalg.norm(board.xyz_mm[:, None] - board.xyz_mm[known][None], axis=2).min(axis=1) < REACH * spacing
        )
    return uv, view


def _refined(grey: NDArray[np.uint8], uv: Array, half: int) -> Array:
    """Move places (n, 2) onto the corners next to them."""
    if not len(uv):
        return uv
    start = np.ascontiguousarray(uv, np.float32).reshape(-1, 1, 2).copy()
    moved = cv2.cornerSubPix(grey, start, (half, half), (-1, -1), (3, 30, 0.005))
    return np.asarray(moved, np.float64).reshape(-1, 2)


def _alternates(grey: NDArray[np.uint8], uv: Array, half: Array) -> NDArray[np.bool_]:
    """Whether the four squares around are dark and bright in turn, shape (n,)."""
    values = []
    for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        u, v = (uv + 0.25 * (half @ np.array([x, y], np.float64))).astype(np.float32).T
        values.append(cv2.remap(grey, u[:, None].copy(), v[:, None].copy(), cv2.INTER_LINEAR).ravel().astype(float))
    a, b, c, d = values
    return np.asarray((np.minimum(a, c) > np.maximum(b, d)) | (np.minimum(b, d) > np.maximum(a, c)))


def _missing(sight: Sight, view: View, rest: NDArray[np.int64]) -> dict[int, str]:
    expected = view.project(sight.board.xyz_mm[rest])
    with np.errstate(invalid="ignore"):
        inside = np.all((expected > 3) & (expected < [sight.camera.width - 4, sight.camera.height - 4]), axis=1)
    words = ("outside the image", "no corner where its neighbours predict it: covered, or without contrast")
    return {int(t): words[int(there)] for t, there in zip(rest, inside, strict=True)}


def _nearest(
    image: NDArray, testfield: Testfield, uv: tuple[float, float], reach_px: float
) -> tuple[float, float] | None:
    window = int(np.clip(reach_px, 2, 8))
    if not (window < uv[0] < image.shape[1] - window - 1 and window < uv[1] < image.shape[0] - window - 1):
        return None
    at = _refined(_eight_bits(image), np.array([uv], np.float64), window)[0]
    return (float(at[0]), float(at[1])) if np.hypot(at[0] - uv[0], at[1] - uv[1]) <= reach_px else None


CHESSBOARD = TargetKind("corners", _guess_plain, lambda sight, seeds: _measure(PLAIN, sight, seeds), _nearest)
CHARUCO = TargetKind("tags", _guess_tagged, lambda sight, seeds: _measure(TAGGED, sight, seeds), _nearest, coded=True)
