"""The picture of a board as it will be printed."""

from __future__ import annotations

from PySide6.QtCore import QByteArray, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QSizePolicy, QWidget

from core.report.board import Sheet, sheet_svg
from stripe_gui import theme

LINE_COLOUR = "#e5484d"  # seen on black and on white


class SheetView(QWidget):
    """A board as it will be printed; a line joins two targets where they are named."""

    def __init__(self) -> None:
        super().__init__()
        self.setMinimumSize(240, 180)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(self.tr("Picture of the board"))
        self._sheet: Sheet | None = None
        self._drawing = QSvgRenderer(self)
        self._drawing.setAspectRatioMode(Qt.AspectRatioMode.KeepAspectRatio)
        self._ends: tuple[int, int] | None = None
        self._instead = ""

    @property
    def sheet(self) -> Sheet | None:
        return self._sheet

    def show_sheet(self, sheet: Sheet | None, ends: tuple[int, int] | None = None, instead: str = "") -> None:
        """Show a board, or say instead why there is none; `ends` are the indices of two targets to be joined."""
        if sheet is not self._sheet and sheet is not None:
            self._drawing.load(QByteArray(sheet_svg(sheet).encode()))
        self._sheet, self._ends, self._instead = sheet, ends, instead
        self.setAccessibleDescription(sheet.title if sheet is not None else instead)
        self.update()

    def sizeHint(self) -> QSize:  # noqa: N802
        return QSize(460, 360)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        painter = QPainter(self)
        if self._sheet is None:
            painter.setPen(QColor(theme.current().muted))
            flags = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
            painter.drawText(self.rect().adjusted(4, 4, -4, -4), flags, self._instead)
            return
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        colours, sheet = theme.current(), self._sheet
        room = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        unit = min(room.width() / sheet.width_mm, room.height() / sheet.height_mm)
        page = QRectF(0, 0, sheet.width_mm * unit, sheet.height_mm * unit)
        page.moveCenter(room.center())
        self._drawing.render(painter, page)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(QColor(colours.border), 1))
        painter.drawRect(page)
        if self._ends is not None:
            places = [page.topLeft() + QPointF(*sheet.targets_mm[end, :2]) * unit for end in self._ends]
            painter.setPen(QPen(QColor(LINE_COLOUR), 2))
            painter.drawLine(*places)
            for place, end in zip(places, self._ends, strict=True):
                radius = sheet.targets_mm[end, 2] * unit / 2 + 4
                painter.drawEllipse(place, radius, radius)
        painter.end()
