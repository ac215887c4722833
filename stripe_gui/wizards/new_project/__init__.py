"""Beginning a project and printing its testfield.

wizard.py    the steps in their order; the last writes the project
steps.py     name and rig
boards.py    testfield, depth plate, scale, summary
pictures.py  a board as it will be printed
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QCoreApplication

from stripe_gui.actions import Action, project_open
from stripe_gui.workbench import Workbench

if TYPE_CHECKING:
    from core.model import Testfield
    from core.report.board import Sheet

translate = QCoreApplication.translate


def actions() -> list[Action]:
    """Give the actions that begin a project and print its testfield."""
    return [
        Action(
            "file.new",
            translate("Actions", "&New project…"),
            lambda bench: bench.show_page("new-project"),
            "Ctrl+N",
            "new",
            translate("Actions", "Describe camera, projector and testfield; begin with an empty project."),
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
    ]


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
