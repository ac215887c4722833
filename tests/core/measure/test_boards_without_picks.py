"""A project whose boards nobody picked, or picked wrongly: told capture by capture, and nothing stops."""

import json

import numpy as np
import pytest

from core.bench.scenarios import experiment
from core.bench.truth import true_targets
from core.errors import InputError
from core.pipeline import calibrate_project, measure_project
from core.project import read_project

E = experiment("quick", 3)


@pytest.fixture
def project(quick_original):
    return quick_original


def edit(project, capture, change):
    path = project / "captures" / capture / "picks.json"
    picks = json.loads(path.read_text())
    change(picks["seeds"])
    path.write_text(json.dumps(picks))


def names_off(targets):
    """How far the targets of every capture are from the true ones of their names, px; and of half-turned names."""
    result = {}
    for t in targets:
        if not len(t.row):
            continue
        true = true_targets(E.rig, E.shot(t.capture).scene)
        index = {key: k for k, key in enumerate(zip(true.row.tolist(), true.col.tolist(), strict=True))}
        last = true.row.max(), true.col.max()
        both = []
        for half in (False, True):
            keys = zip(*((last[0] - t.row, last[1] - t.col) if half else (t.row, t.col)), strict=True)
            at = [index[int(r), int(c)] for r, c in keys]
            both.append(float(np.abs(true.camera_uv[at] - t.camera_uv).max()))
        result[t.capture] = both
    return result


def test_all_boards_are_recognised_one_way_round_without_picks(quick):
    for picks in quick.glob("captures/*/picks.json"):
        picks.unlink()
    off = names_off(measure_project(read_project(quick)))
    assert len(off) == 13
    for role in ("testfield", "depth"):  # each board as a whole may be taken half a turn round
        both = np.array([v for k, v in off.items() if k.startswith(role)])
        assert (both.max(axis=0) < 0.5).sum() == 1


def test_one_half_turned_and_one_unrecognised_capture_are_told(quick):
    def half(seeds):
        for s in seeds:
            s["row"], s["col"] = 6 - s["row"], 8 - s["col"]

    edit(quick, "testfield-03", half)
    edit(quick, "testfield-05", lambda seeds: [s.update(u=2.0 + 30 * k, v=2.0) for k, s in enumerate(seeds[:2])])
    targets = {t.capture: t for t in measure_project(read_project(quick))}
    assert all(straight < 0.5 for straight, _ in names_off(targets.values()).values())
    assert any("turned against the other images" in note for note in targets["testfield-03"].notes)
    assert not len(targets["testfield-05"].row)
    assert "no dot of the expected size" in targets["testfield-05"].missing[0].reason
    assert not targets["testfield-04"].notes


def test_a_pick_beside_any_dot_is_told_and_stops_neither_method(calibrated):
    def off(seeds):
        seeds[0].update(u=2.0, v=2.0)

    edit(calibrated, "depth-02", off)
    done = calibrate_project(read_project(calibrated))
    assert set(done) == {"photogrammetric", "polynomial"}
    told = [*done["polynomial"].warnings, *(x.because for x in done["polynomial"].left_out)]
    assert any("pick 1" in text for text in told)


def test_where_nothing_is_recognised_the_reason_is_an_error(quick):
    for capture in sorted(quick.glob("captures/*/picks.json")):
        edit(quick, capture.parent.name, lambda seeds: [s.update(col=40) for s in seeds])
    with pytest.raises(InputError, match="not in the testfield"):
        measure_project(read_project(quick))
