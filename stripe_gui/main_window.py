"""The window: menus, stage strip, pages, help beside the work, progress of long work."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QEvent, QSize, Qt
from PySide6.QtGui import QCloseEvent, QDragEnterEvent, QDropEvent, QResizeEvent
from PySide6.QtWidgets import QFrame, QMainWindow, QSplitter, QStackedWidget, QVBoxLayout, QWidget

from core import __version__
from core.resources import resource
from stripe_gui.actions import Action, ActionSet
from stripe_gui.commands import menu_titles, program_actions
from stripe_gui.pages import PAGES, make_page
from stripe_gui.pages.page import Page
from stripe_gui.pages.parts_page import PartsPage
from stripe_gui.presenters.told import translate
from stripe_gui.widgets.command_palette import CommandPalette
from stripe_gui.widgets.help_panel import HelpPanel
from stripe_gui.widgets.job_bar import JobBar
from stripe_gui.widgets.notice import NoticeArea
from stripe_gui.widgets.stage_strip import StageStrip
from stripe_gui.workbench import Workbench

ROOM_FOR_HELP = 1340  # px: beside the help, the tabs of the calibrate page then still show their whole names in German
USUAL_SIZE = QSize(1360, 860)
TITLE_BAR_PX = 40  # what the desktop puts above a window


class MainWindow(QMainWindow):
    """One window over a workbench; another one can take its place (after a change of language)."""

    def __init__(self, bench: Workbench) -> None:
        super().__init__()
        self.bench = bench
        self.setAcceptDrops(True)
        self.setMinimumSize(1080, 680)
        self.resize(USUAL_SIZE)
        self._has_room = True  # beside the help
        self.strip = StageStrip()
        self.strip.chosen.connect(self.show_page)
        self.stack = QStackedWidget()
        self.pages: dict[str, Page] = {}  # those that were shown already
        self.help = HelpPanel(bench.settings.text("language", "en"))
        self.help.closed.connect(lambda: self._show_help(False))
        self._lay_out()
        self.job_bar = JobBar(bench.jobs)
        self.statusBar().addPermanentWidget(self.job_bar)
        self.statusBar().setSizeGripEnabled(False)
        self.page_of("start")
        self.actions_ = ActionSet([*program_actions(), *self._page_actions(), *self._window_actions()], bench, self)
        self.actions_.fill(self.menuBar(), menu_titles())
        self._add_buttons(self.page)
        self._connect()
        self._restore()
        self.show_page("start")
        self._project_changed()

    def _lay_out(self) -> None:
        line = QFrame()
        line.setProperty("role", "line")
        line.setFixedHeight(1)
        self.notices = NoticeArea(self.stack)
        self.split = QSplitter(Qt.Orientation.Horizontal)
        self.split.addWidget(self.stack)
        self.split.addWidget(self.help)
        self.split.setStretchFactor(0, 1)
        self.split.setStretchFactor(1, 0)  # the help keeps its width, what room there is belongs to the picture
        self.split.setCollapsible(0, False)
        self.split.setCollapsible(1, False)
        self.split.setSizes([1040, 320])
        central = QWidget()
        layout = QVBoxLayout(central)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.setSpacing(0)
        layout.addWidget(self.strip)
        layout.addWidget(line)
        layout.addWidget(self.split, 1)
        self.setCentralWidget(central)

    def _connect(self) -> None:
        bench = self.bench
        bench.noticed.connect(self.notices.show_notice)
        bench.page_wanted.connect(self.show_page)
        bench.session.project_changed.connect(self._project_changed)
        bench.session.refreshed.connect(self._refreshed)
        bench.jobs.changed.connect(self._jobs_changed)

    def _page_actions(self) -> list[Action]:
        return [
            Action(
                "run.stage",
                translate("Actions", "&Run this stage"),
                lambda _: self.page.run(),
                "F5",
                "run",
                translate("Actions", "Do the work of the page that is open."),
                0,
                lambda bench: bench.session.is_open and self.page.can_run(),
            ),
            Action(
                "edit.undo",
                translate("Actions", "&Undo"),
                lambda _: self.page.undo(),
                "Ctrl+Z",
                "undo",
                translate("Actions", "Take the last change back, in whichever image it was made."),
                0,
                lambda _: self.page.undoes,
            ),
            Action(
                "edit.redo",
                translate("Actions", "R&edo"),
                lambda _: self.page.redo(),
                "Ctrl+Shift+Z",
                "redo",
                translate("Actions", "Make the change again that was taken back last."),
                0,
                lambda _: self.page.undoes,
            ),
            Action(
                "run.cancel",
                translate("Actions", "&Cancel the running work"),
                lambda bench: bench.jobs.cancel_all(),
                "Ctrl+.",
                "stop",
                translate("Actions", "Stop at the next step; nothing half is written."),
                1,
                lambda bench: bench.jobs.busy,
            ),
        ]

    def _window_actions(self) -> list[Action]:
        return [
            Action(
                "view.full",
                translate("Actions", "&Full screen"),
                lambda _: self.showNormal() if self.isFullScreen() else self.showFullScreen(),
                "F11",
                "screen",
                translate("Actions", "Use the whole screen, or go back to a window."),
                2,
                checked_when=lambda _: self.isFullScreen(),
            ),
            Action(
                "help.panel",
                translate("Actions", "&Help beside the work"),
                lambda _: self._show_help(self.help.isHidden()),
                "F1",
                "help",
                translate("Actions", "Show or hide the help of the page that is open."),
                checked_when=lambda _: not self.help.isHidden(),
            ),
            Action(
                "help.commands",
                translate("Actions", "&All commands…"),
                lambda _: self.open_palette(),
                "Ctrl+Shift+P",
                "search",
                translate("Actions", "Search everything the program can do."),
            ),
            Action(
                "help.notices",
                translate("Actions", "Put all &notices away"),
                lambda _: self.notices.clear(),
                "Ctrl+Shift+N",
                "close",
                translate("Actions", "Clear the notices over the page."),
            ),
            Action(
                "help.about",
                translate("Actions", "About this &program"),
                lambda _: self._about(),
                "Shift+F1",
                "info",
                translate("Actions", "Version and licence."),
                1,
            ),
            Action(
                "file.quit",
                translate("Actions", "&Quit"),
                lambda _: self.close(),
                "Ctrl+Q",
                "quit",
                translate("Actions", "Close the program; every step is saved already."),
                3,
            ),
        ]

    # ------------------------------------------------------------------------------------------------------------ pages

    @property
    def page(self) -> Page:
        page = self.stack.currentWidget()
        assert isinstance(page, Page)
        return page

    def page_of(self, name: str) -> Page:
        """Give a page, made when it is first asked for."""
        if name not in self.pages:
            page = make_page(name, self.bench)
            self.pages[name] = page
            self.stack.addWidget(page)
            if hasattr(self, "actions_"):
                self._add_buttons(page)
        return self.pages[name]

    def _add_buttons(self, page: Page) -> None:
        for identity in page.action_ids:
            if identity in self.actions_:
                page.add_action_button(self.actions_[identity])

    def show_page(self, name: str) -> None:
        """Bring a page to the front; without a project there is only the start page."""
        name, _, part = name.partition("#")
        page = self.page_of(name if name in PAGES else "start")
        if page.needs_project and not self.bench.session.is_open:
            page = self.page_of("start")
        self.stack.setCurrentWidget(page)
        self.strip.show_page(page.stage)
        page.setFocus()
        page.refresh()
        if part and isinstance(page, PartsPage):
            page.go_to(part)
        if not self.help.isHidden():
            self.help.show_topic(page.stage or page.id)
        self.actions_.update()

    def open_palette(self) -> CommandPalette:
        self.actions_.update()
        palette = CommandPalette(self.actions_, self)
        palette.open()
        return palette

    def _project_changed(self) -> None:
        folder = self.bench.session.folder
        name = f"{folder.project.name} – " if folder else ""
        self.setWindowTitle(name + self.tr("Stripe workbench"))
        if folder is None and self.page.needs_project:
            self.show_page("start")
        self._refreshed()

    def _refreshed(self) -> None:
        self._jobs_changed()
        self.page.refresh()
        self.actions_.update()

    def _jobs_changed(self) -> None:
        running = self.bench.jobs.running
        at_work = {running.stage: running.fraction} if running and running.stage else {}
        self.strip.show_statuses(self.bench.session.statuses, at_work)
        self.actions_.update()

    # ------------------------------------------------------------------------------------------------------------- help

    def _show_help(self, visible: bool) -> None:
        self.help.setVisible(visible)
        self.bench.settings.set("help", visible)
        if visible:
            self.help.show_topic(self.page.stage or self.page.id)
        self.actions_.update()

    def _place_help(self) -> None:
        """Show the help if it is wanted and has room; in a narrow window it comes when it is asked for."""
        wanted = self.bench.settings.flag("help", True) and resource("help").is_dir()
        self._has_room = self.width() >= ROOM_FOR_HELP
        self.help.setVisible(wanted and self._has_room)
        if not self.help.isHidden():
            self.help.show_topic(self.page.stage or self.page.id)
        self.actions_.update()

    def _about(self) -> None:
        text = self.tr(
            "Stripe workbench {version}\nDecode, calibrate, reconstruct and evaluate stripe projectors.\n\n{licence}"
        )
        licence = self.tr("BSD-3-Clause licence.")
        self.bench.dialogs.tell(self, self.tr("About"), text.format(version=__version__, licence=licence))

    # ----------------------------------------------------------------------------------------------- dropping, closing

    def dragEnterEvent(self, event: QDragEnterEvent) -> None:  # noqa: N802
        """Welcome a folder that is, holds or belongs to a project."""
        if self._dropped(event) is not None:
            event.acceptProposedAction()

    def dropEvent(self, event: QDropEvent) -> None:  # noqa: N802
        """Open the project; a capture's folder opens its project at this capture."""
        path = self._dropped(event)
        if path is None:
            return
        event.acceptProposedAction()
        self.open_path(path)

    def open_path(self, path: Path) -> bool:
        """Open a project, or the project of a capture with that capture chosen."""
        if (path / "capture.json").is_file():
            from core.project import find_project

            project = find_project(path)
            if project is not None:
                opened = self.bench.open_project(project)
                if opened:
                    self.bench.session.choose_capture(path.name)
                return opened
        return self.bench.open_project(path)

    def _dropped(self, event: QDragEnterEvent | QDropEvent) -> Path | None:
        for url in event.mimeData().urls():
            path = Path(url.toLocalFile())
            path = path.parent if path.is_file() else path
            if (path / "project.json").is_file() or (path / "capture.json").is_file():
                return path
        return None

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        """Look for changes by other programs when the operator comes back to the window."""
        if event.type() == QEvent.Type.ActivationChange and self.isActiveWindow() and not self.bench.jobs.busy:
            self.bench.refresh()
        super().changeEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        """Let the help step aside when the window becomes too narrow for both, and come back with the room."""
        super().resizeEvent(event)
        if self._has_room != (self.width() >= ROOM_FOR_HELP):
            self._place_help()

    def closeEvent(self, event: QCloseEvent) -> None:  # noqa: N802
        """Ask while work is running; remember the window."""
        job = self.bench.jobs.running
        if job is not None and self.bench.jobs.busy:
            text = self.tr("{title} is still running. Its result is lost if you stop it now.").format(title=job.title)
            ask = self.bench.dialogs.confirm
            if not ask(self, self.tr("Work is running"), text, self.tr("Stop and close"), self.tr("Keep working")):
                event.ignore()
                return
        self.end()
        event.accept()

    def end(self) -> None:
        """Stop all work, and remember the window."""
        self.bench.jobs.shut_down()
        self.bench.views.shut_down()
        self.bench.watch.shut_down()
        self.bench.states.shut_down()
        self.remember()

    def remember(self) -> None:
        """Keep size, place and the split for the next start."""
        self.bench.settings.set("window", self.saveGeometry())
        self.bench.settings.set("split", self.split.saveState())

    def _restore(self) -> None:
        if not (state := self.bench.settings.state("window")).isEmpty():
            self.restoreGeometry(state)
        if not (state := self.bench.settings.state("split")).isEmpty():
            self.split.restoreState(state)
        self._fit_screen()
        self._place_help()

    def _fit_screen(self) -> None:
        """Lie on the screen as a whole: the lower edge holds Back, Next and the status line."""
        room = self.screen().availableGeometry().adjusted(0, TITLE_BAR_PX, 0, 0)
        self.resize(self.size().boundedTo(room.size()).expandedTo(self.minimumSize()))
        if not (self.bench.settings.state("window").isEmpty() or room.contains(self.geometry())):
            self.move(room.topLeft())
