"""The compiled loops of views and of surfaces round dots, against plain numpy."""

import numpy as np
import pytest

from core.geometry import Pose, matrix_from_rotation_vector
from core.measure.centres.course import bends
from core.measure.identity.view import View, _linearised
from core.measure.projector import middle_of_surface
from core.model import DeviceSpec
from core.numerics import nearest

ELLIPSE = np.array([[7.0, 1.0], [-0.5, 6.0]])
INSIDE, AROUND = (0.0, 0.85), (1.3, 2.1)


def fitted(values, sigma, uv, radii, bend=None):
    inner, outer = (np.full(len(uv), radius) for radius in radii)
    return middle_of_surface(values, sigma, uv, np.stack([ELLIPSE] * len(uv)), inner, outer, bend)


@pytest.mark.parametrize("radii", [INSIDE, AROUND])
def test_a_surface_is_that_of_weighted_least_squares(radii):
    rng = np.random.default_rng(3)
    v, u = np.mgrid[:60, :70]
    sigma = rng.uniform(0.05, 0.1, u.shape).astype(np.float32)
    values = (200 + 0.8 * u - 0.1 * v + 2e-3 * u * v + rng.uniform(-1, 1, u.shape) * sigma).astype(np.float32)
    values[rng.random(u.shape) < 0.1] = np.nan
    uv = np.array([[33.4, 29.7], [-4.0, 30.0], [np.nan, 1.0]])  # whole, beyond the rim, nowhere
    value, spread = fitted(values, sigma, uv, radii)
    values, sigma = (each.ravel().astype(np.float64) for each in (values, sigma))
    x, z = np.linalg.solve(ELLIPSE, np.stack([u.ravel(), v.ravel()]) - uv[0, :, None])
    use = (np.hypot(x, z) >= radii[0]) & (np.hypot(x, z) <= radii[1]) & np.isfinite(values)
    A = (np.stack([np.ones_like(x), x, z, x * x, x * z, z * z], axis=1) / sigma[:, None])[use]
    terms, squares, *_ = np.linalg.lstsq(A, values[use] / sigma[use], rcond=None)
    expected = np.sqrt(np.linalg.inv(A.T @ A)[0, 0] * max(squares[0] / (use.sum() - 6), 1.0))
    assert value[0] == pytest.approx(terms[0], abs=1e-9)
    assert spread[0] == pytest.approx(expected, rel=1e-9)
    assert np.isnan([value[1:], spread[1:]]).all()


def seen_by_projector(places, tilt, bumps=0.0):
    """Columns (n,) that light a tilted board at places (n, 2), px, through a lens that bends lines at its corners."""
    x, y = (places - [374, 288]).T / 1500
    depth = 1 / (1 + tilt * x - 0.4 * y)
    at = (x * depth + 0.25 * (1 - depth) + bumps) / (1 + 0.1 * (1 - depth))
    return 320 + 1900 * at * (1 - 0.2 * (at**2 + (y * depth) ** 2))


@pytest.mark.parametrize(("radii", "bumps"), [(INSIDE, 0.0), (INSIDE, 1e-4), (AROUND, 0.0)])
def test_dots_that_tell_together_how_a_surface_bends_are_twice_as_precise(radii, bumps):
    rng = np.random.default_rng(8)
    uv = np.stack(np.meshgrid(np.arange(60, 700, 36.0), np.arange(60, 540, 36.0)), axis=-1).reshape(-1, 2)
    uv += rng.uniform(-3, 3, uv.shape)
    v, u = np.mgrid[:576, :748]
    places = np.stack([u, v], axis=-1).reshape(-1, 2).astype(float)
    dot = nearest(uv, of=places)[:, 0]
    ups = bumps * rng.standard_normal(len(uv))  # every dot a little off the board, each flat in itself
    true = seen_by_projector(places, 0.7, ups[dot]).reshape(u.shape)
    sigma = np.full(u.shape, 0.05, np.float32)
    ratios, sigmas = [], []
    for _ in range(2):
        values = (true + 0.05 * rng.standard_normal(u.shape)).astype(np.float32)
        first, spread = fitted(values, sigma, uv, radii)
        value, better = fitted(values, sigma, uv, radii, bends(uv, first, spread))
        ratios.append((value - seen_by_projector(uv, 0.7, ups)) / better)
        sigmas.append(better / spread)
    # 504 values: their r.m.s. is known to 3 %; sigma has what a polynomial may leave
    assert 0.8 < np.sqrt(np.mean(np.square(ratios))) < 1.1
    assert np.median(sigmas) < 0.6


