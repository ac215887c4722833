"""Guided work that is a sequence of steps: one wizard a folder, over Qt-free functions of `presenters`.

A wizard is a page of the window (`wizard.Wizard`, with a line in `pages.PAGES`) that an action of `commands` opens.
Pages find the action by its id and show a button where there is one (see `Page.add_action_button`).
"""
