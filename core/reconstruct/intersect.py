"""Forward intersection of a camera ray with one or two projector coordinates.

The pixel's ray is fixed; the inverse depth q on it is estimated from the projector coordinates u and v by weighted
least squares (4 observations: the pixel's x and y, u and v) or follows from one of them alone (3 observations), with
the full interior orientation of both devices. Gauss and Newton's step is

    q <- q + (w_u J_u r_u + w_v J_v r_v) / (w_u J_u² + w_v J_v²),    w = 1 / sigma²,  J = df/dq,  r = observed - f(q)

from the closed solution without distortion; two or three steps do. The rows of an image are handed to threads.
"""

from __future__ import annotations

import numpy as np

from core.compiling import inner, njit
from core.errors import NoCoordinateError
from core.geometry import lens_of, pair_for
from core.model import Array, Floats, Pair, PhaseMap, PhotogrammetricCalibration, PointCloud
from core.parallel import run_in_bands
from core.reconstruct.rays import flat
from core.reconstruct.system import System, prepare, sigma_table

MOST_STEPS, STEPS = 12, 8  # of the kernel, and in plain numpy
SETTLED_LINES = 1e-3  # a step this small leaves an error of the order of its square
LEAST_VARIANCE = 1e-8  # lines², so that a sigma of 0 has a weight
WEAK_AXIS = 0.1  # an axis with less than this share of the other's depth resolution cannot serve alone

Coordinate = tuple[Floats, Floats, tuple[float, float, float]]  # values and sigmas (H, W), see `System.line_u`


def intersect(phase: PhaseMap, calibration: PhotogrammetricCalibration | Pair) -> PointCloud:
    """Intersect all pixels of a phase map, (H, W), with u, v or both.

    `sigma_mm` is from phase noise and the calibration's covariance; `sigma_depth_mm` of Z from phase noise alone.

    NoCoordinateError if no axis was decoded, or only one along which depth changes nothing.

    A pixel has a point where the leading coordinate (of those decoded the one that changes more with depth) is valid;
    the other one takes part where it is valid too. The calibration's part of the sigma is interpolated between nodes
    and taken for equal weights of u and v.
    """
    pair = pair_for(phase, calibration)
    system = prepare(pair)
    axes = _axes(phase, system)
    # as they lie in memory: views would have the kernel compiled anew
    u, sigma_u, v, sigma_v = map(np.ascontiguousarray, (phase.u, phase.sigma_u, phase.v, phase.sigma_v))
    coordinates = {"u": (u, sigma_u, system.line_u), "v": (v, sigma_v, system.line_v)}
    first, second = coordinates[axes[0]], coordinates["v" if axes[0] == "u" else "u"]
    height, width = u.shape
    xyz = np.empty((height, width, 3), np.float32)
    sigma = np.empty((height, width, 3), np.float32)
    sigma_depth = np.empty((height, width), np.float32)
    table = sigma_table(pair, axes)
    device = (*system.matrix.ravel().tolist(), *system.vector.tolist(), *(system.radial or (0.0,) * 5))

    def band(start: int, stop: int) -> None:
        points = flat(xyz), flat(sigma), sigma_depth, start, stop
        ends = flat(system.rays), device, table.nodes, table.step, table.per_q, *points
        if system.radial is None:
            _finish_rows(*solve_rows(system, first, second, axes, start, stop), *ends)
        else:
            _intersect_rows(*first, *second, len(axes) == 2, *ends)

    run_in_bands(band, height)
    return PointCloud(xyz, sigma, sigma_depth)


def _axes(phase: PhaseMap, system: System) -> str:
    """Name the coordinates that were decoded, the leading one first."""
    slopes = dict(zip("uv", system.slopes, strict=True))
    decoded = [name for name, values in (("u", phase.u), ("v", phase.v)) if _any_finite(values)]
    if not decoded:
        raise NoCoordinateError(
            "phase map", "no pixel has a projector coordinate", "check the capture's frames and exposure"
        )
    decoded.sort(key=lambda name: -slopes[name])
    lead = decoded[0]
    if slopes[lead] < WEAK_AXIS * max(slopes.values()):
        seen = f"only {lead} was decoded, which hardly changes with depth on this rig"
        raise NoCoordinateError("phase map", seen, f"capture with patterns along {'x' if lead == 'v' else 'y'}")
    return "".join(decoded)


