"""Guided work that is a sequence of steps: one wizard a file or folder, over Qt-free functions of `presenters`.

A wizard is a page of the window (`wizard.Wizard`, with a line in `pages.PAGES`). It offers its actions in a function
``actions() -> list[Action]`` of its module; naming the module in `WIZARDS` puts them into the menus, the shortcuts and
the command palette. Pages find them by their id and show a button where there is one (see `Page.add_action_button`).
"""

from __future__ import annotations

from importlib import import_module

from stripe_gui.actions import Action

# modules below stripe_gui.wizards
WIZARDS: tuple[str, ...] = ("new_project", "capture", "import_frames")


def wizard_actions() -> list[Action]:
    """Gather the actions of all wizards, in the order of `WIZARDS`."""
    return [action for name in WIZARDS for action in import_module(f"stripe_gui.wizards.{name}").actions()]
