"""The linear algebra's own threads: they wait for each other without pause, and ours use the processors already.

The commands and the window start NumPy with one. A program that calls the core has as many as there are processors:
small products then take several times as long where anything else is at work, and no process can be copied beside them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from threading import Lock
from typing import Any

CHOSEN = "OPENBLAS_NUM_THREADS"  # where somebody has told how many there shall be, nothing is changed

_lock, _limits = Lock(), ExitStack()
_inside = 0  # calls under way, in all threads


@contextmanager
def on_own_threads() -> Iterator[None]:
    """Let the linear algebra have one thread, and after the last of such calls as many as before; a decorator, too."""
    global _inside
    if CHOSEN in os.environ or (control := _control()) is None:
        yield
        return
    with _lock:
        if not _inside:
            _limits.enter_context(control.threadpool_limits(limits=1, user_api="blas"))
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if not _inside:
                _limits.close()


def one_thread() -> None:
    """Let it have one thread from now on."""
    if CHOSEN not in os.environ and (control := _control()) is not None:
        control.threadpool_limits(limits=1, user_api="blas")


def end_workers() -> None:
    """End the threads that OpenBLAS keeps for its next large product, which starts others, as it does after a fork."""
    if os.environ.get(CHOSEN) == "1" or (control := _control()) is None:
        return
    for library in control.ThreadpoolController().lib_controllers:
        if library.internal_api == "openblas":
            with suppress(AttributeError):  # built without threads
                library.dynlib.blas_thread_shutdown_()


def _control() -> Any:
    """Give threadpoolctl; None in an environment that was made before it was asked for: all goes on, slower."""
    try:
        import threadpoolctl
    except ImportError:
        return None
    return threadpoolctl
