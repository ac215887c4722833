"""Actions as records: menus, shortcuts and the command palette are all made from them.

To add one, put an `Action` into the list that `commands.program_actions` returns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from PySide6.QtCore import QObject
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QMenu, QMenuBar

from core.lazy import dataclass
from stripe_gui.assets import icon
from stripe_gui.workbench import Workbench


def always(_: Workbench) -> bool:
    """For what can be done at any time."""
    return True


def project_open(bench: Workbench) -> bool:
    """For what needs an open project."""
    return bench.session.is_open


def project_idle(bench: Workbench) -> bool:
    """For what needs an open project that no job works on."""
    return bench.session.is_open and not bench.jobs.busy


@dataclass(frozen=True)
class Action:
    """One thing the operator can do."""

    id: str  #: "menu.name": the part before the dot names the menu it stands in
    text: str  #: as in the menu, in the operator's language; "..." at its end says that it asks something first
    slot: Callable[[Workbench], object]  #: does it, given the workbench
    shortcut: str = ""  #: such as "Ctrl+O"; unique
    icon: str = ""  #: a file of resources/icons without its ending
    tip: str = ""  #: one sentence more, shown in the palette and the status line
    group: int = 0  #: groups of a menu are separated by a line
    enabled_when: Callable[[Workbench], bool] = always
    checked_when: Callable[[Workbench], bool] | None = None  #: makes it a switch that shows this state

    @property
    def menu(self) -> str:
        return self.id.partition(".")[0]


class ActionSet(QObject):
    """The QActions of all records; call `update` when the program's state has changed."""

    def __init__(self, records: Iterable[Action], bench: Workbench, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._bench = bench
        self.records: dict[str, Action] = {}
        self._actions: dict[str, QAction] = {}
        for record in records:
            if record.id in self.records:
                raise ValueError(f"two actions are called {record.id}")
            self.records[record.id] = record
            self._actions[record.id] = self._make(record)
        self.update()

    def _make(self, record: Action) -> QAction:
        action = QAction(record.text, self)
        action.setObjectName(record.id)
        action.setStatusTip(record.tip)
        hint = record.text.replace("&", "")
        action.setToolTip(
            f"{hint} ({QKeySequence(record.shortcut).toString(QKeySequence.SequenceFormat.NativeText)})"
            if record.shortcut
            else hint
        )
        if record.shortcut:
            action.setShortcut(QKeySequence(record.shortcut))
        if record.icon:
            action.setIcon(icon(record.icon))
        action.setMenuRole(QAction.MenuRole.QuitRole if record.id == "file.quit" else QAction.MenuRole.NoRole)
        action.setCheckable(record.checked_when is not None)
        action.triggered.connect(lambda: self._run(record))
        return action

    def _run(self, record: Action) -> None:
        record.slot(self._bench)
        self.update()

    def __getitem__(self, identity: str) -> QAction:
        return self._actions[identity]

    def __contains__(self, identity: str) -> bool:
        return identity in self._actions

    def all(self) -> list[QAction]:
        """Give every QAction, in the order of the records."""
        return list(self._actions.values())

    def update(self) -> None:
        """Enable, disable and tick what the program's state asks for."""
        for identity, record in self.records.items():
            action = self._actions[identity]
            action.setEnabled(record.enabled_when(self._bench))
            if record.checked_when is not None:
                action.setChecked(record.checked_when(self._bench))

    def fill(self, bar: QMenuBar, titles: dict[str, str]) -> None:
        """Make the menus of a window; `titles` gives their order and names."""
        unknown = {record.menu for record in self.records.values()} - set(titles)
        if unknown:
            raise ValueError(f"no such menu: {', '.join(sorted(unknown))}")
        for name, title in titles.items():
            records = [record for record in self.records.values() if record.menu == name]
            if not records:
                continue
            menu: QMenu = bar.addMenu(title)
            menu.setObjectName(f"menu.{name}")
            group = None
            for record in sorted(records, key=lambda record: record.group):
                if group is not None and record.group != group:
                    menu.addSeparator()
                group = record.group
                menu.addAction(self._actions[record.id])
