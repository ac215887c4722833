"""A process that runs commands in forks of itself and disturbs them at their n-th call that changes the disk.

It has imported the program and started no thread, so that its forks are as good as new processes, and quicker. A line
of JSON on standard input asks for one command, a line on standard output says how it ended.
"""

from __future__ import annotations

import errno
import io
import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

PATIENCE_S = 120


@contextmanager
def disturbed(root: Path, number: int, what: Callable[[], None]) -> Iterator[list[str]]:
    """Count the calls that change the disk below a folder, and do something before one of them."""
    calls: list[str] = []

    def counted(name: str) -> None:
        calls.append(name)
        if len(calls) == number:
            what()

    def inside(path: Any) -> bool:
        return not isinstance(path, int) and os.fspath(path).startswith(str(root))

    real = {name: getattr(os, name) for name in ("open", "mkdir", "rename", "replace", "unlink", "rmdir", "link")}
    real_fsync, real_fdopen, real_open = os.fsync, os.fdopen, io.open

    def wrapped(name: str) -> Callable[..., Any]:
        def call(path: Any, *rest: Any, **named: Any) -> Any:
            if inside(path) and (name != "open" or rest[0] & os.O_CREAT):
                counted(name)
            return real[name](path, *rest, **named)

        return call

    def fsync(handle: int) -> None:
        counted("fsync")
        real_fsync(handle)

    def fdopen(handle: int, *rest: Any, **named: Any) -> Any:
        file = real_fdopen(handle, *rest, **named)
        if file.writable() and inside(os.readlink(f"/proc/self/fd/{handle}")):
            return Counting(file, counted)
        return file

    def opened(path: Any, mode: str = "r", *rest: Any, **named: Any) -> Any:
        if not inside(path) or {"w", "x"}.isdisjoint(mode):
            return real_open(path, mode, *rest, **named)
        counted("open")
        return Counting(real_open(path, mode, *rest, **named), counted)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(io, "open", opened)
        for name in real:
            patch.setattr(os, name, wrapped(name))
        patch.setattr(os, "fsync", fsync)
        patch.setattr(os, "fdopen", fdopen)
        yield calls


def disturb(fault: str) -> None:
    """End this process, or fail as the disk does."""
    if fault == "kill":
        os.kill(os.getpid(), signal.SIGKILL)
    if fault == "SIGTERM":
        os.kill(os.getpid(), signal.SIGTERM)  # heard at the next step
        return
    raise OSError(getattr(errno, fault), os.strerror(getattr(errno, fault)))


class Counting:
    """A file whose writes are counted."""

    def __init__(self, file: Any, counted: Callable[[str], None]) -> None:
        self._file, self._counted = file, counted

    def write(self, data: Any) -> Any:
        self._counted("write")
        return self._file.write(data)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def __enter__(self) -> Counting:
        return self

    def __exit__(self, *error: object) -> None:
        self._file.close()


def run(job: dict[str, Any], out: int) -> None:
    """Run one command in this process, disturbed as the job says; write the number of calls and the exit code."""
    from core.cli import _end, main

    signal.signal(signal.SIGTERM, _end)
    signal.alarm(PATIENCE_S)
    told = Path(job["told"])
    with told.open("w") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)

    try:
        with disturbed(Path(job["root"]), job["number"], lambda: disturb(job["fault"])) as calls:
            code = main(job["arguments"])
        sys.stdout.flush()
        sys.stderr.flush()
        os.write(out, json.dumps([code, len(calls)]).encode())
    except BaseException as error:
        os.write(out, json.dumps([f"{type(error).__name__}: {error}", len(calls)]).encode())
    os._exit(0)


def serve() -> None:
    """Run jobs until the input ends."""
    import core.calibrate
    import core.cli
    import core.evaluate
    import core.pipeline
    import core.reconstruct  # noqa: F401

    for line in sys.stdin:
        job = json.loads(line)
        reading, writing = os.pipe()
        if (pid := os.fork()) == 0:
            run(job, writing)
        os.close(writing)
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        said = os.read(reading, 4096)
        os.close(reading)
        code, calls = json.loads(said) if said else (status, 0)
        print(json.dumps({"code": code, "calls": calls}), flush=True)


if __name__ == "__main__":
    serve()
