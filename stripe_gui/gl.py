"""Whether points can be shown in space here, and if not, why, in a sentence.

Drivers that fail at OpenGL may take the program down with them. So a mark is set before the first view in space is made
and taken away once it has painted: a start that finds it knows that the last one ended there.
"""

from __future__ import annotations

from importlib.util import find_spec

from PySide6.QtCore import QCoreApplication
from PySide6.QtGui import QGuiApplication, QOffscreenSurface, QOpenGLContext

from stripe_gui.settings import Settings

LEAST = (2, 1)  # of desktop OpenGL
TRYING = "gl_trying"
WITHOUT_SCREEN = ("offscreen", "minimal", "vnc", "linuxfb")
translate = QCoreApplication.translate


def gl_problem(settings: Settings) -> str:
    """Say why there is no view in space, empty if there is one."""
    if QGuiApplication.platformName() in WITHOUT_SCREEN:
        return translate("Space", "the program runs without a screen")
    if find_spec("OpenGL") is None:
        return translate("Space", "a package is missing: pip install 'stripe-workbench[gl]'")
    if settings.flag(TRYING):
        return translate("Space", "the graphics driver ended the program when it was tried last")
    return _context_problem()


def _context_problem() -> str:
    """Make a context that is not shown, and look at its version."""
    context, surface = QOpenGLContext(), QOffscreenSurface()
    if not context.create():
        return translate("Space", "this display has no OpenGL")
    surface.setFormat(context.format())
    surface.create()
    if not surface.isValid() or not context.makeCurrent(surface):
        return translate("Space", "OpenGL does not start on this display")
    version = context.format().version()
    context.doneCurrent()
    if tuple(version) < LEAST:
        text = translate("Space", "OpenGL {have[0]}.{have[1]} is too old, {least[0]}.{least[1]} is needed")
        return text.format(have=tuple(version), least=LEAST)
    return ""
