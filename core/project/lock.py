"""One writer at a time: a lock file that names its holder, and that a dead program does not hold any more.

The kernel's lock on the file counts, not the file: it goes with the process, however that ends. What the file says is
for people. Where the file system has no such locks, the file counts as long as its process lives on this machine.
Reading needs no lock: results are replaced whole.
"""

from __future__ import annotations

import errno
import getpass
import json
import os
import platform
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path
from typing import Any

from core.atomic import is_running, sweep, unwritable
from core.errors import BusyError
from core.fields import kept_object
from core.project.contents import FILE as CONTENTS

try:
    import fcntl
except ImportError:  # not on this system
    fcntl = None  # type: ignore[assignment]
try:
    import msvcrt
except ImportError:
    msvcrt = None  # type: ignore[assignment]

RESULTS_LOCK = ".lock"  # in results/
DOCUMENT_LOCK = ".project.lock"  # beside project.json
_WITHOUT = {getattr(errno, name) for name in ("ENOLCK", "EOPNOTSUPP", "ENOSYS", "EINVAL") if hasattr(errno, name)}
_threads: dict[str, threading.RLock] = {}  # by path: which thread of this process may have it
_handles: dict[str, int] = {}  # by path: the files that are locked; -1 where this is a copy of the process that did


def _let_go() -> None:
    """Close the locks in a copy of this process, which would hold them if it lived longer; it writes under them."""
    for path, handle in _handles.items():
        with suppress(OSError):
            os.close(handle)
        _handles[path] = -1


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_let_go)


def read_only(folder: Path) -> bool:
    """Whether a project's results may only be read."""
    return not all(os.access(place, os.W_OK) for place in (folder, folder / "results") if place.exists())


@contextmanager
def writing_results(folder: Path, work: str) -> Iterator[None]:
    """Be the one who writes into a project's results; nested calls of one thread are one.

    BusyError at once, by whom and since when, if another program, or another thread of this one, is writing there;
    InputError if nothing can be written.
    """
    results = Path(folder) / "results"
    new = not results.exists()
    try:
        with lock(results / RESULTS_LOCK, work):
            for place in (Path(folder), results, *(results / name for name in ("runs", "report", "points"))):
                sweep(place)  # what killed programs left: nobody else writes there now
            yield
    finally:
        if new:
            with suppress(OSError):
                if os.listdir(results) == [CONTENTS]:
                    (results / CONTENTS).unlink()
                results.rmdir()  # only where nothing was written


@contextmanager
def lock(path: Path, work: str, wait_s: float = 0.0) -> Iterator[None]:
    """Hold a lock file, waiting for it if need be; it is gone afterwards."""
    key, until = os.path.realpath(path), time.monotonic() + wait_s
    mine = _threads.setdefault(key, threading.RLock())
    if not mine.acquire(timeout=wait_s):
        raise _busy(path, {**_who(work), "program": "another task of this program"})
    try:
        if key in _handles:  # a nested call
            yield
            return
        handle = _handles[key] = _take(path, work, until)
        try:
            yield
        finally:
            _handles.pop(key, None)
            _release(path, handle)
    finally:
        mine.release()


def holder_of(path: Path) -> dict[str, Any] | None:
    """Tell who holds a lock; None where nobody does, whatever was left behind."""
    if os.path.realpath(path) in _handles:
        return _read(path)
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:
        return None
    try:
        return None if _locked(handle, path) else _read(path)
    finally:
        os.close(handle)


def words_of(holder: dict[str, Any]) -> str:
    """Say who holds a lock."""
    return (
        f"{holder.get('program', 'a program')} (process {holder.get('pid', '?')} of {holder.get('user', '?')} on "
        f"{holder.get('host', '?')}, since {holder.get('since', '?')})"
    )


def _take(path: Path, work: str, until: float) -> int:
    while True:
        handle = _open(path)
        taken = _locked(handle, path)
        if taken and _is_there(handle, path):
            _write(handle, work)
            return handle
        os.close(handle)
        late = time.monotonic() - until
        if not taken and late > 0:
            seen = _read(path)
            if seen is not None or late > 1:  # whoever has just taken it says so in a moment
                raise _busy(path, seen or {})
        time.sleep(0.01)


def _is_there(handle: int, path: Path) -> bool:
    """Whether an open file is the one of that name: its last holder may have removed it meanwhile."""
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except OSError:
        return False


def _open(path: Path) -> int:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            return os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except PermissionError as refused:
            try:
                return os.open(path, os.O_RDONLY)  # another user's: it can be locked all the same
            except FileNotFoundError:
                raise refused from None
    except OSError as error:
        raise unwritable(path.parent, error) from error


def _locked(handle: int, path: Path) -> bool:
    """Take the kernel's lock if it is free; where there is none, see whether the process that the file names lives."""
    if fcntl is not None:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            return False
        except OSError as error:
            if error.errno not in _WITHOUT:
                raise
    elif msvcrt is not None:  # a byte far behind what is written, so that others can read who has it
        try:
            os.lseek(handle, 1 << 30, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
            return True
        except OSError:
            return False
    holder = _read(path) or {}
    pid = holder.get("pid")
    alive = isinstance(pid, int) and pid > 0 and is_running(pid)
    return holder.get("host") != platform.node() or not alive


def _release(path: Path, handle: int) -> None:
    if os.name == "nt":  # a file that is open cannot be removed there
        os.close(handle)
        with suppress(OSError):
            path.unlink()
        return
    with suppress(OSError):
        path.unlink()  # while it is held: whoever opened it meanwhile sees that it is not the file any more
    os.close(handle)


def _write(handle: int, work: str) -> None:
    with suppress(OSError):
        os.ftruncate(handle, 0)
        os.lseek(handle, 0, os.SEEK_SET)
        os.write(handle, json.dumps(_who(work)).encode())


def _who(work: str) -> dict[str, Any]:
    try:
        user = getpass.getuser()
    except (KeyError, OSError):
        user = str(os.getuid()) if hasattr(os, "getuid") else "?"
    name = Path(sys.argv[0]).name if sys.argv and sys.argv[0] not in ("", "-c", "-m") else "python"
    program = "stripe-core" if name == "__main__.py" else name
    return {
        "pid": os.getpid(),
        "host": platform.node(),
        "user": user,
        "program": f"{program} {work}",
        "since": f"{datetime.now():%Y-%m-%d %H:%M:%S}",
    }


def _read(path: Path) -> dict[str, Any] | None:
    return kept_object(path) or None


def _busy(path: Path, holder: dict[str, Any]) -> BusyError:
    return BusyError(path.parent, f"is being written by {words_of(holder)}", "wait until it is done; reading goes on")
