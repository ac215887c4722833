"""Before stage 1: is the rig fit to measure? Every check with a sentence and a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from core.pipeline.capture import devices_of
from core.progress import SILENT, Progress
from core.project import read_project

if TYPE_CHECKING:
    from core.capture import Finding

TITLES = {
    "exposure": "Exposure",
    "settle": "Settle time and latency",
    "linearity": "Linearity",
    "focus": "Focus",
    "order": "Pattern order",
    "orientation": "Line orientation",
    "visibility": "Stripes over the working depth",
}
PICTURES = {
    "exposure": "white, share of the range",
    "linearity": "half light, seen as",
    "focus": "modulation of the finest stripes",
    "order": "contradiction, white = 1",
    "orientation": "projector column",
}
AXES = {
    "settle": ("delay after the acknowledgement [ms]", "light, white = 1"),
    "linearity": ("light meant", "light seen"),
    "visibility": ("position of the plate [mm]", "modulation [grey values]"),
}


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
        write_preflight(findings, project.name, out)
    progress(1.0, "checked")
    return findings


def write_preflight(findings: Sequence[Finding], title: str, out: Path) -> Path:
    """Write findings with their pictures as ``preflight.html`` into a folder."""
    from core.report.checks import Check, write_checks

    checks = [
        Check(
            TITLES.get(f.check, f.check),
            f.level,
            f.text,
            f.picture,
            PICTURES.get(f.check, ""),
            f.curve,
            AXES.get(f.check, ("", "")),
        )
        for f in findings
    ]
    return write_checks(checks, title, out)
