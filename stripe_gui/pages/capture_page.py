"""The captures of the project and the frames in them."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QCheckBox, QListWidget, QListWidgetItem

from stripe_gui.pages.page import Page
from stripe_gui.presenters.capture import FrameView, load_frame, pattern_text, rig_lines
from stripe_gui.widgets.capture_list import CaptureList
from stripe_gui.widgets.health_strip import HealthStrip
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import boxed, column, fit_button, label, make, row, splitter
from stripe_gui.workbench import Workbench


class CapturePage(Page):
    """What was recorded: captures to the left, their frames to the right, the chosen frame between."""

    id = stage = "capture"
    by_pair = True
    action_ids = ("capture.import", "capture.new")

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench, self.tr("Capture"), self.tr("The sequences of stripe images in this project, frame by frame.")
        )
        self.captures = CaptureList(bench.session)
        self.frames = make(
            QListWidget, accessibleName=self.tr("Frames of the capture"), minimumWidth=230, maximumWidth=300
        )
        self.frames.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.frames.currentItemChanged.connect(self._load)
        self.view = ImageView(self.tr("Frame"))
        self.figures = label(" ", "muted", wrap=True)
        self.empty = label(self.tr("This project has no captures yet."), "muted")
        self.stretch = QCheckBox(self.tr("Brighten"))
        self.stretch.setToolTip(
            self.tr("Show up to the brightest pixels of this frame instead of the sensor's full scale.")
        )
        self.stretch.toggled.connect(self._draw)
        self._frame: FrameView | None = None
        self.rig = label("", "muted")
        rig = (label(self.tr("Rig"), "heading"), self.rig)
        left = column(label(self.tr("Captures"), "heading"), self.captures, *rig, spacing=8)
        middle = column(row(self.stretch, None, fit_button(self.view.fit)), self.figures, self.view)
        right = column(label(self.tr("Frames"), "heading"), self.frames, spacing=8)
        self.health = HealthStrip(bench)
        self.body.addWidget(self.health)
        self.body.addWidget(self.empty)
        self.body.addWidget(splitter(boxed(left), boxed(middle), boxed(right), widest=1), 1)
        bench.session.capture_changed.connect(self._capture_changed)

    def refresh(self) -> None:
        self.captures.refresh()
        self.rig.setText("\n".join(rig_lines(self.session.opened.project.rig)) if self.session.is_open else "")
        self.empty.setVisible(self.captures.count() == 0)
        self.health.refresh()
        self._list_frames()

    def _capture_changed(self) -> None:
        if self.isVisible():  # else it is refreshed when it comes to the front
            self._list_frames()

    def _list_frames(self) -> None:
        entry = self.session.capture
        at = max(self.frames.currentRow(), 0)
        self.frames.blockSignals(True)
        self.frames.clear()
        if entry is not None and entry.capture is not None:
            for frame in entry.capture.frames:
                item = QListWidgetItem(f"{frame.path.name}\n{pattern_text(frame.pattern)}")
                item.setData(Qt.ItemDataRole.UserRole, str(frame.path))
                self.frames.addItem(item)
        self.frames.setCurrentRow(min(at, self.frames.count() - 1))
        self.frames.blockSignals(False)
        self._load(self.frames.currentItem())

    def _load(self, item: QListWidgetItem | None, _previous: QListWidgetItem | None = None) -> None:
        entry = self.session.capture
        if item is None or entry is None or entry.capture is None:
            self._clear(str(entry.error) if entry is not None and entry.error else " ")
            return
        frame = entry.capture.frames[self.frames.row(item)]
        self.look_for(frame.path.name, self._show, self._clear, load_frame, frame.path)

    def _show(self, frame: FrameView) -> None:
        self._frame = frame
        self._draw()
        height, width = frame.image.shape
        text = self.tr("{w} × {h} px, {bits} bit   mean {mean:.1f}   clipped {clipped:.2f} %")
        bits = round(frame.white + 1).bit_length() - 1
        self.figures.setText(text.format(w=width, h=height, bits=bits, mean=frame.mean, clipped=frame.clipped_percent))

    def _draw(self) -> None:
        if self._frame is not None:
            top = self._frame.bright if self.stretch.isChecked() else self._frame.white
            self.view.set_image(self._frame.image, (0.0, top))

    def _clear(self, text: str) -> None:
        self.bench.views.cancel_all()  # the frame of another capture may be on its way
        self._frame = None
        self.view.set_image(None)
        self.figures.setText(text)
