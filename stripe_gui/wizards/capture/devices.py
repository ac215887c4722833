"""Projector and camera: chosen from a list or typed as a URL, and asked whether they answer."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QComboBox, QLineEdit, QWidget

from core.model import Project
from stripe_gui.presenters.capturing import (
    Connection,
    DeviceKind,
    camera_kinds,
    connect,
    in_scene,
    projector_kinds,
    scene_of,
    scenes,
    url_problem,
)
from stripe_gui.presenters.failures import describe
from stripe_gui.presenters.looking import Rig
from stripe_gui.presenters.told import sentence
from stripe_gui.screens import screen_names
from stripe_gui.widgets.layout import boxed, button, card, column, emptied, label, make, refill, row
from stripe_gui.widgets.notice import Sign
from stripe_gui.workbench import Workbench


class DeviceCard(QWidget):
    """One device: a list of kinds, what the chosen kind is for, and its URL."""

    changed = Signal()

    def __init__(self, title: str, name: str) -> None:
        super().__init__()
        self._kinds: tuple[DeviceKind, ...] = ()
        self.kind = make(QComboBox, accessibleName=self.tr("{device}: kind").format(device=name))
        self.kind.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.url = make(QLineEdit, accessibleName=self.tr("{device}: address").format(device=name))
        self.explanation = label("", "muted", wrap=True)
        self.explanation.setMinimumHeight(36)
        self.explanation.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.setLayout(column(card(self.kind, self.url, self.explanation, None, title=title)))
        self.kind.currentIndexChanged.connect(self._take_kind)
        self.url.textChanged.connect(self._typed)

    def offer(self, kinds: tuple[DeviceKind, ...], url: str) -> None:
        """Offer kinds of devices, and show one URL."""
        self._kinds = kinds
        refill(self.kind, [(kind.title, kind.kind) for kind in kinds], None)
        self.url.setText(url)
        self._typed()

    def _take_kind(self, index: int) -> None:
        if 0 <= index < len(self._kinds):
            self.url.setText(self._kinds[index].url)

    def _typed(self) -> None:
        at = next((i for i, k in enumerate(self._kinds) if self.url.text().startswith(f"{k.kind}:")), -1)
        with QSignalBlocker(self.kind):
            self.kind.setCurrentIndex(at)
        self.explanation.setText(self._kinds[at].explanation if at >= 0 else url_problem(self.url.text()))
        self.changed.emit()


class DevicesStep(QWidget):
    """Both devices, the scene of the virtual bench, and the connection test with its result in words."""

    changed = Signal()

    def __init__(self, bench: Workbench, rig: Rig) -> None:
        super().__init__()
        self.bench, self.rig = bench, rig
        self.connection: Connection | None = None
        self._tested: tuple[str, str] | None = None
        self.project: Project | None = None
        self.projector = DeviceCard(self.tr("Projector"), self.tr("Projector"))
        self.camera = DeviceCard(self.tr("Camera"), self.tr("Camera"))
        what = self.tr("What stands before the virtual rig")
        self.scene = make(QComboBox, accessibleName=what, minimumWidth=180)
        self.scene.textActivated.connect(self.choose_scene)
        before, after = label(self.tr("Before the virtual rig stands")), label(self.tr("of its experiment."))
        self.scene_row = boxed(row(before, self.scene, after, None))
        self.test_button = button(self.tr("Test the connection"), self.test, "run")
        self.result = column(spacing=6)
        result = card(row(label(self.tr("Connection"), "heading"), None, self.test_button), self.result)
        self.setLayout(column(row((self.projector, 1), (self.camera, 1)), self.scene_row, result, None))
        self.projector.changed.connect(self._follow_projector)
        self.camera.changed.connect(self._changed)

    @property
    def urls(self) -> tuple[str, str]:
        return self.projector.url.text().strip(), self.camera.url.text().strip()

    def missing(self) -> str:
        if self._tested == self.urls and self.connection is not None:
            return ""
        return self.tr("Test the connection first.")

    def offer(self, project: Project, virtual: str, urls: tuple[str, str]) -> None:
        self.project, self.connection, self._tested = project, None, None
        self.projector.offer(projector_kinds(virtual, screen_names()), urls[0])
        self.camera.offer(camera_kinds(virtual), urls[1])
        self._say(None, ())
        self._list_scenes()

    def enter(self) -> None:
        self._list_scenes()
        if self.missing() and scene_of(self.urls[0]) and scene_of(self.urls[1]):
            self.test()

    def choose_scene(self, scene: str) -> None:
        kept = self.connection if not self.missing() else None
        self.projector.url.setText(in_scene(self.projector.url.text(), scene))
        self.camera.url.setText(in_scene(self.camera.url.text(), scene))
        if kept is not None:  # the same rig, looking at something else
            self.connection, self._tested = kept, self.urls
        self.scene.setCurrentText(scene)
        self.changed.emit()

    def adjusted(self, camera_url: str, connection: Connection) -> None:
        """Take over another exposure of the same camera."""
        self.camera.url.setText(camera_url)
        self.connection, self._tested = connection, self.urls
        self.changed.emit()

    def test(self) -> None:
        if self.project is None:
            return
        urls = self.urls
        if problem := url_problem(urls[0]) or url_problem(urls[1]):
            self._say("error", (problem,))
            return
        self.connection, self._tested = None, None
        first_use = self.tr("At its very first use the virtual bench is compiled, which can take a minute.")
        self._say("info", (self.tr("Asking both devices …"), first_use if scene_of(urls[0]) else ""))
        self.changed.emit()
        self.bench.views.run(
            self.tr("Connection test"),
            connect,
            self.project,
            self.rig,
            urls,
            on_done=lambda connection: self._answered(urls, connection),
            on_failed=lambda failure: self._failed(failure.error),
        )

    def _answered(self, urls: tuple[str, str], connection: Connection) -> None:
        if urls != self.urls:
            return
        self.connection, self._tested = connection, urls
        self._say("success", connection.words)
        self.changed.emit()

    def _failed(self, error: BaseException) -> None:
        told = describe(error)
        self._say("error", (f"{told.happened}.".replace("..", "."), f"{told.remedy}.".replace("..", ".")))
        self.changed.emit()

    def _follow_projector(self) -> None:
        """A virtual camera looks at the virtual projector's scene."""
        scene = scene_of(self.projector.url.text())
        if scene and scene_of(self.camera.url.text()) and scene != scene_of(self.camera.url.text()):
            self.camera.url.setText(f"virtual:{scene}")
        self._list_scenes()
        self._changed()

    def _changed(self) -> None:
        if self._tested is not None and self._tested != self.urls:
            self._say(None, ())
        self.changed.emit()

    def _list_scenes(self) -> None:
        scenario = scene_of(self.projector.url.text())
        self.scene_row.setVisible(bool(scenario))
        if scenario and self.scene.property("scenario") != scenario:
            self.scene.setProperty("scenario", scenario)
            self.scene.clear()
            self.scene.addItems(list(scenes(scenario)))

    def _say(self, sign: str | None, lines: tuple[str, ...]) -> None:
        emptied(self.result)
        if sign is None:
            lines = (self.tr("Not tested yet."),)
        colour = {"success": "ok", "error": "danger"}.get(sign or "", "muted")
        for i, line in enumerate(filter(None, lines)):
            sign = "info" if sign == "error" and i else sign  # below what happened stands what to do
            text = label(sentence(line), "" if sign else "muted", wrap=True)
            signs = [Sign(sign, colour if sign != "info" else "muted", 18)] if sign else []
            self.result.addWidget(boxed(row(*signs, (text, 1), spacing=8)))
