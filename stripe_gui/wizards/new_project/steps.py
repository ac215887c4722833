"""Name and rig of a new project: one widget a step, each takes and gives its part of the draft."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QGridLayout, QLineEdit, QSpinBox, QWidget

from core.model import DeviceSpec
from stripe_gui.presenters.new_project import place_problem, suggested_folder
from stripe_gui.presenters.rig_space import planned, rig_scene
from stripe_gui.presenters.rig_view import RigPlan, RigView, presets, rig_problem, rig_view, rig_words
from stripe_gui.presenters.space import Scene
from stripe_gui.widgets.layout import boxed, button, card, column, form, label, make, named, real, row, whole
from stripe_gui.widgets.space_view import SpaceView
from stripe_gui.workbench import Workbench

FORM_WIDTH = 350


class PlaceStep(QWidget):
    """What the project is called and where it lies."""

    changed = Signal()

    def __init__(self, bench: Workbench) -> None:
        super().__init__()
        self._bench = bench
        self._followed = ""  # the folder suggested last: it follows the name until the operator chooses another
        self.name = make(QLineEdit, accessibleName=self.tr("Name of the project"))
        self.name.textEdited.connect(self._follow)
        self.folder = make(QLineEdit, accessibleName=self.tr("Folder of the project"))
        for field in (self.name, self.folder):
            field.textChanged.connect(self.changed)
        self.choose_button = button(self.tr("Choose…"), self._choose, "folder")
        self.choose_button.setAccessibleName(self.tr("Choose the folder"))
        folder = boxed(row(self.folder, self.choose_button, spacing=8))
        fields = form((self.tr("Name"), self.name), (self.tr("Folder"), folder))
        about = self.tr(
            "A project is a folder: the rig and the boards in small files, every capture in a folder of its "
            "own, and the results. The folder has to be new or empty; it can be moved and copied as a whole."
        )
        frame = card(fields, label(about, "muted", wrap=True))
        frame.setFixedWidth(640)
        self.setLayout(column(row(frame, None), None, margins=(0, 4, 0, 0)))

    def show_place(self, name: str, folder: str) -> None:
        self._followed = folder
        self.name.setText(name)
        self.folder.setText(folder)

    def problem(self) -> str:
        return place_problem(self.name.text(), self.folder.text())

    def _follow(self, name: str) -> None:
        if self.folder.text() == self._followed and self._followed:
            self._followed = str(suggested_folder(Path(self._followed).parent, name))
            self.folder.setText(self._followed)

    def _choose(self) -> None:
        here = Path(self.folder.text()).expanduser()
        start = next((path for path in (here, *here.parents) if path.is_dir()), Path.home())
        chosen = self._bench.dialogs.open_folder(self, self.tr("Choose a new or empty folder for the project"), start)
        if chosen is not None:
            self.folder.setText(str(chosen))


class DeviceFields:
    """The five numbers of a device, to be put beside those of the other."""

    def __init__(self, device: str, unit: str, words: dict[str, str], changed: Callable[[], None]) -> None:
        def name(key: str) -> str:
            return f"{device}: {words[key]}"

        self.width = whole(name("width"), 1, 100_000, changed, f" {unit}")
        self.height = whole(name("height"), 1, 100_000, changed, f" {unit}")
        self.pitch_x = real(name("pitch_x"), 0.01, 10_000, 3, changed, " µm")
        self.pitch_y = real(name("pitch_y"), 0.01, 10_000, 3, changed, " µm")
        self.c = real(name("c"), 0.1, 10_000, 3, changed, " mm")

    def all(self) -> tuple[QSpinBox | QDoubleSpinBox, ...]:
        return self.width, self.height, self.pitch_x, self.pitch_y, self.c

    def show_spec(self, spec: DeviceSpec) -> None:
        values = (spec.width, spec.height, 1000 * spec.pitch_mm[0], 1000 * spec.pitch_mm[1], spec.nominal_c_mm)
        for field, value in zip(self.all(), values, strict=True):
            with QSignalBlocker(field):
                field.setValue(value)  # type: ignore[arg-type]

    def spec(self) -> DeviceSpec:
        pitch = round(self.pitch_x.value() / 1000, 6), round(self.pitch_y.value() / 1000, 6)
        return DeviceSpec(self.width.value(), self.height.value(), pitch, self.c.value())


class RigStep(QWidget):
    """Camera and projector, from a preset or typed, and the sketch that follows."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        words = {
            "width": self.tr("Width"),
            "height": self.tr("Height"),
            "pitch_x": self.tr("Pitch across"),
            "pitch_y": self.tr("Pitch down"),
            "c": self.tr("Focal length"),
        }
        self._presets = presets()
        self.preset = make(QComboBox, accessibleName=self.tr("Rig to start from"), minimumContentsLength=12)
        self.preset.addItems([*(name for name, _ in self._presets), self.tr("Custom")])
        self.preset.activated.connect(self._take_preset)
        self.camera = DeviceFields(self.tr("Camera"), self.tr("px"), words, self._typed)
        self.projector = DeviceFields(self.tr("Projector"), self.tr("lines"), words, self._typed)
        self.distance = real(self.tr("Working distance"), 1.0, 100_000.0, 1, self._typed, " mm")
        self.base = real(self.tr("Base"), 1.0, 100_000.0, 1, self._typed, " mm")
        for field in (self.distance, self.base):
            field.setToolTip(self.tr("For the sketch and the advice only; calibration finds the true orientation."))
        self.sketch = SpaceView(self.tr("Sketch of the rig"))
        self.figures = label("", wrap=True)
        self.words = label("", "muted", wrap=True)
        self.view: RigView | None = None
        self._problem = ""
        self._lay_out(words)

    def _lay_out(self, words: dict[str, str]) -> None:
        grid = QGridLayout()
        grid.setHorizontalSpacing(10)
        grid.setVerticalSpacing(8)
        grid.addWidget(label(self.tr("Camera"), "heading"), 0, 1)
        grid.addWidget(label(self.tr("Projector"), "heading"), 0, 2)
        for i, (name, left, right) in enumerate(
            zip(words.values(), self.camera.all(), self.projector.all(), strict=True), 1
        ):
            grid.addWidget(named(name, left), i, 0)
            grid.addWidget(left, i, 1)
            grid.addWidget(right, i, 2)
        for i, (name, field) in enumerate(
            ((self.tr("Working distance"), self.distance), (self.tr("Base"), self.base)), 1 + len(words)
        ):
            grid.addWidget(named(name, field), i, 0)
            grid.addWidget(field, i, 1)
        grid.addWidget(label(self.tr("(sketch only)"), "muted"), 1 + len(words), 2)
        grid.setColumnStretch(1, 1)
        grid.setColumnStretch(2, 1)
        typed = boxed(column(self.preset, grid, None, spacing=10))
        typed.setFixedWidth(FORM_WIDTH + 40)
        frame = card((self.sketch, 1), self.figures, self.words)
        self.setLayout(column(row(typed, frame, spacing=16), margins=(0, 4, 0, 0)))

    def show_rig(self, rig: RigPlan) -> None:
        self.camera.show_spec(rig.camera)
        self.projector.show_spec(rig.projector)
        for field, value in ((self.distance, rig.distance_mm), (self.base, rig.base_mm)):
            with QSignalBlocker(field):
                field.setValue(value)
        self._typed()

    def rig(self) -> RigPlan:
        return RigPlan(self.camera.spec(), self.projector.spec(), self.distance.value(), self.base.value())

    def problem(self) -> str:
        return self._problem

    def _take_preset(self, index: int) -> None:
        if index < len(self._presets):
            self.show_rig(self._presets[index][1])

    def _typed(self) -> None:
        rig = self.rig()
        devices = [(plan.camera, plan.projector) for _, plan in self._presets]
        known = (rig.camera, rig.projector)
        self.preset.setCurrentIndex(devices.index(known) if known in devices else len(devices))
        self._problem = rig_problem(rig)
        self.view = None if self._problem else rig_view(rig)
        reach = 0.9 * rig.distance_mm, 1.1 * rig.distance_mm
        self.sketch.show_scene(Scene() if self._problem else rig_scene(planned(rig), reach, np.zeros((0, 3))))
        self.figures.setText(self._figures(self.view) if self.view else "")
        words = rig_words(self.view) if self.view else [self._problem]
        self.words.setText(" ".join(words))
        self.words.setVisible(bool(words) and self.words.parent() is not None)
        self.changed.emit()

    def _figures(self, view: RigView) -> str:
        size = self.tr("On the object: 1 px = {px:.3f} mm, 1 line = {line:.3f} mm.")
        depth = self.tr("Axes meet at {angle:.1f}°: 1 line = {depth:.2f} mm in depth.")
        first = size.format(px=view.camera.unit_mm, line=view.projector.unit_mm)
        return f"{first}\n{depth.format(angle=view.convergence_deg, depth=view.depth_per_line_mm)}"