def _any_finite(values: Floats) -> bool:
    """Whether there is a finite value, of which mostly the first part of the image tells."""
    return any(np.isfinite(part).any() for part in np.array_split(values, 16))


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"}, inline="always")
def _along(q, X, Y, W, device):  # type: ignore[no-untyped-def]
    """Image after radial and decentring parameters at inverse depth q, and its derivative by q."""
    mx, my, mw, a1, a2, a5, a6, d0 = device[9:]
    w = 1.0 / (W + mw * q)
    x, y = (X + mx * q) * w, (Y + my * q) * w
    dx, dy = (mx - x * mw) * w, (my - y * mw) * w
    r2 = x * x + y * y
    dr2 = 2.0 * (x * dx + y * dy)
    d = 1.0 + d0 + r2 * (a1 + a2 * r2)
    dd = (a1 + 2.0 * a2 * r2) * dr2
    xy, dxy = x * y, x * dy + y * dx
    x1 = x * d + 2.0 * a5 * xy + a6 * (r2 + 2.0 * x * x)
    y1 = y * d + 2.0 * a6 * xy + a5 * (r2 + 2.0 * y * y)
    dx1 = dx * d + x * dd + 2.0 * a5 * dxy + a6 * (dr2 + 4.0 * x * dx)
    dy1 = dy * d + y * dd + 2.0 * a6 * dxy + a5 * (dr2 + 4.0 * y * dy)
    return x1, y1, dx1, dy1


@inner(error_model="numpy", fastmath={"contract", "reassoc"})
def _begin_row(u, line, rays, device, X, Y, W, q):  # type: ignore[no-untyped-def]
    """Project the rays of a row and solve for q without distortion."""
    k0, kx, ky = line
    mx, my, mw = device[9:12]
    along = kx * mx + ky * my
    for c in range(u.shape[0]):
        dx, dy = np.float64(rays[2 * c]), np.float64(rays[2 * c + 1])
        X[c] = device[0] * dx + device[1] * dy - device[2]
        Y[c] = device[3] * dx + device[4] * dy - device[5]
        W[c] = device[6] * dx + device[7] * dy - device[8]
        m = np.float64(u[c]) - k0
        q[c] = (kx * X[c] + ky * Y[c] - m * W[c]) / (m * mw - along)


@inner(error_model="numpy", fastmath={"contract", "reassoc"})
def _step_one(u, sigma, line, device, X, Y, W, q, sigma_q, last):  # type: ignore[no-untyped-def]
    """Newton's step in a row for one coordinate alone, a fifth faster than for two; how many move still."""
    k0, kx, ky = line
    moving = 0
    for c in range(u.shape[0]):
        x1, y1, dx1, dy1 = _along(q[c], X[c], Y[c], W[c], device)
        slope = kx * dx1 + ky * dy1
        rest = np.float64(u[c]) - (k0 + kx * x1 + ky * y1)
        q[c] += rest / slope
        sigma_q[c] = np.float64(sigma[c]) / abs(slope)
        last[c] = abs(rest)
        moving += last[c] > SETTLED_LINES
    return moving


@inner(error_model="numpy", fastmath={"contract", "reassoc"})
def _step_two(u, sigma_u, line_u, v, sigma_v, line_v, device, X, Y, W, q, sigma_q, last):  # type: ignore[no-untyped-def]
    """Gauss and Newton's step in a row, the second coordinate without weight where it is NaN; how many move still."""
    for_u, for_v = line_u, line_v
    moving = 0
    for c in range(u.shape[0]):
        x1, y1, dx1, dy1 = _along(q[c], X[c], Y[c], W[c], device)
        slope_u = for_u[1] * dx1 + for_u[2] * dy1
        slope_v = for_v[1] * dx1 + for_v[2] * dy1
        rest_u = np.float64(u[c]) - (for_u[0] + for_u[1] * x1 + for_u[2] * y1)
        rest_v = np.float64(v[c]) - (for_v[0] + for_v[1] * x1 + for_v[2] * y1)
        su, sv = np.float64(sigma_u[c]), np.float64(sigma_v[c])
        # a sigma that is missing counts as one line; NaN fails every comparison
        variance_u = max(su * su, LEAST_VARIANCE) if su >= 0 else 1.0
        variance_v = max(sv * sv, LEAST_VARIANCE) if sv >= 0 else 1.0
        known = rest_v == rest_v
        weight_u = slope_u / variance_u
        weight_v = slope_v / variance_v if known else 0.0
        rest_v = rest_v if known else 0.0
        information = weight_u * slope_u + weight_v * slope_v
        step = (weight_u * rest_u + weight_v * rest_v) / information
        q[c] += step
        sigma_q[c] = 1.0 / np.sqrt(information)
        last[c] = abs(step) * max(abs(slope_u), abs(slope_v))
        moving += last[c] > SETTLED_LINES
    return moving


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"}, inline="always")
def _seven(values, k):  # type: ignore[no-untyped-def]
    return values[k], values[k + 1], values[k + 2], values[k + 3], values[k + 4], values[k + 5], values[k + 6]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"}, inline="always")
