"""The pages of the window, one a file, made when they are first shown.

A new page: a subclass of `Page` in its own file, and a line in `PAGES`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from stripe_gui.pages.page import Page
    from stripe_gui.workbench import Workbench

PAGES = {
    "start": ("start_page", "StartPage"),
    "capture": ("capture_page", "CapturePage"),
    "decode": ("decode_page", "DecodePage"),
    "measure": ("measure_page", "MeasurePage"),
    "calibrate": ("calibrate_page", "CalibratePage"),
    "reconstruct": ("reconstruct_page", "ReconstructPage"),
    "evaluate": ("evaluate_page", "EvaluatePage"),
    "report": ("report_page", "ReportPage"),
}  # id of the page -> module below this package, class


def make_page(name: str, bench: Workbench) -> Page:
    """Make the page of an id; its module is imported only now, so that the window appears quickly."""
    module, kind = PAGES[name]
    page: Page = getattr(import_module(f"stripe_gui.pages.{module}"), kind)(bench)
    return page
