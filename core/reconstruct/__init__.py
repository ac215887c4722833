"""From a phase map and a calibration to points in the camera's frame.

* `points` dispatches: `reconstruct` is the stage;
* `intersect` forward intersection by the photogrammetric calibration, from 4 or 3 observations;
* `joint` intersection from all cameras and projectors that saw a point;
* `epipolar` where it starts without a calibrated projector; `light_planes` which of these places are another surface's;
* `correspondence` where another camera sees what a camera sees, by the same stripes;
* `stations` a rig moved between captures as one rig; `overlaps` the mean of what its stations see;
* `texture` points without code, matched in the images of two cameras; its kernels in `matching`;
* `system` what of a photogrammetric calibration is prepared once: camera rays and projection along a ray;
* `sigma_table` what the calibration's covariance does to a point;
* `lookup` depth by the polynomial or the table of every pixel;
* `rays` the viewing directions of all camera pixels;
* `export/` files for other programs, one for each ending.

A camera pixel is where it is: its centre has no error, so a point lies on its pixel's ray and the projector coordinates
u and v, which carry the phase noise, say how far along.
"""

from core.reconstruct.correspondence import seen_by_other
from core.reconstruct.export import EXPORTERS, exporter_for, write_npz, write_ply
from core.reconstruct.joint import Sight, intersect_all, intersect_each, merged
from core.reconstruct.points import reconstruct
from core.reconstruct.stations import at_stations, joined
from core.reconstruct.texture import fill_by_texture

__all__ = [
    "EXPORTERS", "Sight", "at_stations", "exporter_for", "fill_by_texture", "intersect_all", "intersect_each",
    "joined", "merged", "reconstruct", "seen_by_other", "write_npz", "write_ply",
]  # fmt: skip
