"""Stage 3: the targets of all captures of boards, picked or not."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from core.errors import InputError, NotRecognisedError
from core.figures import targets_figures
from core.model import Capture, PhaseMap, Project, Role, TargetSet, Testfield, named_by
from core.pipeline.decode import Look
from core.pipeline.evidence import because_of, shared_frames
from core.pipeline.folders import all_captures, result_path
from core.pipeline.state.inputs import measured_from
from core.progress import SILENT, Progress
from core.project import load_archive, save_archive, write_json
from core.project.contents import contents_of
from core.project.lock import writing_results

if TYPE_CHECKING:
    from core.measure import Labelling, Turned

Side = Literal["front", "back"]
BOARDS: tuple[Role, ...] = ("testfield", "depth")
TURNED = "its picks name the board turned against the other images: taken as those have it"
UNTOLD = "its turn cannot be told, the board looks the same when turned; pick 4 targets"
UNPLACED = (
    "which of the board's rows and columns are seen cannot be told: outer ones are hidden, or beyond light or image; "
    "pick 4 targets"
)


def measure_project(project: Project, progress: Progress = SILENT) -> tuple[TargetSet, ...]:
    """Measure the targets of all captures of boards, and keep them in the project.

    What was measured before from the same frames, picks, board and rig is taken as it is. A capture whose board is not
    recognised has no targets, and says why.
    """
    captures = boards_of(project)
    if not captures:
        raise InputError(project.path, "no capture names a testfield", "capture a board with targets")
    with writing_results(project.path, "measure"):
        targets = measured_targets(project, captures, progress)
        save_targets(project, targets)
    return tuple(targets)


def boards_of(project: Project, captures: Sequence[Capture] | None = None) -> list[Capture]:
    """Give all captures of boards with targets; `captures` are all of the project, where they have been read."""
    captures = all_captures(project) if captures is None else captures
    found = [c for c in captures if c.testfield is not None or c.seeds]
    return [c for role in BOARDS for c in found if c.role == role]


def common_testfield(captures: Sequence[Capture]) -> Testfield:
    """Give the one board of some captures; refuse those that name another one than most do."""
    fields = [(c, c.testfield, c.testfield.index() if c.testfield else None) for c in captures]
    keys = [index for _, _, index in fields]
    usual, board, common = max(fields, key=lambda entry: (entry[1] is not None, keys.count(entry[2])))
    for capture, own, index in fields:
        if own is None:
            raise InputError(capture.path / "capture.json", "no testfield", 'name the board in "testfield"')
        if index != common:
            seen, role = f"another testfield than {usual.name}", capture.role
            raise InputError(capture.path / "capture.json", seen, f"use one board in all captures of role {role}")
    assert board is not None
    return board


def measured_targets(project: Project, captures: Sequence[Capture], progress: Progress = SILENT) -> list[TargetSet]:
    """Measure the targets of captures, or take what was measured before where nothing has changed since.

    InputError if picks contradict each other, or not one of the captures can be measured: the first one's reason.
    """
    targets: list[TargetSet] = look_at_boards(project, captures).taken(project, progress)
    return targets


def look_at_boards(project: Project, captures: Sequence[Capture]) -> Look:
    """Say what is to be decoded for that, and how targets come of it."""
    import core.checks  # noqa: F401  once, not by every process that measures
    from core.measure import SAME, labellings

    sides = sides_of(captures)
    signs = signs_of(project, captures, sides)
    series = [one for capture in captures for one in capture.series]
    found = {(t.made_from, t.camera, t.projector): t for t in kept_targets(project) if len(t.row)}

    def key(one: Capture) -> tuple[str, str, str]:
        return signs[one.path], one.camera, one.projector

    ways: dict[tuple[str, str, str], Sequence[Labelling]] = {}
    for c in series:
        kept = found.get(key(c))
        may_be = labellings(c.testfield) if c.testfield is not None else ()
        ways[key(c)] = (SAME,) if kept is not None and kept.told else may_be

    def each(capture: Capture, phase: PhaseMap) -> tuple[TargetSet, Sequence[Labelling], NotRecognisedError | None]:
        try:
            return measured_or_why(capture, phase, project, sides[capture.role])
        except InputError:
            with because_of(shared_frames(project, [capture])):
                raise

    def whole(decoded: Iterable[tuple[Capture, Any]]) -> list[TargetSet]:
        failures: dict[tuple[str, str], NotRecognisedError] = {}
        for capture, (targets, ways[key(capture)], failure) in decoded:
            if failure:
                failures.setdefault((capture.camera, capture.projector), failure)
            found[key(capture)] = replace(targets, made_from=signs[capture.path])
        for pair, failure in failures.items():
            if not any(len(found[key(c)].row) for c in series if (c.camera, c.projector) == pair):
                raise failure
        order = {capture.name: k for k, capture in enumerate(captures)}
        told = turned_together(series, [found[key(c)] for c in series], [ways[key(c)] for c in series])
        return sorted(told, key=lambda t: order[t.capture])

    return Look([c for c in series if key(c) not in found], each, whole)


def measured_or_why(
    capture: Capture, phase: PhaseMap, project: Project, side: Side
) -> tuple[TargetSet, Sequence[Labelling], NotRecognisedError | None]:
    """Measure one decoded capture; where its board is not recognised, give no targets and why."""
    from core.checks import exchanged_notes
    from core.measure import SAME, unmeasured

    of_board = exchanged_notes(capture.testfield) if capture.testfield is not None else ()
    try:
        with because_of({capture.name: (*phase.notes, *of_board)}):
            return *measured_capture(capture, phase, project, side), None
    except NotRecognisedError as error:
        assert capture.testfield is not None
        why = f"{error.seen}; {error.remedy}"
        nothing = _named(replace(unmeasured(capture.testfield, capture.name, why), notes=phase.notes), capture)
        return nothing, (SAME,), error


def measured_capture(
    capture: Capture, phase: PhaseMap, project: Project, side: Side
) -> tuple[TargetSet, Sequence[Labelling]]:
    """Measure one decoded capture, from its picks or without; give the labellings that the targets allow, too."""
    from core.measure import OUTSIDE, labellings, measure_targets, recognise

    field, camera = capture.testfield, project.rig.cameras[capture.camera]
    if field is None:
        raise InputError(capture.path / "capture.json", "picks, but no testfield", 'name the board in "testfield"')
    how: dict[str, Any] = {
        "projector": project.rig.projectors[capture.projector],
        "capture": str(capture.path),
        "excluded": capture.excluded,
        "side": side,
    }
    if capture.seeds:
        targets, ways = measure_targets(phase, field, capture.seeds, camera, **how), labellings(field)
    else:
        targets, ways = recognise(phase, field, camera, **how)
        targets = replace(targets, told=len(ways) == 1)
    lacking = sum(target.reason != OUTSIDE for target in targets.missing)
    dark = len(targets.row) > lacking  # a black board between dots that decode
    said = (note for note in phase.notes if not (dark and named_by(note) == "light"))
    told = replace(targets, notes=(*said, *targets.notes), response=phase.response, gaps=phase.gaps)
    return _named(told, capture), ways


def turned_together(
    captures: Sequence[Capture], targets: Sequence[TargetSet], ways: Sequence[Sequence[Labelling]]
) -> list[TargetSet]:
    """Tell the turns of all captures of one board together, those by all cameras and projectors."""
    from core.measure import placed, solve_turns, unmeasured

    result = list(targets)
    boards: dict[bytes, list[int]] = {}
    for k, capture in enumerate(captures):
        if capture.testfield is not None and len(targets[k].row):
            t = capture.testfield
            boards.setdefault(t.xyz_mm.tobytes() + t.row.tobytes() + t.col.tobytes(), []).append(k)
    for members in boards.values():
        field = captures[members[0]].testfield
        assert field is not None
        picked = [bool(captures[k].seeds) for k in members]
        solved = solve_turns([targets[k] for k in members], [ways[k] for k in members], field, picked)
        solved = _shifted_alike([captures[k] for k in members], solved, [ways[k] for k in members], field)
        for k, turned in zip(members, solved, strict=True):
            if turned.told and turned.choice and captures[k].seeds:
                notes = (*turned.targets.notes, TURNED)
                result[k] = replace(turned.targets, notes=tuple(dict.fromkeys(notes)))
            elif turned.told or captures[k].seeds:
                result[k] = turned.targets
            else:
                why = UNTOLD if placed(ways[k], field) else UNPLACED
                untold = replace(unmeasured(field, captures[k].name, why), made_from=targets[k].made_from)
                result[k] = _named(untold, captures[k])
    return result


def _shifted_alike(
    captures: Sequence[Capture], solved: Sequence[Turned], ways: Sequence[Sequence[Labelling]], field: Testfield
) -> list[Turned]:
    """Label images of a depth plate, whose turn is not told, as its other positions have it: it is shifted, not turned.

    If none is told, they are labelled as the first one: a plate that only one camera saw, and only at positions, has no
    other image to contradict, and its nominal places are the same either way.
    """
    from core.measure import placed, unturned

    result = list(solved)
    sure = [k for k, one in enumerate(solved) if captures[k].role == "depth" and (one.told or captures[k].seeds)]
    whole = [k for k, of in enumerate(ways) if placed(of, field)]
    if not sure and whole and {c.role for c in captures} == {"depth"} and len({c.camera for c in captures}) == 1:
        sure = whole[:1]
        result[sure[0]] = replace(solved[sure[0]], told=True)
    for k, one in enumerate(solved):
        beside = next((i for i in sure if captures[i].camera == captures[k].camera), None)
        if result[k].told or captures[k].seeds or captures[k].role != "depth" or beside is None:
            continue
        named = unturned(one.targets, ways[k], result[beside].targets, field)
        if named is not None:
            result[k] = replace(one, targets=named, told=True)
    return result


def signs_of(project: Project, captures: Sequence[Capture], sides: Mapping[Role, Side]) -> dict[Path, str]:
    """Record what the targets of captures follow from, as one text each, by the captures' folders."""
    contents = contents_of(project.path)
    contents.learn(frame.place for c in captures for frame in c.frames)
    signs = {
        c.path: json.dumps(measured_from(project, c, sides[c.role], contents), separators=(",", ":")) for c in captures
    }
    contents.keep()
    return signs


