"""Clouds of one step from two stations, in closed form: no place takes part of a view that cannot see it."""

from __future__ import annotations

import numpy as np
import pytest

from core.geometry import Pose, project, ray_directions
from core.model import DeviceSpec, Interior, PointCloud
from core.reconstruct.overlaps import Seen, averaged
from core.reconstruct.placed import Device

SPEC = DeviceSpec(240, 160, (0.01, 0.01), 14.0)  # 0.7 mm on the object
BACK, FRONT = -1000.0, -995.0  # a plane, and half a plane before it where x < 0


def behind(origin: np.ndarray, to: np.ndarray) -> np.ndarray:
    """Whether the front hides points (n, 3) of the back from a place."""
    share = (FRONT - origin[2]) / (to[:, 2] - origin[2])
    return np.asarray((to[:, 2] < FRONT - 1) & (origin[0] + share * (to[:, 0] - origin[0]) < 0))


def seen(pose: Pose, sigma_mm: float = 0.04) -> Seen:
    device = Device(SPEC, Interior(14.0), pose)
    v, u = np.mgrid[: SPEC.height, : SPEC.width]
    rays = ray_directions(SPEC, device.interior, np.stack([u, v], axis=-1).reshape(-1, 2).astype(float))
    rays, origin = rays @ pose.rotation, pose.inverse().translation_mm
    points = origin + rays * ((FRONT - origin[2]) / rays[:, 2])[:, None]
    back = origin + rays * ((BACK - origin[2]) / rays[:, 2])[:, None]
    own = pose.apply(np.where(points[:, :1] < 0, points, back)).reshape(SPEC.height, SPEC.width, 3)
    sigma = np.full(own.shape, 3 * sigma_mm)
    return Seen(PointCloud(own, sigma, np.full(own.shape[:2], sigma_mm)), device, int(origin[0] != 0))


def test_a_place_that_another_view_does_not_see_is_no_part_of_an_outline() -> None:
    """The surface jumps by 5 mm between pixels of the other view: rays meet what joins them, but nothing is there."""
    turn = 0.6
    pose = Pose(np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]))
    pose = Pose(pose.rotation, np.array([0, 0, BACK]) - pose.rotation @ [0, 0, BACK])
    views = [seen(Pose()), seen(pose)]
    cloud, made = averaged(views)[0]
    points = views[0].cloud.xyz_mm.reshape(-1, 3)
    hidden = behind(pose.inverse().translation_mm, points)
    assert 300 < np.count_nonzero(hidden) < 3000
    image = project(SPEC, Interior(14.0), points, pose)
    sees = ~hidden & np.all((image > 1) & (image < (SPEC.width - 2, SPEC.height - 2)), axis=1)
    assert not np.any(made.ravel()[hidden] & 2)
    assert np.mean(made.ravel()[sees] & 2 > 0) > 0.97
    np.testing.assert_allclose(cloud.xyz_mm.reshape(-1, 3), points, atol=1e-6)  # nothing was drawn anywhere


def plane(turn: float, sigma_mm: float, rng: np.random.Generator) -> tuple[Seen, np.ndarray]:
    """A tilted plane as a camera has it, with noise of each depth, and how far off it is, (H, W) mm of depth."""
    R = np.array([[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]])
    pose = Pose(R, np.array([0, 0, BACK]) - R @ [0, 0, BACK])
    v, u = np.mgrid[: SPEC.height, : SPEC.width]
    rays = ray_directions(SPEC, Interior(14.0), np.stack([u, v], axis=-1).reshape(-1, 2).astype(float)) @ R
    origin, normal = pose.inverse().translation_mm, np.array([0.2, 0.1, 1.0])
    own = pose.apply(origin + rays * ((normal @ ([0, 0, BACK] - origin)) / (rays @ normal))[:, None])
    true = own.reshape(SPEC.height, SPEC.width, 3)
    xyz = true * (1 + rng.normal(0, sigma_mm, true.shape[:2]) / -true[..., 2])[..., None]
    depth = np.full(true.shape[:2], sigma_mm)
    sigma = np.abs(true @ R / true[..., 2:]) * sigma_mm
    return Seen(PointCloud(xyz, sigma, depth), Device(SPEC, Interior(14.0), pose), int(turn != 0)), true


@pytest.mark.parametrize("pixels", [0.1, 0.5, 2.0])
def test_noise_of_many_pixels_on_the_surface_is_averaged_as_well(pixels: float) -> None:
    """Between four pixels so noisy a surface has no slope; from these, errors were 1.26 times sigma at two pixels."""
    rng = np.random.default_rng(4)
    (first, true), (other, _) = (plane(turn, pixels * 0.714, rng) for turn in (0.0, 0.5))
    cloud, made = averaged([first, other])[0]
    both = made == 3
    error = (cloud.xyz_mm[..., 2] - true[..., 2])[both]
    assert np.mean(both[20:-20, 60:-60]) > 0.97
    # 37,000 points in which neighbours share pixels: r.m.s. known to 0.7 %
    assert np.sqrt(np.mean((error / cloud.sigma_depth_mm[both]) ** 2)) == pytest.approx(1.0, abs=0.03)
    assert np.sqrt(np.mean(error**2)) < 0.5 * pixels * 0.714
