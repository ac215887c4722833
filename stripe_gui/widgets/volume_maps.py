"""A calibration over its working volume: a map over the camera's image, at the depth chosen in the table beside it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QWidget

from stripe_gui.jobs import Failure, Job
from stripe_gui.presenters.failures import describe
from stripe_gui.presenters.told import sentence
from stripe_gui.presenters.volumes import VolumeView
from stripe_gui.widgets.image_view import ImageView
from stripe_gui.widgets.layout import boxed, choice, column, fit_button, label, refill, row
from stripe_gui.widgets.result_table import ResultTable
from stripe_gui.workbench import Workbench

LEAST = 200, 110  # px: a low window has little room below the runs
LEAST_TABLE = 70  # px: two rows
LOW = 210  # px in which the note below the table has no room: it is its tip then
LEAST_PICTURE = 330  # px of the width, with the colours


class VolumeMaps(QWidget):
    """Map and table, worked out in the background."""

    def __init__(self, bench: Workbench, name: str) -> None:
        super().__init__()
        self._bench = bench
        self._job: Job | None = None
        self._asked: object = None
        self._shown: VolumeView | None = None
        self.said = label("", wrap=True)
        self.kind = choice(self.tr("Map"), self._draw, minimumWidth=190)
        self.words = label("", "muted", wrap=True)
        self.view = ImageView(name)
        self.view.setMinimumSize(*LEAST)
        self.table = ResultTable(name, titled=False)
        self.table.row_chosen.connect(lambda _: self._draw())
        top = row(self.kind, fit_button(self.view.fit), (self.words, 1))
        halves = row((self.view, 1), column(self.table, None), spacing=16)
        self._body = boxed(column(top, (halves, 1), spacing=6))
        self.setLayout(column(self.said, (self._body, 1), spacing=8, margins=(0, 12, 0, 0)))
        self._body.hide()

    def look(self, asked: object, function: Callable[..., VolumeView], *arguments: Any) -> None:
        """Show what a function gives in the background; nothing changes where the same was `asked` before."""
        if asked == self._asked:
            return
        if self._job is not None:
            self._job.cancel()
        self._asked = asked
        self._body.hide()  # it is of something else
        self.said.setText(self.tr("Working out…"))
        views, title = self._bench.views, self.tr("Working volume")
        self._job = views.run(title, function, *arguments, waits=True, on_done=self._show, on_failed=self._refuse)
        self._job.cancelled.connect(partial(self._stopped, self._job))

    def _show(self, view: VolumeView) -> None:
        at = self.table.chosen_row()
        self._shown = view
        refill(self.kind, [(q.name, q.key) for q in view.quantities], self.kind.currentData())
        self.said.setText(view.said)
        self.table.show_table(view.table)
        self.table.fit_height(LEAST_TABLE)
        self._body.show()
        self._share()
        self.table.choose_row(at if at is not None and at < len(view.rows) else len(view.rows) // 2)

    def _refuse(self, failure: Failure) -> None:
        told = describe(failure.error)
        what, remedy = (sentence(text).rstrip(".") for text in (told.happened, told.remedy))
        self.said.setText(self.tr("{what}. {remedy}.").format(what=what, remedy=remedy))
        self._asked = None  # the next look tries again

    def _stopped(self, job: Job) -> None:
        if job is self._job:  # nothing else is looked at: the next look asks again
            self._asked = None

    def _draw(self) -> None:
        at, kind = self.table.chosen_row(), self.kind.currentIndex()
        if self._shown is None or at is None or kind < 0:
            return
        shown, words = self._shown.picture(kind, at), self._shown.words(kind, at)
        self.view.set_image(shown.image, shown.levels, scale=shown.scale, unit=shown.unit, digits=shown.digits)
        self.words.setText(words)
        self.view.canvas.setAccessibleDescription(f"{self.kind.currentText()}, {words}")

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self._share()

    def _share(self) -> None:
        """Give the table its columns' width, but leave room for the picture; the note, where there is any."""
        self.table.fit_width(max(self.width() - LEAST_PICTURE, 160))
        self.table.notes.setVisible(self.height() > LOW)
        self.table.setToolTip(self.table.notes.text())
