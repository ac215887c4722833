"""A line that says whether the rig still stands as it was calibrated, by the capture that is looked at."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QFrame

from stripe_gui.presenters.drift import Health, health_of
from stripe_gui.presenters.folder import frames_key, version
from stripe_gui.widgets.layout import button, label, row
from stripe_gui.widgets.notice import COLOURS, Sign
from stripe_gui.workbench import Workbench

WAIT_MS = 400  # an operator who walks through the captures is not followed
MOST_KEPT = 5000


class HealthStrip(QFrame):
    """Looks in the background; takes no room where nothing is calibrated."""

    def __init__(self, bench: Workbench) -> None:
        super().__init__()
        self.bench = bench
        self._known: dict[tuple[Any, ...], Health] = {}
        self._asked: tuple[Any, ...] = ()
        self.text = label("", "muted", wrap=True)
        self.chart_button = button(self.tr("Drift chart"), lambda: bench.show_page("rig#drift"), flat=True)
        self.sign = Sign("info", "accent", 18)
        self.setLayout(row(self.sign, (self.text, 1), self.chart_button, spacing=8))
        self._timer = QTimer(self, singleShot=True, interval=WAIT_MS)
        self._timer.timeout.connect(self._look)
        bench.session.capture_changed.connect(self.refresh)
        self.hide()

    def refresh(self, _capture: str = "") -> None:
        page = self.parentWidget()
        if page is None or not page.isVisible():
            return
        self._asked = self._key()
        known = self._known.get(self._asked)
        self.setVisible(bool(self._asked))  # at once: nothing is to move under the mouse later
        self._show(known or Health("info", self.tr("Looking whether the rig has moved …")))
        if known is None and self._asked:
            self._timer.start()

    def _key(self) -> tuple[Any, ...]:
        session = self.bench.session
        entry = session.capture if session.is_open else None
        calibration = version(session.opened.result_file("photogrammetric.npz")) if session.is_open else None
        if entry is None or entry.capture is None or calibration is None:
            return ()
        return *frames_key(entry.capture), calibration

    def _look(self) -> None:
        page = self.parentWidget()
        if page is None or not page.isVisible():
            return
        entry, asked = self.bench.session.capture, self._asked
        if entry is None or entry.capture is None or asked != self._key():
            return

        def done(health: Health) -> None:
            while len(self._known) >= MOST_KEPT:
                self._known.pop(next(iter(self._known)))
            self._known[asked] = health
            self.refresh()

        project = self.bench.session.opened.project
        self.bench.watch.run("rig", health_of, project, entry.capture, on_done=done)

    def _show(self, health: Health) -> None:
        self.sign.take(health.kind, COLOURS[health.kind])
        self.text.setText(health.words)
        self.text.setToolTip(health.more)
        self.setAccessibleName(health.words)
