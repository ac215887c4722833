"""How a coordinate runs over a board under a wide-angle camera: its slopes and bends against those of exact optics."""

import numpy as np
import pytest

from core.measure.centres.course import bends
from core.measure.centres.light import line_gradients

CENTRE, FOCAL = np.array([399.5, 299.5]), 425.0  # px: 86 degrees across 800
K1, K2 = -0.19, 0.035
BASE = np.array([160.0, 20.0, 10.0])  # mm, of a projector that is turned towards the board, which lies 270 mm away
NORMAL = np.array([0.2, -0.15, 1.0]) / np.linalg.norm([0.2, -0.15, 1.0])


def ray(uv):
    """Directions (n, 3) of the pixels (n, 2) of a camera whose lens distorts by k1 and k2."""
    seen = (uv - CENTRE) / FOCAL
    x = seen.copy()
    for _ in range(40):
        r2 = np.sum(x * x, axis=1, keepdims=True)
        x = seen / (1 + K1 * r2 + K2 * r2 * r2)
    return np.column_stack([x, np.ones(len(x))])


def lines(uv):
    """Projector columns (n,) that light what the pixels (n, 2) see of a tilted board."""
    d = ray(uv)
    point = d * (270 * NORMAL[2] / (d @ NORMAL))[:, None] - BASE
    axis = np.array([-BASE[0], -BASE[1], 270.0 - BASE[2]]) / np.linalg.norm([BASE[0], BASE[1], 270.0 - BASE[2]])
    across = np.cross([0.0, 1.0, 0.0], axis)
    x, y, z = point @ across / np.linalg.norm(across), point @ np.cross(axis, across), point @ axis
    r2 = (x * x + y * y) / z**2
    return 640 + 855 * x / z * (1 - 0.02 * r2)


def images(rows, columns, spacing=37.0):
    """Centres (n, 2) of a board's dots, px, as irregular as a perspective has them."""
    v, u = np.mgrid[:rows, :columns]
    even = np.stack([u - (columns - 1) / 2, v - (rows - 1) / 2], axis=-1).reshape(-1, 2) * spacing
    return CENTRE + even * (1 + 4e-4 * even[:, :1]) + np.random.default_rng(2).uniform(-2, 2, even.shape)


def slopes(uv):
    return np.stack([(lines(uv + step) - lines(uv - step)) / 2 for step in np.eye(2)], axis=1)


@pytest.mark.parametrize(("rows", "columns", "limit"), [(9, 14, 0.004), (6, 8, 0.02)])
def test_slopes_hold_up_to_a_boards_rim(rows, columns, limit):
    # centres of 14 px dots are carried by up to 0.08 px along them: 0.004 lines need 2 %
    uv = images(rows, columns)
    coordinates = np.column_stack([lines(uv), uv[:, 1]]) + 0.006 * np.random.default_rng(1).normal(size=uv.shape)
    found = line_gradients(uv, coordinates)[:, 0]
    true = slopes(uv)
    assert (np.linalg.norm(found - true, axis=1) / np.linalg.norm(true, axis=1)).max() < limit  # planes: up to 0.1


def test_slopes_are_told_where_coordinates_are_wrong_or_missing():
    uv, rng = images(9, 14), np.random.default_rng(1)
    coordinates = np.column_stack([lines(uv), np.where(uv[:, 1] > 350, np.nan, uv[:, 1])])
    coordinates[rng.choice(len(uv), 5, replace=False), 0] += 40
    found, true = line_gradients(uv, coordinates), slopes(uv)
    assert np.quantile(np.linalg.norm(found[:, 0] - true, axis=1) / np.linalg.norm(true, axis=1), 0.95) < 0.02
    assert np.abs(found[:, 1] - [0, 1]).max() < 1e-4


@pytest.mark.parametrize(("rows", "columns"), [(9, 14), (7, 9)])
def test_bends_hold_up_to_a_boards_rim_or_say_that_they_do_not(rows, columns):
    uv, sigma = images(rows, columns), 0.006
    u, v = np.eye(2)
    uu, across, vv = (lines(uv + step) + lines(uv - step) - 2 * lines(uv) for step in (u, u + v, v))
    true = np.stack([uu, (across - uu - vv) / 2, vv], axis=1)
    area = (1.4**2 + 2.2**2) / 4 * 7.0**2  # px², of the ring round a 14 px dot
    noise = sigma * np.random.default_rng(1).normal(size=len(uv))
    found = bends(uv, lines(uv) + noise, np.full(len(uv), sigma))
    told = np.isfinite(found[:, 0])
    assert np.mean(told) > 0.8
    off = (found - np.column_stack([true, np.zeros(len(uv))]))[told]
    error = (off[:, 0] + off[:, 2]) * area / 2
    assert np.sqrt(np.mean(error**2)) < 0.003  # lines; polynomials of degree 4 alone leave 0.01, at the rim 0.05
    assert np.abs(error / np.hypot(off[:, 3] * area / 2, 0.003)).max() < 4  # a ring's own noise


def test_a_projection_alone_is_told_by_few_terms():
    uv, sigma = images(9, 14), 0.05
    even = 640 + 1.2 * (uv - CENTRE)[:, 0] / (1 + (uv - CENTRE) @ [1e-3, -4e-4])
    found = bends(uv, even + sigma * np.random.default_rng(1).normal(size=len(uv)), np.full(len(uv), sigma))
    inner = np.pad(np.ones((7, 12), bool), 1).ravel()
    assert np.isfinite(found[inner]).all()
    assert np.median(found[inner, 3]) < 4e-5  # lines/px²: of degree 6 alone it is 7e-5


def test_what_few_terms_lack_is_not_taken_for_a_board_seen_from_its_edge():
    # terms of degree 4 stand for such a lens best with a denominator that is 0 at the board's rim
    uv, sigma = images(16, 10, 30.0), 0.015
    y = (uv[:, 1] - 299.5) / 240
    noise = sigma * np.random.default_rng(0).normal(size=len(uv))
    found = bends(uv, 600 + 300 * y + 0.3 * uv[:, 0] + y**5 + 0.5 * y**6 + noise, np.full(len(uv), sigma))
    told, bent = np.isfinite(found[:, 0]), (20 * y**3 + 15 * y**4) / 240**2
    assert np.mean(told) > 0.9
    assert np.abs((found[:, 2] - bent) / np.hypot(found[:, 3], sigma / 49))[told].max() < 4
