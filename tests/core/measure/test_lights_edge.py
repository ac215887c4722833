"""Targets beside the edge of the projector's light: those left out are wrong, those kept are honest."""

from dataclasses import replace

import numpy as np
import pytest

from core.measure import measure_targets, recentred
from core.measure.centres.light import CUT, line_gradients
from core.model import DeviceSpec

PROJECTOR = DeviceSpec(900, 900, (0.05, 0.05), 60.0)
LINES_PER_PX = 0.8


@pytest.fixture(scope="module")
def captures(bench):
    """Boards at several places, each cut by the light's edge at another column of the camera."""
    found = []
    for k, (lit_from, roll) in enumerate([(200, 5), (226, 100), (255, 230), (270, 290)]):
        truth = bench.scene(
            bench.look(10, 30 * k, roll, 620), field=bench.grid(11, 15), noise=1.0, lit_from=lit_from, seed=k, samples=4
        )
        phase = truth.phase(k)
        u = np.arange(truth.spec.width, dtype=np.float32)
        lines = np.where(u >= lit_from, LINES_PER_PX * (u - lit_from + 0.5) - 0.5, np.nan)
        phase = replace(phase, u=np.broadcast_to(lines, phase.u.shape).astype(np.float32))
        found.append((truth, phase, lit_from))
    return found


