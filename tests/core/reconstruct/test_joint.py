"""Several cameras and one projector over surfaces in closed form: what each pixel sees, worked out here by rays."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from core.errors import InputError, NoCoordinateError
from core.geometry import Pose, matrix_from_rotation_vector
from core.model import (
    AdjustedDevice,
    Capture,
    DeviceSpec,
    Interior,
    Orientation,
    PhaseMap,
    PhotogrammetricCalibration,
    PointCloud,
    Registration,
)
from core.pipeline.judge import said_of
from core.reconstruct import Sight, at_stations, intersect_all, joined, merged, reconstruct
from core.reconstruct.joint import Scene, View, by_calibration
from core.reconstruct.labels import labels_of
from core.reconstruct.placed import moved, placed

NOISE = 0.03  # lines
CAMERA = DeviceSpec(240, 180, (0.025, 0.025), 12.0)
PROJECTOR = DeviceSpec(640, 640, (0.09, 0.09), 180.0)
BASE_MM = 255.0
Surface = Callable[[np.ndarray, np.ndarray], np.ndarray]  # origin (3,) and directions (..., 3): distances, inf for none


@dataclass(frozen=True)
class Place:
    """A pinhole device: rows of R are its axes X, Y, Z in space; it looks along -Z."""

    spec: DeviceSpec
    c: float
    centre: np.ndarray
    R: np.ndarray

    @classmethod
    def looking(cls, spec: DeviceSpec, c: float, centre: list[float]) -> Place:
        z = np.array(centre) / np.linalg.norm(centre)  # back from the origin, at which it looks
        x = np.cross([0.0, 1.0, 0.0], z)
        x /= np.linalg.norm(x)
        return cls(spec, c, np.array(centre), np.stack([x, np.cross(z, x), z]))

    def rays(self) -> np.ndarray:
        u, v = np.meshgrid(np.arange(self.spec.width), np.arange(self.spec.height))
        x = (u - (self.spec.width - 1) / 2) * self.spec.pitch_mm[0] / self.c
        y = ((self.spec.height - 1) / 2 - v) * self.spec.pitch_mm[1] / self.c
        return np.stack([x, y, -np.ones_like(x)], axis=-1) @ self.R

    def image(self, X: np.ndarray) -> np.ndarray:
        own = (X - self.centre) @ self.R.T
        x, y = -self.c * own[..., 0] / own[..., 2], -self.c * own[..., 1] / own[..., 2]
        middle = (np.array([self.spec.width, self.spec.height]) - 1) / 2
        return np.stack([x / self.spec.pitch_mm[0], -y / self.spec.pitch_mm[1]], axis=-1) + middle

    def device(self) -> AdjustedDevice:
        return AdjustedDevice(self.spec, Interior(self.c), np.zeros(9), (0.0, 0.0), 0)


LEFT = Place.looking(CAMERA, 12.0, [-BASE_MM, 10.0, 900.0])
RIGHT = Place.looking(CAMERA, 12.5, [BASE_MM, -15.0, 905.0])
LAMP = Place.looking(PROJECTOR, 181.0, [0.0, 0.0, 910.0])


def plane(origin: np.ndarray, d: np.ndarray) -> np.ndarray:
    n = np.array([0.15, -0.1, 1.0])
    return -(origin @ n) / (d @ n)


def ball(origin: np.ndarray, d: np.ndarray) -> np.ndarray:
    """A ball of 30 mm, 70 mm before the plane."""
    to, dd = origin - [0.0, 0.0, 70.0], np.sum(d * d, axis=-1)
    b = d @ to
    root = b**2 - dd * (to @ to - 900.0)
    return np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / dd, np.inf)


def capture(camera: Place, lamp: Place, surfaces: list[Surface], name: str, noise: float, seed: int) -> PhaseMap:
    d = camera.rays()
    X = camera.centre + d * np.min([s(camera.centre, d) for s in surfaces], axis=0)[..., None]
    to = X - lamp.centre
    lit = np.min([s(lamp.centre, to) for s in surfaces], axis=0) > 1 - 1e-6
    uv = lamp.image(X) + noise * np.random.default_rng(seed).standard_normal((*X.shape[:2], 2))
    uv = np.where(lit[..., None], uv, np.nan).astype(np.float32)
    sigma, plain = np.full(uv.shape[:2], noise, np.float32), np.ones(uv.shape[:2], np.float32)
    flags = np.zeros(uv.shape[:2], np.uint8)
    return PhaseMap(uv[..., 0], uv[..., 1], sigma, sigma, plain, plain, flags, camera=name, projector="projector")


def calibration(
    left: Place = LEFT, right: Place = RIGHT, lamp: Place = LAMP, **more: Place
) -> PhotogrammetricCalibration:
    """Of two cameras and one projector or more."""
    places = {"left": left, "right": right, "projector": lamp, **more}

    def from_left(place: Place) -> Orientation:
        return Orientation("left", Pose(place.R @ left.R.T, place.R @ (left.centre - place.centre)))

    others = [*places][1:]
    names = [f"{n}.{p}" for n in places for p in ("c", "x0", "y0", *(f"A{k}" for k in range(1, 7)))]
    names += [f"{n}.{p}" for n in others for p in ("rx", "ry", "rz", "tx", "ty", "tz")]
    return PhotogrammetricCalibration(
        {name: place.device() for name, place in places.items()},
        ("left", "right"), {name: from_left(places[name]) for name in others},
        np.zeros((len(names), len(names))), tuple(names), 1.0, 1, 1, 1, 1, (0.0, 0.0, 0.0),
    )  # fmt: skip


def captures(surfaces: list[Surface], lamp: Place = LAMP, noise: float = NOISE) -> list[PhaseMap]:
    places = {"left": LEFT, "right": RIGHT}
    return [capture(place, lamp, surfaces, name, noise, i) for i, (name, place) in enumerate(places.items())]


def truth(camera: Place, surfaces: list[Surface]) -> np.ndarray:
    """Distances along the camera's -Z."""
    d = camera.rays()
    return np.min([s(camera.centre, d) for s in surfaces], axis=0)


