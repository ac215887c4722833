"""An image or a map: fixed levels, zoom that stays when the image changes, and the value under the cursor."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyqtgraph as pg
from numpy.typing import ArrayLike, NDArray
from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent
from PySide6.QtWidgets import QGraphicsRectItem, QSizePolicy

from stripe_gui import theme
from stripe_gui.widgets.colour_bar import ColourBar
from stripe_gui.widgets.colours import lookup
from stripe_gui.widgets.layout import column, label, row

ARROWS = {Qt.Key.Key_Left: (-1, 0), Qt.Key.Key_Right: (1, 0), Qt.Key.Key_Up: (0, -1), Qt.Key.Key_Down: (0, 1)}
CLICK_PX = 4  # the mouse may tremble by so much and still click


class Canvas(pg.GraphicsView):
    """The picture itself: wheel or + and - zoom, dragging moves, arrow keys move, 0 shows all."""

    hovered = Signal(float, float)  # u, v in px
    left = Signal()
    moved = Signal()  # the operator zoomed or moved
    clicked = Signal(float, float, object, object)  # u, v in px, Qt.MouseButton, Qt.KeyboardModifier

    def __init__(self) -> None:
        super().__init__(background=None)
        self.box = pg.ViewBox(lockAspect=True, invertY=True, enableMenu=False)
        self.box.setDefaultPadding(0.01)
        self.setCentralItem(self.box)
        self.box.sigRangeChangedManually.connect(lambda *_: self.moved.emit())
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.viewport().setMouseTracking(True)
        self._pressed: QPointF | None = None

    def sizeHint(self) -> QSize:  # noqa: N802
        return QSize(260, 200)

    def position(self, event: QMouseEvent) -> tuple[float, float]:
        """Where in the image (px) the mouse is."""
        point = self.box.mapSceneToView(self.mapToScene(event.position().toPoint()))
        return point.x(), point.y()

    def mousePressEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        self._pressed = event.position()
        super().mousePressEvent(event)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        super().mouseReleaseEvent(event)
        if self._pressed is not None and (event.position() - self._pressed).manhattanLength() <= CLICK_PX:
            self.clicked.emit(*self.position(event), event.button(), event.modifiers())
        self._pressed = None

    def mouseMoveEvent(self, event: QMouseEvent) -> None:  # noqa: N802
        super().mouseMoveEvent(event)
        self.hovered.emit(*self.position(event))

    def leaveEvent(self, event: QEvent) -> None:  # noqa: N802
        super().leaveEvent(event)
        self.left.emit()

    def keyPressEvent(self, event: QKeyEvent) -> None:  # noqa: N802
        if event.key() in (Qt.Key.Key_Plus, Qt.Key.Key_Equal, Qt.Key.Key_Minus):
            factor = 1.25 if event.key() == Qt.Key.Key_Minus else 0.8
            self.box.scaleBy((factor, factor))
        elif event.key() == Qt.Key.Key_0:
            self.box.autoRange(padding=0.01)
        elif event.key() in ARROWS:
            (x0, x1), (y0, y1) = self.box.viewRange()
            dx, dy = ARROWS[Qt.Key(event.key())]
            self.box.translateBy(x=dx * (x1 - x0) / 10, y=dy * (y1 - y0) / 10)
        else:
            event.ignore()
            return
        self.moved.emit()


class ImageView(theme.Themed):
    """An image with its colour bar and a line that reads the value under the cursor.

    Positions are device pixels: (0, 0) is the centre of the top-left pixel, u right, v down. Overlays are pyqtgraph
    items in these coordinates, put in by `add_item`; keep many marks in one item.
    """

    hovered = Signal(float, float)  # u, v in px
    clicked = Signal(float, float, object, object)  # u, v in px, Qt.MouseButton, Qt.KeyboardModifier

    def __init__(self, name: str, *, bar: bool = True) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setMinimumSize(220, 180)
        self.canvas = Canvas()
        self.canvas.setAccessibleName(name)
        self.canvas.setAccessibleDescription(
            self.tr("Plus and minus zoom, the arrow keys move, 0 shows the whole image.")
        )
        self.image_item = pg.ImageItem(axisOrder="row-major")
        self.canvas.box.addItem(self.image_item)
        self.bar = ColourBar()
        self.bar.hide()  # until there is an image
        self._with_bar = bar
        self.readout = label("", "muted")
        self.readout.setAccessibleName(self.tr("Value under the cursor"))
        self.outline = QGraphicsRectItem()  # dark images and maps with gaps do not show where they end
        self.add_item(self.outline)
        self.image: NDArray | None = None  # what is shown, (H, W)
        self._unit, self._digits, self._signed = "", 1, False
        self._extra: Callable[[int, int], str] | None = None
        self.setLayout(column((row(self.canvas, self.bar, spacing=8), 1), self.readout, spacing=4))
        self.canvas.hovered.connect(self._hover)
        self.canvas.left.connect(lambda: self._say(None))
        self.canvas.clicked.connect(self.clicked)
        self.colour()
        self._say(None)

    def set_image(
        self,
        image: ArrayLike | None,
        levels: tuple[float, float] = (0.0, 255.0),
        *,
        scale: str = "grey",
        unit: str = "",
        digits: int = 0,
        extra: Callable[[int, int], str] | None = None,
        colours: NDArray[np.uint8] | None = None,
    ) -> None:
        """Show an image (H, W) between two fixed levels; the zoom stays where it is unless the size is another.

        NaN is not drawn, None empties the view. The scale is "grey", "map" or "deviation"; `digits` are decimals of the
        read-out, to which ``extra(u, v)`` adds text. `colours`, (H, W, 4), are painted instead of the scale's, such as
        a shaded map.
        """
        before = None if self.image is None else self.image.shape
        self.image = None if image is None else np.asarray(image)
        self._unit, self._digits, self._extra = unit, digits, extra
        self._signed = levels[0] < 0
        if self.image is None:
            self.image_item.clear()
            self.outline.setRect(QRectF())
            self.bar.hide()
            self._say(None)
            return
        if colours is not None:
            self.image_item.setLookupTable(None, update=False)
            self.image_item.setImage(colours, autoLevels=False, levels=(0, 255))
        else:
            self.image_item.setLookupTable(None if scale == "grey" else lookup(scale), update=False)
            self.image_item.setImage(self.image, autoLevels=False, levels=levels)
        height, width = self.image.shape
        self.image_item.setRect(QRectF(-0.5, -0.5, width, height))
        self.outline.setRect(QRectF(-0.5, -0.5, width, height))
        self.bar.setVisible(self._with_bar)
        self.bar.show_scale(scale, levels, unit, least=10.0**-digits)
        if before != self.image.shape:
            self.fit()

    def fit(self) -> None:
        if self.image is not None:
            height, width = self.image.shape
            self.canvas.box.setRange(QRectF(-0.5, -0.5, width, height), padding=0.01)

    def show_as(self, other: ImageView) -> None:
        """Show the same part as another view of the same size."""
        self.canvas.box.setRange(other.canvas.box.viewRect(), padding=0)

    def centre_on(self, u: float, v: float) -> None:
        """Bring a point to the middle; the zoom stays."""
        (x0, x1), (y0, y1) = self.canvas.box.viewRange()
        self.canvas.box.translateBy(x=u - (x0 + x1) / 2, y=v - (y0 + y1) / 2)

    def add_item(self, item: pg.GraphicsObject) -> None:
        self.canvas.box.addItem(item, ignoreBounds=True)

    def value_at(self, u: float, v: float) -> float | None:
        """Give the value of the pixel at a position; None outside and where it is NaN."""
        if self.image is None or not (np.isfinite(u) and np.isfinite(v)):
            return None
        x, y = round(u), round(v)
        height, width = self.image.shape
        if not (0 <= x < width and 0 <= y < height):
            return None
        value = float(self.image[y, x])
        return value if np.isfinite(value) else None

    def _hover(self, u: float, v: float) -> None:
        self._say((u, v))
        self.hovered.emit(u, v)

    def _say(self, at: tuple[float, float] | None) -> None:
        if at is None or self.image is None:
            self.readout.setText(
                self.tr("Move the cursor over the image to read values.") if self.image is not None else " "
            )
            self.bar.mark(None)
            return
        u, v = at
        value = self.value_at(u, v)
        sign = "+" if self._signed else ""
        number = self.tr("no value") if value is None else f"{value:{sign}.{self._digits}f} {self._unit}".rstrip()
        height, width = self.image.shape
        inside = -0.5 <= u < width - 0.5 and -0.5 <= v < height - 0.5
        more = self._extra(round(u), round(v)) if self._extra and inside else ""
        self.readout.setText(f"u {u:.1f}   v {v:.1f}   {number}   {more}".rstrip() if inside else " ")
        self.bar.mark(value)

    def colour(self) -> None:
        self.canvas.setBackground(QColor(theme.current().canvas))
        self.outline.setPen(pg.mkPen(theme.current().faint, width=1))
