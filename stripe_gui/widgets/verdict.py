"""What is to be thought of a result: failed in red, doubtful in yellow, always with the sentences that say why."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QFrame, QScrollArea, QSizePolicy

from core.model import Verdict
from stripe_gui.presenters.told import sentence, told, translate
from stripe_gui.widgets.layout import boxed, column, emptied, label, row
from stripe_gui.widgets.notice import COLOURS, Sign

KINDS = {"passed": "success", "doubtful": "warning", "failed": "error"}  # of a notice, whose sign and colours it takes
QWIDGETSIZE_MAX = 16_777_215  # px, which PySide does not name
HIGHEST = 220  # px: three or four verdicts with their reasons
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


class VerdictList(QScrollArea):
    """Verdicts below each other, what failed first; none takes no room.

    Many are scrolled, or all are shown where the page itself is scrolled.
    """

    def __init__(self, *, whole: bool = False) -> None:
        super().__init__()
        self._highest = QWIDGETSIZE_MAX if whole else HIGHEST
        self.setFrameShape(QFrame.Shape.NoFrame)
        self._rows = column(spacing=6)
        held = boxed(self._rows)
        held.installEventFilter(self)
        self.setWidget(held)
        self.setWidgetResizable(True)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(self.tr("Verdicts"))
        self.boxes: list[VerdictBox] = []
        self.hide()

    def show_verdicts(self, verdicts: dict[str, Verdict]) -> None:
        emptied(self._rows)
        found = sorted(verdicts.items(), key=lambda item: ORDER.index(item[1].state))
        self.boxes = [VerdictBox(verdict, of) for of, verdict in found]
        for box in self.boxes:
            self._rows.addWidget(box)
        self.verticalScrollBar().setValue(0)
        self.setVisible(bool(self.boxes))

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:  # noqa: N802
        if event.type() == QEvent.Type.LayoutRequest:  # verdicts have come or gone
            self._fit()
        return super().eventFilter(watched, event)

    def resizeEvent(self, event: QResizeEvent) -> None:  # noqa: N802
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Be as high as the words are in this width, up to a height that leaves room for the figures."""
        wanted = max(0, self._rows.totalHeightForWidth(self.viewport().width()))
        self.setFixedHeight(min(wanted, self._highest))
        scrolls = wanted > self._highest  # by keys, too
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus if scrolls else Qt.FocusPolicy.NoFocus)