def depth_errors(cloud, camera: Place, surfaces: list[Surface]) -> np.ndarray:
    return -cloud.xyz_mm[..., 2] - truth(camera, surfaces)


def behind(origin: np.ndarray, d: np.ndarray) -> np.ndarray:
    """The plane, 5 mm farther away."""
    n = np.array([0.15, -0.1, 1.0])
    return (n[2] * -5.0 - origin @ n) / (d @ n)


def off_by(cloud: PointCloud, which: np.ndarray) -> float:
    """How many sigmas depths are from the one plane or from the other, r.m.s., the larger of the two."""
    off = [depth_errors(cloud, LEFT, [surface])[which] / cloud.sigma_depth_mm[which] for surface in (plane, behind)]
    return max(float(np.sqrt(np.mean(each**2))) for each in off)


def test_sigmas_hold_what_moved_between_the_cameras_images() -> None:
    """All rays miss one another alike, which was the image's usual misfit and in no sigma: they were 128 off."""
    phases = [captures([plane])[0], captures([behind])[1]]
    cloud = intersect_all(phases, calibration(), "left")
    joint = cloud.sight == Sight.JOINT
    assert joint.mean() > 0.8
    assert off_by(cloud, joint) < 3  # three observations too many share it


def test_what_moved_between_two_projectors_light_is_told_and_in_sigmas() -> None:
    """Each of them fits the camera, and nothing held one against the other."""
    below = Place.looking(PROJECTOR, 181.0, [30.0, -250.0, 905.0])
    found = calibration(lamp=LAMP, lamp2=below)
    by_one = capture(LEFT, LAMP, [plane], "left", NOISE, 1)
    for surface in (plane, behind):
        by_other = replace(capture(LEFT, below, [surface], "left", NOISE, 2), projector="lamp2")
        phases = [by_one, by_other]
        cloud = intersect_all(phases, found, "left")
        assert off_by(cloud, cloud.valid) < 3 or surface is plane
        told = said_of(Capture(Path("a"), "object", ()), phases, found)
        assert [text.partition(": ")[0] for text in told] == (
            [] if surface is plane else ["left sees it at other depths by lamp2 than by projector"]
        )
        deeper = [float(re.search(r"([+-]\S+) ± ", text)[1]) for text in told]
        true = np.nanmedian((truth(LEFT, [behind]) - truth(LEFT, [plane]))[cloud.valid])
        assert deeper in ([], [pytest.approx(true, rel=0.02)])


