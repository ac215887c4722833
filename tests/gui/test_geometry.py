"""On a small laptop's screen: every button of every page and step lies in the window, with notices and help, too."""

from __future__ import annotations

from pathlib import Path

import pytest
from PySide6.QtCore import QEvent, QObject, QPoint, QRect, Qt
from PySide6.QtWidgets import QAbstractButton, QScrollArea, QWidget

from core.model import Verdict
from stripe_gui.pages import PAGES
from stripe_gui.widgets.verdict import VerdictList
from stripe_gui.wizards.wizard import Wizard
from tests.gui.conftest import settle
from tests.gui.hands import idle
from tests.gui.test_german import only_english, said

SCREEN = (1280, 800)
WINDOW = (1280, 720)  # what a title bar and a desktop's panel of 40 px each leave of it


def inside(window, widget: QWidget) -> bool:
    return window.rect().contains(QRect(widget.mapTo(window, QPoint(0, 0)), widget.size()))


def scrolled(widget: QWidget) -> bool:
    parent = widget.parentWidget()
    while parent is not None and not isinstance(parent, QScrollArea):
        parent = parent.parentWidget()
    return parent is not None


class Shown(QObject):
    """Notes every window that appears on the screen."""

    def __init__(self) -> None:
        super().__init__()
        self.windows: list[str] = []

    def eventFilter(self, watched, event):  # noqa: N802
        if event.type() == QEvent.Type.Show and isinstance(watched, QWidget) and watched.isWindow():
            self.windows.append(type(watched).__name__)
        return False


@pytest.mark.parametrize(("language", "beside", "theme"), [("en", "work", "light"), ("de", "help beside", "dark")])
def test_every_button_of_every_page_is_on_the_screen_and_speaks_the_language(
    program, qapp, finished: Path, qtbot, language: str, beside: str, theme: str
) -> None:
    """And no part of a page flashes up as a window of its own."""
    program.choose_language(language)
    program.choose_theme(theme)
    english = only_english() if language == "de" else set()
    shown, window = Shown(), program.window
    window.resize(*WINDOW)
    with qtbot.waitExposed(window):
        window.show()
    if theme == "light":  # every event passes
        qapp.installEventFilter(shown)
    assert window.open_path(finished)
    if beside == "help beside":
        window._show_help(True)
    for i in range(3):
        window.bench.notify("error", f"something happened, number {i}", "do this about it", "Traceback\n" * 30)
    outside, helps = [], set()
    for page in PAGES:
        window.show_page(page)
        for part in window.page.parts():
            idle(window, qtbot)
            settle()
            helps.add(window.help.width())
            where = page + part
            outside += [(where, "English", text) for text in english.intersection(said(window.page))]
            if (window.width(), window.height()) != WINDOW:
                outside.append((where, "the window itself", window.size().toTuple()))
            buttons = [b for b in window.findChildren(QAbstractButton) if b.isVisible() and not scrolled(b)]
            whole = (b for b in buttons if not inside(window, b) or b.visibleRegion().boundingRect() != b.rect())
            outside += [(where, b.text() or b.accessibleName()) for b in whole]
            firm = [window.statusBar()]
            if isinstance(window.page, Wizard):
                firm += [window.page.back_button, window.page.next_button]
            for widget in firm:
                assert widget.visibleRegion().boundingRect() == widget.rect(), (where, type(widget).__name__)
                over = QRect(window.notices.mapTo(window, QPoint(0, 0)), window.notices.size())
                assert not over.intersects(QRect(widget.mapTo(window, QPoint(0, 0)), widget.size())), where
    qapp.removeEventFilter(shown)
    assert not outside
    assert shown.windows == []
    assert len(helps) == 1  # it keeps its width from page to page


def test_a_window_begins_no_larger_than_the_screen(program) -> None:
    window, room = program.window, program.window.screen().availableGeometry()
    assert window.width() <= max(room.width(), window.minimumWidth())
    assert window.height() < max(room.height(), window.minimumHeight() + 1)
    assert window.minimumWidth() <= SCREEN[0]
    assert window.minimumHeight() <= WINDOW[1]


def test_a_notice_moves_nothing(window, bench, project: Path, qtbot) -> None:
    window.open_path(project)
    idle(window, qtbot)
    before = [(w, w.geometry()) for w in window.page.findChildren(QWidget)]
    bench.notify("warning", "something happened", "do this")
    settle()
    assert window.notices.isVisible()
    assert window.notices.geometry().bottom() < window.stack.height()
    assert all(w.geometry() == geometry for w, geometry in before)
    window.show_page("decode")
    idle(window, qtbot)
    assert window.notices.boxes()[0].visibleRegion().boundingRect().size() == window.notices.boxes()[0].size()


def test_the_help_keeps_its_width_and_leaves_the_room_to_the_picture(window, qtbot) -> None:
    window.resize(1360, 860)
    window._show_help(True)
    settle()
    narrow = window.help.width(), window.stack.width()
    window.resize(2200, 1200)
    settle()
    assert window.help.width() == narrow[0]
    assert window.stack.width() == narrow[1] + 2200 - 1360


def test_undo_and_redo_stand_under_edit(window) -> None:
    menus = {a.menu().objectName(): [x.objectName() for x in a.menu().actions()] for a in window.menuBar().actions()}
    assert menus["menu.edit"] == ["edit.undo", "edit.redo"]


def test_many_verdicts_are_scrolled_and_each_can_be_read(qtbot) -> None:
    """Eleven doubtful planes were squeezed into as many empty frames."""
    shown = VerdictList()
    qtbot.addWidget(shown)
    shown.resize(700, 100)
    shown.show_verdicts({f"plane {k}": Verdict("doubtful", (f"reason {k} " * 30,)) for k in range(11)})
    qtbot.waitUntil(lambda: shown.verticalScrollBar().maximum() > 0)
    assert shown.height() < 300
    assert all(box.height() >= box.heightForWidth(box.width()) for box in shown.boxes)
    assert shown.focusPolicy() != Qt.FocusPolicy.NoFocus
    shown.show_verdicts({"plane": Verdict("doubtful", ("one reason",))})
    qtbot.waitUntil(lambda: shown.verticalScrollBar().maximum() == 0)
    assert shown.height() == shown.boxes[0].heightForWidth(shown.boxes[0].width())


def test_what_failed_stands_first_and_is_red(qtbot) -> None:
    shown = VerdictList()
    qtbot.addWidget(shown)
    shown.show_verdicts(
        {"one": Verdict(), "two": Verdict("doubtful", ("weak",)), "three": Verdict("failed", ("the scale is wrong",))}
    )
    assert [box.verdict.state for box in shown.boxes] == ["failed", "doubtful", "passed"]
    assert shown.boxes[0].property("notice") == "error"
    assert "The scale is wrong." in shown.boxes[0].text.text()
    assert shown.boxes[0].text.textInteractionFlags() & Qt.TextInteractionFlag.TextSelectableByMouse
    shown.show_verdicts({})
    assert shown.isHidden()
