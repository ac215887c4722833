"""Wrong input is named: results are held against each other, against what is known and against their own prediction.

Every check gives concerns (`core.model.Concern`): a state and one sentence with the figure, the probable cause and the
remedy. The state of a verdict is that of its worst concern.

network.py   the bundle adjustment: chi-square test, systematic residuals, gross errors, nominal values
forms.py     ... what the images of each device say of what was not adjusted: both of the next
lens.py      ... whether its lens models have the right form
changed.py   ... whether c or the board was another one from some image on
lacking.py   terms that were not adjusted, from what residuals show of them
weights.py   ... sigmas of its images, and of both axes, against each other
given.py     ... a network against what its files give: known points and lengths, units, pixels, stations
lengths.py   scale bar, boards and plate positions: which of the known lengths is not like the others
placing.py   ... between which targets they lie, of boards that may be named another way
boards.py    ... which targets of a board or plate its file misplaces
plates.py    ... where the plates stood, seen by camera and projector
depth.py     ... and where the depth calibration has them; the camera that it has by them alone
volume.py    how sure a calibration is over the working volume, and how far two differ in it
planes.py    deviations from planes: form apart from noise, angles, one method against the other
sequences.py what captures say they show: code and the light's end against projector lines, their response
captures.py  the same frames twice, grey values unlike the others', dots' diameters as seen and as given
left_out.py  points and captures that had no part, with the reasons
"""

from core.checks.boards import exchanged_notes, misplaced_concerns, misplaced_on_plate
from core.checks.captures import grey_concerns, repeated_frames, repeated_planes, repeated_targets, size_concerns
from core.checks.depth import flatness_concerns, placed_concerns, travel_concerns
from core.checks.given import given_concerns
from core.checks.left_out import left_out_of, rejected_of
from core.checks.lengths import bar_notes, foreign_concerns, length_concerns
from core.checks.network import adjustment_concerns, nominal_concerns, sound_words
from core.checks.placing import mirrored_concerns, named_from_behind, turned_concerns
from core.checks.planes import form_of, is_noise, pair_concerns, plane_concerns, plane_words
from core.checks.plates import Plates, pose_plates, see_plates
from core.checks.sequences import code_concerns, end_notes, light_end, response_concerns
from core.checks.volume import bend_of_plane, depthless_concerns, fields_at, independent_errors
from core.checks.weights import uneven_axes

__all__ = [
    "Plates", "adjustment_concerns", "bar_notes", "bend_of_plane", "code_concerns", "depthless_concerns", "end_notes",
    "exchanged_notes", "fields_at", "flatness_concerns", "foreign_concerns", "form_of", "given_concerns",
    "grey_concerns", "independent_errors", "is_noise", "left_out_of", "length_concerns", "light_end",
    "mirrored_concerns", "misplaced_concerns", "misplaced_on_plate", "named_from_behind", "nominal_concerns",
    "pair_concerns", "placed_concerns", "plane_concerns", "plane_words", "pose_plates", "rejected_of",
    "repeated_frames", "repeated_planes", "repeated_targets", "response_concerns", "see_plates", "size_concerns",
    "sound_words", "travel_concerns", "turned_concerns", "uneven_axes",
]  # fmt: skip
