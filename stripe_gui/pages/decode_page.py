"""The maps of a decoded capture: projector coordinates, their sigma, modulation, validity."""

from __future__ import annotations

from functools import partial
from typing import Any

from core.model import Capture, PhaseMap
from core.pipeline.update import decode_project
from stripe_gui.pages.map_page import MapPage
from stripe_gui.presenters.decode import figures_table, kind_name, kinds_of, map_view, pixel_text, recent_phases
from stripe_gui.presenters.folder import frames_key
from stripe_gui.presenters.work import decode_one
from stripe_gui.widgets.layout import boxed, column, label
from stripe_gui.widgets.result_table import EMPTY, ResultTable
from stripe_gui.workbench import Workbench


class DecodePage(MapPage):
    """A viewer: choose a capture and a map, read values with the cursor."""

    id = stage = "decode"
    by_pair = True

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("Decode"),
            self.tr("Which projector line lit each pixel, how surely, and where that cannot be told."),
            self.tr("Map of the decoded capture"),
        )
        self.cache = recent_phases()
        self._shown: tuple[Any, ...] | None = None  # of which frames
        self._phase: PhaseMap | None = None
        self.figures = ResultTable(self.tr("Figures of the decoded capture"), titled=False)
        self.captures.setMaximumWidth(340)
        self.figures.setMinimumWidth(290)
        self.figures.setMaximumWidth(340)
        self.all_button = self.add_button(self.tr("Decode all captures"), self.run, "run", primary=True)
        self.all_button.setToolTip(self.tr("Decode every capture that has changed, and keep its figures (F5)."))
        self.lay_out(boxed(column(self.state, self.view)), below=(label(self.tr("Figures"), "heading"), self.figures))

    def refresh(self) -> None:
        """Show the captures, and decode the chosen one if it is not here yet."""
        self.captures.refresh()
        self.all_button.setEnabled(self.can_run())
        self.look()

    def run(self) -> None:
        self.bench.run_stage("decode", decode_project, on_done=self._told)

    def can_run(self) -> bool:
        return self.session.is_open and bool(self.session.opened.project.captures)

    def look(self) -> None:
        self.bench.views.cancel_all()  # another capture may be on its way
        entry = self.session.capture
        if entry is None:
            self._clear(self.tr("This project has no captures yet."))
            return
        if entry.capture is None:
            self._clear(str(entry.error))
            return
        if frames_key(entry.capture) == self._shown:
            return
        phase = self.cache.get(entry.capture)
        if phase is not None:
            self._show(entry.capture, phase)
            return
        self.say(self.tr("decoding …"))
        self.look_for(entry.name, partial(self._decoded, entry.capture), self._clear, decode_one, entry.capture)

    def choose(self) -> None:
        if self._phase is not None:
            projector = self.session.opened.project.rig.projectors.get(self._phase.projector)
            view = map_view(self._phase, self.kind.currentData(), projector)
            self.show_map(view, partial(pixel_text, self._phase))

    def _told(self, count: int) -> None:
        self.bench.notify("success", self.tr("{n} captures decoded.").format(n=count))

    def _decoded(self, capture: Capture, phase: PhaseMap) -> None:
        self.cache.put(capture, phase)
        if capture.name == self.session.capture_name:
            self._show(capture, phase)

    def _show(self, capture: Capture, phase: PhaseMap) -> None:
        self._shown, self._phase = frames_key(capture), phase
        self.offer(kinds_of(phase), kind_name)
        self.say("")
        self.figures.show_table(figures_table(phase))
        self.choose()

    def _clear(self, text: str) -> None:
        self._shown = self._phase = None
        self.show_map(None)
        self.figures.show_table(EMPTY)
        self.say(text)
