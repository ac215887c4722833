"""The recent projects as they are now."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QCoreApplication


@dataclass(frozen=True)
class RecentProject:
    """A project opened before; `problem` says why it cannot be opened now, empty if it can."""

    folder: Path
    name: str
    problem: str = ""


def recent_projects(folders: Iterable[Path]) -> list[RecentProject]:
    """Look up the names of projects; a glance only, the whole check comes when one is opened."""
    found = []
    for folder in folders:
        try:
            name = json.loads((folder / "project.json").read_text(encoding="utf-8")).get("name")
            found.append(RecentProject(folder, str(name or folder.name)))
        except OSError:
            problem = QCoreApplication.translate("Start", "not there any more")
            found.append(RecentProject(folder, folder.name, problem))
        except (ValueError, AttributeError):
            found.append(RecentProject(folder, folder.name, QCoreApplication.translate("Start", "damaged")))
    return found
