"""Several cameras on one pattern: every camera takes what the projector shows, and every camera's frames are verified.

Each camera has a folder of its own within the capture's, with its transcript, so that an interrupted capture is gone on
with; the capture lists the frames of all once every one has been verified.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace

from core.capture.plan import check_shown, make_plan, sequence_for
from core.capture.run import CaptureReport, Loop, Said, check_sizes
from core.capture.store import TIFF, Listen, Store, is_complete, no_listener, open_store, reopen_store
from core.devices import open_camera, open_projector
from core.errors import InputError
from core.model import Project
from core.patterns import Pattern
from core.progress import SILENT, Progress
from core.project import add_capture
from core.project.captures import write_capture_json


def capture_together(
    project: Project,
    name: str,
    role: str,
    projector_url: str,
    camera_urls: Mapping[str, str],
    *,
    patterns: Sequence[Pattern] | None = None,
    z_mm: float | None = None,
    angle_deg: float | None = None,
    testfield: str | None = None,
    progress: Progress = SILENT,
    listen: Listen = no_listener,
    ending: str = TIFF,
) -> CaptureReport:
    """Record one sequence with several cameras at once; `camera_urls` by their names in the rig, else `run_capture`."""
    how = {"z_mm": z_mm, "angle_deg": angle_deg, "testfield": testfield}
    for camera in camera_urls:
        make_plan(project, name, role, patterns=patterns, camera=camera, **how)  # type: ignore[arg-type]
    folder = project.path / "captures" / name
    if is_complete(folder):
        raise InputError(folder, "this capture is complete", "choose another name, or remove its folder first")
    notes: list[Said] = []

    def note(who: str, what: str) -> None:
        notes.append((time.monotonic(), who, what))

    with ExitStack() as opened:
        projector = opened.enter_context(closing(open_projector(projector_url, note, progress.check)))
        chosen = patterns if patterns is not None else sequence_for(project, projector)
        loops: list[Loop] = []
        for camera, url in camera_urls.items():
            device = opened.enter_context(closing(open_camera(url, note)))
            check_sizes(project, projector, device, camera)
            plan = make_plan(project, name, role, patterns=chosen, camera=camera, **how)  # type: ignore[arg-type]
            plan = replace(plan, guards=tuple(g for g in plan.guards if projector.refusal(g) is None))
            check_shown(plan, projector.refusal, projector.name)
            own = folder / camera
            store = reopen_store(own, listen) if is_complete(own) else open_store(own, plan, listen, ending)
            store.plan = plan
            loops.append(Loop(store, projector, device, notes))
        loops[0].beside = loops[1:]
        report = loops[0].run(progress)
    _list([loop.store for loop in loops], report)
    add_capture(project.path, f"captures/{name}")
    return replace(report, folder=folder, frames=report.frames * len(loops))


def _list(stores: Sequence[Store], report: CaptureReport) -> None:
    """Write capture.json of the frames of all cameras."""
    frames, more = [], []
    for store in stores:
        for i in store.plan.own:
            frames.append((f"{store.folder.name}/{store.shots[i].file}", store.plan.shots[i]))
            more.append({"camera": store.folder.name, **store.plan.devices})
    plan = stores[0].plan
    write_capture_json(
        stores[0].folder.parent,
        plan.role,
        frames,
        testfield=plan.testfield,
        z_mm=plan.z_mm,
        angle_deg=plan.angle_deg,
        extra={"state": "complete", "findings": [finding.as_dict() for finding in report.findings]},
        more=more,
    )
