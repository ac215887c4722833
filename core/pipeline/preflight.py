"""Before stage 1: is the rig fit to measure? Every check with a sentence and a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from core.model import Finding
from core.pipeline.capture import devices_of
from core.progress import SILENT, Progress
from core.project import read_project


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
    """Check a project's rig before it is calibrated.

    Parameters
    ----------
    folder : Path
        The project.
    projector, camera : str, optional
        URLs; without them the virtual bench's rig of the project's sizes.
    depths_mm : sequence of float
        Where the plate is put to see whether the stripes are clear over the working depth; none: not looked at.
    place : callable
        Is asked to put the plate at a position, and returns when it is there. The virtual bench puts its own plate.
    out : Path, optional
        Folder for ``preflight.html``.
    """
    from core.capture.rigcheck import check_rig, stay

    project = read_project(folder)
    urls = devices_of(project, projector, camera)
    findings = check_rig(project, urls, depths_mm, place or stay, progress.part(0.0, 0.95))
    if out is not None:
        from core.report.checks import write_checks

        write_checks(findings, project.name, out)
    progress(1.0, "checked")
    return findings
