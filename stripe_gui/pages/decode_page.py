"""The maps of a decoded capture: projector coordinates, their sigma, modulation, validity."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QSplitter

from core.model import PhaseMap
from stripe_gui.pages.page import Page
from stripe_gui.presenters.decode import PhaseCache, figures_table, kind_name, kinds_of, map_view, pixel_text
from stripe_gui.presenters.folder import CaptureEntry
from stripe_gui.presenters.work import decode_all, decode_one
from stripe_gui.widgets.capture_list import CaptureList
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import boxed, button, column, label, row
from stripe_gui.widgets.result_table import EMPTY, ResultTable
from stripe_gui.workbench import Workbench


class DecodePage(Page):
    """A viewer: choose a capture and a map, read values with the cursor."""

    id = stage = "decode"

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("Decode"),
            self.tr("Which projector line lit each pixel, how surely, and where that cannot be told."),
        )
        self.cache = PhaseCache()
        self._shown: CaptureEntry | None = None
        self._phase: PhaseMap | None = None
        self.captures = CaptureList(bench.session)
        self.kind = QComboBox()
        self.kind.setAccessibleName(self.tr("Map"))
        self.kind.setMinimumWidth(200)
        self.kind.currentIndexChanged.connect(self._show_map)
        self.view = ImageView(self.tr("Map of the decoded capture"))
        self.state = label(" ", "muted")
        self.figures = ResultTable(self.tr("Figures of the decoded capture"), titled=False)
        self.figures.setMinimumWidth(300)
        self.figures.setMaximumWidth(340)
        self.all_button = self.add_button(self.tr("Decode all captures"), self.run, "run", primary=True)
        self.all_button.setToolTip(self.tr("Decode every capture that has changed, and keep its figures (F5)."))
        fit = button(self.tr("Whole image"), self.view.fit, "fit", flat=True)
        top = row(label(self.tr("Map")), self.kind, self.state, None, fit)
        split = QSplitter(Qt.Orientation.Horizontal)
        split.addWidget(boxed(column(label(self.tr("Captures"), "heading"), self.captures, spacing=8)))
        split.addWidget(boxed(column(top, self.view)))
        split.addWidget(boxed(column(label(self.tr("Figures"), "heading"), self.figures, spacing=8)))
        split.setStretchFactor(1, 1)
        split.setChildrenCollapsible(False)
        split.setHandleWidth(14)
        self.body.addWidget(split, 1)
        bench.session.capture_changed.connect(self._capture_changed)

    def refresh(self) -> None:
        """Show the captures, and decode the chosen one if it is not here yet."""
        self.captures.refresh()
        self.all_button.setEnabled(self.can_run())
        self._look()

    def run(self) -> None:
        """Decode all captures."""
        self.bench.run_stage("decode", decode_all, on_done=self._told)

    def can_run(self) -> bool:
        """Say whether there is anything to decode."""
        return self.session.is_open and bool(self.session.folder.project.captures)

    def _told(self, count: int) -> None:
        self.bench.notify("success", self.tr("{n} captures decoded.").format(n=count))

    def _capture_changed(self) -> None:
        if self.isVisible():  # else it is refreshed when it comes to the front
            self._look()

    def _look(self) -> None:
        entry = self.session.capture
        if entry is None or entry.capture is None:
            self._clear(str(entry.error) if entry is not None and entry.error else " ")
            return
        if entry == self._shown and self._phase is not None:
            return
        phase = self.cache.get(entry)
        if phase is not None:
            self._show(entry, phase)
            return
        self.state.setText(self.tr("decoding …"))
        self.bench.views.run(
            entry.name,
            decode_one,
            entry.folder,
            on_done=partial(self._decoded, entry),
            on_failed=lambda failure: self._clear(str(failure.error)),
        )

    def _decoded(self, entry: CaptureEntry, phase: PhaseMap) -> None:
        self.cache.put(entry, phase)
        if entry.name == self.session.capture_name:
            self._show(entry, phase)

    def _show(self, entry: CaptureEntry, phase: PhaseMap) -> None:
        self._shown, self._phase = entry, phase
        before = self.kind.currentData()
        kinds = kinds_of(phase)
        self.kind.blockSignals(True)
        self.kind.clear()
        for kind in kinds:
            self.kind.addItem(kind_name(kind), kind)
        self.kind.setCurrentIndex(kinds.index(before) if before in kinds else 0)
        self.kind.blockSignals(False)
        self.state.setText(" ")
        self.figures.show_table(figures_table(phase))
        self._show_map()

    def _show_map(self) -> None:
        if self._phase is None:
            return
        phase = self._phase
        view = map_view(phase, self.kind.currentData(), self.session.folder.project.projector)
        self.view.set_image(
            view.image,
            view.levels,
            scale=view.scale,
            unit=view.unit,
            digits=view.digits,
            extra=partial(pixel_text, phase),
        )

    def _clear(self, text: str) -> None:
        self._shown = self._phase = None
        self.view.set_image(None)
        self.figures.show_table(EMPTY)
        self.state.setText(text)
