"""A third method of calibration, added by one assignment, goes the whole road from the command line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from core.cli import main
from core.pipeline import METHODS


def run(*words: object) -> None:
    assert main([str(word) for word in words]) == 0


@pytest.mark.usefixtures("plain_reports")
def test_a_method_from_outside_is_calibrated_reconstructed_evaluated_and_reported(
    calibrated: Path, tmp_path: Path, extension
) -> None:
    extension("calibration_method", METHODS)
    out = tmp_path / "figures.json"
    run("calibrate", calibrated, "--method", "lookup", "--without", "depth-01", "--json", out)
    figures = json.loads(out.read_text())["lookup"]
    # the plates stand where z_mm says: what the polynomial cannot follow is left, of 100 mm that they span
    assert figures["rms_mm"] < 3
    assert figures["verdict"]["state"] in ("passed", "doubtful")
    assert {"capture": "depth-01", "points": 0, "of": 0, "because": "left out by choice"} in figures["left_out"]
    plane = next(iter(sorted(p.name for p in (calibrated / "captures").glob("plane*"))))
    run("reconstruct", calibrated, plane, "--method", "lookup", "--out", tmp_path / "points.npz")
    with np.load(tmp_path / "points.npz") as stored:
        assert np.isfinite(stored["xyz"]).any()
    run("evaluate", calibrated, "--json", out)
    planes = json.loads(out.read_text())["planes"]
    assert {p["method"] for p in planes} == {"photogrammetric", "polynomial", "lookup"}
    run("report", calibrated, "--out", tmp_path / "report")
    page = (tmp_path / "report" / "report.html").read_text()
    assert "lookup" in page
    assert "plane look-up" in page.lower()
    run("status", calibrated, "--json", out)
    assert json.loads(out.read_text())["stages"]["evaluate"]["state"] == "current"


def test_an_unknown_method_is_refused_with_those_known(calibrated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["calibrate", calibrated], ["reconstruct", calibrated, "plane+00", "--out", "x.npz"]):
        assert main([*map(str, words), "--method", "magic"]) == 2
        told = capsys.readouterr().err
        assert "magic" in told
        assert "photogrammetric, polynomial" in told
