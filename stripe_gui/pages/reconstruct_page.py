"""The points of a capture: shaded surface, depth, sigma; export for other programs."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QSplitter

from stripe_gui.pages.page import Page
from stripe_gui.presenters.reconstruct import KINDS, Points, kind_name, load_points, map_view, methods_of, points_state
from stripe_gui.presenters.status import method_name
from stripe_gui.presenters.work import cloud_file, export_points, reconstruct
from stripe_gui.widgets.capture_list import CaptureList
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import boxed, button, column, label, row
from stripe_gui.workbench import Workbench


class ReconstructPage(Page):
    """A viewer of points as maps over the camera's image."""

    id = stage = "reconstruct"

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("Reconstruct"),
            self.tr("From projector coordinates to points in the camera's frame, each with its sigma."),
        )
        self._points: Points | None = None
        self._waiting = ""
        self.captures = CaptureList(bench.session)
        self.method = QComboBox()
        self.method.setAccessibleName(self.tr("Calibration"))
        self.method.setMinimumWidth(150)
        self.method.currentIndexChanged.connect(self._look)
        self.kind = QComboBox()
        self.kind.setAccessibleName(self.tr("Map"))
        for kind in KINDS:
            self.kind.addItem(kind_name(kind), kind)
        self.kind.currentIndexChanged.connect(self._show_map)
        self.state = label(" ", "muted")
        self.view = ImageView(self.tr("Map of the points"))
        self.export_button = self.add_button(self.tr("Export points…"), self.export, "export")
        self.export_button.setToolTip(self.tr("Write the points as PLY, XYZ or NPZ."))
        self.run_button = self.add_button(self.tr("Reconstruct"), self.run, "run", primary=True)
        self.run_button.setToolTip(self.tr("Reconstruct the chosen capture (F5)."))
        fit = button(self.tr("Whole image"), self.view.fit, "fit", flat=True)
        top = row(label(self.tr("Calibration")), self.method, label(self.tr("Map")), self.kind, None, fit)
        split = QSplitter(Qt.Orientation.Horizontal)
        split.addWidget(boxed(column(label(self.tr("Captures"), "heading"), self.captures, spacing=8)))
        split.addWidget(boxed(column(top, self.state, self.view)))
        split.setStretchFactor(1, 1)
        split.setChildrenCollapsible(False)
        split.setHandleWidth(14)
        self.body.addWidget(split, 1)
        bench.session.capture_changed.connect(self._capture_changed)

    def refresh(self) -> None:
        """Show the captures, the calibrations there are, and the chosen capture's points."""
        self.captures.refresh()
        before = self.method.currentData()
        methods = methods_of(self.session.folder) if self.session.is_open else []
        self.method.blockSignals(True)
        self.method.clear()
        for method in methods:
            self.method.addItem(method_name(method), method)
        self.method.setCurrentIndex(methods.index(before) if before in methods else 0 if methods else -1)
        self.method.blockSignals(False)
        self._look()

    def run(self) -> None:
        """Reconstruct the chosen capture."""
        name, method = self.session.capture_name, self.method.currentData()
        self.bench.run_stage("reconstruct", reconstruct, name, method, on_done=lambda _: self._told(name))

    def can_run(self) -> bool:
        """Say whether there are a capture and a calibration."""
        entry = self.session.capture
        return entry is not None and entry.capture is not None and self.method.currentData() is not None

    def export(self) -> None:
        """Ask where to, and write the points there."""
        name, method = self.session.capture_name, self.method.currentData()
        start = Path.home() / f"{name}.ply"
        kinds = self.tr("Point clouds (*.ply *.xyz *.npz)")
        out = self.bench.dialogs.save_file(self, self.tr("Export points"), kinds, start)
        if out is not None:
            done = self.tr("{n} points written to {path}.")
            self.bench.run_stage(
                "reconstruct",
                export_points,
                name,
                method,
                out,
                on_done=lambda count: self.bench.notify("success", done.format(n=count, path=out)),
            )

    def _told(self, name: str) -> None:
        self.bench.notify("success", self.tr("{name} is reconstructed.").format(name=name))

    def _capture_changed(self) -> None:
        if self.isVisible():  # else it is refreshed when it comes to the front
            self._look()

    def _look(self) -> None:
        able = self.can_run()
        self.run_button.setEnabled(able)
        self.export_button.setEnabled(able)
        if not able:
            text = self.tr("Calibrate first.") if self.method.currentData() is None else " "
            self._clear(text)
            return
        folder, name, method = self.session.folder, self.session.capture_name, self.method.currentData()
        state = points_state(folder, name, method)
        if state == "none":
            self._clear(self.tr("{name} is not reconstructed yet.").format(name=name))
            return
        stale = self.tr("   Out of date: reconstruct it again.") if state == "stale" else ""
        path = cloud_file(folder.project, name, method)
        self._waiting = str(path)
        self.bench.views.run(
            name,
            load_points,
            path,
            on_done=partial(self._show, str(path), stale),
            on_failed=lambda failure: self._clear(str(failure.error)),
        )

    def _show(self, path: str, stale: str, points: Points) -> None:
        if path != self._waiting:
            return
        self._points = points
        share = points.count / max(1, points.xyz_mm[..., 2].size)
        self.state.setText(self.tr("{n} points, {p:.1%} of the image.").format(n=points.count, p=share) + stale)
        self._show_map()

    def _show_map(self) -> None:
        view = map_view(self._points, self.kind.currentData()) if self._points is not None else None
        if view is None:
            self.view.set_image(None)
            return
        self.view.set_image(
            view.image, view.levels, scale=view.scale, unit=view.unit, digits=view.digits, extra=self._coordinates
        )

    def _coordinates(self, u: int, v: int) -> str:
        if self._points is None:
            return ""
        x, y, z = self._points.xyz_mm[v, u]
        return f"X {x:.3f}   Y {y:.3f}   Z {z:.3f} mm" if z == z else ""

    def _clear(self, text: str) -> None:
        self._points, self._waiting = None, ""
        self.view.set_image(None)
        self.state.setText(text)
