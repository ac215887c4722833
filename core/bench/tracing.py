"""The ray caster: from a place on the sensor along its ray to a surface, and on to the projector's lines.

Written a second time, scalar by scalar, and not borrowed from `core.geometry`: a bench that shared the formulae with
what it examines could not find their faults. The tests compare the two.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.compiling import inner, njit
from core.model import Array, DeviceSpec, Floats, Interior

Counts = NDArray[np.int32]

# places in a packed device
_C, _X0, _Y0, _A1, _A2, _A3, _A4, _A5, _A6, _R02, _W, _H, _PX, _PY = range(14)
MISS, BOARD, SPHERE, BLOCK = 0, 1, 2, 3


def pack_device(spec: DeviceSpec, interior: Interior) -> Array:
    """Put a device into an array, shape (14,), for the kernels."""
    raster = [spec.width, spec.height, *spec.pitch_mm]
    return np.array([*interior.vector, interior.r0_mm**2, *raster], np.float64)


@inner(error_model="numpy", forceinline=True)
def _with_distortion(device: Array, u: float, v: float) -> tuple[float, float]:
    """Image coordinates (mm) of a pixel, before affinity and principal point have changed them."""
    mx = (u - (device[_W] - 1) / 2) * device[_PX]
    my = ((device[_H] - 1) / 2 - v) * device[_PY]
    a3, a4 = device[_A3], device[_A4]
    det = 1 - a3 * a3 - a4 * a4
    return ((1 - a3) * mx - a4 * my) / det - device[_X0], ((1 + a3) * my - a4 * mx) / det - device[_Y0]


@inner(error_model="numpy", forceinline=True)
def _without_distortion(device: Array, x1: float, y1: float, x: float, y: float) -> tuple[float, float]:
    """The collinearity image (mm), by Newton's method from (x, y); NaN where the polynomial has no inverse."""
    a5, a6 = device[_A5], device[_A6]
    for _ in range(12):
        r2 = x * x + y * y
        d = device[_A1] * (r2 - device[_R02]) + device[_A2] * (r2 * r2 - device[_R02] * device[_R02])
        dd = 2 * device[_A1] + 4 * device[_A2] * r2
        fx = x * (1 + d) + 2 * a5 * x * y + a6 * (r2 + 2 * x * x) - x1
        fy = y * (1 + d) + 2 * a6 * x * y + a5 * (r2 + 2 * y * y) - y1
        jxx = 1 + d + x * x * dd + 2 * a5 * y + 6 * a6 * x
        jyy = 1 + d + y * y * dd + 2 * a6 * x + 6 * a5 * y
        jxy = x * y * dd + 2 * a5 * x + 2 * a6 * y
        j = jxx * jyy - jxy * jxy
        sx, sy = (jyy * fx - jxy * fy) / j, (jxx * fy - jxy * fx) / j
        x -= sx
        y -= sy
        if sx * sx + sy * sy < 1e-12:  # the next one would be a millionth of its square
            return x, y
    return np.nan, np.nan


@inner(error_model="numpy", forceinline=True)
def place_of(device: Array, X: float, Y: float, Z: float) -> tuple[float, float]:
    """Pixel (u, v) at which a device sees a point of its own frame, with Z < 0."""
    x, y = -device[_C] * X / Z, -device[_C] * Y / Z
    r2 = x * x + y * y
    d = device[_A1] * (r2 - device[_R02]) + device[_A2] * (r2 * r2 - device[_R02] * device[_R02])
    a5, a6 = device[_A5], device[_A6]
    x1 = x * (1 + d) + 2 * a5 * x * y + a6 * (r2 + 2 * x * x) + device[_X0]
    y1 = y * (1 + d) + 2 * a6 * x * y + a5 * (r2 + 2 * y * y) + device[_Y0]
    mx = x1 + device[_A3] * x1 + device[_A4] * y1
    my = y1 + device[_A4] * x1 - device[_A3] * y1
    return mx / device[_PX] + (device[_W] - 1) / 2, (device[_H] - 1) / 2 - my / device[_PY]


@inner(error_model="numpy", forceinline=True)
def form_at(form: Array, scale: float, x: float, y: float) -> tuple[float, float, float]:
    """Height of a form and its slopes in x and y."""
    h, hx, hy = 0.0, 0.0, 0.0
    x, y = x / scale, y / scale
    for p in range(form.shape[0] - 1, -1, -1):
        row, row_y = 0.0, 0.0
        for q in range(form.shape[1] - 1, -1, -1):
            row_y = row_y * y + row
            row = row * y + form[p, q]
        hx = hx * x + h
        h = h * x + row
        hy = hy * x + row_y
    return h, hx / scale, hy / scale


