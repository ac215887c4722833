"""The compiled normal equations and pose refinement against plain numpy."""

from dataclasses import replace

import numpy as np
import pytest

from core.calibrate.approximate.initial import initial_state
from core.calibrate.approximate.refinement import refined, robust_factors
from core.calibrate.approximate.stations import oriented_stations, resectable
from core.calibrate.solution.equations import cost_of, linearise, misclosures
from core.calibrate.solution.normals import SingularNormalsError, assemble
from core.calibrate.solution.problem import problem_of
from core.calibrate.solution.state import Step, moved


def dense_normals(problem, state, damping):
    """Normals and right-hand side of all unknowns, globals, kept and eliminated, from the Jacobian written out."""
    equations = linearise(problem, state)
    G, P, n = problem.globals, problem.poses, problem.points
    rows = np.arange(len(equations.w))
    A = np.zeros((len(rows), 2, G + 3 * n + 6 * P))
    for j in range(problem.columns.shape[1]):
        place = problem.columns[problem.device, j]
        A[rows[place >= 0], :, place[place >= 0]] = equations.J[place >= 0, :, 9 + j]
    point_at, pose_at = (G + 6 * P, G) if problem.by_points else (G, G + 3 * n)
    for j in range(6):
        A[rows, :, pose_at + 6 * problem.pose + j] = equations.J[:, :, j]
    for j in range(3):
        A[rows, :, point_at + 3 * problem.point + j] = equations.J[:, :, 6 + j]
    A, kept = A.reshape(-1, A.shape[2]), G + (6 * P if problem.by_points else 3 * n)
    N = A.T @ A
    own = np.arange(kept, len(N))
    N[own, own] *= 1 + damping
    return N, A.T @ equations.w.ravel(), kept


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("by_points", [False, True])
@pytest.mark.parametrize("rigid", [False, True])
def test_blocks_eliminated_one_by_one_leave_what_the_dense_system_leaves(simulate, rigid, by_points, damping):
    network = simulate(poses=4, rows=4, cols=5, rigid=rigid).network
    problem = problem_of(network, by_points=by_points)
    state = initial_state(network, problem)
    normals = assemble(problem, state, damping)
    N, b, kept = dense_normals(problem, state, damping)
    solved = np.linalg.solve(N[kept:, kept:], np.column_stack([N[kept:, :kept], b[kept:]]))
    M, right = N[:kept, :kept] - N[:kept, kept:] @ solved[:, :-1], b[:kept] - N[:kept, kept:] @ solved[:, -1]
    unit = np.sqrt(np.diagonal(N)[:kept])
    np.testing.assert_allclose(normals.M / np.outer(unit, unit), M / np.outer(unit, unit), atol=1e-10)
    np.testing.assert_allclose(normals.right / unit, right / unit, atol=1e-8 * np.abs(b[:kept] / unit).max())
    np.testing.assert_allclose(normals.diagonal, np.diagonal(N)[:kept], rtol=1e-12)
    np.testing.assert_allclose(normals.b, b[:kept], rtol=1e-9, atol=1e-9 * np.abs(b[:kept]).max())


def test_a_block_that_nothing_determines_is_named(simulate):
    network = simulate(poses=4, rows=4, cols=5, rigid=False).network
    problem = problem_of(network)
    state = initial_state(network, problem)
    unseen = replace(problem, root_weight=np.where(problem.pose[:, None] == 2, 0.0, problem.root_weight))
    with pytest.raises(SingularNormalsError) as caught:
        assemble(unseen, state)
    assert caught.value.block == 2


def test_misclosures_without_derivatives_are_those_with(simulate):
    network = simulate(poses=3, rows=4, cols=5).network
    problem = problem_of(network)
    state = initial_state(network, problem)
    equations = linearise(problem, state)
    np.testing.assert_array_equal(misclosures(problem, state), equations.w)
    assert cost_of(problem, state) == equations.cost


def test_robust_weights_lower_what_exceeds_three_medians_of_its_pose(simulate):
    problem = problem_of(simulate(poses=3, rows=4, cols=5, rigid=False).network)
    w = np.random.default_rng(1).standard_t(2, size=problem.uv.shape)
    size = np.linalg.norm(w, axis=1)
    factor = robust_factors(problem, w)[0][:, 0]
    for pose in range(problem.poses):
        own = problem.pose == pose
        limit = 3 * np.median(size[own])
        np.testing.assert_allclose(factor[own], np.minimum(1, limit / size[own]), rtol=1e-12)


def test_disturbed_poses_come_back_wherever_one_wrong_point_pulls_them(simulate):
    """Without noise, on the true points and with the true focal lengths the poses are those of the simulation."""
    simulated = simulate(poses=6, rows=5, cols=6, rigid=False, noise=0.0, scale=False, approximation_mm=0.0)
    network = simulated.network
    wrong = network.observation_uv.copy()
    first = np.unique(network.observation_station, return_index=True)[1]
    wrong[first] += 40.0
    network = replace(network, observation_uv=wrong)
    problem = replace(problem_of(network), points_free=False)
    state = oriented_stations(network, resectable(network))
    interior = np.array([simulated.interior[name].vector for name in network.devices])
    truth = replace(
        state,
        interior=interior,
        pose_rotation=np.array([p.rotation for p in simulated.stations]),
        pose_shift=np.array([p.translation_mm + p.rotation @ problem.origin_mm for p in simulated.stations]),
    )
    push = np.random.default_rng(2).normal(size=(problem.poses, 6)) * [0.02, 0.02, 0.02, 4, 4, 10]
    held = replace(problem, columns=np.full_like(problem.columns, -1))
    found, sums = refined(problem, moved(held, truth, Step(np.zeros(0), push, np.zeros((0, 3)), 0.0)))
    # one of some thirty points is 40 px off, some 30 mm, and draws none of them
    np.testing.assert_allclose(found.pose_shift, truth.pose_shift, atol=1e-6)
    np.testing.assert_allclose(sums, 0, atol=1e-6)
