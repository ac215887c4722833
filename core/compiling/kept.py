"""The folders of compiled kernels: the user's, and what a bundle or a wheel brings along.

What comes along is compiled for a level of processors that nearly all reach (`packaging/kernels.py`). It bears the same
names: what does not fit versions or sources is not found, and compiled.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from core.atomic import atomic_write
from core.compiling.native import Native, processor
from core.resources import user_cache

try:
    import fcntl
except ImportError:  # not on this system
    fcntl = None  # type: ignore[assignment]

_KEPT_DAYS, _KEPT_BYTES = 60, 256_000_000
_OWN = Path(__file__).parents[1]
_BROUGHT = _OWN / "kernels"
_LEVEL, _LEVEL_HAS = "x86-64-v3", {"+avx2", "+bmi", "+bmi2", "+f16c", "+fma", "+lzcnt", "+movbe"}


def name_of(kernel: str, made_from: str, kinds: tuple[Any, ...]) -> tuple[str, str]:
    """Name a kernel's version for this processor, and for the level of what is brought along."""
    system, model, features = processor()

    def named(*made_for: str) -> str:
        text = f"{made_from} {_told(kinds)} {made_for}"
        return f"{kernel}-{hashlib.sha256(text.encode()).hexdigest()[:24]}.kernel"

    fits = set(features.split(",")) >= _LEVEL_HAS
    return named(system, model, features), named(system, _LEVEL, "") if fits else ""


def _told(kind: Any) -> str:
    """Tell a kind of argument with the names of its fields; never by address."""
    if isinstance(kind, tuple):
        return f"({' '.join(map(_told, kind))})"
    return f"{kind.__name__} {getattr(kind, '_fields', '')}" if isinstance(kind, type) else str(kind)


def find(name: tuple[str, str]) -> Native:
    """Read what this user's processor compiled, else what was brought along; FileNotFoundError if neither is there."""
    own, brought = name
    if (folder := kernel_folder()) is not None and (kept := folder / own).exists():
        if time.time() - kept.stat().st_mtime > 86400:
            os.utime(kept)  # what is in use stays
        return read(kept)
    if not brought:
        raise FileNotFoundError(own)
    return read(_BROUGHT / brought)


def read(kernel: Path) -> Native:
    """Read a kept kernel."""
    return Native(*pickle.loads(kernel.read_bytes()))


def keep(name: tuple[str, str], native: Native) -> None:
    """Keep a kernel; a full disk takes nothing from the result."""
    if (folder := kernel_folder()) is not None:
        try:
            _sweep(folder)
            with atomic_write(folder / name[0], durable=False) as file:
                file.write(pickle.dumps(tuple(native)))
        except Exception:
            return


@contextmanager
def compiled_by_one(name: tuple[str, str]) -> Iterator[None]:
    """Let other processes that want this kernel wait until it is kept, where the file system has locks."""
    folder, place = kernel_folder(), int(hashlib.sha256(name[0].encode()).hexdigest()[:15], 16)
    if folder is None or fcntl is None:
        yield
        return
    try:
        handle = os.open(folder / "lock", os.O_RDWR | os.O_CREAT, 0o600)
    except OSError:
        yield
        return
    try:
        with suppress(OSError):
            fcntl.lockf(handle, fcntl.LOCK_EX, 1, place)  # a byte for every kernel, in a file of none
        yield
    finally:
        os.close(handle)


@cache
def kernel_folder() -> Path | None:
    """The folder of compiled kernels: the user's cache, else beside the sources, else none.

    The bundle and an installed package stay as they are, and all checkouts of one user share what is the same.
    """
    numba = os.environ.get("NUMBA_CACHE_DIR")
    of_the_user = Path(numba) / "stripe-workbench" if numba else user_cache()
    for base in filter(None, (of_the_user, _OWN / "__pycache__")):
        folder = base / "kernels"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return None


@cache
def _sweep(folder: Path) -> None:
    """Delete what nobody has used for long, and the oldest beyond a size; once a process, when something is added."""
    entries = sorted(((e.stat().st_mtime, e.stat().st_size, e) for e in folder.glob("*.kernel*")), reverse=True)
    size = 0
    for used, room, entry in entries:
        size += room
        if size > _KEPT_BYTES or time.time() - used > _KEPT_DAYS * 86400:
            entry.unlink(missing_ok=True)
