"""Bands of rows on threads, for kernels that release the interpreter lock; whole captures on processes."""

from __future__ import annotations

import os
import pickle
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from functools import lru_cache
from itertools import pairwise
from mmap import mmap
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar, cast
from weakref import finalize

from core.algebra import end_workers, one_thread
from core.errors import StripeError
from core.progress import Progress

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

T = TypeVar("T")
THREADS = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
_ALIGNED = 64  # bytes at which arrays begin
FEWEST = 3  # pieces of work that are worth processes
_AT_ONCE = 16_000  # numbers that a pipe holds
TURNS = 4  # bands of each thread: who meets a busy processor leaves the rest to the others


def limit_threads(count: int) -> None:
    """Use at most `count` threads from now on: for processes that share this machine's processors."""
    global THREADS
    THREADS = count


def run_in_bands(function: Callable[[int, int], None], rows: int, least: int = 16) -> None:
    """Call ``function(start, stop)`` for bands that together cover ``range(rows)``, on all processors.

    It works on rows start to stop - 1, touches no others and should release the interpreter lock. A band has `least`
    rows in the mean; small work stays in the calling thread.

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


def can_fork(count: int) -> bool:
    """Whether so many pieces of work are worth processes of their own, and these can be had at no risk.

    A copy of a process has none of its threads, and locks that they held are never released: only a process of a single
    thread is copied, as most commands are. The window's, a test's or a Dask worker's is not.
    """
    if sys.platform != "linux" or not FEWEST <= count < _AT_ONCE or THREADS < 2:
        return False
    others = [thread for thread in threading.enumerate() if thread is not threading.current_thread()]
    if all(thread.name.startswith("bands") for thread in others):
        _pool.cache_clear()  # so that they end: only this thread could have given them work
        for thread in others:
            thread.join(1.0)
        end_workers()
        _end_workers_of_opencv()
    with suppress(OSError):  # /proc may be hidden
        for _ in range(20):
            # its number is exact; a list of /proc/self/task lacks threads where one ends meanwhile
            if re.search(rb"^Threads:\s*1$", Path("/proc/self/status").read_bytes(), re.MULTILINE):
                return True
            time.sleep(0.001)  # the kernel takes a moment longer
    return False


def _end_workers_of_opencv() -> None:
    """End the threads that OpenCV keeps for its next call, which starts others."""
    if opencv := sys.modules.get("cv2"):
        count = opencv.getNumThreads()
        opencv.setNumThreads(1)
        opencv.setNumThreads(count)


def on_processes(
    work: Callable[[int, Progress], T],
    count: int,
    progress: Progress,
    most: int | None = None,
    meanwhile: Callable[[], object] = lambda: None,
) -> Generator[T]:
    """Yield ``work(0, ...)`` to ``work(count - 1, ...)`` in this order, from copies of this process; see `can_fork`.

    Copies share what is in memory, take the next piece when they are done with one, and send what comes of it. What one
    reports is reported here; who stops ends them all. There are `most` at most, and where none can be had, or one alone
    is wanted, the pieces are worked on here. `meanwhile` is what this process may do beside the copies.
    """
    copies_at_once = min(most or THREADS, count)
    if copies_at_once < 2 or not can_fork(count):
        yield from map(work, range(count), progress.parts(count))
        return
    import multiprocessing
    from multiprocessing.connection import wait as wait_for

    fork = multiprocessing.get_context("fork")
    turn, numbers = os.pipe()
    os.write(numbers, b"".join(k.to_bytes(4, "big") for k in range(count)))
    os.close(numbers)
    pipes = [fork.Pipe() for _ in range(copies_at_once)]
    readers = [reader for reader, _ in pipes]
    copies = [fork.Process(target=_copy, args=(work, turn, sender, readers), daemon=True) for _, sender in pipes]
    done: dict[int, Any] = {}
    _end_workers_of_opencv()  # a copy would wait for them
    try:
        for copy, (_, sender) in zip(copies, pipes, strict=True):
            copy.start()
            sender.close()
        meanwhile()
        for k in range(count):
            while k not in done and readers:
                progress.check()
                for reader in cast("list[Connection]", wait_for(readers, 0.05)):
                    try:
                        number, found = _received(reader)
                    except (EOFError, OSError):  # nothing left to do, or killed, maybe in the middle of a word
                        readers.remove(reader)
                        continue
                    if number < 0:
                        progress(k / count, found)
                    else:
                        done[number] = found
            result = done.pop(k) if k in done else work(k, progress.quiet())
            if isinstance(result, Exception):
                raise result
            yield result
    finally:
        os.close(turn)
        for copy in copies:
            if copy.pid is not None:
                copy.terminate()
                copy.join()


def beside(work: Callable[[], T]) -> Callable[[], T]:
    """Begin small work in a copy of this process, where one can be had; give what waits for its result.

    Where there is no copy, or it fails, the work is done when the result is asked for. A copy for whose result nobody
    can ask any more is ended.
    """
    if os.name == "nt" or not hasattr(os, "fork") or not can_fork(FEWEST):
        return work
    reader, writer = os.pipe()
    copy = os.fork()
    if not copy:
        try:
            with suppress(BaseException):  # also the signals that end a command
                os.close(reader)
                _alone()
                with open(writer, "wb") as out:
                    out.write(pickle.dumps(work()))
        finally:
            os._exit(0)
    os.close(writer)
    file = open(reader, "rb")  # noqa: SIM115  for as long as somebody may ask

    def result() -> T:
        with file:
            text = file.read()
        end.detach()
        with suppress(ChildProcessError):  # who started this process had it wait for none
            os.waitpid(copy, 0)
        with suppress(EOFError, pickle.UnpicklingError):  # it ended before it had told all
            return cast("T", pickle.loads(text))
        return work()

    end = finalize(result, _end_copy, os.getpid(), copy, file)
    return result


def _end_copy(process: int, copy: int, file: BinaryIO) -> None:
    """End a copy of a process, which other copies of that process leave alone."""
    file.close()
    if os.getpid() == process:
        with suppress(OSError):
            os.kill(copy, signal.SIGTERM)
            os.waitpid(copy, 0)


def _alone() -> None:
    """Use one thread, in a copy of a process that uses all processors."""
    limit_threads(1)
    one_thread()
    if "cv2" in sys.modules:
        sys.modules["cv2"].setNumThreads(1)


def _copy(work: Callable[[int, Progress], Any], turn: int, sender: Connection, readers: list[Connection]) -> None:
    """Work on pieces until none is left, or nobody reads any more what comes of them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who was copied ends its copies
    for ending in ("SIGTERM", "SIGHUP"):  # what can be copied has both
        signal.signal(getattr(signal, ending), signal.SIG_DFL)
    for reader in readers:
        reader.close()
    _alone()
    said = Progress(lambda fraction, message: sender.send((-1, message)))
    with suppress(OSError):  # nobody reads, or no room is left: who was copied does the rest, and tells why
        while number := os.read(turn, 4):
            k = int.from_bytes(number, "big")
            try:
                found = work(k, said)
            except StripeError as error:
                found = error
            _send(sender, k, found)


