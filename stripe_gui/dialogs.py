"""Every question to the operator goes through one object, so that tests (and scripts) can answer it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QFileDialog,
    QLabel,
    QListWidget,
    QListWidgetItem,
    QMessageBox,
    QVBoxLayout,
    QWidget,
)


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

    def choose_several(
        self, parent: QWidget | None, title: str, text: str, names: Sequence[str], chosen: Collection[str]
    ) -> list[str]:
        """Ask which of some names are meant; none when the operator changed their mind."""
        box = QDialog(parent)
        box.setWindowTitle(title)
        words, listed = QLabel(text), QListWidget()
        words.setWordWrap(True)
        for name in names:
            entry = QListWidgetItem(name, listed)
            entry.setCheckState(Qt.CheckState.Checked if name in chosen else Qt.CheckState.Unchecked)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Ok | QDialogButtonBox.StandardButton.Cancel)
        buttons.accepted.connect(box.accept)
        buttons.rejected.connect(box.reject)
        layout = QVBoxLayout(box)
        for widget in (words, listed, buttons):
            layout.addWidget(widget)
        box.resize(420, 360)
        agreed = box.exec() == QDialog.DialogCode.Accepted
        entries = [listed.item(i) for i in range(listed.count())] if agreed else []
        found = [entry.text() for entry in entries if entry.checkState() == Qt.CheckState.Checked]
        box.deleteLater()
        return found

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
