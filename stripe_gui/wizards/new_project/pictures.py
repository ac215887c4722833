"""The pictures of the new-project wizard: a plan of the rig, and a board as it will be printed."""

from __future__ import annotations

from math import atan2, degrees

from PySide6.QtCore import QByteArray, QPointF, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QSizePolicy, QWidget

from core.report.board import Sheet, sheet_svg
from stripe_gui import theme
from stripe_gui.presenters.rig_view import Cover, RigView

EDGE = 10.0  # px round a picture
LINE_COLOUR = "#e5484d"  # seen on black and on white


def _say_instead(painter: QPainter, room: QRect, words: str) -> None:
    """Say why there is no picture."""
    painter.setPen(QColor(theme.current().muted))
    flags = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
    painter.drawText(room.adjusted(4, 4, -4, -4), flags, words)


class RigSketch(QWidget):
    """A plan of camera and projector with their fields of view, to scale."""

    def __init__(self) -> None:
        super().__init__()
        self.setMinimumSize(260, 200)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(self.tr("Sketch of the rig"))
        self._view: RigView | None = None
        self._distance_mm = 0.0
        self._instead = ""

    def show_view(self, view: RigView | None, distance_mm: float, instead: str = "") -> None:
        """Draw a rig, or say instead why there is none."""
        self._view, self._distance_mm, self._instead = view, distance_mm, instead
        self.update()

    def sizeHint(self) -> QSize:  # noqa: N802
        """Give the size the sketch likes best."""
        return QSize(460, 360)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        """Draw the object plane above, the devices below, their rays between."""
        painter = QPainter(self)
        if self._view is None:
            _say_instead(painter, self.rect(), self._instead)
            return
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        view, colours = self._view, theme.current()
        self._find_scale(view)
        named = (
            (view.camera, self.tr("camera"), colours.mark),
            (view.projector, self.tr("projector"), colours.mark_other),
        )
        for cover, _, colour in named:
            self._draw_rays(painter, cover, QColor(colour))
        self._draw_plane(painter, view, QColor(colours.text))
        self._draw_measures(painter, view, QColor(colours.muted))
        for cover, name, colour in named:
            self._draw_device(painter, cover, name, QColor(colour))
        painter.end()

    def _find_scale(self, view: RigView) -> None:
        """Fit everything into the widget, with room for words above and below."""
        covers = (view.camera, view.projector)
        wide = max(max(abs(x) for x in (*cover.reach_mm, cover.at_mm[0])) for cover in covers)
        words = self.fontMetrics().height() + 8.0
        room = QRectF(self.rect()).adjusted(EDGE + 30, EDGE + words, -EDGE - 30, -EDGE - 2 * words - 14)
        high = view.camera.at_mm[1]
        self._unit = min(room.width() / (2 * wide), room.height() / high)
        self._origin = QPointF(room.center().x(), room.center().y() - self._unit * high / 2)

    def _at(self, x_mm: float, y_mm: float) -> QPointF:
        return self._origin + QPointF(x_mm, y_mm) * self._unit

    def _draw_rays(self, painter: QPainter, cover: Cover, colour: QColor) -> None:
        fill = QColor(colour)
        fill.setAlpha(40)
        painter.setPen(QPen(colour, 1.2))
        painter.setBrush(fill)
        ends = [self._at(x, 0) for x in cover.reach_mm]
        painter.drawPolygon(QPolygonF([self._at(*cover.at_mm), *ends]))

    def _draw_plane(self, painter: QPainter, view: RigView, colour: QColor) -> None:
        """The object plane, thick where both devices see it."""
        left = max(view.camera.reach_mm[0], view.projector.reach_mm[0])
        right = min(view.camera.reach_mm[1], view.projector.reach_mm[1])
        ends = [*view.camera.reach_mm, *view.projector.reach_mm]
        painter.setPen(QPen(colour, 1))
        painter.drawLine(self._at(min(ends), 0), self._at(max(ends), 0))
        middle = self._at((left + right) / 2, 0)
        if view.common_mm > 0:
            painter.setPen(QPen(colour, 4))
            painter.drawLine(self._at(left, 0), self._at(right, 0))
            painter.setPen(colour)
            text = self.tr("{common:.0f} mm in common").format(common=view.common_mm)
            where = QRectF(middle.x() - 150, middle.y() - painter.fontMetrics().height() - 6, 300, 20)
            painter.drawText(where, Qt.AlignmentFlag.AlignHCenter, text)

    def _draw_measures(self, painter: QPainter, view: RigView, colour: QColor) -> None:
        """Both axes with the working distance and their angle, and the base."""
        painter.setPen(QPen(colour, 1, Qt.PenStyle.DashLine))
        origin, left, right = self._at(0, 0), self._at(*view.camera.at_mm), self._at(*view.projector.at_mm)
        for end in (left, right):
            painter.drawLine(origin, end)
        painter.drawLine(left, right)
        painter.setPen(colour)
        high = painter.fontMetrics().height()
        centred = Qt.AlignmentFlag.AlignHCenter
        base = self.tr("base {base:.0f} mm").format(base=view.projector.at_mm[0] - view.camera.at_mm[0])
        if right.x() - left.x() > painter.fontMetrics().horizontalAdvance(base) + 24:
            painter.drawText(QRectF(origin.x() - 80, left.y() - high - 3, 160, high), centred, base)
        angle = self.tr("{angle:.0f}°").format(angle=view.convergence_deg)
        needs = painter.fontMetrics().horizontalAdvance(angle) + 10  # so far down the axes are apart enough for it
        below = needs * (left.y() - origin.y()) / max(right.x() - left.x(), 1.0)
        if below < (left.y() - origin.y()) * 0.8:
            painter.drawText(QRectF(origin.x() - 40, origin.y() + below, 80, high), centred, angle)
        distance = self.tr("{distance:.0f} mm").format(distance=self._distance_mm)
        painter.save()
        painter.translate((origin + left) / 2)
        painter.rotate(degrees(atan2(origin.y() - left.y(), origin.x() - left.x())))
        painter.drawText(QRectF(-80, -high - 2, 160, high), centred, distance)
        painter.restore()

    def _draw_device(self, painter: QPainter, cover: Cover, name: str, colour: QColor) -> None:
        """A box that looks at the object; its name and its field below, on its own side of the middle."""
        at = self._at(*cover.at_mm)
        painter.save()
        painter.translate(at)
        painter.rotate(-degrees(atan2(*cover.at_mm)))
        painter.setPen(QPen(colour, 1.5))
        painter.setBrush(QColor(theme.current().surface))
        painter.drawRect(QRectF(-5, -2, 10, 7))
        painter.drawRoundedRect(QRectF(-11, 4, 22, 15), 3, 3)
        painter.restore()
        painter.setPen(colour)
        field = self.tr("{w:.0f} × {h:.0f} mm").format(w=cover.field_mm[0], h=cover.field_mm[1])
        metrics = painter.fontMetrics()
        half = max(metrics.horizontalAdvance(words) for words in (name, field)) / 2 + 4
        middle = self._origin.x()
        x = min(at.x(), middle - half) if cover.at_mm[0] < 0 else max(at.x(), middle + half)
        where = QRectF(x - half, at.y() + 24, 2 * half, 2 * metrics.lineSpacing())
        painter.drawText(where, Qt.AlignmentFlag.AlignHCenter, f"{name}\n{field}")


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
        """What is shown."""
        return self._sheet

    def show_sheet(self, sheet: Sheet | None, ends: tuple[int, int] | None = None, instead: str = "") -> None:
        """Show a board, or say instead why there is none; `ends` are the indices of two targets to be joined."""
        if sheet is not self._sheet and sheet is not None:
            self._drawing.load(QByteArray(sheet_svg(sheet).encode()))
        self._sheet, self._ends, self._instead = sheet, ends, instead
        self.setAccessibleDescription(sheet.title if sheet is not None else instead)
        self.update()

    def sizeHint(self) -> QSize:  # noqa: N802
        """Give the size the picture likes best."""
        return QSize(460, 360)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        """Draw the page, and the line on it."""
        painter = QPainter(self)
        if self._sheet is None:
            _say_instead(painter, self.rect(), self._instead)
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
