"""Boards of coded tags: the targets are corners, each tag tells where on the board it is; any four tags will do.

`charuco`: corners of a chessboard's squares, every white one with a tag, numbered from the first as OpenCV prints them.
`aprilgrid`: the corners of AprilTags (36h11) in rows, joined by small black squares, as Kalibr prints them. `tags`: the
corners of free-standing tags in rows, OpenCV's grid boards. Corners of tag number n have the rows 2 (n // m) and one
more and the columns 2 (n % m) and one more, with m tags in a row; `diameter_mm` is the gap between tags.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import InputError, NotRecognisedError
from core.lazy import dataclass
from core.measure.board import Board
from core.measure.kinds.chessboard import (
    ASIDE,
    CornerShape,
    drawn_squares,
    eight_bits,
    is_corner,
    measure_corners,
    nearest_corner,
    refined,
    spread,
)
from core.measure.kinds.kind import Guesses, Patch, TargetKind
from core.model import Array, DeviceSpec, Seed, Testfield

FAMILIES = ("5X5_{}", "4X4_{}", "6X6_{}", "7X7_{}", "APRILTAG_36h11")
SIZES = (50, 100, 250, 1000)  # of dictionaries: each begins with the smaller ones, and takes longer to look through
LEAST_TAGS = 4
ENOUGH_TAGS = 10  # that fit one board: no other family is looked for
SOFT_PX = 1.0
BESIDE = 0.8  # sides of a tag's square from its middle to a corner of it
NEAR = 0.15  # sides that a corner may lie off the place that the tags foretell
TAGGED = 0.17  # radius that counts, in squares: beyond it are the tags
UNLIKE = 0.05  # part by which a tag's side may differ from what the file says of tags and gaps
TELLING_PX = 12.0  # side of a tag from which its size is told so well
SHARE = 0.7  # of a square that a printed tag fills
FRAMED = 0.16  # radius that counts, in sides of a tag: beyond it its cells may be white


@dataclass(frozen=True)
class Layout:
    """How a kind of board carries its tags.

    `families` are the dictionaries and black frames, in cells, that are tried; `places` gives the corners (n, 2) in
    sides of a tag's square, the middles (k, 2) of the tags by number for each way that such a board is printed, and the
    side, mm; `sized` says that this is the tag's own. `step_px` is how much larger each window is whose mean tells dark
    from bright, of 3 to 23 px.
    """

    families: tuple[tuple[str, int], ...]
    places: Callable[[Testfield], tuple[Array, tuple[Array, ...], float]]
    shape: CornerShape
    step_px: int = 10
    sized: bool = True


def _on_squares(testfield: Testfield) -> tuple[Array, tuple[Array, ...], float]:
    rows, cols = int(testfield.row.max()) + 2, int(testfield.col.max()) + 2
    squares = [(x - 0.5, y - 0.5) for y in range(rows) for x in range(cols)]
    of_ways = [np.array(squares)[[(x + y) % 2 != black for y in range(rows) for x in range(cols)]] for black in (0, 1)]
    corners = np.column_stack([testfield.col, testfield.row]).astype(np.float64)
    return corners, tuple(of_ways), float(np.median(testfield.diameter_mm))


def _in_rows(testfield: Testfield) -> tuple[Array, tuple[Array, ...], float]:
    """Places in mm over the side of a tag; a tag without all its corners is nowhere."""
    index, across = testfield.index(), int(testfield.col.max()) // 2 + 1
    corners = np.full((across * (int(testfield.row.max()) // 2 + 1), 4, 2), np.nan)
    for (row, col), i in index.items():
        corners[row // 2 * across + col // 2, row % 2 * 2 + col % 2] = testfield.xyz_mm[i, :2]
    side = float(np.nanmedian(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)))
    return testfield.xyz_mm[:, :2] / side, (corners.mean(axis=1) / side,), side


def _framed_mm(board: Board) -> Array:
    """Radius on the board within which a tag's corner has its frame on one side and its gap on the others."""
    other = [board.index.get((r ^ 1, c), i) for i, (r, c) in enumerate(board.index)]
    side = np.linalg.norm(board.xyz_mm[other] - board.xyz_mm, axis=1)
    return np.asarray(np.minimum(FRAMED * side, 1.6 * board.radius_mm))


CHARUCO_LAYOUT = Layout(
    tuple((family, 1) for family in FAMILIES),
    _on_squares,
    CornerShape(lambda board: 2 * TAGGED * board.radius_mm, rough=0.12),
    sized=False,
)
APRILGRID_LAYOUT = Layout(  # blur joins its tags by their corners, and few windows part them
    (("APRILTAG_36h11", 2), ("APRILTAG_36h11", 1)), _in_rows, CornerShape(_framed_mm), step_px=2
)
TAGS_LAYOUT = Layout(
    (("APRILTAG_36h11", 1), *((family, 1) for family in FAMILIES[:-1])), _in_rows, CornerShape(_framed_mm, single=True)
)


