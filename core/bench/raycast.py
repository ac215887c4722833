"""The geometry of a capture: every subsample's projector coordinates, brightness and blur, worked out once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from core.bench.optics import DEFOCUS_STEP, WIDTHS, window_tables
from core.bench.rig import Rig
from core.bench.scene import Scene
from core.bench.tables import look_up
from core.bench.tracing import (
    BLOCK,
    BOARD,
    MISS,
    SPHERE,
    direction_of,
    form_at,
    in_shadow,
    meets_block,
    meets_sphere,
    pack_device,
    paint_at,
    place_of,
)
from core.geometry import Pose
from core.parallel import run_in_bands

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
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
    members: list[list[int]] = [[] for _ in range(columns * rows)]
    for n, (x, y, _, radius, _) in enumerate(circles):
        reach = radius + 2.0  # the footprint of a ray and its shift by the circle's height
        i0, j0 = (max(0, int(a)) for a in ((x - reach + half[0]) / _CELL_MM, (y - reach + half[1]) / _CELL_MM))
        i1, j1 = int((x + reach + half[0]) / _CELL_MM), int((y + reach + half[1]) / _CELL_MM)
        for j in range(j0, min(j1, rows - 1) + 1):
            for i in range(i0, min(i1, columns - 1) + 1):
                members[j * columns + i].append(n)
    start = np.concatenate([[0], np.cumsum([len(m) for m in members])]).astype(np.int32)
    form = scene.board.form
    return PackedScene(
        np.array([*half, scene.board.albedo, form.scale_mm]),
        np.ascontiguousarray(form.coefficients, np.float64),
        np.ascontiguousarray(circles, np.float64),
        start,
        np.array([n for m in members for n in m], np.int32),
        np.array([-half[0], -half[1], _CELL_MM, columns, rows], np.float64),
        np.array([[*s.centre_mm, s.radius_mm, s.albedo] for s in scene.spheres], np.float64).reshape(-1, 5),
        np.array([[*b.lower_mm, *b.upper_mm, b.albedo] for b in scene.blocks], np.float64).reshape(-1, 7),
    )


@njit(cache=True, nogil=True)
def _meet(
    o: Array, dx: float, dy: float, dz: float, board: Array, form: Array, spheres: Array, blocks: Array, hit: Array
) -> tuple[int, int]:
    """Find the nearest surface along a ray; put the point and the unit normal into `hit` (6,); say kind and number."""
    kind, which, best, axis = MISS, 0, np.inf, -1
    if dz != 0:
        t = -o[2] / dz
        for _ in range(4):  # slopes are below 1/100: each round gains two digits
            h, hx, hy = form_at(form, board[3], o[0] + t * dx, o[1] + t * dy)
            t = (h - o[2]) / dz
        x, y = o[0] + t * dx, o[1] + t * dy
        if t > 0 and abs(x) <= board[0] and abs(y) <= board[1]:
            kind, best = BOARD, t
            n = np.sqrt(hx * hx + hy * hy + 1)
            hit[3], hit[4], hit[5] = -hx / n, -hy / n, 1 / n
    for k in range(spheres.shape[0]):
        t = meets_sphere(spheres[k], o, dx, dy, dz)
        if t < best:
            kind, which, best = SPHERE, k, t
    for k in range(blocks.shape[0]):
        t, a = meets_block(blocks[k], o, dx, dy, dz)
        if t < best:
            kind, which, best, axis = BLOCK, k, t, a
    hit[0], hit[1], hit[2] = o[0] + best * dx, o[1] + best * dy, o[2] + best * dz
    if kind == SPHERE:
        for k in range(3):
            hit[3 + k] = (hit[k] - spheres[which, k]) / spheres[which, 3]
    elif kind == BLOCK:
        hit[3:] = 0.0
        slope = dx if axis == 0 else (dy if axis == 1 else dz)
        hit[3 + axis] = -1.0 if slope > 0 else 1.0
    return kind, which


@njit(cache=True, nogil=True)
def _cast_rows(
    first: int, last: int, per_pixel: int, camera: Array, projector: Array, R: Array, eye: Array, P: Array, lamp: Array,
    board: Array, form: Array, circles: Array, cell_start: Counts, cell_circle: Counts, grid: Array,
    spheres: Array, blocks: Array, light: Array, window_u: Floats, window_v: Floats,
    u: Floats, v: Floats, gain: Floats, reflect: Floats, width: NDArray[np.uint8], points: Array,
) -> None:  # fmt: skip
    """Cast the rays of rows `first` to `last` - 1 of the subsample raster.

    R (3, 3) and eye (3,): camera axes and projection centre in the board's frame; P (3, 4): projector from board; lamp
    (3,): the projector's centre in the board's frame; light (2,): reference and focus distance.
    """
    hit = np.empty(6)
    for i in range(first, last):
        for j in range(u.shape[1]):
            gain[i, j] = reflect[i, j] = 0.0
            if points.shape[0] > 0:
                points[i, j, :] = np.nan
            a, b = direction_of(camera, (j + 0.5) / per_pixel - 0.5, (i + 0.5) / per_pixel - 0.5)
            if not np.isfinite(a):
                continue
            dx = R[0, 0] * a + R[0, 1] * b - R[0, 2]
            dy = R[1, 0] * a + R[1, 1] * b - R[1, 2]
            dz = R[2, 0] * a + R[2, 1] * b - R[2, 2]
            kind, which = _meet(eye, dx, dy, dz, board, form, spheres, blocks, hit)
            if kind == MISS or hit[3] * dx + hit[4] * dy + hit[5] * dz >= 0:
                continue
            if kind == BOARD:
                footprint = (hit[2] - eye[2]) / dz * camera[12] / camera[0] / per_pixel
                albedo, lift = paint_at(board, circles, cell_start, cell_circle, grid, hit[0], hit[1],
                                        dx / dz, dy / dz, footprint)  # fmt: skip
                hit[0], hit[1], hit[2] = hit[0] + lift * dx / dz, hit[1] + lift * dy / dz, hit[2] + lift
            else:
                albedo = spheres[which, 4] if kind == SPHERE else blocks[which, 6]
            if points.shape[0] > 0:
                points[i, j] = hit[:3]
            seen = 1 / (1 + a * a + b * b)  # cos² of the angle to the camera's axis
            reflect[i, j] = albedo * seen * seen
            lx, ly, lz = lamp[0] - hit[0], lamp[1] - hit[1], lamp[2] - hit[2]
            X = P[0, 0] * hit[0] + P[0, 1] * hit[1] + P[0, 2] * hit[2] + P[0, 3]
            Y = P[1, 0] * hit[0] + P[1, 1] * hit[1] + P[1, 2] * hit[2] + P[1, 3]
            Z = P[2, 0] * hit[0] + P[2, 1] * hit[1] + P[2, 2] * hit[2] + P[2, 3]
            facing = hit[3] * lx + hit[4] * ly + hit[5] * lz
            if Z >= 0 or facing <= 0 or in_shadow(spheres, blocks, hit, lx, ly, lz):
                continue
            u[i, j], v[i, j] = place_of(projector, X, Y, Z)
            w = min(int(abs(light[1] / -Z - 1) / DEFOCUS_STEP), WIDTHS - 1)
            width[i, j] = w
            edge = look_up(window_u, w, u[i, j]) * look_up(window_v, w, v[i, j])
            square = lx * lx + ly * ly + lz * lz
            # inverse square, incidence on the surface, foreshortening of the projector's pupil
            falloff = light[0] * light[0] / square * facing * -Z / square
            gain[i, j] = reflect[i, j] * falloff * edge if edge > 1e-6 else 0.0


def cast(rig: Rig, scene: Scene, per_pixel: int, with_points: bool = False) -> tuple[Samples, Array]:
    """Cast `per_pixel`² rays through every pixel of the camera.

    Returns
    -------
    samples : Samples
    points : array, shape (H s, W s, 3)
        Where the rays end, mm in the board's frame, NaN where nowhere; shape (0, 0, 3) unless asked for.
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
        np.array([rig.reference_mm, rig.lcd.focus_mm]),
        window_tables(rig.lcd, rig.projector.width),
        window_tables(rig.lcd, rig.projector.height),
        *vars(samples).values(),
        points,
    )
    run_in_bands(lambda first, last: _cast_rows(first, last, *arguments), shape[0])
    return samples, points
