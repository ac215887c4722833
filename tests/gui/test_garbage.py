"""Widgets that nobody holds any more are destroyed by the window's thread, whatever thread allocates meanwhile."""

from __future__ import annotations

import gc
import threading
import weakref

from PySide6.QtCore import QObject

from core.progress import Progress
from stripe_gui.garbage import collected_here
from stripe_gui.jobs import JobQueue


class Knot(QObject):
    """Refers to itself, so that only the collector ends it."""

    def __init__(self, ended_in: list[threading.Thread]) -> None:
        super().__init__()
        self.itself = self
        weakref.finalize(self, lambda: ended_in.append(threading.current_thread()))


def allocate(progress: Progress) -> None:
    """Make so many containers that the collector is due again and again, in all generations."""
    held = []
    for k in range(200):
        progress(k / 200, "allocating")
        held.append([[] for _ in range(2000)])


def test_a_jobs_thread_destroys_no_widget(qapp, qtbot) -> None:
    ended_in: list[threading.Thread] = []
    queue = JobQueue()
    for _ in range(50):
        Knot(ended_in)
    job = queue.run("allocate", allocate)
    with qtbot.waitSignal(job.ended, timeout=20_000):
        pass
    held = [[] for _ in range(2 * gc.get_threshold()[0])]  # so that it is due here, too
    qtbot.waitUntil(lambda: len(ended_in) == 50, timeout=20_000)
    assert held
    assert set(ended_in) == {threading.main_thread()}
    assert queue.shut_down()


def test_python_collects_by_itself_again_afterwards(qapp) -> None:
    was = gc.isenabled()
    gc.enable()
    try:
        with collected_here():
            assert not gc.isenabled()
        assert gc.isenabled()
    finally:
        (gc.enable if was else gc.disable)()