def _guess(
    layout: Layout, image: NDArray, testfield: Testfield, camera: DeviceSpec, known: Sequence[Seed], side: str
) -> tuple[Array, Guesses]:
    """Place the board by its tags.

    Raises
    ------
    NotRecognisedError
        If the tags are of another size, beside the gaps between them, than the testfield says.
    """
    grey = eight_bits(image)
    best: tuple[int, Array, Array, Array, Array] | None = None
    seen: Array = np.zeros((0, 2))
    corner, ways, _ = layout.places(testfield)
    for family, frame in layout.families:
        if best is not None and best[0] >= ENOUGH_TAGS:
            break
        tags, ids = _found(_detector(_dictionary(family, len(ways[0])), frame, layout.step_px), grey)
        if ids is None or len(ids) < max(LEAST_TAGS, 0 if best is None else best[0]):
            continue
        centres = np.array([_crossing(tag.reshape(4, 2)) for tag in tags])
        for squares in ways:
            use = np.flatnonzero(ids.ravel() < len(squares))
            use = use[np.isfinite(squares[ids.ravel()[use], 0])]
            if len(use) < LEAST_TAGS:
                continue
            places = squares[ids.ravel()[use]]
            H, fits = cv2.findHomography(places, centres[use], cv2.RANSAC, _square_px(centres[use], places) * 0.3)
            if H is None or fits.sum() < LEAST_TAGS:
                continue
            if best is None or fits.sum() > best[0]:
                fit = fits.ravel() > 0
                quads = np.array(tags, np.float64).reshape(-1, 4, 2)[use[fit]]
                best = (int(fits.sum()), np.asarray(H, np.float64), places[fit], centres[use[fit]], quads)
                seen = centres
    if best is None:
        return seen, ()
    _, H, near, near_uv, quads = best
    if layout.sized and 2 * len(near) > len(seen):
        _check_size(grey, H, near, quads)
    away = np.linalg.norm(corner[:, None] - near[None], axis=2)
    own = away.argmin(axis=1)
    uv = _mapped(H, corner) + (near_uv - _mapped(H, near))[own]  # a lens is smooth
    inside = np.all((uv > 4) & (uv < np.array([camera.width, camera.height]) - 5), axis=1)
    usable = np.flatnonzero(inside & (away.min(axis=1) < BESIDE))
    fine = refined(grey, uv[usable], 3)
    arms = np.stack([_mapped(H, corner[usable] + step) for step in ((1.0, 0.0), (0.0, 1.0))], axis=2)
    arms -= _mapped(H, corner[usable])[..., None]
    clear = np.linalg.norm(fine - uv[usable], axis=1) < NEAR * np.linalg.svd(arms, compute_uv=False)[:, 1]
    arms *= TAGGED / 2 / ASIDE * np.sign(near[own[usable]] - corner[usable])[:, None]
    clear &= is_corner(grey, fine, arms, layout.shape.single)  # not covered
    usable, fine = usable[clear], fine[clear]
    if len(usable) < 4:
        return seen, ()
    at = corner[usable]
    chosen = spread(at)
    seeds = tuple(
        Seed(int(testfield.row[usable[k]]), int(testfield.col[usable[k]]), float(fine[k, 0]), float(fine[k, 1]))
        for k in chosen
    )
    return seen, (seeds,) if len(seeds) >= 4 else ()


def _check_size(grey: NDArray[np.uint8], H: Array, places: Array, quads: Array) -> None:
    """Compare tags, outlines (n, 4, 2) px, with what the board's way to the image makes of their size."""
    foretold = _areas(_mapped(H, places[:, None] + _UNIT - 0.5).reshape(-1, 4, 2))
    half = max(3, int(np.sqrt(np.median(foretold)) / 7))  # detected outlines cut corners off; gaps are a fifth and more
    found = _areas(refined(grey, quads.reshape(-1, 2), half).reshape(-1, 4, 2))
    ratio = float(np.sqrt(np.median(found / foretold)))
    if np.median(foretold) > TELLING_PX**2 and abs(ratio - 1) > UNLIKE:
        raise NotRecognisedError(
            "image",
            f"beside the gaps between them, the tags are {ratio:.2f} times as large as the testfield file says",
            "correct its coordinates: the size of the tags, or of the gaps, is another one",
        )


def _areas(quads: Array) -> Array:
    """Areas (n,) of quadrilaterals (n, 4, 2)."""
    (ax, ay), (bx, by) = ((quads[:, k + 2] - quads[:, k]).T for k in (0, 1))
    return np.asarray(np.abs(ax * by - ay * bx) / 2)


def _dictionary(family: str, tags: int) -> str:
    return family.format(next((n for n in SIZES if n >= tags), SIZES[-1]))


@cache
def _detector(name: str, frame: int, step_px: int) -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.markerBorderBits = frame
    parameters.adaptiveThreshWinSizeStep = step_px
    return cv2.aruco.ArucoDetector(_marks(name), parameters)


