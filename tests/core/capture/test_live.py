"""Continuous capture to points on the virtual rig."""

import json
import time
from pathlib import Path
from signal import SIGINT, SIGTERM

import numpy as np
import pytest

from core.cli import main
from core.pipeline import live
from core.project import read_project

RIG = "virtual:quick?shot=plane%2B00"


def test_every_cycle_is_the_plane_that_stands_there(calibrated: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "points"
    arguments = ["live", str(calibrated), "--projector", RIG, "--camera", f"{RIG}&faults=stale-frame@40"]
    arguments += ["--count", "2", "--out", str(out), "--format", "npz", "--json", str(tmp_path / "f.json")]
    before = {p: p.read_bytes() for p in calibrated.rglob("*.json")}
    assert main(arguments) == 0
    first, second = json.loads((tmp_path / "f.json").read_text())["cycles"]
    assert capsys.readouterr().out.count("rig p = ") == 2
    assert (first["retakes"], second["retakes"]) == (0, 1)  # 30 shots a sequence: the fault is in the second
    assert 0 < first["p"] <= 1
    for cycle in (first, second):
        with np.load(out / f"{cycle['number']:04d}.npz") as stored:
            points = stored["xyz"].reshape(-1, 3)
        points = points[np.isfinite(points).all(axis=1)]
        assert len(points) == cycle["points"] > 10_000
        off = np.linalg.svd(points - points.mean(0), full_matrices=False)
        # the plate is flat: what its points keep from a plane is noise of the depths and the calibration
        assert off[1][2] / np.sqrt(len(points)) < 2 * cycle["sigma_depth_mm"]
    assert before == {p: p.read_bytes() for p in calibrated.rglob("*.json")}


@pytest.mark.parametrize(("number", "code"), [(SIGINT, 0), (SIGTERM, 143)])
def test_an_interruption_ends_it_and_keeps_what_is_there(
    number: int, code: int, calibrated: Path, monkeypatch, capsys
) -> None:
    """Ctrl+C is how an operator ends it; what else ends it says so, as every command does."""
    wait, calls = live._wait, []

    def interrupted(*arguments):
        calls.append(time.monotonic())
        if len(calls) == 2:
            raise KeyboardInterrupt(number)
        return wait(*arguments)

    monkeypatch.setattr(live, "_wait", interrupted)
    assert main(["live", str(calibrated), "--projector", RIG, "--camera", RIG]) == code
    assert time.monotonic() - calls[-1] < 2.0
    assert ("ended after 1 sequences" in capsys.readouterr().out) == (code == 0)


@pytest.mark.parametrize(
    ("options", "seen"), [(["--count", "-1"], "-1"), (["--format", "doc", "--out", "x"], "doc"), ([], "calibrat")]
)
def test_what_cannot_be_done_is_refused_before_anything_is_shown(
    quick: Path, calibrated: Path, options: list[str], seen: str, capsys, monkeypatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = calibrated if options else quick
    assert main(["live", str(folder), *options]) == 2
    assert seen in capsys.readouterr().err
    assert read_project(folder)
