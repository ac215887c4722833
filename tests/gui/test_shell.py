"""The window as a whole: menus and shortcuts from records, pages, notices, appearance, language, closing."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QApplication,
    QComboBox,
    QLineEdit,
    QMenu,
    QPlainTextEdit,
    QTableView,
)

from core.progress import Progress
from stripe_gui import theme
from stripe_gui.pages import PAGES
from stripe_gui.presenters.stages import STAGES, State
from stripe_gui.widgets.command_palette import CommandPalette
from tests.gui.hands import idle


def test_the_empty_window_shows_the_start_page_and_idle_stages(window) -> None:
    assert window.page.id == "start"
    assert not any(b.isEnabled() for b in window.strip.buttons.values())


def test_every_action_is_in_a_menu_and_has_its_own_shortcut(window) -> None:
    in_menus = {a.objectName() for menu in window.menuBar().findChildren(QMenu) for a in menu.actions()} - {""}
    records = window.actions_.records
    assert in_menus == set(records)
    shortcuts = [r.shortcut for r in records.values()]
    assert all(shortcuts), [r.id for r in records.values() if not r.shortcut]
    assert len(set(shortcuts)) == len(shortcuts)
    assert all(r.tip for r in records.values())


def test_a_project_opens_by_the_keyboard(window, answers, project: Path, qtbot) -> None:
    answers.path = project
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_O, Qt.KeyboardModifier.ControlModifier)
    assert window.bench.session.folder.path == project.resolve()
    assert "quick" in window.windowTitle().lower() or window.windowTitle()
    assert window.page.id == "capture"


def test_control_and_a_digit_opens_the_stage(window, project: Path, qtbot) -> None:
    window.open_path(project)
    with qtbot.waitActive(window):
        for i, stage in enumerate(STAGES):
            qtbot.keyClick(window, Qt.Key(Qt.Key.Key_1 + i), Qt.KeyboardModifier.ControlModifier)
            assert window.page.id == stage
            assert window.strip.buttons[stage].isChecked()


def test_the_palette_finds_and_runs_an_action(window, qtbot) -> None:
    with qtbot.waitActive(window):
        keys = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.ShiftModifier
        qtbot.keyClick(window, Qt.Key.Key_P, keys)
    palette = window.findChild(CommandPalette)
    qtbot.keyClicks(palette.search, "dark app")
    assert palette.found.item(0).text().startswith("Dark appearance")
    qtbot.keyClick(palette.search, Qt.Key.Key_Return)
    assert theme.current().name == "dark"


def test_a_narrow_window_belongs_to_the_work_until_help_is_asked_for(program, finished: Path, qtbot) -> None:
    for language in ("en", "de"):
        program.choose_language(language)
        window = program.window
        with qtbot.waitExposed(window):
            window.show()
        window.resize(1360, 860)
        qtbot.waitUntil(lambda window=window: not window.help.isHidden())
        window.resize(window.minimumSize())
        qtbot.waitUntil(lambda window=window: window.help.isHidden())
        assert window.open_path(finished)
        window.show_page("calibrate")
        tabs = window.page.results.tabs.tabBar()
        # all tabs in full: none has to be fetched by an arrow
        qtbot.waitUntil(lambda tabs=tabs: tabs.width() >= tabs.sizeHint().width())
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F1)
    assert not window.help.isHidden()
    idle(window, qtbot)


def test_a_window_that_begins_narrow_begins_without_help(program, qtbot) -> None:
    window = program.window
    window.resize(1280, 800)
    with qtbot.waitExposed(window):
        window.show()
    assert window.help.isHidden()


def test_a_dropped_project_folder_opens(window, project: Path) -> None:
    _drop(window, project)
    assert window.bench.session.is_open


def test_a_dropped_capture_opens_its_project_there(window, project: Path) -> None:
    _drop(window, project / "captures" / "plane+15")
    assert window.bench.session.capture_name == "plane+15"


def _drop(window, path: Path) -> None:
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path))])
    left, no_key = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    QApplication.sendEvent(window, QDragEnterEvent(QPoint(50, 50), Qt.DropAction.CopyAction, data, left, no_key))
    QApplication.sendEvent(window, QDropEvent(QPointF(50, 50), Qt.DropAction.CopyAction, data, left, no_key))


def test_a_folder_without_a_project_is_refused_in_a_notice(window, tmp_path: Path, notices) -> None:
    assert not window.open_path(tmp_path)
    assert notices[0].kind == "error"
    assert "project.json" in notices[0].happened
    assert notices[0].remedy
    assert window.notices.boxes()


def test_details_of_a_notice_unfold_and_it_can_be_put_away(window, bench, qtbot) -> None:
    bench.notify("error", "the disk is full", "make room", "Traceback ...")
    box = window.notices.boxes()[0]
    assert not box.details.isVisible()
    unfold = next(b for b in box.findChildren(QAbstractButton) if b.isCheckable())
    qtbot.mouseClick(unfold, Qt.MouseButton.LeftButton)
    assert box.details.isVisible()
    qtbot.mouseClick(box.close_button, Qt.MouseButton.LeftButton)
    assert not window.notices.boxes()
    assert not window.notices.isVisible()


@pytest.mark.parametrize("name", ["light", "dark"])
def test_both_appearances_colour_the_window(program, window, name: str) -> None:
    program.choose_theme(name)
    colour = window.palette().window().color().name()
    assert colour == (theme.DARK if name == "dark" else theme.LIGHT).window


@pytest.mark.parametrize("colours", [theme.LIGHT, theme.DARK], ids=lambda c: c.name)
def test_texts_have_the_contrast_that_wcag_asks_for(colours) -> None:
    """WCAG 2.1, 1.4.3: at least 4.5 for text (3 for the faint text of what is disabled is not required)."""
    for front in ("text", "muted", "accent", "ok", "warning", "danger"):
        for back in ("window", "surface"):
            assert _contrast(getattr(colours, front), getattr(colours, back)) >= 4.5, (front, back)
    assert _contrast(colours.accent_text, colours.accent) >= 4.5
    assert _contrast(colours.text, colours.selection) >= 4.5


def _contrast(a: str, b: str) -> float:
    def luminance(colour: str) -> float:
        channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def test_a_change_of_language_keeps_project_and_page(program, window, project: Path, qtbot) -> None:
    window.open_path(project)
    window.show_page("decode")
    program.choose_language("de")
    assert program.window is not window
    assert program.window.page.id == "decode"
    assert program.bench.settings.text("language") == "de"


def test_closing_while_work_runs_asks(window, bench, answers, qtbot) -> None:
    def work(progress: Progress) -> None:
        while True:
            progress(0.5, "at work")
            time.sleep(0.005)

    bench.jobs.run("endless", work)
    qtbot.waitUntil(lambda: bench.jobs.running is not None)
    answers.agree = False
    window.close()
    assert window.isVisible()
    assert len(answers.asked) == 1
    answers.agree = True
    window.close()
    assert not window.isVisible()
    assert not bench.jobs.busy


def test_everything_the_operator_can_reach_has_an_accessible_name(window, project: Path) -> None:
    window.open_path(project)
    kinds = (QAbstractButton, QAbstractItemView, QLineEdit, QPlainTextEdit)
    nameless = []
    for page in map(window.page_of, PAGES):
        for kind in kinds:
            for widget in page.findChildren(kind):
                inner = widget.objectName().startswith("qt_") or type(widget).__name__ == "QTableCornerButton"
                if not inner and not (widget.accessibleName() or getattr(widget, "text", str)()):
                    parent = widget.parent()
                    if not isinstance(parent.parent(), QComboBox) and not isinstance(parent, QTableView):
                        nameless.append((page.id, type(widget).__name__, type(parent).__name__))
    assert not nameless


def test_everything_outdated_is_done_from_the_menu(window, finished_project: Path, notices, qtbot) -> None:
    assert not window.actions_["run.update"].isEnabled()
    window.open_path(finished_project)
    points = next((finished_project / "results" / "points").glob("*.npz"))
    points.unlink()
    window.bench.refresh()
    assert window.bench.session.statuses["reconstruct"].state is State.TODO
    with qtbot.waitActive(window):
        qtbot.keyClick(window, Qt.Key.Key_F5, Qt.KeyboardModifier.ShiftModifier)
    assert window.bench.jobs.busy
    idle(window, qtbot)
    assert {s.state for s in window.bench.session.statuses.values()} == {State.DONE}
    assert notices[-1].kind == "success"
    assert "reconstruct" in notices[-1].details
    points.unlink()
    window.actions_["run.update"].trigger()
    window.actions_["run.cancel"].trigger()
    idle(window, qtbot)
    assert window.bench.session.statuses["reconstruct"].state is not State.DONE  # stopped, and told as it is
