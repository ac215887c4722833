"""The desktop program: an operator's whole day in one window, over the core.

__main__.py      looks for a display, reads the arguments, starts the program
libraries.py     what of the system Qt would miss, told before it starts
app.py           the QApplication: palette, font, language; owns the workbench and the window
workbench.py     what every page, wizard and action is given: session, jobs, dialogs, settings, notices
session.py       the one object that owns the open project
garbage.py       Python's garbage is collected in the window's thread alone
jobs.py          runs a core function in a thread: progress, cancel, result, the whole traceback on failure
actions.py       actions as records; menus, shortcuts and the command palette are made from them
commands.py      what the operator can do besides the work of a page
main_window.py   menus, stage strip, pages, help, progress
dialogs.py       every question to the operator, so that tests can answer it
settings.py      what is remembered between two starts
theme.py         colours and style, light and dark
assets.py        icons, fonts and help texts of `resources`
tour.py          a picture of every page
screens.py       a second screen, for projectors that are one
presenters/      what the pages show, computed from the project folder; no widgets
pages/           one page a file
wizards/         guided work, one wizard a file or folder
widgets/         image view, residual plot, result table, notice, stage strip, help, ...
"""
