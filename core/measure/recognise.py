"""The targets of one image without picks: guesses of its picks, measured until one holds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.errors import InputError, NotRecognisedError
from core.measure.kinds import kind_of
from core.measure.picks import Side
from core.measure.targets import measure_targets
from core.measure.turns import SAME, Labelling, labelling_between, symmetries
from core.model import DeviceSpec, MissingTarget, PhaseMap, TargetSet, Testfield

MOST_TRIES = 4  # guesses that are measured until one holds
LEAST = 4  # targets measured, for a guess to hold


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
        If the board cannot be recognised.
    """
    kind = kind_of(testfield, capture or "testfield.csv")
    facing = "back" if side == "back" else "front"
    seen = 0
    for image in (phase, _mirrored(phase)) if kind.coded else (phase,):  # what is not coded has no mirror image
        seen_uv, guesses = kind.guess(image.image, testfield, camera, (), facing)
        seen = len(seen_uv) if image is phase else seen
        for guess in guesses[:MOST_TRIES]:
            try:
                found = measure_targets(
                    image,
                    testfield,
                    guess,
                    camera,
                    projector=projector,
                    capture=capture,
                    excluded=excluded,
                    side=side,
                )
            except InputError:
                continue
            if len(found.row) < LEAST:
                continue
            if image is not phase:
                raise NotRecognisedError(
                    capture or "image",
                    "the board is recognised in the image's mirror image only",
                    "mirror the frames back, or correct the testfield file if its x or y runs the other way",
                )
            cells = [[(seed.row, seed.col) for seed in other] for other in (guess, *guesses)]
            ways = [w for other in cells[1:] if (w := labelling_between(cells[0], other)) is not None and w != SAME]
            return found, (SAME, *dict.fromkeys(ways))
    what = f"{seen} {kind.plural} in order, which do not fit the board" if seen else f"no {kind.plural} in order"
    raise NotRecognisedError(
        capture or "image",
        f"the board is not recognised: {what}",
        "see whether its testfield file is of this board, in mm, or pick 4 targets",
    )


def _mirrored(phase: PhaseMap) -> PhaseMap:
    """The same seen in a mirror."""
    planes = (phase.u, phase.v, phase.sigma_u, phase.sigma_v, phase.modulation, phase.image)
    u, v, sigma_u, sigma_v, modulation, image = (np.ascontiguousarray(plane[:, ::-1]) for plane in planes)
    return PhaseMap(u, v, sigma_u, sigma_v, modulation, image, np.ascontiguousarray(phase.flags[:, ::-1]))


def labellings(testfield: Testfield, where: str = "testfield.csv") -> tuple[Labelling, ...]:
    """Give the labellings by which a picked board may look the same, its own first."""
    return (SAME,) if kind_of(testfield, where).coded else (SAME, *symmetries(testfield))


def unmeasured(testfield: Testfield, capture: str, why: str) -> TargetSet:
    """Give the result of a capture that tells nothing: all targets are missing, for one reason."""
    none, pairs = np.zeros(0, np.int64), np.zeros((0, 2))
    missing = tuple(MissingTarget(row, col, why) for row, col in testfield.keys)
    empty = TargetSet(capture, none, none, pairs, np.zeros((0, 2, 2)), pairs, pairs, pairs, np.zeros(0), missing)
    return replace(empty, gradient=np.zeros((0, 2, 2)))
