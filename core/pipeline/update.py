"""All that is outdated or absent, done in the order of the road; what stops it is told, and the next call goes on."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext, suppress
from dataclasses import field, replace
from pathlib import Path

from core.errors import Cancelled, InputError, StripeError
from core.figures import phase_figures, verdict_figures
from core.lazy import dataclass
from core.model import Figures, Method, Project
from core.parallel import on_processes
from core.pipeline.calibrate import calibrate_project, chosen_calibration, methods_in_use
from core.pipeline.decode import phase_maps
from core.pipeline.evaluate import evaluate_project
from core.pipeline.folders import method_of, points_file, result_path
from core.pipeline.measure import measure_project
from core.pipeline.methods import METHODS
from core.pipeline.options import CalibrateOptions
from core.pipeline.reconstruct import reconstruct_capture, write_cloud
from core.pipeline.report import report_project
from core.pipeline.runs import calibration_hashes, current_run
from core.pipeline.state.failures import StageFailure, clear_failure, keep_failure
from core.pipeline.state.graph import Graph, project_states
from core.pipeline.state.holdings import decoded_figures
from core.pipeline.state.inputs import decoded_from, reconstructed_from
from core.pipeline.state.states import ProjectStates, State
from core.progress import SILENT, Progress
from core.project import write_json
from core.project.contents import contents_of, hash_file
from core.project.lock import writing_results

Listen = Callable[[str], None]
DUE = ("absent", "outdated", "failed")


@dataclass(frozen=True)
class Update:
    """What was done, a sentence each, and the states after it."""

    done: tuple[str, ...]
    states: ProjectStates = field(repr=False)


def update_project(project: Project, progress: Progress = SILENT, listen: Listen | None = None) -> Update:
    """Do everything that is outdated or absent and can be done, in order; tell `listen` what has been done.

    Every stage is kept as soon as it has succeeded: what stops this costs no more than the stage it was at.

    Raises
    ------
    BusyError
        If another program writes into the project.
    StripeError
        What the first stage failed with that could not be done; stages that do not need it are done all the same,
        and nothing by a calibration that is outdated.
    """
    done: list[str] = []
    problems: list[StripeError] = []

    def tell(text: str) -> None:
        done.append(text)
        if listen is not None:
            listen(text)

    work: dict[str, Callable[[Project, ProjectStates, Progress], str]] = {
        "measure": _measure,
        "calibrate": _calibrate,
        "reconstruct": _reconstruct,
        "evaluate": _evaluate,
        "decode": _decode,  # last of what reads frames: all before it decode what they need
        "report": _report,
    }
    spans = {"measure": 0.4, "calibrate": 0.6, "reconstruct": 0.68, "evaluate": 0.82, "decode": 0.87, "report": 1.0}
    start, states = 0.0, project_states(project)
    due = any(states.stages[stage].state in DUE for stage in work)
    with writing_results(project.path, "update") if due else nullcontext():  # what is current may be read only
        for stage, do in work.items():
            part, start = progress.part(start, spans[stage]), spans[stage]
            if states.stages[stage].state not in DUE:
                continue
            try:
                if text := do(project, states, part):
                    tell(f"{stage}: {text}")
                clear_failure(project.path, stage)
            except Cancelled:
                raise
            except StripeError as error:  # its state from now on; stages that do not need it are done all the same
                problems.append(error)
                failure = StageFailure(f"{error.where}: {error.seen}", error.remedy, read=Graph(project).sign())
                with suppress(StripeError):
                    keep_failure(project.path, stage, failure)
            states = project_states(project)
    if problems:
        raise problems[0]
    progress(1.0, "everything is current")
    return Update(tuple(done), states)


def _due(states: ProjectStates, stage: str, *words: str) -> list[str]:
    return [name for name, of in states.captures.items() if of.get(stage, State("current")).state in (words or DUE)]


def _measure(project: Project, states: ProjectStates, progress: Progress) -> str:
    graph = Graph(project)
    due = [name for name in _due(states, "measure") if name in graph.captures]
    if not due:
        return ""
    targets = measure_project(project, progress)
    return f"targets of {len(targets)} captures, {len(due)} of them anew"


def _calibrate(project: Project, states: ProjectStates, progress: Progress) -> str:
    """Calibrate by the methods that need it, with what was chosen for those in use."""
    due = [m for m, (state, _) in Graph(project).calibrations.items() if state.state in DUE]
    if not due:
        return ""
    calibrate_project(project, due[0] if len(due) == 1 else "all", chosen_options(project), progress)
    return " and ".join(due)


def chosen_options(project: Project) -> CalibrateOptions:
    """Give what was chosen for the calibrations in use, so that calibrating again begins from there."""
    runs = {m: run for m in METHODS if (run := current_run(project, m)) is not None}
    if not runs:
        return CalibrateOptions()
    newest = max(runs.values(), key=lambda run: run.number)
    options = newest.options
    for method, run in runs.items():
        options = replace(options, **{name: getattr(run.options, name) for name in METHODS[method].options})
    there = {folder.name for folder in project.captures}
    return replace(options, without=tuple(name for name in options.without if name in there))


def _reconstruct(project: Project, states: ProjectStates, progress: Progress) -> str:
    """Reconstruct objects by the calibration that comes first, and anew what was reconstructed before."""
    graph, done = Graph(project), list[str]()
    if not calibration_hashes(project):
        return ""
    first = methods_in_use(project)[0]
    names = [name for name in _due(states, "reconstruct") if name in graph.captures]
    left: dict[str, list[str]] = {}
    for name in progress.over(names, "reconstructing {0}"):
        capture = graph.captures[name].name
        methods = dict.fromkeys(map(method_of, graph.clouds.get(capture, ()))) or [first]
        for method in methods:
            if stale := graph.of_calibrations([method]):
                left.setdefault(stale[0], []).append(name)
                continue
            _, calibration = chosen_calibration(project, method)
            for pair in graph.captures[name].pairs:
                if METHODS[method].is_of(project, calibration, *pair):
                    keep_points(project, capture, method, camera=pair[0], projector=pair[1])
                    done.append(name)
    told = [f"points of {len(set(done))} captures"] if done else []
    return "; ".join([*told, *(f"no new points of {', '.join(dict.fromkeys(n))}: {why}" for why, n in left.items())])


def keep_points(
    project: Project, name: str, method: Method, progress: Progress = SILENT, *, camera: str = "", projector: str = ""
) -> Path:
    """Reconstruct a capture and keep its points in the project, with the record of what they were made from.

    `camera` and `projector` choose whose, where the capture holds frames of several.
    """
    capture = next(c for c in Graph(project).captures.values() if c.name == name)
    path = points_file(project, capture, method, camera, projector)
    with writing_results(project.path, "reconstruct"):
        record = reconstructed_from(project, capture, calibration_hashes(project, [method]))
        phase, cloud = reconstruct_capture(
            project, str(capture.path), method, progress=progress, camera=camera, projector=projector
        )
        progress.check()
        write_cloud(path, phase.image, cloud)
        verdict = verdict_figures(cloud.verdict)
        write_json(
            path.with_suffix(".json"), {"files": {path.name: hash_file(path)}, "made_from": record, "verdict": verdict}
        )
        contents_of(project.path).keep()
    return path


def _evaluate(project: Project, states: ProjectStates, progress: Progress) -> str:
    graph = Graph(project)
    if not graph.of_role("plane") or not calibration_hashes(project):
        return ""
    chosen = (graph.evaluation[0] or {}).get("options") or {}
    planes = [name for name in chosen.get("captures") or () if name in graph.captures] or None
    methods = [m for m in chosen.get("methods") or () if f"{m} calibration" in calibration_hashes(project)] or None
    if stale := graph.of_calibrations(methods or METHODS):
        return f"not done: {stale[0]}"
    found = evaluate_project(project, progress, captures=planes, methods=methods)
    return f"{len({e.capture for e in found})} planes"


def _decode(project: Project, states: ProjectStates, progress: Progress) -> str:
    count = decode_project(project, progress)
    return f"{count} captures" if count else ""


def decode_project(project: Project, progress: Progress = SILENT) -> int:
    """Decode every capture that is not decoded as it is now, and keep the figures; give the count.

    The first capture that cannot be decoded is a StripeError once the others are done; it is noted with its figures.
    """
    graph = Graph(project)
    with writing_results(project.path, "decode"):
        states = graph.states().captures
        due = [c for name, c in graph.captures.items() if states[name]["decode"].state in DUE]
        names = {c.name for c in graph.captures.values()}
        kept = {name: entry for name, entry in decoded_figures(project).items() if name in names}
        problem: StripeError | None = next((c for c in graph.read.values() if isinstance(c, StripeError)), None)
        records = [decoded_from(project, capture) for capture in due]

        def decoded(k: int, said: Progress) -> tuple[Figures, StripeError | None]:
            said(0.0, f"decoding {due[k].name}")
            try:
                phases = [phase for _, phase in phase_maps(project, [due[k]], said.quiet())]
            except Cancelled:
                raise
            except StripeError as error:
                return {"error": str(error)}, error
            by_pair = {f"{p.camera}-{p.projector}": phase_figures(p) for p in phases}
            return by_pair if len(phases) > 1 else next(iter(by_pair.values())), None

        outcomes = on_processes(decoded, len(due), progress)
        for capture, record, (figures, error) in zip(due, records, outcomes, strict=True):
            problem = problem or error
            kept[capture.name] = {"made_from": record, **figures}
            write_json(result_path(project, "decode.json"), {"captures": kept})
        contents_of(project.path).keep()
    if problem is not None:
        raise problem
    return len(due)


def _report(project: Project, states: ProjectStates, progress: Progress) -> str:
    if not calibration_hashes(project):
        return ""
    with suppress(InputError):  # damaged calibrations: told by the stage that could not mend them
        return str(report_project(project, progress=progress).html)
    return ""
