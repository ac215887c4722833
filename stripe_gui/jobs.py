"""Long work in a thread, one job after the other: progress, cancel, result, the whole traceback on failure.

A job runs a core function, which reports through `core.progress.Progress`. Only plain values cross the threads:
the window's thread looks at the running job at a steady pace and emits the signals itself.
"""

from __future__ import annotations

import threading
import time
import traceback
from collections import deque
from collections.abc import Callable
from enum import Enum
from typing import Any

from PySide6.QtCore import QObject, QTimer, Signal

from core.errors import Cancelled
from core.lazy import dataclass
from core.progress import Progress

POLL_MS = 30
WAIT_AT_END_S = 3.0


class JobState(Enum):
    """Where a job stands."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


@dataclass(frozen=True)
class Failure:
    """What a job failed with: the error itself and how it came about."""

    error: BaseException
    trace: str


class Job(QObject):
    """One run of a function; `succeeded(result)`, `failed(Failure)` or `cancelled()`, then `ended()`."""

    progressed = Signal(float, str)
    told = Signal(str, int, float)  # a figure of its course: name, step (0 begins anew), value
    succeeded = Signal(object)
    failed = Signal(object)
    cancelled = Signal()
    ended = Signal()

    def __init__(self, title: str, function: Callable[..., Any], arguments: tuple, keywords: dict, stage: str) -> None:
        super().__init__()
        self.title, self.stage = title, stage
        self.state, self.waits = JobState.WAITING, False
        self.fraction, self.message = 0.0, ""
        self.started = 0.0
        self.result: Any = None
        self.failure: Failure | None = None
        self._function, self._arguments, self._keywords = function, arguments, keywords
        self._stop = threading.Event()
        self._latest = (0.0, "")  # written by the worker: one assignment is atomic
        self._course: deque[tuple[str, int, float]] = deque()  # so are append and popleft
        self._thread: threading.Thread | None = None

    @property
    def stopping(self) -> bool:
        return self._stop.is_set()

    @property
    def active(self) -> bool:
        return self.state in (JobState.WAITING, JobState.RUNNING)

    def cancel(self) -> None:
        """Ask the work to stop at its next step."""
        self._stop.set()

    def seconds_left(self) -> float | None:
        """Estimate the remaining time from the pace so far; None while it is too early to tell."""
        elapsed = time.monotonic() - self.started
        if self.state is not JobState.RUNNING or self.fraction < 0.03 or elapsed < 1.0:
            return None
        return elapsed * (1 - self.fraction) / self.fraction

    def _report(self, fraction: float, message: str) -> None:
        self._latest = (fraction, message or self._latest[1])

    def _work(self) -> None:
        progress = Progress(self._report, self._stop.is_set, lambda *figure: self._course.append(figure))
        try:
            progress.check()
            self.result = self._function(*self._arguments, progress=progress, **self._keywords)
        except BaseException as error:  # the worker's last line of defence: the window tells every failure
            self.failure = Failure(error, traceback.format_exc())

    def _start(self) -> None:
        self.state, self.started = JobState.RUNNING, time.monotonic()
        self._thread = threading.Thread(target=self._work, name=f"job: {self.title}", daemon=True)
        self._thread.start()

    def _look(self) -> bool:
        """Pass on the progress; say whether the work is over."""
        over = self._thread is not None and not self._thread.is_alive()
        if self._latest != (self.fraction, self.message):
            self.fraction, self.message = self._latest
            self.progressed.emit(self.fraction, self.message)
        while self._course:
            self.told.emit(*self._course.popleft())
        return over

    def _end(self, *, wanted: bool = True) -> None:
        failure = self.failure
        self._function, self._arguments, self._keywords = _nothing, (), {}  # let go of large arguments
        if not wanted or (failure is not None and isinstance(failure.error, Cancelled)):
            self.state = JobState.CANCELLED
            self.cancelled.emit()
        elif failure is None:
            self.state = JobState.DONE
            self.succeeded.emit(self.result)
        else:
            self.state = JobState.FAILED
            self.failed.emit(failure)
        self.ended.emit()


class JobQueue(QObject):
    """Runs jobs in order, one at a time.

    With `latest_only`, for previews, a new job stops the running one and takes the place of those that wait. What was
    stopped is not shown even if it came through: the operator looks at something else by now. A job that `waits` stands
    back: it stops none, and none stops it.
    """

    changed = Signal()  # a job started, moved on or ended

    def __init__(self, parent: QObject | None = None, *, latest_only: bool = False) -> None:
        super().__init__(parent)
        self._latest_only = latest_only
        self._waiting: deque[Job] = deque()
        self.running: Job | None = None
        self._timer = QTimer(self)
        self._timer.setInterval(POLL_MS)
        self._timer.timeout.connect(self._poll)

    @property
    def waiting(self) -> tuple[Job, ...]:
        return tuple(self._waiting)

    @property
    def busy(self) -> bool:
        return self.running is not None or bool(self._waiting)

    def run(
        self,
        title: str,
        function: Callable[..., Any],
        *arguments: Any,
        stage: str = "",
        waits: bool = False,
        on_done: Callable[[Any], None] | None = None,
        on_failed: Callable[[Failure], None] | None = None,
        **keywords: Any,
    ) -> Job:
        """Queue ``function(*arguments, progress=..., **keywords)``; the callbacks run in the window's thread."""
        job = Job(title, function, arguments, keywords, stage)
        if on_done is not None:
            job.succeeded.connect(on_done)
        if on_failed is not None:
            job.failed.connect(on_failed)
        if self._latest_only and not waits:
            self._cancel([job for job in self._all() if not job.waits])
        job.waits = waits
        self._waiting.append(job)
        if not self._timer.isActive():
            self._timer.start()
        QTimer.singleShot(0, self, self._poll)
        self.changed.emit()
        return job

    def cancel_all(self) -> None:
        """Stop the running job and forget those that wait."""
        self._cancel(self._all())
        self.changed.emit()

    def _all(self) -> list[Job]:
        return [*self._waiting, *([] if self.running is None else [self.running])]

    def _cancel(self, jobs: list[Job]) -> None:
        for job in jobs:
            job.cancel()
            if job in self._waiting:
                self._waiting.remove(job)
                job.state = JobState.CANCELLED
                job.cancelled.emit()
                job.ended.emit()

    def shut_down(self) -> bool:
        """Stop everything and wait a moment for the worker; say whether it ended."""
        self.cancel_all()
        self._timer.stop()
        running, self.running = self.running, None
        if running is None or running._thread is None:
            return True
        running._thread.join(WAIT_AT_END_S)
        return not running._thread.is_alive()

    def _poll(self) -> None:
        job = self.running
        if job is not None:
            before = (job.fraction, job.message)
            if job._look():
                self.running = None
                job._end(wanted=not (self._latest_only and job.stopping))
                self.changed.emit()
            elif before != (job.fraction, job.message):
                self.changed.emit()
        if self.running is None and self._waiting:
            self.running = self._waiting.popleft()
            self.running._start()
            self.changed.emit()
        if not self.busy:
            self._timer.stop()


def _nothing(**_: Any) -> None:
    return None
