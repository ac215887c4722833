"""The few lines that serve instead of SciPy's heavy parts give what SciPy gives."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize, special
from scipy.spatial import cKDTree

from core.numerics import (
    chi_square_limit,
    erf,
    factor_of,
    fisher_above,
    fisher_limit,
    inverse_by,
    least_squares,
    nearest,
    normal_limit,
    solution_by,
)
from core.numerics import systems as module


@pytest.mark.parametrize("level", [0.5, 0.05, 0.01, 1e-4, 1e-9])
@pytest.mark.parametrize("redundancy", [0.7, 1, 2, 10, 123.4, 5000, 60000])
def test_chi_square(redundancy, level):
    assert chi_square_limit(redundancy, level) == pytest.approx(special.chdtri(redundancy, level), rel=1e-9)


@pytest.mark.parametrize("level", [0.5, 0.05, 0.01, 1e-4])
@pytest.mark.parametrize("first", [1, 6, 84, 600])
@pytest.mark.parametrize("second", [1, 9, 300, 12000])
def test_fisher(first, second, level):
    limit = special.fdtri(first, second, 1 - level)
    assert fisher_limit(first, second, level) == pytest.approx(limit, rel=1e-7)
    assert fisher_above(first, second, limit) == pytest.approx(special.fdtrc(first, second, limit), rel=1e-9)


def test_normal_and_error_function():
    for level in (0.3, 1e-3, 1e-9):
        assert normal_limit(level) == pytest.approx(-special.ndtri(level), rel=1e-12)
    x = np.linspace(-6, 6, 400).reshape(20, 20)
    assert np.allclose(erf(x), special.erf(x), rtol=1e-14, atol=1e-300)


@pytest.mark.parametrize(("n", "k"), [(1, 1), (2, 2), (500, 9), (5000, 3)])
def test_neighbours(n, k):
    rng = np.random.default_rng(n)
    places, asked = rng.normal(size=(n, 2)), rng.normal(size=(300, 2))
    assert np.array_equal(nearest(places, k, of=asked), cKDTree(places).query(asked, k=[*range(1, k + 1)])[1])
    assert np.array_equal(nearest(places, k)[:, 0], np.arange(n))


def test_a_nonlinear_fit_and_a_valley_end_where_scipy_ends():
    t = np.linspace(0, 3, 60)
    seen = 2 * np.exp(-1.3 * t) * np.cos(4 * t) + np.random.default_rng(5).normal(0, 0.01, 60)

    def wave(x):
        return x[0] * np.exp(-x[1] * t) * np.cos(x[2] * t) - seen

    def by_wave(x):
        envelope = np.exp(-x[1] * t)
        cosine, sine = np.cos(x[2] * t), np.sin(x[2] * t)
        return np.stack([envelope * cosine, -x[0] * t * envelope * cosine, -x[0] * t * envelope * sine], axis=1)

    for misfit, jacobian, start in (
        (wave, by_wave, [1.0, 0.5, 3.5]),
        (
            lambda x: np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]),  # Rosenbrock's
            lambda x: np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]),
            [-1.2, 1.0],
        ),
    ):
        found, J = least_squares(misfit, jacobian, start)
        theirs = optimize.least_squares(misfit, start, jacobian, method="lm", ftol=1e-15, xtol=1e-15, gtol=1e-15)
        assert np.allclose(found, theirs.x, rtol=1e-9)
        assert np.allclose(J, theirs.jac, rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("n", [1, 31, 33, 160, 333, 759])
@pytest.mark.parametrize("large", [0, 1000], ids=["by LAPACK", "by numpy"])
def test_a_symmetric_system_is_solved_and_inverted(n, large, monkeypatch):
    monkeypatch.setattr(module, "LARGE", large)
    rng = np.random.default_rng(n)
    A, b = rng.normal(size=(n, n + 20)), rng.normal(size=n)
    M = A @ A.T / n
    L = factor_of(M)
    assert np.allclose(L @ L.T, M, atol=1e-12 * np.abs(M).max())
    # rounding times the condition of the matrix
    limit = 1e-14 * n * np.linalg.cond(M)
    assert np.abs(M @ solution_by(L, b) - b).max() < limit
    assert np.abs(M @ inverse_by(L) - np.eye(n)).max() < limit


def test_a_matrix_that_is_not_positive_definite_has_no_factor(monkeypatch):
    for large in (0, 1000):
        monkeypatch.setattr(module, "LARGE", large)
        assert factor_of(np.diag([1.0, -1.0])) is None
