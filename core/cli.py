"""The command line: parse, call the pipeline, print. Nothing heavy is imported before a command needs it."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NoReturn

from core.errors import Cancelled, InputError, StripeError
from core.progress import Progress

Run = Callable[[argparse.Namespace, Progress], dict[str, Any] | None]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; give the exit code: 0 done, 2 bad input, 1 the work failed."""
    started = time.monotonic()
    console = _Console(started)
    try:
        options = _parser().parse_args(arguments)
        if options.json not in (None, "-"):
            _check_json(options.json)
        figures = options.run(options, Progress(console.report))
        console.clear()
        if options.json is not None:
            _write_figures(options.json, figures or {})
        return 0
    except StripeError as error:
        console.clear()
        print(f"stripe-core: {error}", file=sys.stderr)
        return error.exit_code
    except OSError as error:
        console.clear()
        where, seen = error.filename or "the work", error.strerror or str(error)
        print(f"stripe-core: {StripeError(where, seen, 'see to the disk and run it again')}", file=sys.stderr)
        return 1
    except MemoryError:
        console.clear()
        print(f"stripe-core: {StripeError('the work', 'out of memory', 'free some and run it again')}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        console.clear()
        print(f"stripe-core: {Cancelled('the command')}", file=sys.stderr)
        return 130


class _Console:
    """Progress on stderr: one line rewritten on a terminal; elsewhere a line now and then.

    Where a program reads stderr, a refusal has to be the only line there: progress waits half a minute.
    """

    def __init__(self, started: float) -> None:
        self.terminal = sys.stderr.isatty()
        self.due = started + (0.2 if self.terminal else 30.0)

    def report(self, fraction: float, message: str) -> None:
        now = time.monotonic()
        if now >= self.due:
            self.due = now + (0.1 if self.terminal else 10.0)
            start, end = ("\r\033[K", "") if self.terminal else ("", "\n")
            print(f"{start}{fraction:4.0%}  {message}", end=end, file=sys.stderr, flush=True)

    def clear(self) -> None:
        if self.terminal:
            print("\r\033[K", end="", file=sys.stderr, flush=True)


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise InputError("arguments", message, f"see `{self.prog} --help`")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="stripe-core", description="Decode, calibrate, reconstruct and evaluate stripe projectors.")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=_Parser)

    def command(name: str, run: Run, text: str) -> argparse.ArgumentParser:
        sub = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        sub.set_defaults(run=run)
        sub.add_argument("--json", metavar="FILE", help="write the figures (- for standard output)")
        return sub

    sub = command("demo", _demo, "simulate the whole experiment, calibrate both ways, evaluate the plane-table, report")
    sub.add_argument("out", nargs="?", type=Path, default=Path("demo"), metavar="OUT")
    _scenario(sub)

    sub = command("simulate", _simulate, "write a project with its captures, as a rig would")
    sub.add_argument("out", type=Path, metavar="OUT")
    _scenario(sub)

    sub = command("testfield", _testfield, "a testfield to print at true size")
    sub.add_argument("testfield", type=Path, metavar="PROJECT|TESTFIELD.csv")
    sub.add_argument("--out", type=Path, required=True, metavar="FILE.pdf|FILE.svg")

    sub = command("capture", _capture, "run one sequence on real or virtual devices")
    _project(sub)
    sub.add_argument("name", metavar="NAME")
    sub.add_argument("--role", required=True, choices=("testfield", "depth", "plane", "object"))
    sub.add_argument("--projector", metavar="URL", help="virtual, serial, screen, ...")
    sub.add_argument("--camera", metavar="URL", help="virtual, folder, replay, uvc, ...")
    sub.add_argument("--testfield", metavar="CSV", help="the board, for roles testfield and depth")
    sub.add_argument("--z-mm", type=float, help="position of the plate, for role depth")
    sub.add_argument("--angle-deg", type=float, help="angle of the plane-table, for role plane")

    sub = command("preflight", _preflight, "check a rig before its first calibration")
    _project(sub)
    sub.add_argument("--projector", metavar="URL")
    sub.add_argument("--camera", metavar="URL")
    sub.add_argument("--depth", type=float, action="append", default=[], metavar="Z_MM", help="put a plate here too")
    sub.add_argument("--out", type=Path, metavar="DIR", help="write preflight.html, with a picture of every check")

    sub = command("decode", _decode, "projector coordinates of every camera pixel")
    sub.add_argument("capture", type=Path, metavar="CAPTURE")
    sub.add_argument("--out", type=Path, required=True, metavar="F.npz")

    _project(command("measure", _measure, "targets of all captures that have picks"))

    sub = command("calibrate", _calibrate, "calibrate camera and projector; the result stays in the project")
    _project(sub)
    sub.add_argument("--method", choices=("photogrammetric", "polynomial", "all"), default="all")
    sub.add_argument("--free-stations", action="store_true", help="no rigid rig: orient every station on its own")
    sub.add_argument("--degree", type=int, default=3, help="degree of the depth polynomial (default 3)")
    sub.add_argument("--table", action="store_true", help="piecewise-linear depth table instead of the polynomial")
    sub.add_argument("--low-pass", type=float, default=2.0, metavar="PX", help="smooth the plate (default 2; 0: off)")
    sub.add_argument("--without", action="append", default=[], metavar="NAME", help="leave this capture out")
    sub.add_argument("--hold", action="append", default=[], metavar="P", help="do not estimate, such as projector.A3")
    sub.add_argument(
        "--reject", type=float, default=6.0, metavar="SIGMAS", help="gross errors (default 6; 0: keep all)"
    )

    sub = command("adjust", _adjust, "the bundle adjustment of a network alone")
    sub.add_argument("network", type=Path, metavar="NETWORK")

    sub = command("reconstruct", _reconstruct, "points in the camera's frame")
    _project(sub)
    sub.add_argument("capture", metavar="CAPTURE")
    sub.add_argument("--method", choices=("photogrammetric", "polynomial"))
    sub.add_argument("--extrapolate", action="store_true", help="polynomial: beyond the calibrated depths too")
    sub.add_argument("--out", type=Path, required=True, metavar="F.npz|F.ply")

    _project(command("evaluate", _evaluate, "deviations of every plane capture, by every calibration"))

    sub = command("report", _report, "the HTML and PDF report")
    _project(sub)
    sub.add_argument("--out", type=Path, metavar="DIR")

    sub = command("batch", _batch, "decode, reconstruct and evaluate many captures on worker processes")
    _project(sub)
    sub.add_argument("captures", nargs="*", metavar="CAPTURE", help="names or folders; all of the project if unsaid")
    sub.add_argument("--out", type=Path, required=True, metavar="DIR", help="a second run leaves what is up to date")
    sub.add_argument("--do", default="decode,reconstruct,evaluate", metavar="STEPS", help="of these (default: all)")
    sub.add_argument("--scheduler", metavar="ADDRESS", help="a Dask scheduler that is running; default: this machine")
    sub.add_argument("--workers", type=int, metavar="N", help="worker processes to start (default: one per processor)")
    return parser


