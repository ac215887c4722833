"""The geometry of a capture: every subsample's projector coordinates, brightness and blur, worked out once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.bench.optics import DEFOCUS_STEP, window_tables
from core.bench.rig import Rig
from core.bench.scene import Scene
from core.bench.tables import fade_rows
from core.bench.tracing import cast_rows, pack_device
from core.geometry import Pose
from core.lazy import dataclass
from core.model import Array, Floats
from core.parallel import run_in_bands

Counts = NDArray[np.int32]
_CELL_MM = 2.0


@dataclass(frozen=True)
class PackedScene:
    """A scene as arrays, for the kernels."""

    board: Array  # (4,): half width, half height, albedo, scale of the form
    form: Array
    circles: Array  # (n, 5)
    cell_start: Counts
    cell_circle: Counts
    grid: Array  # (5,): x0, y0, cell size, columns, rows
    spheres: Array  # (k, 5): centre, radius, albedo
    blocks: Array  # (k, 7): lower corner, upper corner, albedo


@dataclass(frozen=True)
class Samples:
    """What every subsample sees; arrays of shape (H s, W s).

    `u`, `v` are the projector coordinates in lines. `gain` is the light it receives from a fully bright projector, with
    white square to it at the reference distance as 1, the blurred edge of the raster included. `reflect` is the same
    for the light of the room. `width` numbers the tabulated defocus.
    """

    u: Floats
    v: Floats
    gain: Floats
    reflect: Floats
    width: NDArray[np.uint8]


def pack_scene(scene: Scene) -> PackedScene:
    """Put a scene into arrays and sort its circles into square cells."""
    circles = scene.board.circles()
    half = np.array(scene.board.half_size_mm)
    columns, rows = (int(n) for n in np.ceil(2 * half / _CELL_MM))
    members: list[tuple[int, int]] = []  # cell and circle
    for n, (x, y, _, radius, _) in enumerate(circles):
        reach = radius + 2.0  # the footprint of a ray and its shift by the circle's height
        i0, j0 = (max(0, int(a)) for a in ((x - reach + half[0]) / _CELL_MM, (y - reach + half[1]) / _CELL_MM))
        i1, j1 = int((x + reach + half[0]) / _CELL_MM), int((y + reach + half[1]) / _CELL_MM)
        for j in range(j0, min(j1, rows - 1) + 1):
            for i in range(i0, min(i1, columns - 1) + 1):
                members.append((j * columns + i, n))
    cell, circle = np.array(sorted(members), np.int32).reshape(-1, 2).T
    start = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=columns * rows))]).astype(np.int32)
    form = scene.board.form
    return PackedScene(
        np.array([*half, scene.board.albedo, form.scale_mm]),
        np.ascontiguousarray(form.coefficients, np.float64),
        np.ascontiguousarray(circles, np.float64),
        start,
        np.ascontiguousarray(circle),
        np.array([-half[0], -half[1], _CELL_MM, columns, rows], np.float64),
        np.array([[*s.centre_mm, s.radius_mm, s.albedo] for s in scene.spheres], np.float64).reshape(-1, 5),
        np.array([[*b.lower_mm, *b.upper_mm, b.albedo] for b in scene.blocks], np.float64).reshape(-1, 7),
    )


def cast(rig: Rig, scene: Scene, per_pixel: int, with_points: bool = False) -> tuple[Samples, Array]:
    """Cast `per_pixel`² rays through every pixel of the camera; the samples, and where the rays end.

    The points, (H s, W s, 3) mm in the board's frame, are NaN where nowhere; (0, 0, 3) unless asked for.
    """
    shape = (rig.camera.height * per_pixel, rig.camera.width * per_pixel)
    packed = pack_scene(scene)
    board_from_camera: Pose = scene.camera_from_board.inverse()
    projector_from_board = rig.projector_from_camera @ scene.camera_from_board
    u, v, gain, reflect = (np.zeros(shape, np.float32) for _ in range(4))
    samples = Samples(u, v, gain, reflect, np.zeros(shape, np.uint8))
    points = np.empty((*shape, 3) if with_points else (0, 0, 3))
    arguments = (
        per_pixel,
        pack_device(rig.camera, rig.camera_interior),
        pack_device(rig.projector, rig.projector_interior),
        np.ascontiguousarray(board_from_camera.rotation),
        board_from_camera.translation_mm,
        np.column_stack([projector_from_board.rotation, projector_from_board.translation_mm]),
        projector_from_board.origin_mm,
        *vars(packed).values(),
        np.array([rig.reference_mm, rig.lcd.focus_mm, DEFOCUS_STEP]),
        *vars(samples).values(),
        points,
    )
    edges = (window_tables(rig.lcd, rig.projector.width), window_tables(rig.lcd, rig.projector.height))

    def rows(first: int, last: int) -> None:
        cast_rows(first, last, *arguments)
        fade_rows(first, last, u, v, gain, samples.width, *edges)

    run_in_bands(rows, shape[0])
    return samples, points
