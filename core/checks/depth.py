"""A depth calibration held against the photogrammetric one that saw the same plates."""

from __future__ import annotations

import numpy as np

from core.checks.lengths import LEAST_OFF, scale_of
from core.checks.network import LEVEL, focal_concerns
from core.checks.plates import Plates
from core.digits import unit_hint
from core.geometry import matrix_from_rotation_vector, rotation_vector_from_matrix
from core.model import Array, Concern, DepthCalibration
from core.numerics import chi_square_limit, fisher_limit

FAILED = 3.0  # times the limits
FEWEST, REPEATED = 8, 3  # targets that tell a plane's form; positions that tell their noise
UNEVEN, MOST_UNEVEN = 0.5, 4.0  # of the noise of depths
NEARLY = 0.2  # by which c may be off the nominal one beside a mistaken unit


def placed_concerns(depth: DepthCalibration, plates: Plates | None) -> list[Concern]:
    """Compare where a depth calibration has its plate with where the plate's targets were seen.

    H0: distances along the targets' rays differ by no plane over the field, beyond what both leave uncertain. What is
    known of the camera is in both, and counts twice. The board's size is a matter of `lengths`: as far as the plate's
    distance goes by it and not by the plate's travel, the board is as large here as it is seen.
    """
    if plates is None or not len(plates.names) or depth.covariance is None:
        return []
    factor, off = min(_off(depth, plates, size) for size in (1.0, scale_of(plates, plates.xyz_mm)))
    limit = LEAST_OFF * float(np.linalg.norm(depth.camera_from_plate.translation_mm))
    if factor <= 1 or off <= limit:
        return []
    text = (
        f"the plate lies {off:.2g} mm r.m.s. off where the photogrammetric calibration sees its targets, {factor:.2g} "
        "times what both leave uncertain: correct x_mm, y_mm and z_mm of the plate's testfield file, or calibrate "
        "both again if the camera was moved between"
    )
    return [Concern("failed" if min(factor, off / limit) > FAILED else "doubtful", text, "plates")]


def flatness_concerns(depth: DepthCalibration, plates: Plates | None) -> list[Concern]:
    """H0: the plate is flat; its targets lie off a plane by noise alone, and not alike at all positions.

    Curves go through the plate's surface, as if it were flat, and no residual shows that it is not.
    """
    if plates is None or not depth.noise_rms_mm:
        return []
    off = np.full(plates.xyz_mm.shape[:2], np.nan)
    for xyz, own in zip(plates.xyz_mm, off, strict=True):
        seen = np.isfinite(xyz).all(axis=1)
        if np.count_nonzero(seen) >= FEWEST:
            about = xyz[seen] - xyz[seen].mean(axis=0)
            normal = np.linalg.svd(about, full_matrices=False)[2][2]
            own[seen] = about @ (normal * np.sign(normal[2]))
    count = np.isfinite(off).sum(axis=0)
    off, count = off[:, count >= REPEATED], count[count >= REPEATED]
    if len(count) < FEWEST:
        return []
    mean, spread = np.nanmean(off, axis=0), np.nanvar(off, axis=0, ddof=1)
    noise = float(np.mean(spread / count))
    form = max(float(np.mean(mean**2)) - noise, 0.0) ** 0.5
    free = int(np.sum(count - 1))
    if np.mean(mean**2) <= fisher_limit(len(count) - 3, free, LEVEL) * noise or form <= UNEVEN * depth.noise_rms_mm:
        return []
    text = (
        f"the plate is not flat: its targets lie {form:.2g} mm r.m.s. off a plane, alike at all positions, and depths "
        f"are off by as much there (noise {depth.noise_rms_mm:.2g} mm): use a flat plate"
    )
    return [Concern("failed" if form > MOST_UNEVEN * depth.noise_rms_mm else "doubtful", text, "plates")]


def travel_concerns(depth: DepthCalibration, camera: str) -> list[Concern]:
    """Hold the camera that the plate alone orients against the nominal one.

    How its targets grow along the travel gives their distance in mm of z, and their size there gives c.
    """
    if depth.covariance is None:
        return []
    c_mm, ratio = depth.camera.c_mm, depth.camera.c_mm / depth.camera_spec.nominal_c_mm
    of_z, of_board = unit_hint(ratio, within=NEARLY), unit_hint(1 / ratio, within=NEARLY)
    given = {"z_mm of the plates": of_z or not of_board, "x_mm and y_mm of their testfield file": not of_z}
    suspected = " or ".join(name for name, wrong in given.items() if wrong)
    remedy = f"correct nominal_c_mm, pitch_mm, or {suspected}{of_z or of_board}"
    return focal_concerns(camera, depth.camera_spec, c_mm, float(depth.covariance[0, 0]) ** 0.5, remedy)


def _off(depth: DepthCalibration, plates: Plates, scale: float) -> tuple[float, float]:
    """How many times the limit of chance a plate of so many times its size is off, and by what, r.m.s. in mm."""
    assert depth.covariance is not None
    pose, axis = depth.camera_from_plate, depth.axis_direction
    size = np.array([1.0, 1.0, 1.0, scale, scale, scale, 1.0, 1.0])
    outer = size * [*rotation_vector_from_matrix(pose.rotation), *pose.translation_mm, *(axis[:2] / axis[2])]
    values, vectors = np.linalg.eigh(depth.covariance[-len(outer) :, -len(outer) :])
    by_plate = [outer + change for change in (vectors * np.sqrt(np.maximum(values, 0.0))).T]
    seen, sign = plates.xyz_mm, float(np.sign(axis[2]))
    own = _apart(plates.z_mm, seen, outer, sign)
    use = np.isfinite(own)
    tangents = seen[use][:, :2] / seen[use][:, 2:]
    A = np.column_stack([np.ones(len(tangents)), (tangents - tangents.mean(axis=0)) / np.ptp(tangents, axis=0).max()])
    fit = np.linalg.pinv(A)
    others = [_apart(plates.z_mm, seen, one, sign) for one in by_plate]
    others += [_apart(plates.z_mm, uncertain, outer, sign) for uncertain in plates.uncertain_mm]
    changes = np.array([fit @ (other[use] - own[use]) for other in others])
    found, left = fit @ own[use], own[use] - A @ (fit @ own[use])
    C = changes.T @ changes + np.var(left) * fit @ fit.T
    factor = (float(found @ np.linalg.pinv(C, hermitian=True) @ found) / chi_square_limit(len(found), LEVEL)) ** 0.5
    return factor, float(np.sqrt(np.mean((A @ found) ** 2)))


def _apart(z_mm: Array, seen: Array, outer: Array, sign: float) -> Array:
    """How much further targets (plates, n, 3) are seen than the plate's plane lies on their rays: (plates, n) mm."""
    turn, shift, slopes = np.split(outer, [3, 6])
    direction = sign * np.append(slopes, 1.0)
    R = matrix_from_rotation_vector(turn)
    origins = shift + np.outer(z_mm, R @ (direction / np.linalg.norm(direction)))
    normal, far = R[:, 2], np.linalg.norm(seen, axis=2)
    return np.asarray(far - (origins @ normal)[:, None] / (seen @ normal) * far)
