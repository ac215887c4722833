"""One frame of a complete capture taken again, or the capture left as it was."""

from __future__ import annotations

import time
from collections.abc import Sequence

from core.capture.plan import check_shown
from core.capture.run import ROUNDS, CaptureReport, Loop, Said, check_sizes, judge, verify
from core.capture.store import LOCK, Listen, no_listener, reopen_store
from core.devices import open_devices
from core.errors import DeviceError, InputError
from core.model import Project
from core.progress import SILENT, Progress
from core.project.lock import lock


def retake_frame(
    project: Project,
    name: str,
    frame: int,
    projector_url: str,
    camera_url: str,
    *,
    progress: Progress = SILENT,
    listen: Listen = no_listener,
) -> CaptureReport:
    """Take one frame of a complete capture, numbered from 0, again, with the guards after it; verify the whole anew.

    The capture stays as it is until the new frame has been verified together with all others: what interrupts this
    costs no more than the new frame. URLs and `listen` are as `run_capture` takes them.

    Raises
    ------
    InputError
        If there is no such capture or frame.
    DeviceError
        If a device fails, the new frame does not show its pattern, or something has moved since.
    """
    folder = project.path / "captures" / name
    store = reopen_store(folder, listen)
    plan = store.plan
    if not 0 <= frame < len(plan.patterns):
        raise InputError(folder, f"no frame {frame}", f"choose 0 to {len(plan.patterns) - 1}")
    notes: list[Said] = []

    def note(who: str, what: str) -> None:
        notes.append((time.monotonic(), who, what))

    devices = open_devices(projector_url, camera_url, note, progress.check)
    with devices as (projector, camera), lock(folder / LOCK, "retake"):
        check_sizes(project, projector, camera)
        check_shown(plan, projector.refusal, projector.name)
        store.note("retake", True, planned=plan.own[frame])
        return _again(Loop(store, projector, camera, notes), plan.own[frame], progress)


def _again(loop: Loop, shot: int, progress: Progress) -> CaptureReport:
    store, start = loop.store, time.monotonic()
    kept, first = dict(store.shots), store.taken
    due: Sequence[int] = [shot, *range(loop.plan.own.stop, len(loop.plan.shots))]
    try:
        for attempt in range(ROUNDS + 1):
            loop.take(due, progress.part(0.0, 0.8))
            findings = verify(store, loop.projector.size, progress.part(0.8, 1.0))
            due, moved = judge(findings)
            if not due and moved is None:
                return loop.finish(findings, start, attempt + 1, len(kept))
            if moved is not None or not set(due) <= {shot, *range(loop.plan.own.stop, len(loop.plan.shots))}:
                break
            loop.doubt()
        reasons = "; ".join(f.text for f in findings if f.level == "bad" or f is moved)
        raise DeviceError(
            store.folder,
            f"the new frame does not fit the others ({reasons}); the capture is as it was",
            "look whether the scene stands as it did then, or take a new capture",
        )
    except BaseException:
        store.shots = kept
        for number in range(first, store.taken):
            for path in store.folder.glob(f"shot-{number:04d}.*"):
                path.unlink()
        raise
