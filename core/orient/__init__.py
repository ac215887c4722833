"""Has the rig moved? Told by any capture with columns and rows, of an object that need not be known.

A pixel with both projector coordinates gives four observations for the three unknowns of its point. The fourth is the
epipolar residual: how far the projector's ray passes by the camera's. All pixels together show five of the six elements
of the relative orientation; the length of the base, and with one scene the focal lengths, fit any residual.

residuals.py  points and epipolar residuals of the image's places, and how they change with the calibration
known.py      lengths and points that are known, as observations
freedom.py    what may have changed, by how much rigs drift, and what chance explains
equations.py  the linear estimate, its covariance, and what neighbours share
motion.py     the test of the calibrated orientation, and the corrected one with its covariance
rig.py        all devices of a rig corrected together
register.py   how the rig stood in captures of one object, from targets and the surface; starts in starts.py,
              patches of a surface in surface.py
chart.py      captures one after the other, each held against those before it
"""

from core.orient.chart import Expectation, drift_chart, expectation_of, judged
from core.orient.freedom import OrientOptions
from core.orient.known import LENGTHS, lines_at
from core.orient.motion import find_motion
from core.orient.register import View, apart, register
from core.orient.rig import correct_rig
from core.orient.starts import starts_of

__all__ = [
    "LENGTHS", "Expectation", "OrientOptions", "View", "apart", "correct_rig", "drift_chart", "expectation_of",
    "find_motion", "judged", "lines_at", "register", "starts_of",
]  # fmt: skip
