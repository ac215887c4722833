"""Cards, headings, buttons and fields with the same spacing everywhere."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

from PySide6.QtCore import QSignalBlocker, QSize, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import (
    QComboBox,
    QDoubleSpinBox,
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QLayout,
    QPushButton,
    QScrollArea,
    QSizePolicy,
    QSpinBox,
    QSplitter,
    QTabWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from stripe_gui.assets import icon
from stripe_gui.presenters.told import translate

SPACE = 12
MARGIN = 20
Item = QWidget | QLayout | None | tuple[QWidget | QLayout, int]
Made = TypeVar("Made", bound=QWidget)
Spin = TypeVar("Spin", QSpinBox, QDoubleSpinBox)
Box = TypeVar("Box", QHBoxLayout, QVBoxLayout)


def make(kind: Callable[..., Made], *arguments: Any, **properties: Any) -> Made:
    """Give a widget with its Qt properties set, as ``accessibleName="Map"``: the stubs know none in constructors."""
    return kind(*arguments, **properties)


def label(text: str = "", role: str = "", wrap: bool = False, *, bold: bool = False) -> QLabel:
    """Give a text; roles are "title", "heading", "muted" and "figure" (see app.qss)."""
    made = QLabel(text)
    made.setProperty("role", role)
    made.setWordWrap(wrap)
    made.setTextFormat(Qt.TextFormat.PlainText)
    made.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    made.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    if bold:
        font = made.font()
        font.setBold(True)
        made.setFont(font)
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


def action_button(action: QAction, text: str = "") -> QPushButton:
    """Give a button that runs an action and follows its state."""
    made = button((text or action.text()).replace("&", ""), action.trigger, "run")
    made.setIcon(action.icon())
    made.setToolTip(action.toolTip())
    made.setEnabled(action.isEnabled())
    action.enabledChanged.connect(made.setEnabled)
    return made


def tool(icon_name: str, name: str, slot: Callable[[], object]) -> QToolButton:
    """Give a small button with an icon only."""
    made = make(QToolButton, icon=icon(icon_name), iconSize=QSize(14, 14), accessibleName=name, toolTip=name)
    made.clicked.connect(lambda: slot())
    return made


def fit_button(slot: Callable[[], object]) -> QPushButton:
    """Give the button that shows the whole image."""
    made = button("", slot, "fit", flat=True)
    name = translate("Layout", "Whole image")
    made.setAccessibleName(name)
    made.setToolTip(name)
    return made


def card(
    *items: Item, title: str = "", spacing: int = SPACE, margins: tuple[int, int, int, int] = (16, 14, 16, 14)
) -> QFrame:
    """Put widgets below each other, as `column` does, on a framed surface."""
    frame = QFrame()
    frame.setProperty("role", "card")
    heading = [label(title, "heading")] if title else []
    frame.setLayout(column(*heading, *items, spacing=spacing, margins=margins))
    return frame


def row(*items: Item, spacing: int = SPACE) -> QHBoxLayout:
    """Put widgets side by side; None is a space that stretches, ``(widget, n)`` takes n shares of the room."""
    return _filled(QHBoxLayout(), items, spacing)


def column(*items: Item, spacing: int = SPACE, margins: tuple[int, int, int, int] = (0, 0, 0, 0)) -> QVBoxLayout:
    """Put widgets below each other, as `row` does side by side; margins are left, top, right, bottom."""
    return _filled(QVBoxLayout(), items, spacing, margins)


def boxed(layout: QLayout) -> QWidget:
    """Give a widget that holds a layout."""
    widget = QWidget()
    widget.setLayout(layout)
    return widget


def splitter(*widgets: QWidget, widest: int = -1, down: bool = False) -> QSplitter:
    """Put widgets side by side, or `down`, with borders to be drawn; the one of an index gets what room there is."""
    made = QSplitter(Qt.Orientation.Vertical if down else Qt.Orientation.Horizontal)
    for widget in widgets:
        made.addWidget(widget)
    if widest >= 0:
        made.setStretchFactor(widest, 1)
    made.setChildrenCollapsible(False)
    made.setHandleWidth(14)
    return made


def scrolled(widget: QWidget, *, across: bool = True) -> QScrollArea:
    """Give an area without a frame in which a widget is scrolled, down only unless `across`."""
    area = QScrollArea()
    area.setWidgetResizable(True)
    area.setFrameShape(QFrame.Shape.NoFrame)
    if not across:
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    area.setWidget(widget)
    return area


def emptied(layout: QLayout) -> None:
    """Take away the widgets of a layout."""
    while layout.count():
        item = layout.takeAt(0)
        widget = item.widget() if item is not None else None
        if widget is not None:
            widget.hide()
            widget.deleteLater()


def tabbed(*entries: tuple[str, str, QWidget], **properties: Any) -> QTabWidget:
    """Give tabs, of each a name for the program, its title, and what it shows."""
    tabs = make(QTabWidget, documentMode=True, **properties)
    for name, title, widget in entries:
        widget.setObjectName(name)
        tabs.addTab(widget, title)
    return tabs


def tab_name(tabs: QTabWidget, index: int) -> str:
    """Give the name, for the program, of what a tab shows."""
    widget = tabs.widget(index)
    return widget.objectName() if widget is not None else ""


def tab_parts(tabs: QTabWidget) -> Iterator[str]:
    """Bring each tab to the front that can be, name it, and go back to the first: for pictures of everything."""
    for i in range(tabs.count()):
        if tabs.isTabEnabled(i):
            tabs.setCurrentIndex(i)
            yield f"-{tab_name(tabs, i)}"
    tabs.setCurrentIndex(0)


def choice(name: str, changed: Callable[[], object] | None, *entries: tuple[str, Any], **properties: Any) -> QComboBox:
    """Give a field that chooses among entries (text, value)."""
    made = make(QComboBox, accessibleName=name, **properties)
    for text, value in entries:
        made.addItem(text, value)
    if changed is not None:
        made.currentIndexChanged.connect(lambda: changed())
    return made


def refill(box: QComboBox, entries: Iterable[tuple[str, Any]], chosen: Any, *, otherwise: int = 0) -> None:
    """Give a field other entries (text, value), silently; where the chosen value is not among them, by index."""
    with QSignalBlocker(box):
        box.clear()
        for text, value in entries:
            box.addItem(text, value)
        found = box.findData(chosen)
        box.setCurrentIndex(found if found >= 0 else otherwise)


def whole(name: str, least: int, most: int, changed: Callable[[], object], suffix: str = "") -> QSpinBox:
    """Give a field for a whole number."""
    made = make(QSpinBox, minimum=least, maximum=most, suffix=suffix, accessibleName=name)
    return _listened(made, changed)


def real(
    name: str,
    least: float,
    most: float,
    decimals: int,
    changed: Callable[[], object],
    suffix: str = "",
    *,
    step: float | None = None,
) -> QDoubleSpinBox:
    """Give a field for a number, whose arrows change the second of its digits, or go by a `step`."""
    made = make(QDoubleSpinBox, decimals=decimals, minimum=least, maximum=most, suffix=suffix, accessibleName=name)
    if step is None:
        made.setStepType(QDoubleSpinBox.StepType.AdaptiveDecimalStepType)
    else:
        made.setSingleStep(step)
    return _listened(made, changed)


def form(*lines: tuple[str, QWidget]) -> QGridLayout:
    """Put names beside fields."""
    grid = QGridLayout()
    grid.setContentsMargins(0, 0, 0, 0)
    grid.setHorizontalSpacing(SPACE)
    grid.setVerticalSpacing(8)
    grid.setColumnStretch(1, 1)
    for i, (name, field) in enumerate(lines):
        grid.addWidget(named(name, field), i, 0)
        grid.addWidget(field, i, 1)
    return grid


def named(name: str, field: QWidget) -> QLabel:
    """Give the name of a field, tied to it for screen readers."""
    made = label(name)
    made.setBuddy(field)
    return made


def _listened(made: Spin, changed: Callable[[], object]) -> Spin:
    made.lineEdit().setTextMargins(6, 0, 0, 0)  # the style sheet's padding does not reach it
    made.valueChanged.connect(lambda: changed())
    return made


def _filled(
    layout: Box, items: tuple[Item, ...], spacing: int, margins: tuple[int, int, int, int] = (0, 0, 0, 0)
) -> Box:
    layout.setContentsMargins(*margins)
    layout.setSpacing(spacing)
    for entry in items:
        item, stretch = entry if isinstance(entry, tuple) else (entry, 0)
        if item is None:
            layout.addStretch(1)
        elif isinstance(item, QLayout):
            layout.addLayout(item, stretch)
        else:
            layout.addWidget(item, stretch)
    return layout
