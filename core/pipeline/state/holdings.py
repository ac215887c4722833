"""What a project holds: its captures, and the records of what its results were made from; each is read once."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from core.errors import StripeError
from core.fields import kept_object, text_of
from core.model import Capture, Method, Project
from core.pipeline.folders import method_of, result_path
from core.pipeline.measure import BOARDS, side_of
from core.pipeline.method import ADJUSTMENT
from core.pipeline.methods import METHODS
from core.pipeline.runs import Run, calibration_file, calibration_hashes, current_run
from core.pipeline.signed import signed_state
from core.pipeline.state.inputs import Record, reported_from
from core.project import read_capture
from core.project.archive import read_head
from core.project.contents import Look, contents_of, hash_value

UNKNOWN = "it does not say what it was made from: an earlier version of the program made it"


@dataclass
class Holdings:
    """One look at a project."""

    project: Project
    known: Mapping[Path, Capture | StripeError] | None = None  # captures read a moment ago, or why they could not be
    contents: Look = field(init=False)

    def __post_init__(self) -> None:
        self.contents = Look(contents_of(self.project.path))

    @cached_property
    def read(self) -> dict[str, Capture | StripeError]:
        """Every capture by its name, or why it cannot be read; of two of one name the later has its folder's path."""
        found: dict[str, Capture | StripeError] = {}
        for folder in self.project.captures:
            name = folder.name if folder.name not in found else str(folder.relative_to(self.project.path))
            try:
                capture = (self.known or {}).get(folder) or read_capture(folder, self.project)
            except StripeError as error:
                capture = error
            found[name] = capture
        if result_path(self.project, "").is_dir():  # else there is nothing that frames could have changed since
            self.contents.learn(f.place for c in found.values() if isinstance(c, Capture) for f in c.frames)
        return found

    @cached_property
    def captures(self) -> dict[str, Capture]:
        """The captures that can be read."""
        return {name: c for name, c in self.read.items() if isinstance(c, Capture)}

    def of_role(self, *roles: str) -> list[Capture]:
        """Give the captures of some roles."""
        return [c for c in self.captures.values() if c.role in roles]

    @cached_property
    def runs(self) -> dict[Method, Run | None]:
        """The run of every calibration in use; None where it is not known."""
        return {
            m: current_run(self.project, m) for m in METHODS if calibration_file(self.project, f"{m}.npz") is not None
        }

    @cached_property
    def targets(self) -> tuple[dict[str, Record | None], str]:
        """What the kept targets of every capture were made from, and what is wrong with their file."""
        _, sets, damage = self._head("targets.npz")
        return {name: _record(fields.get("made_from")) for name, fields in sets.items()}, damage

    @cached_property
    def evaluation(self) -> tuple[Record | None, set[str], str]:
        """What the evaluation was made from, the planes in it, and what is wrong with its file."""
        record, planes, damage = self._head("evaluation.npz")
        return record, set(planes), damage

    def _head(self, name: str) -> tuple[Record | None, dict[str, dict[str, Any]], str]:
        """Read the record of a result, its fields by capture, and what is wrong with its file."""
        path = result_path(self.project, name)
        try:
            head: dict[str, Any] = read_head(path) if path.exists() else {"value": ()}
            shown = path.with_suffix(".json")  # the same for other programs, written after it
            damage = f"{shown}: is missing" if path.exists() and not shown.exists() else ""
            return head.get("made_from"), {each["fields"]["capture"]: each["fields"] for each in head["value"]}, damage
        except StripeError as error:
            return None, {}, str(error)
        except (TypeError, KeyError, AttributeError):
            return None, {}, f"{path}: damaged"

    @cached_property
    def clouds(self) -> dict[str, dict[Path, Record | None]]:
        """What the points that are kept were made from, by capture and file (`folders.points_file`)."""
        found: dict[str, dict[Path, Record | None]] = {}
        folder = result_path(self.project, "points")
        for path in sorted([*folder.glob("*.npz"), *folder.glob("*/*.npz")]):
            if method_of(path) in METHODS:
                name = path.stem.rpartition(".")[0] if path.parent == folder else path.parent.name
                record = stored_record(path.with_suffix(".json"), {path.name: self.contents.of(path)})
                found.setdefault(name, {})[path] = None if isinstance(record, str) else record
        return found

    @cached_property
    def decoded(self) -> dict[str, Any]:
        """The figures of what was decoded, with its records, by capture."""
        return decoded_figures(self.project)

    @cached_property
    def sides(self) -> dict[str, str]:
        """The side from which the boards of each role are seen."""
        return {role: side_of([c for c in self.captures.values() if c.role == role and c.seeds]) for role in BOARDS}


def decoded_figures(project: Project) -> dict[str, dict[str, Any]]:
    """Read what was decoded for its own sake: figures or an error by capture, each with its record."""
    captures = kept_object(result_path(project, "decode.json")).get("captures")
    return (
        {name: entry for name, entry in captures.items() if isinstance(entry, dict)}
        if isinstance(captures, dict)
        else {}
    )


def reported_now(project: Project, contents: Look | None = None) -> Record:
    """Record what a report would be made from now."""
    contents = contents or Look(contents_of(project.path))
    files = {"evaluation": result_path(project, "evaluation.npz"), "adjustment": calibration_file(project, ADJUSTMENT)}
    hashes = {name: contents.of(path) for name, path in files.items() if path is not None and path.exists()}
    hashes |= {"sign-off": signed} if (signed := signed_state(project)) else {}
    drift = {path.name: contents.of(path) for path in sorted(result_path(project, "drift").glob("*.npz"))}
    hashes |= {"drift chart": hash_value(drift)} if len(drift) > 1 else {}
    merged = result_path(project, "merged.npz")
    hashes |= {"merged captures": contents.of(merged)} if merged.exists() else {}
    return reported_from(project, {**calibration_hashes(project), **hashes})


def stored_record(path: Path, files: Mapping[str, str | None]) -> Record | str:
    """Read a record that lies beside its files; in words what is wrong if it does not fit them."""
    try:
        stored = json.loads(text_of(path))
        record, written = stored["made_from"], stored["files"]
        for name, value in files.items():
            if value != written[name]:
                return f"{name} is {'gone' if value is None else 'not as it was written'}"
        return dict(record)
    except FileNotFoundError:
        return UNKNOWN
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return f"{path.name} is damaged"


def _record(text: Any) -> Record | None:
    try:
        record = json.loads(text)
    except (ValueError, TypeError, RecursionError):
        return None
    return record if isinstance(record, dict) else None
