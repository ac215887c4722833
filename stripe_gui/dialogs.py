"""Every question to the operator goes through one object, so that tests (and scripts) can answer it."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import QFileDialog, QMessageBox, QWidget


class Dialogs:
    """What the program may ask."""

    def open_folder(self, parent: QWidget | None, title: str, start: Path | None = None) -> Path | None:
        """Ask for a folder that exists; None when the operator changed their mind."""
        return _path(QFileDialog.getExistingDirectory(parent, title, str(start or "")))

    def open_file(self, parent: QWidget | None, title: str, kinds: str, start: Path | None = None) -> Path | None:
        """Ask for a file that exists; `kinds` as in ``"CSV files (*.csv)"``."""
        return _path(QFileDialog.getOpenFileName(parent, title, str(start or ""), kinds)[0])

    def save_file(self, parent: QWidget | None, title: str, kinds: str, start: Path | None = None) -> Path | None:
        """Ask where to write a file."""
        return _path(QFileDialog.getSaveFileName(parent, title, str(start or ""), kinds)[0])

    def confirm(self, parent: QWidget | None, title: str, text: str, yes: str, no: str) -> bool:
        """Ask a question with two answers; `no` is the safe one."""
        box = QMessageBox(QMessageBox.Icon.Question, title, text, QMessageBox.StandardButton.NoButton, parent)
        agree = box.addButton(yes, QMessageBox.ButtonRole.AcceptRole)
        refuse = box.addButton(no, QMessageBox.ButtonRole.RejectRole)
        box.setDefaultButton(refuse)
        box.setEscapeButton(refuse)
        box.exec()
        agreed = box.clickedButton() is agree
        box.deleteLater()
        return agreed

    def tell(self, parent: QWidget | None, title: str, text: str) -> None:
        """Show a text until it is closed."""
        QMessageBox.about(parent, title, text)


def _path(name: str) -> Path | None:
    return Path(name) if name else None
