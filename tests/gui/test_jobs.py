"""Long work: order, progress, results, failures with their traceback, and cancel within half a second."""

from __future__ import annotations

import threading
import time

import pytest

from core.errors import InputError
from core.progress import Progress
from stripe_gui.jobs import JobQueue, JobState


@pytest.fixture
def queue(qapp):
    made = JobQueue()
    yield made
    assert made.shut_down()


def count(to: int, progress: Progress) -> int:
    for i in range(to):
        progress(i / to, f"step {i}")
        time.sleep(0.002)
    return to


def test_a_job_reports_progress_and_gives_its_result_in_the_windows_thread(queue, qtbot) -> None:
    seen, results = [], []
    job = queue.run("count", count, 60, on_done=lambda r: results.append((r, threading.current_thread())))
    job.progressed.connect(lambda fraction, message: seen.append((fraction, message)))
    with qtbot.waitSignal(job.ended, timeout=3000):
        pass
    assert results == [(60, threading.main_thread())]
    assert job.state is JobState.DONE
    assert seen
    assert [f for f, _ in seen] == sorted(f for f, _ in seen)


def test_a_failure_carries_the_error_and_the_whole_traceback(queue, qtbot) -> None:
    def work(progress: Progress) -> None:
        raise InputError("project.json", "width is -3", "give a width of at least 1")

    failures = []
    job = queue.run("fail", work, on_failed=failures.append)
    with qtbot.waitSignal(job.ended, timeout=3000):
        pass
    assert job.state is JobState.FAILED
    assert failures[0].error.seen == "width is -3"
    assert "in work" in failures[0].trace


def test_cancel_ends_a_job_within_half_a_second(queue, qtbot) -> None:
    job = queue.run("count", count, 100_000)
    qtbot.waitUntil(lambda: job.state is JobState.RUNNING and job.fraction > 0)
    start = time.monotonic()
    with qtbot.waitSignal(job.cancelled, timeout=3000):
        job.cancel()
    assert time.monotonic() - start < 0.5
    assert job.result is None


def test_jobs_run_one_after_the_other(queue, qtbot) -> None:
    at_work, most = [], []

    def work(name: str, progress: Progress) -> None:
        at_work.append(name)
        most.append(len(at_work))
        time.sleep(0.03)
        at_work.remove(name)

    jobs = [queue.run(name, work, name) for name in "abc"]
    with qtbot.waitSignal(jobs[-1].ended, timeout=3000):
        pass
    assert most == [1, 1, 1]


def test_cancel_all_forgets_the_jobs_that_wait(queue, qtbot) -> None:
    jobs = [queue.run("count", count, 100_000) for _ in range(3)]
    qtbot.waitUntil(lambda: jobs[0].state is JobState.RUNNING)
    queue.cancel_all()
    qtbot.waitUntil(lambda: not queue.busy, timeout=3000)
    assert [job.state for job in jobs] == [JobState.CANCELLED] * 3


def test_of_previews_only_the_latest_is_finished(qapp, qtbot) -> None:
    queue = JobQueue(latest_only=True)
    done = []
    first = queue.run("a", count, 100_000, on_done=done.append)
    qtbot.waitUntil(lambda: first.state is JobState.RUNNING)
    for to in (1, 2, 3):
        queue.run("b", count, to, on_done=done.append)
    qtbot.waitUntil(lambda: not queue.busy, timeout=3000)
    assert done == [3]


def test_a_preview_that_waits_stops_none_and_is_stopped_by_none(qapp, qtbot) -> None:
    queue = JobQueue(latest_only=True)
    done = []
    queue.run("a", count, 1, on_done=done.append)
    queue.run("b", count, 2, waits=True, on_done=done.append)
    queue.run("c", count, 3, on_done=done.append)
    queue.run("d", count, 4, on_done=done.append)
    qtbot.waitUntil(lambda: not queue.busy, timeout=3000)
    assert done == [2, 4]


@pytest.mark.parametrize(("preview", "state", "shown"), [(True, JobState.CANCELLED, []), (False, JobState.DONE, [1])])
def test_what_was_stopped_and_came_through_is_done_and_no_longer_shown_of_a_preview(
    qapp, qtbot, preview: bool, state: JobState, shown: list[int]
) -> None:
    queue = JobQueue(latest_only=preview)
    gate, done = threading.Event(), []

    def deaf(progress: Progress) -> int:
        gate.wait(5)
        return 1

    job = queue.run("a", deaf, on_done=done.append)
    qtbot.waitUntil(lambda: job.state is JobState.RUNNING)
    queue.cancel_all()
    gate.set()
    qtbot.waitUntil(lambda: not queue.busy, timeout=3000)
    assert (job.state, done) == (state, shown)


def test_the_remaining_time_follows_from_the_pace(queue, qtbot) -> None:
    job = queue.run("count", count, 100_000)
    qtbot.waitUntil(lambda: job.state is JobState.RUNNING)
    assert job.seconds_left() is None
    job.started, job.fraction = time.monotonic() - 10, 0.25
    assert job.seconds_left() == pytest.approx(30, rel=0.05)
    job.cancel()