def _send(sender: Connection, number: int, found: Any) -> None:
    """Send what came of a piece; its arrays in a file in memory, so that nobody waits until they are received."""
    from multiprocessing.reduction import send_handle

    arrays: list[pickle.PickleBuffer] = []
    text = pickle.dumps((number, found), 5, buffer_callback=arrays.append)
    parts = [array.raw() for array in arrays]
    sizes = [part.nbytes for part in parts]
    sender.send((text, sizes))
    if any(sizes):
        with open(os.memfd_create("piece"), "wb") as file:
            for part in parts:
                file.write(part)
                file.write(bytes(-part.nbytes % _ALIGNED))
            file.flush()
            send_handle(sender, file.fileno(), os.getppid())


def _received(reader: Connection) -> tuple[int, Any]:
    """Give what `_send` sent, or what the piece said; arrays stay where they are and go with the last of them."""
    from multiprocessing.reduction import recv_handle

    text, sizes = reader.recv()
    if isinstance(sizes, str):
        return text, sizes
    views, at = [memoryview(b"")] * len(sizes), 0
    if any(sizes):
        handle = recv_handle(reader)
        whole = memoryview(mmap(handle, 0))
        os.close(handle)
        for k, size in enumerate(sizes):
            views[k] = whole[at : at + size]
            at += size + -size % _ALIGNED
    number, found = pickle.loads(text, buffers=views)
    return number, found
