"""How flat a plane came out: the orthogonal plane fit and the deviations from it.

* `planes` the plane itself: `fit_plane`, `Plane`; the judgement of one capture: `evaluate_plane` is the stage;
* `profile` the deviations along a line: `read_profile`, `Profile`;
* `sphere` the same for a ball: `fit_sphere`.
"""

from core.evaluate.planes import Plane, evaluate_plane, fit_plane, heights, share_within
from core.evaluate.profile import Line, Profile, interpolate, line_across, points_on_plane, read_profile
from core.evaluate.sphere import Sphere, fit_sphere

__all__ = [
    "Line", "Plane", "Profile", "Sphere", "evaluate_plane", "fit_plane", "fit_sphere", "heights", "interpolate",
    "line_across", "points_on_plane", "read_profile", "share_within",
]  # fmt: skip
