"""All checks of a rig that two URLs name, over the working depth too."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from core.capture.fitness import visibility
from core.capture.preflight import measure_stripes, preflight
from core.capture.run import check_sizes
from core.devices import open_devices
from core.devices.opening import at_depth
from core.model import Array, Project
from core.model.finding import Finding
from core.progress import SILENT, Progress

Urls = tuple[str, str]  # of projector and camera


def stay(z_mm: float) -> None:
    """Leave the plate where it is."""


def check_rig(
    project: Project,
    urls: Urls,
    depths_mm: Sequence[float] = (),
    place: Callable[[float], None] = stay,
    progress: Progress = SILENT,
) -> tuple[Finding, ...]:
    """Run every check on the devices of a project.

    With depths, a plate is put there to see whether the stripes are clear over the working depth: `place` is asked to
    put it and returns when it is there. The virtual bench puts its own plate.
    """
    with open_devices(*urls, check=progress.check) as (projector, camera):
        check_sizes(project, projector, camera)
        findings = preflight(projector, camera, progress.part(0.0, 0.8 if depths_mm else 1.0))
    if not depths_mm:
        return findings
    stacks, noises = [], []
    for z_mm in progress.part(0.8, 1.0).over(depths_mm, "stripes at {:g} mm"):
        if at_depth(urls[0], z_mm) == urls[0]:
            place(z_mm)
        stack, noise = stripes_at(urls, z_mm, progress)
        stacks.append(stack)
        noises.append(noise)
    return (*findings, visibility(depths_mm, stacks, max(noises)))


def stripes_at(urls: Urls, z_mm: float, progress: Progress = SILENT) -> tuple[list[Array], float]:
    """Take the finest stripes on a plate at a position, as `measure_stripes`; the virtual bench puts its own there."""
    here = at_depth(urls[0], z_mm), at_depth(urls[1], z_mm)
    with open_devices(*here, check=progress.check) as (projector, camera):
        return measure_stripes(projector, camera, projector.settle_s, progress.quiet())
