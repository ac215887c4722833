"""Small systems and medians of poses: against numpy and the truth."""

from __future__ import annotations

import numpy as np
import pytest

from core.calibrate.approximate.initial import _median_pose
from core.geometry import Pose, matrix_from_rotation_vector, rotation_vector_from_matrix
from core.numerics.small import solve_in_place


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


@pytest.mark.parametrize("count", [1, 20, 1000])
def test_the_median_of_poses_is_not_moved_by_a_third_that_are_wrong(count: int) -> None:
    rng = np.random.default_rng(count)
    truth = matrix_from_rotation_vector([0.3, -1.2, 2.0])
    samples = []
    for k in range(count):
        turn, shift = rng.normal(0, [1e-3, 0.1], (3, 2)).T
        if k % 3 == 1:  # the second solution of a flat field
            turn, shift = np.array([0.0, 0.8, 0.0]), np.array([40.0, 0.0, 5.0])
        samples.append(Pose(matrix_from_rotation_vector(turn) @ truth, np.array([250.0, 0.0, 9.0]) + shift))
    found = _median_pose(samples)
    # of one pose its own noise; of many the wrong third moves the median by less than half a sigma of 1e-3 and 0.1
    assert np.linalg.norm(rotation_vector_from_matrix(found.rotation @ truth.T)) < 4e-3
    np.testing.assert_allclose(found.translation_mm, [250.0, 0.0, 9.0], atol=0.4)
