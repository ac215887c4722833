"""The block solver against a dense one that shares nothing with it.

The reference differentiates `core.geometry.project` numerically, keeps every unknown in one matrix and borders it with
the inner constraints; rotations are plain rotation vectors.
"""

import numpy as np
import pytest

from core.calibrate import adjust
from core.calibrate.approximate.initial import initial_state
from core.calibrate.solution.covariance import point_cofactors, pose_cofactors, redundancy_numbers
from core.calibrate.solution.elimination import reduce
from core.calibrate.solution.equations import linearise
from core.calibrate.solution.iterate import iterate
from core.calibrate.solution.problem import problem_of
from core.geometry import LENSES, Pose, matrix_from_rotation_vector, project, rotation_vector_from_matrix
from core.geometry import estimated as names_estimated
from core.model import Interior

# units in which the unknowns of the reference are of size one, for the differences
UNITS = np.array([1e-2, 1e-2, 1e-2, 1e-5, 1e-7, 1e-4, 1e-4, 1e-5, 1e-5])


class Reference:
    """Observation vector as a function of one vector of unknowns: interiors, relative, poses, points."""

    def __init__(self, adjustment):
        self.a, self.network = adjustment, adjustment.network
        self.names = list(self.network.devices)
        self.rigid = list(adjustment.relative)
        self.groups = sorted(set(self.network.station_pose))
        self.n = len(self.network.point_names)

    def start(self):
        parts = [self.a.devices[name].interior.vector for name in self.names]
        for name in self.rigid:
            pose = self.a.relative[name]
            parts += [rotation_vector_from_matrix(pose.rotation), pose.translation_mm]
        for group in self.groups:
            pose = self.a.station_from_object[self.network.station_pose.index(group)]  # the base device comes first
            parts += [rotation_vector_from_matrix(pose.rotation), pose.translation_mm]
        return np.concatenate([*parts, self.a.points_mm.ravel()])

    def units(self):
        moves = np.tile([1e-4] * 3 + [1e-2] * 3, len(self.rigid) + len(self.groups))
        return np.concatenate([*[UNITS] * len(self.names), moves, np.full(3 * self.n, 1e-2)])

    def free(self):
        names = LENSES["A1..A6"].names
        estimated = [p in names_estimated(d) for d in self.network.devices.values() for p in names]
        return np.array(estimated + [True] * (len(self.start()) - len(estimated)))

    def observations(self, x):
        D, r = len(self.names), len(self.rigid)
        interior = {
            name: Interior.from_vector(x[9 * d : 9 * d + 9], self.a.devices[name].interior.r0_mm)
            for d, name in enumerate(self.names)
        }
        poses = x[9 * D :][: 6 * (r + len(self.groups))].reshape(-1, 6)
        moves = [Pose(matrix_from_rotation_vector(p[:3]), p[3:]) for p in poses]
        relative = dict(zip(self.rigid, moves[:r], strict=True))
        points = x[len(x) - 3 * self.n :].reshape(-1, 3)
        out = np.empty_like(self.network.observation_uv)
        for s, name in enumerate(self.network.station_device):
            rows = self.network.observation_station == s
            pose = relative.get(name, Pose()) @ moves[r + self.groups.index(self.network.station_pose[s])]
            spec = self.network.devices[name].spec
            out[rows] = project(spec, interior[name], points[self.network.observation_point[rows]], pose)
        whitened = (out / self.network.observation_sigma).ravel()
        bar = self.network.scale
        if bar is None:
            return whitened
        return np.append(whitened, np.linalg.norm(points[bar.start] - points[bar.stop]) / bar.sigma_mm)

    def observed(self):
        values = (self.network.observation_uv / self.network.observation_sigma).ravel()
        bar = self.network.scale
        return values if bar is None else np.append(values, bar.length_mm / bar.sigma_mm)

    def constraints(self, x):
        """Columns that shift, turn and scale the points alone."""
        X = x[len(x) - 3 * self.n :].reshape(-1, 3)
        X = X - X.mean(axis=0)
        columns = [np.tile(axis, (self.n, 1)) for axis in np.eye(3)]
        columns += [np.cross(axis, X) for axis in np.eye(3)]
        columns += [] if self.network.scale is not None else [X]
        G = np.zeros((len(x), len(columns)))
        G[len(x) - 3 * self.n :] = np.array([c.ravel() for c in columns]).T
        return G

    def solve(self):
        """Unknowns, their cofactors (0 where held), redundancy numbers and vᵀPv at the least-squares solution."""
        x, units, free = self.start(), self.units(), self.free()
        for _ in range(2):
            steps = np.diag(units)[free]
            A = np.array([(self.observations(x + e) - self.observations(x - e)) / 2 for e in steps]).T
            G = (self.constraints(x) * units[:, None])[free]
            zero = np.zeros((G.shape[1], G.shape[1]))
            Q = np.linalg.inv(np.block([[A.T @ A, G], [G.T, zero]]))[: A.shape[1], : A.shape[1]]
            x[free] += Q @ (A.T @ (self.observed() - self.observations(x))) * units[free]
        numbers = 1 - np.einsum("ij,jk,ik->i", A, Q, A)
        cofactors = np.zeros((len(x), len(x)))
        cofactors[np.ix_(free, free)] = units[free, None] * Q * units[free]
        misclosure = self.observed() - self.observations(x)
        return x, cofactors, numbers, float(misclosure @ misclosure)


