"""The application: Qt set up the same everywhere, the workbench, and the window over it."""

from __future__ import annotations

import signal
import socket
import sys
import traceback
from types import FrameType, TracebackType

from PySide6.QtCore import QLibraryInfo, QLocale, QObject, QSocketNotifier, Qt, QTimer, QTranslator
from PySide6.QtGui import QFont, QFontDatabase, QIcon
from PySide6.QtWidgets import QApplication

from core.resources import resource
from stripe_gui import theme
from stripe_gui.main_window import MainWindow
from stripe_gui.presenters.told import speak
from stripe_gui.workbench import Workbench

FONT_PT = 9.5


def make_application() -> QApplication:
    """Give the QApplication with its style, font and icon."""
    made = QApplication.instance()
    app = made if isinstance(made, QApplication) else QApplication(["stripe-gui"])
    app.setApplicationName("stripe-gui")
    app.setApplicationDisplayName("")
    app.setOrganizationName("stripe-workbench")
    app.setDesktopFileName("org.stripe_workbench.StripeWorkbench")
    app.setStyle("Fusion")
    app.setWindowIcon(QIcon(str(resource("icons", "program.svg"))))
    families: list[str] = []
    for file in ("DejaVuSans.ttf", "DejaVuSans-Bold.ttf"):
        number = QFontDatabase.addApplicationFont(str(resource("fonts", file)))
        families += QFontDatabase.applicationFontFamilies(number)
    font = QFont(families[:1] or ["sans-serif"])
    font.setPointSizeF(FONT_PT)
    app.setFont(font)
    return app


class Program(QObject):
    """Owns the workbench and the window; changes appearance and language."""

    def __init__(self, app: QApplication, bench: Workbench | None = None) -> None:
        super().__init__()
        self.app = app
        self.bench = bench or Workbench()
        self._translators: list[QTranslator] = []
        self._ended: int | None = None  # by a signal: the exit code
        self.show_theme(self.bench.settings.text("theme", "system"))
        self.load_language(self.bench.settings.text("language", "") or _desktop_language())
        self.window = MainWindow(self.bench)
        self.bench.theme_wanted.connect(self.choose_theme)
        # queued: the window that is replaced must not be at work in its own menu
        self.bench.language_wanted.connect(self.choose_language, Qt.ConnectionType.QueuedConnection)

    def choose_theme(self, choice: str) -> None:
        self.bench.settings.set("theme", choice)
        self.show_theme(choice)

    def show_theme(self, choice: str) -> None:
        theme.apply(self.app, theme.resolve(choice))

    def choose_language(self, language: str) -> None:
        """Change the language and remember it: a new window takes the old one's place."""
        self.load_language(language)
        old = self.window
        old.remember()
        self.window = MainWindow(self.bench)
        self.window.show_page(old.page.id)
        if old.isVisible():
            self.window.show()
        old.hide()
        old.deleteLater()

    def load_language(self, language: str) -> None:
        """Load the texts of a language: ours and Qt's own."""
        self.bench.settings.set("language", language)
        for translator in self._translators:
            self.app.removeTranslator(translator)
        self._translators = []
        places = [
            ("stripe", str(resource("translations"))),
            ("qtbase", QLibraryInfo.path(QLibraryInfo.LibraryPath.TranslationsPath)),
        ]
        for name, folder in places if language != "en" else ():
            translator = QTranslator(self)
            if translator.load(f"{name}_{language}", folder):
                self.app.installTranslator(translator)
                self._translators.append(translator)
        speak(language)
        QLocale.setDefault(QLocale(QLocale.Language.C))  # numbers as in the report: a point, no grouping

    def heed_signals(self) -> None:
        """Close in good order when the system, or who started the program, ends it."""
        wake, self._woken = socket.socketpair()
        for end in (wake, self._woken):
            end.setblocking(False)
        signal.set_wakeup_fd(wake.detach())
        notifier = QSocketNotifier(self._woken.fileno(), QSocketNotifier.Type.Read, self)
        notifier.activated.connect(lambda: self._woken.recv(64))  # Python calls the handler before
        for name in ("SIGTERM", "SIGHUP", "SIGINT"):
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), self._end)

    def run(self) -> int:
        """Work until the window is closed, or not at all where a signal came before; give the exit code."""
        return self.app.exec() if self._ended is None else self._ended

    def _end(self, number: int, _frame: FrameType | None) -> None:
        self._ended = code = 128 + number
        self.window.end()
        QTimer.singleShot(0, lambda: self.app.exit(code))  # which before `exec` would be lost

    def watch_faults(self) -> None:
        """Tell faults of the program in a notice instead of only on the terminal."""
        sys.excepthook = self._fault

    def _fault(self, kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        text = "".join(traceback.format_exception(kind, error, trace))
        print(text, file=sys.stderr)
        if isinstance(error, Exception):
            self.bench.report_error(error, text)


def _desktop_language() -> str:
    return "de" if QLocale.system().language() == QLocale.Language.German else "en"
