"""A table of results: sortable by its numbers, copyable into a spreadsheet."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, QSortFilterProxyModel, Qt, Signal
from PySide6.QtGui import QGuiApplication, QKeySequence, QShortcut
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView, QWidget

from core.report import Number, Table, cell_text
from core.report.table import numeric_columns
from stripe_gui.presenters.told import told
from stripe_gui.widgets.layout import column, label, make

VALUE = Qt.ItemDataRole.UserRole
EMPTY = Table("", (), ())
Index = QModelIndex | QPersistentModelIndex


class TableModel(QAbstractTableModel):
    """A `core.report.Table` as Qt wants it."""

    def __init__(self) -> None:
        super().__init__()
        self.table = EMPTY
        self._numeric: tuple[bool, ...] = ()

    def show(self, table: Table) -> None:
        self.beginResetModel()
        self.table = table
        self._numeric = numeric_columns(table)
        self.endResetModel()

    def rowCount(self, parent: Index | None = None) -> int:  # noqa: N802
        return 0 if parent is not None and parent.isValid() else len(self.table.rows)

    def columnCount(self, parent: Index | None = None) -> int:  # noqa: N802
        return 0 if parent is not None and parent.isValid() else len(self.table.columns)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Give a cell's text, its alignment, or the number to sort by."""
        if not index.isValid():
            return None
        cell = self.table.rows[index.row()][index.column()]
        if role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.AccessibleTextRole):
            return told(cell_text(cell)) if isinstance(cell, str) else cell_text(cell)
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return self._side(index.column())
        if role == VALUE:
            return cell.value if isinstance(cell, Number) else cell
        return None

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole) -> Any:  # noqa: N802
        if orientation != Qt.Orientation.Horizontal:
            return None
        if role == Qt.ItemDataRole.TextAlignmentRole:
            return self._side(section)
        return told(self.table.columns[section]) if role == Qt.ItemDataRole.DisplayRole else None

    def _side(self, section: int) -> int:
        side = Qt.AlignmentFlag.AlignRight if self._numeric[section] else Qt.AlignmentFlag.AlignLeft
        return int(side | Qt.AlignmentFlag.AlignVCenter)


class _Sorted(QSortFilterProxyModel):
    def lessThan(self, left: Index, right: Index) -> bool:  # noqa: N802
        return _key(left.data(VALUE)) < _key(right.data(VALUE))


def _key(value: Any) -> tuple[int, float, str]:
    """Order numbers before texts before what is not known."""
    if value is None:
        return (2, 0.0, "")
    return (1, 0.0, str(value)) if isinstance(value, str) else (0, float(value), "")


class ResultTable(QWidget):
    """A table with its title and notes; Ctrl+C copies the selection (or everything) as tab-separated text."""

    row_chosen = Signal(int)  # row of the table, whatever the sorting

    def __init__(self, name: str = "", *, titled: bool = True) -> None:
        super().__init__()
        self.title = label("", "heading")
        self._titled = titled
        self.model = TableModel()
        self._sorted = _Sorted(self)
        self._sorted.setSourceModel(self.model)
        self.view = make(QTableView, accessibleName=name, showGrid=False, alternatingRowColors=True, wordWrap=False)
        self.view.setModel(self._sorted)
        self.view.setSortingEnabled(True)
        self.view.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.view.setHorizontalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.view.setTabKeyNavigation(False)
        self.view.verticalHeader().hide()
        self.view.verticalHeader().setDefaultSectionSize(28)
        header = self.view.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        header.setHighlightSections(False)
        header.setSortIndicator(-1, Qt.SortOrder.AscendingOrder)
        header.sortIndicatorChanged.connect(self._make_room)
        self.view.selectionModel().currentRowChanged.connect(self._choose)
        copy = QShortcut(QKeySequence.StandardKey.Copy, self.view, context=Qt.ShortcutContext.WidgetShortcut)
        copy.activated.connect(self.copy)
        self.notes = label("", "muted", wrap=True)
        self.setLayout(column(self.title, (self.view, 1), self.notes, spacing=6))

    def show_table(self, table: Table) -> None:
        self.view.horizontalHeader().setSortIndicator(-1, Qt.SortOrder.AscendingOrder)
        self.model.show(table)
        self.title.setText(told(table.title))
        self.title.setVisible(self._titled and bool(table.title))
        self.notes.setText("\n".join(map(told, table.notes)))
        self.notes.setVisible(bool(table.notes))
        self.view.setAccessibleDescription(told(table.title))
        header = self.view.horizontalHeader()
        header.setSortIndicatorShown(False)  # else every column keeps room for the arrow that one of them may show
        self.view.resizeColumnsToContents()
        header.setSortIndicatorShown(True)

    def fit_height(self, least: int | None = None) -> None:
        """Make the view as high as its rows, 14 rows at most; where there is less room, down to a height in px."""
        rows = min(self.model.rowCount(), 14)
        height = self.view.horizontalHeader().sizeHint().height() + 28 * rows + 6
        height += self.view.horizontalScrollBar().sizeHint().height()
        self.view.setMaximumHeight(height)
        self.view.setMinimumHeight(height if least is None else least)

    def fit_width(self, most: int = 1 << 24) -> None:
        """Make the table as wide as its columns, but no wider than `most`."""
        room = self.view.verticalScrollBar().sizeHint().width() + 2 * self.view.frameWidth()
        self.setFixedWidth(min(self.view.horizontalHeader().length() + room, most))

    def choose_row(self, row: int) -> None:
        self.view.setCurrentIndex(self._sorted.mapFromSource(self.model.index(row, 0)))

    def chosen_row(self) -> int | None:
        """Give the chosen row of the table, whatever the sorting."""
        current = self.view.currentIndex()
        return self._sorted.mapToSource(current).row() if current.isValid() else None

    def copy(self) -> None:
        """Copy the selected rows, or all of them, with the columns' names."""
        chosen = sorted({index.row() for index in self.view.selectionModel().selectedRows()})
        rows = chosen or range(self._sorted.rowCount())
        lines = ["\t".join(map(told, self.model.table.columns))]
        for i in rows:
            cells = [self._sorted.index(i, j).data() for j in range(self._sorted.columnCount())]
            lines.append("\t".join(cells))
        QGuiApplication.clipboard().setText("\n".join(lines))

    def _make_room(self, column: int) -> None:
        """Show a column's name beside the arrow of its order."""
        if column >= 0:
            self.view.resizeColumnToContents(column)

    def _choose(self, current: QModelIndex, _previous: QModelIndex) -> None:
        if current.isValid():
            self.row_chosen.emit(self._sorted.mapToSource(current).row())
