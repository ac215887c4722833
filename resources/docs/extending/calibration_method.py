"""
A calibration method
====================

This method describes depth by one polynomial of pixel and projector column for the whole image. Few would calibrate
this way, but it takes part in every stage. Its record makes it known to ``calibrate --method``, kept runs, states,
evaluation and report.
"""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from core.model import DeviceSpec, LeftOut, PointCloud, Verdict
from core.pipeline import (
    METHODS,
    Calibrated,
    CalibrationMethod,
    calibrate_project,
    reconstruct_capture,
    simulate_project,
)
from core.pipeline.decode import phase_maps
from core.pipeline.folders import captures_of


@dataclass(frozen=True)
class PlaneLookup:
    """The result; every calibration has the last three fields."""

    spec: DeviceSpec
    coefficients: np.ndarray
    rms_mm: float
    warnings: tuple[str, ...] = ()
    verdict: Verdict | None = None
    left_out: tuple[LeftOut, ...] = ()


def terms(u, v, lines):
    """Give all products up to the third degree."""
    x, y, w = u / 160 - 1, v / 120 - 1, lines / 80 - 1
    return np.stack([x**i * y**j * w**k for i in range(4) for j in range(4 - i) for k in range(4 - i - j)], axis=-1)


def calibrate(project, captures, options, progress):
    """Fit the polynomial to plates at known positions."""
    rows, depths = [], []
    for capture, phase in phase_maps(project, captures, progress):
        v, u = (a[::97] for a in np.nonzero(np.isfinite(phase.u)))
        rows.append(terms(u, v, phase.u[v, u].astype(float)))
        depths.append(np.full(len(u), capture.z_mm))
    A, z = np.concatenate(rows), np.concatenate(depths)
    x = np.linalg.lstsq(A, z, rcond=None)[0]
    return Calibrated(PlaneLookup(project.camera, x, float(np.sqrt(np.mean((A @ x - z) ** 2)))))


def reconstruct(phase, calibration, extrapolate, progress):
    """Give points; only their depth means anything here."""
    v, u = np.indices(phase.u.shape)
    z = terms(u, v, phase.u.astype(float)) @ calibration.coefficients
    xyz = np.stack([0.5 * u, -0.5 * v, z - 700], axis=-1)
    return PointCloud(np.where(np.isfinite(z)[..., None], xyz, np.nan).astype(np.float32))


METHODS["lookup"] = CalibrationMethod(
    title="plane look-up",
    result=PlaneLookup,
    roles=("depth",),
    none=("no plate", "capture a plate at known positions"),
    calibrate=calibrate,
    reconstruct=reconstruct,
    figures=lambda calibration: {"rms_mm": calibration.rms_mm},
    devices=lambda project, calibration: [("camera", project.camera, calibration.spec)],
    least=2,
)

# %%
# All stages on a project of the virtual bench.
project = simulate_project(Path(tempfile.mkdtemp()) / "quick", "quick")
found = calibrate_project(project, "lookup")["lookup"]
print(f"r.m.s. at the plates {found.rms_mm:.2f} mm; verdict: {found.verdict.state}")
plane = captures_of(project, "plane")[0]
_, cloud = reconstruct_capture(project, plane.name, "lookup")

plt.imshow(cloud.xyz_mm[..., 2])
plt.title(f"depth of {plane.name} by the look-up")
plt.colorbar(label="mm")
plt.show()
