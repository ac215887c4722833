"""Has the rig moved? Told by any capture with columns and rows, of an object that need not be known.

A pixel with both projector coordinates gives four observations for the three unknowns of its point. The fourth is the
epipolar residual: how far the projector's ray passes by the camera's. All pixels together show five of the six elements
of the relative orientation; the length of the base, and with one scene the focal lengths, fit any residual.

residuals.py  the epipolar residual of every pixel, and how it changes with the orientation
motion.py     the test of the calibrated orientation, and the corrected one with its covariance
"""

from core.orient.motion import OrientOptions, corrected_pair, find_motion

__all__ = ["OrientOptions", "corrected_pair", "find_motion"]
