"""The capture wizard: its steps, and what they hand on to each other."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtGui import QHideEvent

from core.capture.plan import guards_for
from core.devices import offer_screens
from core.errors import StripeError
from core.pipeline.capture import virtual_rig
from core.project import choose_sequence
from stripe_gui.jobs import JobQueue
from stripe_gui.presenters.capturing import scene_for
from stripe_gui.presenters.folder import ProjectFolder
from stripe_gui.presenters.looking import Rig
from stripe_gui.screens import Screens
from stripe_gui.widgets.layout import boxed, column, label, scrolled
from stripe_gui.widgets.sequence_form import SequenceForm
from stripe_gui.wizards.capture.checks import ChecksStep
from stripe_gui.wizards.capture.devices import DevicesStep
from stripe_gui.wizards.capture.picture import PictureStep
from stripe_gui.wizards.capture.subject import SubjectStep
from stripe_gui.wizards.capture.taking import TakingStep
from stripe_gui.wizards.wizard import Wizard
from stripe_gui.workbench import Workbench

RIG = "capture.rig"  # the setting that keeps the devices used last: project, projector, camera


class CaptureWizard(Wizard):
    """From two devices to a stored, verified capture."""

    id = "capture-wizard"
    stage = "capture"

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("New capture"),
            self.tr("Connect projector and camera, look, and record one sequence of an unmoving scene."),
            last=self.tr("Done"),
        )
        offer_screens(Screens().open)  # any screen may serve as a projector
        self.rig = Rig()
        self._closing = JobQueue(self)  # of its own: what the next page looks at would take its place
        self.devices = DevicesStep(bench, self.rig)
        self.subject = SubjectStep(bench)
        self.sequence = SequenceForm(bench, self.tr("The projector's own"))
        self.planned = label("", "muted", wrap=True)
        self.picture = PictureStep(bench, self.devices)
        self.checks = ChecksStep(bench, self.devices)
        self.taking = TakingStep(bench, self.devices)
        devices, subject = scrolled(self.devices), scrolled(self.subject)
        sequence = scrolled(boxed(column(self.sequence, self.planned, None)), across=False)
        title = self.tr("Sequence")
        self.add_step("devices", self.tr("Devices"), devices, enter=self.devices.enter, missing=self.devices.missing)
        self.add_step("subject", self.tr("What"), subject, enter=self._enter_subject, missing=self.subject.missing)
        self.add_step("sequence", title, sequence, enter=self._enter_sequence, missing=self.sequence.missing)
        self.add_step("picture", self.tr("Live picture"), self.picture, enter=self._enter_picture)
        self.add_step("checks", self.tr("Check the rig"), self.checks)
        self.add_step("take", self.tr("Take"), self.taking, enter=self._enter_take, missing=self.taking.missing)
        for step in (self.devices, self.subject, self.picture, self.checks, self.taking):
            step.changed.connect(self.update_steps)
        self.subject.changed.connect(self._choose_scene)
        self.sequence.changed.connect(self._sequence_chosen)
        self.step_changed.connect(self._keep_sequence)
        self.taking.another_wanted.connect(self.another)
        self.taking.stored.connect(self.subject.pose_taken)

    def begin(self, folder: ProjectFolder) -> None:
        try:
            virtual = virtual_rig(folder.project)
        except StripeError:
            virtual = ""
        kept = self.bench.settings.text(RIG).split("\n")
        urls = (kept[1], kept[2]) if len(kept) == 3 and kept[0] == str(folder.path) else (virtual, virtual)
        self.subject.name.clear()
        self.subject.offer(folder.project)
        self.sequence.show_spec(folder.project.sequence)
        self.devices.offer(folder.project, virtual, urls)
        self.checks.clear()
        self._choose_scene()

    def another(self) -> None:
        """Go on to the next pose: the next free name, the picture first."""
        folder = self.session.folder
        if folder is None:
            return
        self.subject.offer(folder.project)
        self.subject.another()
        self._choose_scene()
        self.go_to("picture")

    def hideEvent(self, event: QHideEvent) -> None:  # noqa: N802
        """Let the devices go; work under way has opened them for itself."""
        super().hideEvent(event)
        self.bench.views.cancel_all()
        self._closing.run(self.tr("Devices"), self.rig.close)

    def _enter_subject(self) -> None:
        if self.devices.connection is not None:
            self.bench.settings.set(RIG, "\n".join((str(self._begun), *self.devices.urls)))
        self.subject.offer_pose()

    def _enter_sequence(self) -> None:
        if self.devices.connection is not None:
            self.sequence.show_projector(self.devices.connection.shown)
        if self.sequence.view is None:
            self.sequence.look()

    def _enter_picture(self) -> None:
        self.picture.tell_pose(self.subject.pose_words)
        self.picture.enter()

    def _enter_take(self) -> None:
        self.taking.prepare(self.subject.subject)

    def _sequence_chosen(self) -> None:
        """Plan with what was chosen, and say what more is shown."""
        view, connection = self.sequence.view, self.devices.connection
        patterns = view.patterns if view is not None else ()
        self.planned.setVisible(bool(patterns))
        if connection is not None and patterns:
            self.devices.connection = replace(connection, patterns=patterns)
            text = self.tr(
                "Before and after them {g} more are shown, to see whether anything moved and whether the lamp is "
                "steady. The choice is kept in the project."
            )
            self.planned.setText(text.format(g=len(guards_for(patterns, connection.lines))))
        self.update_steps()

    def _keep_sequence(self, step: str) -> None:
        """Keep the choice in the project once the operator goes on."""
        folder = self.session.folder
        if folder is None or step in ("devices", "subject", "sequence") or self.sequence.missing():
            return
        if self.sequence.spec != folder.project.sequence:
            self.bench.guarded(choose_sequence, folder.path, self.sequence.spec)
            self.devices.project = folder.project

    def _choose_scene(self) -> None:
        """Put before the virtual rig what suits the new capture."""
        names = [self.devices.scene.itemText(i) for i in range(self.devices.scene.count())]
        subject = self.subject.subject
        if scene := scene_for(subject.name, subject.role, names):
            self.devices.choose_scene(scene)