@inner(error_model="numpy", forceinline=True)
def meets_sphere(sphere: Array, o: Array, dx: float, dy: float, dz: float) -> float:
    """Ray parameter of the first meeting with a sphere (centre, radius) beyond 1e-6, infinite if there is none."""
    px, py, pz = o[0] - sphere[0], o[1] - sphere[1], o[2] - sphere[2]
    a = dx * dx + dy * dy + dz * dz
    b = px * dx + py * dy + pz * dz
    c = px * px + py * py + pz * pz - sphere[3] * sphere[3]
    root = b * b - a * c
    if root < 0:
        return np.inf
    root = np.sqrt(root)
    if (-b - root) / a > 1e-6:
        return (-b - root) / a
    return (-b + root) / a if (-b + root) / a > 1e-6 else np.inf


@inner(error_model="numpy", forceinline=True)
def meets_block(block: Array, o: Array, dx: float, dy: float, dz: float) -> tuple[float, int]:
    """Ray parameter at which a ray from outside enters a block (two corners), and through the faces of which axis."""
    near, far, axis = -np.inf, np.inf, -1
    for k in range(3):
        d = dx if k == 0 else (dy if k == 1 else dz)
        if d == 0:
            if o[k] <= block[k] or o[k] >= block[3 + k]:
                return np.inf, -1
            continue
        t0, t1 = (block[k] - o[k]) / d, (block[3 + k] - o[k]) / d
        if t0 > t1:
            t0, t1 = t1, t0
        if t0 > near:
            near, axis = t0, k
        far = min(far, t1)
    # a ray that starts on a face and leaves is already at its end; one that starts beside a face may enter at once
    if near < far and near > -1e-9 and far > 1e-9:
        return near, axis
    return np.inf, -1


@inner(error_model="numpy", forceinline=True)
def share_of_footprint(inside: float, long: float, short: float) -> float:
    """Share of a parallelogram inside a straight edge: how far in its middle is, and its sides square to the edge."""
    if short < 1e-3 * long:
        return min(max(0.5 + inside / long, 0.0), 1.0)
    outer, middle = 0.5 * (long + short), 0.5 * (long - short)
    if inside >= outer:
        return 1.0
    total = 0.0
    for at, sign in ((inside + outer, 0.5), (inside + middle, -0.5), (inside - middle, -0.5)):
        total += sign * max(at, 0.0) ** 2
    return total / (long * short)


@inner(error_model="numpy", forceinline=True)
def paint_at(
    board: Array, circles: Array, cell_start: Counts, cell_circle: Counts, grid: Array,
    x: float, y: float, sx: float, sy: float, ux: float, uy: float, vx: float, vy: float,
) -> tuple[float, float]:  # fmt: skip
    """Albedo of the board, and the height over its form, at a place where a ray of slopes (sx, sy) per z arrives.

    The share of a circle is that of the subsample's footprint, a parallelogram of the sides u and v, cut by a straight
    edge as far in as the circle is on average: the sum over a pixel counts areas.
    """
    albedo, lift = board[2], 0.0
    i, j = int((x - grid[0]) / grid[2]), int((y - grid[1]) / grid[2])
    if i < 0 or j < 0 or i >= grid[3] or j >= grid[4]:
        return albedo, lift
    cell = j * int(grid[3]) + i
    for k in range(cell_start[cell], cell_start[cell + 1]):
        n = cell_circle[k]
        above = circles[n, 2]
        # the ray arrives at the circle's own height elsewhere
        ex, ey = x + sx * above - circles[n, 0], y + sy * above - circles[n, 1]
        away = max(np.sqrt(ex * ex + ey * ey), 1e-12)
        a, b = abs(ex * ux + ey * uy) / away, abs(ex * vx + ey * vy) / away
        # the edge recedes from its tangent by the square of the way along it, over twice the radius
        along = ((ex * uy - ey * ux) ** 2 + (ex * vy - ey * vx) ** 2) / (away * away)
        cover = share_of_footprint(circles[n, 3] - away - along / (24 * circles[n, 3]), max(a, b), min(a, b))
        if cover > 0:
            albedo += cover * (circles[n, 4] - albedo)
            if cover > 0.5:
                lift = above
    return albedo, lift


@inner(error_model="numpy", forceinline=True)
def in_shadow(spheres: Array, blocks: Array, p: Array, lx: float, ly: float, lz: float) -> bool:
    """Whether anything stands between a point and the projector, at the end of the vector (lx, ly, lz)."""
    for k in range(spheres.shape[0]):
        if meets_sphere(spheres[k], p, lx, ly, lz) < 1:
            return True
    nearest = np.inf
    for k in range(blocks.shape[0]):
        nearest = min(nearest, meets_block(blocks[k], p, lx, ly, lz)[0])
    return nearest < 1