def test_two_cameras_are_better_than_one_and_say_by_how_much() -> None:
    """Bounds: two thirds of a pixel's noise are left between pixels, so that 1/sqrt(1 + 1/0.44) = 0.55 is to be had."""
    both, found = captures([plane]), calibration()
    alone, joint = reconstruct(both[0], found), intersect_all(both, found, "left")
    seen = joint.sight == Sight.JOINT
    assert seen.mean() > 0.8
    assert np.median(joint.sigma_depth_mm[seen]) < 0.65 * np.median(alone.sigma_depth_mm[seen])
    for cloud in (alone, joint):
        error = depth_errors(cloud, LEFT, [plane])[seen]
        assert np.sqrt(np.mean((error / cloud.sigma_depth_mm[seen]) ** 2)) == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("turn", [1e-4, 1e-2])
def test_cameras_alone_do_not_care_where_the_projector_stands(turn: float) -> None:
    """The projector has turned, and its c drifted by 50 um since the calibration."""
    drifted = replace(LAMP, c=LAMP.c + 0.05, R=matrix_from_rotation_vector([0.0, turn, 0.3 * turn]) @ LAMP.R)
    both, found = captures([plane], drifted), calibration()
    pair = reconstruct(both[0], found)
    cameras = intersect_all(both, found, "left", rays="cameras")
    seen = cameras.sight == Sight.JOINT
    error = depth_errors(cameras, LEFT, [plane])[seen]
    assert seen.mean() > 0.8
    assert abs(np.mean(depth_errors(pair, LEFT, [plane])[seen])) > 0.05
    assert abs(np.mean(error)) < 0.1 * np.median(cameras.sigma_depth_mm[seen])
    assert np.sqrt(np.mean((error / cameras.sigma_depth_mm[seen]) ** 2)) == pytest.approx(1.0, abs=0.03)


def with_top(centre: list[float]) -> tuple[dict[str, Place], PhotogrammetricCalibration, list[PhaseMap]]:
    """Three cameras before a plane, as calibrated."""
    top = Place.looking(CAMERA, 11.8, centre)
    places, found = {"left": LEFT, "right": RIGHT, "top": top}, calibration()
    from_left = Pose(top.R @ LEFT.R.T, top.R @ (LEFT.centre - top.centre))
    more = [n.replace("right", "top") for n in found.parameter_names if n.startswith("right")]
    found = replace(
        found,
        devices={**found.devices, "top": top.device()},
        cameras=tuple(places),
        orientations={**found.orientations, "top": Orientation("left", from_left)},
        parameter_names=(*found.parameter_names, *more),
        covariance=np.zeros((len(found.covariance) + len(more),) * 2),
    )
    seen = [capture(place, LAMP, [plane], each, NOISE, i) for i, (each, place) in enumerate(places.items())]
    return places, found, seen


@pytest.mark.parametrize("name", ["left", "right", "top"])
def test_cameras_that_share_a_label_share_its_noise(name: str) -> None:
    """Of three cameras: 1.25 and 1.13 (left, right) where residuals of two against the third count as independent."""
    places, found, seen = with_top([120.0, 200.0, 890.0])
    cloud = intersect_all(seen, found, name, rays="cameras")
    own = cloud.sight == Sight.JOINT
    assert own.mean() > 0.7
    error = depth_errors(cloud, places[name], [plane])[own] / cloud.sigma_depth_mm[own]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(1.0, abs=0.03)


