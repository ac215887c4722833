"""Frames go to disk while the next one is taken."""

from __future__ import annotations

import queue
import threading
from types import TracebackType

from core.capture.store import Store
from core.devices import Image

AHEAD = 4  # frames that may wait for the disk: what a power cut can cost beyond the one being taken


class Writer:
    """Keeps shots in a store, in the order they come, from a thread of its own.

    Nothing may depend on a shot before `wait` has returned. Leaving the context writes what is waiting, whatever the
    reason for leaving: frames that were taken before a cancellation are there when the capture goes on.

    Raises
    ------
    StripeError
        From `put` and `wait`, once a frame could not be written; the frames after it are given up.
    """

    def __init__(self, store: Store) -> None:
        self.store = store
        self._waiting: queue.Queue[tuple[int, Image] | None] = queue.Queue(AHEAD)
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, name="frames to disk", daemon=True)

    def __enter__(self) -> Writer:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._waiting.put(None)
        self._thread.join()

    def put(self, planned: int, image: Image) -> None:
        """Hand over a shot; waits while `AHEAD` others wait."""
        self._check()
        self._waiting.put((planned, image))

    def wait(self) -> None:
        """Return once everything handed over is on disk, complete and flushed."""
        self._waiting.join()
        self._check()

    def _check(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _run(self) -> None:
        while (item := self._waiting.get()) is not None:
            try:
                if self._failure is None:
                    self.store.keep(*item)
            except BaseException as error:  # told in the thread that waits for the frame
                self._failure = error
            finally:
                self._waiting.task_done()
