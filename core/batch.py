"""Decode, reconstruct and evaluate many captures: on copies of this process, or on the workers of a Dask scheduler.

Each capture is one task, by each camera and projector where there are several. Its results go to ``OUT/NAME/``, or
``OUT/NAME/CAMERA-PROJECTOR/``: ``phase.npz`` (decode), ``points.npz`` (reconstruct),
``evaluation.npz`` (evaluate, plane captures), each written whole or not at all, and last ``figures.json``, which also
says from which state of the inputs they were made. A second run therefore leaves what is up to date and does the rest,
whatever stopped the first. ``OUT/summary.json`` tells of all captures.

A scheduler's workers must see the project and OUT under the same paths.
"""

from __future__ import annotations

import json
import time
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import field, replace
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Literal

from core.atomic import is_leftover
from core.errors import InputError, StripeError
from core.fields import kept_object, text_of
from core.figures import evaluation_figures, phase_figures, verdict_figures
from core.lazy import dataclass
from core.model import Calibration, Capture, Figures, Method, Note, PhaseMap, Project
from core.parallel import limit_threads, on_processes
from core.pipeline import load_calibrations
from core.pipeline.decode import phase_maps, read_phase, write_phase
from core.pipeline.evaluate import covers, judge_plane
from core.pipeline.evidence import points_of, shared_frames
from core.pipeline.folders import find_folder
from core.pipeline.judge import judge_points, said_of
from core.pipeline.reconstruct import write_cloud
from core.pipeline.runs import calibration_hashes
from core.pipeline.state.inputs import decoded_from, evaluated_from, reconstructed_from
from core.progress import SILENT, Progress
from core.project import read_capture, read_project, save_archive, write_json
from core.project.contents import Contents, contents_of, hash_value
from core.project.lock import lock
from core.project.made import FILE as MADE

if TYPE_CHECKING:
    from distributed import Client, Future

Step = Literal["decode", "reconstruct", "evaluate"]
State = Literal["done", "left", "failed", "waiting"]
STEPS: tuple[Step, ...] = ("decode", "reconstruct", "evaluate")
FILES: dict[Step, str] = {"decode": "phase.npz", "reconstruct": "points.npz", "evaluate": "evaluation.npz"}
RETRIES = 2
_VERSION = 1
_ASK_S = 0.25  # how often a waiting batch looks whether to stop
_ANSWER_S = 10.0  # how long a scheduler may take to answer


@dataclass(frozen=True)
class Job:
    """One capture, or the frames of one camera and projector in it, to be worked on."""

    project: Project
    name: str  #: of the capture, and of the pair where it has several
    capture: Capture
    out: Path  #: where its results go
    steps: tuple[Step, ...]  #: what to do, in the order of `STEPS`
    inputs: Mapping[Step, str]  #: for every step, a sign of what it is made from as that was when the batch began
    #: the calibrations and their hashes: a worker reads them again when they changed
    calibrations: tuple[tuple[str, str | None], ...] = ()
    shared: tuple[Note, ...] = ()  #: which of its frames another capture of the project holds, too


@dataclass(frozen=True)
class Outcome:
    """What became of one capture; `figures` holds an entry for every step that has a result."""

    capture: str
    state: State = "waiting"
    seconds: float = 0.0
    figures: Figures = field(default_factory=dict)
    error: str = ""


@dataclass(frozen=True)
class BatchReport:
    """What became of all captures, in the order given."""

    outcomes: tuple[Outcome, ...]
    seconds: float

    def count(self, state: State) -> int:
        """How many captures ended in a state."""
        return sum(outcome.state == state for outcome in self.outcomes)

    def figures(self) -> Figures:
        """The summary as `OUT/summary.json` holds it."""
        captures = []
        for o in self.outcomes:
            row: Figures = {"capture": o.capture, "state": o.state, "seconds": round(o.seconds, 3), **o.figures}
            captures.append({**row, "error": o.error} if o.error else row)
        states: tuple[State, ...] = ("done", "left", "failed", "waiting")
        counts: Figures = {state: self.count(state) for state in states}
        head: Figures = {"format": "stripe-batch", "version": _VERSION, "seconds": round(self.seconds, 3)}
        return {**head, **counts, "captures": captures}


