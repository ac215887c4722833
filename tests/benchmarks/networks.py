"""One synthetic network for all adjustments: what each of them can describe, its starting values and its judge.

Both devices are free of shear (A4 = 0), so that OpenCV's eight parameters (two focal lengths, principal point, k1, k2,
p1, p2) describe them exactly, and all image points weigh the same, because not every program knows weights. Object
points are compared with the truth after a similarity transformation: nobody is asked for the scale.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from core.geometry import LENSES, Pose, matrix_from_rotation_vector
from core.model import Network
from tests.core.calibrate.conftest import CAMERA_TRUTH, PROJECTOR_TRUTH, Simulated, simulated_network

SIGMA_PX = 0.02
TURN = np.diag([1.0, -1.0, -1.0])  # from X right, Y up, looking along -Z to OpenCV's axes


@dataclass(frozen=True)
class Task:
    """A network with its truth, and the same as arrays in OpenCV's convention for the others."""

    simulated: Simulated
    arrays: dict[str, np.ndarray]

    @property
    def network(self) -> Network:
        """What is adjusted."""
        return self.simulated.network


def task(poses: int) -> Task:
    """Simulate a board of 247 targets before camera and projector at `poses` free poses of each."""
    devices = [replace(t, a=(*t.a[:3], 0.0, *t.a[4:])) for t in (CAMERA_TRUTH, PROJECTOR_TRUTH)]
    simulated = simulated_network(
        poses=poses,
        rows=13,
        cols=19,
        rigid=False,
        scale=False,
        extent_mm=175.0,
        sigma_px={"camera": SIGMA_PX, "projector": SIGMA_PX},
        camera_truth=devices[0],
        projector_truth=devices[1],
        estimate=tuple(name for name in LENSES["A1..A6"].names if name != "A4"),
    )
    return Task(simulated, _arrays(simulated))


def _arrays(simulated: Simulated) -> dict[str, np.ndarray]:
    """Starting values: nominal points and cameras, poses off by half a degree and a few mm, as resections are."""
    n = simulated.network
    rng = np.random.default_rng(1)
    poses = [
        Pose(matrix_from_rotation_vector(rng.normal(0, 0.005, 3)) @ p.rotation, p.translation_mm + rng.normal(0, 2, 3))
        for p in simulated.stations
    ]
    names = list(n.devices)
    specs = [n.devices[name].spec for name in names]
    focal = [[s.nominal_c_mm / s.pitch_mm[0], s.nominal_c_mm / s.pitch_mm[1]] for s in specs]
    centre = [[(s.width - 1) / 2, (s.height - 1) / 2] for s in specs]
    return {
        "interior": np.hstack([focal, centre, np.zeros((len(specs), 4))]),
        "sizes": np.array([[s.width, s.height] for s in specs]),
        "rotation": np.array([TURN @ p.rotation for p in poses]),
        "shift": np.array([TURN @ p.translation_mm for p in poses]),
        "device": np.array([names.index(d) for d in n.station_device]),
        "points": n.point_xyz_mm,
        "station": n.observation_station,
        "point": n.observation_point,
        "uv": n.observation_uv,
    }


def judge(task: Task) -> Callable[[np.ndarray], str]:
    """Judge adjusted points by their r.m.s. deviation from the truth; the noise explains a little less than allowed.

    The free network's inverse gives 1.54 um r.m.s. for 40 stations, and every further station the same information.
    """
    truth = task.simulated.points_mm
    expected_um = 1.54 * np.sqrt(40 / len(task.network.station_names))

    def right(points: np.ndarray) -> str:
        error_um = 1e3 * np.sqrt(np.mean((similar(points, truth) - truth) ** 2))
        assert error_um < 1.2 * expected_um, f"points {error_um:.2f} um off, the noise explains {expected_um:.2f}"
        return f"points {error_um:.2f} um off (noise: {expected_um:.2f})"

    return right


def similar(points: np.ndarray, onto: np.ndarray) -> np.ndarray:
    """Rotate, shift and scale points, shape (n, 3), onto others by least squares (Umeyama 1991)."""
    a, b = points - points.mean(axis=0), onto - onto.mean(axis=0)
    U, s, Vt = np.linalg.svd(b.T @ a)
    sign = np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
    scale = np.trace(np.diag(s) @ sign) / np.sum(a**2)
    return scale * a @ (U @ sign @ Vt).T + onto.mean(axis=0)
