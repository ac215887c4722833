"""Which captures take part in a calibration, and what each contributes."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableWidget, QTableWidgetItem, QWidget

from core.pipeline import METHODS
from stripe_gui.presenters.capture import role_name
from stripe_gui.presenters.contributions import Contribution
from stripe_gui.presenters.work import chosen_methods
from stripe_gui.widgets.layout import button, column, label, make, row

LEAST = 2  # testfields: one alone leaves the interior orientation open
NONE = "–"


class CaptureChoice(QWidget):
    """A list to tick; captures that cannot take part are listed with the reason."""

    changed = Signal()
    restore_wanted = Signal(str)  # a capture whose excluded targets shall be used again

    def __init__(self) -> None:
        super().__init__()
        self._shown: tuple[Contribution, ...] = ()
        self._without: set[str] = set()
        columns = (
            self.tr("capture"),
            self.tr("role"),
            self.tr("targets"),
            self.tr("excluded"),
            self.tr("roll"),
            self.tr("tilt"),
            self.tr("contributes"),
        )
        said = self.tr("Captures that take part")
        self.table = make(QTableWidget, 0, len(columns), accessibleName=said, showGrid=False, alternatingRowColors=True)
        self.table.setHorizontalHeaderLabels(columns)
        self.table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.table.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.table.setTabKeyNavigation(False)
        self.table.verticalHeader().hide()
        self.table.verticalHeader().setDefaultSectionSize(28)
        header = self.table.horizontalHeader()
        header.setHighlightSections(False)
        header.setStretchLastSection(True)
        header.setDefaultAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        header.setSectionResizeMode(QHeaderView.ResizeMode.Interactive)
        self.table.itemChanged.connect(self._ticked)
        self.table.currentCellChanged.connect(lambda *_: self._offer())
        self.all_button = button(self.tr("All"), lambda: self.set_without(()), flat=True)
        self.restore_button = button(self.tr("Use excluded targets again"), self._restore, "refresh", flat=True)
        self.hint = label(self.tr("Space or a click on the box leaves a capture out or takes it in."), "muted")
        self.summary = label(" ", "muted", wrap=True)
        top = row(self.hint, None, self.restore_button, self.all_button)
        self.setLayout(column(top, (self.table, 1), self.summary, spacing=8))
        self._offer()

    @property
    def without(self) -> tuple[str, ...]:
        """The captures that are left out, in their order."""
        return tuple(c.name for c in self._shown if c.name in self._without) if self._shown else tuple(self._without)

    def show_captures(self, shown: Sequence[Contribution]) -> None:
        """List captures; which are left out stays."""
        self._shown = tuple(shown)
        self._fill()

    def set_without(self, names: Collection[str]) -> None:
        self._without = set(names)
        self._fill()
        self.changed.emit()

    def leave_out(self, name: str, out: bool = True) -> None:
        """Leave one capture out, or take it in again."""
        self.set_without(self._without | {name} if out else self._without - {name})

    def used(self, *roles: str) -> list[Contribution]:
        """Give the captures of some roles that take part."""
        return [c for c in self._shown if c.role in roles and c.usable and c.name not in self._without]

    def missing(self, method: str) -> str:
        """Say what a method still lacks; nothing before the captures are known."""
        if not self._shown:
            return ""
        used = {m: len(self.used(*METHODS[m].roles)) for m in chosen_methods(method)}
        if not any(used.values()):
            return self.tr("No capture takes part.")
        for m, count in used.items():
            least = max(LEAST, METHODS[m].least) if "testfield" in METHODS[m].roles else METHODS[m].least
            if 0 < count < least:
                text = self.tr("Take at least {n} captures of the role {role}, or none.")
                return text.format(n=least, role=", ".join(map(role_name, METHODS[m].roles)))
        return ""

    def _fill(self) -> None:
        self.table.blockSignals(True)
        self.table.setRowCount(len(self._shown))
        for i, c in enumerate(self._shown):
            texts = (
                c.name,
                role_name(c.role),
                NONE if c.targets is None else str(c.targets),
                str(c.excluded or NONE),
                NONE if c.roll_deg is None else f"{round(c.roll_deg)}°",
                NONE if c.tilt_deg is None else f"{round(c.tilt_deg)}°",
                c.remark,
            )
            for j, text in enumerate(texts):
                self.table.setItem(i, j, self._item(c, text, first=j == 0))
        self.table.blockSignals(False)
        self.table.resizeColumnsToContents()
        self.table.setColumnWidth(0, self.table.columnWidth(0) + 14)
        self._sum_up()
        self._offer()

    def _item(self, c: Contribution, text: str, *, first: bool) -> QTableWidgetItem:
        item = QTableWidgetItem(text)
        item.setToolTip(text)
        flags = Qt.ItemFlag.ItemIsSelectable | Qt.ItemFlag.ItemIsEnabled
        if first and c.usable:
            flags |= Qt.ItemFlag.ItemIsUserCheckable
            item.setCheckState(Qt.CheckState.Unchecked if c.name in self._without else Qt.CheckState.Checked)
        item.setFlags(flags if c.usable else flags & ~Qt.ItemFlag.ItemIsEnabled)
        return item

    def _ticked(self, item: QTableWidgetItem) -> None:
        if item.column() == 0:
            name = self._shown[item.row()].name
            self._without.discard(name)
            if item.checkState() is Qt.CheckState.Unchecked:
                self._without.add(name)
            self._sum_up()
            self.changed.emit()

    def _sum_up(self) -> None:
        fields, plates = self.used("testfield"), self.used("depth")
        rolled = sum(c.roll_deg is not None and abs((c.roll_deg + 45) % 180 - 45) > 45 for c in fields)
        text = self.tr("{n} testfields, {r} of them turned by a quarter, and {m} plates take part.")
        self.summary.setText(text.format(n=len(fields), r=rolled, m=len(plates)))

    def _offer(self) -> None:
        at = self.table.currentRow()
        self.restore_button.setEnabled(0 <= at < len(self._shown) and self._shown[at].excluded > 0)

    def _restore(self) -> None:
        self.restore_wanted.emit(self._shown[self.table.currentRow()].name)