def run_batch(
    project: Project,
    out: Path,
    captures: Sequence[str] = (),
    *,
    steps: Iterable[str] = STEPS,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: Progress = SILENT,
) -> BatchReport:
    """Work on many captures (names or folders; all if none is named); leave those whose results are up to date.

    `steps` are of `STEPS`; planes alone are evaluated. Without a Dask scheduler's address the work is done here, by
    `workers` copies of this process (as many as processors if unsaid) where `core.parallel.can_fork` allows them, else
    one capture after the other. The report is also in ``out / "summary.json"``; a capture that failed is told there and
    stops no other. Cancelling stops what has not begun. An unknown name or step, a missing calibration and a scheduler
    that does not answer, or needs the extra ``batch``, are InputErrors.
    """
    started = time.monotonic()
    chosen = _chosen_steps(steps)
    if workers is not None and workers < 1:
        raise InputError("--workers", f"is {workers}", "give 1 or more")
    project, out = replace(project, path=project.path.resolve()), Path(out).resolve()
    outcomes, jobs = _prepare(project, out, captures, chosen, progress)
    found = _by_scheduler(_client(scheduler), jobs, progress) if scheduler and jobs else _here(jobs, workers, progress)
    try:
        with closing(found):
            for done, outcome in enumerate(found, 1):
                outcomes[outcome.capture] = outcome
                progress(0.02 + 0.98 * done / len(jobs), f"{done} of {len(jobs)}: {outcome.capture} {outcome.state}")
    finally:
        for job in () if scheduler else jobs:
            _sweep(job.out)
        report = BatchReport(tuple(outcomes.values()), time.monotonic() - started)
        write_json(out / "summary.json", report.figures())
    progress(1.0, "the batch is done")
    return report


def _sweep(out: Path) -> None:
    """Remove what copies of this process were writing when they were ended."""
    for part in out.glob(".*.part"):
        if is_leftover(part):
            part.unlink(missing_ok=True)
    if (path := out / f"{MADE}.lock").exists():
        with suppress(StripeError), lock(path, "batch"):
            pass  # it goes with its holder


# ------------------------------------------------------------------------------------------------ what is to be done


def _chosen_steps(steps: Iterable[str]) -> tuple[Step, ...]:
    wanted = list(steps)
    for step in wanted:
        if step not in STEPS:
            raise InputError("--do", f"names {step!r}", f"choose among {', '.join(STEPS)}")
    if not wanted:
        raise InputError("--do", "names no step", f"choose among {', '.join(STEPS)}")
    return tuple(step for step in STEPS if step in wanted)


def _prepare(
    project: Project, out: Path, names: Sequence[str], steps: tuple[Step, ...], progress: Progress
) -> tuple[dict[str, Outcome], list[Job]]:
    """Find the captures and tell those that need work; the others have their outcome already."""
    folders = [find_folder(project, name) for name in names] if names else list(project.captures)
    if not folders:
        raise InputError(project.path, "the project has no captures", "record some first")
    calibrations: dict[str, str | None] = {}
    if set(steps) & {"reconstruct", "evaluate"}:
        load_calibrations(project)
        calibrations = calibration_hashes(project)
    contents = contents_of(project.path)
    outcomes: dict[str, Outcome] = {}
    found: dict[str, Capture | None] = {}
    for folder in folders:
        if folder.name in found:
            seen = f"two are called {folder.name!r}"
            raise InputError("captures", seen, "run them in two batches with an OUT of their own")
        try:
            found[folder.name] = read_capture(folder.resolve(), project)
        except InputError as error:
            found[folder.name] = None
            outcomes[folder.name] = Outcome(folder.name, "failed", error=str(error))
    shared = shared_frames(project, [capture for capture in found.values() if capture])
    jobs = []
    for i, (title, capture) in enumerate(found.items()):
        progress(0.02 * i / len(found), "looking what is to be done")
        if capture is None:
            outcomes[title] = outcomes.pop(title)  # in the order given
            continue
        notes = shared[capture.name]
        each = [(s, _inputs(project, s, calibrations, contents, notes)) for s in capture.series]
        todo = tuple(step for step in steps if step != "evaluate" or capture.role == "plane")
        for series, inputs in each:
            name = title if len(each) == 1 else f"{title}/{series.camera}-{series.projector}"
            job = Job(project, name, series, out / name, todo, inputs, tuple(calibrations.items()), notes)
            ready = _ready(job)
            left = all(step in ready for step in todo)
            outcomes[name] = Outcome(name, "left", figures=ready) if left else Outcome(name)
            if not left:
                jobs.append(job)
    for job in jobs:
        _check_own(job)
    contents.keep()
    return outcomes, jobs


