"""What can be chosen about a calibration, each choice with what follows from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QBoxLayout, QCheckBox, QGridLayout, QLabel, QVBoxLayout, QWidget

from core.geometry import LENSES
from core.pipeline import METHODS, CalibrateOptions
from core.pipeline.options import DEVICES
from stripe_gui.presenters.status import device_name
from stripe_gui.presenters.told import told
from stripe_gui.presenters.work import CalibrateChoice, chosen_methods
from stripe_gui.widgets.layout import boxed, choice, column, emptied, label, real, refill, row


class CalibrateForm(QWidget):
    """Method and options."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._base = CalibrateOptions()
        self._consequences: dict[QWidget, QLabel] = {}
        self.parameters: dict[str, QCheckBox] = {}  # by names such as "camera.A3"; ticked: estimated
        self._devices: dict[str, tuple[str, ...]] = {}
        self._pairs: tuple[tuple[str, str], ...] = ()
        self._make_fields()
        methods = self._block(self.tr("Method"), self.method)
        network = [self._block("", self.rigid), self._block("", self.reject, self.limit), self._parameters()]
        self._pair = boxed(self._block(self.tr("Camera and projector"), self.pair))
        depth: list[QWidget | QVBoxLayout] = [
            self._pair,
            self._block(self.tr("Depth as a function of the phase"), self.degree),
            self._block(self.tr("Low-pass of the depth calibration"), self.low_pass),
        ]
        left = column(label(self.tr("Photogrammetric"), "heading"), *network, None, spacing=14)
        right = column(label(self.tr("Polynomial depth"), "heading"), *depth, None, spacing=14)
        self._halves = row((left, 3), (right, 2), spacing=36)
        layout = column(methods, self._halves, None, spacing=14)
        layout.insertSpacing(1, 4)
        self.setLayout(layout)
        self.show_devices(dict.fromkeys(DEVICES, LENSES["A1..A6"].names))
        self.show_pairs((), DEVICES)
        self.set_choice(CalibrateChoice())

    def show_devices(self, devices: Mapping[str, tuple[str, ...]]) -> None:
        """Offer the parameters of these devices, all of them to be estimated."""
        if devices == self._devices:
            return
        self._devices = dict(devices)
        emptied(self._grid)
        self.parameters = {f"{device}.{name}": QCheckBox(name) for device, names in devices.items() for name in names}
        for i, (device, names) in enumerate(devices.items()):
            self._grid.addWidget(label(device_name(device), "muted"), i, 0)
            for j, name in enumerate(names):
                box = self.parameters[f"{device}.{name}"]
                box.setChecked(True)
                box.toggled.connect(self._change)
                text = self.tr("{device}: estimate {name}")
                box.setAccessibleName(text.format(name=name, device=device_name(device)))
                self._grid.addWidget(box, i, j + 1)
        self._grid.setColumnStretch(max(map(len, devices.values())) + 1, 1)
        self._change()

    def show_pairs(self, pairs: Sequence[tuple[str, str]], meant: tuple[str, str]) -> None:
        """Offer the pairs whose depth can be calibrated, where there are several; what is shown means one."""
        self._pairs, self._meant = tuple(pairs), meant
        names = [" – ".join(pair) for pair in pairs]
        refill(self.pair, zip(names, names, strict=True), " – ".join(meant))
        self._pair.setVisible(len(pairs) > 1)

    def set_narrow(self, narrow: bool) -> None:
        """Put what belongs to the two methods below each other, or side by side."""
        ways = QBoxLayout.Direction
        self._halves.setDirection(ways.TopToBottom if narrow else ways.LeftToRight)

    def _make_fields(self) -> None:
        methods = [(self.tr("all, as far as captures allow"), "all"), *((told(m), m) for m in METHODS)]
        self.method = choice("", self._change, *methods)
        self.rigid = QCheckBox(self.tr("Camera and projector rigidly joined"))
        self.reject = QCheckBox(self.tr("Reject gross errors beyond"))
        self.limit = real(self.tr("Limit of gross errors"), 3.0, 99.0, 1, self._change, " σ", step=0.5)
        degrees = [(self.tr("polynomial of degree {n}").format(n=degree), degree) for degree in (1, 2, 3, 4, 5)]
        self.degree = choice("", self._change, *degrees, (self.tr("table, linear between plates"), None))
        self.pair = choice("", self._change)
        self.low_pass = real("", 0.0, 20.0, 2, self._change, " px", step=0.5)
        self.low_pass.setSpecialValueText(self.tr("none"))
        for box in (self.rigid, self.reject):
            box.toggled.connect(self._change)

    def _block(self, name: str, widget: QWidget, *beside: QWidget) -> QVBoxLayout:
        """Give a field with its name above and its consequence below."""
        self._consequences[widget] = text = _small()
        if not widget.accessibleName():
            widget.setAccessibleName(name or getattr(widget, "text", str)())
        field = boxed(row(widget, *beside, None, spacing=6)) if beside else widget
        return column(*([label(name)] if name else []), field, text, spacing=5)

    def _parameters(self) -> QVBoxLayout:
        self._grid = QGridLayout()
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setHorizontalSpacing(10)
        self._grid.setVerticalSpacing(2)
        self._held = _small()
        return column(label(self.tr("Parameters to estimate")), boxed(self._grid), self._held, spacing=5)

    # ---------------------------------------------------------------------------------------------------------- choices

    def choice(self) -> CalibrateChoice:
        options = replace(
            self._base,
            rigid=self.rigid.isChecked(),
            degree=self.degree.currentData(),
            low_pass_px=self.low_pass.value(),
            hold=tuple(name for name, box in self.parameters.items() if not box.isChecked()),
            reject_beyond=self.limit.value() if self.reject.isChecked() else None,
        )
        if self._pairs and (pair := self._pairs[self.pair.currentIndex()]) != self._meant:
            options = replace(options, camera=pair[0], projector=pair[1])
        return CalibrateChoice(self.method.currentData(), options)

    def set_choice(self, choice: CalibrateChoice) -> None:
        """Show a choice; what the form does not offer is kept as it is."""
        options = self._base = choice.options
        self.blockSignals(True)
        self.method.setCurrentIndex(self.method.findData(choice.method))
        self.rigid.setChecked(options.rigid)
        self.reject.setChecked(options.reject_beyond is not None)
        self.limit.setValue(options.reject_beyond or CalibrateOptions.reject_beyond or 0.0)
        for name, box in self.parameters.items():
            box.setChecked(name not in options.hold)
        if self.degree.findData(options.degree) < 0:
            self.degree.addItem(self.tr("polynomial of degree {n}").format(n=options.degree), options.degree)
        self.degree.setCurrentIndex(self.degree.findData(options.degree))
        self.low_pass.setValue(options.low_pass_px)
        self.blockSignals(False)
        self._change()

    def _change(self) -> None:
        read = {name for method in chosen_methods(self.method.currentData()) for name in METHODS[method].options}
        for option, widget in (
            ("rigid", self.rigid),
            ("reject_beyond", self.reject),
            *(("hold", box) for box in self.parameters.values()),
            ("degree", self.degree),
            ("low_pass_px", self.low_pass),
            ("camera", self.pair),
        ):
            widget.setEnabled(option in read)
        self.limit.setEnabled(self.reject.isEnabled() and self.reject.isChecked())
        for field, text in self._texts().items():
            if field in self._consequences:
                self._consequences[field].setText(text)
        self._held.setText(self._held_words())
        self.changed.emit()

    # ------------------------------------------------------------------------------------------------------------ words

    def _texts(self) -> dict[QWidget, str]:
        degree, method = self.degree.currentData(), self.method.currentData()
        return {
            self.method: self.tr("They can be compared at every plane. Takes as long as all of them together.")
            if method == "all"
            else told(METHODS[method].about),
            self.rigid: self.tr(
                "One relative orientation for all poses: more redundancy. The program tests whether the rig was rigid."
            )
            if self.rigid.isChecked()
            else self.tr("Every station is oriented on its own: right if the rig was moved or knocked; wider sigmas."),
            self.reject: self.tr(
                "Targets that contradict all others are left out one by one and counted; good ones stay."
            )
            if self.reject.isChecked()
            else self.tr("Every observation counts; a single wrong target can spoil the result. They are only named."),
            self.degree: self.tr("Passes through every plate position; their noise goes straight into the depth.")
            if degree is None
            else self.tr(
                "Needs at least {n} plate positions. A higher degree follows the optics more closely and the noise too."
            ).format(n=degree + 1),
            self.pair: self.tr("The depth of this camera's pixels follows from this projector's lines."),
            self.low_pass: self.tr("Every pixel keeps its own depth curve; its noise stays in the result.")
            if self.low_pass.value() == 0
            else self.tr("Neighbouring pixels are averaged: less noise, and detail finer than this is lost."),
        }

    def _held_words(self) -> str:
        held = [name for name, box in self.parameters.items() if not box.isChecked()]
        if not held:
            return self.tr("All are estimated: right where the images are rolled, convergent and filled to the edges.")
        text = self.tr("Held: {names}. c stays nominal, others zero; the residuals take what they would explain.")
        return text.format(names=", ".join(held))


def _small() -> QLabel:
    """Give a text a little smaller than the rest."""
    made = label("", "muted", wrap=True)
    font = made.font()
    font.setPointSizeF(font.pointSizeF() - 0.5)
    made.setFont(font)
    return made
