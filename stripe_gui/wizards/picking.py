"""The target-picking wizard's place in the menus; the page itself is loaded when it is first shown."""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication

from stripe_gui.actions import Action, project_open

translate = QCoreApplication.translate


def actions() -> list[Action]:
    """Give the wizard's actions."""
    return [
        Action(
            "measure.pick",
            translate("Actions", "&Pick targets"),
            lambda bench: bench.show_page("pick"),
            "Ctrl+Shift+T",
            "measure",
            translate("Actions", "Pick four targets in each image of a board; all others follow."),
            enabled_when=project_open,
        )
    ]
