"""What the operator can do besides the work of a page: the menus and their actions."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QUrl
from PySide6.QtGui import QDesktopServices

from stripe_gui import theme
from stripe_gui.actions import Action, always, project_idle, project_open
from stripe_gui.jobs import Failure
from stripe_gui.presenters.stages import STAGES, stage_name
from stripe_gui.presenters.told import translate
from stripe_gui.workbench import Workbench

if TYPE_CHECKING:
    from core.model import Testfield
    from core.report.board import Sheet


def menu_titles() -> dict[str, str]:
    """Give the menus in their order."""
    return {
        "file": translate("Menus", "&Project"),
        "edit": translate("Menus", "E&dit"),
        "go": translate("Menus", "&Go"),
        "run": translate("Menus", "&Run"),
        "capture": translate("Menus", "&Capture"),
        "view": translate("Menus", "&View"),
        "help": translate("Menus", "&Help"),
    }


def program_actions() -> list[Action]:
    """Give the actions that need no more than the workbench."""
    update = Action(
        "run.update",
        translate("Actions", "&Update everything"),
        update_all,
        "Shift+F5",
        "runall",
        translate("Actions", "Do all that is out of date or to do, in order; what is done stays if it is stopped."),
        0,
        project_idle,
    )
    return [*_file_actions(), *_go_actions(), update, *_capture_actions(), *_view_actions()]


def _file_actions() -> list[Action]:
    return [
        Action(
            "file.open",
            translate("Actions", "&Open project…"),
            open_project,
            "Ctrl+O",
            "open",
            translate("Actions", "Go on with a project, or look at captures from another rig."),
        ),
        Action(
            "file.demo",
            translate("Actions", "&Demo experiment…"),
            make_demo,
            "Ctrl+D",
            "demo",
            translate("Actions", "Let the virtual bench record an experiment, calibrate it and judge it."),
            enabled_when=lambda bench: not bench.jobs.busy,
        ),
        Action(
            "file.new",
            translate("Actions", "&New project…"),
            lambda bench: bench.show_page("new-project"),
            "Ctrl+N",
            "new",
            translate("Actions", "Describe camera, projector and testfield; begin with an empty project."),
        ),
        Action(
            "file.folder",
            translate("Actions", "Show project &folder"),
            lambda bench: QDesktopServices.openUrl(QUrl.fromLocalFile(str(bench.session.opened.path))),
            "Ctrl+Shift+F",
            "folder",
            translate("Actions", "Open the project's folder in the file manager."),
            1,
            project_open,
        ),
        Action(
            "file.refresh",
            translate("Actions", "&Look for changes"),
            lambda bench: bench.refresh(),
            "Ctrl+R",
            "refresh",
            translate("Actions", "Read the project's files again."),
            1,
            project_open,
        ),
        Action(
            "file.testfield",
            translate("Actions", "&Print testfield…"),
            print_project_testfield,
            "Ctrl+P",
            "print",
            translate("Actions", "Write the project's testfield as PDF or SVG at true size."),
            1,
            project_open,
        ),
        Action(
            "file.close",
            translate("Actions", "&Close project"),
            close_project,
            "Ctrl+W",
            "close",
            translate("Actions", "Back to the start page; every step is saved already."),
            2,
            project_idle,
        ),
    ]


def _go_actions() -> list[Action]:
    pages = [("start", translate("Actions", "Start page"), "Ctrl+0", "home")]
    pages += [(stage, stage_name(stage), f"Ctrl+{i}", stage) for i, stage in enumerate(STAGES, 1)]
    pages.append(("rig", translate("Actions", "The ri&g"), "Ctrl+8", "rig"))
    return [
        Action(
            f"go.{page}",
            text,
            partial(Workbench.show_page, page=page),
            keys,
            icon,
            translate("Actions", "Open this page."),
            0 if page == "start" else 1,
            always if page == "start" else project_open,
        )
        for page, text, keys, icon in pages
    ]


def _capture_actions() -> list[Action]:
    return [
        Action(
            "capture.new",
            translate("Actions", "&New capture…"),
            lambda bench: bench.show_page("capture-wizard"),
            "Ctrl+T",
            "capture",
            translate("Actions", "Connect projector and camera, check the rig, and record a sequence."),
            enabled_when=project_idle,
        ),
        Action(
            "capture.import",
            translate("Actions", "&Import frames…"),
            lambda bench: bench.show_page("import-wizard"),
            "Ctrl+I",
            "open",
            translate("Actions", "Make a capture of images that another program or projector has made."),
            enabled_when=project_idle,
        ),
    ]


def _view_actions() -> list[Action]:
    return [
        Action(
            "view.dark",
            translate("Actions", "D&ark appearance"),
            lambda bench: bench.theme_wanted.emit("light" if theme.current().name == "dark" else "dark"),
            "Ctrl+Shift+D",
            "theme",
            translate("Actions", "Switch between light and dark."),
            checked_when=lambda _: theme.current().name == "dark",
        ),
        Action(
            "view.system",
            translate("Actions", "Appearance of the des&ktop"),
            lambda bench: bench.theme_wanted.emit("system"),
            "Ctrl+Shift+A",
            "",
            translate("Actions", "Follow the desktop in light and dark."),
            checked_when=lambda bench: bench.settings.text("theme", "system") == "system",
        ),
        Action(
            "view.english",
            "&English",
            lambda bench: bench.language_wanted.emit("en"),
            "Ctrl+Shift+E",
            "language",
            "Show the program in English.",
            1,
            checked_when=lambda bench: bench.settings.text("language", "en") == "en",
        ),
        Action(
            "view.german",
            "&Deutsch",
            lambda bench: bench.language_wanted.emit("de"),
            "Ctrl+Shift+G",
            "language",
            "Das Programm auf Deutsch zeigen.",
            1,
            checked_when=lambda bench: bench.settings.text("language", "en") == "de",
        ),
    ]


def open_project(bench: Workbench) -> None:
    """Ask for a project folder and open it."""
    recent = bench.settings.recent()
    start = recent[0].parent if recent else Path.home()
    title = translate("Actions", "Open a project: the folder with project.json")
    folder = bench.dialogs.open_folder(None, title, start)
    if folder is not None:
        bench.open_project(folder)


def make_demo(bench: Workbench) -> None:
    """Ask where to, run the whole experiment in the background, and open what came out."""
    from core.demo import run_demo

    title = translate("Actions", "Choose a new or empty folder for the demo experiment")
    folder = bench.dialogs.open_folder(None, title, Path.home())
    if folder is None:
        return

    def done(_: object) -> None:
        if bench.open_project(folder, "evaluate"):
            bench.notify(
                "success", translate("Actions", "The demo experiment is complete; every stage shows its part.")
            )

    title = translate("Actions", "Demo experiment")
    bench.jobs.run(title, run_demo, folder, on_done=done, on_failed=bench.report_failure)


def update_all(bench: Workbench) -> None:
    """Do what is out of date or to do in the background, and tell what was done."""
    from core.pipeline import update_project
    from core.pipeline.update import Update

    def done(update: Update) -> None:
        bench.refresh()
        text = translate("Actions", "Everything is up to date.")
        bench.notify("success", text, details="\n".join(update.done))

    def failed(failure: Failure) -> None:
        bench.refresh()  # other stages may have been done
        bench.report_failure(failure)

    title = translate("Actions", "Update everything")
    job = bench.jobs.run(title, update_project, bench.session.opened.project, on_done=done, on_failed=failed)
    job.cancelled.connect(bench.refresh)


def close_project(bench: Workbench) -> None:
    """Close the project and go to the start page."""
    bench.session.close()
    bench.show_page("start")


def print_project_testfield(bench: Workbench) -> None:
    """Print the open project's testfield."""
    from stripe_gui.presenters.new_project import FIELD_FILE

    folder = bench.session.opened
    print_board(bench, folder.path, folder.path / Path(FIELD_FILE).with_suffix(".pdf"))


def print_board(bench: Workbench, source: Path | Testfield, suggested: Path) -> None:
    """Ask where to, and write a board as a sheet to print."""
    from core.pipeline import print_testfield

    title = translate("NewProject", "Write the testfield at true size")
    out = bench.dialogs.save_file(None, title, "PDF (*.pdf);;SVG (*.svg)", suggested)
    if out is None:
        return
    out = out if out.suffix else out.with_suffix(".pdf")

    def done(sheet: Sheet) -> None:
        text = translate("NewProject", "{out}: a page of {w:.0f} × {h:.0f} mm.")
        advice = translate(
            "NewProject", "Print at 100 %; its bars must then measure {across:g} mm across and {down:g} mm down."
        )
        across, down = sheet.bars_mm
        said = text.format(out=out, w=sheet.width_mm, h=sheet.height_mm)
        bench.notify("success", said, advice.format(across=across, down=down))

    title = translate("NewProject", "Testfield to print")
    bench.jobs.run(title, print_testfield, source, out, on_done=done, on_failed=bench.report_failure)
