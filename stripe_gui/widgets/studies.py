"""Questions to the calibration in use that take a while: asked by a button, answered below it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from PySide6.QtWidgets import QFrame

from core.pipeline.volumes import left_out_figures, left_out_verdict, next_pose_figures
from core.progress import Progress
from stripe_gui.jobs import Job
from stripe_gui.presenters.folder import ProjectFolder, version
from stripe_gui.presenters.studies import left_out_table, next_pose_table
from stripe_gui.presenters.told import told
from stripe_gui.widgets.layout import button, column, label, row
from stripe_gui.widgets.result_table import ResultTable
from stripe_gui.widgets.verdict import VerdictList
from stripe_gui.workbench import Workbench

Version = tuple[Path, tuple[int, int] | None]


def in_use(folder: ProjectFolder | None) -> Version | None:
    """Tell the photogrammetric calibration in use from others."""
    file = None if folder is None else folder.result_file("photogrammetric.npz")
    return None if file is None or not file.exists() else (file, version(file))


def asked(folder: ProjectFolder, function: Callable[..., Any], progress: Progress) -> tuple[Version | None, Any]:
    """Ask the calibration that is in use once the job begins: what ran before it may have made another."""
    return in_use(folder), function(folder.project, progress=progress)


class Study(QFrame):
    """A question and its answer, which goes when another calibration is in use."""

    def __init__(self, bench: Workbench, title: str, about: str, ask: str, function: Callable[..., Any]) -> None:
        super().__init__()
        self._bench, self._title, self._function = bench, title, function
        self._job: Job | None = None
        self._of: Version | None = None
        self.setProperty("role", "card")
        self.ask_button = button(ask, self.ask, "run")
        self.verdicts = VerdictList(whole=True)
        self.table = ResultTable(title, titled=False)
        top = row((label(about, "muted", wrap=True), 1), self.ask_button)
        inside = column(label(title, "heading"), top, self.verdicts, self.table, spacing=8, margins=(16, 14, 16, 14))
        self.setLayout(inside)
        self.table.hide()
        self.refresh()

    def ask(self) -> None:
        """Work the answer out as a job."""
        about, failed = (self._bench.session.opened, self._function), self._bench.report_failure
        self._job = self._bench.jobs.run(self._title, asked, *about, on_done=self._answered, on_failed=failed)
        self._job.ended.connect(self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Ask anew about another calibration; the button waits for the answer."""
        running = self._job is not None and self._job.active
        self.ask_button.setEnabled(self.possible and not running)
        if in_use(self._bench.session.folder) != self._of:
            self.verdicts.show_verdicts({})
            self.table.hide()

    @property
    def possible(self) -> bool:
        """Whether there is a calibration to ask."""
        return in_use(self._bench.session.folder) is not None

    def _answered(self, answer: tuple[Version | None, list[dict[str, Any]]]) -> None:
        of, found = answer
        if of == in_use(self._bench.session.folder):
            self._of = of
            self.show_answer(found)
            self.table.fit_height()
            self.table.show()

    def show_answer(self, found: list[dict[str, Any]]) -> None:
        """Put what was found into the table."""


class CrossValidation(Study):
    """Every capture left out in turn."""

    def __init__(self, bench: Workbench) -> None:
        about = self.tr("Leaves each capture out in turn and tests whether the others predict what it shows.")
        super().__init__(bench, self.tr("Cross-validation"), about, self.tr("Leave each out"), left_out_figures)
        self.table.row_chosen.connect(self._choose)

    def show_answer(self, found: list[dict[str, Any]]) -> None:
        """Show the verdict and every capture."""
        self.verdicts.show_verdicts({self.tr("captures against each other"): left_out_verdict(found)})
        self.table.show_table(left_out_table(found, self._bench.session.opened.project.rig))

    def _choose(self, index: int) -> None:
        """Look at a capture on the other pages, too."""
        self._bench.session.choose_capture(str(self.table.model.table.rows[index][0]))


class NextPose(Study):
    """Which poses to capture next, and what they would bring."""

    def __init__(self, bench: Workbench) -> None:
        about = self.tr("Tries 108 poses of the board by their covariance: which to capture next, one after the other.")
        super().__init__(bench, self.tr("Next poses"), about, self.tr("Find the best poses"), next_pose_figures)

    def show_answer(self, found: list[dict[str, Any]]) -> None:
        self.table.show_table(next_pose_table(found))

    @property
    def words(self) -> str:
        """How to hold the board for the pose that was chosen, or for the first; empty while none was looked for."""
        rows = self.table.model.table.rows
        return "" if self.table.isHidden() else told(str(rows[self.table.chosen_row() or 0][0]))

    def go_on(self) -> None:
        """Choose the pose after the one that was captured; after the last there is none until it is asked again."""
        following = (self.table.chosen_row() or 0) + 1
        self.table.choose_row(following)
        self.table.setVisible(not self.table.isHidden() and following < self.table.model.rowCount())