def _polynomial(x, t, first, last):  # type: ignore[no-untyped-def]
    """A variance: the square of a polynomial whose coefficients change from `first` to `last` with t from 0 to 1."""
    value = first[0] + t * (last[0] - first[0])
    for k in range(1, 7):
        value = value * x + (first[k] + t * (last[k] - first[k]))
    return value * value


@inner(error_model="numpy", fastmath={"contract", "reassoc"})
def _end(rays, q, sigma_q, last, mw, W, left, right, per_column, per_q, xyz, sigma, sigma_depth):  # type: ignore[no-untyped-def]
    """Points and sigmas between two columns of nodes, from the inverse depths."""
    x0, y0, z0 = _seven(left, 0), _seven(left, 7), _seven(left, 14)
    x1, y1, z1 = _seven(right, 0), _seven(right, 7), _seven(right, 14)
    low, high, lower, higher = left[21], left[22], right[21] - left[21], right[22] - left[22]
    for c in range(q.shape[0]):
        good = (last[c] <= SETTLED_LINES) & (q[c] > 0) & (W[c] + mw * q[c] > 0)
        s = 1.0 / q[c] if good else np.nan
        s2 = s * s
        noise = sigma_q[c] * s2
        dx, dy = np.float64(rays[2 * c]), np.float64(rays[2 * c + 1])
        xyz[3 * c], xyz[3 * c + 1], xyz[3 * c + 2] = dx * s, dy * s, -s
        sigma_depth[c] = noise
        t = c * per_column
        x = min(max(q[c] * per_q - 1.0, low + t * lower), high + t * higher)
        noise2, s4 = noise * noise, s2 * s2
        sigma[3 * c] = np.sqrt(np.float32(dx * dx * noise2 + s4 * _polynomial(x, t, x0, x1)))
        sigma[3 * c + 1] = np.sqrt(np.float32(dy * dy * noise2 + s4 * _polynomial(x, t, y0, y1)))
        sigma[3 * c + 2] = np.sqrt(np.float32(noise2 + s4 * _polynomial(x, t, z0, z1)))


@inner(error_model="numpy")
def _interpolate(table, row, rows, nodes):  # type: ignore[no-untyped-def]
    """Nodes at a row; one by one: numba names a whole array's expression by an address, other in every build."""
    at = row * (table.shape[0] - 1) / max(rows - 1, 1)
    i = min(int(at), table.shape[0] - 2)
    for j in range(nodes.shape[0]):
        for k in range(nodes.shape[1]):
            nodes[j, k] = (1 - (at - i)) * table[i, j, k] + (at - i) * table[i + 1, j, k]


@inner(error_model="numpy")
def _end_row(r, q, sigma_q, last, W, rays, device, table, step, per_q, nodes, xyz, sigma, sigma_depth):  # type: ignore[no-untyped-def]
    """Points and sigmas of a row from its inverse depths; `nodes` is scratch memory."""
    _interpolate(table, r, xyz.shape[0], nodes)
    for j in range(nodes.shape[0] - 1):
        a, b = j * step, min((j + 1) * step, q.shape[0])
        _end(
            rays[r, 2 * a : 2 * b], q[a:b], sigma_q[a:b], last[a:b], device[11], W[a:b],
            nodes[j], nodes[j + 1], 1.0 / step, per_q,
            xyz[r, 3 * a : 3 * b], sigma[r, 3 * a : 3 * b], sigma_depth[r, a:b],
        )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def _intersect_rows(  # type: ignore[no-untyped-def]
    u, sigma_u, line_u, v, sigma_v, line_v, both, rays, device, table, step, per_q, xyz, sigma, sigma_depth, start, stop
):
    """Intersect rows start to stop - 1."""
    width = u.shape[1]
    # arrays of their own: the compiler does not do several pixels at once where the columns of one array are written
    X, Y, W = np.empty(width), np.empty(width), np.empty(width)
    q, sigma_q, last = np.empty(width), np.empty(width), np.empty(width)
    nodes = np.empty(table.shape[1:])
    for r in range(start, stop):
        _begin_row(u[r], line_u, rays[r], device, X, Y, W, q)
        for _ in range(MOST_STEPS):
            if both:
                moving = _step_two(
                    u[r], sigma_u[r], line_u, v[r], sigma_v[r], line_v, device, X, Y, W, q, sigma_q, last
                )
            else:
                moving = _step_one(u[r], sigma_u[r], line_u, device, X, Y, W, q, sigma_q, last)
            if moving == 0:
                break
        _end_row(r, q, sigma_q, last, W, rays, device, table, step, per_q, nodes, xyz, sigma, sigma_depth)


