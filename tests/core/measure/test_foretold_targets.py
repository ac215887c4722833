"""What foretells targets and chooses their spots, against plain numpy."""

import numpy as np
import pytest

from core.measure.identity.foretold import WHY, choose, foretell


@pytest.fixture
def board() -> dict[str, np.ndarray]:
    """A lattice seen with some distortion, two thirds of it identified, between spots that are no targets."""
    rng = np.random.default_rng(3)
    col, row = (a.ravel() for a in np.meshgrid(np.arange(8), np.arange(7)))
    xyz = np.stack([20.0 * col, 20.0 * row, 0.0 * row], axis=1)
    jacobian = np.array([[1.1, 0.1], [-0.2, -0.9]]) * rng.uniform(0.9, 1.1, (len(xyz), 1, 1))
    base = xyz[:, :2] @ jacobian[0].T + 200
    apart = np.hypot(*np.moveaxis(xyz[:, None, :2] - xyz[:, :2], -1, 0))
    uv = base + 1e-3 * (base - 200) ** 2 / 20 + rng.normal(0, 0.3, base.shape)
    spots = np.concatenate([uv, uv[::5] + rng.normal(0, 4, (len(uv[::5]), 2)), rng.uniform(100, 400, (30, 2))])
    number = np.arange(len(uv))
    unit = 4.5 * jacobian[np.resize(number, len(spots))]
    spread = unit @ np.swapaxes(unit, 1, 2) / 4 * rng.uniform(0.3, 2.5, (len(spots), 1, 1))
    spread[rng.random(len(spots)) < 0.2] *= [[5, 0], [0, 1]]
    return {
        "xyz": xyz,
        "spacing": np.full(len(xyz), 20.0),
        "radius": np.full(len(xyz), 4.5),
        "neighbours": np.argsort(apart, axis=1, kind="stable")[:, 1:25],
        "base": np.where(rng.random((len(base), 1)) < 0.05, np.nan, base),
        "jacobian": jacobian,
        "blob": np.where(rng.random(len(uv)) < 0.66, number, -1),
        "spots": spots,
        "area": np.pi * 4 * np.sqrt(np.linalg.det(spread)),
        "cov": spread,
        "contrast": 100 * rng.uniform(0.2, 1.5, len(spots)),
        "border": rng.random(len(spots)) < 0.1,
    }


def test_targets_are_foretold_by_a_weighted_line_through_what_their_neighbours_miss(board):
    b, targets = board, np.flatnonzero(board["blob"] < 0)
    names = ("neighbours", "blob", "spots", "base", "xyz", "spacing")
    uv, support = foretell(targets, *(b[name] for name in names))
    for t, place, count in zip(targets, uv, support, strict=True):
        near = [j for j in b["neighbours"][t] if b["blob"][j] >= 0 and np.isfinite(b["base"][j, 0])]
        offset = (b["xyz"][near, :2] - b["xyz"][t, :2]) / b["spacing"][t]
        A, w = np.column_stack([np.ones(len(near)), offset]), 1 / (0.3 + np.sum(offset**2, axis=1)) ** 2
        N = A.T @ (w[:, None] * A) + w.sum() * np.diag([1e-9, 0.03, 0.03])
        missed = b["spots"][b["blob"][near]] - b["base"][near]
        assert count == len(near)
        expected = b["base"][t] + np.linalg.solve(N, A.T @ (w[:, None] * missed))[0]
        assert place == pytest.approx(expected, rel=1e-9, nan_ok=True)


def test_a_spot_is_chosen_where_it_is_near_alone_and_like_its_neighbours(board):
    b, targets = board, np.flatnonzero(board["blob"] < 0)
    uv = b["spots"][targets] + np.random.default_rng(1).normal(0, 3, (len(targets), 2))
    support = np.resize([2, 5], len(targets))
    chosen, why = np.empty_like(targets), np.empty_like(targets)
    names = ("jacobian", "radius", "spacing", "neighbours", "blob", "spots", "area", "cov", "contrast", "border")
    choose(targets, uv, support, *(b[name] for name in names), 1.0, chosen, why)
    seen = set()
    for k, t in enumerate(targets):
        four = np.argsort(np.linalg.norm(b["spots"] - uv[k], axis=1))[:4]
        distance = np.linalg.norm(np.linalg.solve(b["jacobian"][t], (b["spots"][four] - uv[k]).T), axis=0) / 20
        known = [j for j in b["blob"][b["neighbours"][t]] if j >= 0]
        bright = b["contrast"][four] / np.median(b["contrast"][known])
        back = np.linalg.inv(4.5 * b["jacobian"][t])
        axes = np.sqrt(np.linalg.eigvalsh(back @ b["cov"][four] @ back.T))
        size = np.sqrt(b["area"][four] / np.pi / abs(np.linalg.det(4.5 * b["jacobian"][t])))
        faults = np.zeros(4, int)
        for number, bad in enumerate(
            (bright <= 0.35, axes[:, 1] >= 1.8 * axes[:, 0], (size <= 0.6) | (size >= 1.6)), 1
        ):
            faults[bad] = number
        faults[b["border"][four]] = 4
        within = distance < (0.2 if support[k] >= 3 else 0.35)
        good = np.flatnonzero(within & (faults == 0))
        good = good[np.argsort(distance[good])]
        if len(good) > 1 and distance[good[1]] < max(2.5 * distance[good[0]], 0.15):
            expected = -1, 5
        elif len(good):
            expected = four[good[0]], None
        else:
            expected = -1, faults[np.argmin(distance)] if within.any() else 0
        assert chosen[k] == expected[0]
        assert expected[1] is None or why[k] == expected[1]
        seen.add(expected[1])
    assert {None, 0, 3, 5} <= seen
    assert all(WHY[number] for number in range(1, 6))
