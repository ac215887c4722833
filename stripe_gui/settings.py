"""What is remembered between two starts: recent projects, appearance, language, window."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QByteArray, QSettings

RECENT = 8


class Settings:
    """Typed access to QSettings; `file` replaces the user's own settings (tests, the tour)."""

    def __init__(self, file: Path | None = None) -> None:
        if file is None:
            self._store = QSettings("stripe-workbench", "stripe-gui")
        else:
            self._store = QSettings(str(file), QSettings.Format.IniFormat)

    def close(self) -> None:
        """Write now what would be written later, into a folder that may be gone by then."""
        self._store.sync()

    def text(self, key: str, default: str = "") -> str:
        return str(self._store.value(key, default))

    def flag(self, key: str, default: bool = False) -> bool:
        return self.text(key, "true" if default else "false") == "true"

    def set(self, key: str, value: str | bool | QByteArray) -> None:
        """Keep a text, a yes or no, or a window's state."""
        self._store.setValue(key, ("true" if value else "false") if isinstance(value, bool) else value)

    def state(self, key: str) -> QByteArray:
        """Give the state of a window or splitter; empty where none was kept."""
        value = self._store.value(key)
        return value if isinstance(value, QByteArray) else QByteArray()

    def recent(self) -> list[Path]:
        """Give the projects opened last, the latest first."""
        return [Path(line) for line in self.text("recent").split("\n") if line]

    def add_recent(self, folder: Path) -> None:
        """Put a project at the top of the list."""
        paths = [folder, *(p for p in self.recent() if p != folder)]
        self.set("recent", "\n".join(str(p) for p in paths[:RECENT]))

    def remove_recent(self, folder: Path) -> None:
        self.set("recent", "\n".join(str(p) for p in self.recent() if p != folder))