@njit(cache=True, nogil=True, error_model="numpy")
def _finish_rows(  # type: ignore[no-untyped-def]
    q, sigma_q, last, W, rays, device, table, step, per_q, xyz, sigma, sigma_depth, start, stop
):
    """Points and sigmas of rows start to stop - 1 from inverse depths found elsewhere."""
    nodes = np.empty(table.shape[1:])
    for r in range(start, stop):
        k = r - start
        _end_row(r, q[k], sigma_q[k], last[k], W[k], rays, device, table, step, per_q, nodes, xyz, sigma, sigma_depth)


def solve_rows(
    system: System, first: Coordinate, second: Coordinate, axes: str, start: int, stop: int
) -> tuple[Array, Array, Array, Array]:
    """Inverse depths of rows start to stop - 1, in plain numpy, where the kernel does not know the projector's lens.

    Each coordinate has values (H, W) in lines, their sigmas, and (k0, kx, ky); `axes` names those decoded, the first
    one first: "uv", "vu", "u" or "v".
    Gives, (rows, W): inverse depth, its sigma, the last step in lines, and the depth in the projector at q = 0.
    """
    values, _, (k0, kx, ky) = first
    spec, interior = system.devices.projector
    lens = lens_of(interior)
    rays = system.rays[start:stop].astype(np.float64)
    directions = np.concatenate([rays, np.full((*rays.shape[:2], 1), -1.0)], axis=-1)
    X, Y, W = np.moveaxis(directions @ system.matrix.T, -1, 0)
    mx, my, mw = system.vector
    m = values[start:stop].astype(np.float64) - k0
    q = (kx * X + ky * Y - m * W) / (m * mw - kx * mx - ky * my)
    per_line = np.array([1 / spec.pitch_mm[0], -1 / spec.pitch_mm[1]])
    middle = np.array([(spec.width - 1) / 2, (spec.height - 1) / 2])
    use = slice("u" not in axes, 1 + ("v" in axes))
    decoded = [first, second][: len(axes)][:: 1 if axes[0] == "u" else -1]  # as the image has them: u, then v
    seen = np.stack([c[0][start:stop] for c in decoded], axis=-1).astype(np.float64)
    spread = np.stack([c[1][start:stop] for c in decoded], axis=-1).astype(np.float64)
    variance = np.maximum(np.nan_to_num(spread**2, nan=1.0), LEAST_VARIANCE)
    sigma_q, last = np.full(q.shape, np.nan), np.full(q.shape, np.inf)
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            w = 1.0 / (W + mw * q)
            xy = np.stack([(X + mx * q) * w, (Y + my * q) * w], axis=-1)
            along = (system.vector[:2] - xy * mw) * w[..., None]
            rest = seen - (lens.distort(interior, xy) * per_line + middle)[..., use]
            slopes = ((lens.derivatives(interior, xy)[0] @ along[..., None])[..., 0] * per_line)[..., use]
            weight = np.where(np.isfinite(rest), slopes / variance, 0.0)
            information = np.einsum("rck,rck->rc", weight, slopes)
            step = np.einsum("rck,rck->rc", weight, np.nan_to_num(rest)) / information
            q, last = q + step, np.abs(step) * np.abs(slopes).max(axis=-1)
            sigma_q = 1.0 / np.sqrt(information)
            if not np.any(last > 1e-6):
                break
    return q, sigma_q, np.nan_to_num(last, nan=np.inf), np.ascontiguousarray(W)