def _marks(name: str) -> Any:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}"))


def _found(detector: Any, grey: NDArray[np.uint8]) -> tuple[Sequence[Array], NDArray[np.intp] | None]:
    """The tags in an image, or in it softened: sharp frames of few pixels fall apart where grey values are parted."""
    tags, ids, _ = detector.detectMarkers(grey)
    if ids is not None and len(ids) >= ENOUGH_TAGS:
        return tags, ids
    softer, of_softer, _ = detector.detectMarkers(cv2.GaussianBlur(grey, (0, 0), SOFT_PX))
    more = of_softer is not None and (ids is None or len(of_softer) > len(ids))
    return (softer, of_softer) if more else (tags, ids)


def _mapped(H: Array, at: Array) -> Array:
    return np.asarray(cv2.perspectiveTransform(at.reshape(-1, 1, 2), H), np.float64).reshape(-1, 2)


def _crossing(tag: Array) -> Array:
    """Where the diagonals of a tag cross: the image of its centre."""
    a, b, c, d = tag.astype(np.float64)
    share = np.linalg.solve(np.column_stack([c - a, b - d]), b - a)[0]
    return np.asarray(a + share * (c - a))


def _square_px(uv: Array, places: Array) -> float:
    """Side of a square in px, about."""
    linear = np.linalg.lstsq(np.column_stack([places, np.ones(len(places))]), uv, rcond=None)[0][:2]
    return float(max(np.sqrt(abs(np.linalg.det(linear))), 4.0))


# ------------------------------------------------------------------------------------------------------ printing


def _drawn_charuco(testfield: Testfield) -> tuple[Patch, ...]:
    """As OpenCV draws it, beginning with a black square."""
    corner, (places, _), side = _on_squares(testfield)
    to_mm = np.linalg.lstsq(np.column_stack([corner, np.ones(len(corner))]), testfield.xyz_mm[:, :2], rcond=None)[0]
    middles = np.column_stack([places, np.ones(len(places))]) @ to_mm
    return (*drawn_squares(testfield), *_drawn_tags(_dictionary(FAMILIES[0], len(places)), 1, middles, SHARE * side))


def _drawn_rows(layout: Layout, testfield: Testfield) -> tuple[Patch, ...]:
    _, (places,), side = layout.places(testfield)
    family, frame = layout.families[0]
    half_turn = not layout.shape.single  # Kalibr's tags stand on their head beside OpenCV's
    tags = _drawn_tags(_dictionary(family, len(places)), frame, places * side, side, half_turn)
    if layout.shape.single:
        return tags
    joints = {}  # up to four corners share one
    for x, y, gap in np.column_stack([testfield.xyz_mm[:, :2], testfield.diameter_mm]):
        middle = places[np.nanargmin(np.linalg.norm(places * side - (x, y), axis=1))] * side
        outline = (x, y) + gap * np.sign((x, y) - middle) * _UNIT
        joints[tuple(np.rint(outline.mean(axis=0) / gap * 4).tolist())] = Patch(outline, True)
    return (*tags, *joints.values())


_UNIT = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def _drawn_tags(name: str, frame: int, middles: Array, side: float, half_turn: bool = False) -> tuple[Patch, ...]:
    """Tags upright, X to the right and Y upwards: a dark square each, and its white cells joined along lines."""
    marks = _marks(name)
    most, n = len(marks.bytesList), marks.markerSize + 2 * frame
    if len(middles) > most:
        raise InputError("testfield", f"{len(middles)} tags", f"there are {most} of this kind: use fewer, larger ones")
    drawn = []
    for number in np.flatnonzero(np.isfinite(middles[:, 0])).tolist():
        first = middles[number] + np.array([-side / 2, side / 2])
        drawn.append(Patch(first + side * _UNIT * (1, -1), True))
        cells = cv2.aruco.generateImageMarker(marks, number, n, borderBits=frame) > 0
        cells = cells[::-1, ::-1] if half_turn else cells
        for i, row in enumerate(cells):
            steps = np.flatnonzero(np.diff(np.concatenate([[0], row, [0]]).astype(int)))
            for start, stop in steps.reshape(-1, 2):
                box = (np.array([start, i]) + _UNIT * (stop - start, 1)) * side / n
                drawn.append(Patch(first + box * (1, -1), False))
    return tuple(drawn)


def _kind(layout: Layout, drawn: Callable[[Testfield], tuple[Patch, ...]]) -> TargetKind:
    return TargetKind(
        "tags",
        partial(_guess, layout),
        partial(measure_corners, layout.shape),
        nearest_corner,
        coded=True,
        drawn=drawn,
        round=False,
    )


CHARUCO = _kind(CHARUCO_LAYOUT, _drawn_charuco)
APRILGRID = _kind(APRILGRID_LAYOUT, partial(_drawn_rows, APRILGRID_LAYOUT))
TAGS = _kind(TAGS_LAYOUT, partial(_drawn_rows, TAGS_LAYOUT))
