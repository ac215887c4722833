"""Dots with a coded ring round them: twelve sectors, inked or not, tell which target it is; measured as dots are.

The ring reaches from 2 to 3 radii of the dot. A code is twelve bits with an even number of ones, the same however it is
turned; the targets that carry one have them in order of rows and columns. All do where rings have room and codes
suffice, else those of every second row and column, or third. `diameter_mm` is the dot's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import erfc

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.measure.identity.blobs import Blobs
from core.measure.identity.propose import bright_spots
from core.measure.kinds.dots import DOTS, measure_dots
from core.measure.kinds.kind import Guesses, Marks, Patch, Sight
from core.model import Array, DeviceSpec, Seed, Testfield

BITS = 12
INNER, OUTER = 2.0, 3.0  # radii of the ring, in those of the dot
ROOM = 6.6, 4.4  # radii of the dot from one coded target to the next, and to any other
TURNS = 8  # steps within a sector at which its edges are looked for
CLEAR = 0.16  # share of the contrast by which every sector must be off the middle between ink and ground
LEAST = 5  # coded targets that must agree
DRAWN = 0.15  # radii that a dot is drawn by, as standard deviation, per share of ink in the ground round it


def _least_turn(code: int) -> int:
    return min((code >> k | code << BITS - k) & (1 << BITS) - 1 for k in range(BITS))


CODES = [c for c in range(1, (1 << BITS) - 1) if c.bit_count() % 2 == 0 and c == _least_turn(c)]


def coded_targets(testfield: Testfield) -> dict[int, int]:
    """Targets (indices) of a board by their codes; InputError if they are so close that no ring has room."""
    xy, radius = testfield.xyz_mm[:, :2], float(testfield.diameter_mm.max()) / 2
    nearest = np.linalg.norm(xy[:, None] - xy, axis=2) + np.diag(np.full(len(xy), np.inf))
    if nearest.min() < ROOM[1] * radius:
        seen = f"targets {nearest.min():.4g} mm apart have no room for rings round dots of {2 * radius:.4g} mm"
        raise InputError("testfield", seen, f"leave {ROOM[1] * radius:.4g} mm, or write # kind: dots")
    order = np.lexsort([testfield.col, testfield.row])
    for step in range(1, len(order) + 1):
        of = order[(testfield.row[order] % step == 0) & (testfield.col[order] % step == 0)]
        if len(of) <= len(CODES) and nearest[np.ix_(of, of)].min() >= ROOM[0] * radius:
            break
    return dict(zip(CODES, of.tolist(), strict=False))


def _measure(sight: Sight, seeds: Sequence[Seed]) -> Marks:
    """Measure as dots whose next neighbours are as near as the rings."""
    radius = sight.board.radius_mm
    near = np.minimum((1 + INNER) * radius, sight.board.spacing_mm + (1 - OUTER) * radius)
    marks = measure_dots(replace(sight, board=replace(sight.board, spacing_mm=near)), seeds, coded=True)
    # blurred ink of a ring, on one side or the other, slopes the ground that a dot's weights are taken from
    minor = np.linalg.svd(marks.ellipse, compute_uv=False)[:, 1]
    free = (near / radius)[marks.target] - 1 - marks.window
    sloped = DRAWN * minor * np.vectorize(erfc, [float])(np.maximum(free, 0.0) * minor / (marks.blur * np.sqrt(2))) / 2
    return replace(marks, cov=marks.cov + (sloped**2)[:, None, None] * np.eye(2), code=INNER)


def _guess(
    image: NDArray, testfield: Testfield, camera: DeviceSpec, known: Sequence[Seed], side: str
) -> tuple[Array, Guesses]:
    """Read the rings, and keep those that lie as the board has them."""
    grey = np.nan_to_num(np.asarray(image, np.float32))
    grey = -grey if testfield.polarity == "black-on-white" else grey
    at = coded_targets(testfield)
    spots = bright_spots(grey)
    codes = read_codes(grey, spots)
    use = np.array([k for k, code in enumerate(codes) if code in at], np.int64)
    if len(use) < LEAST:
        return spots.uv[use], ()
    target, uv = np.array([at[codes[k]] for k in use]), spots.uv[use]
    radius_px = float(np.sqrt(np.median(spots.area_px[use]) / np.pi))
    fits = cv2.findHomography(testfield.xyz_mm[target, :2], uv, cv2.RANSAC, radius_px)[1]
    good = np.flatnonzero(fits) if fits is not None else np.zeros(0, np.int64)
    if len(good) < LEAST:
        return uv, ()
    place = testfield.xyz_mm[target[good], :2]
    chosen = list(dict.fromkeys(int(good[np.argmax(place @ way)]) for way in _WAYS))
    seeds = tuple(
        Seed(int(testfield.row[target[k]]), int(testfield.col[target[k]]), *np.round(uv[k], 3).tolist()) for k in chosen
    )
    return uv[good], (seeds,) if len(seeds) == len(_WAYS) else ()


_WAYS = np.array([(-1.0, 1.01), (1.0, 1.01), (1.0, -1.01), (-1.0, -1.01)])


def read_codes(image: NDArray[np.float32], spots: Blobs) -> list[int]:
    """Codes of the rings round spots, 0 where there is none.

    A spot's second moments give the ellipse in whose multiples the ring lies; sectors are told where every one is
    clearly ink or ground, for some turn.
    """
    values, vectors = np.linalg.eigh(spots.cov_px2)
    unit = 2 * (vectors * np.sqrt(np.maximum(values, 1e-6))[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    angle = -np.arange(BITS * TURNS) * (2 * np.pi / (BITS * TURNS))  # v points down: as seen from the front
    ways = np.stack([np.cos(angle), np.sin(angle)])
    radii = np.array([0.0, 1.4, 1.5, 1.6, 2.3, 2.5, 2.7])
    at = spots.uv[:, None, :, None] + radii[:, None, None] * (unit @ ways)[:, None]  # (n, radii, 2, angles)
    u, v = (np.ascontiguousarray(at[:, :, k].reshape(-1, len(angle)), np.float32) for k in (0, 1))
    value = np.concatenate(  # in parts: a picture for OpenCV has 32767 lines at most
        [
            cv2.remap(image, u[k : k + 30000], v[k : k + 30000], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            for k in range(0, len(u), 30000)
        ]
    ).reshape(at.shape[0], len(radii), len(angle))
    ground, ink = np.median(value[:, 1:4], axis=(1, 2)), value[:, 0, 0]
    contrast = np.where(ink == ground, np.nan, ink - ground)
    share = (value - ground[:, None, None]) / contrast[:, None, None]
    even = np.abs(share[:, 1:4].mean(axis=1)).max(axis=1) < 0.5  # nothing between dot and ring
    ring = share[:, 4:].mean(axis=1)
    turned = np.stack([np.roll(ring, -k, axis=1) for k in range(TURNS)], axis=1).reshape(len(ring), TURNS, BITS, TURNS)
    level = turned[..., 1:-1].mean(axis=3)
    clear = np.abs(level - 0.5).min(axis=2)
    best = np.nan_to_num(clear, nan=0.0).argmax(axis=1)
    each = np.arange(len(ring))
    bits = level[each, best] > 0.5
    told = even & (clear[each, best] > CLEAR)
    return [_least_turn(int(b @ (1 << np.arange(BITS)))) if t else 0 for b, t in zip(bits, told, strict=True)]


def _drawn(testfield: Testfield) -> tuple[Patch, ...]:
    drawn = []
    for turn, (code, i) in enumerate(coded_targets(testfield).items()):
        code = (code << 5 * turn % BITS | code >> BITS - 5 * turn % BITS) & (1 << BITS) - 1  # ink on all sides in turn
        start = next(k for k in range(BITS) if not code >> k & 1)  # in a gap: no run of ones is cut
        k = start + 1
        while k < start + BITS:
            stop = next(j for j in range(k, start + BITS + 1) if not code >> j % BITS & 1)
            if stop > k:
                angle = np.linspace(k, stop, 15 * (stop - k) + 1) * (2 * np.pi / BITS)
                arc = np.column_stack([np.cos(angle), np.sin(angle)]) * testfield.diameter_mm[i] / 2
                drawn.append(Patch(testfield.xyz_mm[i, :2] + np.concatenate([INNER * arc, OUTER * arc[::-1]]), True))
            k = stop + 1
    return tuple(drawn)


RINGS = replace(DOTS, plural="rings", guess=_guess, measure=_measure, coded=True, drawn=_drawn)
