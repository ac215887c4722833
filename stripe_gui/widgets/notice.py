"""Notices: what happened, what to do, the details folded away."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import QEvent, QObject, QRectF, QSize, Qt, QTimer
from PySide6.QtGui import QFontDatabase, QGuiApplication, QPainter
from PySide6.QtWidgets import QFrame, QHBoxLayout, QPlainTextEdit, QStackedWidget, QVBoxLayout, QWidget

from stripe_gui import theme
from stripe_gui.assets import draw_icon
from stripe_gui.presenters.told import sentence, translate
from stripe_gui.widgets.layout import MARGIN, button, column, label, row, tool
from stripe_gui.workbench import Notice

MOST = 3
SHORT_LIVED_MS = 8000
WIDEST = 620  # px
FOOT = 72  # px below the notices: a wizard's Back and Next stay free


class Sign(QWidget):
    """An icon in a colour of the theme, such as "ok" or "danger"."""

    def __init__(self, name: str, colour: str, size: int = 20) -> None:
        super().__init__()
        self._name, self._colour, self._size = name, colour, size
        self.setFixedSize(size, size)

    def take(self, name: str, colour: str) -> None:
        self._name, self._colour = name, colour
        self.update()

    def sizeHint(self) -> QSize:  # noqa: N802
        return QSize(self._size, self._size)

    def paintEvent(self, _event: object) -> None:  # noqa: N802
        painter = QPainter(self)
        draw_icon(painter, self._name, QRectF(self.rect()), getattr(theme.current(), self._colour))
        painter.end()


COLOURS = {"info": "accent", "success": "ok", "warning": "warning", "error": "danger"}


class NoticeBox(QFrame):
    """One notice; the operator can unfold and copy its details and put it away."""

    def __init__(self, notice: Notice) -> None:
        super().__init__()
        self.notice = notice
        self.setProperty("notice", notice.kind)
        self.setAccessibleName(f"{_word(notice.kind)}: {notice.happened} {notice.remedy}".strip())
        words = column(label(sentence(notice.happened), wrap=True, bold=bool(notice.remedy)), spacing=2)
        if notice.remedy:
            words.addWidget(label(f"{sentence(notice.remedy).removesuffix('.')}.", wrap=True))
        top = row()
        top.addWidget(Sign(notice.kind, COLOURS[notice.kind]), 0, Qt.AlignmentFlag.AlignTop)
        top.addLayout(words, 1)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(14, 10, 10, 10)
        layout.addLayout(top)
        self.details: QPlainTextEdit | None = None
        if notice.details:
            self._add_details(top, layout)
        self.close_button = tool("close", self.tr("Put this notice away"), self.dismiss)
        top.addWidget(self.close_button, 0, Qt.AlignmentFlag.AlignTop)

    def _add_details(self, top: QHBoxLayout, layout: QVBoxLayout) -> None:
        self.details = QPlainTextEdit(self.notice.details)
        self.details.setReadOnly(True)
        self.details.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        self.details.setFixedHeight(160)
        self.details.setAccessibleName(self.tr("Details"))
        self.details.hide()
        layout.addWidget(self.details)
        unfold = button(self.tr("Details"), lambda: None, flat=True)
        unfold.setCheckable(True)
        unfold.toggled.connect(self.details.setVisible)
        copy = button(self.tr("Copy"), self._copy, flat=True)
        unfold.toggled.connect(copy.setVisible)
        copy.hide()
        top.addWidget(copy, 0, Qt.AlignmentFlag.AlignTop)
        top.addWidget(unfold, 0, Qt.AlignmentFlag.AlignTop)

    def _copy(self) -> None:
        notice = self.notice
        QGuiApplication.clipboard().setText(f"{notice.happened}\n{notice.remedy}\n\n{notice.details}")

    def dismiss(self) -> None:
        self.hide()
        self.deleteLater()


def _word(kind: str) -> str:
    return {
        "info": translate("NoticeBox", "Note"),
        "success": translate("NoticeBox", "Done"),
        "warning": translate("NoticeBox", "Warning"),
        "error": translate("NoticeBox", "Error"),
    }[kind]


class NoticeArea(QWidget):
    """The notices, the latest on top: they lie over the lower part of a page and move nothing under the mouse."""

    def __init__(self, over: QStackedWidget) -> None:
        super().__init__(over)
        self._layout = column(spacing=8)
        self.setLayout(self._layout)
        over.installEventFilter(self)
        over.currentChanged.connect(self._place)  # a page that comes to the front is raised
        self.hide()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        if event.type() == QEvent.Type.Resize:
            self._place()
        return super().eventFilter(watched, event)

    def event(self, event: QEvent) -> bool:
        done = super().event(event)
        if event.type() == QEvent.Type.LayoutRequest:
            self._place()
        return done

    def _place(self) -> None:
        over = self.parentWidget()
        if over is None or self.isHidden():
            return
        width = min(WIDEST, over.width() - 2 * MARGIN)
        room = over.height() - FOOT - MARGIN
        height = min(self._layout.totalHeightForWidth(width), room)
        self.setGeometry((over.width() - width) // 2, over.height() - FOOT - height, width, height)
        self.raise_()

    def boxes(self) -> list[NoticeBox]:
        items = (self._layout.itemAt(i) for i in range(self._layout.count()))
        found = (item.widget() for item in items if item is not None)
        return [box for box in found if isinstance(box, NoticeBox) and not box.isHidden()]

    def show_notice(self, notice: Notice) -> None:
        """Add a notice; what is said already is not said twice, good news goes by itself."""
        for box in self.boxes():
            if replace(box.notice, details=notice.details) == notice:
                box.dismiss()
        box = NoticeBox(notice)
        self._layout.insertWidget(0, box)
        box.destroyed.connect(self._hide_if_empty)
        box.close_button.clicked.connect(self._hide_if_empty)
        if notice.kind in ("info", "success"):
            QTimer.singleShot(SHORT_LIVED_MS, box, box.dismiss)
        for old in self.boxes()[MOST:]:
            old.dismiss()
        self.show()
        self._place()

    def clear(self) -> None:
        for box in self.boxes():
            box.dismiss()
        self._hide_if_empty()

    def _hide_if_empty(self) -> None:
        try:
            self.setVisible(bool(self.boxes()))
        except RuntimeError:  # the area itself is being destroyed with its notices
            return
