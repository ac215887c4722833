"""Calibrations to and from other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from core import pipeline
from core.cli.arguments import Commands, Options, add_devices, tell_devices
from core.progress import Progress


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    known = "opencv, ros, kalibr, colmap, matlab, mrcal or agisoft"
    sub = commands.add_on_project("export", _export, "export the calibration to another program")
    sub.add_argument("--to", required=True, metavar="FORMAT", help=known)
    sub.add_argument("out", type=Path, metavar="FILE")
    sub.set_defaults(beside=True)  # some formats take several files
    add_devices(sub)

    sub = commands.add("import", _import, "import another program's calibration of the project's devices")
    sub.add_argument("file", type=Path, metavar="FILE")
    sub.add_argument("--from", required=True, metavar="FORMAT", dest="form", help=known)
    sub.add_argument("project", type=Path, metavar="PROJECT")
    add_devices(sub)


def _export(options: Options, progress: Progress) -> dict[str, Any]:
    from core.pipeline.exchange import export_calibration

    project, names = options.project, (options.camera, options.projector)
    files, residuals = export_calibration(project, options.to, options.out, *names)
    for file in files:
        print(file)
    for name, rms in residuals.items():
        print(f"{name}: the fit leaves {rms:.4f} px r.m.s.")
    tell_devices(options, *(name or usual for name, usual in zip(names, project.rig.usual, strict=True)))
    return {"files": [str(file) for file in files], "residual_rms_px": residuals}


def _import(options: Options, progress: Progress) -> dict[str, Any]:
    from core.cli.console import print_verdict
    from core.pipeline.exchange import import_calibration
    from core.project import read_project

    project = read_project(options.project)
    calibration = import_calibration(project, options.form, options.file, options.camera, options.projector)
    figures = pipeline.calibration_figures({"photogrammetric": calibration})
    print_verdict("photogrammetric", figures["photogrammetric"]["verdict"])
    print(f"kept as run {max(pipeline.current_runs(project).values())}")
    return figures
