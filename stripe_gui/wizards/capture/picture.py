"""The live picture: what the camera sees in the projector's light, over-exposed pixels hatched and counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QRectF, QSignalBlocker, QTimer, Signal
from PySide6.QtGui import QColor, QHideEvent
from PySide6.QtWidgets import QCheckBox, QDoubleSpinBox, QWidget

from core.devices import Setting, with_option
from stripe_gui import theme
from stripe_gui.presenters.failures import describe
from stripe_gui.presenters.looking import Look
from stripe_gui.presenters.told import sentence
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import boxed, button, card, choice, column, label, make, row
from stripe_gui.wizards.capture.devices import DevicesStep
from stripe_gui.workbench import Workbench

PAUSE_MS = 40  # between two images: the window stays quick
HATCH_PX = 6


def hatch(clipped: NDArray[np.bool_], colour: str) -> NDArray[np.uint8]:
    """Draw slanted lines over the marked pixels, shape (H, W, 4).

    Examples
    --------
    >>> marks = hatch(np.array([[True, False], [True, True]]), "#ff0000")
    >>> (marks[..., 3] > 0).tolist()
    [[True, False], [True, True]]
    """
    y, x = np.ogrid[: clipped.shape[0], : clipped.shape[1]]
    line = (x + y) % HATCH_PX < HATCH_PX / 2
    marks = np.zeros((*clipped.shape, 4), np.uint8)
    full = QColor(colour)
    marks[clipped & line] = (full.red(), full.green(), full.blue(), 255)
    marks[clipped & ~line] = (255, 255, 255, 255)
    return marks


class PictureStep(QWidget):
    """The live picture and what sets it: the light, the exposure."""

    changed = Signal()

    def __init__(self, bench: Workbench, devices: DevicesStep) -> None:
        super().__init__()
        self.bench, self.devices = bench, devices
        self.view = ImageView(self.tr("Live picture"))
        self.marks = pg.ImageItem(axisOrder="row-major")
        self.marks.setZValue(5)
        self.view.add_item(self.marks)
        lights = (self.tr("White"), "white"), (self.tr("Finest stripes"), "stripes"), (self.tr("Black"), "black")
        self.light = choice(self.tr("Light"), None, *lights)
        self.live = QCheckBox(self.tr("Live"))
        self.live.setChecked(True)
        self.live.toggled.connect(self._again)
        self.clipped = label("–", "figure")
        self.clipped.setAccessibleName(self.tr("Over-exposed"))
        self.advice = label("", wrap=True)
        self.brightest = label("", "muted", wrap=True)
        self.exposure = make(QDoubleSpinBox, keyboardTracking=False)
        self.exposure.valueChanged.connect(self._expose)
        self.exposure_label = label("")
        self.fixed = label(
            self.tr("This camera's exposure is set on the camera itself, or by its own program."), "muted", wrap=True
        )
        fit = button(self.tr("Whole image"), self.view.fit, "fit", flat=True)
        light = card(self.light, row(self.live, None, fit), title=self.tr("Light"))
        words, setting = (self.clipped, self.advice, self.brightest), (self.exposure_label, self.exposure, self.fixed)
        figures = card(*words, *setting, title=self.tr("Over-exposed"), spacing=6)
        side = boxed(column(light, figures, None))
        side.setFixedWidth(240)
        self.pose = label("", wrap=True)
        self.tell_pose("")
        self.setLayout(row(column(self.pose, (self.view, 1), spacing=8), side))
        self._timer = QTimer(self, singleShot=True, interval=PAUSE_MS)
        self._timer.timeout.connect(self._again)
        self._look: Look | None = None

    def enter(self) -> None:
        self._show_setting()
        self.live.setEnabled(True)
        self._again()

    def tell_pose(self, words: str) -> None:
        """Say how to hold the board while it is looked at; nothing where nothing was found out."""
        self.pose.setText(self.tr("A good next pose, by the calibration in use: {words}.").format(words=words))
        self.pose.setVisible(bool(words))

    def hideEvent(self, event: QHideEvent) -> None:  # noqa: N802
        """Stop looking; the devices are let go."""
        super().hideEvent(event)
        self._timer.stop()

    def _again(self, *_: object) -> None:
        if not self.isVisible() or not self.live.isChecked():
            return
        self._timer.stop()
        self.bench.views.run(
            self.tr("Live picture"),
            self.devices.rig.look,
            self.devices.urls,
            self.light.currentData(),
            on_done=self._show,
            on_failed=lambda failure: self._failed(failure.error),
        )

    def _show(self, look: Look) -> None:
        self._look = look
        self.view.set_image(look.image, (0.0, look.full))
        height, width = look.image.shape
        percent = look.clipped_percent
        self.marks.setVisible(percent > 0)
        if percent > 0:
            self.marks.setImage(hatch(look.clipped, theme.current().danger), autoLevels=False)
            self.marks.setRect(QRectF(-0.5, -0.5, width, height))
        self.clipped.setText(f"{percent:.2f} %")
        self.advice.setText(self._advice(look))
        text = self.tr("The brightest places use {share:.0f} % of the camera's range.")
        self.brightest.setText(text.format(share=100 * look.brightest))
        if self.isVisible() and self.live.isChecked():
            self._timer.start()

    def _advice(self, look: Look) -> str:
        if look.clipped_percent > 0.1:
            return self.tr("The hatched pixels are over-exposed: expose less or close the aperture.")
        if self.light.currentData() == "white" and look.brightest < 0.5:
            return self.tr("There is room: expose longer or open the aperture.")
        return self.tr("Nothing that matters is over-exposed.")

    def _failed(self, error: BaseException) -> None:
        told = describe(error)
        self.live.setChecked(False)
        self.advice.setText(f"{sentence(told.happened)}: {told.remedy}.")
        self.clipped.setText("–")

    def _show_setting(self) -> None:
        setting = self.devices.connection.setting if self.devices.connection else None
        for widget in (self.exposure, self.exposure_label):
            widget.setVisible(setting is not None)
        self.fixed.setVisible(setting is None)
        if setting is None:
            return
        word = self.tr("Gain") if setting.what == "gain" else self.tr("Exposure")
        self.exposure_label.setText(word)
        self.exposure.setAccessibleName(word)
        with QSignalBlocker(self.exposure):
            fine = setting.what == "gain"
            self.exposure.setDecimals(2 if fine else 0)
            self.exposure.setRange(0.01 if fine else -100.0, 100.0 if fine else 1e7)
            self.exposure.setSingleStep(0.1 if fine else max(1.0, abs(setting.value) / 10))
            self.exposure.setSuffix(f" {setting.unit}" if setting.unit else "")
            self.exposure.setValue(setting.value)

    def _expose(self, value: float) -> None:
        connection = self.devices.connection
        if connection is None or connection.setting is None:
            return
        projector, camera = self.devices.urls
        url = with_option(camera, connection.setting.option, value)
        self._timer.stop()
        self.bench.views.run(
            self.tr("Exposure"),
            self.devices.rig.adjust,
            value,
            (projector, url),
            on_done=lambda setting: self._exposed(url, setting),
            on_failed=lambda failure: self._failed(failure.error),
        )

    def _exposed(self, url: str, setting: Setting | None) -> None:
        if self.devices.connection is not None and setting is not None:
            self.devices.adjusted(url, replace(self.devices.connection, setting=setting))
        self._show_setting()
        self._again()
