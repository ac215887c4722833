"""Sequences on devices, and the checks of a rig."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from core.cli.arguments import Commands, Options, add_subject, chosen_sequence, chosen_subject
from core.errors import InputError
from core.progress import Progress


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    sub = commands.add_on_folder("capture", _capture, "run one sequence on real or virtual devices")
    add_subject(sub)
    sub.add_argument("--projector", metavar="URL", help="virtual, serial, screen, ...")
    words = "virtual, folder, replay, uvc, ...; several take each pattern together: NAME=URL, given for each"
    sub.add_argument("--camera", metavar="URL", action="append", default=[], help=words)
    sub.add_argument("--png", action="store_true", help="store PNG: a third of the room, ten times the time")

    sub = commands.add(
        "probe", _probe, "try every command of a profile once, with all bytes; or find the latency of a projector"
    )
    sub.add_argument("profile", metavar="PROFILE|URL", help="a profile's name or .toml file; with --camera a projector")
    sub.add_argument("port", metavar="PORT", nargs="?", help="/dev/ttyUSB0, COM3, socket://host:port, /dev/hidraw0")
    sub.add_argument("--camera", metavar="URL", help="sees flashes of the projector URL: latency, jitter, linearity")

    sub = commands.add_on_folder("preflight", _preflight, "check a rig before its first calibration")
    sub.add_argument("--projector", metavar="URL")
    sub.add_argument("--camera", metavar="URL")
    sub.add_argument("--depth", type=float, action="append", default=[], metavar="Z_MM", help="put a plate here too")
    sub.add_argument("--out", type=Path, metavar="DIR", help="write preflight.html, with a picture of every check")


def _capture(options: Options, progress: Progress) -> dict[str, Any]:
    from core.pipeline import capture_into

    report = capture_into(
        options.project,
        chosen_subject(options),
        projector=options.projector,
        camera=_cameras(options.camera),
        sequence=chosen_sequence(options),
        progress=progress,
        png=options.png,
    )
    print(report.folder)
    for words in report.words:
        print(f"  {words}")
    return {
        "capture": str(report.folder),
        "frames": report.frames,
        "retakes": report.retakes,
        "repeats": report.repeats,
        "findings": report.words,
    }


def _cameras(given: list[str]) -> str | dict[str, str] | None:
    """One camera's URL, or those of several by their names in the rig."""
    split = [url.partition("=") for url in given]
    if all(sep and ":" not in name for name, sep, _ in split):
        return {name: url for name, _, url in split} or None
    if len(given) > 1:
        raise InputError("--camera", " ".join(given), "name each of several in the rig: --camera NAME=URL")
    return given[0]


def _probe(options: Options, progress: Progress) -> dict[str, Any]:
    from core.cli.arguments import UnfinishedError
    from core.pipeline import probe_device, probe_light

    if options.camera is not None:
        return _told(probe_light(options.profile, options.camera, progress))
    if options.port is None:
        raise InputError("probe", "no PORT", "name the device's port, or --camera URL to see a projector's light")
    tried = []
    for exchange in probe_device(options.profile, options.port, progress):
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
    from core.pipeline import preflight_rig

    def place(z_mm: float) -> None:
        print(f"put the plate at {z_mm:g} mm and press Enter", file=sys.stderr, flush=True)
        sys.stdin.readline()

    findings = preflight_rig(
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
