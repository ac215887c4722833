"""The recent projects as they are now."""

from __future__ import annotations

import json
from collections.abc import Iterable
from datetime import date
from pathlib import Path

from core.lazy import dataclass
from stripe_gui.presenters.told import translate


@dataclass(frozen=True)
class RecentProject:
    """A project opened before; `problem` says why it cannot be opened now, empty if it can."""

    folder: Path
    name: str
    problem: str = ""
    facts: str = ""  #: how many captures it has and when something was last written


def recent_projects(folders: Iterable[Path]) -> list[RecentProject]:
    """Look up the names of projects; a glance only, the whole check comes when one is opened."""
    found = []
    for folder in folders:
        try:
            document = json.loads((folder / "project.json").read_text(encoding="utf-8"))
            name = str(document.get("name") or folder.name)
            found.append(RecentProject(folder, name, facts=_facts(folder, len(document.get("captures") or []))))
        except OSError:
            found.append(RecentProject(folder, folder.name, translate("Start", "not there any more")))
        except (ValueError, AttributeError, TypeError):
            found.append(RecentProject(folder, folder.name, translate("Start", "damaged")))
    return found


def _facts(folder: Path, captures: int) -> str:
    places = (folder, folder / "project.json", folder / "captures", folder / "results")
    changed = date.fromtimestamp(max(place.stat().st_mtime for place in places if place.exists()))
    one, many = translate("Start", "1 capture"), translate("Start", "{n} captures").format(n=captures)
    return f"{one if captures == 1 else many}   {changed.isoformat()}"