def test_a_camera_whose_axis_tells_nothing_by_the_projector_has_its_points_by_others() -> None:
    """It stands above the projector, and has decoded columns alone: they hardly change with depth."""
    places, found, (left, right, top) = with_top([0.0, 230.0, 890.0])
    top = replace(top, v=np.full_like(top.v, np.nan))
    with pytest.raises(NoCoordinateError):
        intersect_all([top], found, "top")
    cloud = intersect_all([left, right, top], found, "top")
    own = cloud.sight == Sight.JOINT
    assert own.mean() > 0.7
    error = depth_errors(cloud, places["top"], [plane])[own] / cloud.sigma_depth_mm[own]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(1.0, abs=0.05)


def test_a_camera_in_the_dark_keeps_no_others_from_being_joined() -> None:
    """Of two captures of the same plane by the same rig; in the second one camera saw no light."""
    found, (left, right) = calibration(), captures([plane])
    dark = replace(right, **dict.fromkeys(("u", "v", "sigma_u", "sigma_v"), np.full_like(right.u, np.nan)))
    k = len(found.covariance)
    still = Registration(("a", "b"), (Pose(), Pose()), np.zeros((6, 6)), np.zeros((6, k)), ())
    cloud, image, sources = joined([[left, right], [left, dark]], ["a", "b"], at_stations(found, still, "left"))
    assert cloud.xyz_mm.shape[1] == image.shape[1] > 0.8 * left.u.size
    assert "right" in {name for cameras, _ in sources for name in cameras.split(" + ")}
    off = cloud.xyz_mm[0] @ LEFT.R @ [0.15, -0.1, 1.0] + LEFT.centre @ [0.15, -0.1, 1.0]
    assert np.sqrt(np.mean(off**2)) < 0.3
    with pytest.raises(NoCoordinateError):
        joined([[left, right], [dark, dark]], ["a", "b"], at_stations(found, still, "left"))


def test_hidden_places_are_told_from_rays_that_miss() -> None:
    surfaces = [plane, ball]
    both, found = captures(surfaces), calibration()
    # a patch in which the right camera's coordinates are off by two lines, as light reflected twice would do it
    at = np.s_[100:110, 60:80]
    both[1].u[at] += 2.0
    joint = intersect_all(both, found, "left")
    X = LEFT.centre + LEFT.rays() * truth(LEFT, surfaces)[..., None]
    place, to = RIGHT.image(X), X - RIGHT.centre
    free = ball(RIGHT.centre, to) > 1 - 1e-6
    inside = np.all((place > 3) & (place < [236, 176]), axis=-1)
    lit = np.isfinite(both[0].u)
    hidden = lit & inside & ~free
    assert hidden.sum() > 200
    assert np.mean(joint.sight[hidden] == Sight.JOINT) < 0.01  # pixels that straddle the ball's outline
    assert np.mean(np.abs(depth_errors(joint, LEFT, surfaces)[hidden]) < 6 * joint.sigma_depth_mm[hidden]) > 0.99
    spoilt = lit & free & np.all((place > [62, 102]) & (place < [77, 107]), axis=-1)
    assert np.mean(joint.sight[spoilt] == Sight.DISAGREE) > 0.95
    # not what straddles the ball's outline in an image, nor its flanks, seen at a grazing angle
    curved = ~lit | ~free | (np.linalg.norm(X - [0.0, 0.0, 70.0], axis=-1) < 30.1)
    sound = inside & (cv2.dilate(curved.astype(np.uint8), np.ones((9, 9))) == 0)
    sound &= np.abs(place - [70, 105]).max(axis=-1) > 15
    assert sound.sum() > 20_000
    assert np.mean(joint.sight[sound] == Sight.DISAGREE) < 1e-4


def test_points_that_walk_off_what_another_camera_decoded_are_made_without_it() -> None:
    """What the right camera has is three pixels off along its row, in a strip: at its end points leave it."""
    both, found = captures([plane]), calibration()
    strip, lines = np.zeros(both[1].u.shape, bool), 3 * np.nanmedian(np.diff(both[1].u, axis=1))
    strip[60:120, 100:112] = True
    u, v = np.where(strip, both[1].u - lines, np.nan), np.where(strip, both[1].v, np.nan)
    joint = intersect_all([both[0], replace(both[1], u=u, v=v)], found, "left")
    assert np.any(joint.sight == Sight.HIDDEN)
    made = (joint.sight == Sight.HIDDEN) | (joint.sight == Sight.OWN)
    error = depth_errors(joint, LEFT, [plane])[made] / joint.sigma_depth_mm[made]
    assert np.abs(error).max() < 6  # of 43,000; 640 as they were


