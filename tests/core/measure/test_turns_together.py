"""Turns of a board that looks the same half a turn round: told from its irregularity, or not at all.

The images come from a small camera of this test's own: a pinhole with one radial term, in its own words.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.measure.identity.turns import SAME, relabelled, solve_turns, symmetries
from core.model import Capture, Frame, TargetSet, Testfield
from core.patterns import White
from core.pipeline import decode, measure
from core.project import load_archive, save_archive

ROWS, COLS = 13, 19
HALF = (((-1, 0), (0, -1)), (ROWS - 1, COLS - 1))


@pytest.fixture(scope="module")
def board():
    row, col = (x.ravel() for x in np.mgrid[0:ROWS, 0:COLS])
    xyz = np.stack([12.0 * (col - 9), 12.0 * (6 - row), 0.0 * row], axis=1)
    field = Testfield(row, col, xyz, np.full(row.size, 5.0))
    for values in (row, col, xyz, field.diameter_mm):
        values.flags.writeable = False  # as fields that are read: they are looked through once
    return field


def image_of(made, field, rng, sigma_px=0.01, hidden=0.3):
    """A view of a board as made: tilted to 40 degrees, rolled anyhow, a part of it out of sight, true labels."""
    roll, tilt, about = rng.uniform(0, 2 * np.pi), rng.uniform(0, 0.7), rng.uniform(0, 2 * np.pi)
    z = lambda a: np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1.0]])  # noqa: E731
    x = np.array([[1, 0, 0], [0, np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), np.cos(tilt)]])
    p = made @ (z(roll) @ x @ z(about)).T + [rng.uniform(-30, 30), rng.uniform(-20, 20), 0]
    q = p[:, :2] / (600 - p[:, 2:])
    q = q * (1 - 0.15 * np.sum(q**2, axis=1, keepdims=True))
    uv = 1500 * q * [1, -1] + [374, 288] + rng.normal(0, sigma_px, q.shape)
    side = rng.normal(size=2)
    keep = np.argsort((uv - uv.mean(axis=0)) @ side)[: int(len(uv) * (1 - rng.uniform(0, hidden)))]
    n = len(keep)
    none = np.full((n, 2), np.nan)
    cov = np.tile(np.eye(2) * sigma_px**2, (n, 1, 1))
    return TargetSet("", field.row[keep], field.col[keep], uv[keep], cov, none, none, none, np.full(n, 12.0))


def as_made(field, rng, off_mm, bend_mm=0.3):
    xyz = field.xyz_mm + rng.normal(0, 1, field.xyz_mm.shape) * [off_mm, off_mm, off_mm / 2]
    xyz[:, 2] += bend_mm * (xyz[:, 0] ** 2 - 0.7 * xyz[:, 0] * xyz[:, 1]) / 108**2
    return xyz


@pytest.mark.parametrize("off_mm", [0.1, 0.02])
def test_no_wrong_turn_in_random_poses_in_sets_of_eight(board, off_mm):
    rng, wrong, untold, count = np.random.default_rng(int(1000 * off_mm)), 0, 0, 0
    assert symmetries(board) == (HALF,)
    for _ in range(25):
        made = as_made(board, rng, off_mm)
        turned = rng.integers(0, 2, 8).astype(bool)
        images = [image_of(made, board, rng) for _ in range(8)]
        named = [relabelled(i, HALF, board) if t else i for i, t in zip(images, turned, strict=True)]
        solved = solve_turns(named, [(SAME, HALF)] * 8, board)
        # the whole board's turn is free, so all must be right or all half a turn round
        right = [bool(np.array_equal(s.targets.row, i.row)) for s, i in zip(solved, images, strict=True) if s.told]
        wrong += min(sum(right), len(right) - sum(right))
        untold += 8 - len(right)
        count += 8
    assert wrong == 0
    assert untold == 0, f"{untold} of {count}"


@pytest.mark.parametrize("stated", [1.0, 0.25])
@pytest.mark.parametrize("seed", [3, 5, 8])
def test_a_board_as_regular_as_its_drawing_is_not_guessed(board, stated, seed):
    """Nor where centroids have errors beyond their sigmas, as pixels leave them in images of little noise."""
    rng = np.random.default_rng(seed)
    images = [image_of(board.xyz_mm, board, rng) for _ in range(8)]
    images = [replace(i, camera_cov=i.camera_cov * stated**2) for i in images]
    named = [relabelled(i, HALF, board) if k % 2 else i for k, i in enumerate(images)]
    solved = solve_turns(named, [(SAME, HALF)] * 8, board)
    assert not any(s.told for s in solved)


def test_what_a_wide_lens_leaves_does_not_overrule_picks():
    """Plates one before the other: beyond a polynomial the lens leaves nearly the same in all images."""
    row, col = (x.ravel() for x in np.mgrid[0:7, 0:9])
    xyz = np.stack([62.0 * (col - 4), 62.0 * (3 - row), 0.0 * row], axis=1)
    field = Testfield(row, col, xyz, np.full(row.size, 26.0))
    overruled = 0
    for seed in range(20):
        rng, images = np.random.default_rng(seed), []
        for z in (-330, -300, -270, -240):
            x, y = (xyz[:, :2] / -z).T
            r2 = x**2 + y**2
            d = 1 - 0.18 * r2 + 0.028 * r2**2
            u = x * d + 0.001 * x * y + 0.0003 * (r2 + 2 * x**2)
            v = y * d + 0.0006 * x * y + 0.0005 * (r2 + 2 * y**2)
            uv = 304 * np.stack([u, -v], axis=1) + [320, 240] + rng.normal(0, 0.006, (63, 2))
            keep = np.flatnonzero((np.abs(uv - [320, 240]) < [315, 235]).all(axis=1) & (rng.random(63) > 0.1))
            none, n = np.full((len(keep), 2), np.nan), len(keep)
            cov = np.tile(np.eye(2) * 0.004**2, (n, 1, 1))
            images.append(TargetSet("", row[keep], col[keep], uv[keep], cov, none, none, none, np.full(n, 12.0)))
        solved = solve_turns(images, [(SAME, *symmetries(field))] * 4, field, [True] * 4)
        overruled += sum(s.choice != 0 for s in solved)
    assert overruled == 0


def test_picks_half_turned_against_the_others_are_found(board):
    rng = np.random.default_rng(4)
    made = as_made(board, rng, 0.05)
    images = [image_of(made, board, rng) for _ in range(7)]
    named = [relabelled(i, HALF, board) if k in (0, 4) else i for k, i in enumerate(images)]
    solved = solve_turns(named, [(SAME, HALF)] * 7, board, [True] * 7)
    assert [s.choice for s in solved] == [1, 0, 0, 0, 1, 0, 0]  # told against what most picks say
    assert all(np.array_equal(s.targets.row, i.row) for s, i in zip(solved, images, strict=True))


def test_a_square_board_has_three_other_turns(board):
    row, col = (x.ravel() for x in np.mgrid[0:7, 0:7])
    field = Testfield(row, col, np.stack([10.0 * col, -10.0 * row, 0 * row], axis=1), np.full(49, 4.0))
    assert len(symmetries(field)) == 3
    mirrored_only = replace(field, xyz_mm=field.xyz_mm + (col == 0)[:, None] * [-4.0, 0, 0])
    assert symmetries(mirrored_only) == ()


def undecoded(monkeypatch, recognised, kept):
    """Let captures without frames be measured by a function, those that are kept not again."""
    monkeypatch.setattr(measure, "measured_or_why", recognised)
    monkeypatch.setattr(decode, "from_phase_maps", lambda _p, due, what, _: [(c, what(c, None)) for c in due])
    monkeypatch.setattr(measure, "signs_of", lambda _project, captures, _sides: {c.path: c.name for c in captures})
    monkeypatch.setattr(measure, "kept_targets", lambda _project: tuple(kept))


def test_all_cameras_name_a_board_alike(board, monkeypatch):
    """Two cameras see the same board, and nobody picked: one whole turn for both, not one for each."""
    rng = np.random.default_rng(6)
    made = as_made(board, rng, 0.05)
    frames = tuple(Frame(Path("f.png"), White(), camera) for camera in ("left", "right"))
    captures = [Capture(Path(f"b{k}"), "testfield", frames, testfield=board) for k in range(5)]
    truth = {}

    def recognised(capture, *_):
        image = replace(image_of(made, board, rng), capture=capture.name, camera=capture.camera)
        truth[capture.name, capture.camera] = image
        turned = (int(capture.name[1:]) % 2 == 0) == (capture.camera == "left")
        return relabelled(image, HALF, board) if turned else image, (SAME, HALF), None

    undecoded(monkeypatch, recognised, ())
    told = measure.measured_targets(None, captures)
    assert len(told) == 10
    right = {np.array_equal(t.row, truth[t.capture, t.camera].row) for t in told}
    assert len(right) == 1, "all as they are, or all half a turn round"


def at_positions(made, field, shift, sigma_px=0.01):
    """Views of a plate that is shifted along its axis, which leans, and never turned: true labels."""
    images = []
    for k, z in enumerate(shift):
        x, y, away = (made + np.array([0.1 * z, -0.2 * z, z])).T
        rng, n = np.random.default_rng(100 + k), len(made)
        uv = 374 + 1500 * np.stack([x, -y], axis=1) / (600 - away)[:, None] + rng.normal(0, sigma_px, (n, 2))
        none, cov = np.full((n, 2), np.nan), np.tile(np.eye(2) * sigma_px**2, (n, 1, 1))
        images.append(TargetSet("", field.row, field.col, uv, cov, none, none, none, np.full(n, 12.0)))
    return images


@pytest.mark.parametrize(("role", "off_mm", "told"), [("depth", 0.0, 4), ("depth", 0.05, 4), ("testfield", 0.0, 0)])
def test_a_plate_is_shifted_and_not_turned(board, monkeypatch, role, off_mm, told):
    """An exact plate looks the same half a turn round; its positions are named alike all the same."""
    made = as_made(board, np.random.default_rng(8), off_mm)
    images = dict(zip("abcd", at_positions(made, board, (-60.0, -20, 20, 60)), strict=True))
    captures = [
        Capture(Path(name), role, (Frame(Path("f.png"), White()),), testfield=board, z_mm=10.0 * k)
        for k, name in enumerate(images)
    ]

    def recognised(capture, *_):
        image = replace(images[capture.name], capture=capture.name)
        return relabelled(image, HALF, board) if capture.name in "bd" else image, (SAME, HALF), None

    undecoded(monkeypatch, recognised, ())
    found = [t for t in measure.measured_targets(None, captures) if len(t.row)]
    assert len(found) == told
    turned = {np.array_equal(t.row, images[t.capture].row) for t in found}
    assert len(turned) == min(told, 1), "all as they are, or all half a turn round"


def test_a_turn_that_the_image_tells_is_kept(board, monkeypatch, tmp_path):
    """A chessboard's dark corner tells its turn; measured again from what is kept, it is told as before."""
    rng = np.random.default_rng(7)
    captures = [
        Capture(Path(f"b{k}"), "testfield", (Frame(Path("f.png"), White()),), testfield=board) for k in range(3)
    ]
    kept, due = [], []

    def recognised(capture, *_):
        due.append(capture.name)
        image = replace(image_of(board.xyz_mm, board, rng), told=True)  # as regular as its drawing
        return replace(image, capture=capture.name), (SAME,), None

    undecoded(monkeypatch, recognised, kept)
    counts = []
    for _ in range(3):
        archive = tmp_path / "targets.npz"
        save_archive(archive, tuple(measure.measured_targets(None, captures)))
        kept[:] = load_archive(archive, tuple, TargetSet)
        counts.append([len(t.row) for t in kept])
    assert due == ["b0", "b1", "b2"]
    assert min(counts[0]) > 0
    assert counts[1] == counts[2] == counts[0]


