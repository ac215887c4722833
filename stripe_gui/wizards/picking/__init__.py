"""Picking the targets of a testfield, image by image; measuring goes on behind it.

page.py        the page: what keys and clicks do
model.py       what was picked and excluded, undo and redo, all saved at once; without Qt
view.py        what the page shows of an image, and what Enter does next; without widgets
image.py       the image with its marks (marks.py) and cross hairs; keys.py has its keys
side.py        the map of the field, the loupe, the lists
background.py  measuring what was accepted, making the next images ready (work.py)
"""

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
