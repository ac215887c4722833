"""Colours and style, light and dark, set explicitly: the same on every desktop and without one."""

from __future__ import annotations

from dataclasses import asdict
from string import Template

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QColor, QGuiApplication, QPalette
from PySide6.QtWidgets import QApplication, QWidget

from core.lazy import dataclass
from core.resources import resource


@dataclass(frozen=True)
class Theme:
    """The colours of one appearance. Every meaning they carry is also told by a word or a sign."""

    name: str
    window: str
    surface: str
    sunken: str
    hover: str
    border: str
    text: str
    muted: str
    faint: str
    accent: str
    accent_hover: str
    accent_text: str
    selection: str
    ok: str
    warning: str
    danger: str
    ok_fill: str
    warning_fill: str
    danger_fill: str
    info_fill: str
    canvas: str
    mark: str
    mark_other: str


_COLOURS = {  # light, dark
    "window": ("#f4f6f8", "#15191e"),
    "surface": ("#ffffff", "#1d2329"),
    "sunken": ("#e9edf1", "#11151a"),
    "hover": ("#e3e9ef", "#2a323b"),
    "border": ("#d3dae2", "#343e48"),
    "text": ("#1b2128", "#e7ebef"),
    "muted": ("#56616d", "#a3afbb"),
    "faint": ("#98a3ae", "#66727e"),
    "accent": ("#0b63b6", "#58a6f0"),
    "accent_hover": ("#0a559c", "#7bbaf5"),
    "accent_text": ("#ffffff", "#0c141c"),
    "selection": ("#cfe3f7", "#234d75"),
    "ok": ("#1a7f37", "#5fc47a"),
    "warning": ("#8a5a00", "#e0ad4b"),
    "danger": ("#b42318", "#f5857a"),
    "ok_fill": ("#e5f5e9", "#183222"),
    "warning_fill": ("#fdf3dc", "#362b14"),
    "danger_fill": ("#fdeae8", "#3d201e"),
    "info_fill": ("#e4f0fb", "#172c42"),
    "canvas": ("#dfe4e9", "#0b0e11"),
    "mark": ("#0b63b6", "#6cb6ff"),
    "mark_other": ("#b35900", "#f0a04b"),
}
LIGHT, DARK = (
    Theme(name, **{key: pair[i] for key, pair in _COLOURS.items()}) for i, name in enumerate(("light", "dark"))
)


def current() -> Theme:
    """Give the theme the program shows."""
    app = QApplication.instance()
    return DARK if app is not None and app.property("theme") == "dark" else LIGHT


def resolve(choice: str) -> Theme:
    """Give the theme a choice stands for: "light", "dark", or what the desktop says."""
    if choice == "system":
        dark = QGuiApplication.styleHints().colorScheme() == Qt.ColorScheme.Dark
        return DARK if dark else LIGHT
    return DARK if choice == "dark" else LIGHT


def apply(app: QApplication, theme: Theme) -> None:
    """Show a theme: palette and style sheet."""
    app.setProperty("theme", theme.name)
    app.setStyleSheet("")  # from none to one is four times as quick as from one to the other
    app.setPalette(palette(theme))
    app.setStyleSheet(style_sheet(theme))


def palette(theme: Theme) -> QPalette:
    """Give the palette for Qt's Fusion style."""
    roles = QPalette.ColorRole
    colours = {
        roles.Window: theme.window,
        roles.WindowText: theme.text,
        roles.Base: theme.surface,
        roles.AlternateBase: theme.window,
        roles.Text: theme.text,
        roles.PlaceholderText: theme.muted,
        roles.Button: theme.surface,
        roles.ButtonText: theme.text,
        roles.BrightText: theme.danger,
        roles.ToolTipBase: theme.surface,
        roles.ToolTipText: theme.text,
        roles.Highlight: theme.selection,
        roles.HighlightedText: theme.text,
        roles.Link: theme.accent,
        roles.LinkVisited: theme.accent,
        roles.Light: theme.surface,
        roles.Midlight: theme.hover,
        roles.Mid: theme.border,
        roles.Dark: theme.faint,
        roles.Shadow: theme.border,
        roles.Accent: theme.accent,
    }
    result = QPalette()
    for role, colour in colours.items():
        result.setColor(role, QColor(colour))
    for role in (roles.WindowText, roles.Text, roles.ButtonText, roles.HighlightedText):
        result.setColor(QPalette.ColorGroup.Disabled, role, QColor(theme.faint))
    return result


def style_sheet(theme: Theme) -> str:
    """Fill the theme's colours into `resources/styles/app.qss`."""
    styles = resource("styles")
    text = styles.joinpath("app.qss").read_text(encoding="utf-8")
    files_of = {
        key: styles.joinpath(f"{key.replace('_', '-')}-{theme.name}.svg") for key in ("chevron", "chevron_up", "check")
    }
    places = {key: str(file).replace("\\", "/") for key, file in files_of.items()}
    return Template(text).substitute(asdict(theme) | places)


class Themed(QWidget):
    """A widget that draws in the theme's colours, and anew when the theme changes."""

    def colour(self) -> None:
        """Put the colours of the current theme on what is drawn."""

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        if event.type() == QEvent.Type.PaletteChange and self.layout() is not None:  # not while it is made
            self.colour()
        super().changeEvent(event)
