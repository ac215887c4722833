"""Whether lens models are of the right form: what one more radial term would change."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.checks.lacking import Lacking
from core.geometry import project_with_derivatives, ray_directions
from core.lazy import dataclass
from core.model import AdjustedDevice, Array, Concern, Ints

SIGNIFICANT = 5.0  # sigmas of the term: of 600 adjusted devices of right form 3.4 at most
MATTERS = 0.1  # px or lines, by which it changes some place of the image
POWERS = 6, 8, 10  # of the radius: the first that the model has not
CONTAINED = 1e-8  # square of such a term, beside what the model's own parameters make of it
RASTER = 24  # places along each side of the image


@dataclass(frozen=True)
class Term:
    """A radial term that was not adjusted: in sigmas, and by how much it moves what was seen and any place, px."""

    sigmas: float
    seen_px: float
    all_px: float


def lens_concerns(name: str, device: AdjustedDevice, found: Lacking) -> list[Concern]:
    """H0: one radial term more is 0; tested where it would change the image. `found` begins with those of `POWERS`.

    Where no targets were seen, as in corners, the form of the model alone says what the lens does, and sigmas do not
    contain that it is another.
    """
    term = lacking_term(device, found)
    if term is None or abs(term.sigmas) < SIGNIFICANT or term.all_px < MATTERS:
        return []
    text = (
        f"{name}: the lens model lacks a radial term (of {abs(term.sigmas):.2g} sigmas) that moves the image by up "
        f"to {term.seen_px:.2g} px or lines where targets were seen, and by {term.all_px:.2g} elsewhere: choose a "
        "model with more terms, or capture the board in all corners of the image"
    )
    return [Concern("doubtful", text)]


def lacking_term(device: AdjustedDevice, found: Lacking) -> Term | None:
    """The first radial term that a device's adjusted parameters do not make up for; None if they do for all."""
    column = next((c for c in range(len(POWERS)) if found.rest[c, c] > CONTAINED), None)
    if column is None:
        return None
    k, amount, by_parameters = len(found.free), found.amount(column), found.by_parameters(column)
    moved = [
        np.linalg.norm(amount * (x[..., k + column] - x[..., :k] @ by_parameters), axis=-1)
        for x in (found.images, _raster(device, found.free))
    ]
    return Term(found.sigmas(column), *(float(np.fmax.reduce(each, axis=None)) for each in moved))


def _raster(device: AdjustedDevice, free: Ints) -> Array:
    """How places (n, 2, k) all over the image change with parameters and terms."""
    u, v = np.meshgrid(*(np.linspace(0, n - 1, RASTER) for n in (device.spec.width, device.spec.height)))
    rays = device.interior.c_mm * ray_directions(device.spec, device.interior, np.stack([u, v], axis=-1))
    by_interior = project_with_derivatives(device.spec, device.interior, rays).by_interior[..., free]
    found = np.concatenate([by_interior, radial(device, rays)], axis=-1)
    return np.asarray(found.reshape(-1, *found.shape[-2:]))


def radial(device: AdjustedDevice, points: NDArray[np.floating]) -> Array:
    """Change (..., 2, k) px of the images of points in the device's frame with radial terms, 1 at the half diagonal."""
    with np.errstate(invalid="ignore", divide="ignore"):
        xy = -device.interior.c_mm * points[..., :2] / points[..., 2:]
    radius = np.linalg.norm(xy, axis=-1, keepdims=True) / device.spec.half_diagonal_mm
    to_pixel = np.array([1.0, -1.0]) / np.array(device.spec.pitch_mm)
    return np.asarray((xy * to_pixel)[..., None] * radius[..., None] ** np.array(POWERS))
