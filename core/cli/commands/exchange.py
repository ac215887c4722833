"""Calibrations to and from other programs, and the schema of the files that they may write."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from core import pipeline
from core.cli.arguments import Commands, Options, add_devices, tell_devices
from core.errors import InputError
from core.progress import Progress


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    known = "opencv, ros, kalibr, colmap, matlab, mrcal or agisoft"
    sub = commands.add_on_project("export", _export, "export the calibration to another program")
    sub.add_argument("--to", required=True, metavar="FORMAT", help=known)
    sub.add_argument("out", type=Path, metavar="FILE")
    sub.set_defaults(beside=True)  # some formats take several files
    add_devices(sub)
    words = "two cameras in the place of a camera and a projector, which only labels corresponding places"
    sub.add_argument("--cameras", nargs=2, default=(), metavar="NAME", help=words)

    sub = commands.add("import", _import, "import another program's calibration of the project's devices")
    sub.add_argument("file", type=Path, metavar="FILE")
    sub.add_argument("--from", required=True, metavar="FORMAT", dest="form", help=known)
    sub.add_argument("project", type=Path, metavar="PROJECT")
    add_devices(sub)
    words = "several cameras in the order of the file; without --projector it only labels corresponding places"
    sub.add_argument("--cameras", nargs="+", default=(), metavar="NAME", help=words)

    commands.add("schema", _schema, "print the JSON Schema of project.json, capture.json, picks.json and network.json")


def _named(options: Options, *others: str) -> dict[str, Any]:
    """Give the devices that were chosen; `others` are those that do not go with several cameras."""
    if options.cameras and any(getattr(options, kind) for kind in others):
        told = " and ".join(f"--{kind}" for kind in others)
        raise InputError("--cameras", f"does not go with {told}", "leave one of the two out")
    return {"camera": options.camera, "projector": options.projector, "cameras": options.cameras}


def _tell_devices(options: Options) -> None:
    """Say whose calibration it is where others could be meant."""
    rig = options.project.rig
    if not options.cameras:
        tell_devices(options, options.camera or rig.camera_name, options.projector or rig.projector_name)


def _export(options: Options, progress: Progress) -> dict[str, Any]:
    from core.cli.console import print_verdict
    from core.figures import verdict_figures
    from core.pipeline.calibrate import photogrammetric_calibration
    from core.pipeline.exchange import WORSE_PX, export_calibration

    files, residuals = export_calibration(
        options.project, options.to, options.out, **_named(options, "camera", "projector")
    )
    for file in files:
        print(file)
    for name, rms in residuals.items():
        worse = f", more than targets are measured to: {options.to} has no parameter for it" if rms > WORSE_PX else ""
        print(f"{name}: the fit leaves {rms:.4f} px r.m.s.{worse}")
    if "projector" in residuals:
        _tell_devices(options)
    verdict = verdict_figures(photogrammetric_calibration(options.project).verdict)
    print_verdict("photogrammetric", verdict)
    return {"files": [str(file) for file in files], "residual_rms_px": residuals, "verdict": verdict}


def _import(options: Options, progress: Progress) -> dict[str, Any]:
    from core.cli.console import print_verdict
    from core.pipeline.exchange import import_calibration
    from core.project import read_project

    options.project = project = read_project(options.project)
    calibration = import_calibration(project, options.form, options.file, **_named(options, "camera"))
    figures = pipeline.methods.calibration_figures({"photogrammetric": calibration})
    print_verdict("photogrammetric", figures["photogrammetric"]["verdict"])
    _tell_devices(options)
    print(f"kept as run {max(pipeline.runs.current_runs(project).values())}")
    return figures


def _schema(options: Options, progress: Progress) -> dict[str, Any]:
    import json

    from core.project.schema import files_schema

    print(text := files_schema(), end="")
    return dict(json.loads(text))
