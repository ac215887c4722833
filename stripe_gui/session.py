"""The one object that owns the open project."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject, Signal

from core.errors import InputError
from stripe_gui.presenters.stages import StageStatus
from stripe_gui.settings import Settings

if TYPE_CHECKING:
    from core.evaluate import Line
    from core.model import DeviceSpec
    from stripe_gui.presenters.folder import CaptureEntry, ProjectFolder


class Session(QObject):
    """The open project, the capture the operator looks at, and the state of the stages.

    Everything shown is read from the folder; call `refresh` after something was written there.
    """

    project_changed = Signal()  # another project was opened, or it was closed
    refreshed = Signal()  # files of the project may have changed: show them anew
    capture_changed = Signal(str)  # another capture was chosen

    def __init__(self, settings: Settings, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.settings = settings
        self.folder: ProjectFolder | None = None
        self.capture_name = ""  # of the capture the operator looks at; empty without captures
        self._pair = ("", "")
        self._target: tuple[int, int] | None = None
        self.line: Line | None = None  # of the profiles; None: across the middle
        self.statuses: dict[str, StageStatus] = {}  # of every stage as of the last refresh; empty without a project

    @property
    def opened(self) -> ProjectFolder:
        """The same, where it is known that a project is open."""
        if self.folder is None:
            raise RuntimeError("no project is open")
        return self.folder

    @property
    def is_open(self) -> bool:
        return self.folder is not None

    def open(self, path: Path) -> None:
        """Open the project in a folder (or of its project.json).

        InputError if there is no usable project; the one that was open stays open.
        """
        from stripe_gui.presenters.status import stage_statuses

        folder = self.found(path)
        self.adopt(folder, stage_statuses(folder))

    def found(self, path: Path) -> ProjectFolder:
        """Read the project.json of a folder (or of this name); nothing is opened yet."""
        from stripe_gui.presenters.folder import ProjectFolder  # what reads projects is not needed to begin with

        return ProjectFolder((path.parent if path.name == "project.json" else path).resolve())

    def adopt(self, folder: ProjectFolder, statuses: dict[str, StageStatus]) -> None:
        """Open a project that was looked at."""
        self.folder, self.statuses, self.line = folder, statuses, None
        names = [c.name for c in folder.project.captures]
        self.capture_name = names[0] if names else ""
        self.settings.add_recent(folder.path)
        self.project_changed.emit()

    def close(self) -> None:
        """Close the project; nothing needs saving, every step was."""
        if self.folder is not None:
            self.folder, self.statuses, self.capture_name = None, {}, ""
            self.project_changed.emit()

    def refresh(self) -> None:
        """Look at the folder again; InputError if project.json cannot be used any more: the project is closed then."""
        if self.folder is None:
            return
        from stripe_gui.presenters.status import stage_statuses

        try:
            statuses = stage_statuses(self.folder)
        except InputError:
            self.close()
            raise
        self.take_statuses(self.folder, statuses)

    def take_statuses(self, folder: ProjectFolder, statuses: dict[str, StageStatus]) -> None:
        """Show the open project as it was found."""
        if folder is not self.folder:
            return
        self.statuses = statuses
        names = [c.name for c in folder.project.captures]
        if self.capture_name not in names:
            self.choose_capture(names[0] if names else "")
        self.refreshed.emit()

    @property
    def pair(self) -> tuple[str, str]:
        """The camera and the projector whose frames are looked at."""
        rig = self.opened.project.rig
        return self._pair if self._pair in rig.pairs else rig.usual

    @property
    def pair_names(self) -> tuple[str, ...]:
        """The names of both, none where there are no others."""
        return () if self.opened.project.rig.is_pair else self.pair

    @property
    def projector(self) -> DeviceSpec:
        return self.opened.project.rig.projectors[self.pair[1]]

    def choose_pair(self, pair: tuple[str, str]) -> None:
        """Look at the frames of another camera, or of another projector."""
        if pair != self.pair:
            self._pair = pair
            self.capture_changed.emit(self.capture_name)

    @property
    def capture(self) -> CaptureEntry | None:
        """The same, as read from its folder: the frames of the chosen camera and projector."""
        entry = self.folder.entry(self.capture_name) if self.folder and self.capture_name else None
        if entry is None or entry.capture is None:
            return entry
        return replace(entry, capture=entry.capture.seen_by(*self.pair))

    def choose_capture(self, name: str, target: tuple[int, int] | None = None) -> None:
        """Look at another capture; `target` (row, col) is what the page that comes next shall point at."""
        self._target = target
        if name != self.capture_name:
            self.capture_name = name
            self.capture_changed.emit(name)

    def keep_line(self, line: Line) -> None:
        """Remember the line along which profiles are read."""
        self.line = line

    def take_target(self) -> tuple[int, int] | None:
        target, self._target = self._target, None
        return target
