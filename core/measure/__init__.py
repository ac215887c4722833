"""From four picked targets, or none, to all visible ones: who is who, where exactly, and where the projector sees them.

targets.py    `measure_targets`, the whole stage from top to bottom
board.py      the nominal testfield, checked, with everyone's neighbours
kinds         what a kind of target is, one file each: dots, rings, chessboard, tags
identity      who is who
centres       where exactly
projector.py  projector coordinates from the phase maps
rows.py       how far whole rows of the image are shifted, and what is read in them
missing.py    why a target was not measured, in words
features.py   edges of the evenly lit image on the measured surface: holes, marks, lines
outlines.py   the forms of these edges in the image, straight ones as the lens bends them
"""

from core.measure.centres.circles import eccentricity, recentred
from core.measure.centres.estimators import ESTIMATORS
from core.measure.features import find_circles, measure_feature
from core.measure.identity.propose import find_dots, propose_picks
from core.measure.identity.recognise import labellings, recognise, unmeasured
from core.measure.identity.single import dot_at, measured_view, predicted_view
from core.measure.identity.turns import SAME, Labelling, Turned, placed, solve_turns, symmetries, unturned
from core.measure.identity.view import View
from core.measure.kinds import TARGET_KINDS, Marks, Sight, TargetKind, kind_of
from core.measure.missing import OUTSIDE
from core.measure.outlines import checked_place
from core.measure.targets import measure_targets

__all__ = [
    "ESTIMATORS", "OUTSIDE", "SAME", "TARGET_KINDS", "Labelling", "Marks", "Sight", "TargetKind", "Turned", "View",
    "checked_place", "dot_at", "eccentricity", "find_circles", "find_dots", "kind_of", "labellings", "measure_feature",
    "measure_targets", "measured_view", "placed", "predicted_view", "propose_picks", "recentred", "recognise",
    "solve_turns", "symmetries", "unmeasured", "unturned",
]  # fmt: skip
