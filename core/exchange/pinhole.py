"""A camera and a projector as most programs describe them: pinholes with radial and decentring distortion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from core.errors import InputError
from core.geometry import Pose, calibration_of_pair, pixel_to_image, ray_directions
from core.geometry.lens import fitted
from core.model import (
    AdjustedDevice,
    Array,
    DeviceSpec,
    Interior,
    PhotogrammetricCalibration,
    Verdict,
)

DISTORTION = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")  # in OpenCV's order
LIMIT_PX = 0.1  # r.m.s. that a fit may leave: what centroids of targets are measured to at worst
SAME_PX = 0.005  # r.m.s. below which our own lens model says the same
GRID = 28  # places along each side of the image
FLIP = np.diag([1.0, -1.0, -1.0])
MODEL = "brown"


@dataclass(frozen=True)
class Pinhole:
    """A device in OpenCV's model and axes; pixels count from the centre of the top-left one.

    `distortion` holds k1, k2, p1, p2, k3, k4, k5, k6; `rms_px` is what fitting ours to it left.
    """

    name: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = (0.0,) * 8
    rms_px: float = 0.0

    @property
    def matrix(self) -> Array:
        """The camera matrix, shape (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True)
class Pair:
    """Camera and projector, and the projector's pose from the camera's: ``X_p = R X_c + t``, OpenCV's axes, mm."""

    camera: Pinhole
    projector: Pinhole
    rotation: Array
    translation_mm: Array


def project_pinhole(p: Pinhole, tangents: Array) -> Array:
    """Pixel coordinates, (n, 2), of directions (X/Z, Y/Z), (n, 2)."""
    k1, k2, p1, p2, k3, k4, k5, k6 = p.distortion
    x, y = tangents[:, 0], tangents[:, 1]
    r2 = x * x + y * y
    d = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    xd = x * d + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    yd = y * d + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([p.fx * xd + p.cx, p.fy * yd + p.cy], axis=1)


def fit_pair(calibration: PhotogrammetricCalibration, free: Sequence[str]) -> Pair:
    """Say a calibration in this model with the distortion parameters that a format has.

    Raises
    ------
    InputError
        If the model cannot hold a device to `LIMIT_PX`.
    """
    pose = calibration.projector_from_camera
    return Pair(
        fit_device("camera", calibration.camera.spec, calibration.camera.interior, free),
        fit_device("projector", calibration.projector.spec, calibration.projector.interior, free),
        FLIP @ pose.rotation @ FLIP,
        FLIP @ pose.translation_mm,
    )


def fit_device(name: str, spec: DeviceSpec, interior: Interior, free: Sequence[str]) -> Pinhole:
    """Fit this model to a device over its whole image."""
    u, v = np.meshgrid(np.linspace(0, spec.width - 1, GRID), np.linspace(0, spec.height - 1, GRID))
    uv = np.stack([u.ravel(), v.ravel()], axis=1)
    rays = ray_directions(spec, interior, uv)
    use = np.isfinite(rays).all(axis=1)
    uv, tangents = uv[use], rays[use, :2] * (1.0, -1.0)
    chosen = [DISTORTION.index(n) for n in free]
    scale = np.array([spec.width, spec.width, spec.width, spec.width, *[1.0] * len(chosen)])

    def made(x: Array) -> Pinhole:
        k = np.zeros(8)
        k[chosen] = x[4:]
        fx, fy, cx, cy = x[:4] * scale[:4]
        return Pinhole(name, spec.width, spec.height, fx, fy, cx, cy, tuple(k.tolist()))

    c = interior.c_mm / np.array(spec.pitch_mm)
    start = np.array([*c, (spec.width - 1) / 2, (spec.height - 1) / 2]) / scale[:4]
    found = least_squares(
        lambda x: (project_pinhole(made(x), tangents) - uv).ravel(),
        np.concatenate([start, np.zeros(len(chosen))]),
        x_scale="jac",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
    )
    off = np.hypot(*found.fun.reshape(-1, 2).T)
    rms = float(np.sqrt(np.mean(off**2)))
    if not rms <= LIMIT_PX:
        raise InputError(
            f"{name} of the calibration",
            f"with {', '.join(free) or 'no distortion'} alone it is off by {rms:.3g} px r.m.s., more than {LIMIT_PX:g}",
            "choose a format with more distortion parameters, such as opencv",
        )
    return replace(_plain(made(found.x)), rms_px=rms)


def _plain(p: Pinhole) -> Pinhole:
    return replace(p, fx=float(p.fx), fy=float(p.fy), cx=float(p.cx), cy=float(p.cy))


def device_from(p: Pinhole, spec: DeviceSpec) -> AdjustedDevice:
    """Make a device of the project's raster from this model; nothing is known of its sigmas.

    The program's own lens model is taken where it says the same to `SAME_PX`, else that of OpenCV.
    """
    if (p.width, p.height) != (spec.width, spec.height):
        raise InputError(
            f"{p.name} of the calibration",
            f"is {p.width} x {p.height}, the one in project.json has {spec.width} x {spec.height}",
            "import it into a project of the same devices",
        )
    c = p.fy * spec.pitch_mm[1]
    b1 = p.fx * spec.pitch_mm[0] / c - 1
    x0, y0 = pixel_to_image(spec, [p.cx, p.cy])
    interior = Interior(float(c), float(x0), float(y0), (*p.distortion, float(b1)), spec.zero_radius_mm, MODEL)
    own, rms_px = fitted(spec, interior, "A1..A6")
    if rms_px <= SAME_PX:
        interior = own
    spec = (
        replace(spec, interior=None, interior_sigma=())
        if interior.model == "A1..A6"
        else replace(spec, interior=interior, interior_sigma=())
    )
    return AdjustedDevice(spec, interior, np.zeros(len(interior.vector)), (0.0, 0.0), 0)


def pair_to_calibration(
    pair: Pair, camera: DeviceSpec, projector: DeviceSpec, source: str
) -> PhotogrammetricCalibration:
    """Make a calibration of this program's from a pair that another one calibrated."""
    devices = device_from(pair.camera, camera), device_from(pair.projector, projector)
    size = sum(len(d.interior.vector) for d in devices) + 6
    R = FLIP @ pair.rotation @ FLIP
    if not (np.isfinite(R).all() and np.abs(R @ R.T - np.eye(3)).max() < 1e-4 and np.linalg.det(R) > 0):
        raise InputError(source, "the rotation from camera to projector is none", "export it again")
    U, _, Vt = np.linalg.svd(R)
    return calibration_of_pair(
        camera=devices[0],
        projector=devices[1],
        projector_from_camera=Pose(U @ Vt, FLIP @ np.asarray(pair.translation_mm, float)),
        covariance=np.zeros((size, size)),
        sigma0=1.0,
        stations=0,
        image_points=0,
        object_points=0,
        redundancy=0,
        object_sigma_rms_um=(0.0, 0.0, 0.0),
        verdict=Verdict("doubtful", (f"imported from {source}: its sigmas are not known, judge it by a plane",)),
    )
