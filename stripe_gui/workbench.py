"""What every page, wizard and action is given."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from PySide6.QtCore import QObject, Signal

from core.errors import StripeError
from core.lazy import dataclass
from stripe_gui.dialogs import Dialogs
from stripe_gui.jobs import Failure, Job, JobQueue
from stripe_gui.presenters.stages import stage_name
from stripe_gui.session import Session
from stripe_gui.settings import Settings

if TYPE_CHECKING:
    from stripe_gui.presenters.folder import ProjectFolder


@dataclass(frozen=True)
class Notice:
    """Something the operator should know: what happened, what to do, the details folded away."""

    kind: str  #: {"info", "success", "warning", "error"}
    happened: str
    remedy: str = ""
    details: str = ""


class Workbench(QObject):
    """The program without its window: session, dialogs, settings, and the ways to speak to the operator.

    Long work goes to `jobs`, one at a time, shown with progress and cancel; what only fills the picture to `views`,
    where a newer one replaces the older. `watch` looks whether the rig has moved, `states` works out those of a large
    project.
    """

    noticed = Signal(object)  # Notice
    page_wanted = Signal(str)  # id of a page
    theme_wanted = Signal(str)  # "light", "dark", "system"
    language_wanted = Signal(str)  # "en", "de"

    def __init__(self, settings: Settings | None = None, dialogs: Dialogs | None = None) -> None:
        super().__init__()
        self.settings = settings or Settings()
        self.dialogs = dialogs or Dialogs()
        self.session = Session(self.settings, self)
        self.jobs = JobQueue(self)
        self.views = JobQueue(self, latest_only=True)
        self.watch = JobQueue(self, latest_only=True)
        self.states = JobQueue(self, latest_only=True)

    # ---------------------------------------------------------------------------------------- speaking to the operator

    def notify(self, kind: str, happened: str, remedy: str = "", details: str = "") -> None:
        self.noticed.emit(Notice(kind, happened, remedy, details))

    def report_error(self, error: BaseException, trace: str = "") -> None:
        from stripe_gui.presenters.failures import describe  # its rooms of the core are not needed to begin with

        failure = describe(error, trace)
        self.notify("error", failure.happened, failure.remedy, failure.details)

    def report_failure(self, failure: Failure) -> None:
        """Show what a job failed with as a notice."""
        self.report_error(failure.error, failure.trace)

    def show_page(self, page: str) -> None:
        """Bring a page to the front, or a part of it ("page#part")."""
        self.page_wanted.emit(page)

    # -------------------------------------------------------------------------------------------------------- projects

    def open_project(self, path: Path, page: str = "capture") -> bool:
        """Open a project and show it; say whether that worked."""
        if self.jobs.busy:
            text = self.tr("Work is running in the open project.")
            self.notify("warning", text, self.tr("wait until it is done, or cancel it"))
            return False
        try:
            folder = self.session.found(path)
            if not folder.large:
                self.session.open(path)
        except StripeError as error:
            self.report_error(error)
            return False
        if folder.large:

            def looked(statuses: Any) -> None:
                self.session.adopt(folder, statuses)
                self.show_page(page)

            self._look(folder, looked)
        else:
            self.show_page(page)
        return True

    def _look(self, folder: ProjectFolder, done: Callable[[Any], Any]) -> None:
        """Look at a large project in the background."""
        from stripe_gui.presenters.status import stage_statuses

        title = self.tr("Looking at the captures")
        self.states.run(title, stage_statuses, folder, on_done=done, on_failed=self.report_failure)

    def refresh(self) -> None:
        """Look at the project's files again, at those of a large one in the background."""
        folder = self.session.folder
        if folder is not None and folder.large:
            self._look(folder, partial(self.session.take_statuses, folder))
            return
        try:
            self.session.refresh()
        except StripeError as error:
            self.report_error(error)

    # ------------------------------------------------------------------------------------------------------------ work

    def run_stage(
        self,
        stage: str,
        function: Callable[..., Any],
        *arguments: Any,
        on_done: Callable[[Any], None] | None = None,
        **keywords: Any,
    ) -> Job | None:
        """Run a stage's work on the open project in the background.

        ``function(project, *arguments, progress=..., **keywords)`` is called with the project. Its failure is told and
        kept as the stage's state until it succeeds; the window is refreshed at the end.
        """
        from core.pipeline.state.failures import clear_failure
        from stripe_gui.presenters.failures import describe, keep_failure

        folder = self.session.folder
        if folder is None or any(job.stage == stage for job in (self.jobs.running, *self.jobs.waiting) if job):
            return None
        path = folder.path

        def succeeded(result: Any) -> None:
            clear_failure(path, stage)
            self.refresh()
            if on_done is not None:
                on_done(result)

        def failed(failure: Failure) -> None:
            told = describe(failure.error, failure.trace)
            try:
                keep_failure(path, stage, told)
            except StripeError as error:  # a full disk must not hide the failure itself
                self.report_error(error)
            self.refresh()
            self.notify("error", told.happened, told.remedy, told.details)

        title = stage_name(stage)
        return self.jobs.run(
            title, function, folder.project, *arguments, stage=stage, on_done=succeeded, on_failed=failed, **keywords
        )

    def guarded(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a quick function; an error becomes a notice and None is returned."""
        try:
            return function(*arguments)
        except StripeError as error:
            self.report_error(error)
        except OSError as error:
            self.report_error(error, traceback.format_exc())
        return None
