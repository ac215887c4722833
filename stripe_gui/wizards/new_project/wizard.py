"""A new project in seven steps: place, rig, testfield, depth plate, scale, sequence, summary; the last writes it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from stripe_gui.presenters.new_project import Draft, create, draft_from_text, draft_text, new_draft, sequence_of
from stripe_gui.presenters.sequences import Shown
from stripe_gui.widgets.layout import boxed, column, scrolled
from stripe_gui.widgets.sequence_form import SequenceForm
from stripe_gui.wizards.new_project.boards import BoardStep, ScaleStep, SummaryStep
from stripe_gui.wizards.new_project.steps import PlaceStep, RigStep
from stripe_gui.wizards.wizard import Wizard
from stripe_gui.workbench import Workbench

KEPT = "new-project"  # where the settings keep the answers until the project is written


class NewProjectWizard(Wizard):
    """Asks for all that a project needs before its first capture."""

    id = "new-project"
    needs_project = False

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench,
            self.tr("New project"),
            self.tr("What the project is called, what rig and boards it is about. All can be typed; little has to be."),
            last=self.tr("Create project"),
        )
        self.place, self.rig = PlaceStep(bench), RigStep()
        self.field = BoardStep(bench)
        self.plate = BoardStep(
            bench,
            self.tr("This project has a depth plate"),
            self.tr("A flat plate with a few targets, moved along an axis: for the polynomial depth calibration only."),
        )
        self.scale, self.summary = ScaleStep(), SummaryStep()
        self.sequence = SequenceForm(bench, self.tr("The projector's own, chosen when it answers"))
        self._showing = False
        self.add_step("place", self.tr("Name and place"), self.place, missing=self.place.problem)
        self.add_step("rig", self.tr("Rig"), self.rig, missing=self.rig.problem)
        self.add_step(
            "testfield", self.tr("Testfield"), self.field, enter=self.field.look_again, missing=self.field.problem
        )
        self.add_step(
            "plate", self.tr("Depth plate"), self.plate, enter=self.plate.look_again, missing=self.plate.problem
        )
        self.add_step("scale", self.tr("Scale"), self.scale, missing=self.scale.problem)
        sequence = scrolled(boxed(column(self.sequence, None)), across=False)
        self.add_step(
            "sequence", self.tr("Sequence"), sequence, enter=self.sequence.look, missing=self.sequence.missing
        )
        self.add_step("summary", self.tr("Summary"), self.summary, enter=self._show_summary)
        self.show_draft(draft_from_text(bench.settings.text(KEPT)) or self._fresh())
        for step in (self.place, self.rig, self.field, self.plate, self.scale, self.sequence):
            step.changed.connect(self._answered)
        self.start()

    # ------------------------------------------------------------------------------------------------------ the answers

    def draft(self) -> Draft:
        return Draft(
            self.place.name.text(),
            self.place.folder.text(),
            self.rig.rig(),
            self.field.plan(),
            self.plate.wanted.isChecked(),
            self.plate.plan(),
            self.scale.wanted.isChecked(),
            self.scale.scale(),
            spec.data if (spec := self.sequence.spec) else None,
        )

    def show_draft(self, draft: Draft) -> None:
        self._showing = True
        self.place.show_place(draft.name, draft.folder)
        self.rig.show_rig(draft.rig)
        self.field.show_plan(draft.board)
        self.plate.show_plan(draft.plate, draft.with_plate)
        self.scale.show_scale(draft.scale, draft.with_scale)
        self.sequence.show_spec(sequence_of(draft))
        self._showing = False
        self._pass_on()

    def _answered(self) -> None:
        """Tell the later steps of a new answer, and keep it."""
        if self._showing:
            return
        self._showing = True
        self._pass_on()
        self._showing = False
        self.bench.settings.set(KEPT, draft_text(self.draft()))

    def _pass_on(self) -> None:
        for board in (self.field, self.plate):
            board.show_rig(self.rig.view)
        self.scale.show_board(self.field.board)
        projector = self.rig.rig().projector
        self.sequence.show_projector(Shown((projector.width, projector.height)))
        self.update_steps()

    def _fresh(self) -> Draft:
        recent = self.bench.settings.recent()
        return new_draft(recent[0].parent if recent else Path.home())

    def _show_summary(self) -> None:
        self.summary.show_draft(self.draft(), self.field.board, self.plate.board)

    # ----------------------------------------------------------------------------------------------------- page, wizard

    def refresh(self) -> None:
        self.update_steps()

    def parts(self) -> Iterator[str]:
        kept, stored = self.draft(), self.bench.settings.text(KEPT)
        self.plate.wanted.setChecked(True)
        self.scale.wanted.setChecked(True)
        self.scale.length.setValue(258.6)
        yield from super().parts()
        self.show_draft(kept)
        self.bench.settings.set(KEPT, stored)
        self.start()

    def finish(self) -> None:
        if self.bench.jobs.busy:
            text = self.tr("Work is running in the open project.")
            self.bench.notify("warning", text, self.tr("wait until it is done, or cancel it"))
            return
        folder = self.bench.guarded(create, self.draft(), self.field.testfield, self.plate.testfield)
        if folder is None:
            self.update_steps()
            return
        self.bench.settings.set(KEPT, "")
        if self.bench.open_project(folder):
            text = self.tr("The project is ready for its first captures: {folder}.").format(folder=folder)
            self.bench.notify("success", text, self.tr("Project > Print testfield gives the board at true size."))
        self.show_draft(self._fresh())
        self.start()
