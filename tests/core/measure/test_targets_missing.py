"""Dots that cannot be measured without bias are left out, and every missing target has its reason."""

import re
from dataclasses import replace

import numpy as np
import pytest

from core.errors import InputError
from core.measure import measure_targets

CELLS = [(1, 2), (1, 6), (5, 6), (5, 2)]


def measured(truth, cells=CELLS, phase=None):
    found = measure_targets(phase or truth.phase(), truth.field, truth.seeds(cells), truth.spec)
    return found, {(m.row, m.col): m.reason for m in found.missing}


def test_every_target_is_measured_or_missing_with_a_reason(bench):
    truth = bench.scene(bench.look(30, 20, 60, 350, (15, 10)), noise=1.0, samples=3)
    found, why = measured(truth, bench.middle)
    cells = set(zip(found.row.tolist(), found.col.tolist(), strict=True))
    assert cells.isdisjoint(why)
    assert len(cells) + len(why) == 247
    size = np.array([748, 576])
    for (row, col), reason in why.items():
        uv = truth.true_uv[truth.field.index()[row, col]]
        if np.any(uv < -12) or np.any(uv > size + 12):
            assert reason == "outside the image"
        else:
            assert reason in ("outside the image", "cut by the image border")


@pytest.mark.parametrize("depth_px", np.linspace(-4, 4, 9))
def test_a_dot_at_the_edge_of_the_light_is_not_biased(bench, depth_px):
    # a chord one pixel deep moves the centroid of a disc of radius 6 px by 0.15 px
    field = bench.grid(7, 9)
    truth = bench.scene(bench.look(), interior=bench.interior(12.0), field=field, noise=1.0, samples=4)
    column = truth.true_uv[field.col == 1]
    truth = truth.but(lit_from=float(column[:, 0].min() - 6.2 + depth_px))
    found, why = measured(truth)
    _, error = bench.compare(found, truth)
    assert np.hypot(*error.T).max() < 0.06
    if depth_px >= 1:
        for row in range(7):
            assert re.search("light|lit", why[row, 1]), why[row, 1]
    assert {why[row, 0] for row in range(7)} <= {"not lit", "its contrast is unlike its neighbours'"}
    assert sum(c >= 2 for c in found.col) == 49


def test_dark_dots_at_the_edge_of_the_light_are_not_biased_either(bench):
    field = bench.grid(7, 9, polarity="black-on-white")
    truth = bench.scene(bench.look(), interior=bench.interior(12.0), field=field, noise=1.0, samples=4)
    truth = truth.but(lit_from=float(truth.true_uv[field.col == 1][:, 0].mean()))
    found, _ = measured(truth)
    _, error = bench.compare(found, truth)
    assert found.col.min() == 2
    assert np.hypot(*error.T).max() < 0.06


def test_specks_and_reflections_do_not_move_targets(bench):
    rng = np.random.default_rng(3)
    field = bench.grid(7, 9)
    truth = bench.scene(bench.look(20, 40, 10), field=field, noise=1.0, samples=4)
    spots = [(*(uv + rng.normal(0, 9, 2)), rng.uniform(0.5, 3.5), rng.uniform(0.3, 1.0)) for uv in truth.true_uv[::2]]
    picks = truth.true_uv[[field.index()[c] for c in CELLS]]
    spots = [s for s in spots if np.hypot(*(picks - s[:2]).T).min() > 15]
    found, why = measured(truth.but(extra=spots))
    _, error = bench.compare(found, truth)
    assert len(spots) > 20
    assert len(found.row) > 30
    # whatever a speck of a third of the contrast may do unseen in a contour of 0.1 px roughness
    assert np.hypot(*error.T).max() < 0.08
    assert all(re.search("covered|lit|touches|size|bright|disturbed|ambiguous", reason) for reason in why.values())


def test_a_covered_dot_is_missed_with_words(bench):
    field = bench.grid(7, 9)
    truth = bench.scene(bench.look(), field=field, noise=1.0, samples=3)
    phase = truth.phase()
    u, v = np.rint(truth.true_uv[field.index()[3, 4]]).astype(int)
    image = phase.image.copy()
    image[v - 9 : v + 10, u - 9 : u + 10] = 20.0
    _, why = measured(truth, phase=replace(phase, image=image))
    assert why == {(3, 4): "no dot where its neighbours predict it: covered, or without contrast"}
    image = phase.image.copy()
    image[v - 9 : v + 2, u - 9 : u + 10] = 20.0
    _, why = measured(truth, phase=replace(phase, image=image))
    assert "covered" in why[3, 4]


def test_pixels_without_a_value_cost_the_dots_they_lie_in_and_no_others(bench):
    field = bench.grid(7, 9)
    truth = bench.scene(bench.look(), field=field, noise=1.0, samples=3)
    phase = truth.phase()
    u, v = np.rint(truth.true_uv[field.index()[3, 4]]).astype(int)
    image = phase.image.copy()
    image[v - 1 : v + 2, u + 2 : u + 5] = np.nan
    found, why = measured(truth, phase=replace(phase, image=image))
    assert set(why) == {(3, 4)}
    assert len(found.row) == 62


def _lit_between(truth, phase, half):
    """The same image, its light a rhombus that ends before the corners of the board."""
    v, u = np.mgrid[0:576, 0:748]
    middle = truth.true_uv.mean(axis=0)
    dark = np.abs(u - middle[0]) / half[0] + np.abs(v - middle[1]) / half[1] > 1
    dim = truth.black + 0.06 * (phase.image - truth.black)
    return replace(phase, image=np.where(dark, dim, phase.image).astype(np.float32))


def test_picks_on_dots_without_light_lead_to_those_in_the_light(bench):
    truth = bench.scene(bench.look(20, 30, 10, 1000), interior=bench.interior(20.0), noise=0.5, samples=2)
    phase = _lit_between(truth, truth.phase(), (380, 280))
    rows, cols = truth.field.row.max(), truth.field.col.max()
    corners = [(0, 0), (0, cols), (rows, cols), (rows, 0)]
    found, _ = measured(truth, corners, phase)
    at = [truth.field.index()[key] for key in zip(found.row.tolist(), found.col.tolist(), strict=True)]
    assert len(at) > 100
    assert np.hypot(*(found.camera_uv - truth.true_uv[at]).T).max() < 0.2  # a tenth of a spacing is 2 px
    seeds = truth.seeds(corners)
    seeds[1] = replace(seeds[1], col=int(cols) - 1)
    with pytest.raises(InputError, match=r"spacings from where|contradicts"):
        measure_targets(phase, truth.field, seeds, truth.spec)
