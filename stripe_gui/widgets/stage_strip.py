"""The seven stages in a row, each with its state as a sign and a word."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFont, QFontMetrics, QPainter, QPen
from PySide6.QtWidgets import QAbstractButton, QHBoxLayout, QSizePolicy, QWidget

from stripe_gui import theme
from stripe_gui.assets import draw_icon
from stripe_gui.presenters.stages import STAGES, StageStatus, State, stage_name, state_word
from stripe_gui.theme import Theme

HEIGHT = 64


class StageButton(QAbstractButton):
    """One stage: click to open its page."""

    def __init__(self, stage: str, number: int) -> None:
        super().__init__()
        self.stage = stage
        self.number = number
        self.status: StageStatus | None = None
        self.running: float | None = None
        self.setCheckable(True)
        self.setAutoExclusive(False)
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAttribute(Qt.WidgetAttribute.WA_Hover)
        self.show_status(None, None)

    def sizeHint(self) -> QSize:  # noqa: N802
        metrics = QFontMetrics(self._bold())
        small = QFontMetrics(self.font())
        widest = max(small.horizontalAdvance(state_word(s)) for s in State)
        return QSize(66 + max(metrics.horizontalAdvance(stage_name(self.stage)), widest), HEIGHT)

    def minimumSizeHint(self) -> QSize:  # noqa: N802
        """Give the same: nothing is ever cut off."""
        return self.sizeHint()

    def show_status(self, status: StageStatus | None, running: float | None) -> None:
        """Show a state; `running` is the fraction done while a job works on this stage."""
        self.status, self.running = status, running
        reason = status.reason if status else ""
        name = stage_name(self.stage)
        self.setAccessibleName(f"{self.number}. {name}: {self.word()}")
        self.setAccessibleDescription(reason)
        self.setToolTip(f"{name}: {self.word()}" + (f" – {reason}" if reason else ""))
        self.update()

    def word(self) -> str:
        if self.running is not None:
            return f"{self.running:.0%}"
        return state_word(self.status.state) if self.status else "–"

    def _bold(self) -> QFont:
        font = QFont(self.font())
        font.setBold(True)
        return font

    def paintEvent(self, _event: object) -> None:  # noqa: N802
        colours = theme.current()
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        body = QRectF(self.rect()).adjusted(3, 6, -3, -6)
        if self.isChecked() or self.underMouse():
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(QColor(colours.surface if self.isChecked() else colours.hover))
            painter.drawRoundedRect(body, 7, 7)
        if self.isChecked():
            painter.setBrush(QColor(colours.accent))
            painter.drawRoundedRect(QRectF(body.left() + 12, body.bottom() - 2, body.width() - 24, 3), 1.5, 1.5)
        if self.hasFocus():
            painter.setPen(QPen(QColor(colours.accent), 1.5))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawRoundedRect(body, 7, 7)
        self._draw_sign(painter, QPointF(body.left() + 24, body.center().y()), colours)
        left = body.left() + 46
        painter.setFont(self._bold())
        painter.setPen(QColor(colours.text if self.isEnabled() else colours.faint))
        middle = body.center().y()
        painter.drawText(QPointF(left, middle - 3), stage_name(self.stage))
        painter.setFont(self.font())
        painter.setPen(QColor(self._state_colour(colours)))
        painter.drawText(QPointF(left, middle + 14), self.word())
        painter.end()

    def _state_colour(self, colours: Theme) -> str:
        if not self.isEnabled() or self.status is None:
            return colours.faint
        if self.running is not None:
            return colours.accent
        return {
            State.DONE: colours.ok,
            State.STALE: colours.warning,
            State.TODO: colours.muted,
            State.FAILED: colours.danger,
        }[self.status.state]

    def _draw_sign(self, painter: QPainter, centre: QPointF, colours: Theme) -> None:
        box = QRectF(centre.x() - 12, centre.y() - 12, 24, 24)
        colour = QColor(self._state_colour(colours))
        if self.running is not None:
            painter.setPen(QPen(QColor(colours.border), 3))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawEllipse(box.adjusted(2, 2, -2, -2))
            painter.setPen(QPen(colour, 3))
            painter.drawArc(box.adjusted(2, 2, -2, -2), 90 * 16, -round(self.running * 360 * 16))
        elif self.status is None or self.status.state is State.TODO:
            painter.setPen(QPen(colour, 1.7))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawEllipse(box.adjusted(2, 2, -2, -2))
            painter.setFont(self._bold())
            painter.drawText(box, Qt.AlignmentFlag.AlignCenter, str(self.number))
        else:
            name = {State.DONE: "success", State.STALE: "refresh", State.FAILED: "error"}[self.status.state]
            draw_icon(painter, name, box, colour)


class StageStrip(QWidget):
    """The road: click a stage to open its page."""

    chosen = Signal(str)

    def __init__(self) -> None:
        super().__init__()
        self.setAccessibleName(self.tr("Stages"))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        layout = QHBoxLayout(self)
        layout.setContentsMargins(12, 0, 12, 0)
        layout.setSpacing(0)
        self.buttons: dict[str, StageButton] = {}
        for number, stage in enumerate(STAGES, 1):
            made = StageButton(stage, number)
            made.clicked.connect(lambda _=False, stage=stage: self.chosen.emit(stage))
            layout.addWidget(made)
            self.buttons[stage] = made

    def show_statuses(self, statuses: dict[str, StageStatus], running: dict[str, float]) -> None:
        """Show the state of every stage and the fraction done of those at work; without a project they are disabled."""
        for stage, made in self.buttons.items():
            made.setEnabled(bool(statuses))
            made.show_status(statuses.get(stage), running.get(stage))

    def show_page(self, page: str) -> None:
        for stage, made in self.buttons.items():
            made.setChecked(stage == page)
