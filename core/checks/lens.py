"""Whether lens models are of the right form: what one more radial term would change."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.geometry import project_with_derivatives, ray_directions
from core.lazy import dataclass
from core.model import AdjustedDevice, Adjustment, Array, Concern, Ints
from core.numerics import distinct

SIGNIFICANT = 5.0  # sigmas of the term: of 600 adjusted devices of right form 3.4 at most
MATTERS = 0.1  # px or lines, by which it changes some place of the image
POWERS = 6, 8, 10  # of the radius: the first that the model has not
CONTAINED = 1e-8  # square of such a term, beside what the model's own parameters make of it
FEWEST, MOST = 50, 800  # redundancy that tells a term; points, and stations, that are worth it
POSE, POSED = 6, 4  # parameters; points that tell them
RASTER = 24  # places along each side of the image
TINY = 1e-300
RIDGE = 1e-12  # of the mean diagonal: for movements of all points, which poses make, too


@dataclass(frozen=True)
class Term:
    """A radial term that was not adjusted: in sigmas, and by how much it moves what was seen and any place, px."""

    sigmas: float
    seen_px: float
    all_px: float


def lens_concerns(adjustment: Adjustment) -> list[Concern]:
    """H0: one radial term more is 0, for every device; tested where it would change the image.

    Where no targets were seen, as in corners, the form of the model alone says what the lens does, and sigmas do not
    contain that it is another.
    """
    concerns = []
    for name, device in adjustment.devices.items():
        term = lacking_term(adjustment, name, device)
        if term is None or abs(term.sigmas) < SIGNIFICANT or term.all_px < MATTERS:
            continue
        text = (
            f"{name}: the lens model lacks a radial term (of {abs(term.sigmas):.2g} sigmas) that moves the image by up "
            f"to {term.seen_px:.2g} px or lines where targets were seen, and by {term.all_px:.2g} elsewhere: choose a "
            "model with more terms, or capture the board in all corners of the image"
        )
        concerns.append(Concern("doubtful", text))
    return concerns


def lacking_term(adjustment: Adjustment, name: str, device: AdjustedDevice) -> Term | None:
    """Estimate the first radial term that a device's adjusted parameters do not make up for; None if nothing tells.

    By the device's images alone, with poses and points free: what is left of the term then is free of all else.
    """
    network, free = adjustment.network, np.flatnonzero(device.sigma > 0)
    own, k = np.flatnonzero(network.made_by[name]), len(free)
    of_station = network.observation_station[own]
    stations = [own[of_station == s] for s in distinct(of_station) if np.count_nonzero(of_station == s) >= POSED]
    if not k or not stations or len(stations) > MOST:
        return None
    used = np.concatenate(stations)
    points, count = distinct(network.observation_point[used]), np.count_nonzero(np.isfinite(adjustment.residuals[used]))
    redundancy = int(count) - POSE * len(stations) - 3 * len(points) - k
    if redundancy < FEWEST or len(points) > MOST:
        return None
    normal, images = _equations(adjustment, device, free, stations, points)
    size = 3 * len(points)
    normal[:size, :size].flat[:: size + 1] += RIDGE * np.trace(normal[:size, :size]) / size
    left = normal[size:, size:] - normal[size:, :size] @ np.linalg.solve(normal[:size, :size], normal[:size, size:])
    unit = np.sqrt(np.maximum(np.diag(normal)[size:], TINY))
    left /= np.outer(unit, unit)
    made_up = np.linalg.lstsq(left[:k, :k], left[:k, k:], rcond=1e-12)[0]
    rest = left[k:, k:] - left[k:, :k] @ made_up
    column = next((c for c in range(len(POWERS)) if rest[c, c] > CONTAINED), None)
    if column is None:
        return None
    amount = rest[column, -1] / rest[column, column] * unit[-1] / unit[k + column]
    by_parameters = made_up[:, column] * unit[k + column] / unit[:k]
    moved = [
        np.linalg.norm(amount * (x[..., k + column] - x[..., :k] @ by_parameters), axis=-1)
        for x in (images, _raster(device, free))
    ]
    # residuals of computed images are rounding alone
    sigmas = rest[column, -1] / np.sqrt(max(float(rest[column, column] * rest[-1, -1]) / redundancy, TINY))
    return Term(float(sigmas), *(float(np.fmax.reduce(each, axis=None)) for each in moved))


def _equations(
    adjustment: Adjustment, device: AdjustedDevice, free: Ints, stations: Sequence[Ints], points: Ints
) -> tuple[Array, Array]:
    """Normal equations of a device's images without their poses: of points, parameters, terms and residuals.

    `stations` are the observations of each. Also how the images (m, 2, k) change with parameters and terms.
    """
    network, size, width = adjustment.network, 3 * len(points), len(free) + len(POWERS) + 1
    of_points, mixed = np.zeros((len(points), 3, 3)), np.zeros((len(points), 3, width))
    of_others, of_poses = np.zeros((width, width)), np.zeros((len(stations), POSE, size + width))
    images = []
    for some, of_pose in zip(stations, of_poses, strict=True):
        xyz, pose = (
            adjustment.points_mm[network.observation_point[some]],
            adjustment.station_from_object[network.observation_station[some[0]]],
        )
        found = project_with_derivatives(device.spec, device.interior, xyz, pose)
        images.append(np.concatenate([found.by_interior[..., free], _radial(device, pose.apply(xyz))], axis=-1))
        residuals = adjustment.residuals[some]
        weight = np.where(np.isfinite(residuals), 1 / network.observation_sigma[some], 0)[..., None]
        columns = found.by_pose, found.by_point, np.concatenate([images[-1], residuals[..., None]], axis=-1)
        by_pose, by_point, by_others = (np.nan_to_num(each * weight) for each in columns)
        at = np.searchsorted(points, network.observation_point[some])
        of_points[at] += np.einsum("nia,nib->nab", by_point, by_point)
        mixed[at] += np.einsum("nia,nik->nak", by_point, by_others)
        of_others += np.einsum("nij,nik->jk", by_others, by_others)
        Q = np.linalg.qr(by_pose.reshape(-1, POSE))[0].reshape(by_pose.shape)
        of_pose[:, :size].reshape(POSE, -1, 3)[:, at] = np.einsum("nic,nia->cna", Q, by_point)
        of_pose[:, size:] = np.einsum("nic,nik->ck", Q, by_others)
    eliminated = of_poses.reshape(-1, size + width)
    normal = -eliminated.T @ eliminated
    row = np.arange(size).reshape(-1, 3)
    normal[row[:, :, None], row[:, None]] += of_points
    normal[:size, size:] += mixed.reshape(size, width)
    normal[size:, :size] += mixed.reshape(size, width).T
    normal[size:, size:] += of_others
    return normal, np.concatenate(images)


def _raster(device: AdjustedDevice, free: Ints) -> Array:
    """How places (n, 2, k) all over the image change with parameters and terms."""
    u, v = np.meshgrid(*(np.linspace(0, n - 1, RASTER) for n in (device.spec.width, device.spec.height)))
    rays = device.interior.c_mm * ray_directions(device.spec, device.interior, np.stack([u, v], axis=-1))
    by_interior = project_with_derivatives(device.spec, device.interior, rays).by_interior[..., free]
    found = np.concatenate([by_interior, _radial(device, rays)], axis=-1)
    return np.asarray(found.reshape(-1, *found.shape[-2:]))


def _radial(device: AdjustedDevice, points: NDArray[np.floating]) -> Array:
    """Change (..., 2, k) px of the images of points in the device's frame with radial terms, 1 at the half diagonal."""
    with np.errstate(invalid="ignore", divide="ignore"):
        xy = -device.interior.c_mm * points[..., :2] / points[..., 2:]
    radius = np.linalg.norm(xy, axis=-1, keepdims=True) / device.spec.half_diagonal_mm
    to_pixel = np.array([1.0, -1.0]) / np.array(device.spec.pitch_mm)
    return np.asarray((xy * to_pixel)[..., None] * radius[..., None] ** np.array(POWERS))
