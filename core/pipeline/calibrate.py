"""Stage 4: the calibrations of a project by all methods, and the adjustment of a network alone."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from core.errors import AdjustmentError, InputError
from core.model import Adjustment, Calibration, Capture, DeviceSpec, Method, PhotogrammetricCalibration, Project
from core.pipeline.decode import taken_together
from core.pipeline.evidence import Evidence
from core.pipeline.folders import all_captures, result_path
from core.pipeline.judge import judge_adjustment, judge_calibrations
from core.pipeline.measure import save_targets, side_of
from core.pipeline.method import ADJUSTMENT, Calibrated
from core.pipeline.methods import METHODS, archives_of, calibration_figures, method_of, shares
from core.pipeline.options import CalibrateOptions, check_options
from core.pipeline.picking import current_target_sets
from core.pipeline.runs import Run, calibration_file, current_run, keep_run, list_runs, now, read_run, run_folder
from core.pipeline.state.inputs import Record, calibrated_from
from core.progress import SILENT, Progress
from core.project import load_archive, read_network
from core.project.contents import hash_file
from core.project.lock import writing_results


def calibrate_project(
    project: Project, method: Method = "all", options: CalibrateOptions | None = None, progress: Progress = SILENT
) -> dict[Method, Calibration]:
    """Calibrate the sensor by one method, or by every method the project has captures for; keep the run.

    What follows from the same captures, picks and rig as before is not computed again: the targets of each capture,
    and each method's calibration.

    Raises
    ------
    InputError
        If there are no captures for it, or the method or an option names something unknown.
    AdjustmentError
        If they do not determine the calibration; those by other methods are kept.
    """
    options = options or CalibrateOptions()
    check_options(project, options)
    everything = all_captures(project)
    captures = captures_for(project, method, options, everything)
    with writing_results(project.path, "calibrate"):
        result = _calibrate(project, everything, captures, options, progress)
    tell_idle(method, options, everything, captures)
    return result


def _calibrate(
    project: Project,
    everything: Sequence[Capture],
    captures: dict[Method, list[Capture]],
    options: CalibrateOptions,
    progress: Progress,
) -> dict[Method, Calibration]:
    kept_sets = current_target_sets(project, everything)
    measured = {t.capture for t in kept_sets}
    records = _records(project, captures, options)  # of what is there before it is read: what changes meanwhile shows
    held: dict[Method, tuple[dict[str, Any], int]] = {}  # the archives of those taken over, and the number of their run
    for name, used in captures.items():
        if measured.issuperset(c.name for c in used) and (kept := _kept(project, name, records[name])) is not None:
            held[name] = kept
    beside = {file: value for own, _ in held.values() for file, value in own.items()}
    due = {name: used for name, used in captures.items() if name not in held}
    found, failures = _calibrated(project, due, options, beside, progress)
    progress.check()
    if failures and not (held or found):
        raise next(iter(failures.values()))
    captures = {name: used for name, used in captures.items() if name not in failures}
    archives: dict[str, object] = {}
    for name, one in found.items():
        archives |= {f"{name}.npz": one.calibration, **one.beside}
    beside |= archives
    done: dict[Method, Any] = {name: beside[f"{name}.npz"] for name in captures}
    targets = [t for one in found.values() for t in one.targets]
    anew = {t.capture for t in targets}
    sets = [*targets, *(t for t in kept_sets if t.capture not in anew)]  # those of captures without a part stay
    if targets:
        save_targets(project, sets)
    roles = {m: METHODS[m].roles for m in captures}
    evidence = Evidence(project, done, beside, captures, options, sets, roles, everything)
    for name, judged in judge_calibrations(evidence).items():
        before, done[name] = done[name], judged
        if (before.verdict, before.left_out) != (judged.verdict, judged.left_out):
            archives |= {**(held.pop(name)[0] if name in held else {}), f"{name}.npz": judged}
    run = Run(
        number=0,
        made_at=now(),
        options=options,
        captures={m: tuple(dict.fromkeys(c.name for c in used)) for m, used in captures.items()},
        excluded={c.name: c.excluded for used in captures.values() for c in used if c.excluded},
        made_from={name: records[name] for name in captures},
        figures=calibration_figures(done),
        held_by={name: number for name, (_, number) in held.items()},
    )
    keep_run(project, run, archives)
    for failure in failures.values():
        others = f"the {' and '.join(done)} calibration is kept"
        raise AdjustmentError(failure.where, failure.seen, f"{failure.remedy}; {others}") from failure
    return done


def _records(
    project: Project, captures: Mapping[Method, list[Capture]], options: CalibrateOptions
) -> dict[Method, Record]:
    """Say what every method's calibration would follow from."""
    records: dict[Method, Record] = {}
    for m, used in captures.items():
        read = {name: record for name in METHODS[m].reads if (record := records.get(name) or _record(project, name))}
        records[m] = calibrated_from(project, METHODS[m], used, options, side_of(used), read=read)
    return records