def _inputs(
    project: Project,
    capture: Capture,
    calibrations: Mapping[str, str | None],
    contents: Contents,
    shared: Sequence[str],
) -> dict[Step, str]:
    """Sign what each step is made from, as the stages of a project record it, and what is told of frames shared."""
    contents.learn(frame.place for frame in capture.frames)
    records: dict[Step, Any] = {
        "decode": decoded_from(project, capture, contents),
        "reconstruct": reconstructed_from(project, capture, calibrations, contents),
        "evaluate": evaluated_from(project, [capture], calibrations, contents=contents),
    }
    return {step: hash_value({**record, "shared": shared} if shared else record) for step, record in records.items()}


def _check_own(job: Job) -> None:
    """Refuse a folder that holds a file of a result's name, and is no batch's."""
    if "inputs" in kept_object(job.out / "figures.json"):
        return
    for path in (job.out / name for name in ("figures.json", *FILES.values())):
        if path.exists():
            seen = "is there already, and not as this program wrote it"
            raise InputError(path, seen, "give another --out, or move that file away")


def _ready(job: Job) -> Figures:
    """Figures of the steps whose results are there and made from the inputs as they are."""
    try:
        kept = json.loads(text_of(job.out / "figures.json"))
        inputs = kept["inputs"]
        return {
            step: kept[step]
            for step in STEPS
            if step in kept and inputs[step] == job.inputs[step] and (job.out / FILES[step]).exists()
        }
    except (OSError, ValueError, KeyError, TypeError):
        return {}


# ------------------------------------------------------------------------------------------------- what a worker does


def process(job: Job) -> tuple[Figures, float]:
    """Do what a capture still needs and write it; give the figures and the seconds it took."""
    started = time.monotonic()
    for part in job.out.glob(".*.part"):  # of a worker that was killed while it wrote
        part.unlink(missing_ok=True)
    figures = _ready(job)
    if not (job.out / "figures.json").exists():  # so that what a killed worker leaves is known for a batch's
        write_json(job.out / "figures.json", {"capture": job.name, "inputs": {}})
    if "decode" in figures:
        phase = read_phase(job.out / FILES["decode"])
        phase = replace(phase, camera=job.capture.camera, projector=job.capture.projector)
    else:
        ((_, phase),) = phase_maps(job.project, [job.capture])
        phase = replace(phase, notes=(*job.shared, *phase.notes))
    for step in job.steps:
        if step not in figures:
            figures[step] = _do(step, job, phase)
            inputs = {name: job.inputs[name] for name in STEPS if name in figures}
            write_json(job.out / "figures.json", {"capture": job.name, "inputs": inputs, **figures})
    return figures, time.monotonic() - started


