"""Kept runs: all in a table, two side by side, one in use."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLineEdit, QWidget

from core.pipeline.runs import Run, current_runs, delete_run, list_runs, make_current, rename_run
from stripe_gui.presenters.runs import comparison_table, run_title, runs_table
from stripe_gui.presenters.volumes import difference_view
from stripe_gui.widgets.layout import (
    boxed,
    button,
    choice,
    column,
    label,
    make,
    refill,
    row,
    splitter,
    tab_parts,
    tabbed,
)
from stripe_gui.widgets.result_table import EMPTY, ResultTable
from stripe_gui.widgets.volume_maps import VolumeMaps
from stripe_gui.workbench import Workbench


class RunsPart(QWidget):
    """The runs above, the comparison below."""

    def __init__(self, bench: Workbench) -> None:
        super().__init__()
        self._bench = bench
        self._runs: tuple[Run, ...] = ()
        self._used: set[int] = set()
        self.table = ResultTable(self.tr("Kept runs"), titled=False)
        self.table.row_chosen.connect(lambda _: self._offer())
        self.name = make(QLineEdit, accessibleName=self.tr("Name of the chosen run"))
        self.name.setPlaceholderText(self.tr("a name for the chosen run"))
        self.name.setFixedWidth(240)
        self.name.returnPressed.connect(self.rename)
        self.rename_button = button(self.tr("Name it"), self.rename, flat=True)
        self.use_button = button(self.tr("Use this run"), self.use, "success", flat=True)
        self.use_button.setToolTip(self.tr("Put its calibrations in use; what follows is then out of date."))
        self.delete_button = button(self.tr("Delete"), self.delete, "close", flat=True)
        self.delete_button.setToolTip(self.tr("Delete the chosen run from the disk."))
        self.first = choice(self.tr("Run to compare with"), self._compare, minimumWidth=170)
        self.second = choice(self.tr("Run to compare"), self._compare, minimumWidth=170)
        self.comparison = ResultTable(self.tr("Comparison of two runs"), titled=False)
        self.volume = VolumeMaps(bench, self.tr("Difference of two runs over the working volume"))
        self.tabs = tabbed(
            ("parameters", self.tr("Parameters"), self.comparison),
            ("volume", self.tr("Working volume"), self.volume),
            accessibleName=self.tr("Comparison of two runs"),
        )
        self.tabs.tabBar().setDrawBase(False)
        self.tabs.currentChanged.connect(self._compare)
        self.nothing = label("", "muted", wrap=True)
        self.nothing.setAlignment(Qt.AlignmentFlag.AlignTop)
        buttons = row(self.use_button, self.name, self.rename_button, self.delete_button, None)
        pair = row(label(self.tr("Compare")), self.second, label(self.tr("with")), self.first, None)
        lower = boxed(column(pair, self.nothing, (self.tabs, 1), spacing=8))
        split = splitter(boxed(column((self.table, 1), buttons, spacing=6)), lower, down=True)
        split.setSizes([150, 390])
        self.setLayout(column(split))
        self._offer()

    def show_runs(self) -> None:
        """List the project's runs, the newest first; the newest that can be compared is, with the one before it."""
        folder = self._bench.session.folder
        runs = tuple(reversed(list_runs(folder.project))) if folder is not None else ()
        current = current_runs(folder.project) if folder is not None else {}
        fresh = {r.number for r in runs} != {r.number for r in self._runs}
        at = self.table.chosen_row()
        self._runs, self._used = runs, set(current.values())
        self.table.show_table(runs_table(runs[::-1], current) if runs else EMPTY)
        places = sorted(range(len(runs)), key=lambda i: "photogrammetric" not in runs[i].methods)
        for box, place in ((self.first, places[:2][-1:]), (self.second, places[:1])):
            wanted = None if fresh else box.currentData()
            refill(box, [(run_title(run), run.number) for run in runs], wanted, otherwise=place[0] if place else 0)
        if runs:
            self.table.choose_row(0 if fresh or at is None else at)
        self._compare()
        self._offer()

    @property
    def chosen(self) -> Run | None:
        at = self.table.chosen_row()
        return self._runs[at] if at is not None and at < len(self._runs) else None

    def use(self) -> None:
        self._change(make_current)

    def rename(self) -> None:
        self._change(rename_run, self.name.text())

    def delete(self) -> None:
        run = self.chosen
        if run is None:
            return
        name = run_title(run)
        text = self.tr("{run} and its files are deleted for good.").format(run=name[0].upper() + name[1:])
        ask = self._bench.dialogs.confirm
        if ask(self, self.tr("Delete a run"), text, self.tr("Delete"), self.tr("Keep")):
            self._change(delete_run)

    def _change(self, function: Callable[..., Any], *arguments: Any) -> None:
        run, folder = self.chosen, self._bench.session.folder
        if run is None or folder is None:
            return
        self._bench.guarded(function, folder.project, run, *arguments)
        self._bench.refresh()
        self.show_runs()

    def _offer(self) -> None:
        run = self.chosen
        self.name.setText(run.name if run else "")
        for made in (self.name, self.rename_button, self.use_button):
            made.setEnabled(run is not None)
        self.delete_button.setEnabled(run is not None and run.number not in self._used)

    def _compare(self) -> None:
        by_number = {run.number: run for run in self._runs}
        first, second = (by_number.get(box.currentData()) for box in (self.first, self.second))
        table = EMPTY
        if len(self._runs) < 2:
            self.nothing.setText(self.tr("Runs are compared here once there are two of them."))
        elif first is None or second is None or first is second:
            self.nothing.setText(self.tr("Choose two different runs."))
        else:
            table = comparison_table(first, second)
            self.nothing.setText("" if table.rows else self.tr("Only photogrammetric calibrations can be compared."))
        self.nothing.setVisible(bool(self.nothing.text()))
        self.tabs.setVisible(bool(table.rows))
        if not table.rows or first is None or second is None:
            return
        if self.tabs.currentWidget() is self.volume:
            folder, pair = self._bench.session.opened, self._bench.session.pair_names
            asked = folder.path, *((run.number, run.made_at) for run in (first, second)), pair
            self.volume.look(asked, difference_view, folder.project, first.number, second.number, *pair)
        else:
            self.comparison.show_table(table)

    def parts(self) -> Iterator[str]:
        """Bring what is compared to the front, one after the other, and name it."""
        yield from ("",) if self.tabs.isHidden() else tab_parts(self.tabs)