@inner(error_model="numpy", forceinline=True)
def _meet(
    o: Array, dx: float, dy: float, dz: float, board: Array, form: Array, spheres: Array, blocks: Array, hit: Array
) -> tuple[int, int]:
    """Find the nearest surface along a ray; put the point and the unit normal into `hit`; say kind and number.

    hit[6] is the board's height where the ray before met it: one step of Newton's method leads from there to the form,
    which is smooth and nearly flat.
    """
    kind, which, best, axis = MISS, 0, np.inf, -1
    if dz != 0:
        t = (hit[6] - o[2]) / dz
        hx, hy = 0.0, 0.0
        if form.size > 0:
            h, hx, hy = form_at(form, board[3], o[0] + t * dx, o[1] + t * dy)
            t += (h - hit[6]) / (dz - hx * dx - hy * dy)
        x, y = o[0] + t * dx, o[1] + t * dy
        if t > 0 and abs(x) <= board[0] and abs(y) <= board[1]:
            kind, best = BOARD, t
            hit[6] = o[2] + t * dz
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
        hit[3] = hit[4] = hit[5] = 0.0
        slope = dx if axis == 0 else (dy if axis == 1 else dz)
        hit[3 + axis] = -1.0 if slope > 0 else 1.0
    return kind, which


@njit(cache=True, nogil=True, error_model="numpy")
def cast_rows(
    first: int, last: int, per_pixel: int, camera: Array, projector: Array, R: Array, eye: Array, P: Array, lamp: Array,
    board: Array, form: Array, circles: Array, cell_start: Counts, cell_circle: Counts, grid: Array,
    spheres: Array, blocks: Array, light: Array,
    u: Floats, v: Floats, gain: Floats, reflect: Floats, width: NDArray[np.uint8], points: Array,
) -> None:  # fmt: skip
    """Cast the rays of rows `first` to `last` - 1 of the subsample raster.

    R (3, 3) and eye (3,): camera axes and projection centre in the board's frame; P (3, 4): projector from board; lamp
    (3,): the projector's centre in the board's frame; light (3,): reference distance, focus distance,
    and the step of relative defocus from one tabulated width to the next. A ray that ends unlit has gain 0.
    """
    hit = np.empty(7)
    for i in range(first, last):
        hit[6] = 0.0
        x, y, step_x, step_y = np.nan, np.nan, 0.0, 0.0
        for j in range(u.shape[1]):
            gain[i, j] = reflect[i, j] = 0.0
            if points.shape[0] > 0:
                points[i, j, :] = np.nan
            x1, y1 = _with_distortion(camera, (j + 0.5) / per_pixel - 0.5, (i + 0.5) / per_pixel - 0.5)
            was_x, was_y = x, y
            if np.isfinite(x):  # one step is enough from where the row so far leads
                x, y = _without_distortion(camera, x1, y1, x + step_x, y + step_y)
            else:
                x, y = _without_distortion(camera, x1, y1, x1, y1)
            if not np.isfinite(x):
                continue
            if np.isfinite(was_x):
                step_x, step_y = x - was_x, y - was_y
            a, b = x / camera[_C], y / camera[_C]
            dx = R[0, 0] * a + R[0, 1] * b - R[0, 2]
            dy = R[1, 0] * a + R[1, 1] * b - R[1, 2]
            dz = R[2, 0] * a + R[2, 1] * b - R[2, 2]
            kind, which = _meet(eye, dx, dy, dz, board, form, spheres, blocks, hit)
            if kind == MISS or hit[3] * dx + hit[4] * dy + hit[5] * dz >= 0:
                continue
            if kind == BOARD:
                sx, sy, far = dx / dz, dy / dz, (hit[2] - eye[2]) / dz / camera[_C] / per_pixel
                wide, high = far * camera[_PX], far * camera[_PY]
                albedo, lift = paint_at(board, circles, cell_start, cell_circle, grid, hit[0], hit[1], sx, sy,
                                        wide * (R[0, 0] - sx * R[2, 0]), wide * (R[1, 0] - sy * R[2, 0]),
                                        high * (R[0, 1] - sx * R[2, 1]), high * (R[1, 1] - sy * R[2, 1]))  # fmt: skip
                hit[0], hit[1], hit[2] = hit[0] + lift * dx / dz, hit[1] + lift * dy / dz, hit[2] + lift
            else:
                albedo = spheres[which, 4] if kind == SPHERE else blocks[which, 6]
            if points.shape[0] > 0:
                points[i, j, 0], points[i, j, 1], points[i, j, 2] = hit[0], hit[1], hit[2]
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
            width[i, j] = min(int(abs(light[1] / -Z - 1) / light[2]), 255)
            square = lx * lx + ly * ly + lz * lz
            # inverse square, incidence on the surface, foreshortening of the projector's pupil
            falloff = light[0] * light[0] / square * facing * -Z / square
            gain[i, j] = reflect[i, j] * falloff
