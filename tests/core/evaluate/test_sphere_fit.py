"""The sphere fit on spheres that are known."""

from __future__ import annotations

import numpy as np
import pytest

from core.errors import StripeError
from core.evaluate import fit_sphere


def _cap(angle_deg: float = 60, n: int = 2000, seed: int = 4) -> np.ndarray:
    """Unit vectors (n, 3) within an angle of +Z, evenly spread."""
    rng = np.random.default_rng(seed)
    z = rng.uniform(np.cos(np.radians(angle_deg)), 1, n)
    a = rng.uniform(0, 2 * np.pi, n)
    return np.stack([np.sqrt(1 - z**2) * np.cos(a), np.sqrt(1 - z**2) * np.sin(a), z], axis=-1)


def test_an_exact_cap_gives_centre_and_radius() -> None:
    sphere = fit_sphere(np.array([10.0, -20, -600]) + 25 * _cap())
    np.testing.assert_allclose(sphere.centre_mm, [10, -20, -600], atol=1e-9)
    assert sphere.radius_mm == pytest.approx(25, abs=1e-9)


def test_the_radius_of_a_noisy_cap_is_not_biased() -> None:
    rng = np.random.default_rng(9)
    radii = []
    for seed in range(40):
        directions = _cap(40, 800, seed)
        radii.append(fit_sphere(directions * (25 + rng.normal(0, 0.2, (800, 1)))).radius_mm)
    # four standard deviations of the mean of 40
    assert np.mean(radii) == pytest.approx(25, abs=4 * np.std(radii) / np.sqrt(40))


def test_deviations_are_positive_outside() -> None:
    sphere = fit_sphere(25 * _cap())
    np.testing.assert_allclose(sphere.deviations(26 * _cap()), 1, atol=1e-9)


def test_too_few_or_flat_points_are_refused() -> None:
    with pytest.raises(StripeError, match="4 valid points"):
        fit_sphere(_cap()[:4])
    with pytest.raises(StripeError, match="in one plane"):
        fit_sphere(_cap() * (1, 1, 0))