def test_a_strip_of_dots_says_how_well_it_tells_the_bend_across():
    rng = np.random.default_rng(8)
    uv = np.stack(np.meshgrid(np.arange(60, 680, 17.0), [100.0, 130.0, 160.0]), axis=-1).reshape(-1, 2)
    uv += rng.uniform(-1, 1, uv.shape) * [1, 0.3]  # rows are never quite straight
    v, u = np.mgrid[:250, :748]
    true = seen_by_projector(np.stack([u, v], axis=-1).reshape(-1, 2).astype(float), 0.7).reshape(u.shape)
    sigma = np.full(u.shape, 0.05, np.float32)
    ratios = []
    for _ in range(3):
        values = (true + 0.05 * rng.standard_normal(u.shape)).astype(np.float32)
        bend = bends(uv, *fitted(values, sigma, uv, INSIDE))
        value, spread = fitted(values, sigma, uv, INSIDE, bend)
        ratios.append((value - seen_by_projector(uv, 0.7)) / spread)
    assert np.sqrt(np.mean(np.square(ratios))) < 1.1  # 330 values: known to 4 %
    assert np.abs(ratios).max() < 4.5


def test_surfaces_of_few_dots_bend_by_themselves():
    uv = np.stack(np.meshgrid(np.arange(5) * 30.0, np.arange(6) * 30.0), axis=-1).reshape(-1, 2)
    assert np.isnan(bends(uv, 0.8 * uv[:, 0], np.full(30, 0.01))).all()
    many = np.stack(np.meshgrid(np.arange(13) * 30.0, np.arange(9) * 30.0), axis=-1).reshape(-1, 2)
    lost = bends(many, np.where(np.arange(117) > 40, np.nan, 0.8 * many[:, 0]), np.full(117, 0.01))
    assert np.isnan(lost).all()


def test_a_pixel_decoded_wrongly_moves_no_surface():
    v, u = np.mgrid[:60, :70]
    values = (200 + 0.8 * u - 0.1 * v).astype(np.float32)
    wrong = values.copy()
    wrong[18, 33] += 5.0
    sigma, uv = np.full(u.shape, 0.05, np.float32), np.array([[33.4, 29.7]])
    value, _ = fitted(wrong, sigma, uv, AROUND)
    assert value[0] == pytest.approx(200 + 0.8 * 33.4 - 0.1 * 29.7, abs=1e-4)  # of float32


@pytest.mark.parametrize(("radii", "slope"), [(INSIDE, 0.31), (INSIDE, 0.74), (AROUND, 0.43)])
def test_errors_common_to_pixels_along_a_line_of_the_pattern_widen_sigma(radii, slope):
    # code alone: lines by their whole numbers, off by up to half a line, all pixels along a line alike
    v, u = np.mgrid[:240, :300]
    true = 20 + slope * u + 0.02 * v
    values, sigma = np.rint(true).astype(np.float32), np.full(u.shape, np.sqrt(1 / 12), np.float32)
    rng = np.random.default_rng(4)
    uv = np.stack(np.meshgrid(np.arange(20, 290, 24), np.arange(20, 230, 24)), axis=-1).reshape(-1, 2)
    uv = uv + rng.uniform(-3, 3, uv.shape)
    value, spread = fitted(values, sigma, uv, radii)
    error = (value - (20 + slope * uv[:, 0] + 0.02 * uv[:, 1])) / spread
    assert 0.5 < np.sqrt(np.mean(error**2)) < 1.35


def test_a_view_changes_with_its_parameters_as_its_derivatives_say():
    rng = np.random.default_rng(1)
    spec = DeviceSpec(748, 576, (0.008, 0.009), 12.0)
    pose, a1 = Pose(matrix_from_rotation_vector(np.array([0.3, 0.2, 1.0])), np.array([3.0, 5.0, -600.0])), 1e-4
    xyz = rng.normal(size=(20, 3)) * 80
    J, rest = _linearised(View(spec, pose, a1), xyz, np.zeros((20, 2)))

    def moved(step):
        turned = matrix_from_rotation_vector(step[:3]) @ pose.rotation
        view = View(spec, Pose(turned, pose.translation_mm + step[3:6]), a1 + step[6])
        image = (view.project(xyz) - (np.array([748, 576]) - 1) / 2) * spec.pitch_mm * [1, -1]
        return image.ravel()

    assert rest == pytest.approx(-moved(np.zeros(7)), abs=1e-12)
    for k, size in enumerate([1e-5] * 3 + [1e-2] * 3 + [1e-7]):
        step = size * np.eye(7)[k]
        numerical = (moved(step) - moved(-step)) / (2 * size)
        assert J[:, k] == pytest.approx(numerical, abs=1e-7 * np.abs(numerical).max())
