"""What checks found: a sign, the check's name, and a sentence each."""

from __future__ import annotations

from collections.abc import Iterable

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtWidgets import QAbstractItemView, QListWidget, QListWidgetItem

from core.model import Finding
from core.model.finding import LEVELS
from stripe_gui.assets import icon
from stripe_gui.presenters.told import sentence, told

SIGNS = {"good": "success", "warning": "warning", "bad": "error"}


class FindingList(QListWidget):
    """Findings, the worst first; the chosen one is told."""

    chosen = Signal(object)  # Finding

    def __init__(self, name: str) -> None:
        super().__init__()
        self.setAccessibleName(name)
        self.setWordWrap(True)
        self.setResizeMode(QListWidget.ResizeMode.Adjust)
        self.setIconSize(QSize(20, 20))
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setVerticalScrollMode(QAbstractItemView.ScrollMode.ScrollPerPixel)
        self.findings: list[Finding] = []
        self.currentRowChanged.connect(self._choose)

    def show_findings(self, findings: Iterable[Finding]) -> None:
        self.findings = sorted(findings, key=lambda finding: [*LEVELS].index(finding.level))
        self.clear()
        policy = Qt.ScrollBarPolicy  # a bar that appears while texts are laid out would cut them
        self.setVerticalScrollBarPolicy(policy.ScrollBarAlwaysOn if self.findings else policy.ScrollBarAlwaysOff)
        for finding in self.findings:
            head = f"{sentence(finding.title)} – {told(finding.level_words)}"
            text = f"{sentence(finding.text)}."
            item = QListWidgetItem(icon(SIGNS[finding.level]), f"{head}\n{text}")
            item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{head}. {text}")
            self.addItem(item)
        if self.findings:
            self.setCurrentRow(0)

    def _choose(self, row: int) -> None:
        if 0 <= row < len(self.findings):
            self.chosen.emit(self.findings[row])