def shifted(targets, by, field):
    """All labellings by so many columns, either way up, that the board allows."""
    ways = [(((1, 0), (0, 1)), (0, c)) for c in by] + [(HALF[0], (ROWS - 1, COLS - 1 - c)) for c in by]
    return tuple(way for way in ways if relabelled(targets, way, field) is not None)


@pytest.mark.parametrize("whole", [4, 0])
def test_columns_that_one_image_cannot_tell_follow_from_images_that_see_the_whole_board(board, whole):
    rng = np.random.default_rng(12)
    made = as_made(board, rng, 0.05)
    seen = [image_of(made, board, rng, hidden=0.0) for _ in range(8)]
    named, offered = [], []
    for k, image in enumerate(seen):
        if k >= whole:  # its first four columns are hidden, or others, it may be
            keep = image.col >= 4
            seen[k] = image = replace(
                image, **{f: getattr(image, f)[keep] for f in ("row", "col", "camera_uv", "camera_cov")}
            )
        by = (-k % 5,) if k >= whole else (0,)
        named.append(replace(image, col=image.col - by[0]))
        offered.append(shifted(named[-1], range(-4, 5) if k >= whole else (0,), board))
    solved = solve_turns(named, offered, board)
    assert [len(of) for of in offered] == [2] * whole + [10] * (8 - whole)
    assert all(s.told for s in solved) == (whole > 0)
    named_right = [
        [np.array_equal(t.col, image.col) for t in (s.targets, relabelled(s.targets, HALF, board))]
        for s, image in zip(solved, seen, strict=True)
    ]
    assert np.array(named_right).all(axis=0).any() == (whole > 0)  # the whole board's turn is free
