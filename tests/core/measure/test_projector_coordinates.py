"""Projector coordinates at the targets: linear maps are read exactly, sigmas are those of the scatter."""

from dataclasses import replace

import numpy as np
import pytest

from core.measure import measure_targets
from core.measure.projector import bilinear

CELLS = [(1, 2), (1, 6), (5, 6), (5, 2)]


@pytest.fixture(scope="module")
def truth(bench):
    return bench.scene(bench.look(25, 20, 0), field=bench.grid(7, 9), noise=1.0, samples=3)


def measured(truth, phase):
    return measure_targets(phase, truth.field, truth.seeds(CELLS), truth.spec)


def read(truth, phase, how):
    """Camera coordinates, and the projector's with the own part of their sigmas: the centroid is what they are at."""
    found = measured(truth, phase)
    if how == "bilinear":
        axes = (phase.u, phase.sigma_u), (phase.v, phase.sigma_v)
        pairs = [bilinear(*axis, found.camera_uv) for axis in axes]
        return found.camera_uv, *(np.stack(part, axis=1) for part in zip(*pairs, strict=True))
    shared = np.einsum("nij,njk,nik->ni", found.gradient, found.camera_cov, found.gradient)
    return found.camera_uv, found.projector_uv, np.sqrt(found.projector_sigma**2 - shared)


@pytest.mark.parametrize("how", ["surface", "bilinear"])
def test_a_linear_map_is_read_exactly(bench, truth, how):
    uv, lines, _ = read(truth, truth.phase(), how)
    # float32 lines at some 500: 3e-5 each
    assert np.allclose(lines, bench.true_projector(uv), atol=2e-4)


@pytest.mark.parametrize("how", ["surface", "bilinear"])
def test_sigmas_are_those_of_repeated_phase_maps(bench, truth, how):
    phase, rng = truth.phase(), np.random.default_rng(2)
    deviations = []
    for _ in range(12):
        u, v = (
            (x + rng.normal(size=x.shape) * s).astype(np.float32)
            for x, s in ((phase.u, phase.sigma_u), (phase.v, phase.sigma_v))
        )
        uv, lines, own = read(truth, replace(phase, u=u, v=v), how)
        deviations.append((lines - bench.true_projector(uv)) / own)
    # 12 x 63 x 2 deviations: their r.m.s. is known to 2 %; three times that
    assert np.sqrt(np.mean(np.array(deviations) ** 2)) == pytest.approx(1.0, abs=0.06)


def test_weights_reduce_the_variance_of_interpolated_values():
    values, sigma = np.zeros((4, 4), np.float32), np.full((4, 4), 2.0, np.float32)
    _, s = bilinear(values, sigma, np.array([[1.0, 1.0], [1.5, 1.0], [1.5, 1.5], [3.0, 3.0]]))
    assert np.allclose(s, [2.0, 2.0 / np.sqrt(2), 1.0, 2.0])


def test_all_four_neighbours_must_be_valid():
    values = np.arange(16, dtype=np.float32).reshape(4, 4)
    values[2, 2] = np.nan
    got, _ = bilinear(values, np.ones((4, 4), np.float32), np.array([[1.5, 1.5], [0.5, 0.5], [3.2, 1.0], [-0.1, 1.0]]))
    assert np.array_equal(np.isfinite(got), [False, True, False, False])
    assert got[1] == pytest.approx(2.5)


def test_an_axis_without_patterns_stays_nan(truth):
    phase = truth.phase()
    nothing = np.full_like(phase.v, np.nan)
    found = measured(truth, replace(phase, v=nothing, sigma_v=nothing))
    assert np.all(np.isfinite(found.projector_uv[:, 0]))
    assert np.all(np.isnan(found.projector_uv[:, 1]))
    assert np.all(np.isnan(found.projector_sigma[:, 1]))


@pytest.mark.parametrize("wrong", [np.nan, 4.0])
def test_an_invalid_or_wrong_pixel_in_the_middle_is_bridged_by_the_rest_of_the_dot(bench, truth, wrong):
    phase = truth.phase()
    before = measured(truth, phase)
    u = phase.u.copy()
    i, j = np.floor(before.camera_uv).astype(int).T
    u[j, i] += wrong
    found = measured(truth, replace(phase, u=u))
    assert np.allclose(found.projector_uv, bench.true_projector(found.camera_uv), atol=2e-3)
    # one pixel of some sixty
    assert np.all(found.projector_sigma[:, 0] < 1.05 * before.projector_sigma[:, 0])


def test_a_rim_that_is_decoded_wrongly_moves_no_value(bench, truth):
    phase = truth.phase()
    before, u = measured(truth, phase), phase.u.copy()
    for (x, y), radius in zip(before.camera_uv, before.diameter_px / 2, strict=True):
        rows, columns = np.mgrid[: u.shape[0], : u.shape[1]]
        u[(np.hypot(columns - x, rows - y) < radius) & (columns - x > 0.55 * radius)] += 4.0
    found = measured(truth, replace(phase, u=u))
    assert len(found.row) == len(before.row)
    assert np.allclose(found.projector_uv, bench.true_projector(found.camera_uv), atol=2e-3)


def test_dots_too_dark_to_be_decoded_take_their_coordinates_from_round_them(bench):
    field = bench.grid(7, 9, polarity="black-on-white")
    truth = bench.scene(bench.look(25, 20, 0), field=field, noise=1.0, samples=3)
    phase = truth.phase()
    dark = phase.image < 0.5 * phase.image.max()
    u, v = np.where(dark, np.nan, phase.u), np.where(dark, np.nan, phase.v)
    found = measured(truth, replace(phase, u=u, v=v))
    assert len(found.row) == 63
    assert np.allclose(found.projector_uv, bench.true_projector(found.camera_uv), atol=1e-3)
    assert np.all((found.projector_sigma > 0) & (found.projector_sigma < 0.02))
