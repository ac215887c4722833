"""Where a project keeps its captures and results."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Literal

from core.errors import InputError, choose_among
from core.fields import read_document
from core.model import Capture, Method, Project, Role
from core.project import read_capture


def result_path(project: Project, name: str) -> Path:
    """Where the program keeps a result of a project."""
    return project.path / "results" / name


def points_file(project: Project, capture: Capture, method: str, camera: str = "", projector: str = "") -> Path:
    """Where the program keeps the points of a capture; those of further cameras or projectors in a folder beside."""
    if not camera or (camera, projector) == capture.pairs[0]:
        return result_path(project, f"points/{capture.name}.{method}.npz")
    return result_path(project, f"points/{capture.name}/{camera}.{projector}.{method}.npz")


def method_of(points: Path) -> Method:
    """Tell the method that points were made by from the name of their file."""
    return points.stem.rpartition(".")[2]


def captures_of(project: Project, role: Role) -> list[Capture]:
    """Read all captures of one role, in the project's order."""
    return [c for c in (read_capture(folder, project) for folder in project.captures) if c.role == role]


def all_captures(project: Project) -> list[Capture]:
    """Read all captures, in the project's order."""
    return [read_capture(folder, project) for folder in project.captures]


def known_truth(project: Project) -> Mapping[str, Any] | None:
    """Read the truth that the virtual bench leaves beside a project; None where there is none, or a foreign file."""
    try:
        return read_document(project.path / "truth.json", "stripe-truth").data
    except InputError:
        return None


def find_capture(project: Project, name: str) -> Capture:
    """Read the capture that a user named: the folder's name, its path from the project, or its path."""
    return read_capture(find_folder(project, name), project)


def find_folder(project: Project, name: str) -> Path:
    """Give the folder of the capture that a user named, as its project names it, whether it can be read or not."""
    for folder in (*(f for f in project.captures if f.name == name), project.path / name, Path(name)):
        if os.path.isfile(folder / "capture.json"):  # false for any text that cannot be a path, too
            return own_folder(project, folder)
    names = [folder.name for folder in project.captures]
    raise InputError(project.path, f"no capture {name!r}", choose_among(name, names))


def own_folder(project: Project, folder: Path) -> Path:
    """Give a capture's folder as its project names it, however the path was written; other folders as they are."""
    same = [own for own in project.captures if os.path.samefile(own, folder)] if os.path.isdir(folder) else []
    return min(same, key=lambda own: own.name != folder.name, default=folder)  # a link gives a folder two names


def check_names(project: Project, kind: Literal["camera", "projector"], names: Iterable[str]) -> None:
    """Refuse names that the rig's cameras or projectors do not have."""
    known = project.rig.cameras if kind == "camera" else project.rig.projectors
    for name in names:
        if name not in known:
            raise InputError(project.path / "project.json", f"no {kind} {name!r}", choose_among(name, known))