def _calibrated(
    project: Project,
    due: Mapping[Method, list[Capture]],
    options: CalibrateOptions,
    held: Mapping[str, Any],
    progress: Progress,
) -> tuple[dict[Method, Calibrated], dict[Method, AdjustmentError]]:
    """Calibrate by the methods that are due, and say which failed; `held` are the archives of those taken over."""
    found: dict[Method, Calibrated] = {}
    failures: dict[Method, AdjustmentError] = {}
    there = dict(held)
    parts = dict(zip(due, progress.parts(len(due)), strict=True))
    looks = {name: look(project, due[name], options) for name in due if (look := METHODS[name].looks)}
    with taken_together(project, [*looks.values()], [parts[name].part(0.0, 0.8) for name in looks]) as taken:
        seen = dict(zip(looks, taken, strict=True))
        for name, used in due.items():
            reads = METHODS[name].reads
            earlier = [{k: known for m in reads for k, known in _earlier(project, m, there).items()}] if reads else []
            given = [seen[name], *earlier] if name in seen else earlier
            part = parts[name].part(0.8, 1.0) if name in seen else parts[name]
            try:
                found[name] = METHODS[name].calibrate(project, used, options, part, *given)
            except AdjustmentError as error:
                failures[name] = error
                continue
            there |= {f"{name}.npz": found[name].calibration, **found[name].beside}
    return found, failures


def captures_for(
    project: Project, method: Method, options: CalibrateOptions, everything: Sequence[Capture]
) -> dict[Method, list[Capture]]:
    """Captures of the method asked for; of "all" those of every method that there are captures for."""
    asked = METHODS if method == "all" else {method: method_of(method)}
    captures = [c for c in everything if c.name not in options.without]
    found = shares(captures) if method == "all" else {method: [c for c in captures if asked[method].uses(c)]}
    if not any(found.values()):
        seen, remedies = zip(*(m.none for m in asked.values()), strict=True)
        raise InputError(project.path, ", ".join(seen), ", or ".join(remedies))
    return found


def tell_idle(method: Method, options: CalibrateOptions, captures: Sequence[Capture], used: Collection[Method]) -> None:
    """Name captures that a method asked for has too few of; a refusal says nothing but its own line."""
    for name in (METHODS.keys() if method == "all" else {method}) - {*used}:
        if idle := [c.name for c in captures if c.name not in options.without and METHODS[name].uses(c)]:
            told = "left out: %s: a %s needs %d such captures"
            logging.getLogger(__name__).warning(told, ", ".join(idle), METHODS[name].title, METHODS[name].least)


def _kept(project: Project, method: Method, record: Record) -> tuple[dict[str, Any], int] | None:
    """Give the archives of the calibration in use if it follows from just this, and the number of their run."""
    run = current_run(project, method) if METHODS[method].reused else None
    if run is None or run.made_from.get(method) != record:
        return None
    folder, kinds = run_folder(project, run.holder(method)), archives_of(method)
    holder = read_run(folder)
    if holder is None or any(hash_file(folder / name) != holder.archives.get(name) for name in kinds):
        return None  # not as they were written
    try:
        return {name: load_archive(folder / name, kind) for name, kind in kinds.items()}, holder.number
    except InputError as error:
        logging.getLogger(__name__).warning("%s: %s; calibrated anew", error.where, error.seen)
        return None


def _record(project: Project, method: Method) -> Record | None:
    """Give what the calibration in use follows from."""
    run = current_run(project, method)
    return None if run is None else run.made_from.get(method)


def _earlier(project: Project, method: Method, there: Mapping[str, Any]) -> dict[str, Any]:
    """Give a method's calibration by its name, and by file what lies beside it: of this run, else in use."""
    own = f"{method}.npz"
    kinds = {own: METHODS[method].result, **METHODS[method].beside}
    if own in there:
        found = {name: there.get(name) for name in kinds}
    else:
        found = {name: _in_use(project, method, name, kind) for name, kind in kinds.items()}
    return {method if name == own else name: value for name, value in found.items() if value is not None}


