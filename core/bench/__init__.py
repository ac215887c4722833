"""The virtual bench: a rig whose every number is known, in front of boards, plates and objects.

It shares no formula with decoding, measuring or adjusting; only the conventions, the patterns and the folder on disk.

scene.py        what stands in front of the rig: boards as made, spheres, blocks
rig.py          camera and projector as they really are, and how they stand
optics.py       line aperture, contrast, defocus, pixel area
sensor.py       line jitter, noise, saturation, quantisation
tracing.py      one ray: undistort, meet a surface, find the projector's line
raycast.py      all rays of a capture, worked out once
tables.py       the kernels that form pixels, of many frames at once
render.py       `prepare` the geometry, expose a `frame`, `render` a sequence
truth.py        what is really so: projector coordinates of pixels, places of targets, an operator's picks
faults.py       what goes wrong, by name
experiment.py   an experiment as data: a plan, and what chance makes of it
scenarios.py    the experiments by name: paper, modern, quick, stereo, many
simulate.py     an experiment written as a project, with its truth
"""

from core.bench.experiment import Experiment
from core.bench.faults import faults
from core.bench.optics import Lcd, Lens
from core.bench.render import Prepared, lines_of, prepare, render
from core.bench.rig import Rig, converging_pair
from core.bench.scenarios import experiment, plan, scenarios
from core.bench.scene import Block, Board, Form, Scene, Sphere
from core.bench.sensor import Sensor
from core.bench.simulate import simulate
from core.bench.truth import true_targets, truth_maps

__all__ = [
    "Block", "Board", "Experiment", "Form", "Lcd", "Lens", "Prepared", "Rig", "Scene", "Sensor", "Sphere",
    "converging_pair", "experiment", "faults", "lines_of", "plan", "prepare", "render", "scenarios", "simulate",
    "true_targets", "truth_maps",
]  # fmt: skip
