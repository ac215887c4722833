"""The plane-table wizard: choose planes and calibrations, judge them, sign the result off.

wizard.py   the wizard and its steps
steps.py    the bodies of the steps
model.py    what there is to choose, what is signed and exported, without Qt widgets
"""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication

from stripe_gui.actions import Action, project_open

translate = QCoreApplication.translate


def actions() -> list[Action]:
    """Give the wizard's action."""
    return [
        Action(
            "evaluate.wizard",
            translate("Actions", "&Plane-table…"),
            lambda bench: bench.show_page("plane-table"),
            "Ctrl+Shift+L",
            "evaluate",
            translate("Actions", "Judge planes step by step: maps, profiles, distribution, Table 3, sign-off."),
            enabled_when=project_open,
        )
    ]
