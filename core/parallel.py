"""Bands of rows on threads, for kernels that release the interpreter lock."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

THREADS = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)


def limit_threads(count: int) -> None:
    """Use at most `count` threads from now on: for processes that share this machine's processors."""
    global THREADS
    THREADS = count


def run_in_bands(function: Callable[[int, int], None], rows: int, least: int = 16) -> None:
    """Call ``function(start, stop)`` for bands that together cover ``range(rows)``, on all processors.

    Parameters
    ----------
    function : callable
        Works on rows start to stop - 1 and touches no others; it should release the interpreter lock.
    rows : int
    least : int
        No band has fewer rows; small work stays in the calling thread.

    Examples
    --------
    >>> done = []
    >>> run_in_bands(lambda start, stop: done.extend(range(start, stop)), 100)
    >>> sorted(done) == list(range(100))
    True
    """
    bands = max(1, min(THREADS, rows // least))
    if bands == 1:
        function(0, rows)
        return
    edges = [rows * i // bands for i in range(bands + 1)]
    with ThreadPoolExecutor(bands) as pool:
        for result in [pool.submit(function, a, b) for a, b in pairwise(edges)]:
            result.result()
