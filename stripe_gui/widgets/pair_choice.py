"""Whose frames are looked at, where a rig has several cameras or projectors."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QComboBox, QWidget

from stripe_gui.session import Session


class PairChoice(QComboBox):
    """Cameras by name, with their projector where there are several; hidden for one camera and one projector."""

    def __init__(self, session: Session, parent: QWidget) -> None:
        super().__init__(parent)
        self._session = session
        self._pairs: tuple[tuple[str, str], ...] = ()
        self.setAccessibleName(self.tr("Camera and projector"))
        self.setToolTip(self.tr("Whose frames are shown."))
        self.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToContents)
        self.setVisible(False)
        self.currentIndexChanged.connect(lambda i: session.choose_pair(self._pairs[i]))
        for changed in (session.project_changed, session.refreshed, session.capture_changed):
            changed.connect(self.refresh)  # no lambda: the session outlives the widget
        self.refresh()

    def refresh(self, _capture: str = "") -> None:
        rig = self._session.opened.project.rig if self._session.is_open else None
        pairs = rig.pairs if rig is not None and not rig.is_pair else ()
        with QSignalBlocker(self):
            if pairs != self._pairs:
                self._pairs = pairs
                self.clear()
                several = rig is not None and len(rig.projectors) > 1
                for camera, projector in pairs:
                    both = self.tr("{camera} with {projector}").format(camera=camera, projector=projector)
                    self.addItem(both if several else camera)
            if pairs:
                self.setCurrentIndex(pairs.index(self._session.pair))
        self.setVisible(bool(pairs))
