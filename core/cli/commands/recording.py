"""Sequences on devices or as images, frames from elsewhere, and the checks of a rig."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from core import pipeline
from core.cli.arguments import (
    Commands,
    Options,
    add_subject,
    add_urls,
    camera_urls,
    chosen_sequence,
    chosen_subject,
    named_url,
    sequence_argument,
)
from core.errors import InputError
from core.progress import Progress


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    sub = commands.add_on_folder("capture", _capture, "run one sequence on real or virtual devices")
    add_subject(sub)
    add_urls(sub)
    sub.add_argument("--png", action="store_true", help="store PNG: a third of the space, ten times the time")

    sub = commands.add(
        "probe", _probe, "send every command of a profile once and show all bytes, or measure a projector's latency"
    )
    sub.add_argument(
        "profile", metavar="PROFILE|URL", help="name or .toml file of a profile; with --camera a projector"
    )
    sub.add_argument("port", metavar="PORT", nargs="?", help="/dev/ttyUSB0, COM3, socket://host:port, /dev/hidraw0")
    sub.add_argument(
        "--camera", metavar="URL", help="camera that sees the projector: measures latency, jitter, linearity"
    )

    sub = commands.add_on_folder("preflight", _preflight, "check a rig before its first calibration")
    sub.add_argument("--projector", metavar="URL")
    sub.add_argument("--camera", metavar="URL")
    sub.add_argument("--depth", type=float, action="append", default=[], metavar="Z_MM", help="also put a plate here")
    sub.add_argument("--out", type=Path, metavar="DIR", help="write preflight.html with a picture for every check")

    sub = commands.add_on_folder("patterns", _patterns, "write the sequence as images of the projector's size")
    sub.add_argument("--out", type=Path, required=True, metavar="DIR")
    sub.add_argument("--linearise", action="store_true", help="compensate the projector's response in project.json")
    sub.add_argument("--projector", default="", metavar="NAME", help="which projector, if the rig has several")
    sequence_argument(sub)

    sub = commands.add("import-frames", _import, "make a capture from frames recorded elsewhere")
    sub.add_argument("folder", type=Path, metavar="FOLDER")
    sub.add_argument("project", type=Path, metavar="PROJECT")
    add_subject(sub)
    orders = "order of the frames: by file name, by a list that names them, or found from the images"
    sub.add_argument("--order", choices=("name", "list", "content"), help=orders)
    sub.add_argument("--camera", default="", metavar="NAME", help="which camera took the frames, in a rig of several")
    sub.add_argument(
        "--projector", default="", metavar="NAME", help="which projector showed the patterns, in a rig of several"
    )

    sub = commands.add_on_folder("plan-sequence", _plan, "compare sequences by noise, gross errors and time")
    sub.add_argument("--frames", type=int, metavar="N", help="largest number of frames (default 28)")
    sub.add_argument("--sigma", type=float, metavar="LINES", help="required standard deviation")
    sub.add_argument("--preflight", type=Path, metavar="FILE", help="file that preflight --json wrote")


def _capture(options: Options, progress: Progress) -> dict[str, Any]:
    name, url = named_url(options.projector or "")
    report = pipeline.capture_into(
        options.project,
        chosen_subject(options, projector=name),
        projector=url or None,
        camera=camera_urls(options.camera),
        sequence=chosen_sequence(options),
        progress=progress,
        png=options.png,
    )
    figures = {**_shown(report), "retakes": report.retakes, "repeats": report.repeats}
    if not url and not options.camera:
        print("  on the virtual bench: neither --projector nor --camera was given")
    return figures


def _shown(report: Any) -> dict[str, Any]:
    """Show a capture that was made, and give its figures."""
    print(report.folder)
    for words in report.words:
        print(f"  {words}")
    return {"capture": str(report.folder), "frames": report.frames, "findings": list(report.words)}


def _probe(options: Options, progress: Progress) -> dict[str, Any]:
    from core.cli.arguments import UnfinishedError

    if options.camera is not None:
        return _told(pipeline.probe_light(options.profile, options.camera, progress))
    if options.port is None:
        raise InputError("probe", "no PORT", "name the device's port, or --camera URL to see a projector's light")
    tried = []
    for exchange in pipeline.probe_device(options.profile, options.port, progress):
        tried.append(exchange)
        print(f"{exchange.command}  {1000 * exchange.seconds:.0f} ms")
        for sign, data in ((">", exchange.sent), ("<", exchange.heard)):
            text = "".join(chr(b) if 32 <= b < 127 else "." for b in data)
            print(f"  {sign} {data.hex(' ')}   {text}" if data else f"  {sign} nothing")
        print(f"  {'ok' if exchange.understood else 'NOT UNDERSTOOD'}: {exchange.words}", flush=True)
    figures = {"exchanges": [exchange.as_dict() for exchange in tried]}
    if wrong := [exchange.command for exchange in tried if not exchange.understood]:
        seen = f"{len(wrong)} of {len(tried)} commands were not understood ({', '.join(wrong)})"
        remedy = "set the bytes beside the device's manual, and correct the profile"
        raise UnfinishedError(figures, options.port, seen, remedy)
    return figures


def _preflight(options: Options, progress: Progress) -> dict[str, Any]:
    def place(z_mm: float) -> None:
        print(f"put the plate at {z_mm:g} mm and press Enter", file=sys.stderr, flush=True)
        sys.stdin.readline()

    findings = pipeline.capture.preflight_rig(
        options.project,
        projector=options.projector,
        camera=options.camera,
        depths_mm=options.depth,
        place=place,
        out=options.out,
        progress=progress,
    )
    figures = _told(findings)
    if options.out is not None:
        print(options.out / "preflight.html")
    return figures


def _told(findings: Sequence[Any]) -> dict[str, Any]:
    for finding in findings:
        print(f"{finding.level:8s} {finding.check}: {finding.text}")
    return {"findings": [finding.as_dict() for finding in findings]}


def _patterns(options: Options, progress: Progress) -> dict[str, Any]:
    from core.pipeline.sequences import write_patterns

    how = {"linearise": options.linearise, "projector": options.projector}
    written = write_patterns(options.project, options.out, chosen_sequence(options), **how, progress=progress)
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
    return {**_shown(report), "order": report.order, "files": list(report.files)}


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
        sigma = "-" if p.sigma_lines is None else f"{p.sigma_lines:.4f}"
        found = f"{p.frames:6d}  {sigma:>13s}  {p.gross:7.3%}  {p.valid:6.1%}  {p.seconds:5.1f} s"
        print(f"{p.words:44s} {found}  {shows}")
    return plan_figures(light, planned)
