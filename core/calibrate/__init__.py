"""The calibrations: camera and projector as one photogrammetric system, and the depth of every pixel on its own.

Photogrammetric, by bundle adjustment:

* `network` makes a network of the measured targets, `selection` checks it and leaves out what cannot be determined;
* `problem` numbers the unknowns, `state` holds and moves them; `resection`, `stations`, `columns` and `initial` find
  approximate values for them;
* `equations` holds the observation equations with their derivatives, `normals` the normal equations, which
  `elimination` solves without the poses or, where there are very many points, without these;
* `datum` holds the inner constraints, `iterate` the way to the solution, `solve` all that is known of it;
* `shared` adds to the covariances what the targets of an image have in common;
* `covariance` and `snooping` judge it, `weakness` says in words what the network does not determine, `held` what is
  held and should not be, `rigid` whether the rig was rigid; `adjust`, which tries what helps where a solution does not
  fit, and `photogrammetric` put it all together;
* `left_out` says what the other captures foresee of one, `next_pose` what one more would bring;

Depth, per pixel: the files that begin with `depth`.
"""

from core.calibrate.adjust import adjust
from core.calibrate.depth import DepthOptions, DepthPlane, calibrate_depth
from core.calibrate.left_out import LeftOut, leave_captures_out
from core.calibrate.network import network_from_targets
from core.calibrate.next_pose import NextPose, next_poses
from core.calibrate.photogrammetric import CALIBRATION_OPTIONS, calibrate_photogrammetric
from core.calibrate.rigid import RigidityTest
from core.calibrate.solve import AdjustOptions

__all__ = [
    "CALIBRATION_OPTIONS", "AdjustOptions", "DepthOptions", "DepthPlane", "LeftOut", "NextPose", "RigidityTest",
    "adjust", "calibrate_depth", "calibrate_photogrammetric", "leave_captures_out", "network_from_targets",
    "next_poses",
]  # fmt: skip
