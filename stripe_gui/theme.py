"""Colours and style, light and dark, set explicitly: the same on every desktop and without one."""

from __future__ import annotations

from string import Template

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QColor, QGuiApplication, QPalette
from PySide6.QtWidgets import QApplication, QWidget

from core.resources import resource


class Colour:
    """A colour of a theme, in light and in dark."""

    def __init__(self, *shades: str) -> None:
        self._shades = shades

    def __get__(self, theme: Theme, _owner: type) -> str:
        return self._shades[theme.name == "dark"]


class Theme:
    """The colours of one appearance. Every meaning they carry is also told by a word or a sign."""

    def __init__(self, name: str) -> None:
        self.name = name

    window = Colour("#f4f6f8", "#15191e")
    surface = Colour("#ffffff", "#1d2329")
    sunken = Colour("#e9edf1", "#11151a")
    hover = Colour("#e3e9ef", "#2a323b")
    border = Colour("#d3dae2", "#343e48")
    text = Colour("#1b2128", "#e7ebef")
    muted = Colour("#56616d", "#a3afbb")
    faint = Colour("#98a3ae", "#66727e")
    accent = Colour("#0b63b6", "#58a6f0")
    accent_hover = Colour("#0a559c", "#7bbaf5")
    accent_text = Colour("#ffffff", "#0c141c")
    selection = Colour("#cfe3f7", "#234d75")
    ok = Colour("#1a7f37", "#5fc47a")
    warning = Colour("#8a5a00", "#e0ad4b")
    danger = Colour("#b42318", "#f5857a")
    ok_fill = Colour("#e5f5e9", "#183222")
    warning_fill = Colour("#fdf3dc", "#362b14")
    danger_fill = Colour("#fdeae8", "#3d201e")
    info_fill = Colour("#e4f0fb", "#172c42")
    canvas = Colour("#dfe4e9", "#0b0e11")
    mark = Colour("#0b63b6", "#6cb6ff")
    mark_other = Colour("#b35900", "#f0a04b")


LIGHT, DARK = Theme("light"), Theme("dark")


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
    result = QPalette()
    for colour, painted in (
        (theme.window, (roles.Window, roles.AlternateBase)),
        (theme.surface, (roles.Base, roles.Button, roles.ToolTipBase, roles.Light)),
        (theme.text, (roles.WindowText, roles.Text, roles.ButtonText, roles.ToolTipText, roles.HighlightedText)),
        (theme.muted, (roles.PlaceholderText,)),
        (theme.danger, (roles.BrightText,)),
        (theme.selection, (roles.Highlight,)),
        (theme.accent, (roles.Link, roles.LinkVisited, roles.Accent)),
        (theme.hover, (roles.Midlight,)),
        (theme.border, (roles.Mid, roles.Shadow)),
        (theme.faint, (roles.Dark,)),
    ):
        for role in painted:
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
    colours = {name: getattr(theme, name) for name, kind in vars(Theme).items() if isinstance(kind, Colour)}
    return Template(text).substitute(colours | places)


class Themed(QWidget):
    """A widget that draws in the theme's colours, and anew when the theme changes."""

    def colour(self) -> None:
        """Put the colours of the current theme on what is drawn."""

    def changeEvent(self, event: QEvent) -> None:  # noqa: N802
        if event.type() == QEvent.Type.PaletteChange and self.layout() is not None:  # not while it is made
            self.colour()
        super().changeEvent(event)
