"""What is to be thought of a result: failed in red, doubtful in yellow, always with the sentences that say why."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFrame, QWidget

from core.model import Verdict
from stripe_gui.presenters.told import sentence, told, translate
from stripe_gui.widgets.layout import column, emptied, label, row
from stripe_gui.widgets.notice import COLOURS, Sign

KINDS = {"passed": "success", "doubtful": "warning", "failed": "error"}  # of a notice, whose sign and colours it takes
ORDER = ("failed", "doubtful", "passed")


def verdict_words(verdict: Verdict, of: str = "") -> str:
    """Give a verdict as a text: the word first, then why."""
    word = {
        "passed": translate("Verdict", "Passed"),
        "doubtful": translate("Verdict", "Doubtful"),
        "failed": translate("Verdict", "Failed"),
    }[verdict.state]
    head = f"{word}: {told(of)}" if of else word
    return "\n".join((head, *(f"{sentence(text).rstrip('.')}." for text in verdict.because)))


class VerdictBox(QFrame):
    """One verdict, such as on a calibration, named by what it is `of`."""

    def __init__(self, verdict: Verdict, of: str = "") -> None:
        super().__init__()
        self.verdict = verdict
        kind = KINDS[verdict.state]
        self.setProperty("notice", kind)
        words = verdict_words(verdict, of)
        passed = verdict.state == "passed"  # takes a line where others take room
        text = words.replace("\n", "   ") if passed else words
        self.text = label(text, wrap=True, bold=verdict.state == "failed")
        self.setAccessibleName(text)
        sign = Sign(kind, COLOURS[kind])
        inside = row(sign, (self.text, 1))
        inside.setAlignment(sign, Qt.AlignmentFlag.AlignTop)
        edge = 4 if passed else 8
        inside.setContentsMargins(14, edge, 14, edge)
        self.setLayout(inside)


class VerdictList(QWidget):
    """Verdicts below each other, what failed first; takes no room where there is nothing to say."""

    def __init__(self) -> None:
        super().__init__()
        self._rows = column(spacing=6)
        self.setLayout(self._rows)
        self.boxes: list[VerdictBox] = []
        self.hide()

    def show_verdicts(self, verdicts: dict[str, Verdict]) -> None:
        emptied(self._rows)
        found = sorted(verdicts.items(), key=lambda item: ORDER.index(item[1].state))
        self.boxes = [VerdictBox(verdict, of) for of, verdict in found]
        for box in self.boxes:
            self._rows.addWidget(box)
        self.setVisible(bool(self.boxes))
