"""Python's garbage is collected in the window's thread alone.

The collector runs in whatever thread allocates when it is due. In a worker's it would destroy widgets that refer to
each other in a circle: Qt then holds a lock of its signals while it waits for Python, and the window's thread, which
has Python, may wait for that lock. Neither ever goes on.
"""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

from PySide6.QtCore import QTimer

LOOK_MS = 300


@contextmanager
def collected_here() -> Iterator[None]:
    """Within it garbage is collected by the thread that entered, while its event loop runs, where Python would."""
    before = gc.isenabled()
    gc.disable()
    timer = QTimer()
    timer.timeout.connect(_collect)
    timer.start(LOOK_MS)
    try:
        yield
    finally:
        timer.stop()
        if before:
            gc.enable()


def _collect() -> None:
    """Collect the oldest generation that is due."""
    due = zip(gc.get_count(), gc.get_threshold(), strict=True)
    generations = [k for k, (count, limit) in enumerate(due) if 0 < limit < count]
    if generations:
        gc.collect(generations[-1])
