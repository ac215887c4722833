"""Kinds of target and estimators of centres are added from outside; a board says which it has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.errors import InputError
from core.measure import ESTIMATORS, TARGET_KINDS, Marks, Sight, TargetKind, measure_targets, recognise
from core.model import DeviceSpec, PhaseMap, Seed, Testfield
from core.pipeline import measure_project
from core.pipeline.picking import guess_picks
from core.project import read_project, read_testfield, write_testfield

SIZE = DeviceSpec(200, 160, (0.01, 0.01), 12.0)


def crossings(seeds: Sequence[Seed], field: Testfield) -> np.ndarray:
    """Where a board seen straight on has its targets, by three picks."""
    index = field.index()
    A = np.column_stack([field.xyz_mm[[index[s.row, s.col] for s in seeds]][:, :2], np.ones(len(seeds))])
    linear = np.linalg.lstsq(A, [[s.u, s.v] for s in seeds], rcond=None)[0]
    return np.column_stack([field.xyz_mm[:, :2], np.ones(len(field.row))]) @ linear


def measure_bright(sight: Sight, seeds: Sequence[Seed]) -> Marks:
    """Take the brightest pixel within 4 px of each target's place: coarse, but nothing of the dots is in it."""
    uv = crossings(seeds, sight.testfield)
    v, u = np.mgrid[0 : sight.image.shape[0], 0 : sight.image.shape[1]]
    for k, at in enumerate(uv):
        near = np.hypot(u - at[0], v - at[1]) < 4
        best = np.argmax(np.where(near, sight.image, -np.inf))
        uv[k] = best % sight.image.shape[1], best // sight.image.shape[1]
    m = len(uv)
    use = np.array([k for k in range(m) if k not in sight.unwanted])
    area = np.broadcast_to(2.0 * np.eye(2), (len(use), 2, 2))
    one = np.ones(len(use))
    return Marks(use, uv[use], area / 24, area, one, one, 0 * uv[use], {}, ("coarse",))


def guess_corners(image, field, camera, known, side):
    """Four corners straight on, row 0 at the top: enough for a test."""
    v, u = np.nonzero(image > image.max() / 2)
    last = field.row.max(), field.col.max()
    corners = [(0, 0, u.min(), v.min()), (0, last[1], u.max(), v.min())]
    corners += [(last[0], last[1], u.max(), v.max()), (last[0], 0, u.min(), v.max())]
    return np.column_stack([u, v]).astype(float), (tuple(Seed(*map(int, c)) for c in corners),)


SPARKS = TargetKind("sparks", guess_corners, measure_bright, lambda image, field, uv, reach: uv, coded=True)


@pytest.fixture
def sparks(monkeypatch: pytest.MonkeyPatch) -> Testfield:
    monkeypatch.setitem(TARGET_KINDS, "sparks", SPARKS)
    row, col = (x.ravel() for x in np.mgrid[0:4, 0:5])
    xyz = np.column_stack([30.0 * col, -30.0 * row, 0.0 * row])
    return Testfield(row, col, xyz, np.full(20, 4.0), kind="sparks")


def image_of(field: Testfield) -> np.ndarray:
    image = np.full((SIZE.height, SIZE.width), 5, np.float32)
    image[30 + 30 * field.row, 40 + 30 * field.col] = 200
    return image


def test_a_kind_from_outside_is_measured_by_picks_and_by_its_own_guess(sparks: Testfield, bench) -> None:
    image = image_of(sparks)
    v, u = np.mgrid[0 : SIZE.height, 0 : SIZE.width]
    a, b = np.moveaxis(bench.true_projector(np.stack([u, v], axis=-1)), -1, 0).astype(np.float32)
    phase = PhaseMap(a, b, 0 * a + 0.03, 0 * a + 0.04, 0 * a + 50, image, np.zeros(image.shape, np.uint8))
    found, ways = recognise(phase, sparks, SIZE, excluded=((3, 4),))
    assert len(ways) == 1
    assert found.notes == ("coarse",)
    truth = np.column_stack([40 + 30 * sparks.col, 30 + 30 * sparks.row])[:-1]
    np.testing.assert_array_equal(found.camera_uv, truth)
    np.testing.assert_allclose(found.projector_uv, bench.true_projector(truth), atol=1e-4)
    assert [(m.row, m.col, m.reason) for m in found.missing] == [(3, 4, "excluded by the operator")]
    picked = [Seed(0, 0, 41, 31), Seed(0, 4, 159, 29), Seed(3, 4, 160, 121), Seed(3, 0, 39, 120)]
    np.testing.assert_array_equal(measure_targets(phase, sparks, picked, SIZE).camera_uv[:-1], truth)


def test_a_board_says_its_kind_and_keeps_it(sparks: Testfield, tmp_path: Path) -> None:
    write_testfield(tmp_path / "board.csv", sparks)
    assert "# kind: sparks" in (tmp_path / "board.csv").read_text()
    again = read_testfield(tmp_path / "board.csv")
    assert (again.kind, again.estimator, again.polarity) == ("sparks", "centroid", "white-on-black")


def comment(project: Path, text: str) -> None:
    path = project / "testfield.csv"
    path.write_text(f"# {text}\n{path.read_text()}")


@pytest.mark.parametrize("key", ["kind", "estimator"])
def test_an_unknown_name_is_refused_with_those_known(quick: Path, key: str) -> None:
    comment(quick, f"{key}: stars")
    known = {"kind": "dots", "estimator": "centroid"}[key]
    for work in (measure_project, guess_picks):
        for picks in quick.glob("captures/testfield-*/picks.json") if work is guess_picks else ():
            picks.unlink()
        with pytest.raises(InputError, match=rf"testfield\.csv: .*{key} of targets is 'stars'.*{known}"):
            work(read_project(quick))


def test_an_estimator_from_outside_gives_the_centres(bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """The middle of the contour, which the profiles hold: another estimator of the same ellipse's centre."""

    def middle(image, rays, profile, light, noise):
        uv = rays.centre + np.einsum("mij,mj->mi", rays.ellipse, profile.contour[:, 1:3])
        return uv, np.broadcast_to(0.02**2 * np.eye(2), (len(uv), 2, 2))

    monkeypatch.setitem(ESTIMATORS, "contour", middle)
    scene = bench.scene(bench.look(20.0, 30.0))
    field = replace(scene.field, estimator="contour")
    found = measure_targets(scene.phase(), field, scene.seeds(bench.corners), scene.spec)
    assert len(found.row) == 247
    _, error = bench.compare(found, scene)
    assert 0.001 < np.sqrt(np.mean(error**2)) < 0.02  # the sigma it claims; truth is the renderer's