def test_where_rays_miss_one_another_the_sigma_says_by_how_much() -> None:
    """Beside the ball's outline pixels hold a mean of both surfaces' coordinates, as in a blurred image."""
    surfaces = [plane, ball]
    both, found = captures(surfaces), calibration()
    mixed = []
    for phase in both:
        values = [(a, cv2.blur(np.nan_to_num(a), (3, 3))) for a in (phase.u, phase.v)]
        torn = np.max([np.abs(mean - a) for a, mean in values], axis=0) > 2
        torn &= cv2.blur(np.isnan(phase.u).astype(np.float32), (3, 3)) == 0
        u, v = (np.where(torn, mean, a) for a, mean in values)
        mixed.append(replace(phase, u=u, v=v))
    joint = intersect_all(mixed, found, "left")
    told = joint.sight == Sight.DISAGREE
    assert told.sum() > 50
    ratio = depth_errors(joint, LEFT, surfaces)[told] / joint.sigma_depth_mm[told]
    assert np.sqrt(np.mean(ratio**2)) < 2  # 1.7; 93 with the sigmas of rays that meet


@pytest.mark.parametrize("rows", [True, False], ids=["columns and rows", "columns"])
def test_beside_an_outline_coordinates_are_not_read_across_it(rows: bool) -> None:
    """Errors over sigmas 1.3 and 1.9, with a few pixels of the ball's flanks; 7 and 35 by slopes across the outline."""
    surfaces = [plane, ball]
    (left, right), found = captures(surfaces), calibration()
    right = right if rows else replace(right, v=np.full_like(right.v, np.nan))
    cameras = intersect_all([left, right], found, "left", rays="cameras")
    told = cameras.sight == Sight.JOINT
    assert told.mean() > 0.8
    ratio = depth_errors(cameras, LEFT, surfaces)[told] / cameras.sigma_depth_mm[told]
    assert np.sqrt(np.mean(ratio**2)) < 3


def test_two_projectors_before_one_camera_share_the_noise() -> None:
    """Weights add up: those of each projector alone."""
    other = Place.looking(PROJECTOR, 181.0, [-2 * BASE_MM, 0.0, 905.0])
    found = calibration()
    pose = Pose(other.R @ LEFT.R.T, other.R @ (LEFT.centre - other.centre))
    found = replace(
        found,
        devices={**{n: found.devices[n] for n in ("left", "projector")}, "second": other.device()},
        cameras=("left",),
        orientations={"projector": found.orientations["projector"], "second": Orientation("left", pose)},
        parameter_names=tuple(name.replace("right", "second") for name in found.parameter_names),
    )
    first = capture(LEFT, LAMP, [plane], "left", NOISE, 1)
    second = replace(capture(LEFT, other, [plane], "left", NOISE, 2), projector="second")
    both = intersect_all([first, second], found, "left")
    weight = sum(reconstruct(phase, found).sigma_depth_mm ** -2.0 for phase in (first, second))
    np.testing.assert_allclose(both.sigma_depth_mm, weight**-0.5, rtol=0.02)  # each at its own depth of the pixel
    error = depth_errors(both, LEFT, [plane])
    assert np.sqrt(np.nanmean((error / both.sigma_depth_mm) ** 2)) == pytest.approx(1.0, abs=0.03)


