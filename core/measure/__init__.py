"""From four picked targets to all visible ones: who is who, where exactly, and where the projector sees them.

targets.py        `measure_targets`, the whole stage from top to bottom
kinds/            what a kind of target is, one file each: dots, rings, chessboard, tags
estimators.py     how a dot's centre follows from its pixels, by name
board.py          the nominal testfield, checked, with everyone's neighbours
picks.py          the operator's picks, checked and moved onto their dots
blobs.py          everything in the image that could be a dot
view.py           the approximate view of the board: pose and one radial parameter
identify.py       from the picks to a lattice that all picks agree on
grow.py           the lattice grows outwards, one confirmed target after the other
foretold.py       where targets should be by those around them, and which spots are there
rays.py           rays from the dots' centres, along which the image is sampled
profile.py        contour, blur, background and plateau of every dot
light.py          where the projector's light ends, in the camera's image
lighting.py       how much the light changes across bright dots
plateau.py        how much of it the middles of blurred dots still show
faults.py         dots that must not be measured, and why
corners.py        corners where straight edges cross or end; crossings.py finds those of a chessboard
ellipse.py        centres by the fit of a blurred ellipse
steps.py          the light of a curved, blurred edge in square pixels, and how surely it is placed
centroid.py       weighted centroid, its covariance, the image's noise
grain.py          raw images of colour cameras; noise that neighbours share
defocus.py        blur that changes across a dot, and what it draws
rows.py           how far whole rows of the image are shifted, and what is read in them
circles.py        the middle of an ellipse is not the image of the circle's centre
projector.py      projector coordinates from the phase maps
single.py         what an operator sees while picking: the dot at hand, the predicted grid
propose.py        a guess of the picks: the dots in order, laid onto the testfield
places.py         what an image shows where dots could be: faint ones, bare ground
recognise.py      an image that nobody picked
turns.py          which way round the board was held, told for all images together
missing.py        why a target was not measured, in words
features.py       edges of the evenly lit image on the measured surface: holes, marks, lines
outlines.py       the forms of these edges in the image, straight ones as the lens bends them
kernels.py        the two loops over pixels
"""

from core.measure.circles import eccentricity, recentred
from core.measure.estimators import ESTIMATORS
from core.measure.features import find_circles, measure_feature
from core.measure.kinds import TARGET_KINDS, Marks, Sight, TargetKind, kind_of
from core.measure.missing import OUTSIDE
from core.measure.outlines import checked_place
from core.measure.propose import find_dots, propose_picks
from core.measure.recognise import labellings, recognise, unmeasured
from core.measure.single import dot_at, measured_view, predicted_view
from core.measure.targets import measure_targets
from core.measure.turns import SAME, Labelling, Turned, placed, solve_turns, symmetries, unturned
from core.measure.view import View

__all__ = [
    "ESTIMATORS", "OUTSIDE", "SAME", "TARGET_KINDS", "Labelling", "Marks", "Sight", "TargetKind", "Turned", "View",
    "checked_place", "dot_at", "eccentricity", "find_circles", "find_dots", "kind_of", "labellings", "measure_feature",
    "measure_targets", "measured_view", "placed", "predicted_view", "propose_picks", "recentred", "recognise",
    "solve_turns", "symmetries", "unmeasured", "unturned",
]  # fmt: skip