def _do(step: Step, job: Job, phase: PhaseMap) -> Any:
    path = job.out / FILES[step]
    if step == "decode":
        write_phase(path, phase)
        return phase_figures(phase)
    from core.pipeline.methods import METHODS

    found = _read_calibrations(job.project.path, job.calibrations)
    calibrations = {
        name: calibration for name, calibration in found.items() if covers(name, calibration, phase, job.project)
    }
    if not calibrations:
        remedy = "calibrate them; from cameras alone points are made by reconstruct and evaluate"
        raise InputError(job.name, "no calibration is of its devices", remedy)
    if step == "reconstruct":
        method, calibration = next(iter(calibrations.items()))
        with points_of(job.capture, [phase]):
            cloud = METHODS[method].reconstruct(phase, calibration, False, SILENT)
        cloud = judge_points(cloud, {job.name: said_of(job.capture, [phase], calibration)}, method, calibration)
        points = write_cloud(path, phase.image, cloud)
        return {"method": method, "points": points, "verdict": verdict_figures(cloud.verdict)}
    planes = judge_plane(job.project, job.capture, phase, calibrations)
    save_archive(path, planes)
    return evaluation_figures(planes)["planes"]


@lru_cache(maxsize=1)
def _read_calibrations(path: Path, hashes: tuple[tuple[str, str | None], ...]) -> dict[Method, Calibration]:
    return load_calibrations(read_project(path))


# ---------------------------------------------------------------------------------------------------------- who does it


def _here(jobs: Sequence[Job], workers: int | None, progress: Progress) -> Generator[Outcome]:
    """Work on all jobs by copies of this process, or in it."""
    for name in ("core.decode.absolute", "core.verify.stored"):
        import_module(name)  # once, not by every copy

    def work(k: int, said: Progress) -> Outcome:
        said.check()
        try:
            figures, seconds = process(jobs[k])
        except Exception as error:
            return _failed(jobs[k].name, error)
        return Outcome(jobs[k].name, "done", seconds, figures)

    return on_processes(work, len(jobs), progress.quiet(), workers)


def _failed(name: str, error: BaseException) -> Outcome:
    kind = "" if isinstance(error, StripeError) else f"{type(error).__name__}: "
    return Outcome(name, "failed", error=f"{kind}{error}")


def _client(scheduler: str) -> Client:
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError(
            "--scheduler", "the package distributed is not installed", "run pip install 'stripe-workbench[batch]'"
        ) from error
    try:
        return Client(scheduler, timeout=_ANSWER_S)
    except (OSError, ValueError, TypeError, RuntimeError) as error:  # the latter of encryption that Dask requires
        remedy = "start it, or mend its address, or the certificates in Dask's configuration"
        raise InputError("--scheduler", f"{scheduler!r} does not answer", remedy) from error


def _by_scheduler(client: Client, jobs: Sequence[Job], progress: Progress) -> Generator[Outcome]:
    """Give all jobs to a scheduler, and their outcomes as they come."""
    finished: SimpleQueue[Future] = SimpleQueue()
    futures = {}
    for job in jobs:
        future = client.submit(_process_alone, job, pure=False, retries=RETRIES)
        futures[future.key] = future, job.name
        future.add_done_callback(finished.put)
    left = len(jobs)
    try:
        while left:
            progress.check()
            with suppress(Empty):
                future, name = futures[finished.get(timeout=_ASK_S).key]
                if future.status in ("lost", "pending"):  # who held the figures died: another worker is at it again
                    future.add_done_callback(finished.put)
                    continue
                left -= 1
                yield _outcome(name, future)
            if client.status != "running":
                raise StripeError("--scheduler", "the connection is lost", "run the same command again to go on")
    finally:
        if left and client.status == "running":
            client.cancel([future for future, _ in futures.values()], force=True)
        client.close()


def _process_alone(job: Job) -> tuple[Figures, float]:
    """Work on a capture beside others on the same machine."""
    limit_threads(1)
    return process(job)


def _outcome(name: str, future: Future) -> Outcome:
    if future.status == "finished":
        figures, seconds = future.result()
        return Outcome(name, "done", seconds, figures)
    error = future.exception() if future.status == "error" else None
    return _failed(name, error) if error else Outcome(name, "failed", error=f"the scheduler {future.status} it")
