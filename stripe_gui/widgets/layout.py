"""Cards, headings and buttons with the same spacing everywhere."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QLabel,
    QLayout,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from stripe_gui.assets import icon

SPACE = 12
MARGIN = 20


def label(text: str = "", role: str = "", wrap: bool = False) -> QLabel:
    """Give a text; roles are "title", "heading", "muted" and "figure" (see app.qss)."""
    made = QLabel(text)
    made.setProperty("role", role)
    made.setWordWrap(wrap)
    made.setTextFormat(Qt.TextFormat.PlainText)
    made.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    made.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    return made


def button(
    text: str, slot: Callable[[], object], icon_name: str = "", *, primary: bool = False, flat: bool = False
) -> QPushButton:
    """Give a button; a page has one primary button at most."""
    made = QPushButton(f" {text}" if icon_name else text)  # a little more room beside the icon
    made.setProperty("primary", primary)
    made.setProperty("flat", flat)
    made.setAccessibleName(text.replace("&", ""))
    made.setSizePolicy(QSizePolicy.Policy.Maximum, QSizePolicy.Policy.Fixed)
    if icon_name:
        made.setIcon(icon(icon_name, on_accent=primary))
    made.clicked.connect(lambda: slot())
    return made


def card(title: str = "") -> tuple[QFrame, QVBoxLayout]:
    """Give a framed surface and the layout to fill."""
    frame = QFrame()
    frame.setProperty("role", "card")
    layout = QVBoxLayout(frame)
    layout.setContentsMargins(16, 14, 16, 14)
    layout.setSpacing(SPACE)
    if title:
        layout.addWidget(label(title, "heading"))
    return frame, layout


def row(*items: QWidget | QLayout | None, spacing: int = SPACE) -> QHBoxLayout:
    """Put widgets side by side; None is a space that stretches."""
    layout = QHBoxLayout()
    _fill(layout, items, spacing)
    return layout


def column(*items: QWidget | QLayout | None, spacing: int = SPACE) -> QVBoxLayout:
    """Put widgets below each other; None is a space that stretches."""
    layout = QVBoxLayout()
    _fill(layout, items, spacing)
    return layout


def boxed(layout: QLayout, *, top: int = 0) -> QWidget:
    """Give a widget that holds a layout, without margins but one at its `top`."""
    widget = QWidget()
    layout.setContentsMargins(0, top, 0, 0)
    widget.setLayout(layout)
    return widget


def scrolled(widget: QWidget, *, across: bool = True) -> QScrollArea:
    """Give an area without a frame in which a widget is scrolled, down only unless `across`."""
    area = QScrollArea()
    area.setWidgetResizable(True)
    area.setFrameShape(QFrame.Shape.NoFrame)
    if not across:
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    area.setWidget(widget)
    return area


def emptied(layout: QLayout, *, keep: int = 0) -> None:
    """Take away the widgets of a layout beyond its first `keep` items."""
    while layout.count() > keep:
        item = layout.takeAt(keep)
        widget = item.widget() if item is not None else None
        if widget is not None:
            widget.hide()
            widget.deleteLater()


def tab_name(tabs: QTabWidget, index: int) -> str:
    """Give the name, for the program, of what a tab shows."""
    widget = tabs.widget(index)
    return widget.objectName() if widget is not None else ""


def _fill(layout: QHBoxLayout | QVBoxLayout, items: tuple[QWidget | QLayout | None, ...], spacing: int) -> None:
    layout.setContentsMargins(0, 0, 0, 0)
    layout.setSpacing(spacing)
    for item in items:
        if item is None:
            layout.addStretch(1)
        elif isinstance(item, QLayout):
            layout.addLayout(item)
        else:
            layout.addWidget(item)