def _project(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("project", type=Path, metavar="PROJECT")


def _scenario(sub: argparse.ArgumentParser) -> None:
    sub.add_argument("--scenario", default="paper", metavar="NAME", help="paper (default), modern or quick")
    sub.add_argument("--seed", type=int, default=0)


# ----------------------------------------------------------------------------------------------------------- commands


def _demo(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from core.demo import run_demo

    demo = run_demo(options.out, options.scenario, options.seed, progress)
    print(demo.text)
    print(f"\nproject  {options.out}\nreport   {demo.report.html}\n         {demo.report.pdf}")
    return demo.figures


def _simulate(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from core.pipeline import simulate_project

    project = simulate_project(options.out, options.scenario, options.seed, progress)
    print(f"{project.path}: {len(project.captures)} captures")
    return {"project": str(project.path), "captures": len(project.captures), "seed": options.seed}


def _testfield(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from core.pipeline import print_testfield

    sheet = print_testfield(options.testfield, options.out, progress)
    across, down = sheet.bars_mm
    print(f"{options.out}: page of {sheet.width_mm:.1f} x {sheet.height_mm:.1f} mm")
    print(f"print at 100 %; its bars must then measure {across:g} mm across and {down:g} mm down")
    return {
        "out": str(options.out),
        "targets": len(sheet.targets_mm),
        "page_mm": [sheet.width_mm, sheet.height_mm],
        "bars_mm": [across, down],
    }


def _capture(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from core.pipeline import capture_into

    report = capture_into(
        options.project,
        options.name,
        options.role,
        projector=options.projector,
        camera=options.camera,
        testfield=options.testfield,
        z_mm=options.z_mm,
        angle_deg=options.angle_deg,
        progress=progress,
    )
    print(report.folder)
    for words in report.words:
        print(f"  {words}")
    return {"capture": str(report.folder), "frames": report.frames, "retakes": report.retakes, "findings": report.words}


def _preflight(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
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
    for finding in findings:
        print(f"{finding.level:8s} {finding.check}: {finding.text}")
    if options.out is not None:
        print(options.out / "preflight.html")
    return {"findings": [finding.as_dict() for finding in findings]}


def _decode(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from core.figures import phase_figures
    from core.pipeline import decode_capture, write_phase

    _check_out(options.out, ".npz")
    phase = decode_capture(options.capture, progress)
    write_phase(options.out, phase)
    figures = phase_figures(phase)
    print(options.out)
    return figures


def _measure(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from core.figures import targets_figures
    from core.pipeline import measure_project
    from core.project import read_project

    targets = measure_project(read_project(options.project), progress)
    for t in targets:
        print(f"{t.capture:20s} {len(t.row):5d} targets measured, {len(t.missing):4d} missing")
    return targets_figures(targets)


def _calibrate(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from core.figures import calibration_figures
    from core.pipeline import CalibrateOptions, calibrate_project, current_runs, result_tables
    from core.project import read_project

    if options.degree < 1:
        raise InputError("--degree", f"is {options.degree}", "give 1 or more")
    if not 0 <= options.low_pass <= 1000:
        raise InputError("--low-pass", f"is {options.low_pass}", "give 0 to 1000 pixels")
    if not 0 <= options.reject < math.inf:
        raise InputError("--reject", f"is {options.reject}", "give 0 or more sigmas")
    chosen = CalibrateOptions(
        rigid=not options.free_stations,
        degree=None if options.table else options.degree,
        low_pass_px=options.low_pass,
        without=tuple(options.without),
        hold=tuple(options.hold),
        reject_beyond=options.reject or None,
    )
    project = read_project(options.project)
    calibrations = calibrate_project(project, options.method, chosen, progress)
    print(result_tables(project))
    print(f"\nkept as run {max(current_runs(project).values())}")
    return calibration_figures(calibrations)


def _adjust(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from core.figures import adjustment_figures
    from core.pipeline import adjust_network

    figures = adjustment_figures(adjust_network(options.network, progress))
    print(f"sigma0 {figures['sigma0']:.6g}, redundancy {figures['redundancy']}, {figures['iterations']} iterations")
    for name, device in figures["devices"].items():
        print(f"\n{name}  (r0 = {device['r0_mm']:.6g} mm)")
        for key, value in device.items():
            if isinstance(value, dict):
                print(f"  {key:6s} {value['value']: .9e}  ± {value['sigma']:.2e}")
    for warning in figures["warnings"]:
        print(f"warning: {warning}")
    return figures


def _reconstruct(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from core.pipeline import reconstruct_capture, write_cloud
    from core.project import read_project

    _check_out(options.out, ".npz", ".ply")
    project = read_project(options.project)
    phase, cloud = reconstruct_capture(project, options.capture, options.method, options.extrapolate, progress)
    points = write_cloud(options.out, phase, cloud)
    print(f"{options.out}: {points} points")
    return {"points": points, "out": str(options.out)}


def _evaluate(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from core.figures import evaluation_figures
    from core.pipeline import evaluate_project, result_tables
    from core.project import read_project

    project = read_project(options.project)
    evaluations = evaluate_project(project, progress)
    print(result_tables(project, evaluations))
    return evaluation_figures(evaluations)


def _report(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from core.pipeline import report_project
    from core.project import read_project

    paths = report_project(read_project(options.project), options.out, progress)
    print(f"{paths.html}\n{paths.pdf}")
    return {"html": str(paths.html), "pdf": str(paths.pdf)}


def _batch(options: argparse.Namespace, progress: Progress) -> dict[str, Any]:
    from core.batch import run_batch
    from core.project import read_project

    report = run_batch(
        read_project(options.project),
        options.out,
        options.captures,
        steps=options.do.split(","),
        scheduler=options.scheduler,
        workers=options.workers,
        progress=progress,
    )
    print(f"{report.count('done')} done, {report.count('left')} up to date, {report.count('failed')} failed")
    if bad := [outcome for outcome in report.outcomes if outcome.state == "failed"]:
        raise StripeError(bad[0].capture, bad[0].error, f"see all in {options.out / 'summary.json'} and run it again")
    return report.figures()


def _check_out(path: Path, *endings: str) -> None:
    """Refuse a result's file that cannot be written before the work begins."""
    from core.atomic import check_place

    if path.suffix.lower() not in endings:
        raise InputError(path, f"ends in {path.suffix!r}", f"give a file name ending in {' or '.join(endings)}")
    check_place(path)


def _check_json(target: str) -> None:
    """Refuse a file for the figures that cannot be written before anything else is."""
    from core.atomic import check_place

    check_place(Path(target))


def _write_figures(target: str, figures: dict[str, Any]) -> None:
    import json

    from core.atomic import write_json

    if target == "-":
        print(json.dumps(figures, indent=1, ensure_ascii=False, allow_nan=False))
    else:
        write_json(Path(target), figures)


if __name__ == "__main__":
    raise SystemExit(main())
