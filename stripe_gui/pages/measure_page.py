"""The targets of the testfield: picked, measured, missing and why."""

from __future__ import annotations

from functools import partial

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QSplitter, QTabWidget

from core.errors import StripeError
from stripe_gui import theme
from stripe_gui.pages.page import Page
from stripe_gui.presenters.capture import FrameView
from stripe_gui.presenters.measure import MeasureView, lit_frame, measure_view, targets_of
from stripe_gui.presenters.work import measure
from stripe_gui.widgets.capture_list import CaptureList
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import boxed, button, column, label, row
from stripe_gui.widgets.result_table import EMPTY, ResultTable
from stripe_gui.widgets.symbols import plus
from stripe_gui.workbench import Workbench


class MeasurePage(Page):
    """Boards to the left, the board with its targets in the middle, the table of targets below."""

    id = stage = "measure"
    action_ids = ("measure.pick",)

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("Measure"),
            self.tr("Where the targets of the testfield are, in the image of the camera and of the projector."),
        )
        self.captures = CaptureList(bench.session, ("testfield", "depth"))
        self.view = ImageView(self.tr("Testfield with its targets"), bar=False)
        self.measured = pg.ScatterPlotItem(pxMode=True, size=10, symbol=plus())
        self.picks = pg.ScatterPlotItem(pxMode=True, size=18, symbol="s")
        self.missing = pg.ScatterPlotItem(pxMode=True, size=12, symbol="d")
        self.chosen = pg.ScatterPlotItem(pxMode=True, size=26, symbol="o")
        for item in (self.measured, self.picks, self.missing, self.chosen):
            self.view.add_item(item)
        self.state = label(" ", "muted", wrap=True)
        self.key = label(self.tr("+ measured   □ picked   ◇ missing"), "muted")
        self.table = ResultTable(self.tr("Measured targets"), titled=False)
        self.table.row_chosen.connect(self._point_at)
        self.missing_table = ResultTable(self.tr("Missing targets"), titled=False)
        self.missing_table.row_chosen.connect(self._point_at_missing)
        self.tabs = QTabWidget()
        self.tabs.setDocumentMode(True)
        for table, name in ((self.table, "measured"), (self.missing_table, "missing")):
            table.setObjectName(name)
            self.tabs.addTab(table, "")
        self._shown: MeasureView | None = None
        self.run_button = self.add_button(self.tr("Measure all"), self.run, "run", primary=True)
        self.run_button.setToolTip(self.tr("Measure the targets of all captures that have picks (F5)."))
        fit = button(self.tr("Whole image"), self.view.fit, "fit", flat=True)
        picture = boxed(column(row(self.key, None, fit), self.state, self.view, spacing=6))
        right = QSplitter(Qt.Orientation.Vertical)
        right.addWidget(picture)
        right.addWidget(self.tabs)
        right.setSizes([420, 220])
        right.setChildrenCollapsible(False)
        right.setHandleWidth(14)
        split = QSplitter(Qt.Orientation.Horizontal)
        split.addWidget(boxed(column(label(self.tr("Boards"), "heading"), self.captures, spacing=8)))
        split.addWidget(right)
        split.setStretchFactor(1, 1)
        split.setChildrenCollapsible(False)
        split.setHandleWidth(14)
        self.body.addWidget(split, 1)
        self._colour()
        bench.session.capture_changed.connect(self._capture_changed)

    def refresh(self) -> None:
        """Show the boards and the chosen one's targets."""
        self.captures.refresh()
        names = self.captures.names()
        if names and self.session.capture_name not in names:
            self.session.choose_capture(names[0])
        self.run_button.setEnabled(self.can_run())
        self._look()

    def run(self) -> None:
        """Measure all boards that have picks."""
        self.bench.run_stage("measure", measure, on_done=self._told)

    def can_run(self) -> bool:
        """Say whether any board has picks."""
        folder = self.session.folder
        return folder is not None and any(e.capture.seeds for e in folder.of_role("testfield", "depth") if e.capture)

    def _told(self, targets: tuple) -> None:
        count = sum(len(t.row) for t in targets)
        self.bench.notify("success", self.tr("{n} targets in {m} captures.").format(n=count, m=len(targets)))

    def _capture_changed(self) -> None:
        if self.isVisible():  # else it is refreshed when it comes to the front
            self._look()

    def _look(self) -> None:
        self.bench.views.cancel_all()  # another capture may be on its way
        entry = self.session.capture
        if entry is None or entry.capture is None or entry.name not in self.captures.names():
            self._clear(self.tr("No board yet: capture the testfield, or a plate, first."))
            return
        try:
            targets = targets_of(self.session.folder, entry.name)
        except StripeError as error:
            self.bench.report_error(error)
            targets = None
        view = measure_view(entry.capture, targets, self.session.folder.project.camera)
        self.bench.views.run(
            entry.name,
            lit_frame,
            entry.capture,
            on_done=partial(self._picture, view),
            on_failed=lambda failure: self._clear(str(failure.error)),
        )

    def _picture(self, view: MeasureView, frame: FrameView) -> None:
        self.view.set_image(frame.image, (0.0, frame.bright))
        self._show(view)

    def _clear(self, text: str) -> None:
        self.view.set_image(None)
        self._show(None)
        self.state.setText(text)

    def _show(self, view: MeasureView | None) -> None:
        self._shown = view
        empty, folder = np.zeros((0, 2)), self.session.folder
        camera = folder.project.camera if folder is not None else None
        for item, points in (
            (self.measured, view.measured if view else empty),
            (self.picks, view.picks if view else empty),
            (self.missing, view.missing_inside(camera) if view and camera else empty),
        ):
            item.setData(x=points[:, 0], y=points[:, 1])
        self.chosen.setData([], [])
        self.state.setText(view.summary if view else " ")
        self.table.show_table(view.table if view else EMPTY)
        self.missing_table.show_table(view.missing_table if view else EMPTY)
        counts = (len(view.measured), len(view.missing)) if view else (0, 0)
        self.tabs.setTabText(0, self.tr("Measured ({n})").format(n=counts[0]))
        self.tabs.setTabText(1, self.tr("Missing ({n})").format(n=counts[1]))
        target = self.session.take_target()
        if view is not None and target in view.targets:
            self._bring(view, view.targets.index(target))

    def _bring(self, view: MeasureView, index: int) -> None:
        """Point at a target that another page asked for, in the middle of the picture."""
        gone = index - len(view.measured)
        table, row = (self.table, index) if gone < 0 else (self.missing_table, gone)
        self.tabs.setCurrentWidget(table)
        table.choose_row(row)
        place = view.measured[index] if gone < 0 else view.missing[gone]
        if np.isfinite(place).all():
            self.view.centre_on(*place, width_px=60)

    def _point_at(self, index: int) -> None:
        if self._shown is not None and index < len(self._shown.measured):
            u, v = self._shown.measured[index]
            self.chosen.setData([u], [v])

    def _point_at_missing(self, index: int) -> None:
        if self._shown is not None and index < len(self._shown.missing):
            u, v = self._shown.missing[index]
            self.chosen.setData(*(([u], [v]) if np.isfinite(u) else ([], [])))

    def _colour(self) -> None:
        # on the picture itself, which is the same in light and dark
        self.measured.setPen(pg.mkPen(theme.DARK.mark, width=1.5))
        self.picks.setPen(pg.mkPen(theme.DARK.mark_other, width=2))
        self.missing.setPen(pg.mkPen(theme.DARK.warning, width=1.5))
        self.chosen.setPen(pg.mkPen("#ffffff", width=2))
        for item in (self.measured, self.picks, self.missing, self.chosen):
            item.setBrush(None)
