"""Watching the rig between calibrations."""

from __future__ import annotations

from typing import Any

from core.cli.arguments import Commands, Options, add_devices
from core.progress import Progress


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    sub = commands.add_on_project("orient", _orient, "has the rig moved since its calibration, by any one capture")
    sub.add_argument("capture", metavar="CAPTURE")
    sub.add_argument("--correct", action="store_true", help="keep the corrected orientation for `reconstruct --orient`")
    sub.add_argument(
        "--significance", type=float, default=1e-3, metavar="P", help="share of false alarms (default 0.001)"
    )
    add_devices(sub)


def _orient(options: Options, progress: Progress) -> dict[str, Any]:
    from core.pipeline import motion_words, motions_figures, orient_pairs
    from core.project import read_project

    project = read_project(options.project)
    motions = orient_pairs(
        project,
        options.capture,
        camera=options.camera,
        projector=options.projector,
        correct=options.correct,
        significance=options.significance,
        progress=progress,
    )
    for motion in motions:
        for line in motion_words(motion):
            print(line)
    if options.correct:
        print(f"kept: `stripe-core reconstruct {project.path} {motions[0].capture} --orient` uses it")
    return motions_figures(motions)
