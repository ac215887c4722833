"""The measure page: image by image, four targets each, by mouse or keys; measuring goes on behind it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence, QShortcut

from core.model import Capture, DeviceSpec, TargetSet
from core.pipeline import measure_project
from stripe_gui.pages.measure.background import Background, Kept, boards, snapped
from stripe_gui.pages.measure.image import ImageKeys, ImagePanel
from stripe_gui.pages.measure.model import Picking, Target
from stripe_gui.pages.measure.side import SidePanel
from stripe_gui.pages.measure.view import NextStep, PickingView, next_step, picking_view, question
from stripe_gui.pages.page import Page
from stripe_gui.presenters.capture import FrameView, lit_frame
from stripe_gui.widgets.layout import splitter, tab_name
from stripe_gui.workbench import Workbench

Modifier = Qt.KeyboardModifier


class MeasurePage(Page):
    """The image in the middle; to the right the map of the field, the loupe, and the images and targets as lists."""

    id, stage, undoes = "measure", "measure", True
    by_pair = True

    def __init__(self, bench: Workbench) -> None:
        super().__init__(
            bench, self.tr("Measure"), self.tr("Targets that cannot be recognised follow from four picks in the image.")
        )
        self.model: Picking | None = None
        self.background: Background | None = None
        self.kept = Kept()
        self._shown: PickingView | None = None
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        self.undo_button = self.add_button("", self.undo, "undo")  # no words: the next step's name needs the room
        self.undo_button.setAccessibleName(self.tr("Undo"))
        self.undo_button.setToolTip(self.tr("Take the last change back, in whichever image it was made (Ctrl+Z)"))
        self.redo_button = self.add_button("", self.redo, "redo")
        self.redo_button.setAccessibleName(self.tr("Redo"))
        self.redo_button.setToolTip(self.tr("Make it again (Ctrl+Shift+Z)"))
        self.run_button = self.add_button(self.tr("Measure all"), self.run, "run")
        self.run_button.setToolTip(self.tr("Measure the targets of all captures that have picks (F5)."))
        self.primary = self.add_button(self.tr("Accept and measure"), self.advance, "next", primary=True)
        self.image, self.side = ImagePanel(self.exclude), SidePanel()
        self.view, self.marks = self.image.view, self.image.marks
        # the lists may be drawn wider to see all columns
        self.body.addWidget(splitter(self.image, self.side, widest=0), 1)
        self.setFocusProxy(self.view.canvas)

    def _connect(self) -> None:
        keys = ImageKeys(
            self.view.canvas,
            {
                Qt.Key.Key_Space: self.pick,
                Qt.Key.Key_Return: self.advance,
                Qt.Key.Key_Enter: self.advance,
                Qt.Key.Key_Backspace: self.remove,
                Qt.Key.Key_Delete: self.remove,
                Qt.Key.Key_Tab: lambda: self.cycle(1),
                Qt.Key.Key_Backtab: lambda: self.cycle(-1),
                Qt.Key.Key_X: self.exclude,
                Qt.Key.Key_R: self.turn_guess,
                **{Qt.Key(Qt.Key.Key_1 + i): partial(self.choose_number, i) for i in range(9)},
            },
        )
        keys.nudged.connect(self.nudge)
        keys.jumped.connect(self._jump)
        keys.unsnapped.connect(lambda: self.pick(snap=False))
        self.view.clicked.connect(self._clicked)
        self.image.looked_at.connect(self._look_through)
        self.side.image_chosen.connect(self.go_to)
        self.side.target_chosen.connect(lambda r, c: self.choose((r, c)))
        self.side.excluded.connect(self.exclude)
        self.side.left.connect(self.view.canvas.setFocus)
        self.session.project_changed.connect(self._forget)
        for shortcut, slot in (
            ("PgDown", lambda: self.turn_over(1)),
            ("PgUp", lambda: self.turn_over(-1)),
            ("F6", lambda: self.side.next_pane(self.view.canvas)),
            ("Escape", self.view.canvas.setFocus),
        ):
            here = Qt.ShortcutContext.WidgetWithChildrenShortcut
            QShortcut(QKeySequence(shortcut), self, context=here).activated.connect(slot)

    # --------------------------------------------------------------------------------------------------------- showing

    def refresh(self) -> None:
        """Show the project as it is now; picks that others changed are taken over."""
        self.run_button.setEnabled(self.can_run())
        folder = self.session.folder
        captures = boards(folder.captures()) if folder else []
        target = self.session.take_target()  # another page may ask to look at one
        pair = self.session.pair if folder else ("", "")
        if self.model is None or not self.model.is_about(captures, pair):
            self._forget()
            self.model = self.bench.guarded(Picking, captures, pair) if captures else None
            if self.model is not None:
                self._begin(self.model)
        else:
            self.bench.guarded(self.model.reload)
            self.model.show(self.session.capture_name)  # it may have been chosen on another page
        if self.background is not None:
            self.background.take_measured()
        if target is not None and self.model is not None:
            self.model.show(self.session.capture_name)
        self._show_image()
        if target is not None:
            self.choose(target)

    def _begin(self, model: Picking) -> None:
        """Start at the image the operator looks at, or at the first one that is not picked."""
        folder = self.session.folder
        assert folder is not None
        self.background = Background(self.bench, model, folder.project, self.kept, self)
        self.background.measured.connect(self._measured)
        self.background.looked.connect(self._looked)
        model.show(self.session.capture_name)
        if model.complete and (due := model.next_due()) is not None:
            model.go_to(due)

    def _forget(self) -> None:
        """Let go of a project that is no longer open or has other captures now."""
        if self.background is not None:
            self.background.stop()
            self.background.deleteLater()
        self.model, self.background = None, None

    def _show_image(self) -> None:
        """Show the image at work: at once where it is here, else when it has been read."""
        model = self.model
        if model is None or self.background is None:
            self._show_nothing()
            return
        capture = model.captures[model.image]
        self.session.choose_capture(capture.name)
        frame = self.kept.frames.get(capture)
        if frame is not None:
            self._show_frame(capture, frame)
        else:
            self.bench.views.run(capture.name, lit_frame, capture, on_done=partial(self._show_frame, capture))
        self._show_marks(move=True)
        self.background.prepare()

    def _show_frame(self, capture: Capture, frame: FrameView) -> None:
        self.kept.frames.put(capture, frame)
        if self.model is not None and self.model.captures[self.model.image] == capture:
            self.image.show_frame(frame)

    def _show_nothing(self) -> None:
        self._shown = None
        self.image.show_frame(None)
        self.image.show_excluded(False, False)
        self.image.name.setText(self.tr("no board"))
        self.image.ask.setText(self.tr("Capture a testfield first; its board must be named in capture.json."))
        self.image.legend.setText(" ")
        self.side.clear()
        for made in (self.undo_button, self.redo_button, self.primary):
            made.setEnabled(False)

    def _show_marks(self, *, move: bool) -> None:
        """Show everything but the image anew; `move` takes the cross hairs to the target at work."""
        if self.model is None or self.background is None or self.session.folder is None:
            return
        self._shown = picking_view(self.model, self._camera(self.model))
        self.marks.show(self._shown.marks)
        self.image.name.setText(self.model.capture.name)
        self.image.legend.setText(self._shown.legend or " ")
        self.side.show_image(self.model, self._shown, self.background.at_work)
        self._show_target(move=move)

    def _show_target(self, *, move: bool) -> None:
        """Show which target is at work, and what comes next."""
        model, view = self.model, self._shown
        if model is None or view is None or self.background is None:
            return
        if move:
            known = None if model.target in model.picked else view.places.get(model.target)
            self._set_cursor(*(known or model.likely() or self.image.middle))
        self.side.show_target(model, view)
        self.image.show_excluded(model.target in model.picks.excluded, bool(view.targets))
        self.marks.show_chosen(view.places.get(model.target) if len(view.marks.measured) else None)
        step = next_step(model, view, self.background.at_work)
        ask, does = question(model, view, step)
        self.image.ask.setText(ask)
        key = self.tr("Space") if step is NextStep.PICK else self.tr("Enter")
        self.primary.setText(f" {does} ({key})")
        self.primary.setAccessibleName(does)
        self.primary.setEnabled(not (step is NextStep.ACCEPT and view.problem))
        self.undo_button.setEnabled(model.can_undo)
        self.redo_button.setEnabled(model.can_redo)

    # ------------------------------------------------------------------------------------------------- the cross hairs

    def _set_cursor(self, u: float, v: float, *, follow: bool = False) -> None:
        if self.model is not None:
            self.image.set_cursor(u, v, self._camera(self.model), follow=follow)

    def _camera(self, model: Picking) -> DeviceSpec:
        return self.session.opened.project.rig.cameras[model.captures[model.image].camera]

    def _look_through(self, u: float, v: float) -> None:
        picks = self._shown.marks.picks if self._shown else np.zeros((0, 2))
        frame = self.image.frame
        image, bright = (frame.image, frame.bright) if frame is not None else (None, 1.0)
        self.side.loupe.show_at(image, bright, u, v, tuple((float(a), float(b)) for a, b in picks))

    def nudge(self, du: float, dv: float) -> None:
        """Move the cross hairs by so many px, and with them the pick of the target at work."""
        u, v = self.image.cursor_at
        self._set_cursor(round(u + du, 3), round(v + dv, 3), follow=True)
        if self.model is not None and self.model.target in self.model.picked:
            self._change(lambda model: model.pick(*self.image.cursor_at), move=False)

    def _jump(self, du: int, dv: int) -> None:
        """Move the cross hairs to the next dot in a direction; a tenth of the view further where there is none."""
        found = self.model.next_dot(*self.image.cursor_at, (du, dv)) if self.model is not None else None
        self._set_cursor(*(found or self.image.ahead(du, dv)), follow=True)

    # ------------------------------------------------------------------------------------------------------- the picks

    def pick(self, *, snap: bool = True) -> None:
        """Put the target at work where the cross hairs are, onto the dot's centre, and ask for the next one."""
        frame, at = self.image.frame, self.image.cursor_at
        if self.model is None or frame is None:
            return
        found = snapped(frame.image, self.model.field, at, self.image.reach_px) if snap else at
        if found is None:
            self.image.ask.setText(self.tr("There is no dot under the cross hairs; Shift+Space picks all the same."))
            return
        self._change(lambda model: model.pick(*found), onward=True)

    def _change(self, change: Callable[[Picking], object], *, move: bool = True, onward: bool = False) -> None:
        """Change the picks and show it; what cannot be saved is told and not shown."""
        model, background = self.model, self.background
        if model is None or background is None:
            return
        image = model.image
        self.bench.guarded(change, model)
        if onward and (following := model.next_target()) is not None:
            model.target = following
        if model.image != image:
            self._show_image()
        else:
            self._show_marks(move=move)
        if model.due(model.image):
            self._measure()

    def remove(self) -> None:
        """Take the pick of the target at work away."""
        self._change(Picking.remove)

    def exclude(self) -> None:
        """Exclude the target at work from this image, or restore it."""
        self._change(lambda model: model.exclude(model.target), move=False)

    def undo(self) -> None:
        self._change(Picking.undo)

    def redo(self) -> None:
        self._change(Picking.redo)

    # ----------------------------------------------------------------------------------------------- choosing targets

    def choose(self, target: Target) -> None:
        if self.model is not None:
            self.model.choose(target)
            self._show_marks(move=True)

    def choose_number(self, index: int) -> None:
        if self.model is not None and index < len(self.model.wanted):
            self.choose(self.model.wanted[index])

    def cycle(self, step: int) -> None:
        """Choose the next of the targets asked for."""
        if self.model is not None:
            self.model.cycle(step)
            self._show_target(move=True)

    def turn_guess(self) -> None:
        if self.model is not None and not self.model.picks.seeds:
            self.model.turn_guess()
            self._show_marks(move=True)

    def _clicked(self, u: float, v: float, which: Qt.MouseButton, modifiers: Qt.KeyboardModifier) -> None:
        """Pick the dot that was clicked; once the picks are complete a click looks at a target, with Shift it picks."""
        if self.model is None or which != Qt.MouseButton.LeftButton:
            return
        if self.model.complete and not modifiers & Modifier.ShiftModifier and self._shown and self._shown.places:
            targets = list(self._shown.places)
            away = np.hypot(*(np.array([self._shown.places[t] for t in targets]) - (u, v)).T)
            self.choose(targets[int(np.argmin(away))])
            return
        self._set_cursor(u, v)
        self.pick()

    # ---------------------------------------------------------------------------------------------------------- images

    def go_to(self, image: int) -> None:
        """Work on another image; the zoom stays."""
        if self.model is not None and 0 <= image < len(self.model.captures) and image != self.model.image:
            self.model.go_to(image)
            self._show_image()

    def turn_over(self, step: int) -> None:
        """Go to the next or the last image."""
        if self.model is not None:
            self.go_to(self.model.next_image(step))

    def advance(self) -> None:
        """Do the next step: take the guess, accept and measure, or go on to the next image."""
        model = self.model
        if model is None or self._shown is None or self.background is None or not self.primary.isEnabled():
            return
        step = next_step(model, self._shown, self.background.at_work)
        if step is NextStep.PICK:
            self.pick()
        elif step is NextStep.DONE:
            self.bench.show_page("calibrate")
        elif step is NextStep.NEXT:
            self.go_to(model.next_due() or 0)
        else:
            if step is NextStep.GUESS and (guess := model.guess):
                self._change(lambda model: model.take(guess))
            if model.complete:
                self._measure()

    def run(self) -> None:
        self.bench.run_stage("measure", measure_project, on_done=self._told)

    def can_run(self) -> bool:
        folder = self.session.folder
        return folder is not None and bool(boards(folder.captures()))

    def _told(self, targets: tuple[TargetSet, ...]) -> None:
        count = sum(len(t.row) for t in targets)
        self.bench.notify("success", self.tr("{n} targets in {m} captures.").format(n=count, m=len(targets)))

    def _measure(self) -> None:
        if self.model is not None and self.background is not None:
            self.background.measure(self.model.image)
            self._show_marks(move=False)
            self.background.prepare()

    def _measured(self, image: int) -> None:
        """Show what came out; where targets were excluded meanwhile it is measured again."""
        if self.model is not None and self.background is not None:
            if self.model.due(image):
                self.background.measure(image)
            self.bench.refresh()
            if self.isVisible():
                self._show_marks(move=False)

    def _looked(self, image: int) -> None:
        """Show the guess of the image at work, unless the operator was quicker."""
        if self.model is not None and image == self.model.image and self.model.guess and not self.model.picks.seeds:
            self._show_marks(move=True)

    def parts(self) -> Iterator[str]:
        """Show the picks before they are accepted, then the targets measured, then the images."""
        model, tabs = self.model, self.side.tabs
        kept = model.measured(model.image) if model is not None else None
        if model is not None and kept is not None:
            model.keep_measurement(model.image, None)
            self._show_marks(move=True)
            yield "-grid"
            model.keep_measurement(model.image, kept)
            self._show_marks(move=True)
        for i in (1, 0):
            tabs.setCurrentIndex(i)
            yield f"-{tab_name(tabs, i)}"
