"""A capture from frames that came from elsewhere; `wizard.py` holds its steps."""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication

from stripe_gui.actions import Action, project_idle

translate = QCoreApplication.translate


def actions() -> list[Action]:
    """Give the wizard's action."""
    return [
        Action(
            "capture.import",
            translate("Actions", "&Import frames…"),
            lambda bench: bench.show_page("import-wizard"),
            "Ctrl+I",
            "open",
            translate("Actions", "Make a capture of images that another program or projector has made."),
            enabled_when=project_idle,
        )
    ]
