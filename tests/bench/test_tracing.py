"""The bench's own optics, scalar by scalar, against `core.geometry` and against closed forms."""

import numpy as np
import pytest

from core.bench import Form, experiment
from core.bench.tracing import (
    _with_distortion,
    _without_distortion,
    form_at,
    meets_block,
    meets_sphere,
    pack_device,
    paint_at,
    place_of,
)
from core.geometry import project, ray_directions


@pytest.fixture(scope="module")
def rig():
    return experiment("paper").rig


def direction_of(device, c_mm, u, v):
    """Slopes of the ray that a pixel sees."""
    x1, y1 = _with_distortion(device, u, v)
    return np.array(_without_distortion(device, x1, y1, x1, y1)) / c_mm


@pytest.mark.parametrize("device", ["camera", "projector"])
def test_a_pixel_sees_the_ray_that_core_geometry_gives(rig, device):
    spec, interior = getattr(rig, device), getattr(rig, f"{device}_interior")
    packed = pack_device(spec, interior)
    rng = np.random.default_rng(0)
    uv = rng.uniform([-20, -20], [spec.width + 20, spec.height + 20], (300, 2))
    expected = ray_directions(spec, interior, uv)
    seen = np.array([direction_of(packed, interior.c_mm, u, v) for u, v in uv])
    np.testing.assert_allclose(seen, expected[:, :2], atol=1e-10)  # both iterate to 1e-9 mm


@pytest.mark.parametrize("device", ["camera", "projector"])
def test_a_point_appears_where_core_geometry_puts_it(rig, device):
    spec, interior = getattr(rig, device), getattr(rig, f"{device}_interior")
    packed = pack_device(spec, interior)
    points = np.random.default_rng(1).uniform([-150, -120, -700], [150, 120, -500], (300, 3))
    seen = np.array([place_of(packed, *p) for p in points])
    np.testing.assert_allclose(seen, project(spec, interior, points), atol=1e-9)


def test_no_ray_where_the_polynomial_has_no_inverse(rig):
    packed = pack_device(rig.camera, rig.camera_interior)
    packed[3] = -0.2  # x(1 - 0.2 (r² - r0²)) turns back before the corner
    assert np.all(np.isnan(direction_of(packed, 1.0, 0.0, 0.0)))


def test_the_form_and_its_slopes():
    a, scale = np.random.default_rng(2).normal(size=(5, 5)), 80.0
    x, y, d = 31.0, -47.0, 1e-4
    form = Form(a, scale)
    h, hx, hy = form_at(a, scale, x, y)
    assert h == pytest.approx(float(form.height(x, y)), abs=1e-12)
    assert hx == pytest.approx(float(form.height(x + d, y) - form.height(x - d, y)) / (2 * d), abs=1e-7)
    assert hy == pytest.approx(float(form.height(x, y + d) - form.height(x, y - d)) / (2 * d), abs=1e-7)


def test_a_ray_meets_a_sphere_at_its_near_side_and_leaves_it_from_inside():
    sphere = np.array([0.0, 0.0, 10.0, 4.0, 1.0])
    assert meets_sphere(sphere, np.zeros(3), 0.0, 0.0, 2.0) == pytest.approx(3.0)
    assert meets_sphere(sphere, np.array([0.0, 0.0, 10.0]), 0.0, 0.0, 1.0) == pytest.approx(4.0)
    assert meets_sphere(sphere, np.array([4.1, 0.0, 0.0]), 0.0, 0.0, 1.0) == np.inf
    assert meets_sphere(sphere, np.zeros(3), 0.0, 0.0, -1.0) == np.inf


def test_a_ray_enters_a_block_by_the_face_it_reaches_last():
    block = np.array([0.0, -1.0, 0.0, 2.0, 1.0, 3.0, 1.0])
    assert meets_block(block, np.array([1.0, 0.0, 5.0]), 0.0, 0.0, -1.0) == (pytest.approx(2.0), 2)
    assert meets_block(block, np.array([-4.0, 0.0, 1.0]), 2.0, 0.0, 0.0) == (pytest.approx(2.0), 0)
    assert meets_block(block, np.array([-4.0, 0.0, 4.0]), 2.0, 0.0, 0.0)[0] == np.inf


def test_a_point_on_a_block_is_not_in_its_own_shadow_but_its_foot_is():
    block = np.array([0.0, -1.0, 0.0, 2.0, 1.0, 3.0, 1.0])
    assert meets_block(block, np.array([1.0, 0.2, 3.0]), 5.0, 0.0, 9.0)[0] == np.inf  # on the top, light from above
    assert meets_block(block, np.array([-1e-9, 0.2, 0.0]), 5.0, 0.0, 9.0)[0] < 1  # beside the wall


def test_the_soft_edge_of_a_circle_counts_areas():
    board = np.array([50.0, 50.0, 0.0, 1.0])
    circle = np.array([[0.3, -0.2, 0.0, 5.0, 1.0]])
    cells = np.array([0, 1], np.int32), np.array([0], np.int32), np.array([-50.0, -50.0, 100.0, 1.0, 1.0])
    step = 0.4
    x = (np.arange(-20, 20) + 0.5) * step
    total = (
        sum(paint_at(board, circle, *cells, a, b, 0.0, 0.0, step, 0.0, 0.0, step)[0] for a in x for b in x) * step**2
    )
    assert total == pytest.approx(np.pi * 25, rel=2e-4)  # a hard edge is off by up to 1 %, a straight one by 5e-4


def test_a_circle_above_the_board_is_met_where_the_ray_crosses_its_height():
    board = np.array([50.0, 50.0, 0.1, 1.0])
    circle = np.array([[10.0, 0.0, 2.0, 3.0, 0.9]])
    cells = np.array([0, 1], np.int32), np.array([0], np.int32), np.array([-50.0, -50.0, 100.0, 1.0, 1.0])
    # slope 0.5 in x per mm of z: the ray that reaches the board at x = 9 crosses z = 2 at x = 10
    assert paint_at(board, circle, *cells, 9.0, 0.0, 0.5, 0.0, 0.1, 0.0, 0.0, 0.1) == (pytest.approx(0.9), 2.0)
    assert paint_at(board, circle, *cells, 12.5, 0.0, 0.5, 0.0, 0.1, 0.0, 0.0, 0.1) == (pytest.approx(0.1), 0.0)
