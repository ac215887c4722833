"""Where everything begins: a new project, one that is there, or the demo experiment."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QGridLayout, QListWidget, QListWidgetItem, QPushButton

from stripe_gui.assets import icon
from stripe_gui.pages.page import Page
from stripe_gui.presenters.start import recent_projects
from stripe_gui.widgets.layout import button, card, label
from stripe_gui.workbench import Workbench


class StartPage(Page):
    """The page of an empty window."""

    id = "start"
    needs_project = False
    action_ids = ("file.new", "file.open", "file.demo")

    def __init__(self, bench: Workbench) -> None:
        super().__init__(bench, self.tr("Stripe workbench"), self.tr("From captured stripes to a plane-table report."))
        self._choices = QGridLayout()
        self._choices.setSpacing(16)
        frame, layout = card(self.tr("Recent projects"))
        self.recent = QListWidget()
        self.recent.setAccessibleName(self.tr("Recent projects"))
        self.recent.setFrameShape(QListWidget.Shape.NoFrame)
        self.recent.setIconSize(QSize(20, 20))
        self.recent.itemActivated.connect(self._open)
        self.recent.itemClicked.connect(self._open)
        self.nothing = label(self.tr("Projects you open are listed here."), "muted")
        layout.addWidget(self.recent, 1)
        layout.addWidget(self.nothing)
        layout.addStretch(0)
        self.drop = label(self.tr("You can also drop a project folder onto this window."), "muted")
        self.body.addLayout(self._choices)
        self.body.addWidget(frame, 1)
        self.body.addWidget(self.drop)
        self.bench.session.project_changed.connect(self.refresh)

    def add_action_button(self, action: QAction, icon_name: str = "") -> QPushButton:
        """Give an action a card with its explanation."""
        frame, layout = card()
        made = button(action.text().replace("&", "").rstrip(". …"), action.trigger, "run")
        made.setIcon(action.icon())
        made.setIconSize(QSize(22, 22))
        made.setMinimumHeight(30)
        made.setToolTip(action.toolTip())
        made.setEnabled(action.isEnabled())
        action.enabledChanged.connect(made.setEnabled)
        layout.addWidget(made)
        text = label(action.statusTip(), "muted", wrap=True)
        text.setAlignment(Qt.AlignmentFlag.AlignTop)
        layout.addWidget(text, 1)
        self._choices.addWidget(frame, 0, self._choices.count())
        return made

    def refresh(self) -> None:
        """List the recent projects."""
        self.recent.clear()
        for project in recent_projects(self.session.settings.recent()):
            there = project.problem == ""
            second = str(project.folder) if there else f"{project.folder} – {project.problem}"
            item = QListWidgetItem(icon("folder"), f"{project.name}\n{second}")
            item.setData(Qt.ItemDataRole.UserRole, str(project.folder))
            item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{project.name}, {second}")
            self.recent.addItem(item)
        empty = self.recent.count() == 0
        self.nothing.setVisible(empty)
        self.recent.setVisible(not empty)

    def _open(self, item: QListWidgetItem) -> None:
        folder = Path(item.data(Qt.ItemDataRole.UserRole))
        if not self.bench.open_project(folder) and not folder.exists():
            self.session.settings.remove_recent(folder)
            self.refresh()
