"""The points of a capture: shaded height, depth, sigma, and in space; export for other programs."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtWidgets import QComboBox, QStackedWidget

from core.pipeline import keep_points
from stripe_gui.gl import TRYING, gl_problem
from stripe_gui.pages.map_page import MapPage
from stripe_gui.presenters.maps import MapView
from stripe_gui.presenters.reconstruct import (
    KINDS,
    Cloud,
    Points,
    cloud_of,
    devices_of,
    kind_name,
    load_points,
    map_view,
    methods_of,
    points_of,
)
from stripe_gui.presenters.status import method_name
from stripe_gui.presenters.work import export_points
from stripe_gui.widgets.layout import boxed, button, column, label, row
from stripe_gui.workbench import Workbench

if TYPE_CHECKING:
    from stripe_gui.widgets.cloud_view import CloudView

SPACE = "space"


class ReconstructPage(MapPage):
    """A viewer of points: as maps over the camera's image, and in space where OpenGL is there."""

    id = stage = "reconstruct"
    by_pair = True

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("Reconstruct"),
            self.tr("From projector coordinates to points in the camera's frame, each with its sigma."),
            self.tr("Map of the points"),
        )
        self._points: Points | None = None
        self._waiting = ""
        self.method = QComboBox()
        self.method.setAccessibleName(self.tr("Calibration"))
        self.method.setToolTip(self.tr("Calibration"))
        self.method.setMinimumWidth(170)
        self.method.currentIndexChanged.connect(self.look)
        self.export_button = self.add_button(self.tr("Export points…"), self.export, "export")
        self.export_button.setToolTip(self.tr("Write the points as PLY, XYZ or NPZ."))
        self.run_button = self.add_button(self.tr("Reconstruct"), self.run, "run", primary=True)
        self.run_button.setToolTip(self.tr("Reconstruct the chosen capture (F5)."))
        self.why_flat = label("", "muted", wrap=True)
        self.try_button = button(self.tr("Try again"), self._try_again, "refresh", flat=True)
        self.stack = QStackedWidget()
        self.stack.addWidget(self.view)
        self.cloud: CloudView | None = None  # made when it is first wanted: its packages are heavy
        middle = boxed(column(self.state, self.stack, row(self.why_flat, self.try_button), spacing=8))
        self.lay_out(middle, before=(self.method,))
        self._offer_kinds()

    def refresh(self) -> None:
        """Show the captures, the calibrations there are, and the chosen capture's points."""
        self.captures.refresh()
        before = self.method.currentData()
        methods = methods_of(self.session.opened) if self.session.is_open else []
        self.method.blockSignals(True)
        self.method.clear()
        for method in methods:
            self.method.addItem(method_name(method), method)
        self.method.setCurrentIndex(methods.index(before) if before in methods else 0 if methods else -1)
        self.method.blockSignals(False)
        self.look()

    def run(self) -> None:
        """Reconstruct the chosen capture."""
        name, method = self.session.capture_name, self.method.currentData()
        told = partial(self._told, name)
        self.bench.run_stage("reconstruct", keep_points, name, method, on_done=told, **self._devices())

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
                self._devices(),
                on_done=lambda count: self.bench.notify("success", done.format(n=count, path=out)),
            )

    def _devices(self) -> dict[str, str]:
        entry = self.session.capture
        return devices_of(entry.capture if entry else None)

    def look(self) -> None:
        """Read the points of the session's capture, if there are any."""
        able = self.can_run()
        self.run_button.setEnabled(able)
        self.export_button.setEnabled(able)
        if not able:
            self._clear(self.tr("Calibrate first.") if self.method.currentData() is None else "")
            return
        folder, name, method = self.session.opened, self.session.capture_name, self.method.currentData()
        state, path = points_of(folder, name, method, self.session.pair)
        if state == "none":
            self._clear(self.tr("{name} is not reconstructed yet.").format(name=name))
            return
        stale = self.tr("   Out of date: reconstruct it again.") if state == "stale" else ""
        self._waiting = str(path)
        self.bench.views.run(
            name,
            load_points,
            path,
            on_done=partial(self._show, str(path), stale),
            on_failed=lambda failure: self._clear(str(failure.error)),
        )

    def choose(self) -> None:
        """Work the chosen map out, or the cloud, and show it."""
        kind = self.kind.currentData()
        if self._points is None:
            return
        work = (cloud_of, self._points) if kind == SPACE else (map_view, self._points, kind)
        self.bench.views.run(
            kind,
            *work,
            on_done=partial(self._shown, self._points),
            on_failed=lambda failure: self._clear(str(failure.error)),
        )

    def fit(self) -> None:
        """Show the whole image, or the cloud from the camera."""
        if self.cloud is not None and self.stack.currentWidget() is self.cloud:
            self.cloud.look(-90, 0)
        else:
            self.view.fit()

    def _offer_kinds(self) -> None:
        problem = gl_problem(self.bench.settings)
        self.offer(KINDS if problem else (*KINDS, SPACE), kind_name)
        text = self.tr("No view in space: {problem}. The shaded height shows the surface instead.")
        self.why_flat.setText(text.format(problem=problem) if problem else "")
        self.why_flat.setHidden(not problem)
        self.try_button.setHidden(not (problem and self.bench.settings.flag(TRYING)))

    def _try_again(self) -> None:
        """Forget that the driver failed."""
        self.bench.settings.set(TRYING, False)
        self._offer_kinds()

    def _told(self, name: str, _path: Path) -> None:
        self.bench.notify("success", self.tr("Reconstructed: {name}.").format(name=name))

    def _show(self, path: str, stale: str, points: Points) -> None:
        if path != self._waiting:
            return
        self._points = points
        share = points.count / max(1, points.xyz_mm[..., 2].size)
        self.say(self.tr("{n} points, {p:.1%} of the image.").format(n=points.count, p=share) + stale)
        self.choose()

    def _shown(self, points: Points, made: MapView | Cloud | None) -> None:
        if points is not self._points:
            return
        if isinstance(made, Cloud):
            self._show_cloud(made)
        else:
            self.stack.setCurrentWidget(self.view)
            self.show_map(made, self._coordinates)

    def _show_cloud(self, cloud: Cloud) -> None:
        if self.cloud is None:
            from stripe_gui.widgets.cloud_view import CloudView

            self.bench.settings.set(TRYING, True)
            self.cloud = CloudView(self.tr("Points in space"))
            self.cloud.painted.connect(self._painted)
            self.stack.addWidget(self.cloud)
        self.cloud.show_cloud(cloud)
        self.stack.setCurrentWidget(self.cloud)

    def _painted(self) -> None:
        """The driver is fit for it; nothing more needs to be watched."""
        self.bench.settings.set(TRYING, False)
        if self.cloud is not None:
            self.cloud.painted.disconnect(self._painted)

    def _coordinates(self, u: int, v: int) -> str:
        if self._points is None:
            return ""
        x, y, z = self._points.xyz_mm[v, u]
        return f"X {x:.3f}   Y {y:.3f}   Z {z:.3f} mm" if z == z else ""

    def _clear(self, text: str) -> None:
        self._points, self._waiting = None, ""
        self.stack.setCurrentWidget(self.view)
        self.show_map(None)
        self.say(text)
