"""The middle of the picking page: the image with its marks, the cross hairs, and what is said about them."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from core.model import DeviceSpec
from stripe_gui.pages.measure.marks import MarksOverlay
from stripe_gui.presenters.capture import FrameView
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import button, column, label, row

REACH_PX = 12  # on the screen: how far beside a dot a click may be


class ImagePanel(QWidget):
    """The image; `cursor` is where the cross hairs are, px."""

    looked_at = Signal(float, float)  # where the loupe should look

    def __init__(self, exclude: Callable[[], object]) -> None:
        super().__init__()
        self.view = ImageView(self.tr("Image with its targets"), bar=False)
        self.view.canvas.setAccessibleDescription(
            self.tr(
                "1 to 4 and Tab choose a target, arrows move the cross hairs, Space picks, Enter does the next step, "
                "F6 goes to the map and the lists."
            )
        )
        self.marks = MarksOverlay(self.view)
        self.frame: FrameView | None = None
        self.cursor_at = (0.0, 0.0)
        self.name = label(" ", "heading")
        self.ask = label(" ", wrap=True)
        self.legend = label(" ", "muted", wrap=True)
        said = self.tr(
            "Arrows: 1 px, Shift 0.1 px, Ctrl next dot · Space: pick · 1–4, Tab: target · X: exclude · "
            "Page Up, Down: image · F6: map and lists"
        )
        keys = label(said, "muted", wrap=True)
        self.exclude_button = button(self.tr("Exclude (X)"), exclude, "close", flat=True)
        fit = button(self.tr("Whole image"), self.view.fit, "fit", flat=True)
        top = row(self.name, None, self.exclude_button, fit)
        self.setLayout(column(top, self.ask, (self.view, 1), self.legend, keys, spacing=6))
        self.view.hovered.connect(self.looked_at)
        self.view.canvas.left.connect(lambda: self.looked_at.emit(*self.cursor_at))

    def show_frame(self, frame: FrameView | None) -> None:
        """Show an image; the zoom stays."""
        if frame is not self.frame:
            self.frame = frame
            self.view.set_image(frame.image if frame else None, (0.0, frame.bright if frame else 1.0))
            self.looked_at.emit(*self.cursor_at)

    def show_excluded(self, excluded: bool, possible: bool) -> None:
        """Say what the button would do with the target at work."""
        self.exclude_button.setText(" " + (self.tr("Restore (X)") if excluded else self.tr("Exclude (X)")))
        self.exclude_button.setEnabled(possible)

    @property
    def reach_px(self) -> float:
        """How far beside a dot a pick may be, px of the image."""
        return max(REACH_PX * float(self.view.canvas.box.viewPixelSize()[0]), 4.0)

    @property
    def middle(self) -> tuple[float, float]:
        """The middle of what is seen, px."""
        (x0, x1), (y0, y1) = self.view.canvas.box.viewRange()
        return (x0 + x1) / 2, (y0 + y1) / 2

    def ahead(self, du: int, dv: int) -> tuple[float, float]:
        """Give the place a tenth of the view further in a direction, px."""
        (x0, x1), (y0, y1) = self.view.canvas.box.viewRange()
        return self.cursor_at[0] + du * (x1 - x0) / 10, self.cursor_at[1] + dv * (y1 - y0) / 10

    def set_cursor(self, u: float, v: float, camera: DeviceSpec, *, follow: bool = False) -> None:
        """Move the cross hairs; `follow` brings them into view where they would leave it."""
        u, v = min(max(u, 0.0), camera.width - 1.0), min(max(v, 0.0), camera.height - 1.0)
        self.cursor_at = (u, v)
        self.marks.show_cursor(self.cursor_at)
        self.looked_at.emit(u, v)
        (x0, x1), (y0, y1) = self.view.canvas.box.viewRange()
        if follow and not (x0 <= u <= x1 and y0 <= v <= y1):
            self.view.centre_on(u, v)