def errors_near_the_edge(bench, captures, projector):
    """Error over sigma of targets within 20 px of the light's edge, along it and across."""
    result = []
    for truth, phase, lit_from in captures:
        inside = np.all((truth.true_uv > (lit_from + 40, 15)) & (truth.true_uv < (730, 560)), axis=1)
        right = np.flatnonzero(inside)
        rows, cols = truth.field.row[right], truth.field.col[right]
        corners = [int(np.argmax(a * rows + b * cols)) for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
        seeds = truth.seeds(sorted({(int(rows[k]), int(cols[k])) for k in corners}))
        targets = measure_targets(phase, truth.field, seeds, truth.spec, projector=projector)
        # as calibrating does by the adjusted camera; the nominal one's eccentricity moves all dots of an image alike
        targets = recentred(targets, truth.field, truth.spec, truth.interior, truth.pose)
        which, error = bench.compare(targets, truth)
        sigma = np.sqrt(np.diagonal(targets.camera_cov, axis1=1, axis2=2))
        result.append((error / sigma)[truth.true_uv[which, 0] < lit_from + 20])
    return np.concatenate(result)


def test_targets_beside_the_edge_are_left_out_and_the_rest_is_honest(bench, captures):
    without, told = (errors_near_the_edge(bench, captures, projector) for projector in (None, PROJECTOR))
    assert 5 < len(told) < len(without)
    # sigmas are honest to 20 % in this renderer (test_target_centroids); of 2 n values none beyond 4.5 of them
    assert np.sqrt(np.mean(told**2)) < 1.35
    assert np.abs(told).max() < 4.5
    # a shadow's edge, of which no raster knows: the board's brightness around the dots tells of most of it
    assert np.sqrt(np.mean(without**2)) < 1.7
    assert np.abs(without).max() < 6


def test_the_reason_is_told(bench, captures):
    truth, phase, _ = captures[0]
    seeds = truth.seeds(((3, 8), (3, 13), (8, 13), (8, 8)))
    before = measure_targets(phase, truth.field, seeds, truth.spec)
    after = measure_targets(phase, truth.field, seeds, truth.spec, projector=PROJECTOR)
    lost = {(m.row, m.col) for m in after.missing} - {(m.row, m.col) for m in before.missing}
    assert lost
    assert {m.reason for m in after.missing if (m.row, m.col) in lost} == {CUT}
    assert len(after.row) + len(after.missing) == len(truth.field.row)


def test_gradients_of_a_known_map_despite_wrong_coordinates():
    rng = np.random.default_rng(0)
    uv = rng.uniform(0, 500, (120, 2))
    J = np.array([[0.8, 0.1], [-0.05, 1.3]])
    lines = uv @ J.T + rng.normal(0, 0.03, uv.shape)
    lines[rng.choice(120, 3, replace=False), 0] += 40
    lines[:20, 1] = np.nan
    gradient = line_gradients(uv, lines)
    # neighbours some 40 px apart tell 0.03 / 40 / 2; ten times that
    assert np.abs(np.median(gradient, axis=0) - J).max() < 0.004
    assert np.mean(np.abs(gradient - J).max(axis=(1, 2)) < 0.05) > 0.95


def test_the_four_coordinates_covary_as_repeated_images_do(bench):
    truth = bench.scene(bench.look(20, 30, 10), bench.part, field=bench.grid(7, 9), samples=4)
    clean, phase = truth.image(bits=False), truth.phase(bits=False)
    seeds = truth.seeds(((1, 2), (1, 6), (5, 6), (5, 2)))
    rng, found = np.random.default_rng(3), []
    for _ in range(30):
        u, v = (x + rng.normal(0, 0.004, x.shape).astype(np.float32) for x in (phase.u, phase.v))
        noisy = (clean + rng.normal(0, 6.0, clean.shape)).astype(np.float32)
        small = np.full_like(u, 0.004)
        noisy_phase = replace(phase, image=noisy, u=u, v=v, sigma_u=small, sigma_v=small)
        found.append(measure_targets(noisy_phase, truth.field, seeds, truth.spec))
    four = np.array([np.concatenate([f.camera_uv, f.projector_uv], axis=1) for f in found])
    scatter = np.einsum("kni,knj->ij", *[four - four.mean(axis=0)] * 2) / (29 * four.shape[1])
    predicted = np.mean([f.cov for f in found], axis=(0, 1))
    norm = np.sqrt(np.diag(predicted))
    # 63 targets x 29 degrees of freedom: entries known to 2 %; the centroids' floor adds some per cent
    assert np.abs((scatter - predicted) / np.outer(norm, norm)).max() < 0.1
    assert (scatter / np.outer(norm, norm))[0, 2] > 0.4  # the shared part is not small here


@pytest.mark.parametrize("cells", [((1, 0), (1, 17), (11, 18), (12, 1)), ((2, 0), (2, 3), (9, 3), (10, 0))])
def test_picks_beside_the_light_lead_into_it(bench, cells):
    truth = bench.scene(bench.look(12, 40, 4, 560), noise=0.5)
    lit = np.zeros((truth.spec.height, truth.spec.width), bool)
    lit[60:500, 190:600] = True  # none of the picks; dim dots all round, as in a room that is not quite dark
    phase = truth.phase(quick=True)
    u, v = (np.where(lit, x, np.nan).astype(np.float32) for x in (phase.u, phase.v))
    phase = replace(phase, image=np.rint(phase.image * np.where(lit, 1, 0.08)).astype(np.float32), u=u, v=v)
    targets = measure_targets(phase, truth.field, truth.seeds(cells), truth.spec)
    which, error = bench.compare(targets, truth)
    assert np.abs(error).max() < 0.5
    whole = np.all((truth.true_uv > (200, 70)) & (truth.true_uv < (590, 490)), axis=1)
    assert set(which) >= set(np.flatnonzero(whole))


def test_what_few_targets_read_has_a_sigma(bench, captures):
    """Two dots tell no gradient of the lines; a capture of them ended `calibrate` by sigmas that are no numbers."""
    truth, phase, _ = captures[0]
    few = np.full_like(phase.u, np.nan)
    for u, v in np.rint(truth.true_uv[[3 * 15 + 8, 8 * 15 + 13]]).astype(int):
        few[v - 15 : v + 16, u - 15 : u + 16] = phase.u[v - 15 : v + 16, u - 15 : u + 16]
    seeds = truth.seeds(((3, 8), (3, 13), (8, 13), (8, 8)))
    targets = measure_targets(replace(phase, u=few), truth.field, seeds, truth.spec)
    read = np.isfinite(targets.projector_uv)
    assert np.count_nonzero(read[:, 0]) == 2
    assert (targets.projector_sigma[read] > 0).all()
