"""Progress of the running job, the time left, and cancel."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QProgressBar, QSizePolicy, QToolButton, QWidget

from stripe_gui.assets import icon
from stripe_gui.jobs import JobQueue
from stripe_gui.presenters.told import told
from stripe_gui.widgets.layout import label, make, row


class JobBar(QWidget):
    """What runs, how far it is and how long it will take."""

    def __init__(self, queue: JobQueue) -> None:
        super().__init__()
        self._queue = queue
        self.text, self.left = label(), label("", "muted")
        self.bar = make(QProgressBar, maximum=1000, textVisible=False, accessibleName=self.tr("Progress"))
        self.bar.setFixedWidth(220)
        self.cancel = make(QToolButton, text=self.tr("Cancel"), icon=icon("stop"), iconSize=QSize(14, 14))
        self.cancel.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.cancel.setAccessibleName(self.tr("Cancel the running work"))
        self.cancel.clicked.connect(queue.cancel_all)
        self.setLayout(row(self.text, self.bar, self.left, self.cancel))
        self.setContentsMargins(8, 2, 4, 2)
        self.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Fixed)
        queue.changed.connect(self.show_queue)
        self.show_queue()

    def show_queue(self) -> None:
        job = self._queue.running or next(iter(self._queue.waiting), None)
        self.setVisible(job is not None)
        if job is None:
            return
        more = len(self._queue.waiting) - (self._queue.running is None)
        text = f"{job.title}: {told(job.message)}" if job.message else job.title
        if job.stopping:
            text = self.tr("{title}: stopping …").format(title=job.title)
        if more:
            text += self.tr(" (+{n} waiting)").format(n=more)
        self.text.setText(text)
        self.bar.setValue(round(1000 * job.fraction))
        self.left.setText(self._time(job.seconds_left()))
        self.cancel.setEnabled(not job.stopping)

    def _time(self, seconds: float | None) -> str:
        if seconds is None:
            return ""
        if seconds < 90:
            return self.tr("{n} s left").format(n=max(1, round(seconds)))
        return self.tr("{n} min left").format(n=round(seconds / 60))
