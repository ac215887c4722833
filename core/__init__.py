"""The stripe workbench's core: from the frames of a coded-light sensor to points with sigmas, and their judgement.

The data path has seven stages; a folder of this package for each, and one dataclass of `core.model` for each arrow::

    capture -> decode -> measure -> calibrate -> reconstruct -> evaluate -> report

* **capture** runs a sequence of patterns on a projector and a camera and keeps the frames;
* **decode** gives each camera pixel the projector column u (and row v) that lit it, with sigma;
* **measure** finds the targets of a testfield and their coordinates in camera and projector;
* **calibrate** adjusts camera and projector as one bundle, or fits the depth of a plate pixel by pixel;
* **reconstruct** intersects rays to points in the camera's frame;
* **evaluate** judges points by their deviations from a fitted plane;
* **report** writes what was found.

`core.pipeline` runs these on a project folder, `core.project` reads and writes that folder, `core.bench` is a virtual
rig with known truth, `core.geometry` holds the frames and `core.patterns` what the projector shows.

Conventions
-----------
Lengths are mm and angles rad unless a name says otherwise (`_um`, `_deg`). Pixel coordinates are (u, v), u right and v
down, with the centre of the first pixel (or LCD line crossing) at (0, 0). Image coordinates (x, y) in mm run right and
up from the middle of the sensor. In a device's frame X is right, Y up, and the device looks along -Z; the projector is
a device like the camera. A pose named ``a_from_b`` takes coordinates from frame b to frame a.

Examples
--------
A whole experiment on the virtual bench, in a folder that does not exist yet::

    import core
    project = core.simulate_project(Path("bench"), "quick")
    core.calibrate_project(project)
    for plane in core.evaluate_project(project):
        print(plane.capture, plane.method, plane.rms_mm)

From arrays, without files: `decode_frames`, `calibrate_points`, `reconstruct_phase`, `merge_phases`, `triangulate`,
`project_points`, `undistort_image`, all in `core.api`.
"""

from core.starting import is_command, listen

if is_command():
    listen()

from typing import TYPE_CHECKING

from core.lazy import attach

if TYPE_CHECKING:
    from core.api import Points as Points
    from core.api import calibrate_points as calibrate_points
    from core.api import decode_frames as decode_frames
    from core.api import merge_phases as merge_phases
    from core.api import project_points as project_points
    from core.api import reconstruct_phase as reconstruct_phase
    from core.api import triangulate as triangulate
    from core.api import undistort_image as undistort_image
    from core.errors import AdjustmentError as AdjustmentError
    from core.errors import InputError as InputError
    from core.errors import StripeError as StripeError
    from core.model import DeviceSpec as DeviceSpec
    from core.model import Interior as Interior
    from core.pipeline import CalibrateOptions as CalibrateOptions
    from core.pipeline import adjust_network as adjust_network
    from core.pipeline import calibrate_project as calibrate_project
    from core.pipeline import capture_into as capture_into
    from core.pipeline import decode_capture as decode_capture
    from core.pipeline import evaluate_project as evaluate_project
    from core.pipeline import measure_project as measure_project
    from core.pipeline import orient_capture as orient_capture
    from core.pipeline import print_testfield as print_testfield
    from core.pipeline import reconstruct_capture as reconstruct_capture
    from core.pipeline import report_project as report_project
    from core.pipeline import simulate_project as simulate_project
    from core.progress import Progress as Progress
    from core.project import read_capture as read_capture
    from core.project import read_network as read_network
    from core.project import read_project as read_project

__version__ = "0.1.0"  # whoever builds a package reads it here

_HOMES = {
    "core.api": "Points calibrate_points decode_frames merge_phases project_points reconstruct_phase triangulate"
    " undistort_image",
    "core.model": "DeviceSpec Interior",
    "core.pipeline": "CalibrateOptions adjust_network calibrate_project capture_into decode_capture evaluate_project"
    " measure_project orient_capture print_testfield reconstruct_capture report_project simulate_project",
    "core.project": "read_capture read_network read_project",
    "core.progress": "Progress",
    "core.errors": "AdjustmentError InputError StripeError",
}
if not TYPE_CHECKING:  # else every name would be right
    __getattr__, _listed, _names = attach(__name__, _HOMES)
    __all__ = ["__version__", *_names]

    def __dir__() -> list[str]:
        return [*_listed(), "__version__"]
