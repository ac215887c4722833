"""The pages of the window, one view a stage, made when they are first shown.

A new page: a subclass of `Page` in its own file, and a line in `PAGES`. Wizards are pages too.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stripe_gui.pages.page import Page
    from stripe_gui.workbench import Workbench

PAGES = {
    "start": ("pages.start_page", "StartPage"),
    "new-project": ("wizards.new_project.wizard", "NewProjectWizard"),
    "capture": ("pages.capture_page", "CapturePage"),
    "decode": ("pages.decode_page", "DecodePage"),
    "measure": ("pages.measure.page", "MeasurePage"),
    "calibrate": ("pages.calibrate.page", "CalibratePage"),
    "reconstruct": ("pages.reconstruct_page", "ReconstructPage"),
    "evaluate": ("pages.evaluate.page", "EvaluatePage"),
    "report": ("pages.report_page", "ReportPage"),
    "rig": ("pages.rig_page", "RigPage"),
    "import-wizard": ("wizards.import_frames", "ImportWizard"),
    "capture-wizard": ("wizards.capture.wizard", "CaptureWizard"),
}  # id of the page -> module below stripe_gui, class


def make_page(name: str, bench: Workbench) -> Page:
    """Make the page of an id; its module is imported only now, so that the window appears quickly."""
    module, kind = PAGES[name]
    page: Page = getattr(import_module(f"stripe_gui.{module}"), kind)(bench)
    return page
