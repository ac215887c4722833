"""The points of a capture: shaded height, depth, sigma, and in space; export for other programs."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
from PySide6.QtWidgets import QCheckBox, QComboBox, QStackedWidget

from core.model import Floats, PointCloud, Verdict
from core.pipeline.merge import Merged
from core.pipeline.update import keep_points
from core.pipeline.views import coverage, reconstruct_views, seen_by_several
from stripe_gui.pages.map_page import MapPage
from stripe_gui.presenters.maps import MapView
from stripe_gui.presenters.reconstruct import (
    JOINT_KINDS,
    KINDS,
    Points,
    cameras_of,
    devices_of,
    joint_scene,
    kind_name,
    load_points,
    map_view,
    merged_scene,
    points_of,
    space_of,
)
from stripe_gui.presenters.space import Scene
from stripe_gui.presenters.status import methods_of
from stripe_gui.presenters.told import told
from stripe_gui.presenters.work import export_points, merge_points
from stripe_gui.widgets.health_strip import HealthStrip
from stripe_gui.widgets.layout import boxed, choice, column, refill
from stripe_gui.widgets.space_view import SpaceView
from stripe_gui.widgets.verdict import VerdictList
from stripe_gui.workbench import Workbench


class ReconstructPage(MapPage):
    """A viewer of points: as maps over the camera's image, and in space; those of all cameras in space only."""

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
        calibration = self.tr("Calibration")
        self.method = choice(calibration, self.look, toolTip=calibration, minimumWidth=170)
        self.method.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
        self.export_button = self.add_button(self.tr("Export points…"), self.export, "export")
        self.export_button.setToolTip(self.tr("Write the points as PLY, XYZ or NPZ."))
        self.merge_button = self.add_button(self.tr("Merge captures…"), self.merge)
        self.merge_button.setToolTip(self.tr("Join captures of one object from several stations to one cloud."))
        self.run_button = self.add_button(self.tr("Reconstruct"), self.run, "run", primary=True)
        self.run_button.setToolTip(self.tr("Reconstruct the chosen capture (F5)."))
        self._joint: tuple[tuple[str, bool], PointCloud] | None = None  # of which capture, and whether filled
        self.fill = QCheckBox(self.tr("Texture too"))
        self.fill.hide()
        self.fill.setToolTip(self.tr("Where the code fails, match the texture that two cameras see."))
        self.fill.toggled.connect(self.choose)
        self.stack = QStackedWidget()
        self.stack.addWidget(self.view)
        self.space = SpaceView(self.tr("Points in space"))
        self.stack.addWidget(self.space)
        self.health = HealthStrip(bench)
        self.verdicts = VerdictList()
        self.body.addWidget(self.health)
        self.body.addWidget(self.verdicts)
        self.lay_out(boxed(column(self.state, self.stack, spacing=8)), before=(self.method, self.fill))
        self.offer(KINDS, kind_name)

    def refresh(self) -> None:
        self.captures.refresh()
        self.health.refresh()
        methods = methods_of(self.session.opened) if self.session.is_open else []
        refill(self.method, [(told(m), m) for m in methods], self.method.currentData())
        self.look()

    def run(self) -> None:
        if self._of_all:
            self._joint = None
            self.choose()
            return
        name, method = self.session.capture_name, self.method.currentData()
        told = partial(self._told, name)
        self.bench.run_stage("reconstruct", keep_points, name, method, on_done=told, **self._devices())

    def can_run(self) -> bool:
        entry = self.session.capture
        return entry is not None and entry.capture is not None and self.method.currentData() is not None

    def export(self) -> None:
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
                self._filled,
                on_done=lambda count: self.bench.notify("success", done.format(n=count, path=out)),
            )

    def merge(self) -> None:
        """Ask which captures are of one object and where to, and join their points."""
        title, name = self.tr("Merge captures"), self.session.capture_name
        text = self.tr("Captures of one object. The points come in the frame of the first one's camera.")
        names = [entry.name for entry in self.session.opened.captures() if entry.capture is not None]
        chosen = self.bench.dialogs.choose_several(self, title, text, names, {name})
        if not chosen:
            return
        kinds = self.tr("Point clouds (*.ply *.xyz *.npz)")
        out = self.bench.dialogs.save_file(self, title, kinds, Path.home() / f"{chosen[0]}-merged.ply")
        if out is not None:
            self.bench.run_stage("reconstruct", merge_points, chosen, out, on_done=partial(self._merged, out))

    def _merged(self, out: Path, merged: Merged) -> None:
        """Show by which capture every point was made, until something else is chosen."""
        count = merged.cloud.xyz_mm.shape[1]
        self.bench.notify("success", self.tr("{n} points written to {path}.").format(n=count, path=out))
        scene, words = merged_scene(merged.cloud, merged.sources)
        sigmas = merged.pose_sigmas[:, 3:]
        said = self.tr("{n} captures, poses to {sigma:.3f} mm.")
        sigma = float(np.sqrt((sigmas**2).sum(axis=1)).max())
        told = said.format(n=len(merged.registration.captures), sigma=sigma)
        self.say(f"{told}&emsp;{words}", rich=True)
        self._judged(merged.cloud.verdict)
        self._points = None
        self.space.show_scene(scene)
        self.stack.setCurrentWidget(self.space)

    @property
    def _of_all(self) -> bool:
        return self.kind.currentData() in JOINT_KINDS

    @property
    def _filled(self) -> bool:
        """Whether texture is matched where the code fails."""
        return self._of_all and self.fill.isChecked() and not self.fill.isHidden()

    def _devices(self) -> dict[str, str]:
        if self._of_all:
            return {}
        entry = self.session.capture
        return devices_of(entry.capture if entry else None)

    def look(self) -> None:
        able = self.can_run()
        self.run_button.setEnabled(able)
        self.export_button.setEnabled(able)
        self.merge_button.setEnabled(able and len(self.session.opened.project.captures) > 1)
        if not able:
            self._clear(self.tr("Calibrate first.") if self.method.currentData() is None else "")
            return
        folder, name, method = self.session.opened, self.session.capture_name, self.method.currentData()
        several = self.bench.guarded(seen_by_several, folder.project, name)
        self.offer((*KINDS, *JOINT_KINDS) if several else KINDS, kind_name)
        if self._of_all:
            self.choose()
            return
        state, path = points_of(folder, name, method, self.session.pair)
        if state == "none":
            self._clear(self.tr("{name} is not reconstructed yet.").format(name=name))
            return
        stale = self.tr("   Out of date: reconstruct it again.") if state == "stale" else ""
        self._waiting = str(path)
        self.look_for(name, partial(self._show, str(path), stale), self._clear, load_points, path)

    def choose(self) -> None:
        kind, name = self.kind.currentData(), self.session.capture_name
        self.fill.setVisible(kind in JOINT_KINDS and len(cameras_of(self.session.opened.entry(name))) > 1)
        if kind in JOINT_KINDS:
            self._choose_joint(name)
            return
        if self._points is None:
            self.look()
            return
        work = (space_of, self._points) if kind == "space" else (map_view, self._points, kind)
        self.look_for(kind, partial(self._shown, self._points), self._clear, *work)

    def _choose_joint(self, name: str) -> None:
        """Show the points of all cameras, intersected now if they were not."""
        wanted = name, self._filled
        if self._joint is not None and self._joint[0] == wanted:
            self._show_joint(wanted, (None, self._joint[1]))
            return
        self._clear(self.tr("intersecting the rays of all cameras …"))
        work = partial(reconstruct_views, fill=self._filled), self.session.opened.project, name
        self.look_for(name, partial(self._show_joint, wanted), self._clear, *work)

    def _show_joint(self, wanted: tuple[str, bool], made: tuple[Floats | None, PointCloud]) -> None:
        name = wanted[0]
        if wanted != (self.session.capture_name, self._filled) or not self._of_all:
            return
        if not (cameras := cameras_of(self.session.opened.entry(name))):
            return
        self._joint, self._points, self._waiting = (wanted, made[1]), None, ""
        scene, words = joint_scene(made[1], self.kind.currentData(), cameras)
        said = [self.tr("{n} points.").format(n=made[1].xyz_mm.shape[1])]
        if covered := coverage(made[1]):
            said.append(self.tr("Of the object {by_code:.1%} by code, {filled:.1%} with texture.").format(**covered))
        self.say("&emsp;".join([*said, words]), rich=True)
        self._judged(made[1].verdict)
        self.space.show_scene(scene)
        self.stack.setCurrentWidget(self.space)

    def fit(self) -> None:
        (self.space if self.stack.currentWidget() is self.space else self.view).fit()

    def _told(self, name: str, _path: Path) -> None:
        self.bench.notify("success", self.tr("Reconstructed: {name}.").format(name=name))

    def _show(self, path: str, stale: str, points: Points) -> None:
        if path != self._waiting:
            return
        self._points = points
        share = points.count / max(1, points.xyz_mm[..., 2].size)
        self.say(self.tr("{n} points, {p:.1%} of the image.").format(n=points.count, p=share) + stale)
        self._judged(points.verdict)
        self.choose()

    def _shown(self, points: Points, made: MapView | Scene | None) -> None:
        if points is not self._points:
            return
        if isinstance(made, Scene):
            self.space.show_scene(made)
            self.stack.setCurrentWidget(self.space)
        else:
            self.stack.setCurrentWidget(self.view)
            self.show_map(made, self._coordinates)

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
        self._judged(None)

    def _judged(self, verdict: Verdict | None) -> None:
        """Say what speaks against the points."""
        doubted = verdict is not None and verdict.state != "passed"
        self.verdicts.show_verdicts({self.tr("points"): verdict} if verdict is not None and doubted else {})
