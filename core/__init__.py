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
"""

import os
from importlib import import_module
from typing import Any

# the threads of the linear algebra would only spin beside our own; it looks here once, when numpy is imported
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

_HOME = {
    "simulate_project": "core.pipeline",
    "capture_into": "core.pipeline",
    "decode_capture": "core.pipeline",
    "measure_project": "core.pipeline",
    "calibrate_project": "core.pipeline",
    "adjust_network": "core.pipeline",
    "reconstruct_capture": "core.pipeline",
    "evaluate_project": "core.pipeline",
    "report_project": "core.pipeline",
    "print_testfield": "core.pipeline",
    "CalibrateOptions": "core.pipeline",
    "read_project": "core.project",
    "read_capture": "core.project",
    "read_network": "core.project",
    "Progress": "core.progress",
    "StripeError": "core.errors",
}
__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    """Import a public name when it is first asked for, so that importing the package costs nothing."""
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module 'core' has no attribute {name!r}")
