"""A peer in its own process and environment: reads its data once, then works when told to, and times itself.

Needs numpy alone. Every line on standard input is answered by one line of JSON: `run` works and tells seconds and peak
memory (`run trim` gives freed memory back first), `result FILE` writes what the last run gave.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Arrays = dict[str, np.ndarray]


def serve(prepare: Callable[[Arrays], Callable[[], Any]], answer: Callable[[Any], Arrays]) -> None:
    """Answer the harness: `prepare` takes its arrays and gives the work; `answer` puts its result into arrays."""
    replies = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # what a library prints must not get between
    with np.load(sys.argv[1], allow_pickle=False) as file:
        work = prepare(dict(file))
    result = None
    replies.write(json.dumps({"ready": True}) + "\n")
    for line in sys.stdin:
        verb, _, argument = line.strip().partition(" ")
        if verb == "run":
            result = None
            gc.collect()
            if argument == "trim":
                ctypes.CDLL(None).malloc_trim(0)
            before = _reset_peak_mb()
            started = time.perf_counter()
            result = work()
            seconds = time.perf_counter() - started
            replies.write(json.dumps({"seconds": seconds, "peak_mb": _status_mb("VmHWM") - before}) + "\n")
        else:
            np.savez(argument, **answer(result))
            replies.write(json.dumps({"written": argument}) + "\n")


def _reset_peak_mb() -> float:
    Path("/proc/self/clear_refs").write_text("5")
    return _status_mb("VmRSS")


def _status_mb(name: str) -> float:
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1e3 for line in lines if line.startswith(name))
