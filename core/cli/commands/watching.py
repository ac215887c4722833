"""Watching the rig, and what stands before it."""

from __future__ import annotations

from pathlib import Path
from signal import SIGINT
from typing import Any

from core import pipeline
from core.cli.arguments import (
    Commands,
    Options,
    UnfinishedError,
    add_devices,
    add_urls,
    camera_urls,
    chosen_sequence,
    method_name,
    named_url,
    sequence_argument,
)
from core.cli.console import print_verdict
from core.errors import InputError, listed
from core.progress import Progress


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    sub = commands.add_on_project("orient", _orient, "test whether the rig has moved since its calibration")
    words = "default: all captures, each tested against those before it"
    sub.add_argument("capture", metavar="CAPTURE", nargs="?", help=words)
    sub.add_argument("--correct", action="store_true", help="keep the corrected orientation for `reconstruct --orient`")
    sub.add_argument(
        "--significance", type=float, default=1e-3, metavar="P", help="share of false alarms (default 0.001)"
    )
    form = ("KIND", "FROM", "TO", "MM", "SIGMA")
    words = "a known length in the scene: points, balls or planes U,V,RADIUS U,V,RADIUS, or targets ROW,COL ROW,COL"
    sub.add_argument("--length", nargs=5, action="append", default=[], metavar=form, help=words)
    words = "points measured before: a table; without FILE the testfield as calibrated"
    sub.add_argument("--points", nargs="?", const="testfield", metavar="FILE", help=words)
    add_devices(sub)

    sub = commands.add_on_project(
        "features", _features, "measure holes, marks and edges in space; without a place, everything round"
    )
    sub.add_argument("capture", metavar="CAPTURE")
    for kind, place in (("circle", "U,V,RADIUS"), ("line", "U,V,U,V")):
        words = f"a {kind} near this place, px; repeat it for more"
        sub.add_argument(f"--{kind}", action="append", default=[], metavar=place, help=words)
    sub.add_argument("--orient", action="store_true", help="use the orientation that `orient --correct` has kept")
    add_devices(sub)

    sub = commands.add_on_folder("live", _live, "capture and reconstruct repeatedly, until Ctrl+C")
    add_urls(sub)
    sub.add_argument(
        "--method", type=method_name, metavar="METHOD", help="photogrammetric (default, if any) or polynomial"
    )
    sub.add_argument("--count", type=int, metavar="N", help="end after N sequences")
    sub.add_argument("--out", type=Path, metavar="DIR", help="write the points of every sequence")
    sub.add_argument(
        "--format", default="ply", metavar="ENDING", help="format of the points: ply (default), npz, las, ..."
    )
    sequence_argument(sub)


def _orient(options: Options, progress: Progress) -> dict[str, Any]:
    project = options.project
    if options.capture is None:
        if options.correct or options.length or options.points:
            raise InputError("orient", "no CAPTURE with --correct, --length or --points", "name the capture")
        charts = pipeline.orient.drift_of(project, significance=options.significance, progress=progress)
        for line in pipeline.orient_words.drift_words(charts):
            print(line)
        return pipeline.orient_words.drift_figures(charts)
    wanted = pipeline.orient.Wanted(
        correct=options.correct,
        significance=options.significance,
        lengths=[pipeline.orient_known.parse_length(words) for words in options.length],
        points=Path(options.points) if options.points not in (None, "testfield") else options.points,
    )
    named = {"camera": options.camera, "projector": options.projector}
    motions, untold = pipeline.orient.orient_pairs(project, options.capture, wanted, **named, progress=progress)
    for motion in motions:
        for line in pipeline.orient_words.motion_words(motion):
            print(line)
    for (camera, projector), because in untold.items():
        print(f"{motions[0].capture}: {projector} against {camera} cannot be judged: {because}")
    figures = pipeline.orient_words.motions_figures(motions, untold)
    if options.correct:
        for m in motions:
            of = "" if project.rig.is_pair else f" --camera {m.camera} --projector {m.projector}"
            print(f"kept: `stripe-core reconstruct {project.path} {m.capture} --orient{of}` uses it")
    if options.correct and not (options.camera or options.projector or options.length or options.points):
        together = pipeline.orient_rig.correct_together(project, options.capture, progress)
        if together is not None:
            print(*pipeline.orient_rig.together_words(together), sep="\n")
            print(f"kept: `stripe-core reconstruct {project.path} {together.capture} --orient` uses it")
            figures["together"] = pipeline.orient_rig.together_figures(together)
    return figures


def _features(options: Options, progress: Progress) -> dict[str, Any]:
    from core.figures import verdict_figures

    found, untold = pipeline.features.measure_features(
        options.project,
        options.capture,
        [("circle", text) for text in options.circle] + [("line", text) for text in options.line],
        camera=options.camera,
        projector=options.projector,
        orient=options.orient,
        progress=progress,
    )
    for feature in found:
        print(pipeline.features.feature_words(feature))
    verdict = verdict_figures(found[0].verdict)
    print_verdict(options.capture, verdict)
    figures = {"features": [pipeline.features.feature_figures(feature) for feature in found], "verdict": verdict}
    if untold:
        first, *others = untold
        figures["untold"] = {error.where: error.seen for error in untold}
        more = f" (also not measured: {listed([error.where for error in others])})" if others else ""
        raise UnfinishedError(figures, first.where, f"{first.seen}{more}", first.remedy)
    return figures


def _live(options: Options, progress: Progress) -> dict[str, Any]:
    from contextlib import closing

    if options.count is not None and options.count < 1:
        raise InputError("--count", f"is {options.count}", "give 1 or more")
    name, url = named_url(options.projector or "")
    cycles = pipeline.live.live_cycles(
        options.project,
        projector=url or None,
        camera=camera_urls(options.camera),
        shown_by=name,
        method=options.method,
        sequence=chosen_sequence(options),
        count=options.count or 0,
        out=options.out,
        ending=options.format,
        progress=progress,
    )
    figures: list[dict[str, Any]] = []
    notes: set[str] = set()
    with closing(cycles):
        try:
            for cycle in cycles:
                figures.append(cycle.as_dict())
                print(cycle.words, flush=True)
                for note in cycle.notes:
                    if note not in notes:
                        print(f"      {note}", flush=True)
                notes.update(cycle.notes)
        except KeyboardInterrupt as ended:
            if ended.args and ended.args[0] != SIGINT:
                raise
            print(f"ended after {len(figures)} sequences")
    return {"cycles": figures}
