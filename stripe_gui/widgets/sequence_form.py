"""The choice of a sequence: a preset with its options, or a list of patterns from a file; and what it is."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import QCheckBox, QComboBox, QGridLayout, QLineEdit, QWidget

from core.errors import StripeError
from core.patterns import PRESETS, SequenceSpec, read_sequence_file
from stripe_gui.presenters.sequences import (
    Option,
    SequenceView,
    Shown,
    look_at,
    options_of,
    preset_title,
    spec_of,
    typed,
)
from stripe_gui.presenters.told import sentence
from stripe_gui.widgets.layout import boxed, button, card, choice, column, emptied, label, make, row
from stripe_gui.widgets.notice import Sign
from stripe_gui.widgets.pattern_strip import PatternStrip
from stripe_gui.workbench import Workbench

OWN, LISTED = "own", "listed"  # beside the presets' names


class SequenceForm(QWidget):
    """Asks what is to be shown, and says at once what that is to the projector.

    `view` is what was chosen, looked at; None while that is being worked out.
    """

    changed = Signal()

    def __init__(self, bench: Workbench, own: str) -> None:
        super().__init__()
        self._bench = bench
        self._shown: Shown | None = None
        self._listed: SequenceSpec | None = None
        self._wrong = ""  # about what was typed
        self._fields: dict[str, tuple[Option, QWidget]] = {}
        self.view: SequenceView | None = None
        kinds = [(own, OWN), *((preset_title(name), name) for name in PRESETS)]
        kinds.append((self.tr("A list of patterns from a file"), LISTED))
        self.kind = choice(self.tr("Sequence"), self._kind_chosen, *kinds, minimumContentsLength=30)
        self.kind.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
        self.file = make(QLineEdit, accessibleName=self.tr("File of patterns"))
        self.file.setPlaceholderText(self.tr("a JSON list of patterns, a capture.json or a project.json"))
        self.choose_button = button(self.tr("Choose…"), self._choose, "folder")
        self.choose_button.setAccessibleName(self.tr("Choose the file of patterns"))
        self._file_row = boxed(row(self.file, self.choose_button, spacing=8))
        self._grid = QGridLayout()
        self._grid.setHorizontalSpacing(12)
        self._grid.setVerticalSpacing(8)
        self._grid.setColumnStretch(4, 1)
        self.words = label("", "muted", wrap=True)
        self.problem = label("", wrap=True)
        self._sign = boxed(row(Sign("warning", "warning"), (self.problem, 1), spacing=8))
        self.strip = PatternStrip(self.tr("Patterns of the sequence"))
        frame = card(self.kind, self._file_row, self._grid, self.words, self._sign, title=self.tr("Sequence"))
        self.setLayout(column(frame, self.strip))
        self.file.editingFinished.connect(self._read_file)
        self._kind_chosen()

    def show_spec(self, spec: SequenceSpec | None) -> None:
        kind = OWN if spec is None else spec.preset or LISTED
        with QSignalBlocker(self.kind):
            self.kind.setCurrentIndex(self.kind.findData(kind))
        with QSignalBlocker(self.file):
            self.file.clear()
        self._listed = spec if kind == LISTED else None
        self._offer_options({} if spec is None else dict(spec.options))
        self.look()

    def show_projector(self, shown: Shown) -> None:
        if shown != self._shown:
            self._shown = shown
            self.look()

    @property
    def spec(self) -> SequenceSpec | None:
        """What is chosen; None for the projector's own, and while it cannot be used."""
        kind = self.kind.currentData()
        if kind in (OWN, LISTED):
            return self._listed if kind == LISTED else None
        try:
            return spec_of(kind, self._options())
        except StripeError:
            return None

    def missing(self) -> str:
        """What is wrong with the choice; empty if nothing is."""
        if self._wrong:
            return self._wrong
        if self.kind.currentData() == LISTED and self._listed is None:
            return self.tr("Choose the file of patterns.")
        return (self.view.problem or self.view.refusal) if self.view else ""

    def look(self) -> None:
        """Work out what the choice is, in the background: some sequences take seconds to make."""
        self.view, self._wrong = None, ""
        kind = self.kind.currentData()
        if kind not in (OWN, LISTED):
            try:
                spec_of(kind, self._options())
            except StripeError as error:
                self._wrong = f"{sentence(error.where)} {error.seen}: {error.remedy}."
        if self._shown is None or self._wrong or (kind == LISTED and self._listed is None):
            self._tell()
            return
        if kind == OWN:
            self._looked(self._shown, look_at(None, self._shown))
            return
        if not self.isVisible():  # its step looks again when it comes to the front
            return
        self.words.setText(self.tr("working out the sequence …"))
        self._bench.views.run(
            self.tr("Sequence"),
            look_at,
            self.spec,
            self._shown,
            on_done=partial(self._looked, self._shown),
            on_failed=self._bench.report_failure,
        )
        self.changed.emit()

    def _looked(self, shown: Shown, view: SequenceView) -> None:
        if shown == self._shown:
            self.view = view
            self._tell()

    def _tell(self) -> None:
        view = self.view or SequenceView()
        self.words.setText(view.words)
        self.words.setVisible(bool(view.words))
        problem = self._wrong or view.problem or view.refusal
        self.problem.setText(problem)
        self._sign.setVisible(bool(problem))
        self.strip.set_patterns(view.patterns, self._shown.lines if self._shown else (1, 1))
        self.strip.setVisible(bool(view.patterns))
        self.changed.emit()

    def _kind_chosen(self) -> None:
        self._offer_options({})
        self.look()

    def _offer_options(self, options: dict[str, Any]) -> None:
        """Give every option of the chosen preset a field."""
        kind = self.kind.currentData()
        self._file_row.setVisible(kind == LISTED)
        emptied(self._grid)
        self._fields = {}
        for i, option in enumerate(() if kind in (OWN, LISTED) else options_of(kind)):
            field = self._field(option, options.get(option.key))
            self._fields[option.key] = option, field
            line, at = i // 2, 2 * (i % 2)
            name = label("" if isinstance(field, QCheckBox) else option.title)
            name.setBuddy(field)
            self._grid.addWidget(name, line, at)
            self._grid.addWidget(field, line, at + 1)

    def _field(self, option: Option, value: Any) -> QWidget:
        made: QWidget
        if isinstance(option.usual, bool):
            made = box = QCheckBox(option.title)
            box.setChecked(option.usual if value is None else bool(value))
            box.toggled.connect(self.look)
        elif option.choices:
            made = choice = QComboBox()
            choice.addItems(option.choices)
            choice.setCurrentText(str(option.usual if value is None else value))
            choice.currentIndexChanged.connect(self.look)
        else:
            made = text = QLineEdit("" if value is None else str(value).strip("[]()"))
            usual = self.tr("automatic") if option.usual is None else f"{option.usual:g}"
            text.setPlaceholderText(usual)
            text.editingFinished.connect(self.look)
            text.setMaximumWidth(160)
        made.setAccessibleName(option.title)
        return made

    def _options(self) -> dict[str, Any]:
        found = {}
        for key, (option, field) in self._fields.items():
            if isinstance(field, QLineEdit):
                value = typed(field.text().strip()) if field.text().strip() else option.usual
            else:
                value = field.isChecked() if isinstance(field, QCheckBox) else field.currentText()  # type: ignore[attr-defined]
            if value != option.usual:
                found[key] = value
        return found

    def _choose(self) -> None:
        start = Path(self.file.text()).parent if self.file.text() else Path.home()
        chosen = self._bench.dialogs.open_file(self, self.tr("Choose a file of patterns"), "JSON (*.json)", start)
        if chosen is not None:
            self.file.setText(str(chosen))
            self._read_file()

    def _read_file(self) -> None:
        text = self.file.text().strip()
        if not text:
            return
        try:
            self._listed = read_sequence_file(Path(text).expanduser())
        except StripeError as error:
            self._listed = None
            self.look()
            self._wrong = f"{error.where}: {error.seen}: {error.remedy}."
            self._tell()
            return
        self.look()
