"""What is to be recorded: role, name, and what belongs to it."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QFormLayout, QLineEdit, QListWidget, QVBoxLayout, QWidget

from core.capture.plan import make_plan
from core.errors import StripeError
from core.model import Project, Subject
from stripe_gui.presenters.capturing import Unfinished, boards, next_name, role_choices, taken_names, unfinished
from stripe_gui.presenters.told import sentence
from stripe_gui.widgets.layout import card, column, label, make
from stripe_gui.widgets.studies import NextPose
from stripe_gui.workbench import Workbench


class SubjectForm(QWidget):
    """Role and name of a new capture, and what belongs to its role."""

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._project: Project | None = None
        self.taken: list[str] = []
        self._proposed = ""
        self.role, self.name, self.board = QComboBox(), QLineEdit(), QComboBox()
        self.z = _number(-10_000, 10_000, " mm", self.tr("Position of the plate"))
        self.angle = _number(-90, 90, "°", self.tr("Angle of the plane-table"))
        self.explanation = label("", "muted", wrap=True)
        self.form = QFormLayout()
        self.form.setLabelAlignment(Qt.AlignmentFlag.AlignLeft)
        self.form.setHorizontalSpacing(16)
        self.form.setVerticalSpacing(10)
        for text, widget in (
            (self.tr("What is it for?"), self.role),
            (self.tr("Position"), self.z),
            (self.tr("Angle"), self.angle),
            (self.tr("Board"), self.board),
            (self.tr("Name"), self.name),
        ):
            self.form.addRow(text, widget)
            widget.setAccessibleName(widget.accessibleName() or text)
        for role, title, _ in role_choices():
            self.role.addItem(title, role)
        self.setLayout(column(card(self.form, self.explanation, None, title=self.tr("New capture"))))
        self.role.currentIndexChanged.connect(self._role_chosen)
        for spin in (self.z, self.angle):
            spin.valueChanged.connect(self._propose)
        self.name.textChanged.connect(lambda _: self.changed.emit())
        self.board.currentIndexChanged.connect(lambda _: self.changed.emit())

    @property
    def subject(self) -> Subject:
        role = self.role.currentData()
        return Subject(
            role,
            self.name.text().strip(),
            self.z.value() if role == "depth" else None,
            self.angle.value() if role == "plane" else None,
            (self.board.currentText() or None) if role in ("testfield", "depth") else None,
        )

    def missing(self) -> str:
        if self._project is None:
            return self.tr("Open a project.")
        if self.subject.name in self.taken:
            return self.tr("There is a capture of this name already: choose another.")
        return self.wrong

    @property
    def wrong(self) -> str:
        """What the core says against such a capture."""
        try:
            assert self._project is not None
            make_plan(self._project, self.subject)
        except StripeError as error:
            return f"{sentence(error.seen)}: {error.remedy}."
        return ""

    def offer(self, project: Project) -> None:
        """Offer what suits a project: free names and boards."""
        self._project, self.taken = project, taken_names(project)
        board = self.board.currentText()
        with QSignalBlocker(self.board):
            self.board.clear()
            self.board.addItems(boards(project))
            self.board.setCurrentText(board)
        self._role_chosen()

    def another(self) -> None:
        """Propose the next name for one more like this."""
        if self._project is not None:
            self.taken = taken_names(self._project)
            self.name.setText(next_name(self.subject, self.taken))
            self._proposed = self.name.text()

    def show_subject(self, subject: Subject) -> None:
        self.role.setCurrentIndex(self.role.findData(subject.role))
        self.z.setValue(subject.z_mm or 0.0)
        self.angle.setValue(subject.angle_deg or 0.0)
        self.board.setCurrentText(subject.testfield or "")
        self.name.setText(subject.name)
        self.changed.emit()

    def _role_chosen(self) -> None:
        role = self.role.currentData()
        self.explanation.setText(next(text for word, _, text in role_choices() if word == role))
        for widget, roles in ((self.z, "depth"), (self.angle, "plane"), (self.board, "testfield depth")):
            self.form.setRowVisible(widget, role in roles.split())
        if role in ("testfield", "depth"):
            wanted = "plate.csv" if role == "depth" else "testfield.csv"
            self.board.setCurrentIndex(max(0, self.board.findText(wanted)))
        self._propose()

    def _propose(self) -> None:
        """Propose a name, unless the operator has typed one."""
        if self.name.text() in ("", self._proposed):
            self._proposed = next_name(self.subject, self.taken)
            self.name.setText(self._proposed)
        self.changed.emit()


class SubjectStep(SubjectForm):
    """The same, with the best poses for more testfields, or an interrupted capture to go on with."""

    def __init__(self, bench: Workbench) -> None:
        super().__init__()
        self.pose = NextPose(bench)
        self._unfinished: tuple[Unfinished, ...] = ()
        name = self.tr("Interrupted captures")
        self.interrupted = make(QListWidget, accessibleName=name, wordWrap=True, maximumHeight=130)
        self.interrupted.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.interrupted_card = card(self.interrupted, title=self.tr("Go on with an interrupted capture"))
        layout = self.layout()
        assert isinstance(layout, QVBoxLayout)
        layout.addWidget(self.pose)
        layout.addWidget(self.interrupted_card)
        layout.addStretch(1)
        self.interrupted.itemActivated.connect(self._go_on)
        self.interrupted.itemClicked.connect(self._go_on)

    def missing(self) -> str:
        subject = self.subject
        if self._project is not None and subject == self._going_on():
            return self.wrong
        if any(u.subject.name == subject.name for u in self._unfinished):
            return self.tr("A capture of this name was interrupted: choose it in the list, or another name.")
        return super().missing()

    def offer(self, project: Project) -> None:
        """Offer what suits a project: free names, boards, interrupted captures."""
        self._unfinished = unfinished(project)
        with QSignalBlocker(self.interrupted):
            self.interrupted.clear()
            self.interrupted.addItems([f"{item.subject.name}\n{item.state}" for item in self._unfinished])
        self.interrupted_card.setVisible(bool(self._unfinished))
        super().offer(project)

    def offer_pose(self) -> None:
        """Offer to look for the best poses of a testfield where there is a calibration."""
        self.pose.refresh()
        self.pose.setVisible(self.pose.possible and self.subject.role == "testfield")

    @property
    def pose_words(self) -> str:
        """How to hold the board, if that was looked for."""
        return self.pose.words if self.subject.role == "testfield" else ""

    def pose_taken(self) -> None:
        """Go on to the next pose once that of a testfield was captured."""
        if self.subject.role == "testfield":
            self.pose.go_on()

    def _role_chosen(self) -> None:
        super()._role_chosen()
        self.offer_pose()

    def _going_on(self) -> Subject | None:
        at = self.interrupted.currentRow()
        return self._unfinished[at].subject if 0 <= at < len(self._unfinished) else None

    def _go_on(self) -> None:
        if subject := self._going_on():
            self.show_subject(subject)


def _number(least: float, most: float, unit: str, name: str) -> QDoubleSpinBox:
    size = {"minimum": least, "maximum": most, "decimals": 3, "maximumWidth": 180}
    return make(QDoubleSpinBox, suffix=unit, accessibleName=name, **size)