def _in_use(project: Project, method: Method, name: str, kind: type) -> Any:
    """Give an archive of the calibration in use, None where there is none that can be read."""
    path = calibration_file(project, name)
    try:
        return None if path is None or not _record(project, method) else load_archive(path, kind)
    except InputError as error:
        logging.getLogger(__name__).warning("%s: %s; not taken into account", error.where, error.seen)
        return None


def adjust_network(folder: Path, progress: Progress = SILENT) -> Adjustment:
    """Adjust a network of targets that were measured elsewhere."""
    from core.calibrate import adjust
    from core.calibrate.diagnosis.weakness import MirroredError

    try:
        return judge_adjustment(adjust(read_network(folder), progress=progress))
    except MirroredError as error:
        raise InputError(Path(folder) / "observations.csv", f"{error.where}: {error.seen}", error.remedy) from None


def methods_in_use(project: Project) -> list[Method]:
    """Name the methods that the project has a calibration by; an `InputError` if there is none."""
    found = [name for name in METHODS if calibration_file(project, f"{name}.npz") is not None]
    pointer = result_path(project, "current.json")
    if not found and pointer.exists() and list_runs(project):
        remedy = (
            "choose one with `stripe-core runs PROJECT --use N`, or mend it with `stripe-core check PROJECT --repair`"
        )
        raise InputError(pointer, "cannot be read, or names no run that is there", remedy)
    if not found:
        raise InputError(project.path, "the project has no calibration", "run `stripe-core calibrate` on it first")
    return found


def load_calibrations(project: Project) -> dict[Method, Calibration]:
    """Read the calibrations that the project has.

    Those of another camera or projector are named and left out beside a photogrammetric one of the project's devices.

    Raises
    ------
    InputError
        If there is none, or one is of another camera or projector and no photogrammetric one is of the project's.
    """
    found: dict[Method, Calibration] = {}
    others: list[InputError] = []
    for name in methods_in_use(project):
        calibration, other = _read(project, name)
        if other is None:
            found[name] = calibration
        else:
            others.append(other)
    if others and not any(isinstance(one, PhotogrammetricCalibration) for one in found.values()):
        raise others[0]
    for error in others:
        logging.getLogger(__name__).warning("left out: %s", error)
    return found


def _read(project: Project, name: Method) -> tuple[Any, InputError | None]:
    """Read a calibration, and say what is wrong where it is of another rig than project.json describes."""
    path = calibration_file(project, f"{name}.npz")
    assert path is not None
    found: Any = load_archive(path, METHODS[name].result)
    for device, there, then in METHODS[name].devices(project, found):
        if (then.width, then.height, then.pitch_mm) != (there.width, there.height, there.pitch_mm):
            seen = f"is of a {device} of {_size(then)}, the one in project.json has {_size(there)}"
            return found, InputError(path, seen, f"calibrate by {name} again, or correct project.json")
    return found, None


def chosen_calibration(project: Project, method: Method | None = None) -> tuple[Method, Any]:
    """Read the calibration in use of one method, by default of the first that there is; give the method's name too."""
    if method is not None:
        method_of(method)
    there = methods_in_use(project)
    chosen = method or there[0]
    if chosen not in there:
        remedy = f"run `stripe-core calibrate --method {chosen}` first"
        raise InputError(project.path, f"no {chosen} calibration", remedy)
    found, other = _read(project, chosen)
    if other is not None:
        raise other
    return chosen, found


def photogrammetric_calibration(project: Project) -> PhotogrammetricCalibration:
    """Read the calibration in use that is of the devices themselves."""
    for calibration in load_calibrations(project).values():
        if isinstance(calibration, PhotogrammetricCalibration):
            return calibration
    remedy = "run `stripe-core calibrate --method photogrammetric` on it first"
    raise InputError(project.path, "no photogrammetric calibration", remedy)


def load_adjustment(project: Project) -> Adjustment:
    """Read the adjustment that the calibration in use of the devices is of."""
    path = calibration_file(project, ADJUSTMENT) or result_path(project, ADJUSTMENT)
    found: Adjustment = load_archive(path, Adjustment)
    return found


def _size(spec: DeviceSpec) -> str:
    return f"{spec.width} x {spec.height} px of {spec.pitch_mm[0]:g} x {spec.pitch_mm[1]:g} mm"
