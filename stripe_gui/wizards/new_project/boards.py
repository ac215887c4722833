"""Boards, scale and summary of a new project: one widget a step."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QByteArray, QPointF, QRectF, QSignalBlocker, QSize, Qt, Signal
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtSvg import QSvgRenderer
from PySide6.QtWidgets import QCheckBox, QComboBox, QFrame, QGridLayout, QLineEdit, QRadioButton, QSizePolicy, QWidget

from core.model import ScaleBar, Testfield
from core.report.board import Sheet, sheet_svg
from stripe_gui import theme
from stripe_gui.commands import print_board
from stripe_gui.presenters.new_project import (
    FIELD_FILE,
    PLATE_FILE,
    BoardPlan,
    BoardView,
    Draft,
    board_text,
    board_words,
    look_at_board,
    scale_problem,
    scale_words,
    sequence_of,
)
from stripe_gui.presenters.rig_view import RigView, rig_text
from stripe_gui.presenters.sequences import sequence_text
from stripe_gui.presenters.told import sentence
from stripe_gui.widgets.layout import boxed, button, card, column, form, label, make, real, row, whole
from stripe_gui.wizards.new_project.steps import FORM_WIDTH
from stripe_gui.workbench import Workbench

POLARITIES = ("white-on-black", "black-on-white")
LINE_COLOUR = "#e5484d"  # seen on black and on white


class SheetView(QWidget):
    """A board as it will be printed; a line joins two targets where they are named."""

    def __init__(self) -> None:
        super().__init__()
        self.setMinimumSize(240, 180)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(self.tr("Picture of the board"))
        self.sheet: Sheet | None = None
        self._drawing = QSvgRenderer(self)
        self._drawing.setAspectRatioMode(Qt.AspectRatioMode.KeepAspectRatio)
        self._ends: tuple[int, int] | None = None
        self._instead = ""

    def show_sheet(self, sheet: Sheet | None, ends: tuple[int, int] | None = None, instead: str = "") -> None:
        """Show a board, or say instead why there is none; `ends` are the indices of two targets to be joined."""
        if sheet is not self.sheet and sheet is not None:
            self._drawing.load(QByteArray(sheet_svg(sheet).encode()))
        self.sheet, self._ends, self._instead = sheet, ends, instead
        self.setAccessibleDescription(sheet.title if sheet is not None else instead)
        self.update()

    def sizeHint(self) -> QSize:  # noqa: N802
        return QSize(460, 360)

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: N802
        painter = QPainter(self)
        if self.sheet is None:
            painter.setPen(QColor(theme.current().muted))
            flags = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
            painter.drawText(self.rect().adjusted(4, 4, -4, -4), flags, self._instead)
            return
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        colours, sheet = theme.current(), self.sheet
        room = QRectF(self.rect()).adjusted(1, 1, -1, -1)
        unit = min(room.width() / sheet.width_mm, room.height() / sheet.height_mm)
        page = QRectF(0, 0, sheet.width_mm * unit, sheet.height_mm * unit)
        page.moveCenter(room.center())
        self._drawing.render(painter, page)
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(QColor(colours.border), 1))
        painter.drawRect(page)
        if self._ends is not None:
            places = [page.topLeft() + QPointF(*sheet.targets_mm[end, :2]) * unit for end in self._ends]
            painter.setPen(QPen(QColor(LINE_COLOUR), 2))
            painter.drawLine(*places)
            for place, end in zip(places, self._ends, strict=True):
                radius = sheet.targets_mm[end, 2] * unit / 2 + 4
                painter.drawEllipse(place, radius, radius)
        painter.end()


class BoardStep(QWidget):
    """A board from numbers or from a CSV file, with its picture; one that may be left out has a check box."""

    changed = Signal()

    def __init__(self, bench: Workbench, wanted: str = "", why: str = "") -> None:
        super().__init__()
        self._bench = bench
        self.wanted = QCheckBox(wanted or self.tr("This project has such a board"), self)
        self.wanted.setHidden(not wanted)
        self.wanted.setChecked(not wanted)
        self.wanted.toggled.connect(self._typed)
        self.by_numbers = QRadioButton(self.tr("Rows and columns"))
        self.by_file = QRadioButton(self.tr("CSV file"))
        self.by_file.toggled.connect(self._typed)
        self.rows = whole(self.tr("Rows"), 2, 100, self._typed)
        self.columns = whole(self.tr("Columns"), 2, 100, self._typed)
        self.spacing = real(self.tr("Spacing"), 0.1, 1000.0, 3, self._typed, " mm")
        self.diameter = real(self.tr("Target diameter"), 0.05, 1000.0, 3, self._typed, " mm")
        self.polarity = make(QComboBox, accessibleName=self.tr("Targets"))
        self.polarity.addItems([self.tr("white on black"), self.tr("black on white")])
        self.polarity.activated.connect(self._typed)
        self.file = make(QLineEdit, accessibleName=self.tr("CSV file with the targets"))
        self.file.setPlaceholderText("row,col,x_mm,y_mm,z_mm,diameter_mm")
        self.file.textChanged.connect(self._typed)
        self.choose_button = button(self.tr("Choose…"), self._choose, "open")
        self.choose_button.setAccessibleName(self.tr("Choose the CSV file"))
        self.print_button = button(self.tr("Print this board…"), self._print, "print")
        self.picture = SheetView()
        self.words = label("", "muted", wrap=True)
        self.board = BoardView(None, None)
        self._plan: BoardPlan | None = None
        self._rig: RigView | None = None
        self._lay_out(why)

    def _lay_out(self, why: str) -> None:
        self._numbers = boxed(
            form(
                (self.tr("Rows"), self.rows),
                (self.tr("Columns"), self.columns),
                (self.tr("Spacing"), self.spacing),
                (self.tr("Target diameter"), self.diameter),
                (self.tr("Targets"), self.polarity),
            )
        )
        self._file_row = boxed(row(self.file, self.choose_button, spacing=8))
        by, under = row(self.by_numbers, self.by_file), row(self.print_button, None)
        self._form = boxed(column(by, self._numbers, self._file_row, under, spacing=10))
        head = [self.wanted, label(why, "muted", wrap=True)] if why else []
        left = boxed(column(*head, self._form, None, spacing=10))
        left.setFixedWidth(FORM_WIDTH)
        frame = card((self.picture, 1), self.words)
        self.setLayout(column(row(left, frame, spacing=16), margins=(0, 4, 0, 0)))

    def show_plan(self, plan: BoardPlan, wanted: bool = True) -> None:
        fields = (self.wanted, self.by_file, self.by_numbers, self.rows, self.columns, self.spacing, self.diameter)
        blockers = [QSignalBlocker(field) for field in (*fields, self.file)]
        self.wanted.setChecked(wanted)
        (self.by_file if plan.from_file else self.by_numbers).setChecked(True)
        self.rows.setValue(plan.rows)
        self.columns.setValue(plan.columns)
        self.spacing.setValue(plan.spacing_mm)
        self.diameter.setValue(plan.diameter_mm)
        self.polarity.setCurrentIndex(POLARITIES.index(plan.polarity) if plan.polarity in POLARITIES else 0)
        self.file.setText(plan.file)
        del blockers
        self._typed()

    def plan(self) -> BoardPlan:
        return BoardPlan(
            self.rows.value(),
            self.columns.value(),
            self.spacing.value(),
            self.diameter.value(),
            POLARITIES[self.polarity.currentIndex()],
            self.by_file.isChecked(),
            self.file.text(),
        )

    @property
    def testfield(self) -> Testfield | None:
        """The board's targets; None where it is left out or not right yet."""
        return self.board.testfield if self.wanted.isChecked() else None

    def problem(self) -> str:
        return self.board.problem if self.wanted.isChecked() else ""

    def show_rig(self, rig: RigView | None) -> None:
        self._rig = rig
        self._say()

    def look_again(self) -> None:
        """Read the CSV file anew: it may have been mended."""
        if self.by_file.isChecked():
            self._plan = None
            self._typed()

    def _typed(self) -> None:
        plan = self.plan()
        if plan != self._plan:
            self._plan, self.board = plan, look_at_board(plan)
        wanted = self.wanted.isChecked()
        self._form.setEnabled(wanted)
        self._numbers.setVisible(not plan.from_file)
        self._file_row.setVisible(plan.from_file)
        self.print_button.setEnabled(self.board.sheet is not None)
        instead = self.board.problem if wanted else self.tr("No such board in this project.")
        self.picture.show_sheet(self.board.sheet if wanted else None, instead=instead)
        self._say()
        self.changed.emit()

    def _say(self) -> None:
        words: list[str] = []
        if self.testfield is not None and self._rig is not None:
            words = board_words(self.testfield, self._rig.camera, self._rig.projector)
        self.words.setText(" ".join(words))

    def _choose(self) -> None:
        title, kinds = self.tr("Choose the targets of the board"), self.tr("Targets (*.csv);;All files (*)")
        chosen = self._bench.dialogs.open_file(self, title, kinds, Path(self.file.text() or Path.home()))
        if chosen is not None:
            self.file.setText(str(chosen))

    def _print(self) -> None:
        if self.board.testfield is not None:
            print_board(self._bench, self.board.testfield, Path.home() / "testfield.pdf")


