"""Beside the road: guesses of picks, kept runs, profiles, tables for other programs, the sign-off."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from core import pipeline
from core.cli.arguments import Commands, Options, add_devices, check_out, tell_devices
from core.cli.console import print_verdict, tell_outdated
from core.errors import InputError, StripeError
from core.progress import Progress

if TYPE_CHECKING:
    from core.pipeline.runs import Run


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    sub = commands.add_on_project("guess-picks", _guess, "guess four targets in each image of a board")
    sub.add_argument("captures", nargs="*", metavar="CAPTURE", help="names (default: all boards without picks)")
    sub.add_argument(
        "--accept", type=int, nargs="?", const=1, metavar="N", help="keep the Nth guess as picks (default: the 1st)"
    )

    sub = commands.add_on_project("runs", _runs, "list, compare, name, use or delete kept calibrations")
    sub.add_argument("--use", type=int, metavar="N", help="use the calibrations of this run")
    sub.add_argument("--compare", type=int, nargs=2, metavar=("A", "B"), help="compare two runs")
    sub.add_argument("--name", nargs=2, metavar=("N", "TEXT"), help="name a run")
    sub.add_argument("--delete", type=int, metavar="N", help="delete a run that is not in use")

    sub = commands.add_on_project(
        "uncertainty", _uncertainty, "show how certain a calibration is over the working volume"
    )
    _add_volume(sub, "sigma_mm, form_sigma_mm, camera_px, projector_lines")
    sub = commands.add_on_project("compare", _compare, "compare two calibrations of a rig over the working volume")
    sub.add_argument("other", metavar="OTHER", help="another project, or the number of a kept run")
    sizes = (
        "difference_mm, form_mm and their sigmas; as vectors shift_mm, form_shift_mm (form: after the best movement)"
    )
    _add_volume(sub, sizes)

    sub = commands.add_on_project(
        "cross-validate", _cross_validate, "leave each capture out and test whether the others predict it"
    )
    _add_run(sub)
    sub = commands.add_on_project("next-pose", _next_pose, "find the poses of the board to capture next")
    _add_run(sub)

    sub = commands.add_on_project("profile", _profile, "give deviations of a plane along a line, by every calibration")
    sub.add_argument("capture", metavar="CAPTURE")
    _add_line(sub)
    add_devices(sub)
    sub.add_argument("--out", type=Path, metavar="F.csv", help="the whole profile, about one value per pixel")

    sub = commands.add_on_project(
        "tables", _tables, "write the tables of all results as CSV, with targets and profiles"
    )
    sub.add_argument("--out", type=Path, required=True, metavar="DIR")
    sub.add_argument("--deviations", action="store_true", help="also the deviations of every pixel")
    sub.add_argument("--report", action="store_true", help="also the HTML and PDF report")
    _add_line(sub)

    sub = commands.add_on_project("sign", _sign, "sign off the evaluation; the sign-off lapses when the figures change")
    sub.add_argument("--operator", default="", metavar="NAME")
    sub.add_argument("--instrument", default="", metavar="TEXT")
    sub.add_argument("--date", default="", metavar="YYYY-MM-DD", help="default: today")
    sub.add_argument("--remark", default="", metavar="TEXT")
    sub.add_argument("--tolerance", type=float, metavar="MM", help="judge every plane against it")
    sub.add_argument(
        "--of", choices=("rms", "max"), default="rms", help="figure that the tolerance limits (default rms)"
    )
    sub.add_argument("--despite", default="", metavar="TEXT", help="why you sign although a verdict failed")
    sub.add_argument("--withdraw", action="store_true", help="withdraw the sign-off")

    sub = commands.add("verify-report", _verify, "check that a signed report has not changed")
    sub.add_argument("file", type=Path, metavar="FILE", help="report.html or report.pdf")


def _add_run(parser: Any) -> None:
    parser.add_argument(
        "--run", type=int, metavar="N", dest="kept", help="a kept run instead of the calibration in use"
    )


def _add_volume(parser: Any, maps: str) -> None:
    _add_run(parser)
    add_devices(parser)
    parser.add_argument("--out", type=Path, metavar="F.npz", help=f"maps: {maps}; uv, xyz_mm of the nodes")


def _add_line(parser: Any) -> None:
    parser.add_argument(
        "--line", type=float, nargs=4, metavar=("U0", "V0", "U1", "V1"), help="px (default: across the middle)"
    )


def _line(options: Options) -> tuple[tuple[float, float], tuple[float, float]] | None:
    if options.line is None:
        return None
    u0, v0, u1, v1 = options.line
    return (u0, v0), (u1, v1)


def _guess(options: Options, progress: Progress) -> dict[str, Any]:
    if options.accept is not None and options.accept < 1:
        raise InputError("--accept", f"is {options.accept}", "give 1 for the likeliest guess, 2 for the next")
    project = options.project
    found = pipeline.picking.guess_picks(project, options.captures or None, progress)
    kept = pipeline.picking.accept_guesses(project, found, options.accept) if options.accept else []
    for name, guesses in found.items():
        first = "; ".join(f"{s.row},{s.col} at {s.u:.1f},{s.v:.1f}" for s in guesses[0]) if guesses else "no guess"
        state = "  (kept)" if name in kept else f"  (none is number {options.accept})" if options.accept else ""
        print(f"{name:20s} {len(guesses)} guesses: {first}{state}")
    if not found:
        print("every board has picks")
    return {
        "captures": {
            name: [[{"row": s.row, "col": s.col, "u": s.u, "v": s.v} for s in guess] for guess in guesses]
            for name, guesses in found.items()
        },
        "kept": kept,
    }


def _runs(options: Options, progress: Progress) -> dict[str, Any]:
    from core.figures import picked

    project = options.project
    runs = {run.number: run for run in pipeline.runs.list_runs(project)}

    def run_of(number: str | int) -> Run:
        if str(number) not in map(str, runs):
            known = ", ".join(map(str, runs)) or "none"
            raise InputError(project.path, f"no run {number}", f"runs: {known}")
        return runs[int(number)]

    if options.name is not None:
        pipeline.runs.rename_run(project, run_of(options.name[0]), options.name[1])
    if options.use is not None:
        pipeline.runs.make_current(project, run_of(options.use))
    if options.delete is not None:
        pipeline.runs.delete_run(project, run_of(options.delete))
    differences = (
        pipeline.runs.compare_runs(run_of(options.compare[0]), run_of(options.compare[1])) if options.compare else ()
    )
    used = pipeline.runs.current_runs(project)
    listed = [
        {
            "run": run.number,
            "name": run.name,
            "made_at": run.made_at,
            "methods": list(run.methods),
            "in_use": [method for method, number in used.items() if number == run.number],
            "captures": {method: list(names) for method, names in run.captures.items()},
            "sigma0": run.figures.get("photogrammetric", {}).get("sigma0"),
        }
        for run in pipeline.runs.list_runs(project)
    ]
    for entry in listed:
        sigma0 = f"sigma0 {entry['sigma0']:.3f}" if entry["sigma0"] is not None else ""
        use = f"in use: {', '.join(entry['in_use'])}" if entry["in_use"] else ""
        print(f"run {entry['run']:<4d} {entry['made_at']:26s} {sigma0:14s} {use:38s} {entry['name']}".rstrip())
    if not listed:
        print("no calibration is kept")
    for d in differences:
        sigmas = "" if d.in_sigmas is None else f"{d.in_sigmas:+.2f} sigma"
        print(
            f"{d.name:22s} {d.first[0]: .7g} -> {d.second[0]: .7g} {d.unit:6s} {d.difference:+.3g}  {sigmas}".rstrip()
        )
    compared = [{"parameter": d.name, **picked(d, "unit first second difference in_sigmas")} for d in differences]
    return {"runs": listed, "compared": compared}


def _uncertainty(options: Options, progress: Progress) -> dict[str, Any]:
    from core.pipeline.volumes import volume_figures

    figures = _volume(options, volume_figures)
    print_verdict("photogrammetric", figures["verdict"])
    return figures


def _compare(options: Options, progress: Progress) -> dict[str, Any]:
    from core.pipeline.volumes import difference_figures

    other = int(options.other) if options.other.isdigit() else Path(options.other)
    figures = _volume(options, difference_figures, other)
    if figures["significant"] is not None:
        word = "differ by more than chance" if figures["significant"] else "agree within their sigmas"
        test = f"chi-square {figures['statistic']:.3g} of {figures['dof']}, limit {figures['limit']:.3g}"
        print(f"they {word}: {test}")
    else:
        print("one of them tells no sigmas, so that chance cannot be told from a difference")
    return figures


def _volume(
    options: Options, of: Callable[..., tuple[dict[str, Any], dict[str, Any]]], *other: object
) -> dict[str, Any]:
    """Print figures by depth, and write the maps."""
    import numpy as np

    from core.atomic import atomic_write
    from core.digits import fixed

    if options.out is not None:
        check_out(options.out, ".npz")
    figures, maps = of(options.project, *other, options.kept, options.camera, options.projector)
    names = [
        name
        for name in figures["depths"][0]
        if name not in ("layer", "depth_mm", "nodes") and not name.endswith("_max")
    ]
    if "camera" in figures:
        tell_devices(options, figures["camera"], figures["projector"])
    print("  ".join(["depth_mm", *names, "(r.m.s.)"]))
    for row in figures["depths"]:
        values = (f"{fixed(row[name], 4):>{len(name)}}" for name in names)
        print("  ".join([f"{fixed(row['depth_mm'], 1):>8}", *values]))
    if options.out is not None:
        with atomic_write(options.out) as file:
            np.savez(file, **maps)
        print(options.out)
    return figures


def _cross_validate(options: Options, progress: Progress) -> dict[str, Any]:
    from core.figures import verdict_figures
    from core.pipeline.volumes import left_out_figures, left_out_verdict

    found = left_out_figures(options.project, options.kept, progress)
    for one in found:
        rms = one["foreseen_px"].items()
        foreseen = "  ".join(f"{name} {value:.4f} ({one['fitted_px'][name]:.4f})" for name, value in rms)
        most = f"{one['parameter']} {one['change_sigmas']:+.1f} sigma"
        word = "  does not fit the others" if one["off"] else ""
        print(f"{one['capture']:20s} {foreseen}  F {one['statistic']:.2f}, limit {one['limit']:.2f}  {most}{word}")
    print(
        "r.m.s. residuals (px, lines) foreseen by the other captures (with the capture); what changes most without it"
    )
    verdict = verdict_figures(left_out_verdict(found))
    print_verdict("captures", verdict)
    return {"captures": found, "verdict": verdict}


def _next_pose(options: Options, progress: Progress) -> dict[str, Any]:
    from core.pipeline.volumes import next_pose_figures

    found = next_pose_figures(options.project, options.kept, progress)
    for one in found:
        gain = f"sigmas {one['gain']:.1%} smaller on average, {one['parameter']} {one['most']:.1%}"
        print(f"{one['words']}: {gain}")
    return {"poses": found}


def _profile(options: Options, progress: Progress) -> dict[str, Any]:
    import numpy as np

    from core.digits import fixed
    from core.pipeline.tables import write_profile_csv

    if options.out is not None:
        check_out(options.out, ".csv")
    project = options.project
    named = options.camera, options.projector
    found = pipeline.tables.read_profiles(
        project, pipeline.tables.kept_evaluation(project), options.capture, _line(options), *named
    )
    figures: dict[str, Any] = {}
    for line in [*found.values()][:1]:
        tell_devices(options, *line.devices)
    for method, line in found.items():
        known = line.deviation_mm[np.isfinite(line.deviation_mm)]
        rms = float(np.sqrt(np.mean(known**2))) if len(known) else None
        length = float(line.length_mm[-1])
        figures[method] = {
            "camera": line.devices[0],
            "projector": line.devices[1],
            "from_px": line.uv[0].tolist(),
            "to_px": line.uv[-1].tolist(),
            "length_mm": length if np.isfinite(length) else None,
            "n": len(known),
            "rms_mm": rms,
            "min_mm": float(known.min()) if len(known) else None,
            "max_mm": float(known.max()) if len(known) else None,
        }
        told = f"{fixed(1000 * rms, 1)} µm r.m.s." if rms is not None else "no values"
        print(f"{options.capture} {method}: {told} along {fixed(length, 1)} mm, {len(known)} values")
    if options.out is not None:
        write_profile_csv(options.out, found)
        print(options.out)
    tell_outdated(project, pipeline.report.outdated_evaluation(project))
    return {"capture": options.capture, "profiles": figures}


def _tables(options: Options, progress: Progress) -> dict[str, Any]:
    project = options.project
    evaluations = pipeline.tables.kept_evaluation(project)
    profiles = pipeline.tables.read_all_profiles(project, evaluations, _line(options))
    write = pipeline.tables.export_report if options.report else pipeline.tables.export_tables
    files = write(project, options.out, progress=progress.part(0.0, 0.2))
    files += pipeline.tables.export_profiles(profiles, options.out)
    if options.deviations:
        files += pipeline.tables.export_deviations(project, evaluations, options.out, progress=progress.part(0.2, 1.0))
    for file in files:
        print(file)
    tell_outdated(project, pipeline.report.outdated_evaluation(project))
    return {"files": [str(file) for file in files]}


def _sign(options: Options, progress: Progress) -> dict[str, Any]:
    from datetime import date

    project = options.project
    if options.withdraw:
        print("withdrawn" if pipeline.signed.withdraw_sign_off(project) else "nothing was signed")
        return {"signed": False}
    if not options.operator.strip():
        raise InputError("--operator", "no name", "say who signs, or --withdraw")
    if options.date:
        try:
            date.fromisoformat(options.date)
        except ValueError as error:
            raise InputError("--date", f"is {options.date!r}", "give it as YYYY-MM-DD") from error
    if options.tolerance is not None and not 0 < options.tolerance < float("inf"):
        raise InputError("--tolerance", f"is {options.tolerance}", "give millimetres above 0")
    signed, found = pipeline.signing.sign_evaluation(
        project,
        options.operator,
        tolerance_mm=options.tolerance,
        of=options.of,
        date=options.date,
        instrument=options.instrument,
        remark=options.remark,
        despite=options.despite,
    )
    print(f"signed by {signed.operator} on {signed.date}; write the report to show it")
    if found is not None:
        print(found.text)
    return {
        "signed": True,
        "operator": signed.operator,
        "date": signed.date,
        "passed": None if found is None else found.passed,
        "result": None if found is None else found.text,
    }


def _verify(options: Options, progress: Progress) -> dict[str, Any]:
    from core.report.seal import verify

    seal = verify(options.file)
    print(f"{options.file}: {seal.words}")
    print(f"sha256 {seal.digest}")
    if not seal.intact:
        raise StripeError(options.file, "is not as it was written", "take the report from where it was signed")
    return {"intact": True, "signed": bool(seal.operator), "operator": seal.operator, "date": seal.date}
