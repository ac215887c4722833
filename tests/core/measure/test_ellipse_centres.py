"""Fitted ellipses against discs of a renderer of this test's own: another point image, another noise, loose lines."""

import cv2
import numpy as np
import pytest

from core.measure.centroid import centroids, noise_model
from core.measure.ellipse import ellipse_centres
from core.measure.profile import profiles
from core.measure.rays import Rays

FINE = 9  # samples per pixel along one axis
PITCH = 22  # px from dot to dot


def discs(semi_axes, defocus_px, rng, rows=7, cols=9):
    """An image of tilted ellipses at random places in their pixels, out of focus: a disc, not a Gaussian."""
    height, width = (rows + 1) * PITCH, (cols + 1) * PITCH
    v, u = (np.mgrid[0 : height * FINE, 0 : width * FINE] + 0.5) / FINE - 0.5
    grid = np.stack(np.meshgrid(np.arange(cols), np.arange(rows)), axis=-1).reshape(-1, 2)
    centre = (grid + 1.0) * PITCH + rng.uniform(-0.5, 0.5, grid.shape)
    turn = np.deg2rad(33)
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    shape = R @ np.diag(semi_axes) @ R.T
    cover, to_unit = np.zeros(u.shape), np.linalg.inv(shape)
    for x, y in centre:
        part = np.s_[int((y - 10) * FINE) : int((y + 10) * FINE), int((x - 10) * FINE) : int((x + 10) * FINE)]
        p = np.stack([u[part] - x, v[part] - y], axis=-1) @ to_unit.T
        rho = np.maximum(np.linalg.norm(p, axis=-1), 1e-9)
        steep = np.linalg.norm(p @ to_unit, axis=-1) / rho
        cover[part] = np.clip(0.5 + (1 - rho) / steep * FINE, 0, 1)
    reach = int(np.ceil(defocus_px * FINE))
    away = np.hypot(*np.mgrid[-reach : reach + 1, -reach : reach + 1]) / FINE
    disc = np.clip(0.5 + (defocus_px - away) * FINE, 0, 1)
    seen = cv2.filter2D(cover, -1, disc / disc.sum(), borderType=cv2.BORDER_REPLICATE)
    return 12 + 90 * seen.reshape(height, FINE, width, FINE).mean(axis=(1, 3)), centre, shape


def measured(image, centre, shape, estimate=ellipse_centres):
    image = np.ascontiguousarray(image, np.float32)
    rays = Rays(np.round(centre), np.broadcast_to(shape, (len(centre), 2, 2)).copy())
    profile = profiles(image, rays, np.full(len(centre), PITCH / 6.0))
    noise = noise_model(image, rays, profile)
    return estimate(image, rays, profile, np.zeros_like(centre), noise, 0.05)


@pytest.mark.parametrize("semi_axes", [(6.0, 5.0), (3.5, 2.2)])
@pytest.mark.parametrize("defocus_px", [0.7, 1.6])
def test_nothing_depends_on_where_in_its_pixel_a_dot_lies(semi_axes, defocus_px):
    image, centre, shape = discs(semi_axes, defocus_px, np.random.default_rng(1))
    error = np.sqrt(np.mean((measured(image, centre, shape)[0] - centre) ** 2))
    weighted = np.sqrt(np.mean((measured(image, centre, shape, centroids)[0] - centre) ** 2))
    assert error < 0.0012  # a quarter of what noise leaves at best
    assert error < weighted


@pytest.mark.parametrize("loose_px", [0.0, 0.03])
def test_errors_are_as_large_as_their_sigmas(loose_px):
    """Noise that grows with the light, and lines that start early or late."""
    rng = np.random.default_rng(2)
    clean, centre, shape = discs((6.0, 5.0), 0.8, rng)
    across = np.gradient(clean, axis=1)
    ratios, sigmas = [], []
    for _ in range(12):
        image = clean - across * rng.normal(0, loose_px, (len(clean), 1))
        image = np.rint(image + rng.normal(size=image.shape) * np.sqrt(1.0 + 0.02 * image))
        uv, cov = measured(image, centre, shape)
        sigma = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
        ratios.append((uv - centre) / sigma)
        sigmas.append(sigma)
    # 756 values of each coordinate: their r.m.s. is known to 2.6 %
    assert np.sqrt(np.mean(np.concatenate(ratios) ** 2, axis=0)) == pytest.approx([1.0, 1.0], abs=0.08)
    u, v = np.sqrt(np.mean(np.concatenate(sigmas) ** 2, axis=0))
    assert (u > 1.3 * v) == (loose_px > 0)  # lines move along themselves only


def test_a_dot_that_no_ellipse_fits_keeps_its_centroid():
    image, centre, shape = discs((6.0, 5.0), 0.8, np.random.default_rng(3))
    image[:, : PITCH * 2] = 12.0  # the first column of dots is not there
    with np.errstate(all="ignore"):
        fitted, weighted = measured(image, centre, shape), measured(image, centre, shape, centroids)
    gone = centre[:, 0] < PITCH * 1.5
    assert np.array_equal(fitted[0][gone], weighted[0][gone], equal_nan=True)
    assert np.isfinite(fitted[0][~gone]).all()
