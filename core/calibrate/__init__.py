"""The calibrations: camera and projector as one photogrammetric system, and the depth of every pixel on its own.

photogrammetric.py  cameras and projectors calibrated together from the targets of moved boards
network.py    from measured targets to a network; selection.py leaves out and names what cannot be determined
adjust.py     the bundle adjustment of a network, by starts.py from those approximate values that help
approximate   approximate values of the unknowns
solution      the unknowns, their equations, the way to the solution, and its covariances
diagnosis     what is wrong with a network, what it does not determine, what more captures would bring
depth         the depth calibration, per pixel
"""

from core.calibrate.adjust import adjust
from core.calibrate.depth.calibration import DepthOptions, DepthPlane, calibrate_depth
from core.calibrate.diagnosis.left_out import LeftOut, leave_captures_out
from core.calibrate.diagnosis.next_pose import NextPose, next_poses
from core.calibrate.diagnosis.rigid import RigidityTest
from core.calibrate.network import network_from_targets
from core.calibrate.photogrammetric import CALIBRATION_OPTIONS, calibrate_photogrammetric
from core.calibrate.solution.solve import AdjustOptions

__all__ = [
    "CALIBRATION_OPTIONS", "AdjustOptions", "DepthOptions", "DepthPlane", "LeftOut", "NextPose", "RigidityTest",
    "adjust", "calibrate_depth", "calibrate_photogrammetric", "leave_captures_out", "network_from_targets",
    "next_poses",
]  # fmt: skip
