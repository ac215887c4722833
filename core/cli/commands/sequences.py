"""Sequences: as images to be shown, and frames that came from elsewhere."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from core.cli.arguments import Commands, Options, add_subject, chosen_sequence, chosen_subject, sequence_argument
from core.progress import Progress


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    sub = commands.add_on_folder("patterns", _patterns, "the sequence as images of the projector's size")
    sub.add_argument("--out", type=Path, required=True, metavar="DIR")
    sub.add_argument("--linearise", action="store_true", help="undo the projector's response that project.json gives")
    sequence_argument(sub)

    sub = commands.add("import-frames", _import, "a capture from frames that came from elsewhere")
    sub.add_argument("folder", type=Path, metavar="FOLDER")
    sub.add_argument("project", type=Path, metavar="PROJECT")
    add_subject(sub)
    orders = "by the files' names, by the list that names them, or found from the images"
    sub.add_argument("--order", choices=("name", "list", "content"), help=orders)
    sub.add_argument("--camera", default="", metavar="NAME", help="whose frames they are, in a rig of several")
    sub.add_argument("--projector", default="", metavar="NAME", help="what was shown by which, in a rig of several")

    sub = commands.add_on_folder("plan-sequence", _plan, "sequences compared: noise, gross errors and time")
    sub.add_argument("--frames", type=int, metavar="N", help="how many there may be (28 if unsaid)")
    sub.add_argument("--sigma", type=float, metavar="LINES", help="the standard deviation wanted")
    sub.add_argument("--preflight", type=Path, metavar="FILE", help="what preflight --json wrote")


def _patterns(options: Options, progress: Progress) -> dict[str, Any]:
    from core.pipeline.sequences import write_patterns

    written = write_patterns(
        options.project, options.out, chosen_sequence(options), linearise=options.linearise, progress=progress
    )
    print(f"{written.folder}: {len(written.patterns)} images, {written.sequence}")
    return {
        "out": str(written.folder),
        "frames": len(written.patterns),
        "sequence": written.sequence,
        "linearised": written.linearised,
    }


def _import(options: Options, progress: Progress) -> dict[str, Any]:
    from core.pipeline.sequences import import_into

    report = import_into(
        options.project,
        options.folder,
        chosen_subject(options, options.camera, options.projector),
        sequence=chosen_sequence(options),
        order=options.order,
        progress=progress,
    )
    print(report.folder)
    for words in report.words:
        print(f"  {words}")
    return {
        "capture": str(report.folder),
        "frames": report.frames,
        "order": report.order,
        "files": list(report.files),
        "findings": list(report.words),
    }


def _plan(options: Options, progress: Progress) -> dict[str, Any]:
    from core.pipeline.planning import plan_figures, plan_sequence

    light, planned = plan_sequence(
        options.project, options.frames, options.sigma, preflight=options.preflight, progress=progress
    )
    for words in light.known_from:
        print(words)
    print(f"\n{'sequence':44s} frames  sigma [lines]  wrong    valid    time    shows")
    for p in planned:
        shows = "grey" if p.needs_grey else "black and white"
        found = f"{p.frames:6d}  {p.sigma_lines:13.4f}  {p.gross:7.3%}  {p.valid:6.1%}  {p.seconds:5.1f} s"
        print(f"{p.words:44s} {found}  {shows}")
    return plan_figures(light, planned)
