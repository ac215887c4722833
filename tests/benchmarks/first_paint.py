"""Start a window, end at its first paint: `python -m tests.benchmarks.first_paint workbench|empty`."""

from __future__ import annotations

import os
import sys

from PySide6.QtCore import QEvent, QObject, QTimer
from PySide6.QtWidgets import QApplication, QMainWindow, QWidget


class Watch(QObject):
    """Ends the process once the window has been painted, and tells its size."""

    def __init__(self, window: QWidget) -> None:
        super().__init__()
        self.window = window

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        """Let the paint through, then end before anything else is done."""
        if event.type() == QEvent.Type.Paint and watched is self.window:
            QTimer.singleShot(0, self.tell)
        return False

    def tell(self) -> None:
        """Say what was painted."""
        print(f"{self.window.width()}x{self.window.height()} {len(self.window.findChildren(QWidget))}", flush=True)
        os._exit(0)


def main() -> None:
    """Do as `stripe-gui` does, or show an empty window."""
    if sys.argv[1] == "workbench":
        from stripe_gui.app import Program, make_application

        program = Program(make_application())
        app, window = program.app, program.window
    else:
        app, window = QApplication([]), QMainWindow()
    app.installEventFilter(watch := Watch(window))
    window.show()
    app.exec()
    del watch


if __name__ == "__main__":
    main()
