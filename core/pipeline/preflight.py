"""Before stage 1: is the rig fit to measure? Every check with a sentence and a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

from core.pipeline.capture import virtual_rig
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


def _stay(z_mm: float) -> None:
    """Leave the plate where it is."""


def preflight_rig(
    folder: Path,
    *,
    projector: str | None = None,
    camera: str | None = None,
    depths_mm: Sequence[float] = (),
    place: Callable[[float], None] = _stay,
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

    Raises
    ------
    InputError, DeviceError
    """
    from core.capture import preflight
    from core.capture.run import check_sizes
    from core.devices import open_camera, open_projector

    project = read_project(folder)
    if projector is None or camera is None:
        virtual = virtual_rig(project)
        projector, camera = projector or virtual, camera or virtual
    with closing(open_projector(projector)) as shows, closing(open_camera(camera)) as sees:
        check_sizes(project, shows, sees)
        findings = preflight(shows, sees, progress.part(0.0, 0.8 if depths_mm else 0.95))
    if depths_mm:
        wait_s = findings[1].figures["settle_ms"] / 1000
        depth = _over_depth(projector, camera, depths_mm, place, wait_s, progress.part(0.8, 0.95))
        findings = (*findings, depth)
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


def at_depth(url: str, z_mm: float) -> str:
    """Give the URL of a virtual rig with the plate at a position, where its experiment has one; else the URL itself."""
    from core.devices import parse_address, with_option

    address = parse_address(url)
    if address.kind not in ("virtual", "emulated") or address.place == "flat":
        return url
    from core.bench import experiment

    names = [shot.name for shot in experiment(address.place).shots if shot.z_mm == z_mm]
    return with_option(url, "shot", names[0]) if names else url


def _over_depth(
    projector: str,
    camera: str,
    depths_mm: Sequence[float],
    place: Callable[[float], None],
    wait_s: float,
    progress: Progress,
) -> Finding:
    from core.capture.preflight import measure_stripes, visibility
    from core.devices import open_camera, open_projector

    stacks, noises = [], []
    for z_mm in progress.over(depths_mm, "stripes at {} mm"):
        urls = at_depth(projector, z_mm), at_depth(camera, z_mm)
        if urls == (projector, camera):
            place(z_mm)
        with closing(open_projector(urls[0])) as shows, closing(open_camera(urls[1])) as sees:
            stack, noise = measure_stripes(shows, sees, max(wait_s, shows.settle_s))
        stacks.append(stack)
        noises.append(noise)
    return visibility(depths_mm, stacks, max(noises))
