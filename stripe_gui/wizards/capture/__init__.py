"""Recording a capture, step by step: devices, what is to be recorded, a look, checks of the rig, the sequence.

wizard.py    the steps in their order, and what they hand on
devices.py   projector and camera, and whether they answer
subject.py   role, name, and what belongs to them
picture.py   the live picture, over-exposed pixels marked
checks.py    the checks before the first calibration
taking.py    the sequence run: progress, cancel, findings, one frame again
"""

from __future__ import annotations

from PySide6.QtCore import QCoreApplication

from stripe_gui.actions import Action, project_idle

translate = QCoreApplication.translate


def actions() -> list[Action]:
    """Give the wizard's action."""
    return [
        Action(
            "capture.new",
            translate("Actions", "&New capture…"),
            lambda bench: bench.show_page("capture-wizard"),
            "Ctrl+T",
            "capture",
            translate("Actions", "Connect projector and camera, check the rig, and record a sequence."),
            enabled_when=project_idle,
        )
    ]
