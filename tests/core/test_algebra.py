"""Programs that call the core have NumPy's threads beside ours: these rest while it works, and are back afterwards."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

SCRIPT = """
import numpy as np, cv2
from threadpoolctl import ThreadpoolController, threadpool_info
from core.parallel import can_fork, limit_threads, on_processes
from core.progress import SILENT, Progress
import core

def threads():
    return [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]

ThreadpoolController().limit(limits=2, user_api="blas")  # as on two processors
big = np.random.default_rng(0).standard_normal((400, 400))
product, within = big @ big, []
rows = np.mgrid[:40, :60][1] * 0.9
patterns = [core.patterns.Phase("x", 64.0, 4, k, k * np.pi / 2) for k in range(4)]
images = [np.rint(100 + 60 * np.cos(2 * np.pi * (rows + 0.5) / 64 - p.shift_rad)).astype(np.uint8) for p in patterns]
progress = Progress(lambda *_: within.append(threads()))
core.decode_frames(patterns, images, projector_size=(64, 64), progress=progress)
assert within and {1} == {count for each in within for count in each}, within
assert {*threads()} == {2}, threads()
try:
    core.decode_frames(patterns, images[:2] + [images[2][:3]] * 2)
except core.InputError:
    pass
assert {*threads()} == {2}, threads()

limit_threads(2)
assert can_fork(9)  # though OpenBLAS had a thread of its own

def work(k, progress):
    assert {*threads()} == {1}, threads()
    return float(np.abs(big @ big - product).max())

assert max(on_processes(work, 9, SILENT)) < 1e-9
np.testing.assert_allclose(big @ big, product, atol=1e-9)
print("done")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux alone")
def test_the_threads_of_the_linear_algebra_rest_while_ours_work() -> None:
    own = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, env=own)
    assert done.stdout == "done\n", done.stderr
