"""The figures of one plane capture."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.errors import InputError, NoCoordinateError, StripeError
from core.evaluate import evaluate_plane
from core.model import PhaseMap, PointCloud
from core.pipeline import METHODS, calibrate_project, evaluate_project, reconstruct_capture
from core.pipeline.evaluate import united
from core.project import read_project

H, W = 60, 80


def _phase() -> PhaseMap:
    u = np.ones((H, W), np.float32)
    return PhaseMap(u, u.copy(), u, u, u, u, np.zeros((H, W), np.uint8))


def _cloud(noise_mm: float = 0.0, tilt_deg: float = 0.0, seed: int = 1) -> PointCloud:
    """A plane through (0, 0, -600) seen by a pinhole camera, with noise along the rays, sigma in Z."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-0.3, 0.3, W), np.linspace(0.2, -0.2, H))
    rays = np.stack([x, y, -np.ones((H, W))], axis=-1)
    normal = np.array([np.sin(np.radians(tilt_deg)), 0, np.cos(np.radians(tilt_deg))])
    s = -600 * normal[2] / (rays @ normal) + rng.normal(0, noise_mm, (H, W))
    return PointCloud((rays * s[..., None]).astype(np.float32), None, np.full((H, W), noise_mm, np.float32))


def test_a_perfect_plane_deviates_by_nothing_but_rounding() -> None:
    result = evaluate_plane(_phase(), _cloud(), capture="p", angle_deg=0, method="photogrammetric")
    assert result.n == H * W
    assert result.rms_mm < 3e-5  # float32 at 600 mm
    assert (result.excluded, result.excluded_rule) == (0, "")
    np.testing.assert_allclose(result.plane, [0, 0, 1, -600], atol=1e-4)


@pytest.mark.parametrize("tilt", [0, -15, 45])
def test_noise_along_the_rays_is_predicted(tilt: float) -> None:
    result = evaluate_plane(_phase(), _cloud(0.05, tilt), capture="p", angle_deg=tilt, method="polynomial")
    # 4800 points: the r.m.s. has a standard deviation of 1 %
    assert result.rms_mm == pytest.approx(result.predicted_rms_mm, rel=0.035)
    assert result.predicted_rms_mm is not None


def test_figures_describe_the_deviations() -> None:
    cloud = _cloud()
    cloud.xyz_mm[10, 10, 2] += 1.0
    cloud.xyz_mm[50, 70, 2] -= 2.0
    result = evaluate_plane(_phase(), cloud, capture="p", angle_deg=None, method="polynomial")
    assert result.max_mm == pytest.approx(2.0, abs=0.01)  # the largest absolute one
    assert result.min_mm == pytest.approx(-2.0, abs=0.01)
    assert np.nanargmin(result.deviation_mm) == 50 * W + 70
    assert result.rms_mm == pytest.approx(np.sqrt(5 / (H * W)), rel=0.01)
    assert result.rms_mm == pytest.approx(np.sqrt(np.mean(result.deviation_mm.astype(float) ** 2)))


@pytest.mark.parametrize("tilt", [0, 20])
def test_a_wall_behind_the_plate_takes_no_part(tilt: float) -> None:
    cloud, plate = _cloud(0.05, tilt), _cloud(0.05, tilt)
    wall = np.zeros((H, W), bool)
    wall[:, :30], wall[50:, :] = True, True
    cloud.xyz_mm[wall] *= 1.2
    cloud.xyz_mm[5, 60] *= 1.2  # one gross error, which counts
    result = evaluate_plane(_phase(), cloud, capture="p", angle_deg=tilt, method="photogrammetric")
    assert result.n == H * W - wall.sum()
    assert result.excluded == result.elsewhere == wall.sum()
    assert result.excluded_rule == f"{wall.sum()} on another surface"
    assert result.max_mm > 100
    alone = evaluate_plane(
        _phase(), replace(plate, xyz_mm=np.where(wall[..., None], np.nan, plate.xyz_mm)), capture="p", angle_deg=tilt,
        method="photogrammetric",
    )  # fmt: skip
    # 2500 points: the gross error of 120 mm moves the plane by 120 / 2500, and tilts it
    assert abs(result.plane[3] - alone.plane[3]) < 0.3


@pytest.mark.parametrize("height", [0.3, 3.0])
def test_form_however_large_is_no_other_surface(height: float) -> None:
    cloud = _cloud(0.05)
    v, u = np.mgrid[-1 : 1 : H * 1j, -1 : 1 : W * 1j]
    cloud.xyz_mm[..., 2] += height * (u**2 + v**2 + u**3)
    result = evaluate_plane(_phase(), cloud, capture="p", angle_deg=0, method="photogrammetric")
    assert (result.n, result.elsewhere) == (H * W, 0)


