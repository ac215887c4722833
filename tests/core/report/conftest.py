"""A small experiment with known numbers: 4 poses of a rigid rig, 12 points, two planes by two methods."""

from pathlib import Path

import numpy as np
import pytest

from core.geometry import LENSES, Pose, matrix_from_axis_angle
from core.model import (
    AdjustedDevice,
    Adjustment,
    DepthCalibration,
    DeviceSpec,
    Interior,
    Network,
    NetworkDevice,
    PlaneEvaluation,
    Project,
    Rig,
    ScaleBar,
)
from core.report import ReportData
from tests.calibrated import calibration_of_pair

CAMERA = DeviceSpec(748, 576, (0.008, 0.008), 12.0)
PROJECTOR = DeviceSpec(640, 640, (0.09, 0.09), 182.0)
CAMERA_INTERIOR = Interior(12.1, -0.08, -0.11, (-6e-4, 3e-6, -0.0143, 3e-5, -1.2e-4, -7.6e-5), 2.5)
PROJECTOR_INTERIOR = Interior(181.9, 1.2, 0.33, (5.5e-7, -2.7e-10, 2e-4, 1.3e-4, 2e-6, 9.8e-6), 27.0)
CAMERA_SIGMA = np.array([2e-3, 1e-3, 1e-3, 5e-6, 5e-7, 4e-6, 4e-6, 3e-6, 3e-6])
PROJECTOR_SIGMA = np.array([0.1, 0.05, 0.05, 2e-8, 5e-11, 6e-6, 6e-6, 3e-7, 0.0])  # A6 held fixed


@pytest.fixture
def project():
    scale = ScaleBar((0, 0), (12, 18), 258.6, 0.005)
    captures = (Path("captures/a"), Path("captures/b"))
    return Project(
        Path("/projects/rig"),
        "Reference rig",
        Rig({"camera": CAMERA}, {"projector": PROJECTOR}),
        scale,
        captures,
        "brenner1999",
    )


@pytest.fixture
def adjustment():
    rng = np.random.default_rng(1)
    stations = [(pose, device) for pose in range(4) for device in ("camera", "projector")]
    points = np.array([[x, y, 0.0] for x in (-90, -30, 30, 90) for y in (-60, 0, 60)])
    station, point = (a.ravel() for a in np.mgrid[: len(stations), : len(points)])
    uv = rng.uniform(20, 550, (len(station), 2))
    residuals = rng.normal(0, 0.05, uv.shape)
    names = tuple(f"{d}.{n}" for d in ("camera", "projector") for n in LENSES["A1..A6"].names)
    names += tuple(f"projector.{n}" for n in ("rx", "ry", "rz", "tx", "ty", "tz"))
    sigma = np.concatenate([CAMERA_SIGMA, PROJECTOR_SIGMA, np.full(3, 2e-4), np.full(3, 0.05)])
    correlation = np.eye(24)
    correlation[1, 8] = correlation[8, 1] = -0.96
    turns = [matrix_from_axis_angle([np.cos(k), np.sin(k), 0], 0.5) for k in range(4)]
    poses = [Pose(turns[k] if d == "camera" else turns[k].T, np.array([0.0, 0, -600])) for k, d in stations]
    network = Network(
        {"camera": NetworkDevice(CAMERA), "projector": NetworkDevice(PROJECTOR)},
        tuple(f"{k}{d[0]}" for k, d in stations),
        tuple(d for _, d in stations),
        tuple(k for k, _ in stations),
        tuple(f"p{i}" for i in range(len(points))),
        points,
        station,
        point,
        uv,
        np.full(uv.shape, 0.05),
    )
    return Adjustment(
        network=network,
        devices={
            "camera": AdjustedDevice(CAMERA, CAMERA_INTERIOR, CAMERA_SIGMA, (0.28, 0.24), 48),
            "projector": AdjustedDevice(PROJECTOR, PROJECTOR_INTERIOR, PROJECTOR_SIGMA, (7.66, 9.9), 48),
        },
        station_from_object=tuple(poses),
        relative={"projector": Pose(np.eye(3), np.array([-250.0, 0, 0]))},
        points_mm=points,
        point_cov_mm2=np.tile(np.diag([0.008, 0.006, 0.020]) ** 2, (len(points), 1, 1)),
        residuals=residuals,
        redundancy_numbers=np.full(uv.shape, 0.7),
        sigma0=1.05,
        redundancy=117,
        iterations=5,
        convergence=(4.0e6, 2.1e4, 150.0, 129.3, 129.0),
        variance_factors={"camera": 1.1, "projector": 0.9},
        parameter_names=names,
        parameter_cov=correlation * np.outer(sigma, sigma),
        warnings=("no images rolled by 90°: A3 and x0 are weak",),
    )


