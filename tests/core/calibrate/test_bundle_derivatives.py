"""The analytic derivatives against differences of `core.geometry.project`."""

import numpy as np
import pytest

from core.calibrate.approximate.initial import initial_state
from core.calibrate.solution.equations import linearise
from core.calibrate.solution.problem import problem_of
from core.calibrate.solution.state import Step, moved
from core.geometry import LENSES, Pose, project
from core.model import Interior

STEPS = {"c": 1e-3, "x0": 1e-3, "y0": 1e-3, "A1": 1e-6, "A2": 1e-8, "A3": 1e-5, "A4": 1e-5, "A5": 1e-6, "A6": 1e-6}


def projected(network, problem, state):
    """Whitened computed observations by the geometry module, observation by observation order of the problem."""
    specs = [d.spec for d in network.devices.values()]
    out = np.empty_like(problem.uv)
    for o in range(len(problem.point)):
        d, p, i = problem.device[o], problem.pose[o], problem.point[o]
        interior = Interior.from_vector(state.interior[d], problem.r0[d])
        relative = Pose(state.relative_rotation[d], state.relative_shift[d])
        pose = relative @ Pose(state.pose_rotation[p], state.pose_shift[p])
        out[o] = project(specs[d], interior, state.xyz[i], pose) * problem.root_weight[o]
    return out


@pytest.fixture
def linearised(simulate):
    network = simulate(poses=4, rows=4, cols=5).network
    problem = problem_of(network)
    state = initial_state(network, problem)
    # parameters far from zero, or their derivatives' mixed terms would not be seen
    interior = state.interior + np.array([0, 0.1, -0.2, 1e-4, 1e-6, 2e-2, -1e-2, 1e-4, -2e-4])
    return network, problem, type(state)(**{**vars(state), "interior": interior})


def test_misclosures_are_observed_minus_projected(linearised):
    network, problem, state = linearised
    equations = linearise(problem, state)
    expected = problem.uv * problem.root_weight - projected(network, problem, state)
    np.testing.assert_allclose(equations.w, expected, atol=1e-8)


def unit_steps(problem):
    """Every unknown's step: its column in the Jacobian, the devices or poses it belongs to, and the step."""
    G, P, n = problem.globals, problem.poses, problem.points
    for d, columns in enumerate(problem.columns):
        for j in range(6 + len(LENSES[problem.models[d]].names)):
            if columns[j] >= 0:
                name = LENSES[problem.models[d]].names[j - 6] if j >= 6 else ""
                h = STEPS[name] if name else 1e-5 if j < 3 else 1e-2
                h *= 0.01 if d and name in ("A1", "A2", "A5", "A6") else 1  # the projector's image is ten times larger
                z = np.zeros(G)
                z[columns[j]] = h
                yield 9 + j, problem.device == d, h, Step(z, np.zeros((P, 6)), np.zeros((n, 3)), 0.0)
    for j in range(6):
        h = 1e-5 if j < 3 else 1e-2
        pose = np.zeros((P, 6))
        pose[1, j] = h
        yield j, problem.pose == 1, h, Step(np.zeros(G), pose, np.zeros((n, 3)), 0.0)
    for j in range(3):
        xyz = np.zeros((n, 3))
        xyz[7, j] = 1e-2
        yield 6 + j, problem.point == 7, 1e-2, Step(np.zeros(G), np.zeros((P, 6)), xyz, 0.0)


def negative(step):
    return Step(-step.z, -step.pose, -step.xyz, 0.0)


def test_every_column_of_the_jacobian_equals_a_central_difference(linearised):
    network, problem, state = linearised
    J = linearise(problem, state).J
    for column, rows, h, step in unit_steps(problem):
        ahead = projected(network, problem, moved(problem, state, step))
        behind = projected(network, problem, moved(problem, state, negative(step)))
        difference = (ahead - behind) / (2 * h)
        expected = np.where(rows[:, None], J[:, :, column], 0.0)
        # central differences err by the third derivative times h², here some 1e-7 of the column
        scale = np.abs(expected).max()
        np.testing.assert_allclose(difference, expected, atol=2e-6 * scale, err_msg=f"column {column}")


def test_a_point_behind_its_device_costs_infinitely_much(linearised):
    _, problem, state = linearised
    turned = type(state)(**{**vars(state), "pose_shift": -state.pose_shift})
    assert linearise(problem, turned).cost == np.inf
