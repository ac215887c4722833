"""The one place that knows the state of everything: what stages read, and whether their results still follow from it.

A result carries the record of what it was made from (`inputs`). Here the record of what is there now is set beside it:
equal is current, otherwise the difference is told in sentences (`states`). Nothing else decides: commands, batch,
window, report and sign-off ask `project_states`.

Stages, what they read, and where their results lie:

    decode       frames, patterns, sizes of the devices           decode.json; later results speak for their captures
    measure      the same, picks, board, rig                      targets.npz, a capture each
    calibrate    the same of many captures, scale, options        runs/NNNN, that current.json points to
    reconstruct  one capture's frames, a calibration              points/NAME.METHOD.npz with its .json
    evaluate     planes' frames and angles, the calibrations      evaluation.npz
    report       rig, calibrations, evaluation, sign-off          report/report.json beside the report's files
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from core.errors import StripeError
from core.model import Capture, Method, Project
from core.pipeline.folders import method_of, result_path
from core.pipeline.measure import BOARDS, side_of
from core.pipeline.methods import METHODS, archives_of, shares
from core.pipeline.options import CalibrateOptions
from core.pipeline.runs import calibration_file, calibration_hashes, read_run, run_folder
from core.pipeline.state.failures import read_failures
from core.pipeline.state.holdings import UNKNOWN, Holdings, reported_now, stored_record
from core.pipeline.state.inputs import (
    Record,
    calibrated_from,
    decoded_from,
    evaluated_from,
    measured_from,
    part_decoded,
    reconstructed_from,
    rig_values,
)
from core.pipeline.state.states import (
    CURRENT,
    STAGES,
    ProjectStates,
    State,
    differences,
    part_of,
    together,
    upstream_words,
    worst,
)
from core.project.archive import read_head
from core.project.contents import hash_value


def project_states(project: Project) -> ProjectStates:
    """Compute the state of every stage of every capture."""
    return Graph(project).states()


class Graph(Holdings):
    """What a project holds, and the states that follow from it."""

    def states(self) -> ProjectStates:
        """Compute everything."""
        by_capture: dict[str, dict[str, State]] = {name: {} for name in self.read}
        single = {
            "decode": {name: self._decode(name) for name in self.read},
            "measure": {
                n: self._measure(n) for n, c in self.captures.items() if c.role in BOARDS and (c.testfield or c.seeds)
            },
        }
        stages = {
            "decode": together(single["decode"], "there are no captures"),
            "measure": together(single["measure"], "there are no captures of a testfield"),
        }
        single["calibrate"], stages["calibrate"] = self._calibrate()
        objects = [n for n, c in self.captures.items() if c.role == "object" or c.name in self.clouds]
        single["reconstruct"] = {name: self._reconstruct(name) for name in objects}
        single["evaluate"], stages["evaluate"] = self._evaluate()
        stages["reconstruct"] = self._reconstruct_all(single["reconstruct"], stages["evaluate"])
        stages["report"] = self._report(stages)
        for stage in STAGES:
            for name, state in single.get(stage, {}).items():
                by_capture.setdefault(name, {})[stage] = state
        self.contents.keep()
        return ProjectStates(self._with_failures({stage: stages[stage] for stage in STAGES}), by_capture)

    def of_results(self) -> ProjectStates:
        """Compute what evaluating and reporting tell of: the calibrations, and the evaluation with its planes."""
        _, calibrate = self._calibrate()
        planes, evaluate = self._evaluate()
        self.contents.keep()
        stages = self._with_failures({"calibrate": calibrate, "evaluate": evaluate})
        return ProjectStates(stages, {name: {"evaluate": state} for name, state in planes.items()})

    def _decode(self, name: str) -> State:
        capture = self.read[name]
        if not isinstance(capture, Capture):
            return State("failed", (str(capture),))
        own = self.decoded.get(capture.name, {})
        records = [own.get("made_from"), *self._records_with(capture.name)]
        parts = [part for record in records if record and (part := part_decoded(record, capture.name))]
        if not parts:
            return State("absent", ("not decoded yet",))
        now = decoded_from(self.project, capture, self.contents)
        if own.get("error") and part_decoded(own.get("made_from") or {}, capture.name) == now:
            return State("failed", (str(own["error"]),))
        return CURRENT if now in parts else State("outdated", differences(parts[0], now))

    def _records_with(self, name: str) -> Iterable[Record]:
        """Give the records of results that a capture had a part in: their makers decoded it."""
        if (record := self.targets[0].get(name)) is not None:
            yield record
        for method, run in self.runs.items():
            if run is not None and method in run.made_from:
                yield run.made_from[method]
        if self.evaluation[0] is not None:
            yield self.evaluation[0]
        yield from filter(None, self.clouds.get(name, {}).values())

    def _measure(self, name: str) -> State:
        capture = self.captures[name]
        records, damage = self.targets
        if damage:
            return State("outdated", (damage,))
        if capture.name not in records:
            return State("absent", ("not measured yet",) if capture.seeds else ("not measured yet, nor picked",))
        then = records[capture.name]
        if then is None:
            return State("outdated", (UNKNOWN,))
        changed = differences(then, measured_from(self.project, capture, self.sides[capture.role], self.contents))
        return State("outdated", changed) if changed else CURRENT

    @cached_property
    def calibrations(self) -> dict[Method, tuple[State, dict[str, State]]]:
        """The state of every calibration that there is or could be, with its captures'."""
        found = shares(self.captures.values(), self.runs)
        states = {method: self._calibration(method, captures) for method, captures in found.items()}
        for method, (state, each) in states.items():
            stale = worst(states[m][0] for m in METHODS[method].reads if m in states and m in self.runs)
            if state == CURRENT and stale.state == "outdated":
                told = State("outdated", upstream_words("a calibration it takes into account", stale))
                states[method] = told, {name: told if own == CURRENT else own for name, own in each.items()}
        return states

    def _calibration(self, method: Method, captures: list[Capture]) -> tuple[State, dict[str, State]]:
        if method not in self.runs:
            state = State("absent", (f"not calibrated by the {method} method yet",))
            return state, dict.fromkeys((c.name for c in captures), state)
        run, damage = self.runs[method], self._damage(method)
        options = run.options if run is not None else CalibrateOptions()
        used = [c for c in captures if c.name not in options.without]
        then = run.made_from.get(method) if run is not None else None
        if damage or then is None:
            state = State("outdated", damage or (f"{method}: {UNKNOWN}",))
            return state, dict.fromkeys((c.name for c in used), state)
        if "imported" in then:
            return State("current", (f"imported from {then['imported']}",)), {}
        runs = {name: run for name in METHODS[method].reads if (run := self.runs.get(name)) is not None}
        read = {name: run.made_from[name] for name, run in runs.items() if name in run.made_from}
        now = calibrated_from(self.project, METHODS[method], used, options, side_of(used), self.contents, read)
        changed = differences(then, now)
        state = State("outdated", changed) if changed else CURRENT
        return state, {c.name: part_of(then, now, c.name) for c in used}

    def _calibrate(self) -> tuple[dict[str, State], State]:
        if not self.calibrations:
            return {}, State("absent", ("it needs captures of a moved testfield, or plates at known depths",))
        each = {name: state for _, states in self.calibrations.values() for name, state in states.items()}
        return each, worst(state for state, _ in self.calibrations.values())

    def of_calibrations(self, methods: Iterable[str]) -> tuple[str, ...]:
        """Say which of the calibrations that a result was made by are outdated themselves."""
        found = worst(state for method, (state, _) in self.calibrations.items() if method in methods)
        self.contents.keep()
        return upstream_words("calibrate", found) if found.state == "outdated" else ()

    def _damage(self, method: Method) -> tuple[str, ...]:
        """Say which archives of the calibration in use are not as they were written."""
        run, wrong = self.runs[method], []
        for name in archives_of(method):
            path = calibration_file(self.project, name)
            if path is None:
                return (f"{name} of the calibration in use is not there",)
            holder = run
            if run is not None and run.holder(method) != run.number:
                holder = read_run(run_folder(self.project, run.holder(method)))
            written = holder.archives.get(name) if holder is not None else None
            told = path.relative_to(self.project.path)
            if written and written != self.contents.of(path):
                wrong.append(f"{told} is not as it was written")
            elif not written:
                try:
                    read_head(path)
                except StripeError as error:
                    wrong.append(f"{told}: {error.seen}")
        return tuple(wrong)

    def _reconstruct(self, name: str) -> State:
        capture = self.captures[name]
        found = [self.points(capture, path) for path in self.clouds.get(capture.name, ())]
        return worst(found) if found else State("absent", ("not reconstructed yet",))

    def points(self, capture: Capture, path: Path) -> State:
        """Compute the state of the points of one capture that are kept in one file, by one method and pair."""
        kept, method = self.clouds.get(capture.name, {}), method_of(path)
        if path not in kept:
            return State("absent", ("not reconstructed yet",))
        then = kept[path]
        if then is None:
            return State("outdated", (UNKNOWN,))
        now = reconstructed_from(self.project, capture, self._hashes([method]), self.contents)
        changed = (*self.of_calibrations([method]), *differences(then, now))
        return State("outdated", changed) if changed else CURRENT

    def _reconstruct_all(self, each: Mapping[str, State], evaluate: State) -> State:
        if each:
            return together(each, "")
        if evaluate.state == "absent":
            return State("absent", ("there are no captures of objects",))
        current = evaluate.state == "current"
        return State(
            evaluate.state, ("the planes, while evaluating",) if current else upstream_words("evaluate", evaluate)
        )

    def _evaluate(self) -> tuple[dict[str, State], State]:
        then, evaluated, damage = self.evaluation
        planes = self.of_role("plane")
        if damage or not evaluated or then is None:
            state = State("outdated", (damage or UNKNOWN,))
            if not damage and not evaluated:
                state = State("absent", ("not evaluated yet",) if planes else ("there are no captures of a plane",))
            return {c.name: state for c in planes}, state
        now, used = self._evaluated_now(then)
        chosen = {c.path for c in used}
        each = {}
        upstream = self.of_calibrations((then.get("options") or {}).get("methods") or METHODS)
        for c in planes:
            state = part_of(then, now, c.name)
            if c.path not in chosen:
                state = State("absent", ("was not chosen to be evaluated",))
            elif upstream and state.state != "absent":
                state = State("outdated", (*upstream, *state.because))
            each[c.name] = state
        changed = (*upstream, *differences(then, now))
        return each, State("outdated", changed) if changed else CURRENT

    def _evaluated_now(self, then: Record) -> tuple[Record, list[Capture]]:
        """Record what an evaluation of the same choice would be made from now, and the planes it would be of."""
        options = then.get("options") or {}
        chosen, methods = options.get("captures"), options.get("methods")
        used = [c for c in self.of_role("plane") if chosen is None or c.name in chosen]
        hashes = self._hashes(METHODS if methods is None else methods)
        return evaluated_from(self.project, used, hashes, (chosen, methods), self.contents), used

    def _hashes(self, methods: Iterable[Method]) -> dict[str, str | None]:
        """Give the hashes of some of the calibrations in use."""
        names = [f"{method} calibration" for method in methods]
        return {name: self._in_use[name] for name in names if name in self._in_use}

    @cached_property
    def _in_use(self) -> dict[str, str | None]:
        """The hashes of all calibrations in use: looked up once, however many captures ask."""
        return calibration_hashes(self.project)

    @cached_property
    def evaluation_fits(self) -> bool:
        """Whether the evaluation is of the planes and calibrations there are, be these outdated themselves or not."""
        then = self.evaluation[0]
        return then is not None and not differences(then, self._evaluated_now(then)[0])

    def _report(self, stages: Mapping[str, State]) -> State:
        folder = result_path(self.project, "report")
        there = [folder / f"report.{kind}" for kind in ("html", "pdf")]
        if not there[0].exists():
            return State("absent", ("not written yet",))
        record = stored_record(folder / "report.json", {path.name: self.contents.of(path) for path in there})
        if isinstance(record, str):
            return State("outdated", (record,))
        changed = differences(record, reported_now(self.project, self.contents))
        upstream = [
            text
            for stage in ("calibrate", "evaluate")
            if stages[stage].state in ("outdated", "failed")
            for text in upstream_words(stage, stages[stage])
        ]
        because = (*dict.fromkeys(upstream), *changed)
        return State("outdated", because) if because else CURRENT

    def _with_failures(self, stages: dict[str, State]) -> dict[str, State]:
        """Tell a failure of the last run, unless its result is there or what the stages read has changed since."""
        failures = read_failures(self.project.path)
        if not any(stage in failures and state.state != "current" for stage, state in stages.items()):
            return stages
        now = self.sign()
        for stage, failure in failures.items():
            if stage in stages and stages[stage].state != "current" and failure.read in ("", now):
                stages[stage] = State("failed", (f"{failure.happened}; {failure.remedy}".removesuffix("; "),))
        return stages

    def sign(self) -> str:
        """Sign everything that people and rigs put into the project: any change of it is worth another try."""
        parts: list[Any] = [rig_values(self.project)]
        for name, capture in self.read.items():
            if not isinstance(capture, Capture):
                parts.append([name, str(capture)])
                continue
            record = measured_from(self.project, capture, "", self.contents)
            parts.append([name, capture.role, capture.z_mm, capture.angle_deg, record["captures"]])
        return hash_value(parts)
