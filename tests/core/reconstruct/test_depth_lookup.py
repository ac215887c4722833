"""The depth look-up on curves that are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from core.errors import InputError
from core.geometry import Pose, matrix_from_rotation_vector
from core.model import DepthCalibration, DeviceSpec, Interior, PhaseMap
from core.reconstruct import reconstruct

SPEC = DeviceSpec(40, 30, (0.1, 0.1), 10.0)
HEIGHT, WIDTH = 30, 40
DEPTHS = np.arange(-50.0, 51.0, 10.0)
POSE = Pose(matrix_from_rotation_vector([0.1, -0.05, 0.2]), np.array([5.0, -7.0, -600.0]))
AXIS = np.array([0.02, -0.01, 1.0]) / np.linalg.norm([0.02, -0.01, 1.0])


def _u_of(z: np.ndarray | float, shift: np.ndarray) -> np.ndarray:
    """A pixel's coordinate at a plate position: falls with z, different at every pixel."""
    return 300.0 + shift - 1.4 * np.asarray(z)


def _shift() -> np.ndarray:
    return np.add.outer(3.0 * np.arange(HEIGHT), 2.0 * np.arange(WIDTH))


def _calibration(degree: int | None = 3, axis: str = "u") -> DepthCalibration:
    shift = _shift()
    low, high = _u_of(DEPTHS[-1], shift), _u_of(DEPTHS[0], shift)
    if degree is None:
        coefficients = np.stack([_u_of(z, shift) for z in DEPTHS])
    else:
        coefficients = np.zeros((degree + 1, HEIGHT, WIDTH))
        coefficients[1] = -50.0  # z(t) = -50 t
    return DepthCalibration(
        axis=axis,  # type: ignore[arg-type]
        depths_mm=DEPTHS,
        degree=degree,
        coefficients=coefficients.astype(np.float32),
        u_range=np.stack([low, high]).astype(np.float32),
        residual_rms_mm=0.0,
        valid_pixels=HEIGHT * WIDTH,
        camera_spec=SPEC,
        camera=Interior(10.0),
        camera_from_plate=POSE,
        axis_direction=AXIS,
    )


def _phase(u: np.ndarray, sigma: float = 0.03, axis: str = "u") -> PhaseMap:
    u = u.astype(np.float32)
    nan = np.full_like(u, np.nan)
    s = np.where(np.isfinite(u), sigma, np.nan).astype(np.float32)
    pair, sigmas = ((u, nan), (s, nan)) if axis == "u" else ((nan, u), (nan, s))
    return PhaseMap(*pair, *sigmas, nan, nan, np.zeros(u.shape, np.uint8))


def _plate_coordinates(xyz: np.ndarray, z: np.ndarray | float) -> np.ndarray:
    """Points in the frame of the plate moved to z."""
    return POSE.inverse().apply(xyz.astype(np.float64)) - np.multiply.outer(np.asarray(z), AXIS)


@pytest.mark.parametrize("degree", [1, 3, None])
@pytest.mark.parametrize("axis", ["u", "v"])
def test_a_point_lies_on_the_plate_at_its_depth_and_on_its_pixels_ray(degree, axis) -> None:
    z = np.linspace(-49, 49, HEIGHT * WIDTH).reshape(HEIGHT, WIDTH)
    cloud = reconstruct(_phase(_u_of(z, _shift()), axis=axis), _calibration(degree, axis))
    # float32: u to 3e-5 lines, Z to 6e-5 mm
    np.testing.assert_allclose(_plate_coordinates(cloud.xyz_mm, z)[..., 2], 0, atol=2e-4)
    columns, rows = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    X, Y, Z = cloud.xyz_mm.transpose(2, 0, 1)
    np.testing.assert_allclose(-10 * X / Z, (columns - 19.5) * 0.1, atol=1e-5)
    np.testing.assert_allclose(-10 * Y / Z, (14.5 - rows) * 0.1, atol=1e-5)


@pytest.mark.parametrize("degree", [3, None])
def test_nothing_is_extrapolated_unless_asked(degree) -> None:
    z = np.linspace(-80, 80, HEIGHT * WIDTH).reshape(HEIGHT, WIDTH)
    phase, calibration = _phase(_u_of(z, _shift())), _calibration(degree)
    inside = np.abs(z) < 50
    found = np.isfinite(reconstruct(phase, calibration).xyz_mm).all(axis=-1)
    np.testing.assert_array_equal(found, inside)
    beyond = reconstruct(phase, calibration, extrapolate=True)
    np.testing.assert_allclose(_plate_coordinates(beyond.xyz_mm, z)[..., 2], 0, atol=3e-4)


@pytest.mark.parametrize("degree", [3, None])
def test_pixels_without_coordinate_or_calibration_stay_empty_even_when_extrapolating(degree) -> None:
    calibration = _calibration(degree)
    calibration.u_range[:, 3, 4] = np.nan
    u = _u_of(np.zeros((HEIGHT, WIDTH)), _shift())
    u[5, 6] = np.nan
    for extrapolate in (False, True):
        cloud = reconstruct(_phase(u), calibration, extrapolate=extrapolate)
        empty = np.isnan(cloud.xyz_mm).all(axis=-1)
        assert sorted(map(tuple, np.argwhere(empty).tolist())) == [(3, 4), (5, 6)]
        np.testing.assert_array_equal(np.isnan(cloud.sigma_depth_mm), empty)
        assert cloud.sigma_mm is None


@pytest.mark.parametrize("degree", [3, None])
def test_the_ends_of_the_calibrated_depths_are_inside(degree) -> None:
    for z in (-50.0, 50.0):
        cloud = reconstruct(_phase(_u_of(np.full((HEIGHT, WIDTH), z), _shift())), _calibration(degree))
        assert np.isfinite(cloud.xyz_mm).all()


@pytest.mark.parametrize("degree", [3, None])
def test_phase_noise_scatters_the_depth_as_its_sigma_says(degree) -> None:
    rng = np.random.default_rng(2)
    u = _u_of(np.zeros((HEIGHT, WIDTH)), _shift())
    calibration = _calibration(degree)
    true = reconstruct(_phase(u), calibration).xyz_mm[..., 2].astype(np.float64)
    errors = []
    for _ in range(50):
        cloud = reconstruct(_phase(u + rng.normal(0, 0.2, u.shape), 0.2), calibration)
        errors.append((cloud.xyz_mm[..., 2] - true) / cloud.sigma_depth_mm)
    # 60 000 values: the r.m.s. has a standard deviation of 0.003
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1, abs=0.012)


def test_a_table_with_a_missing_end_is_shorter() -> None:
    calibration = _calibration(None)
    calibration.coefficients[-1, 2, 2] = np.nan  # not seen at z = 50, where u is least
    calibration.u_range[0, 2, 2] = calibration.coefficients[-2, 2, 2]
    z = np.full((HEIGHT, WIDTH), 45.0)
    phase = _phase(_u_of(z, _shift()))
    assert np.isnan(reconstruct(phase, calibration).xyz_mm[2, 2]).all()
    beyond = reconstruct(phase, calibration, extrapolate=True).xyz_mm
    np.testing.assert_allclose(_plate_coordinates(beyond, z)[2, 2, 2], 0, atol=3e-4)


def test_a_capture_without_the_calibrated_axis_is_refused() -> None:
    phase = _phase(_u_of(np.zeros((HEIGHT, WIDTH)), _shift()), axis="v")
    with pytest.raises(InputError, match="patterns along x"):
        reconstruct(phase, _calibration())
