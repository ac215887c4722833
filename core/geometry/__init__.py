"""Frames, rotations and the device: where a point of space appears, and which ray a pixel sees.

Conventions, told once for the whole program:

* pixel coordinates ``(u, v)``: u right, v down, the centre of the top-left pixel (or LCD line crossing) is (0, 0);
* image coordinates ``(x, y)`` in mm: x right, y up, origin in the middle of the sensor;
* device frame: X right, Y up, the device looks along -Z, so ``x = -c X/Z`` and ``y = -c Y/Z``;
* a `Pose` named ``a_from_b`` takes coordinates in frame b to frame a: ``X_a = R X_b + t``.
"""

from core.geometry.device import (
    Projection,
    estimated,
    image_to_pixel,
    pixel_to_image,
    project,
    project_with_derivatives,
    ray_directions,
)
from core.geometry.lens import LENSES, Lens, at_radius, distort, fitted, lens_of, nominal, regular, undistort
from core.geometry.pairs import (
    calibration_of,
    camera_for,
    changed,
    held_axes,
    knows,
    orientation_names,
    orientation_variances,
    pair_derivatives,
    pair_for,
    pair_named,
    pair_of,
    perturbed,
)
from core.geometry.rotation import (
    Pose,
    cross_matrix,
    matrix_from_axis_angle,
    matrix_from_rotation_vector,
    rotation_vector_from_matrix,
    similarity,
    similarity_residual,
)

__all__ = [
    "LENSES", "Lens", "Pose", "Projection", "at_radius", "calibration_of", "camera_for", "changed", "cross_matrix",
    "distort", "estimated", "fitted", "held_axes", "image_to_pixel", "knows", "lens_of", "matrix_from_axis_angle",
    "matrix_from_rotation_vector", "nominal", "orientation_names", "orientation_variances", "pair_derivatives",
    "pair_for", "pair_named", "pair_of", "perturbed", "pixel_to_image", "project", "project_with_derivatives",
    "ray_directions", "regular", "rotation_vector_from_matrix", "similarity", "similarity_residual",
    "undistort",
]  # fmt: skip
