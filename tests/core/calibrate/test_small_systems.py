"""What the kernels solve and select for themselves, against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from core.calibrate.cholesky import solve_in_place
from core.calibrate.refinement import _median


@pytest.mark.parametrize("size", [1, 2, 6])
def test_a_positive_definite_system_is_solved_as_numpy_solves_it(size: int) -> None:
    rng = np.random.default_rng(size)
    A = rng.standard_normal((size + 3, size)) * 10.0 ** rng.integers(-4, 4, size)  # unknowns of unlike units
    N, x = A.T @ A, rng.standard_normal(size) / np.abs(A).max(axis=0)
    b = N @ x
    assert solve_in_place(np.tril(N), b)
    np.testing.assert_allclose(b, x, rtol=1e-8)


def test_a_system_with_a_direction_of_no_weight_is_not_solved() -> None:
    A = np.array([[1.0, 2.0, 3.0], [0.0, 1.0, 1.0]])
    assert not solve_in_place(A.T @ A, np.ones(3))


@pytest.mark.parametrize("count", [1, 2, 3, 4, 59, 60])
def test_the_median_selected_in_part_is_that_of_all(count: int) -> None:
    rng = np.random.default_rng(count)
    for values in (rng.standard_normal(count), rng.integers(0, 3, count).astype(float), np.arange(count, 0.0, -1.0)):
        assert _median(np.append(values, [-9.0, 9.0]), count) == np.median(values)
    beyond = np.append(rng.standard_normal(count + 1), [np.inf] * (count // 2))
    assert _median(beyond.copy(), len(beyond)) == np.median(beyond)