def kept_targets(project: Project) -> tuple[TargetSet, ...]:
    """Give the targets that the project keeps; none where the file is missing or damaged."""
    try:
        path = result_path(project, "targets.npz")
        kept: tuple[TargetSet, ...] = load_archive(path, tuple, TargetSet) if path.exists() else ()
    except InputError as error:
        logging.getLogger(__name__).warning("%s: %s; measured anew", error.where, error.seen)
        return ()
    return kept


def save_targets(project: Project, targets: Sequence[TargetSet]) -> None:
    """Keep measured targets in the project, for the program and as JSON."""
    save_archive(result_path(project, "targets.npz"), tuple(targets))
    write_json(result_path(project, "targets.json"), targets_figures(targets))


def sides_of(captures: Sequence[Capture]) -> dict[Role, Side]:
    """Give the side from which the boards of each role are seen, see `side_of`."""
    sides = {role: side_of([c for c in captures if c.role == role]) for role in BOARDS}
    return {**sides, "object": sides["testfield"]}  # targets beside an object


def side_of(captures: list[Capture]) -> Side:
    """From which side of its nominal frame most picks show a board; picks that show the other are then refused.

    The nominal frame may have its Z axis towards the viewer (y up) or away from him (y down): both are in use.
    """
    votes = 0
    for capture in (series for c in captures for series in c.series):
        if capture.testfield is not None and len(capture.seeds) >= 4:
            known = capture.testfield.index()
            if all((seed.row, seed.col) in known for seed in capture.seeds):
                votes += 1 if capture.testfield.side_seen(capture.seeds) == "front" else -1
    return "front" if votes >= 0 else "back"


def _named(targets: TargetSet, capture: Capture) -> TargetSet:
    """Say of which capture, camera and projector targets are."""
    return replace(targets, capture=capture.name, camera=capture.camera, projector=capture.projector)
