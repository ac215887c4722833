"""Picking without its window: what is asked for next, undo over everything, and nothing shown that is not saved."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from core.errors import InputError
from core.model import Capture, DeviceSpec, Seed, TargetSet
from core.project import kept_picks, read_capture, read_project
from stripe_gui.pages.measure.model import Measurement, Picking, corner_targets
from stripe_gui.pages.measure.view import NextStep, next_step, picking_view, state_text
from tests.gui.hands import true_targets

CORNERS = ((0, 0), (0, 8), (6, 8), (6, 0))


@pytest.fixture
def captures(project: Path) -> list[Capture]:
    """The testfields of a project, without their picks."""
    made = read_project(project)
    found = [read_capture(folder, made) for folder in made.captures]
    found = [c for c in found if c.role == "testfield"][:4]
    for capture in found:
        (capture.path / "picks.json").unlink()
    return found


@pytest.fixture
def camera(project: Path) -> DeviceSpec:
    return read_project(project).camera


@pytest.fixture
def model(captures: list[Capture]) -> Picking:
    return Picking(captures)


def saved(model: Picking) -> bool:
    return all(kept_picks(c.path)[0] == model.picks_of(i).seeds for i, c in enumerate(model.captures))


def pick_corners(model: Picking) -> None:
    for u, v in ((64, 56), (220, 65), (215, 183), (57, 180)):
        model.pick(u, v)
        model.target = model.next_target() or model.target


def test_the_corners_of_the_field_are_asked_for_one_after_the_other(model: Picking) -> None:
    assert model.wanted == CORNERS == corner_targets(model.field)
    for target in CORNERS:
        assert model.target == target
        model.pick(10.0 * target[1] + 20, 10.0 * target[0] + 20)
        assert saved(model)
        model.target = model.next_target() or model.target
    assert model.complete
    assert model.next_target() is None


def test_any_other_target_may_be_chosen_and_the_next_image_asks_for_it_again(model: Picking) -> None:
    model.choose((2, 3))
    assert model.target == (2, 3)
    assert model.wanted == ((2, 3), *CORNERS[1:])
    pick_corners(model)
    model.go_to(1)
    assert model.wanted == ((2, 3), *CORNERS[1:])
    assert model.likely() == (64, 56)
    model.choose((99, 99))
    assert model.target == (2, 3)


def test_undo_and_redo_lead_through_every_state_of_every_image(model: Picking) -> None:
    rng = np.random.default_rng(4)
    states = [tuple(model.picks_of(i) for i in range(4))]
    while len(states) < 120:
        model.go_to(int(rng.integers(4)))
        what = rng.integers(5)
        if what == 0:
            model.remove()
        elif what == 1:
            model.exclude((int(rng.integers(7)), int(rng.integers(9))))
        else:
            model.cycle(int(rng.integers(1, 4)))
            model.pick(*rng.uniform(0, 200, 2))
        now = tuple(model.picks_of(i) for i in range(4))
        if now != states[-1]:
            states.append(now)
    for before in reversed(states[:-1]):
        assert model.undo()
        assert tuple(model.picks_of(i) for i in range(4)) == before
        assert saved(model)
    assert not model.undo()
    for after in states[1:]:
        assert model.redo()
        assert tuple(model.picks_of(i) for i in range(4)) == after
    assert not model.redo()
    assert saved(model)


def test_a_new_change_ends_redoing(model: Picking) -> None:
    pick_corners(model)
    model.undo()
    model.pick(1, 2)
    assert not model.can_redo


def test_reopened_everything_is_as_it_was(model: Picking, captures: list[Capture]) -> None:
    pick_corners(model)
    model.exclude((3, 3))
    model.go_to(1)
    model.pick(5, 6)
    again = Picking(captures)
    assert [again.picks_of(i) for i in range(4)] == [model.picks_of(i) for i in range(4)]
    assert again.picks_of(1).seeds == (Seed(0, 0, 5.0, 6.0),)


def test_what_cannot_be_saved_is_not_shown_as_picked(model: Picking, captures: list[Capture]) -> None:
    if os.geteuid() == 0:  # who may write everywhere is stopped by a folder in the file's place
        (captures[0].path / "picks-draft.json").mkdir()
    else:
        captures[0].path.chmod(0o500)
    with pytest.raises(InputError):
        model.pick(3, 4)
    assert model.picks.seeds == ()
    assert not model.can_undo


def test_guesses_come_in_turn_and_never_replace_picks(model: Picking) -> None:
    first, second = (tuple(Seed(r, c, 1.0 + c, 1.0 + r) for r, c in cells) for cells in (CORNERS, CORNERS[::-1]))
    model.suggest(0, [first, second])
    assert (model.guess, model.guesses) == (first, 2)
    model.turn_guess()
    assert model.guess == second
    model.turn_guess()
    model.take(first)
    assert model.complete
    assert saved(model)
    model.undo()
    assert model.picks.seeds == ()
    model.pick(50, 60)
    model.suggest(0, [second])
    assert model.wanted[0] == CORNERS[0]


def test_the_predicted_grid_lies_on_the_field_or_says_what_contradicts(model: Picking, camera: DeviceSpec) -> None:
    assert next_step(model, picking_view(model, camera), ()) is NextStep.PICK
    pick_corners(model)
    view = picking_view(model, camera)
    assert len(view.marks.grid) == 63
    assert next_step(model, view, ()) is NextStep.ACCEPT
    # the middle of the field is where the diagonals cross, whatever the view
    (a, b), (c, d) = ((64, 56), (215, 183)), ((220, 65), (57, 180))
    lines = np.cross([*a, 1.0], [*b, 1.0]), np.cross([*c, 1.0], [*d, 1.0])
    cross = np.cross(*lines)
    np.testing.assert_allclose(view.places[3, 4], cross[:2] / cross[2], atol=1.5)
    model.take([Seed(s.row, s.col, o.u, o.v) for s, o in zip(model.picks.seeds, model.picks.seeds[::-1], strict=True)])
    swapped = [*model.picks.seeds[1::-1], *model.picks.seeds[2:]]
    model.take([Seed(s.row, s.col, o.u, o.v) for s, o in zip(model.picks.seeds, swapped, strict=True)])
    assert "swapped" in picking_view(model, camera).problem


def test_a_measurement_counts_only_for_the_picks_it_was_made_from(model: Picking) -> None:
    pick_corners(model)
    model.keep_measurement(0, Measurement(model.picks, None, "no dots"))
    assert "no dots" in state_text(model, 0, ())[1]
    model.exclude((3, 3))
    assert model.measured(0) is None
    assert model.due(0)  # accepted already: measured again by itself
    model.exclude((3, 3))
    assert model.measured(0) is not None
    model.pick(1, 1)
    assert model.measured(0) is None
    assert not model.due(0)  # a moved pick asks to be accepted anew


def test_a_board_recognised_without_picks_is_shown_as_it_was_recognised(model: Picking, camera: DeviceSpec) -> None:
    true = true_targets(model.capture.path.parents[1], model.capture.name, "testfield.csv")
    row, col = np.array(list(true)).T
    uv, nothing = np.array(list(true.values())), np.zeros((len(true), 2))
    found = TargetSet(model.capture.name, row, col, uv, np.zeros((len(true), 2, 2)), *[nothing] * 3, nothing[:, 0])
    half_turned = [Seed(6 - r, 8 - c, *true[r, c]) for r, c in CORNERS]
    model.suggest(0, [tuple(half_turned)])
    assert next_step(model, picking_view(model, camera), ()) is NextStep.GUESS
    model.keep_measurement(0, Measurement(model.picks, found))
    view = picking_view(model, camera)
    assert next_step(model, view, ()) is NextStep.NEXT
    assert not len(view.marks.picks)
    assert np.abs(view.marks.residual).max() < 2.0  # px; a pose and one radial parameter for the bench's whole lens
    assert model.next_due() == 1
    pick_corners(model)  # what an operator says comes first
    assert model.recognised(0) is None


def test_picks_changed_elsewhere_are_taken_over(model: Picking, captures: list[Capture]) -> None:
    pick_corners(model)
    assert not model.reload()
    other = Picking(captures)
    other.exclude((1, 1))
    assert model.reload()
    assert model.picks.excluded == ((1, 1),)
    assert not model.can_undo