def test_a_corner_that_bends_away_is_form() -> None:
    cloud = _cloud(0.05)
    v, u = np.mgrid[0 : 1 : H * 1j, 0 : 1 : W * 1j]
    cloud.xyz_mm[..., 2] += 60 * np.maximum(u + v - 1.7, 0) ** 2  # up to 5.4 mm, a hundred sigmas
    result = evaluate_plane(_phase(), cloud, capture="p", angle_deg=0, method="photogrammetric")
    assert result.max_mm > 2
    assert (result.n, result.elsewhere) == (H * W, 0)


@pytest.mark.parametrize("lead", ["u", "v"])  # a base along the columns needs rows
def test_every_decoded_pixel_without_point_is_counted_with_the_rule(lead: str) -> None:
    phase, cloud = _phase(), _cloud()
    cloud.xyz_mm[:5] = np.nan
    phase.u[0] = phase.v[0] = np.nan  # not decoded: not excluded either
    getattr(phase, lead)[1] = np.nan  # only the other decoded
    outside = "outside the calibrated depths"
    result = evaluate_plane(phase, cloud, capture="p", angle_deg=0, method="polynomial", outside=outside)
    assert result.n == (H - 5) * W
    assert result.excluded == 4 * W
    assert f"{3 * W} outside the calibrated depths" in result.excluded_rule
    assert f"{W} the projector coordinate that gives the depth was not decoded" in result.excluded_rule
    assert np.isnan(result.deviation_mm[:5]).all()


def test_points_without_sigma_have_no_prediction() -> None:
    cloud = PointCloud(_cloud().xyz_mm)
    result = evaluate_plane(_phase(), cloud, capture="p", angle_deg=0, method="photogrammetric")
    assert result.predicted_rms_mm is None


def test_a_capture_without_points_is_refused_by_name() -> None:
    cloud = PointCloud(np.full((H, W, 3), np.nan, np.float32))
    with pytest.raises(StripeError, match=r"plane\+10: 0 valid points"):
        evaluate_plane(_phase(), cloud, capture="plane+10", angle_deg=10, method="photogrammetric")


def test_a_plane_without_the_depth_methods_coordinate_is_judged_by_the_other(
    calibrated: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lacking(*_: object) -> PointCloud:
        raise NoCoordinateError("phase map", "no pixel has the coordinate u", "capture with patterns along x")

    monkeypatch.setitem(METHODS, "polynomial", replace(METHODS["polynomial"], reconstruct=lacking))
    rows = evaluate_project(read_project(calibrated))
    assert {row.method for row in rows} == {"photogrammetric"}
    with pytest.raises(InputError, match="no pixel has the coordinate u"):
        evaluate_project(read_project(calibrated), methods=["polynomial"])


def test_pixels_that_any_projector_lit_are_counted_for_all_devices_together() -> None:
    """Of two that light halves of a plane; two rows of either miss the columns."""
    halves = []
    for lit in (slice(None, 40), slice(40, None)):
        u = np.full((H, W), np.nan, np.float32)
        u[:, lit] = 1
        v = u.copy()
        u[:2] = np.nan
        halves.append(replace(_phase(), u=u, v=v))
    cloud = _cloud()
    cloud.xyz_mm[:2] = np.nan
    result = evaluate_plane(united(halves), cloud, capture="plane", angle_deg=0, method="photogrammetric")
    told = f"{2 * W} the projector coordinate that gives the depth was not decoded"
    assert (result.excluded, result.excluded_rule) == (2 * W, told)
    halves[0].u[10, 10] = halves[0].v[11, 10] = np.nan  # other cameras have their points: either coordinate is missed
    result = evaluate_plane(united(halves), cloud, capture="plane", angle_deg=0, method="photogrammetric")
    assert (result.excluded, result.excluded_rule) == (2 * W, told)


def test_a_method_is_of_the_devices_that_were_calibrated(calibrated: Path, edit_json: Callable[..., None]) -> None:
    """What another projector lit has other columns at the same place: nothing of it is judged, made or calibrated."""
    lamp = json.loads((calibrated / "project.json").read_text())["projector"]
    edit_json(calibrated / "project.json", version=2, projectors={"second": lamp})
    for name in ("plane+15", "depth-01"):
        capture = calibrated / "captures" / name / "capture.json"
        frames = [{**frame, "projector": "second"} for frame in json.loads(capture.read_text())["frames"]]
        edit_json(capture, frames=frames)
    project = read_project(calibrated)
    rows = evaluate_project(project, methods=["polynomial"])
    assert [(row.capture, row.devices) for row in rows] == [("plane+00", ("camera", "projector"))]
    with pytest.raises(InputError, match="is of camera with projector, not of camera with second"):
        reconstruct_capture(project, "plane+15", "polynomial")
    with pytest.raises(InputError, match="has no device second; it knows camera, projector; calibrate"):
        reconstruct_capture(project, "plane+15", "photogrammetric")
    with pytest.raises(InputError, match="capture depth-01: has no frames of camera with projector"):
        calibrate_project(project, "polynomial")
