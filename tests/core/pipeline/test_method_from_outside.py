"""A third method of calibration, added by one assignment, goes the whole road from the command line."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from core.cli import main
from core.model import DeviceSpec, LeftOut, PointCloud, Verdict
from core.pipeline import METHODS, Calibrated, CalibrationMethod, phase_maps


@dataclass(frozen=True)
class PlaneLookup:
    """The depth as one polynomial of pixel and projector column for the whole image: what few would calibrate by."""

    spec: DeviceSpec
    coefficients: np.ndarray
    rms_mm: float
    warnings: tuple[str, ...] = ()
    verdict: Verdict | None = None
    left_out: tuple[LeftOut, ...] = ()


def terms(u: np.ndarray, v: np.ndarray, lines: np.ndarray) -> np.ndarray:
    """All products up to the third degree."""
    x, y, w = (u - 370) / 370, (v - 290) / 290, (lines - 320) / 320
    powers = [(i, j, k) for i in range(4) for j in range(4 - i) for k in range(4 - i - j)]
    return np.stack([x**i * y**j * w**k for i, j, k in powers], axis=-1)


def calibrate(project, captures, options, progress):
    rows, depths = [], []
    for capture, phase in phase_maps(project, captures, progress):
        v, u = np.nonzero(np.isfinite(phase.u))
        keep = slice(None, None, 97)
        rows.append(terms(u[keep], v[keep], phase.u[v[keep], u[keep]].astype(float)))
        depths.append(np.full(len(rows[-1]), capture.z_mm))
    A, z = np.concatenate(rows), np.concatenate(depths)
    x = np.linalg.lstsq(A, z, rcond=None)[0]
    return Calibrated(PlaneLookup(project.camera, x, float(np.sqrt(np.mean((A @ x - z) ** 2)))))


def reconstruct(phase, calibration, extrapolate, progress):
    """Points over the plate: pixels as millimetres, so that only the depth means anything."""
    v, u = np.mgrid[0 : phase.u.shape[0], 0 : phase.u.shape[1]]
    z = terms(u, v, phase.u.astype(float)) @ calibration.coefficients
    xyz = np.stack([0.5 * u, -0.5 * v, z - 700], axis=-1)
    return PointCloud(np.where(np.isfinite(z)[..., None], xyz, np.nan).astype(np.float32))


LOOKUP = CalibrationMethod(
    title="plane look-up",
    result=PlaneLookup,
    roles=("depth",),
    none=("no plate", "capture a plate"),
    calibrate=calibrate,
    reconstruct=reconstruct,
    figures=lambda calibration: {"rms_mm": calibration.rms_mm},
    devices=lambda project, calibration: [("camera", project.camera, calibration.spec)],
    least=2,
    reused=True,
    outside="no column decoded",
)


def run(*words: object) -> None:
    assert main([str(word) for word in words]) == 0


def test_a_method_from_outside_is_calibrated_reconstructed_evaluated_and_reported(
    calibrated: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(METHODS, "lookup", LOOKUP)
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
