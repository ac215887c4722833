"""The targets of one image without picks: guesses of its picks, measured until one holds."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import InputError, NotRecognisedError
from core.measure.board import board_from_testfield
from core.measure.identity.picks import Side
from core.measure.identity.single import measured_view
from core.measure.identity.turns import SAME, Labelling, labelling_between, relabelled, symmetries
from core.measure.kinds import TARGET_KINDS, Guesses, kind_of
from core.measure.targets import measure_targets
from core.model import DeviceSpec, MissingTarget, PhaseMap, Seed, TargetSet, Testfield

LIKELY = ("chessboard", "dots")  # kinds without a code that are taken for others; squares look like dots, too
MOST_TRIES = 4  # guesses that are measured until one holds
LEAST = 4  # targets measured, for a guess to hold
ANOTHER = 0.25  # of the targets of a board, from which what looks like it elsewhere is another such board
MARGIN = 1.5  # spacings round the outermost targets that are of the board, too


def recognise(
    phase: PhaseMap,
    testfield: Testfield,
    camera: DeviceSpec,
    *,
    projector: DeviceSpec | None = None,
    capture: str = "",
    excluded: tuple[tuple[int, int], ...] = (),
    side: Side = "front",
) -> tuple[TargetSet, tuple[Labelling, ...]]:
    """Measure the targets of an image that nobody picked, labelled as one guess has it.

    Gives also that labelling, and all others by which the image looks as likely; `solve_turns` tells them apart.

    Raises
    ------
    NotRecognisedError
        If the board cannot be recognised, or two such boards are seen.
    """
    kind = kind_of(testfield)
    facing = "back" if side == "back" else "front"
    how: dict[str, Any] = {"projector": projector, "capture": capture, "excluded": excluded, "side": side}

    def held(image: PhaseMap, guesses: Guesses) -> tuple[Sequence[Seed], TargetSet] | None:
        for guess in guesses[:MOST_TRIES]:
            with suppress(InputError):
                found = measure_targets(image, testfield, guess, camera, **how)
                if len(found.row) >= LEAST:
                    return guess, found
        return None

    seen = 0
    for image in (phase, _mirrored(phase)) if kind.coded else (phase,):  # what is not coded has no mirror image
        try:
            seen_uv, guesses = kind.guess(image.image, testfield, camera, (), facing)
        except NotRecognisedError as error:
            raise NotRecognisedError(capture or "image", error.seen, error.remedy) from None
        seen = len(seen_uv) if image is phase else seen
        if not (first := held(image, guesses)):
            continue
        if image is not phase:
            raise NotRecognisedError(
                capture or "image",
                "the board is recognised in the image's mirror image only",
                "mirror the frames back, or correct the testfield file if its x or y runs the other way",
            )
        cells = [[(seed.row, seed.col) for seed in guess] for guess in (first[0], *guesses)]
        others = [w for other in cells[1:] if (w := labelling_between(cells[0], other)) is not None and w != SAME]
        found, ways = first[1], (SAME, *dict.fromkeys(others))
        own = _reach(testfield, camera, found, ways)
        rest = replace(phase, image=np.where(own, np.nanmedian(phase.image), phase.image).astype(np.float32))
        second = None
        with suppress(NotRecognisedError):  # what else is seen may be another board, whose tags are of another size
            second = held(rest, kind.guess(rest.image, testfield, camera, (), facing)[1])
        if second:
            u, v = np.rint(second[1].camera_uv).astype(int).T
            beside = np.count_nonzero(~own[v, u])
            if beside > ANOTHER * len(found.row):
                raise NotRecognisedError(
                    capture or "image",
                    f"two such boards are seen, {len(found.row)} targets of one and {beside} of the other",
                    "cover one of them, or pick 4 targets of the one that is meant",
                )
        return found, ways
    if (kind.round or not seen) and (like := _like(phase, testfield, camera, facing)):
        raise NotRecognisedError(
            capture or "image",
            f"the board looks like one of kind {like}, its testfield file says {testfield.kind}",
            f'write "# kind: {like}" if that file is of this board, or name the board that was captured',
        )
    other: Literal["white-on-black", "black-on-white"] = (
        "white-on-black" if testfield.polarity == "black-on-white" else "black-on-white"
    )
    if kind.round and kind.guess(phase.image, replace(testfield, polarity=other), camera, (), facing)[1]:
        raise NotRecognisedError(
            capture or "image",
            f"the board looks like one of polarity {other}, its testfield file says {testfield.polarity}",
            "correct it if that file is of this board, or pick 4 targets",
        )
    what = f"{seen} {kind.plural} in order, which do not fit the board" if seen else f"no {kind.plural} in order"
    raise NotRecognisedError(
        capture or "image",
        f"the board is not recognised: {what}",
        "see whether its testfield file is of this board, in mm, or pick 4 targets",
    )


def _reach(testfield: Testfield, camera: DeviceSpec, found: TargetSet, ways: Sequence[Labelling]) -> NDArray[np.bool_]:
    """Pixels (H, W) to which a board may reach, as any of its labellings has it."""
    board = board_from_testfield(testfield)
    margin = MARGIN * float(board.spacing_mm.max()) * np.array([(1, 1, 0), (1, -1, 0), (-1, -1, 0), (-1, 1, 0)])
    around = (board.xyz_mm[:, None] + margin).reshape(-1, 3)
    flat = replace(testfield, xyz_mm=board.xyz_mm)  # in the board's own plane, as is `around`
    inside = np.zeros((camera.height, camera.width), np.uint8)
    for way in ways:
        named = relabelled(found, way, testfield)
        view = None if named is None else measured_view(flat, camera, named)
        if view is not None:
            uv = view.project(around)
            outline = cv2.convexHull(np.clip(uv[np.isfinite(uv[:, 0])], -1e4, 1e5).astype(np.int32))
            cv2.fillConvexPoly(inside, outline, 1.0)
    return inside > 0


def _like(phase: PhaseMap, testfield: Testfield, camera: DeviceSpec, facing: str) -> str:
    """Name the other kind of targets, dots or corners, of which the board's rows and columns are seen; "" for none."""
    for name in LIKELY:
        if name == testfield.kind or (name == "dots" and TARGET_KINDS[testfield.kind].round):
            continue
        with suppress(InputError):
            if TARGET_KINDS[name].guess(phase.image, replace(testfield, kind=name), camera, (), facing)[1]:
                return name
    return ""


def _mirrored(phase: PhaseMap) -> PhaseMap:
    """The same seen in a mirror."""
    planes = (phase.u, phase.v, phase.sigma_u, phase.sigma_v, phase.modulation, phase.image)
    u, v, sigma_u, sigma_v, modulation, image = (np.ascontiguousarray(plane[:, ::-1]) for plane in planes)
    return PhaseMap(u, v, sigma_u, sigma_v, modulation, image, np.ascontiguousarray(phase.flags[:, ::-1]))


def labellings(testfield: Testfield) -> tuple[Labelling, ...]:
    """Give the labellings by which a picked board may look the same, its own first."""
    return (SAME,) if kind_of(testfield).coded else (SAME, *symmetries(testfield))


def unmeasured(testfield: Testfield, capture: str, why: str) -> TargetSet:
    """Give the result of a capture that tells nothing: all targets are missing, for one reason."""
    none, pairs = np.zeros(0, np.int64), np.zeros((0, 2))
    missing = tuple(MissingTarget(row, col, why) for row, col in testfield.keys)
    empty = TargetSet(capture, none, none, pairs, np.zeros((0, 2, 2)), pairs, pairs, pairs, np.zeros(0), missing)
    return replace(empty, gradient=np.zeros((0, 2, 2)))
