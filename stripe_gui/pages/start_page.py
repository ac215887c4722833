"""Where everything begins: a new project, one that is there, or the demo experiment."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QAction, QColor, QKeySequence, QPainter, QShortcut
from PySide6.QtWidgets import (
    QGridLayout,
    QListWidget,
    QListWidgetItem,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
)

from stripe_gui import theme
from stripe_gui.assets import draw_icon
from stripe_gui.pages.page import Page
from stripe_gui.presenters.start import RecentProject, recent_projects
from stripe_gui.widgets.layout import action_button, card, label, row
from stripe_gui.workbench import Workbench

PROJECT = Qt.ItemDataRole.UserRole
PAD, ICON = 10, 20


class StartPage(Page):
    """The page of an empty window."""

    id = "start"
    needs_project = False
    action_ids = ("file.new", "file.open", "file.demo")

    def __init__(self, bench: Workbench) -> None:
        super().__init__(bench, self.tr("Stripe workbench"), self.tr("From captured stripes to a plane-table report."))
        self._choices = QGridLayout()
        self._choices.setSpacing(16)
        self.recent = QListWidget()
        self.recent.setAccessibleName(self.tr("Recent projects"))
        self.recent.setItemDelegate(_RecentDelegate(self.recent))
        self.recent.setMouseTracking(True)
        self.recent.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.recent.setFrameShape(QListWidget.Shape.NoFrame)
        self.recent.itemActivated.connect(self._open)
        self.recent.itemClicked.connect(self._open)
        forget = QShortcut(QKeySequence(Qt.Key.Key_Delete), self.recent)
        forget.setContext(Qt.ShortcutContext.WidgetShortcut)
        forget.activated.connect(self._forget)
        self.nothing = label(
            self.tr("Projects you open are listed here. Without a rig, begin with the demo experiment."),
            "muted",
            wrap=True,
        )
        self._frame = card((self.recent, 1), self.nothing, title=self.tr("Recent projects"))
        self.drop = label(self.tr("A project folder can also be dropped onto this window."), "muted")
        self.keys = label(self.tr("Enter opens a project, Delete takes it off the list."), "muted")
        self.body.addLayout(self._choices)
        self.body.addWidget(self._frame, 1)
        self.body.addLayout(row(self.drop, None, self.keys))
        self.body.addStretch(0)
        self.bench.session.project_changed.connect(self.refresh)

    def add_action_button(self, action: QAction) -> None:
        """Give an action a card with its shortcut and its explanation."""
        made = action_button(action, action.text().rstrip(". …"))
        made.setIconSize(QSize(22, 22))
        made.setMinimumHeight(30)
        keys = action.shortcut().toString(QKeySequence.SequenceFormat.NativeText)
        text = label(action.statusTip(), "muted", wrap=True)
        text.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._choices.addWidget(card(made, (text, 1), label(keys, "muted")), 0, self._choices.count())

    def refresh(self) -> None:
        self.recent.clear()
        for project in recent_projects(self.session.settings.recent()):
            item = QListWidgetItem(project.name)
            item.setData(PROJECT, project)
            second = f"{project.folder}, {project.problem or project.facts}"
            item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{project.name}, {second}")
            item.setToolTip(str(project.folder))
            self.recent.addItem(item)
        empty = self.recent.count() == 0
        self.nothing.setVisible(empty)
        self.recent.setVisible(not empty)
        self.keys.setVisible(not empty)
        self.body.setStretchFactor(self._frame, 0 if empty else 1)
        self.body.setStretch(self.body.count() - 1, 1 if empty else 0)

    def _open(self, item: QListWidgetItem) -> None:
        folder = item.data(PROJECT).folder
        if not self.bench.open_project(folder) and not folder.exists():
            self._take_off(folder)

    def _forget(self) -> None:
        item = self.recent.currentItem()
        if item is not None:
            self._take_off(item.data(PROJECT).folder)

    def _take_off(self, folder: Path) -> None:
        self.session.settings.remove_recent(folder)
        self.refresh()


class _RecentDelegate(QStyledItemDelegate):
    """Draws a project: name and facts above, folder or problem below."""

    def sizeHint(self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex) -> QSize:  # noqa: N802
        return QSize(200, 2 * option.fontMetrics.lineSpacing() + 2 * PAD)

    def paint(
        self, painter: QPainter, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex
    ) -> None:
        project: RecentProject = index.data(PROJECT)
        colours, rect, high = theme.current(), option.rect, option.fontMetrics.lineSpacing()
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        chosen = option.state & QStyle.StateFlag.State_Selected
        if chosen or option.state & QStyle.StateFlag.State_MouseOver:
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(colours.selection if chosen else colours.hover))
            painter.drawRoundedRect(rect, 5, 5)
        picture = QRectF(rect.left() + PAD, rect.center().y() - ICON / 2, ICON, ICON)
        draw_icon(painter, "warning" if project.problem else "folder", picture, colours.muted)
        words = rect.adjusted(ICON + 2 * PAD, PAD, -PAD, -PAD)
        above, below = QRect(words), QRect(words)
        above.setHeight(high)
        below.setTop(words.top() + high)
        painter.setPen(QColor(colours.muted))
        right = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        painter.drawText(above, right, project.facts)
        folder = f"{project.problem}: {project.folder}" if project.problem else str(project.folder)
        elided = option.fontMetrics.elidedText(folder, Qt.TextElideMode.ElideMiddle, below.width())
        painter.drawText(below, Qt.AlignmentFlag.AlignVCenter, elided)
        above.setRight(above.right() - option.fontMetrics.horizontalAdvance(project.facts) - 2 * PAD)
        font = option.font
        font.setBold(True)
        painter.setFont(font)
        painter.setPen(QColor(colours.muted if project.problem else colours.text))
        name = painter.fontMetrics().elidedText(project.name, Qt.TextElideMode.ElideRight, above.width())
        painter.drawText(above, Qt.AlignmentFlag.AlignVCenter, name)
        painter.restore()