def test_covariance_of_the_calibration_goes_into_the_sigma() -> None:
    """Each parameter moved by its sigma moves the points; their squares add up. Noise: next to nothing."""
    both, found = captures([plane], noise=1e-4), calibration()
    sigma = {
        "c": 0.01,
        "x0": 0.002,
        "y0": 0.002,
        "A1": 1e-6,
        "rx": 2e-5,
        "ry": 2e-5,
        "rz": 2e-5,
        "tx": 0.02,
        "ty": 0.02,
        "tz": 0.02,
    }
    spread = np.array([sigma.get(name.split(".")[1], 0.0) for name in found.parameter_names])
    wide = replace(found, covariance=np.diag(spread**2))
    predicted = intersect_all(both, wide, "left")
    at = np.s_[60:140:20, 84:180:24]
    thin = np.full_like(both[0].u, np.nan)
    thin[at] = both[0].u[at]
    some = [replace(both[0], u=thin), both[1]]
    there, variance = intersect_all(some, found, "left").xyz_mm[at], 0.0
    for step in np.diag(spread)[spread > 0]:
        devices = moved(placed(found), found, step)
        one = replace(
            found,
            devices={n: replace(found.devices[n], interior=d.interior) for n, d in devices.items()},
            orientations={n: Orientation("left", devices[n].from_base) for n in found.orientations},
        )
        variance = variance + (intersect_all(some, one, "left").xyz_mm[at] - there) ** 2
    # a tenth: what neighbours differ by, and float32
    np.testing.assert_allclose(predicted.sigma_mm[at], np.sqrt(variance), rtol=0.1)


def test_sigma_of_many_points_is_that_of_each_by_itself() -> None:
    """Distortion is poorly known in the corners, and some points lie off the surface: a fit would run away there."""
    both, found = captures([plane]), calibration()
    sigma = {"left.A1": 5e-5, "left.A2": 1e-5, "right.A2": 5e-6, "projector.c": 0.02, "right.ry": 2e-5}
    spread = np.array([sigma.get(name, 0.0) for name in found.parameter_names])
    known = replace(found, covariance=np.diag(spread**2))
    scene = Scene(placed(found), [View(p.camera, p.projector, labels_of(p)) for p in both], "left", "all")
    q = 1 / truth(LEFT, [plane])
    rng = np.random.default_rng(3)
    off = rng.random(q.shape) < 1e-3
    q[off] *= 1 + 0.02 * rng.standard_normal(np.count_nonzero(off))
    seen = np.isfinite(both[0].u)
    variance = np.full((*q.shape, 3), np.nan)
    variance[seen] = by_calibration(scene, known, seen, q)
    some = np.argwhere(seen & (off | (rng.random(q.shape) < 1e-3)))
    ratio = []
    for row, column in some:
        one = np.zeros_like(seen)
        one[row, column] = True
        ratio.append(variance[row, column, 2] / by_calibration(scene, known, one, q)[0, 2])
    # 0.13 when written, from the noise of each pixel's slopes; a polynomial through the same points left 0.25
    assert np.log(ratio).std() / 2 < 0.18
    assert np.median(ratio) == pytest.approx(1.0, abs=0.1)


def test_both_clouds_become_one_without_doubles() -> None:
    both, found = captures([plane, ball]), calibration()
    clouds = {name: intersect_all(both, found, name) for name in ("left", "right")}
    one, grey = merged(clouds, {phase.camera: phase.image for phase in both}, found)
    joint = {name: int(np.sum(cloud.sight == Sight.JOINT)) for name, cloud in clouds.items()}
    points = {name: int(np.isfinite(cloud.xyz_mm[..., 2]).sum()) for name, cloud in clouds.items()}
    assert grey.shape == one.xyz_mm.shape[:2]
    assert one.xyz_mm.shape == (1, points["left"] + points["right"] - joint["right"], 3)
    X = one.xyz_mm[0] @ LEFT.R + LEFT.centre
    error = np.minimum(np.abs(X @ [0.15, -0.1, 1.0]), np.abs(np.linalg.norm(X - [0, 0, 70.0], axis=-1) - 30.0))
    assert np.quantile(error, 0.99) < 1.0


def test_wrong_requests_are_refused() -> None:
    both, found = captures([plane]), calibration()
    with pytest.raises(InputError, match="choose one of left, right"):
        intersect_all(both, found, "top")
    with pytest.raises(InputError, match="one camera alone"):
        intersect_all(both[:1], found, "left", rays="cameras")
