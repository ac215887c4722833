"""Contestants run in turns, round by round, so that a busy moment of the machine meets them all."""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

BUDGET_S = 2.0  # of one contestant's timed rounds
ROUNDS = 15


@dataclass(frozen=True)
class Contestant:
    """Work to be timed; `right` looks at its result and says in words how right it is, or raises.

    `prepare` runs before every call and is not timed. A contestant without `warm` is timed at its first call already:
    for slow work that neither compiles nor keeps anything.
    """

    name: str
    work: Callable[..., Any]
    right: Callable[[Any], str] = lambda result: ""
    prepare: Callable[[], Any] | None = None
    warm: bool = True


@dataclass(frozen=True)
class Row:
    """One line of the table: a contestant at one size."""

    part: str
    size: str
    amount: float
    unit: str
    contestant: str
    seconds: float
    rounds: int
    ratio: float  # to the part's reference at this size
    reference: str
    peak_mb: float
    right: str


def race(
    part: str, size: str, amount: float, unit: str, contestants: Sequence[Contestant], reference: str = ""
) -> list[Row]:
    """Time contestants in turns; the median counts. The reference is the first one unless named.

    Every result is checked before anything is timed; then peak memory is taken in a round of its own.
    """
    reference = reference or contestants[0].name
    times: dict[str, list[float]] = {c.name: [] for c in contestants}
    right, peak = {}, {}
    for c in contestants:
        seconds, peak[c.name], result = _once(c)
        if not c.warm:
            times[c.name].append(seconds)
        right[c.name] = c.right(result)
        del result
    for _ in range(ROUNDS):
        for c in contestants:
            if sum(times[c.name]) < BUDGET_S:
                times[c.name].append(_once(c, memory=False)[0])
    medians = {name: statistics.median(t) for name, t in times.items()}
    rows = []
    for c in contestants:
        seconds, rounds = medians[c.name], len(times[c.name])
        ratio = seconds / medians[reference]
        rows.append(
            Row(part, size, amount, unit, c.name, seconds, rounds, ratio, reference, peak[c.name], right[c.name])
        )
        print(f"  {size:24s} {c.name:44s} {1e3 * seconds:10.1f} ms  {ratio:8.2f} x  {right[c.name]}", flush=True)
    return rows


def _once(c: Contestant, memory: bool = True) -> tuple[float, float, Any]:
    arguments = () if c.prepare is None else (c.prepare(),)
    gc.collect()
    before = _reset_peak() if memory else 0.0
    started = time.perf_counter()
    result = c.work(*arguments)
    seconds = time.perf_counter() - started
    return seconds, max(0.0, _status_mb("VmHWM") - before) if memory else 0.0, result


def _reset_peak() -> float:
    """Let the kernel forget this process's peak memory; give what is in use now, in MB."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return float("nan")
    return _status_mb("VmRSS")


def _status_mb(name: str) -> float:
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return float("nan")
    return next(int(line.split()[1]) / 1e3 for line in lines if line.startswith(name))


def copying(name: str, arrays: Sequence[np.ndarray], extra_bytes: int = 0) -> Contestant:
    """The floor: copy these arrays, and as many further bytes, into memory that is there already."""
    sources = [*arrays, np.ones(extra_bytes, np.uint8)]
    targets = [np.zeros_like(a) for a in sources]

    def copy() -> None:
        for target, source in zip(targets, sources, strict=True):
            np.copyto(target, source)

    return Contestant(name, copy)
