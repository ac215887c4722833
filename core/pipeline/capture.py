"""Stage 1: captures come from the virtual bench, or from a projector and a camera; before them a rig is checked."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core.errors import InputError
from core.model import DeviceSpec, Finding, Project, Subject
from core.progress import SILENT, Progress
from core.project import read_project, refuse_used_folder, write_json
from core.project.made import FILE as MADE
from core.project.made import note_made, read_made, remove_made

if TYPE_CHECKING:
    from core.capture import CaptureReport
    from core.capture.store import Listen
    from core.patterns import SequenceSpec


def simulate_project(
    out: Path,
    scenario: str = "paper",
    seed: int = 0,
    progress: Progress = SILENT,
    *,
    sequence: SequenceSpec | None = None,
) -> Project:
    """Let the virtual bench record a project in a new folder, as a rig would, by its own sequence or another.

    In the folder of an earlier simulation, finished or not, what that wrote is replaced, as long as nobody has added or
    changed anything there.

    Raises
    ------
    InputError
        Naming what somebody added or changed; nothing has been touched then.
    """
    from core.bench import experiment, simulate

    out = Path(out)
    planned = [f"captures/{shot.name}" for shot in experiment(scenario, seed).shots]
    facts = {"scenario": scenario, "seed": seed, "sequence": str(sequence)}
    before = read_made(out)
    if "captures" in before:
        remove_made(out, _begun(out, before["captures"]))
    else:
        refuse_used_folder(out)
    new = not out.exists()
    try:
        write_json(out / MADE, {"format": "stripe-made", "version": 1, **facts, "captures": planned, "files": {}})
        project = read_project(simulate(out, scenario, seed, progress, sequence=sequence))
        note_made(out, {**facts, "captures": planned})
    except BaseException:
        with suppress(OSError):
            (out / MADE).unlink(missing_ok=True)
            if new:
                out.rmdir()
        raise
    return project


def _begun(out: Path, captures: Sequence[str]) -> set[str]:
    """Name what a simulation that was killed can have written: it lists its files when all are there."""
    if read_made(out)["files"]:
        return set()
    own = {"project.json", "testfield.csv", "plate.csv", "truth.json"}
    for folder in captures:
        own |= {f"{folder}/{name}" for name in ("capture.json", "picks.json")}
        own |= {f"{folder}/{path.name}" for path in (out / folder).glob("[0-9][0-9][0-9].*")}
    return own


def check_scenario(scenario: str, seed: int) -> None:
    """See that the virtual bench knows a scenario and can begin with a seed."""
    from core.bench import experiment

    experiment(scenario, seed)


def capture_into(
    folder: Path,
    subject: Subject,
    *,
    projector: str | None = None,
    camera: str | Mapping[str, str] | None = None,
    sequence: SequenceSpec | None = None,
    progress: Progress = SILENT,
    listen: Listen | None = None,
    png: bool = False,
) -> CaptureReport:
    """Record one capture with a projector and a camera and add it to a project.

    Without a URL of either, the virtual bench's rig of the project's sizes is taken. Several cameras, by their names in
    the rig, take every pattern together; without any URL all of the project's. Without a `sequence` the project's, the
    projector's own, or the one that suits what it can show. `listen` receives every entry of the transcript from the
    thread that writes it. Frames are stored as plain TIFF, or as `png`.
    """
    from core.capture import run_capture
    from core.capture.store import PNG, TIFF, no_listener

    project = read_project(folder)
    shown_by = project.rig.projectors.get(subject.projector, project.projector)
    lines = shown_by.width, shown_by.height
    how: dict[str, Any] = {
        "patterns": None if sequence is None else sequence.patterns(lines),
        "progress": progress,
        "listen": listen or no_listener,
        "ending": PNG if png else TIFF,
    }
    if camera is None and not project.rig.is_pair:
        camera = virtual_cameras(project)
    if camera is None or isinstance(camera, str):
        projector, camera = devices_of(project, projector, camera)
    return run_capture(project, subject, projector or virtual_rig(project), camera, **how)


def devices_of(project: Project, projector: str | None, camera: str | None) -> tuple[str, str]:
    """Give the URLs of projector and camera; for one that is not named, of the virtual bench's rig."""
    if projector is not None and camera is not None:
        return projector, camera
    virtual = virtual_rig(project)
    return projector or virtual, camera or virtual


def virtual_cameras(project: Project) -> dict[str, str]:
    """Give the URLs of all cameras of the virtual bench's rig that has the project's sizes."""
    virtual = virtual_rig(project)
    if len(project.rig.cameras) == 1:
        return dict.fromkeys(project.rig.cameras, virtual)
    return {name: f"{virtual}?camera={name}" for name in project.rig.cameras}


def virtual_rig(project: Project) -> str:
    """Give the URL of the virtual bench's rig that has the project's sizes."""
    from core.bench import experiment, scenarios

    def sizes(*devices: DeviceSpec) -> list[tuple[int, int]]:
        return [(device.width, device.height) for device in devices]

    wanted = sizes(*project.rig.cameras.values(), project.projector)
    for name in scenarios():
        made = experiment(name)
        if sizes(*(view.rig.camera for view in made.views.values()), made.rig.projector) == wanted:
            return f"virtual:{name}"
    raise InputError(
        project.path,
        "no virtual rig has this camera and projector",
        "name the devices with --projector URL and --camera URL",
    )


def preflight_rig(
    folder: Path,
    *,
    projector: str | None = None,
    camera: str | None = None,
    depths_mm: Sequence[float] = (),
    place: Callable[[float], None] | None = None,
    out: Path | None = None,
    progress: Progress = SILENT,
) -> tuple[Finding, ...]:
    """Check a project's rig before it is calibrated; with `out` write ``preflight.html`` there.

    Parameters
    ----------
    projector, camera : str, optional
        URLs; without them the virtual bench's rig of the project's sizes.
    depths_mm : sequence of float
        Where the plate is put to see whether the stripes are clear over the working depth; none: not looked at.
    place : callable
        Is asked to put the plate at a position, and returns when it is there. The virtual bench puts its own plate.
    """
    from core.capture.rigcheck import check_rig, stay

    project = read_project(folder)
    if unknown := [z for z in depths_mm if not isfinite(z)]:
        raise InputError("--depth", f"is {unknown[0]}", "give the plate's position in mm")
    urls = devices_of(project, projector, camera)
    findings = check_rig(project, urls, depths_mm, place or stay, progress.part(0.0, 0.95))
    if out is not None:
        from core.report.html import write_checks

        write_checks(findings, project.name, out)
    progress(1.0, "checked")
    return findings
