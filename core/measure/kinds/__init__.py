"""Kinds of target by the name that `# kind:` gives in a testfield's file; others may be added to `TARGET_KINDS`."""

from __future__ import annotations

from core.errors import InputError
from core.measure.centres.estimators import ESTIMATORS
from core.measure.kinds.chessboard import CHESSBOARD
from core.measure.kinds.dots import DOTS
from core.measure.kinds.kind import Guesses, Marks, Patch, Sight, TargetKind
from core.measure.kinds.rings import RINGS
from core.measure.kinds.tags import APRILGRID, CHARUCO, TAGS
from core.model import Testfield

TARGET_KINDS: dict[str, TargetKind] = {
    "dots": DOTS,
    "rings": RINGS,
    "chessboard": CHESSBOARD,
    "charuco": CHARUCO,
    "aprilgrid": APRILGRID,
    "tags": TAGS,
}


def kind_of(testfield: Testfield) -> TargetKind:
    """Look up the kind of a board's targets.

    Raises
    ------
    InputError
        If it, or the estimator of centres that the board names, is unknown.
    """
    for key, said, known in (("kind", testfield.kind, TARGET_KINDS), ("estimator", testfield.estimator, ESTIMATORS)):
        if said not in known:
            seen = f"the testfield's {key} of targets is {said!r}"
            raise InputError(testfield.file, seen, f'write "# {key}:" with one of {", ".join(known)}')
    return TARGET_KINDS[testfield.kind]


__all__ = ["TARGET_KINDS", "Guesses", "Marks", "Patch", "Sight", "TargetKind", "kind_of"]
