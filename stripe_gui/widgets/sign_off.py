"""Who signs, against which tolerance, and whether the planes stay within it."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QCheckBox, QFormLayout, QLineEdit, QWidget

from core.model import PlaneEvaluation, Verdict
from core.report import SignOff, Tolerance, conformity
from stripe_gui.widgets.layout import SPACE, card, choice, column, label, real, row
from stripe_gui.widgets.verdict import VerdictList


class SignOffForm(QWidget):
    """The fields of a sign-off; with a tolerance it says at once whether the planes pass."""

    def __init__(self) -> None:
        super().__init__()
        self._evaluations: tuple[PlaneEvaluation, ...] = ()
        self.operator, self.instrument, self.date, self.remark, self.reason = (QLineEdit() for _ in range(5))
        self.with_tolerance = QCheckBox(self.tr("Judge against a tolerance"))
        self.limit = real(self.tr("Tolerance"), 0.001, 100.0, 4, self._judge, " mm", step=0.005)
        figures = (self.tr("r.m.s. deviation"), "rms"), (self.tr("largest deviation"), "max")
        self.of = choice(self.tr("Figure that the tolerance limits"), self._judge, *figures)
        self.verdict = VerdictList(whole=True)
        self.verdict.setAccessibleName(self.tr("Result"))
        form = QFormLayout()
        form.setLabelAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
        form.setHorizontalSpacing(SPACE)
        for text, field in (
            (self.tr("Operator"), self.operator),
            (self.tr("Instrument"), self.instrument),
            (self.tr("Date"), self.date),
            (self.tr("Remark"), self.remark),
            (self.tr("Reason"), self.reason),
        ):
            field.setAccessibleName(text)
            form.addRow(label(text), field)
        self._form = form
        self.failed = label("", wrap=True)
        form.addRow(self.failed)
        self.reason.setPlaceholderText(self.tr("why it is signed all the same"))
        self.operator.setPlaceholderText(self.tr("without a name: not signed"))
        limit = row(self.limit, self.of, None)
        self.setLayout(column(card(form, self.with_tolerance, limit, self.verdict, title=self.tr("Sign-off"))))
        self.with_tolerance.toggled.connect(self._judge)
        self.limit.setValue(0.05)
        self.show_evaluations((), ())

    def show_evaluations(self, evaluations: tuple[PlaneEvaluation, ...], failed: Sequence[str]) -> None:
        """Judge an evaluation; without one there is nothing to sign. What failed asks for a reason."""
        self._evaluations = evaluations
        self.setEnabled(bool(evaluations))
        text = self.tr("Failed: {what}. It can be signed with a reason only.").format(what=", ".join(failed))
        self.failed.setText(text)
        for widget in (self.reason, self.failed):
            self._form.setRowVisible(widget, bool(failed))
        self._judge()

    def fill(self, sign_off: SignOff | None, instrument: str) -> None:
        """Show the sign-off there is, or the instrument typed last time with today's date."""
        shown = sign_off or SignOff("", instrument, date=f"{date.today():%Y-%m-%d}")
        self.operator.setText(shown.operator)
        self.instrument.setText(shown.instrument)
        self.date.setText(shown.date)
        self.remark.setText(shown.remark)
        self.reason.setText(shown.despite)
        self.with_tolerance.setChecked(shown.tolerance is not None)
        if shown.tolerance is not None:
            self.limit.setValue(shown.tolerance.limit_mm)
            self.of.setCurrentIndex(self.of.findData(shown.tolerance.of))
        self._judge()

    def sign_off(self) -> SignOff | None:
        """Give what was typed; None without a name, or without anything to sign."""
        name = self.operator.text().strip()
        if not name or not self._evaluations:
            return None
        return SignOff(
            operator=name,
            instrument=self.instrument.text().strip(),
            remark=self.remark.text().strip(),
            date=self.date.text().strip(),
            tolerance=self.tolerance(),
            despite=self.reason.text().strip(),
        )

    def tolerance(self) -> Tolerance | None:
        return Tolerance(self.limit.value(), self.of.currentData()) if self.with_tolerance.isChecked() else None

    def _judge(self) -> None:
        tolerance = self.tolerance()
        self.limit.setEnabled(tolerance is not None)
        self.of.setEnabled(tolerance is not None)
        found: dict[str, Verdict] = {}
        if tolerance is not None and self._evaluations:
            judged = conformity(self._evaluations, tolerance)
            text = judged.text.partition(": ")[2] or judged.text
            found[self.tr("Tolerance")] = Verdict("passed" if judged.passed else "failed", (text,))
        self.verdict.show_verdicts(found)
