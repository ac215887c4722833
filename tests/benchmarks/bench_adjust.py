"""Time and memory of the bundle adjustment against the number of stations; prints a table, asserts nothing.

python tests/benchmarks/bench_adjust.py
"""

from __future__ import annotations

import importlib.util
import sys
import time
import tracemalloc
from itertools import pairwise
from pathlib import Path

from core.calibrate.adjust import adjust
from core.calibrate.covariance import point_cofactors, redundancy_numbers
from core.calibrate.elimination import invert
from core.calibrate.initial import initial_state
from core.calibrate.iterate import iterate
from core.calibrate.problem import problem_of


def _simulator():
    path = Path(__file__).parents[1] / "core" / "calibrate" / "conftest.py"
    spec = importlib.util.spec_from_file_location("simulated_networks", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # its dataclasses look their module up
    spec.loader.exec_module(module)
    return module.simulated_network


def main() -> None:
    """Adjust networks of 40 to 400 free stations on a board of 247 targets."""
    simulate = _simulator()
    adjust(simulate(rigid=False).network)  # compiles, or reads what was compiled
    print("stations  points  iterations  initial  solution  covariances  adjust in all  memory")
    for poses in (20, 50, 100, 200):
        network = simulate(poses=poses, rows=13, cols=19, rigid=False, extent_mm=175.0).network
        times = [time.perf_counter()]
        problem = problem_of(network)
        state = initial_state(network, problem)
        times.append(time.perf_counter())
        solution = iterate(problem, state)
        times.append(time.perf_counter())
        inverse = invert(problem, solution.state, solution.equations)
        redundancy_numbers(problem, solution.equations, inverse)
        point_cofactors(problem, inverse)
        times.append(time.perf_counter())
        adjust(network)
        times.append(time.perf_counter())
        tracemalloc.start()
        adjust(network)
        peak = tracemalloc.get_traced_memory()[1] / 1e6
        tracemalloc.stop()
        initial, solved, covariances, whole = (b - a for a, b in pairwise(times))
        print(
            f"{2 * poses:8d}  {len(network.observation_uv):6d}  {solution.iterations:10d}  {initial:6.2f}s  "
            f"{solved:7.2f}s  {covariances:10.2f}s  {whole:12.2f}s  {peak:4.0f} MB"
        )


if __name__ == "__main__":
    main()
