"""The stages from decoding to the report, and many captures at once."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from core import pipeline
from core.cli.arguments import Commands, Options, add_devices, check_out, method_name
from core.cli.console import print_left_out, print_plane_verdicts, print_verdict, tell_outdated
from core.errors import InputError, StripeError
from core.progress import Progress


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    sub = commands.add("decode", _decode, "find the projector coordinates of every camera pixel")
    sub.add_argument("capture", type=Path, metavar="CAPTURE")
    sub.add_argument("--estimate", action="store_true", help="adjust to all frames: less noise, takes longer")
    sub.add_argument("--out", type=Path, required=True, metavar="F.npz")
    add_devices(sub)

    commands.add_on_project("measure", _measure, "measure the targets of all boards, picked or recognised")

    sub = commands.add_on_project(
        "calibrate", _calibrate, "calibrate camera and projector, and keep the result in the project"
    )
    words = "photogrammetric, polynomial, or all that have captures (default)"
    sub.add_argument("--method", type=lambda m: method_name(m, "all"), default="all", metavar="METHOD", help=words)
    sub.add_argument(
        "--free-stations", action="store_true", help="orient every station on its own: the rig is not rigid"
    )
    sub.add_argument("--degree", type=int, help="degree of the depth polynomial (default 3)")
    sub.add_argument("--camera", default="", metavar="NAME", help="of the depth calibration, if there are several")
    sub.add_argument("--projector", default="", metavar="NAME", help="likewise")
    sub.add_argument("--table", action="store_true", help="piecewise-linear depth table instead of the polynomial")
    sub.add_argument("--low-pass", type=float, default=2.0, metavar="PX", help="smooth the plate (default 2; 0: off)")
    sub.add_argument("--without", action="append", default=[], metavar="NAME", help="leave this capture out")
    sub.add_argument(
        "--hold", action="append", default=[], metavar="P", help="do not estimate this parameter, such as projector.A3"
    )
    sub.add_argument(
        "--reject", type=float, default=5.0, metavar="SIGMAS", help="limit for gross errors (default 5; 0: keep all)"
    )

    sub = commands.add("adjust", _adjust, "run the bundle adjustment of a network alone")
    sub.add_argument("network", type=Path, metavar="NETWORK")

    sub = commands.add_on_project("reconstruct", _reconstruct, "make points in the camera's frame")
    sub.add_argument("capture", metavar="CAPTURE")
    sub.add_argument(
        "--method", type=method_name, metavar="METHOD", help="photogrammetric (default, if any) or polynomial"
    )
    sub.add_argument("--orient", action="store_true", help="use the orientation that `orient --correct` kept")
    sub.add_argument(
        "--rays",
        choices=("all", "cameras", "pair"),
        help="intersect points from every device that saw them (the default if there are several),"
        " from cameras alone, or from one camera and one projector",
    )
    sub.add_argument("--fill", choices=("texture",), help="where the code fails, match the texture seen by two cameras")
    sub.add_argument("--extrapolate", action="store_true", help="polynomial: also beyond the calibrated depths")
    add_devices(sub)
    sub.add_argument("--out", type=Path, required=True, metavar="FILE", help="npz ply stl obj glb pcd xyz e57 las")

    sub = commands.add_on_project("merge", _merge, "join captures of one object from several stations")
    sub.add_argument("captures", nargs="+", metavar="CAPTURE", help="the camera of the first one gives the frame")
    words = "find the poses from targets of a testfield that captures name, from the surface, or both (default)"
    sub.add_argument("--by", choices=("both", "targets", "surface"), default="both", help=words)
    sub.add_argument("--out", type=Path, required=True, metavar="FILE", help="npz ply pcd xyz e57 las")

    commands.add_on_project("evaluate", _evaluate, "compare every plane capture with its plane, by every calibration")

    sub = commands.add_on_project("report", _report, "write the HTML and PDF report")
    sub.add_argument("--out", type=Path, metavar="DIR")

    sub = commands.add_on_project("batch", _batch, "decode, reconstruct and evaluate many captures on all cores")
    sub.add_argument("captures", nargs="*", metavar="CAPTURE", help="names or folders (default: all of the project)")
    sub.add_argument(
        "--out", type=Path, required=True, metavar="DIR", help="a second run skips captures that are current"
    )
    sub.add_argument(
        "--do",
        default="decode,reconstruct,evaluate",
        metavar="STEPS",
        help="decode,reconstruct,evaluate or some of them (default: all)",
    )
    sub.add_argument("--scheduler", metavar="ADDRESS", help="a running Dask scheduler (default: this machine)")
    sub.add_argument("--workers", type=int, metavar="N", help="number of processes (default: one per processor)")


def _decode(options: Options, progress: Progress) -> dict[str, Any] | None:
    from core.figures import phase_figures

    check_out(options.out, ".npz")
    named = {"camera": options.camera, "projector": options.projector}
    phase = pipeline.decode_capture(options.capture, progress, **named, estimate=options.estimate)
    pipeline.decode.write_phase(options.out, phase)
    print(options.out)
    for note in phase.notes:
        print(note)
    return None if options.json is None else phase_figures(phase)


def _measure(options: Options, progress: Progress) -> dict[str, Any]:
    from core.figures import targets_figures

    project = options.project
    targets = pipeline.measure_project(project, progress)
    for t in targets:
        pair = "" if project.rig.is_pair else f"{t.camera} with {t.projector}: "
        why = f": {t.missing[0].reason}" if t.missing and not len(t.row) else ""
        print(f"{t.capture:20s} {pair}{len(t.row):5d} targets measured, {len(t.missing):4d} missing{why}")
        for note in t.notes:
            print(f"  {note}")
    return targets_figures(targets)


def _calibrate(options: Options, progress: Progress) -> dict[str, Any]:
    if options.degree is not None and options.degree < 1:
        raise InputError("--degree", f"is {options.degree}", "give 1 or more")
    if options.degree is not None and options.table:
        raise InputError("--table", f"does not go with --degree {options.degree}", "leave one of the two out")
    if not 0 <= options.low_pass <= 1000:
        raise InputError("--low-pass", f"is {options.low_pass}", "give 0 to 1000 pixels")
    if not 0 <= options.reject < math.inf:
        raise InputError("--reject", f"is {options.reject}", "give 0 or more sigmas")
    chosen = pipeline.CalibrateOptions(
        rigid=not options.free_stations,
        degree=None if options.table else options.degree or pipeline.CalibrateOptions().degree,
        low_pass_px=options.low_pass,
        without=tuple(options.without),
        hold=tuple(options.hold),
        reject_beyond=options.reject or None,
        camera=options.camera,
        projector=options.projector,
    )
    project = options.project
    calibrations = pipeline.calibrate_project(project, options.method, chosen, progress)
    figures = pipeline.methods.calibration_figures(calibrations)
    for method, entry in figures.items():
        print_verdict(method, entry["verdict"])
        print_left_out(entry["left_out"])
        _print_warnings(entry)
    print()
    print(pipeline.report.result_tables(project))
    print(f"\nkept as run {max(pipeline.runs.current_runs(project).values())}")
    return figures


def _adjust(options: Options, progress: Progress) -> dict[str, Any]:
    from core.figures import adjustment_figures

    figures = adjustment_figures(pipeline.adjust_network(options.network, progress))
    print_verdict("network", figures["verdict"])
    print(f"sigma0 {figures['sigma0']:.6g}, redundancy {figures['redundancy']}, {figures['iterations']} iterations")
    for name, device in figures["devices"].items():
        print(f"\n{name}  " + (f"(r0 = {device['r0_mm']:.6g} mm)" if "r0_mm" in device else f"({device['model']})"))
        for key, value in device.items():
            if isinstance(value, dict):
                print(f"  {key:6s} {value['value']: .9e}  ± {value['sigma']:.2e}")
    _print_warnings(figures)
    return figures


def _print_warnings(figures: dict[str, Any]) -> None:
    for warning in figures["warnings"]:
        print(f"warning: {warning}")


def _reconstruct(options: Options, progress: Progress) -> dict[str, Any]:
    from core.figures import verdict_figures

    project = options.project
    asked = pipeline.reconstruct.asked_beside(project, options.capture, options.method)
    pipeline.reconstruct.check_cloud(options.out)
    one_pair = options.projector or (options.method and not pipeline.METHODS[options.method].joint)
    several = not one_pair and pipeline.views.seen_by_several(project, options.capture)
    if several and options.orient:  # two that are calibrated are corrected as a pair
        several = pipeline.orient_rig.are_together(project, options.capture)
    rays: Any = options.rays or ("all" if several else "pair")
    if options.rays == "pair" and all(device.labels_only for device in project.rig.projectors.values()):
        raise InputError("--rays", "pair, where projectors only label places", "leave it out, or give cameras")
    if options.fill and rays == "pair":
        raise InputError("--fill texture", "matches between cameras", "give a capture by several cameras, and all rays")
    if rays != "pair":
        if one_pair:
            other = f"--method {options.method}" if options.method else "--projector"
            raise InputError("--rays", f"{rays} does not go with {other}", "leave one of the two out")
        if options.extrapolate:
            raise InputError("--extrapolate", f"does not go with rays of {rays}", "give --method polynomial, too")
        pipeline.reconstruct.check_cloud(options.out, joined=not options.camera)
        named = {"camera": options.camera, "rays": rays, "fill": bool(options.fill), "orient": options.orient}
        image, cloud = pipeline.views.reconstruct_views(project, options.capture, **named, progress=progress)
    else:
        if options.orient and not (options.camera or options.projector or project.rig.is_pair):
            options.camera, options.projector = pipeline.folders.find_capture(project, options.capture).pairs[0]
            print(f"of {options.camera} with {options.projector}; --camera and --projector choose others")
        phase, cloud = pipeline.reconstruct_capture(
            project,
            options.capture,
            options.method,
            options.extrapolate,
            progress,
            orient=options.orient,
            camera=options.camera,
            projector=options.projector,
            asked=asked,
        )
        image = phase.image
    points = pipeline.reconstruct.write_cloud(options.out, image, cloud)
    print(f"{options.out}: {points} points")
    verdict = verdict_figures(cloud.verdict)
    print_verdict(options.capture, verdict)
    figures: dict[str, Any] = {"points": points, "out": str(options.out), "verdict": verdict}
    if covered := pipeline.views.coverage(cloud):
        print(
            "of the {object_px} pixels of the object {by_code:.1%} by code, {filled:.1%} with texture".format(**covered)
        )
        figures["covered"] = covered
    tell_outdated(options.project, asked()[0])
    return figures


def _merge(options: Options, progress: Progress) -> dict[str, Any]:
    pipeline.reconstruct.check_cloud(options.out, joined=True)
    merged = pipeline.merge.merge_captures(options.project, options.captures, by=options.by, progress=progress)
    points = pipeline.reconstruct.write_cloud(options.out, merged.image, merged.cloud)
    for line in pipeline.merge.merge_words(merged):
        print(line)
    print(f"{options.out}: {points} points")
    figures = pipeline.merge.merge_figures(merged)
    print_verdict("the merged points", figures["verdict"])
    tell_outdated(options.project, pipeline.report.outdated_words(options.project))
    return {**figures, "out": str(options.out)}


def _evaluate(options: Options, progress: Progress) -> dict[str, Any]:
    from core.figures import evaluation_figures

    project = options.project
    outdated = pipeline.report.outdated_beside(project)
    evaluations = pipeline.evaluate_project(project, progress)
    figures = evaluation_figures(evaluations)
    print_plane_verdicts(figures["planes"], not project.rig.is_pair)
    print()
    print(pipeline.report.table_of_planes(project, evaluations))
    tell_outdated(options.project, outdated())
    return figures


def _report(options: Options, progress: Progress) -> dict[str, Any]:
    paths = pipeline.report_project(options.project, options.out, progress)
    tell_outdated(options.project, paths.outdated)
    print(f"{paths.html}\n{paths.pdf}")
    return {"html": str(paths.html), "pdf": str(paths.pdf)}


def _batch(options: Options, progress: Progress) -> dict[str, Any]:
    from core.batch import run_batch

    report = run_batch(
        options.project,
        options.out,
        options.captures,
        steps=options.do.split(","),
        scheduler=options.scheduler,
        workers=options.workers,
        progress=progress,
    )
    print(f"{report.count('done')} done, {report.count('left')} up to date, {report.count('failed')} failed")
    for outcome in report.outcomes:
        _print_doubts(outcome.capture, outcome.figures, not options.project.rig.is_pair)
    if bad := [outcome for outcome in report.outcomes if outcome.state == "failed"]:
        raise StripeError(bad[0].capture, bad[0].error, f"see all in {options.out / 'summary.json'} and run it again")
    return report.figures()


def _print_doubts(capture: str, figures: dict[str, Any], several: bool) -> None:
    """Print what speaks against a capture's planes, whose verdicts hold those of its points, or else against these."""
    planes = [plane for plane in figures.get("evaluate", ()) if plane["verdict"]["state"] != "passed"]
    print_plane_verdicts(planes, several)
    of_points = figures.get("reconstruct", {}).get("verdict")
    if not planes and of_points and of_points["state"] != "passed":
        print_verdict(capture, of_points)
