"""The window's tests: offscreen, with settings of their own, dialogs that answer, and no widget left behind."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from pathlib import Path

os.environ["QT_QPA_PLATFORM"] = "offscreen"

import pytest
from PySide6.QtCore import QCoreApplication, QEvent
from PySide6.QtWidgets import QApplication

from stripe_gui.app import Program, make_application
from stripe_gui.dialogs import Dialogs
from stripe_gui.garbage import collected_here
from stripe_gui.main_window import MainWindow
from stripe_gui.settings import Settings
from stripe_gui.workbench import Notice, Workbench
from tests.copies import copied


class Answers(Dialogs):
    """Dialogs that answer by themselves; what was asked is kept."""

    def __init__(self) -> None:
        self.path: Path | None = None
        self.agree = True
        self.asked: list[str] = []

    def open_folder(self, parent, title, start=None):
        self.asked.append(title)
        return self.path

    def open_file(self, parent, title, kinds, start=None):
        self.asked.append(title)
        return self.path

    def save_file(self, parent, title, kinds, start=None):
        self.asked.append(title)
        return self.path

    def choose_several(self, parent, title, text, names, chosen):
        self.asked.append(title)
        return list(names)[:2]

    def confirm(self, parent, title, text, yes, no):
        self.asked.append(text)
        return self.agree

    def tell(self, parent, title, text):
        self.asked.append(text)


@pytest.fixture(scope="session")
def qapp_cls():
    return QApplication


@pytest.fixture(scope="session")
def qapp(qapp_args):
    return make_application()


def settle() -> None:
    """Let everything happen that is due, deletions included."""
    for _ in range(3):
        QCoreApplication.processEvents()
        QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)


@pytest.fixture(autouse=True)
def no_widget_left(qapp) -> Iterator[None]:
    """Every test takes away the windows it made; no other thread does, as in the program."""
    before = set(QApplication.topLevelWidgets())
    with collected_here():
        yield
    settle()
    left = [w for w in QApplication.topLevelWidgets() if w not in before]
    if left:  # a cycle of references may still hold it
        del left
        gc.collect()
        settle()
        left = [w for w in QApplication.topLevelWidgets() if w not in before]
    assert not left, f"left behind: {[(type(w).__name__, w.objectName(), w.windowTitle()) for w in left]}"


@pytest.fixture
def answers() -> Answers:
    return Answers()


@pytest.fixture
def bench(qapp, tmp_path: Path, answers: Answers) -> Iterator[Workbench]:
    made = Workbench(Settings(tmp_path / "settings.ini"), answers)
    yield made
    assert made.jobs.shut_down()
    assert made.views.shut_down()
    assert made.watch.shut_down()
    assert made.states.shut_down()


@pytest.fixture
def notices(bench: Workbench) -> list[Notice]:
    seen: list[Notice] = []
    bench.noticed.connect(seen.append)
    return seen


@pytest.fixture
def program(qapp, bench: Workbench) -> Iterator[Program]:
    made = Program(qapp, bench)
    made.choose_theme("light")
    yield made
    made.window.hide()
    made.window.deleteLater()
    made.load_language("en")


@pytest.fixture
def window(program: Program, qtbot) -> MainWindow:
    with qtbot.waitExposed(program.window):
        program.window.show()
    return program.window


@pytest.fixture(scope="session")
def recorded(quick_original: Path) -> Path:
    """A small project as the bench records it; read only."""
    return quick_original


@pytest.fixture(scope="session")
def finished(whole_original: Path) -> Path:
    """A small project with every stage done; read only."""
    return whole_original


@pytest.fixture
def project(recorded: Path, tmp_path: Path) -> Path:
    """A recorded project of the test's own."""
    return copied(recorded, tmp_path / "project")


@pytest.fixture
def finished_project(finished: Path, tmp_path: Path) -> Path:
    """A finished project of the test's own."""
    return copied(finished, tmp_path / "project")
