"""Where the targets of boards stood, seen by the calibrated camera and projector."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np

from core.geometry import pair_of, perturbed, project, ray_directions
from core.lazy import dataclass
from core.model import Array, DeviceSpec, Interior, Pair, PhotogrammetricCalibration, TargetSet, Testfield

START = 50.0  # focal lengths: where the search for a point on a ray begins
STEPS = 25
LEAST = 4  # targets that make a plate
LEAST_EPIPOLAR = 6


@dataclass(frozen=True)
class Plates:
    """Boards at known positions, their targets in the camera's frame in mm.

    `xyz_mm` has the shape (plates, targets, 3), NaN where a target was not measured; `nominal_mm` (targets, 3) those on
    the board. `uncertain_mm` (k, plates, targets, 3) is the same by k calibrations, each off by one sigma of its own:
    squares of differences add up to a variance. `epipolar` is by plate the r.m.s. of what the fourth observation of
    each point leaves over, lines, and the ratio of its squares, calibration's uncertainty taken out, to what the sigmas
    allow, with their number; nothing where one axis was decoded.
    """

    names: tuple[str, ...]
    z_mm: Array
    nominal_mm: Array
    xyz_mm: Array
    uncertain_mm: Array
    epipolar: Mapping[str, tuple[float, float, int]]

    def only(self, names: Sequence[str]) -> Plates:
        """Give some of the plates."""
        kept = np.isin(self.names, names)
        chosen = {name: self.epipolar[name] for name in names if name in self.epipolar}
        xyz, uncertain = self.xyz_mm[kept], self.uncertain_mm[:, kept]
        return Plates(tuple(names), self.z_mm[kept], self.nominal_mm, xyz, uncertain, chosen)


def see_plates(
    calibration: PhotogrammetricCalibration, targets: Sequence[TargetSet], z_mm: Mapping[str, float], board: Testfield
) -> Plates:
    """Intersect the targets of every plate that has some."""
    index = board.index()
    used = [t for t in targets if t.capture in z_mm and len(t.row) >= LEAST]
    at, keep = [], []
    for i, t in enumerate(used):
        place = [index.get(key, -1) for key in t.keys]
        at += [(i, k) for k in place if k >= 0]
        keep.append(np.array(place) >= 0)

    def together(name: str) -> Array:
        return np.concatenate([getattr(t, name)[k] for t, k in zip(used, keep, strict=True)])

    shape = (len(used), len(board.row), 3)
    if not at:
        nothing = np.zeros((0, *shape[1:]))
        return Plates((), np.zeros(0), board.xyz_mm, nothing, np.zeros((0, *nothing.shape)), {})
    plate, target = np.array(at).T
    seen = together("camera_uv"), together("projector_uv"), together("projector_sigma")
    pair = pair_of(calibration)
    values, vectors = np.linalg.eigh(pair.covariance)
    changes = (vectors * np.sqrt(np.maximum(values, 0.0))).T[values > values[-1] * 1e-14]
    start = intersect_targets(pair, *seen)
    found = [start, *(intersect_targets(perturbed(pair, change), *seen, near=start[0]) for change in changes)]
    placed = np.full((len(found), *shape), np.nan)
    for one, (points, _, _) in zip(placed, found, strict=True):
        one[plate, target] = points
    sound = np.isfinite(placed[0, :, :, 0]).sum(axis=1) >= LEAST
    off = np.array([off for _, off, _ in found])
    epipolar = {}
    for i, t in enumerate(used):
        own = (plate == i) & np.isfinite(off).all(axis=0)
        if own.sum() >= LEAST_EPIPOLAR:
            epipolar[t.capture] = (*_beyond_chance(off[:, own], found[0][2][own]), int(own.sum()))
    names = tuple(t.capture for t, use in zip(used, sound, strict=True) if use)
    z = np.array([z_mm[name] for name in names])
    return Plates(names, z, board.xyz_mm, placed[0, sound], placed[1:, sound], epipolar)


def _beyond_chance(off: Array, sigma: Array) -> tuple[float, float]:
    """R.m.s. of residuals, the first row of (k + 1, n), and their ``eᵀ C⁻¹ e`` over n; the others show errors of k."""
    e, D = off[0] / sigma, (off[1:] - off[0]) / sigma
    rest = e - D.T @ np.linalg.solve(np.eye(len(D)) + D @ D.T, D @ e)
    return float(np.sqrt(np.mean(off[0] ** 2))), float(e @ rest) / len(e)


def pose_plates(
    spec: DeviceSpec,
    interior: Interior,
    targets: Sequence[TargetSet],
    z_mm: Mapping[str, float],
    board: Testfield,
    *,
    seen: bool = False,
) -> Plates:
    """Place the nominal board in front of the camera alone, where there is no calibrated projector.

    With `seen`, targets are where their rays meet the board, each at the height that the board gives it.
    """
    index = board.index()
    names, z, xyz = [], [], []
    for t in targets:
        use = np.asarray(np.array([key in index for key in t.keys], bool) & np.isfinite(t.camera_uv).all(axis=1))
        if use.sum() < LEAST:
            continue
        own = [index[key] for key, used in zip(t.keys, use.tolist(), strict=True) if used]
        nominal = board.xyz_mm[own]
        tangents = ray_directions(spec, interior, t.camera_uv[use])[:, :2] * (1.0, -1.0)
        found, rotation, shift = cv2.solvePnP(nominal, np.ascontiguousarray(tangents), np.eye(3), None)
        if not found:
            continue
        R, places = cv2.Rodrigues(rotation)[0], board.xyz_mm
        if seen:
            rays, origin = np.column_stack([tangents, np.ones(len(tangents))]) @ R, R.T @ shift.ravel()
            places = np.full_like(places, np.nan)
            places[own] = (nominal[:, 2:] + origin[2]) / rays[:, 2:] * rays - origin
        names.append(t.capture)
        z.append(z_mm[t.capture])
        xyz.append((places @ R.T + shift.ravel()) * (1.0, -1.0, -1.0))
    stacked = np.reshape(np.array(xyz), (len(names), len(board.row), 3))
    return Plates(tuple(names), np.array(z), board.xyz_mm, stacked, stacked[None][:0], {})


def intersect_targets(
    calibration: Pair, uv: Array, lines: Array, sigma: Array, near: Array | None = None
) -> tuple[Array, Array, Array]:
    """Give the points of targets, (n, 3) mm, and the fourth observation's residual and sigma, (n,) lines.

    `uv` and `lines`, (n, 2), are the camera's and projector's coordinates, `sigma` the projector's; NaN where not
    decoded. `near` are the points by nearly the same calibration, where these are known.
    """
    spec, interior = calibration.camera.spec, calibration.camera.interior
    rays = ray_directions(spec, interior, uv)
    other = calibration.projector.spec, calibration.projector.interior
    weight = 1.0 / np.maximum(sigma, 1e-4) ** 2
    weight = np.asarray(np.where(np.isfinite(lines) & np.isfinite(weight), weight, 0.0))
    seen = np.where(weight > 0, lines, 0.0)
    depth = np.full(len(rays), START * spec.nominal_c_mm)
    # first as if the lens were perfect: far outside of the image its polynomial turns round and fits a second time
    devices = [(other[0], Interior(other[1].c_mm, other[1].x0_mm, other[1].y0_mm)), other]
    if near is not None and np.isfinite(near).all():
        depth, devices = -near[:, 2], [other]
    for device in devices:
        for _ in range(STEPS):
            at, slope = _along(calibration, device, rays, depth)
            rest = np.where(weight > 0, seen - at, 0.0)
            with np.errstate(divide="ignore", invalid="ignore"):
                step = np.sum(weight * slope * rest, axis=1) / np.sum(weight * slope**2, axis=1)
            step = np.clip(np.where(np.isfinite(step), step, 0.0), -0.3 * depth, 0.5 * depth)
            depth = depth + step
            if np.all(np.abs(step) < 1e-7 * depth):
                break
    at, slope = _along(calibration, other, rays, depth)
    valid = np.asarray((weight > 0).any(axis=1) & np.isfinite(at).all(axis=1))
    both = np.asarray((weight > 0).all(axis=1) & valid)
    rest = np.where(both[:, None], seen - at, np.nan)
    with np.errstate(invalid="ignore"):
        across = np.stack([-slope[:, 1], slope[:, 0]], axis=1) / np.linalg.norm(slope, axis=1)[:, None]
    off = np.sum(rest * across, axis=1)
    return np.where(valid[:, None], rays * depth[:, None], np.nan), off, np.sqrt(np.sum((across * sigma) ** 2, axis=1))


def _along(calibration: Pair, other: tuple[DeviceSpec, Interior], rays: Array, depth: Array) -> tuple[Array, Array]:
    """Projector coordinates, (n, 2), of points on rays at depths, and their derivatives by the depth."""
    step = 1e-4 * depth
    pose = calibration.projector_from_camera
    low = project(*other, rays * (depth - step)[:, None], pose)
    high = project(*other, rays * (depth + step)[:, None], pose)
    return (low + high) / 2, (high - low) / (2 * step)[:, None]
