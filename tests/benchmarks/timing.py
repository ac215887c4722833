"""Contestants run in turns, round by round, so that a busy moment of the machine meets them all."""

from __future__ import annotations

import ctypes
import gc
import math
import mmap
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

OURS = "stripe workbench"
FLOOR = "fresh copy of its bytes"
WARM = "copy into warm memory"
HUGE = 4 << 20  # bytes from which numpy asks for huge pages


@dataclass
class Effort:
    """How much is measured: seconds of timed rounds a contestant may take, and the most rounds."""

    seconds: float = 1.0
    rounds: int = 15
    quick: bool = False


EFFORT = Effort()


@dataclass(frozen=True)
class Contestant:
    """Work to be timed; `right` compares its result with the truth and says in words how right it is, or raises.

    `prepare` runs before every call and is not timed. A contestant without `warm` is timed at its first call already:
    for slow work that neither compiles nor keeps anything. `peer` tells what others wrote and may fail here.
    """

    name: str
    work: Callable[..., Any]
    right: Callable[[Any], str] = lambda result: ""
    prepare: Callable[[], Any] | None = None
    warm: bool = True
    peer: bool = False

    def once(self, trim: bool = False) -> tuple[float, float, Any]:
        """Do the work: give seconds, peak memory above what was in use before (MB), and the result.

        `trim` first gives memory that the allocator keeps back to the kernel: without it the peak is too low.
        """
        arguments = () if self.prepare is None else (self.prepare(),)
        gc.collect()
        if trim:
            trim_memory()
        before = _reset_peak()
        started = time.perf_counter()
        result = self.work(*arguments)
        seconds = time.perf_counter() - started
        return seconds, max(0.0, _status_mb("VmHWM") - before), result

    def close(self) -> None:
        """Let go of what it holds."""


@dataclass(frozen=True)
class Absent:
    """A contestant that could not take part, and why."""

    name: str
    reason: str


@dataclass(frozen=True)
class Row:
    """One line of the table: a contestant at one size. Times are NaN where it did not take part or was wrong."""

    part: str
    size: str
    amount: float
    unit: str  # of amount, the plots' abscissa; empty: not to be plotted
    contestant: str
    seconds: float  # the median
    least: float
    rounds: int
    ratio: float  # to the reference's median in the same rounds
    reference: str
    peak_mb: float
    right: str
    failed: bool = False


def race(
    part: str,
    size: str,
    amount: float,
    unit: str,
    contestants: Sequence[Contestant | Absent],
    reference: str = "",
) -> list[Row]:
    """Time contestants in turns; the median counts. The reference is the first one unless named.

    Every result is checked before anything is timed. Who is wrong (AssertionError), or fails as a peer, gets a row that
    says so.
    """
    times: dict[str, list[float]] = {}
    peak, right, failed = {}, {}, {c.name: f"not run: {c.reason}" for c in contestants if isinstance(c, Absent)}
    running = []
    for c in (c for c in contestants if isinstance(c, Contestant)):
        try:
            seconds, peak[c.name], result = c.once(trim=True)
            right[c.name] = c.right(result)
            if c.warm:  # the first call also loaded what was compiled
                peak[c.name] = c.once(trim=True)[1]
        except AssertionError as error:
            failed[c.name] = f"WRONG: {error}"
        except Exception as error:
            if not c.peer:
                raise
            failed[c.name] = f"failed: {type(error).__name__}: {error}".splitlines()[0][:160]
        else:
            times[c.name] = [] if c.warm else [seconds]
            running.append(c)
        result = None
    for _ in range(EFFORT.rounds):
        for c in running:
            if sum(times[c.name]) < EFFORT.seconds:
                times[c.name].append(c.once()[0])
        running = running[1:] + running[:1]  # nobody always follows the same one
    for c in running:
        c.close()
    return _rows(part, size, amount, unit, [c.name for c in contestants], reference, times, peak, right, failed)


def _rows(
    part: str,
    size: str,
    amount: float,
    unit: str,
    names: Sequence[str],
    reference: str,
    times: dict[str, list[float]],
    peak: dict[str, float],
    right: dict[str, str],
    failed: dict[str, str],
) -> list[Row]:
    median = {name: statistics.median(t) for name, t in times.items()}
    reference = reference or next((name for name in names if name in times), names[0])
    against = median.get(reference, math.nan)
    rows = []
    for name in names:
        own = times.get(name, [])
        rows.append(
            Row(
                part,
                size,
                amount,
                unit,
                name,
                median.get(name, math.nan),
                min(own, default=math.nan),
                len(own),
                median.get(name, math.nan) / against,
                reference,
                peak.get(name, math.nan),
                failed.get(name) or right[name],
                name in failed,
            )
        )
        r = rows[-1]
        say(f"  {size:32s} {name:42s} {1e3 * r.seconds:10.2f} ms {r.ratio:8.2f} x  {r.right}")
    return rows


def say(text: str) -> None:
    """Tell how far it is, on stderr."""
    print(text, file=sys.stderr, flush=True)


def floor(arrays: Sequence[np.ndarray], output_bytes: int = 0) -> list[Contestant]:
    """Give the floor: a copy of these arrays and as many further bytes, into new memory and into memory that is there.

    New memory is what a result costs: its pages are not there until the first touch.
    """
    sources = [*arrays, np.ones(output_bytes, np.uint8)]
    targets = [np.zeros_like(a) for a in sources]
    total = sum(a.nbytes for a in sources)

    def fresh() -> list[np.ndarray]:
        pages = mmap.mmap(-1, total, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)  # an allocator might give touched memory
        if total >= HUGE and hasattr(mmap, "MADV_HUGEPAGE"):
            pages.madvise(mmap.MADV_HUGEPAGE)
        copies, start = [], 0
        for source in sources:
            copies.append(np.frombuffer(pages, source.dtype, source.size, start).reshape(source.shape))
            np.copyto(copies[-1], source)
            start += source.nbytes
        return copies

    def warm() -> list[np.ndarray]:
        for target, source in zip(targets, sources, strict=True):
            np.copyto(target, source)
        return targets

    def equal(copies: list[np.ndarray]) -> str:
        for copy, source in zip(copies, sources, strict=True):
            assert np.array_equal(copy, source, equal_nan=source.dtype.kind == "f"), "the copy differs"
        return f"{total / 1e6:.1f} MB"

    return [Contestant(FLOOR, fresh, equal), Contestant(WARM, warm, equal)]


def trim_memory() -> None:
    """Give freed memory back to the kernel, where the C library can."""
    with suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def resident_mb() -> float:
    """Give how much memory this process holds now."""
    return _status_mb("VmRSS")


def _reset_peak() -> float:
    """Let the kernel forget this process's peak memory; give what is in use now, in MB."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return math.nan
    return resident_mb()


def _status_mb(name: str) -> float:
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return math.nan
    return next((int(line.split()[1]) / 1e3 for line in lines if line.startswith(name)), math.nan)
