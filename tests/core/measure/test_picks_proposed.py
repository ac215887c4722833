"""Picks guessed from the order of the dots: the truth is always among the guesses, alone where edges tell."""

from __future__ import annotations

import numpy as np
import pytest

from core.measure import dot_at, find_dots, predicted_view, propose_picks


def guesses(truth, known=(), seed=0):
    image = truth.quick_image(seed)
    order = find_dots(image, dark=truth.field.polarity == "black-on-white")
    return propose_picks(image, order, truth.field, truth.spec, known, "front")


def error_px(truth, seeds) -> float:
    """The largest distance of a guess's picks from where these targets really are."""
    at = [truth.field.index()[s.row, s.col] for s in seeds]
    return float(np.hypot(*(truth.true_uv[at] - [(s.u, s.v) for s in seeds]).T).max())


@pytest.mark.parametrize("polarity", ["white-on-black", "black-on-white"])
@pytest.mark.parametrize("roll_deg", [0, 37, 90, 200])
def test_a_whole_field_has_two_guesses_half_a_turn_apart(bench, roll_deg, polarity):
    field = bench.grid(7, 9, 24.0, 9.0, polarity=polarity)
    truth = bench.scene(bench.look(25, 40, roll_deg), field=field, noise=2.0)
    found = guesses(truth)
    assert len(found) == 2
    # a dot's grey centroid is off its circle's centre by distortion and eccentricity, 0.2 px here at most
    assert sorted(error_px(truth, seeds) < 0.5 for seeds in found) == [False, True]
    turned = {(6 - s.row, 8 - s.col, s.u, s.v) for s in found[0]}
    assert turned == {(s.row, s.col, s.u, s.v) for s in found[1]}


def test_a_speck_where_the_next_dot_of_a_row_would_be_is_no_target(bench):
    truth = bench.scene(bench.look(10, 40, 20), field=bench.grid(7, 9, 24.0, 9.0), noise=2.0)
    image, at = truth.quick_image(0), truth.true_uv.reshape(7, 9, 2)
    dot = np.rint(at[3, 8]).astype(int)
    beyond = np.rint(2 * at[3, 8] - at[3, 7]).astype(int)
    speck = image[dot[1] - 14 : dot[1] + 15, dot[0] - 14 : dot[0] + 15].copy()
    image[beyond[1] - 14 : beyond[1] + 15, beyond[0] - 14 : beyond[0] + 15] = speck
    order = find_dots(image, dark=truth.field.polarity == "black-on-white")
    assert len(order.uv) == 7 * 9 + 1
    found = propose_picks(image, order, truth.field, truth.spec, (), "front")
    assert sorted(error_px(truth, seeds) < 0.5 for seeds in found) == [False, True]


def test_the_guess_nearest_to_the_image_before_comes_first(bench):
    before = bench.scene(bench.look(10, 30, 180), field=bench.grid(7, 9, 24.0, 9.0), noise=1.0)
    after = before.but(pose=bench.look(18, 80, 215, 640, (20, -15)))
    known = before.seeds([(0, 0), (0, 8), (6, 8), (6, 0)])
    found = guesses(after, known)
    assert error_px(after, found[0]) < 0.5


def test_faint_dots_beside_the_light_tell_how_far_the_field_reaches(bench):
    # the light ends between the columns 6 and 7; beyond it there is a tenth of it
    truth = bench.scene(bench.look(12, 30, 4), field=bench.grid(7, 13, 20.0, 8.0), noise=1.5, ambient=0.1)
    column = truth.true_uv[truth.field.col == 6]
    found = guesses(truth.but(lit_from=float(column[:, 0].mean() + 20)))
    assert len(found) == 2
    assert sorted(error_px(truth, seeds) < 0.5 for seeds in found) == [False, True]
    assert min(s.col for seeds in found for s in seeds if error_px(truth, seeds) < 0.5) >= 6


def test_where_nothing_tells_the_image_before_decides(bench):
    # more field than image: no edge is seen, and every shift by whole rows and columns looks the same
    truth = bench.scene(bench.look(5, 20, 3, 330), field=bench.grid(13, 19, 24.0, 9.0), noise=1.0)
    cells = [(4, 7), (4, 11), (8, 11), (8, 7)]
    moved = truth.but(pose=bench.look(8, 40, 5, 335, (6, -5)))
    found = guesses(moved, truth.seeds(cells))
    assert len(found) > 2
    assert error_px(moved, found[0]) < 0.5


def test_no_dots_give_no_guess(bench):
    truth = bench.scene(bench.look(), field=bench.grid(7, 9), noise=2.0)
    noise = np.random.default_rng(0).normal(20, 2, (576, 748)).astype(np.float32)
    assert propose_picks(noise, find_dots(noise, dark=False), truth.field, truth.spec) == ()
    flat = np.full((576, 748), 20, np.uint8)
    assert len(find_dots(flat, dark=False).uv) == 0


def test_another_board_than_the_testfield_gives_no_guess(bench):
    truth = bench.scene(bench.look(10, 10), field=bench.grid(7, 9, 24.0, 9.0), noise=1.0)
    image = truth.quick_image()
    smaller = bench.grid(5, 5, 24.0, 9.0)
    assert propose_picks(image, find_dots(image, dark=False), smaller, truth.spec) == ()


@pytest.mark.parametrize("polarity", ["white-on-black", "black-on-white"])
def test_a_click_beside_a_dot_snaps_to_its_centre(bench, polarity):
    truth = bench.scene(
        bench.look(30, 60, 15), field=bench.grid(7, 9, 24.0, 9.0, polarity=polarity), noise=2.0, samples=4
    )
    image = truth.image()
    rng = np.random.default_rng(5)
    for uv in truth.true_uv:
        found = dot_at(image, *(uv + rng.uniform(-4, 4, 2)), dark=polarity == "black-on-white", reach_px=8)
        assert found is not None
        # eccentricity (0.1 px at this tilt and size) and what noise of 2 of 140 grey values leaves
        assert np.hypot(*(found - uv)) < 0.25


def test_a_click_on_nothing_finds_nothing(bench):
    truth = bench.scene(bench.look(), field=bench.grid(7, 9, 24.0, 9.0), noise=2.0)
    image = truth.quick_image()
    between = truth.true_uv[:2].mean(axis=0)
    assert dot_at(image, *between, dark=False, reach_px=3) is None
    assert dot_at(image, 3.0, 3.0, dark=False, reach_px=8) is None
    assert dot_at(image, -500.0, 9000.0, dark=False, reach_px=8) is None
    assert dot_at(image, float("nan"), 0.0, dark=False, reach_px=8) is None


def test_four_exact_picks_predict_the_grid(bench):
    truth = bench.scene(bench.look(25, 70, 30), interior=bench.interior(12.0), field=bench.grid(7, 9))
    view = predicted_view(truth.field, truth.spec, truth.seeds(((0, 0), (0, 8), (6, 8), (6, 0)), error_px=0.0))
    np.testing.assert_allclose(view.project(truth.field.xyz_mm), truth.true_uv, atol=1e-3)
