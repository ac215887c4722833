"""The compiled loops against plain numpy."""

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from core.measure.centres.kernels import sample_rays, weighted_moments
from core.numerics import inverse_2x2, row_median


def test_sampling_along_rays_is_bilinear_interpolation():
    rng = np.random.default_rng(0)
    image = rng.normal(size=(30, 40)).astype(np.float32)
    image[7, 9] = np.nan
    centre, unit = rng.uniform(5, 25, (6, 2)), rng.normal(size=(6, 8, 2))
    radius = rng.uniform(0, 12, (6, 8, 5))
    out = np.empty(radius.shape, np.float32)
    sample_rays(image, centre, unit, radius, out)
    at = centre[:, None, None] + radius[..., None] * unit[:, :, None]
    expected = map_coordinates(image.astype(float), [at[..., 1], at[..., 0]], order=1, cval=np.nan)
    expected[np.any((at < 0) | (at > [39, 29]), axis=-1)] = np.nan
    assert np.array_equal(np.isnan(out), np.isnan(expected))
    assert np.allclose(out, expected, atol=1e-5, equal_nan=True)


def test_weighted_moments_are_the_sums_they_are_said_to_be():
    rng = np.random.default_rng(1)
    image = rng.uniform(0, 100, (40, 50)).astype(np.float32)
    m = 5
    centre = rng.uniform(-2, 45, (m, 2))  # some windows reach out of the image
    inverse = np.linalg.inv(np.array([[4.0, 1.5], [0.5, 3.0]]) * rng.uniform(0.7, 1.3, (m, 1, 1)))
    taper = np.stack([rng.uniform(0.5, 1, m), rng.uniform(1.2, 2, m)], axis=1)
    plane = np.stack([rng.uniform(0, 20, m), *rng.normal(0, 0.5, (2, m))], axis=1)
    gradient, noise = rng.normal(0, 0.01, (m, 2)), rng.uniform(0, 1, (m, 2))
    out = np.empty((m, 9))
    weighted_moments(image, centre, inverse, taper, plane, gradient, noise, out)
    v, u = np.mgrid[0:40, 0:50]
    for k in range(m):
        du, dv = u - centre[k, 0], v - centre[k, 1]
        rho = np.hypot(*np.einsum("ij,jab->iab", inverse[k], np.stack([du, dv])))

        def g(rho, k=k):
            t = np.clip((rho - taper[k, 0]) / (taper[k, 1] - taper[k, 0]), 0, 1)
            return 1 - 3 * t**2 + 2 * t**3

        # moved by a px, g (x - m) changes by -g - rho g' / 2, over all directions
        lost = g(rho) + rho / 2 * (g(rho + 1e-6) - g(rho - 1e-6)) / 2e-6
        above = image - plane[k, 0] - plane[k, 1] * du - plane[k, 2] * dv
        light = 1 + gradient[k, 0] * du + gradient[k, 1] * dv
        w, var = above / light, g(rho) ** 2 * np.maximum(noise[k, 0] + noise[k, 1] * above, 0) / light**2
        squares = np.stack([du * du, du * dv, dv * dv])
        sums = [lost * w, g(rho) * w * du, g(rho) * w * dv, *(var * squares), *(g(rho) * squares)]
        assert out[k] == pytest.approx([x.sum() for x in sums], rel=1e-5, abs=1e-5)


def test_small_helpers_agree_with_numpy():
    rng = np.random.default_rng(2)
    values = rng.normal(size=(20, 9))
    values[rng.random(values.shape) < 0.3] = np.nan
    values[0, 0], values[3] = 1.0, 2.0
    values[:, 4] = 0.5
    assert np.allclose(row_median(values), np.nanmedian(values, axis=1))
    matrices = rng.normal(size=(7, 2, 2))
    assert np.allclose(inverse_2x2(matrices), np.linalg.inv(matrices))