class ScaleStep(QWidget):
    """A measured distance between two targets, compared with the nominal one."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.wanted = QCheckBox(self.tr("A distance on the board was measured"))
        self.wanted.toggled.connect(self._typed)
        self.ends = [whole(name, 0, 9999, self._typed) for name in self._names()]
        self.length = real(self.tr("Measured length"), 0.0, 100_000.0, 4, self._typed, " mm")
        self.length.setSpecialValueText(self.tr("not typed yet"))
        self.sigma = real(self.tr("Standard deviation"), 0.0, 1000.0, 4, self._typed, " mm")
        self.comparison, self._doubt = label("", wrap=True), label("", wrap=True)
        self._warning = QFrame()
        self._warning.setProperty("notice", "warning")
        self._warning.setLayout(column(self._doubt, margins=(12, 10, 12, 10)))
        self._warning.hide()
        self.picture = SheetView()
        self._board = BoardView(None, None)
        places = [boxed(row(a, b, spacing=8)) for a, b in (self.ends[:2], self.ends[2:])]
        self._form = boxed(
            form(
                (self.tr("From row, column"), places[0]),
                (self.tr("to row, column"), places[1]),
                (self.tr("Measured length"), self.length),
                (self.tr("Standard deviation"), self.sigma),
            )
        )
        why = self.tr(
            "One distance between two targets, measured with a calliper or a scale bar, gives the calibration its "
            "scale. Without it the nominal coordinates do, and a print is seldom true to a thousandth."
        )
        about = label(why, "muted", wrap=True)
        left = boxed(column(self.wanted, about, self._form, self.comparison, self._warning, None, spacing=10))
        left.setFixedWidth(FORM_WIDTH)
        self.setLayout(column(row(left, card((self.picture, 1)), spacing=16), margins=(0, 4, 0, 0)))

    def _names(self) -> list[str]:
        return [self.tr("From row"), self.tr("From column"), self.tr("To row"), self.tr("To column")]

    def show_scale(self, scale: ScaleBar, wanted: bool) -> None:
        fields = (self.wanted, *self.ends, self.length, self.sigma)
        blockers = [QSignalBlocker(field) for field in fields]
        self.wanted.setChecked(wanted)
        for field, value in zip(self.ends, (*scale.start, *scale.stop), strict=True):
            field.setValue(value)
        self.length.setValue(scale.length_mm)
        self.sigma.setValue(scale.sigma_mm)
        del blockers
        self._typed()

    def scale(self) -> ScaleBar:
        a, b, c, d = (field.value() for field in self.ends)
        return ScaleBar((a, b), (c, d), self.length.value(), self.sigma.value())

    def show_board(self, board: BoardView) -> None:
        """Measure on another board: its outermost corners until targets are chosen that it has."""
        changed, self._board = board is not self._board, board
        field = board.testfield
        if changed and field is not None and scale_problem(field, replace(self.scale(), length_mm=1.0, sigma_mm=1.0)):
            first, last = (min(field.index()), max(field.index()))
            self.show_scale(replace(self.scale(), start=first, stop=last), self.wanted.isChecked())
        self._typed()

    def problem(self) -> str:
        if not self.wanted.isChecked() or self._board.testfield is None:
            return ""
        return scale_problem(self._board.testfield, self.scale())

    def _typed(self) -> None:
        self._form.setEnabled(self.wanted.isChecked())
        field, scale, ends = self._board.testfield, self.scale(), None
        words = doubt = ""
        if field is not None and self.wanted.isChecked():
            words, doubt = scale_words(field, scale)
            index = field.index()
            if scale.start in index and scale.stop in index:
                ends = index[scale.start], index[scale.stop]
        self.comparison.setText(words)
        self._doubt.setText(doubt)
        self._warning.setVisible(bool(doubt))
        self.picture.show_sheet(self._board.sheet, ends, self._board.problem)
        self.changed.emit()


class SummaryStep(QWidget):
    """All answers at a glance, before anything is written."""

    def __init__(self) -> None:
        super().__init__()
        grid = QGridLayout()
        grid.setHorizontalSpacing(24)
        grid.setVerticalSpacing(10)
        grid.setColumnStretch(1, 1)
        titles = {
            "name": self.tr("Name"),
            "folder": self.tr("Folder"),
            "rig": self.tr("Rig"),
            "field": self.tr("Testfield"),
            "plate": self.tr("Depth plate"),
            "scale": self.tr("Scale"),
            "sequence": self.tr("Sequence"),
            "files": self.tr("Will be written"),
        }
        self.rows = {name: label("", wrap=True) for name in titles}
        for i, (name, title) in enumerate(titles.items()):
            grid.addWidget(label(title, "muted"), i, 0)
            grid.addWidget(self.rows[name], i, 1)
        self.setLayout(column(card(grid), None, margins=(0, 4, 0, 0)))

    def show_draft(self, draft: Draft, field: BoardView, plate: BoardView) -> None:
        none = self.tr("none")
        bar = draft.scale
        text = self.tr("{length:.4f} mm ± {sigma:.4f} mm from row {a}, column {b} to row {c}, column {d}")
        scale = text.format(
            length=bar.length_mm, sigma=bar.sigma_mm, a=bar.start[0], b=bar.start[1], c=bar.stop[0], d=bar.stop[1]
        )
        files = ["project.json", FIELD_FILE, *([PLATE_FILE] if draft.with_plate else [])]
        values = {
            "name": draft.name.strip(),
            "folder": draft.folder.strip(),
            "rig": rig_text(draft.rig),
            "field": board_text(draft.board, field),
            "plate": board_text(draft.plate, plate) if draft.with_plate else none,
            "scale": scale if draft.with_scale else self.tr("from the nominal coordinates of the testfield"),
            "sequence": sentence(sequence_text(sequence_of(draft))),
            "files": ", ".join(files),
        }
        for key, value in values.items():
            self.rows[key].setText(value)
