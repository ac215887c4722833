"""Compiled kernels and their cache.

numba keeps a kernel until the file of its outermost function changes, and does not notice changes in the files of
what that calls: after an update an old kernel would run, or fail to load. Here the cache's folder is named by the
content of all rooms that have kernels, so what belongs to other sources is never found; it is deleted. That a kernel
is being compiled is told through the progress of the work that needs it.

`njit` compiles what Python calls. What only kernels call is marked `inner`: without wrappers through which Python could
call it, and in one version for constants and variables alike, it costs a third less to compile.
"""

from __future__ import annotations

import gc
import hashlib
import os
import shutil
import sys
from functools import partial
from pathlib import Path

import numba
from numba.core import event
from numba.extending import register_jitable as inner

from core.progress import announce

__all__ = ["inner", "njit"]

njit = partial(numba.njit, no_cfunc_wrapper=True)

_CORE = Path(__file__).parent
_ROOMS = ("bench", "calibrate", "decode", "measure", "reconstruct")


def fingerprint() -> str:
    """Sign the content of all rooms that have kernels, and how they are compiled."""
    digest = hashlib.sha256(numba.__version__.encode())
    for files in ("compiling.py", *(f"{room}/*.py" for room in _ROOMS)):
        for path in sorted(_CORE.glob(files)):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path:
    """A folder of this version's own beside the sources.

    In the user's cache where the sources cannot be written or are those of an installed bundle, which stays as it is.
    """
    base = _CORE / "__pycache__"
    if getattr(sys, "frozen", False) or not os.access(base if base.exists() else _CORE, os.W_OK):
        base = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "stripe-workbench"
    folder = base / f"kernels-{fingerprint()}"
    for old in base.glob("kernels-*"):
        if old != folder:
            shutil.rmtree(old, ignore_errors=True)
    return folder


if not os.environ.get("NUMBA_CACHE_DIR"):
    numba.config.CACHE_DIR = str(_cache_folder())  # type: ignore[attr-defined]


class _Announcer(event.Listener):
    """Tells that the work waits for the compiler, and keeps Python from looking for garbage meanwhile.

    The compiler makes a great many objects and drops few: looking through them takes a tenth of its time.
    """

    def __init__(self) -> None:
        self._within, self._collects = 0, False

    def on_start(self, event: event.Event) -> None:
        if self._within == 0:
            self._collects = gc.isenabled()
            gc.disable()
        self._within += 1
        announce("compiling for this processor, once")

    def on_end(self, event: event.Event) -> None:
        self._within -= 1
        if self._within == 0 and self._collects:
            gc.enable()


event.register("numba:compile", _Announcer())