@pytest.fixture
def photogrammetric(adjustment):
    tilt = Pose(matrix_from_axis_angle([0, 1, 0], np.radians(25)), np.array([-240.0, 0, -70.0]))
    covariance = np.zeros((24, 24))
    covariance[21:, 21:] = np.eye(3) * 0.05**2
    return calibration_of_pair(
        camera=adjustment.devices["camera"],
        projector=adjustment.devices["projector"],
        projector_from_camera=tilt,
        covariance=covariance,
        sigma0=1.05,
        stations=8,
        image_points=96,
        object_points=12,
        redundancy=117,
        object_sigma_rms_um=(8.0, 6.0, 20.0),
        warnings=adjustment.warnings,
    )


@pytest.fixture
def depth():
    empty = np.zeros((1, 2, 2), np.float32)
    depths = np.linspace(-50.0, 50.0, 11)
    interior, pose, axis = CAMERA_INTERIOR, Pose(), np.array([0.0, 0.0, 1.0])
    return DepthCalibration("u", depths, 3, empty, empty, 0.0312, 215424, CAMERA, interior, pose, axis, ("sparse",))


@pytest.fixture
def evaluations():
    rng = np.random.default_rng(2)
    rows = []
    for capture, angle in (("plane+00", 0.0), ("plane-15", -15.0)):
        for method, rms in (("photogrammetric", 0.03), ("polynomial", 0.05)):
            deviation = rng.normal(0, rms, (30, 40)).astype(np.float32)
            deviation[:3] = np.nan
            d = deviation[np.isfinite(deviation)]
            excluded = 7 if (capture, method) == ("plane-15", "polynomial") else 0
            rows.append(
                PlaneEvaluation(
                    capture=capture,
                    angle_deg=angle,
                    method=method,
                    n=d.size,
                    rms_mm=float(np.sqrt(np.mean(d**2))),
                    max_mm=float(np.abs(d).max()),
                    min_mm=float(d.min()),
                    predicted_rms_mm=0.03 if method == "photogrammetric" else None,
                    excluded=excluded,
                    excluded_rule="outside the calibrated depths" if excluded else "",
                    plane=np.array([0.0, 0.0, 1.0, -600.0]),
                    deviation_mm=deviation,
                )
            )
    return tuple(rows)


@pytest.fixture
def truth():
    def entry(interior):
        keys = ("c_mm", "x0_mm", "y0_mm", "A1", "A2", "A3", "A4", "A5", "A6")
        return dict(zip(keys, map(float, interior.vector), strict=True)) | {"r0_mm": interior.r0_mm}

    camera = entry(CAMERA_INTERIOR) | {"c_mm": CAMERA_INTERIOR.c_mm - 3e-3}  # the value lies 1.5 sigma above the truth
    return {"format": "stripe-truth", "camera": camera, "projector": entry(PROJECTOR_INTERIOR)}


@pytest.fixture
def data(project, adjustment, photogrammetric, depth, evaluations, truth):
    return ReportData(
        project, adjustment, photogrammetric, depth, evaluations, truth, made_on="2026-11-21", made_by="stripe-core 1"
    )
