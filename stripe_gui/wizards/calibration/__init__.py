"""The calibration wizard: choose, run, look at what came out, exclude, run again, compare.

wizard.py     the wizard and its steps
captures.py   which captures take part
run.py        the run with its convergence
runs.py       kept runs side by side
"""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication

from stripe_gui.actions import Action, project_open

translate = QCoreApplication.translate


def actions() -> list[Action]:
    """Give the wizard's action."""
    return [
        Action(
            "calibrate.wizard",
            translate("Actions", "&Calibration…"),
            lambda bench: bench.show_page("calibrate-wizard"),
            "Ctrl+Shift+K",
            "calibrate",
            translate("Actions", "Calibrate step by step: options, captures, convergence, results, kept runs."),
            enabled_when=project_open,
        )
    ]
