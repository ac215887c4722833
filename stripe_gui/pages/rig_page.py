"""The calibrated rig: its devices in space, and whether they have stayed where they were."""

from __future__ import annotations

import numpy as np
from PySide6.QtWidgets import QSizePolicy

from core.errors import StripeError
from core.model import Adjustment, DriftPoint, PhotogrammetricCalibration
from core.pipeline.orient import drift_of
from core.pipeline.orient_words import ACTION
from stripe_gui.pages.parts_page import PartsPage
from stripe_gui.presenters.drift import drift_curves, drift_table
from stripe_gui.presenters.rig_space import board_places, depths_of, rig_scene, rig_table, stands_of
from stripe_gui.presenters.space import Scene
from stripe_gui.widgets.layout import boxed, button, choice, column, label, refill, row
from stripe_gui.widgets.plot import Plot
from stripe_gui.widgets.result_table import EMPTY, ResultTable
from stripe_gui.widgets.space_view import SpaceView
from stripe_gui.workbench import Workbench


class RigPage(PartsPage):
    """All devices in space; the control chart of their orientation over the captures."""

    id = "rig"

    def __init__(self, bench: Workbench) -> None:
        super().__init__(bench, self.tr("Rig"), self.tr("Where the devices stand, and whether they have stayed there."))
        self._charts: dict[tuple[str, str], tuple[DriftPoint, ...]] = {}
        self._looked = False
        self.state = label("", "muted", wrap=True)
        self.body.insertWidget(0, self.state)
        self.space = SpaceView(self.tr("The rig in space"))
        self.table = ResultTable(self.tr("Devices of the rig"), titled=False)
        key = self.tr(
            "Each device looks out of its tinted image; green: what all of them see; grey: the targets of all poses."
        )
        self.table.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Maximum)
        body = boxed(column(label(key, "muted", wrap=True), self.space, self.table, spacing=8))
        self.add_step("space", self.tr("In space"), body)
        self.chart = Plot(self.tr("Drift chart"), self.tr("capture"), self.tr("off what was expected [σ]"))
        self.captures = ResultTable(self.tr("Captures of the drift chart"), titled=False)
        self.captures.row_chosen.connect(self._choose)
        self.pair = choice(self.tr("Camera and projector"), self._show_chart)
        self.said = label("", "muted", wrap=True)
        self.look_button = button(self.tr("Look at all captures"), self.run, "run")
        top = row((self.said, 1), self.pair, self.look_button)
        drift = column(top, (self.chart, 30), (self.captures, 20), None, spacing=8)
        self.add_step("drift", self.tr("Drift"), boxed(drift))
        bench.session.project_changed.connect(self._forget)
        self._forget()

    def refresh(self) -> None:
        """Show the rig of the calibration in use."""
        folder = self.session.folder
        if folder is None:
            return
        self.look_button.setEnabled(self.can_run())
        scene, table, said = Scene(), EMPTY, ""
        try:
            calibration = folder.result("photogrammetric.npz", PhotogrammetricCalibration)
            if calibration is None:
                said = self.tr("Calibrate by the photogrammetric method first.")
            else:
                adjustment = folder.result("adjustment.npz", Adjustment)
                devices, targets = stands_of(calibration), board_places(calibration, adjustment)
                reach = depths_of(devices, targets)
                scene, table = rig_scene(devices, reach, targets), rig_table(devices, reach)
        except StripeError as error:
            said = str(error)
        self.state.setText(said)
        self.state.setVisible(bool(said))
        self.space.show_scene(scene)
        self.table.show_table(table)
        self.table.fit_height()

    def can_run(self) -> bool:
        """Say whether there are captures and a calibration to hold them against."""
        return self.session.is_open and self.session.opened.result_file("photogrammetric.npz").exists()

    def run(self) -> None:
        """Look at every capture, and make the chart."""
        if self.can_run():
            title, failed = self.tr("Drift chart"), self.bench.report_failure
            self.bench.jobs.run(title, drift_of, self.session.opened.project, on_done=self._take, on_failed=failed)

    def _take(self, charts: dict[tuple[str, str], tuple[DriftPoint, ...]]) -> None:
        self._charts, self._looked = charts, bool(self.session.is_open)
        refill(self.pair, [(" – ".join(pair), pair) for pair in charts], None)
        self.pair.setVisible(len(charts) > 1)
        self._show_chart()

    def _show_chart(self) -> None:
        chart = next(iter(list(self._charts.values())[max(self.pair.currentIndex(), 0) :]), ())
        moved = [point.capture for point in chart if point.state == "action"]
        if not chart:
            none = self.tr("No capture shows both projector coordinates of enough pixels.")
            text = self.tr("Every capture tells whether the projector has moved against the camera.")
            self.said.setText(none if self._looked else text)
        elif moved:
            self.said.setText(self.tr("Out of control: {names}.").format(names=", ".join(moved)))
        else:
            self.said.setText(self.tr("In control: {n} captures, none off what was expected.").format(n=len(chart)))
        curves = drift_curves(chart) if chart else []
        reach = max([ACTION, *(float(np.abs(np.asarray(curve.y)).max()) for curve in curves)])
        self.chart.set_curves(curves, (0.5, max(len(chart), 1) + 0.5), (-1.1 * reach, 1.1 * reach), self.said.text())
        self.captures.show_table(drift_table(chart) if chart else EMPTY)
        for widget in (self.chart, self.captures):
            widget.setVisible(bool(chart))

    def _choose(self, index: int) -> None:
        """Look at a capture of the chart on the other pages, too."""
        self.session.choose_capture(str(self.captures.model.table.rows[index][1]))

    def _forget(self) -> None:
        self._take({})
        self._looked = False
        self._show_chart()