CASES = {
    "rigid rig with a measured distance": {},
    "rigid rig without": {"scale": False},
    "free stations with a measured distance": {"rigid": False},
    "camera alone, free": {"use": ("camera",), "scale": False},
    "some parameters held": {"use": ("camera",), "estimate": ("c", "x0", "y0", "A1", "A2")},
}


@pytest.fixture(scope="module", params=CASES.values(), ids=CASES.keys())
def both(request, simulate):
    simulated = simulate(**({"poses": 5, "rows": 4, "cols": 4, "extent_mm": 170.0} | request.param))
    adjustment = adjust(simulated.network)
    reference = Reference(adjustment)
    return adjustment, reference, reference.solve()


def test_solution_is_that_of_the_dense_solver(both):
    adjustment, reference, (x, _, _, cost) = both
    assert adjustment.sigma0**2 * adjustment.redundancy == pytest.approx(cost, rel=1e-7)
    start = reference.start()
    sigma = np.concatenate([adjustment.devices[name].sigma for name in reference.names])
    # the iterations end within 1e-5 sigma, the reference's differences are good to a little more
    assert np.all(np.abs(x - start)[: len(sigma)] <= 1e-4 * sigma + 1e-15)
    np.testing.assert_allclose(x[-3 * reference.n :], start[-3 * reference.n :], atol=2e-6)


def test_covariances_are_those_of_the_dense_solver(both):
    adjustment, reference, (_, cofactors, _, _) = both
    dense = adjustment.sigma0**2 * cofactors
    k, n = 9 * len(reference.names), reference.n
    sigma = np.sqrt(np.diagonal(adjustment.parameter_cov)[:k])
    unit = np.outer(*[np.where(sigma > 0, sigma, 1.0)] * 2)
    np.testing.assert_allclose(adjustment.parameter_cov[:k, :k] / unit, dense[:k, :k] / unit, atol=2e-4)
    if reference.rigid:  # shifts only: the reference's rotation vectors are other unknowns than turns from the left
        shifts = slice(k + 3, k + 6)
        np.testing.assert_allclose(adjustment.parameter_cov[shifts, shifts], dense[shifts, shifts], rtol=1e-3)
    points = np.array([dense[i : i + 3, i : i + 3] for i in range(len(dense) - 3 * n, len(dense), 3)])
    np.testing.assert_allclose(adjustment.point_cov_mm2, points, atol=2e-4 * points.max())


def test_redundancy_numbers_are_those_of_the_dense_solver_and_add_up(both):
    adjustment, _, (_, _, numbers, _) = both
    np.testing.assert_allclose(
        adjustment.redundancy_numbers.ravel(), numbers[: adjustment.redundancy_numbers.size], atol=1e-5
    )
    # the measured distance is checked by nothing, so that all redundancy lies in the images
    assert adjustment.redundancy_numbers.sum() == pytest.approx(adjustment.redundancy, abs=1e-5)


@pytest.mark.parametrize("setup", [{}, {"scale": False}, {"use": ("camera",), "scale": False}], ids=str)
def test_eliminating_the_points_gives_what_eliminating_the_poses_gives(simulate, setup):
    """Two orders of elimination share the observation equations only; networks of many points take the second."""
    network = simulate(poses=8, **setup).network
    results = []
    for by_points in (False, True):
        problem = problem_of(network, by_points=by_points)
        start = initial_state(network, problem)
        solution, step = iterate(problem, start), reduce(problem, start).solve(problem)
        inverse = solution.invert(problem)
        equations = linearise(problem, solution.reduced.state)
        numbers = redundancy_numbers(problem, equations, inverse)[np.argsort(problem.order)]
        cofactors = point_cofactors(problem, inverse), pose_cofactors(problem, inverse)
        found = solution.state.xyz, solution.state.interior, *cofactors, numbers
        results.append((*found, step.z, step.pose, step.xyz, np.array(step.gain)))
    for one, other in zip(*results, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-7 * np.abs(one).max(), rtol=1e-5)


def test_networks_of_very_many_points_leave_the_poses_to_be_solved(simulate):
    few, many = (simulate(use=("camera",), rows=n, cols=n, poses=4).network for n in (10, 40))
    assert not problem_of(few).by_points
    assert problem_of(many).by_points
    adjustment = adjust(many)
    assert adjustment.redundancy_numbers.sum() == pytest.approx(adjustment.redundancy, abs=1e-4)
