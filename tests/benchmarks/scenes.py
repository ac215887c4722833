"""What is decoded and intersected in the benchmarks: frames, rigs and phase maps with known truth, of any size."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from core.bench import experiment
from core.geometry import project, ray_directions
from core.model import (
    AdjustedDevice,
    DeviceSpec,
    PhaseMap,
    PhotogrammetricCalibration,
)
from core.patterns import Pattern, Phase, brightness
from tests.benchmarks.timing import EFFORT
from tests.calibrated import calibration_of_pair

LINES = 640
SIZES = {"748x576": (748, 576), "1280x1024": (1280, 1024), "2448x2048": (2448, 2048)}
_FINE = 16  # samples per line of the blurred profiles
AMBIENT = 35.0  # grey value of the room's light


def sizes() -> dict[str, tuple[int, int]]:
    """Give the image sizes to measure at: all, or the smallest alone in a quick run."""
    return dict(list(SIZES.items())[:1]) if EFFORT.quick else SIZES


@dataclass(frozen=True)
class Frames:
    """A capture in memory and the projector coordinates it was made from."""

    patterns: list[Pattern]
    images: list[np.ndarray]
    u: np.ndarray
    v: np.ndarray

    @property
    def nbytes(self) -> int:
        return sum(image.nbytes for image in self.images)


def frames(
    patterns: Sequence[Pattern],
    width: int,
    height: int,
    seed: int = 0,
    places: tuple[np.ndarray, np.ndarray] | None = None,
) -> Frames:
    """8-bit frames: modulation 25 grey values about 60, noise 2, the published figures.

    Without the projector coordinates `places` of all pixels, those of a slanted plane that fills the image. Beyond the
    projector's lines only the room's light is seen.
    """
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    u = 6 + (LINES - 14) * x / width + np.float32(3) * y / height
    v = 6 + (LINES - 14) * y / height + np.float32(3) * x / width
    u, v = places or (u, v)
    lit = np.logical_and.reduce([(a > -0.5) & (a < LINES - 0.5) for a in (u, v)])
    rng = np.random.default_rng(seed)
    noise = rng.normal(0, 2, u.size + 4096).astype(np.float32)
    images = []
    for pattern in patterns:
        place = v if getattr(pattern, "axis", "x") == "y" else u
        at = np.rint((np.clip(place, 0, LINES - 1) + 0.5) * _FINE).astype(np.int32)
        start = int(rng.integers(4096))
        grey = np.where(lit, _profile(pattern)[at], np.float32(AMBIENT)) + noise[start : start + u.size].reshape(
            u.shape
        )
        images.append(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
    return Frames(list(patterns), images, u, v)


def _profile(pattern: Pattern) -> np.ndarray:
    """Grey values along the projector's lines, slightly out of focus; index 16 for each line."""
    sharp = np.repeat(brightness(pattern, np.arange(-8, LINES + 8)), _FINE)
    kernel = np.hanning(2 * _FINE + 1)
    soft = np.convolve(sharp, kernel / kernel.sum(), mode="same")[8 * _FINE : -8 * _FINE]
    contrast = 50.0
    if isinstance(pattern, Phase) and pattern.profile == "square":
        # the lens passes the first harmonic of a period of 4 lines and little else
        line = np.arange(len(soft)) / _FINE
        soft = 0.5 + 0.5 * np.cos(2 * np.pi * line / pattern.period - pattern.shift_rad)
    return (AMBIENT + contrast * np.append(soft, [soft[-1]] * _FINE)).astype(np.float32)


def rig(width: int, height: int) -> PhotogrammetricCalibration:
    """The reference rig, its camera's sensor divided into as many pixels as asked."""
    e = experiment("paper").rig
    pitch = (e.camera.width * e.camera.pitch_mm[0] / width, e.camera.height * e.camera.pitch_mm[1] / height)
    camera = DeviceSpec(width, height, pitch, e.camera.nominal_c_mm)
    inner = replace(e.camera_interior, r0_mm=e.camera_interior.r0_mm)
    devices = [
        AdjustedDevice(spec, o, np.zeros(9), (0.0, 0.0), 0)
        for spec, o in ((camera, inner), (e.projector, e.projector_interior))
    ]
    covariance = np.diag(np.r_[[1e-6] * 3, [1e-12] * 6, [1e-4] * 3, [1e-14] * 6, [1e-10] * 3, [1e-4] * 3])
    counts = {"stations": 40, "image_points": 6656, "object_points": 247, "redundancy": 12000}
    return calibration_of_pair(
        *devices, e.projector_from_camera, covariance, **counts, object_sigma_rms_um=(1.0, 1.0, 1.0)
    )


def pixels(spec: DeviceSpec) -> np.ndarray:
    """(H, W, 2) pixel coordinates of all pixels."""
    return np.stack(np.meshgrid(np.arange(spec.width), np.arange(spec.height)), axis=-1).astype(float)


def plane_points(calibration: PhotogrammetricCalibration, z_mm: float = -600.0) -> np.ndarray:
    """(H, W, 3) points where the camera's rays meet a slanted plane."""
    rays = ray_directions(calibration.camera.spec, calibration.camera.interior, pixels(calibration.camera.spec))
    normal = np.array([0.1, -0.2, 1.0])
    return rays * (z_mm / (rays @ normal))[..., None]


def phase_of(calibration: PhotogrammetricCalibration, points: np.ndarray) -> PhaseMap:
    """The phase map of points, without noise; sigma 0.03 lines."""
    c = calibration
    uv = project(c.projector.spec, c.projector.interior, points, c.projector_from_camera)
    u, v = (np.ascontiguousarray(uv[..., i], np.float32) for i in (0, 1))
    sigma = np.full(u.shape, 0.03, np.float32)
    grey = np.full(u.shape, 60, np.float32)
    return PhaseMap(u, v, sigma, sigma.copy(), grey, grey, np.zeros(u.shape, np.uint8))
