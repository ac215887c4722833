"""Parameters that are held where the observations contradict it: a score test, for the price of one step.

With a held parameter's equations J, the whitened residuals v and the information I that J has once all else is
eliminated, ``(Jᵀv)² / I`` is chi-square distributed with one degree of freedom if the parameter is held rightly. A
wrong value bends the others long before single residuals show it. Source: Rao, *Large sample tests of statistical
hypotheses concerning several parameters*, Mathematical Proceedings of the Cambridge Philosophical Society 44, 1948.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.calibrate.approximate.columns import unobservable
from core.calibrate.diagnosis.weakness import effects
from core.calibrate.solution.elimination import reduce
from core.calibrate.solution.equations import linearise
from core.calibrate.solution.normals import solve_factor
from core.calibrate.solution.problem import RELATIVE, Problem, problem_of
from core.calibrate.solution.state import State
from core.geometry import estimated, lens_of
from core.lazy import dataclass
from core.model import Array, Concern, Network
from core.numerics import fisher_limit

LEVEL = 0.001  # chance that a network is doubted whose parameters are held rightly, if its sigmas are as they say
DOUBTFUL_RATIO = 1.6  # a shift over the limit; what targets have in common makes sigmas up to 1.3 times as large
FAILED_RATIO = 3.0
TELLING = 0.1  # sigma of a parameter, as displacement at the image's edge over the image's radius, that is tested


@dataclass(frozen=True)
class _Held:
    """Held parameters: names and values, score ``Jᵀv`` and information, and the largest sigma that is tested."""

    names: list[str]
    values: Array
    score: Array
    information: Array
    telling: Array


def held_concerns(network: Network, problem: Problem, state: State, cost: float) -> list[Concern]:
    """Name the held parameters whose values the observations of a solution contradict, the plainest first.

    `cost` is its vᵀPv. Each parameter is tested with those before it freed, against a limit that all share.
    """
    held = _held(network, problem, state)
    if held is None:
        return []
    score, information = held.score.copy(), held.information.copy()
    rest, found, ratios = list(range(len(score))), [], []
    redundancy = problem.redundancy
    while redundancy > 1:
        rest = [k for k in rest if information[k, k] * held.telling[k] ** 2 > 1]
        if not rest:
            break
        explained = score[rest] ** 2 / np.diagonal(information)[rest]
        best = rest.pop(int(np.argmax(explained)))
        left = max(cost - float(explained.max()), 1e-12 * cost) / (redundancy - 1)
        limit = fisher_limit(1, redundancy - 1, LEVEL / len(score))
        ratio = float(np.sqrt(explained.max() / max(left, 1e-300) / limit))
        if ratio < DOUBTFUL_RATIO:
            break
        found.append(best)
        ratios.append(ratio)
        cost, redundancy = left * (redundancy - 1), redundancy - 1
        by = information[:, best] / information[best, best]
        score, information = score - by * score[best], information - np.outer(by, information[best])
    if not found:
        return []
    cofactors = np.linalg.inv(held.information[np.ix_(found, found)])
    values = held.values[found] + cofactors @ held.score[found]
    sigmas = np.sqrt(np.diagonal(cofactors) * cost / redundancy)
    return [
        Concern(
            "failed" if ratio > FAILED_RATIO else "doubtful",
            f"{held.names[k]} is held at {held.values[k]:.4g}, by the observations it is {value:.4g} ± {sigma:.2g}: "
            "estimate it, or correct its value",
            about="held",
        )
        for k, ratio, value, sigma in zip(found, ratios, values, sigmas, strict=True)
    ]


def freed(network: Network) -> Network | None:
    """Estimate all that is held of the interior orientations and observable; None where nothing is."""
    lost, devices = unobservable(network), {}
    for name, device in network.devices.items():
        usual = tuple(p for p in lens_of(device.spec).usual if p not in lost.get(name, ()))
        devices[name] = replace(device, spec=replace(device.spec, interior_sigma=()), estimate=usual)
    held = any(set(devices[name].estimate or ()) - {*estimated(device)} for name, device in network.devices.items())
    return replace(network, devices=devices) if held else None


def _held(network: Network, problem: Problem, state: State) -> _Held | None:
    """Free what is held of the interior orientations; None where nothing is."""
    if (free := freed(network)) is None:
        return None
    columns = problem_of(free).columns
    new = (columns >= 0) & (problem.columns < 0)
    if not new.any():
        return None
    whole = replace(problem, columns=columns)
    equations, places = linearise(whole, state), columns[new]
    shares, names, _ = effects(whole, equations)
    telling = TELLING / np.where(shares[places] > 0, shares[places], 1.0)  # 0: no image tells anything of it
    # known a little, so that what no image tells leaves the system regular
    known, weight, of_interior = problem.interior_known.copy(), problem.interior_weight.copy(), new[:, RELATIVE:]
    known[of_interior], weight[of_interior] = state.interior[of_interior], telling**-2.0
    whole = replace(whole, interior_known=known, interior_weight=weight)
    reduced = reduce(whole, state)
    unit = np.zeros((len(reduced.right), len(places)))
    unit[places, range(len(places))] = 1.0
    inverse = np.linalg.inv(np.array([solve_factor(reduced.factor, column)[places] for column in unit.T]))
    score = inverse @ solve_factor(reduced.factor, reduced.right)[places]
    return _Held(
        [names[k] for k in places], state.interior[of_interior], score, inverse - np.diag(telling**-2.0), telling
    )
