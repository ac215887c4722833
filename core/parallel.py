"""Bands of rows on threads, for kernels that release the interpreter lock."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import lru_cache
from itertools import pairwise

THREADS = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
TURNS = 4  # bands of each thread: who meets a busy processor leaves the rest to the others


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
    least : int
        A band has so many rows in the mean at least; small work stays in the calling thread.

    Examples
    --------
    >>> done = []
    >>> run_in_bands(lambda start, stop: done.extend(range(start, stop)), 100)
    >>> sorted(done) == list(range(100))
    True
    """
    threads = min(THREADS, rows // least)
    if threads <= 1:
        function(0, rows)
        return
    waiting = iter(_bands(rows, min(TURNS * threads, rows // least)))

    def work() -> None:
        for start, stop in waiting:
            function(start, stop)

    others = [_pool(os.getpid(), threads - 1).submit(work) for _ in range(threads - 1)]
    try:
        work()
    finally:
        # nobody may go on writing when this function has returned, and who never began is not waited for
        begun = [other for other in others if not other.cancel()]
        wait(begun)
    for other in begun:
        other.result()


def _bands(rows: int, count: int) -> list[tuple[int, int]]:
    """Bands from wide to narrow, so that all threads end at nearly the same time."""
    edges = sorted({round(rows * (1 - (1 - i / count) ** 2)) for i in range(count + 1)})
    return list(pairwise(edges))


@lru_cache(maxsize=4)
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    """Threads that stay, of this process: those of a parent do not survive a fork."""
    return ThreadPoolExecutor(threads, "bands")
