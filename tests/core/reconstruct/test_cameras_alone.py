"""Two calibrated cameras under a projector of which nothing is known: surfaces in closed form, seen by rays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

from core.errors import InputError, NoCoordinateError
from core.geometry import image_to_pixel, lens_of, pair_of, pixel_to_image, ray_directions
from core.model import AdjustedDevice, DeviceSpec, Interior, PhaseMap, PhotogrammetricCalibration
from core.orient import find_motion
from core.reconstruct import Sight, intersect_all, seen_by_other
from core.reconstruct.light_planes import off_their_planes
from tests.core.reconstruct import test_joint as joint

NOISE, AWAY = joint.NOISE, 4  # px from outlines


@dataclass(frozen=True)
class Bent(joint.Place):
    """A place whose lens bends straight lines, by 1.5 px in the corners of the image."""

    @property
    def interior(self) -> Interior:
        return Interior(self.c, 0.03, -0.02, (-2e-3, 2e-5, 0.0, 0.0, 1e-4, -1e-4), 0.0)

    def rays(self) -> np.ndarray:
        uv = np.stack(np.meshgrid(np.arange(self.spec.width), np.arange(self.spec.height)), axis=-1)
        return ray_directions(self.spec, self.interior, uv) @ self.R

    def image(self, X: np.ndarray) -> np.ndarray:
        plain = pixel_to_image(self.spec, super().image(X))
        return image_to_pixel(self.spec, lens_of(self.interior).distort(self.interior, plain))

    def device(self) -> AdjustedDevice:
        return AdjustedDevice(self.spec, self.interior, np.zeros(9), (0.0, 0.0), 0)


def turned(place: joint.Place, angle: float) -> joint.Place:
    """The same place, the device turned about its axis."""
    R = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]) @ place.R
    return replace(place, R=R)


LEFT, RIGHT = (Bent(p.spec, p.c, p.centre, p.R) for p in (joint.LEFT, joint.RIGHT))
FINER = Bent(DeviceSpec(360, 270, (0.0167, 0.0167), 12.0), 12.5, RIGHT.centre, RIGHT.R)
BETWEEN = joint.LAMP
ABOVE = joint.Place.looking(joint.PROJECTOR, 181.0, [60.0, 330.0, 880.0])
SURFACES: list[joint.Surface] = [joint.plane, joint.ball]


def cameras(left: joint.Place = LEFT, right: joint.Place = RIGHT) -> PhotogrammetricCalibration:
    """Both cameras and no more."""
    known = joint.calibration(left, right)
    names = [name for name in known.parameter_names if not name.startswith("projector.")]
    return replace(
        known,
        devices={name: known.devices[name] for name in ("left", "right")},
        orientations={"right": known.orientations["right"]},
        parameter_names=tuple(names),
        covariance=np.zeros((len(names), len(names))),
    )


def seen(axes: str, left=LEFT, right=RIGHT, lamp=BETWEEN, noise: float = NOISE) -> list[PhaseMap]:
    found = []
    for name, place, seed in (("left", left, 0), ("right", right, 1)):
        phase = joint.capture(place, lamp, SURFACES, name, noise, seed)
        nan = np.full_like(phase.u, np.nan)
        found.append(replace(phase, **{axis: nan for axis in "uv" if axis not in axes}))
    return found


@pytest.mark.parametrize(
    ("axes", "left", "right", "lamp"),
    [
        ("uv", LEFT, RIGHT, BETWEEN),
        ("u", LEFT, RIGHT, BETWEEN),
        ("u", LEFT, RIGHT, ABOVE),
        ("u", LEFT, FINER, ABOVE),
        ("u", turned(LEFT, 0.6), turned(RIGHT, -0.4), BETWEEN),
        ("v", LEFT, RIGHT, turned(ABOVE, 0.9)),
    ],
)
def test_labels_alone_tell_where_both_cameras_look(axes: str, left: Bent, right: Bent, lamp: joint.Place) -> None:
    """The r.m.s. of n errors over their sigmas is known to 1 / sqrt(2 n), of which every label is in four or so."""
    phases = seen(axes, left, right, lamp)
    cloud = intersect_all(phases, cameras(left, right), "left")
    error, depth = joint.depth_errors(cloud, left, SURFACES), joint.truth(left, SURFACES)
    assert cloud.sigma_depth_mm is not None
    assert cloud.sight is not None
    made = np.isfinite(error)
    assert (made == (cloud.sight == Sight.JOINT)).all()
    X = left.centre + left.rays() * depth[..., None]
    place, to = right.image(X), X - right.centre
    free = np.min([s(right.centre, to) for s in SURFACES], axis=0) > 1 - 1e-6
    width, height = right.spec.width, right.spec.height
    both = free & np.isfinite(phases[0].u if "u" in axes else phases[0].v)
    both &= np.all((place > AWAY) & (place < [width - AWAY, height - AWAY]), axis=-1)
    onball = (np.linalg.norm(X - [0.0, 0.0, 70.0], axis=-1) < 30.1) | ~both
    outline = cv2.morphologyEx(onball.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((2 * AWAY + 1,) * 2)) > 0
    sound = both & ~outline
    assert sound.sum() > 8000
    assert made[sound].mean() > 0.98
    ratio = (error / cloud.sigma_depth_mm)[sound & made]
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(1.0, abs=0.03)
    # elsewhere, at outlines and where one camera sees something else, nothing is made up
    assert np.mean(np.abs(error[made]) > 8 * cloud.sigma_depth_mm[made]) < 2e-4
    assert np.abs(error[made]).max() < 3.0


@pytest.mark.parametrize("right", [RIGHT, FINER, turned(RIGHT, 2.0)])
def test_places_in_the_other_camera_need_no_calibration(right: Bent) -> None:
    phases = seen("uv", LEFT, right)
    found = seen_by_other(*phases)
    X = LEFT.centre + LEFT.rays() * joint.truth(LEFT, SURFACES)[..., None]
    place = right.image(X)
    error = np.stack([found.u, found.v], axis=-1) - place
    made = np.isfinite(error).all(axis=-1)
    both = ((place > AWAY) & (place < [right.spec.width - AWAY, right.spec.height - AWAY])).all(axis=-1)
    both &= np.isfinite(phases[0].u) & (
        np.min([s(right.centre, X - right.centre) for s in SURFACES], axis=0) > 1 - 1e-6
    )
    assert made[both].mean() > 0.95
    z = (error / np.stack([found.sigma_u, found.sigma_v], axis=-1))[made]
    assert 0.75 < np.sqrt(np.mean(np.clip(z, -8, 8) ** 2)) < 1.0
    assert np.mean(np.abs(z) > 8) < 1e-3
    assert (found.camera, found.projector) == ("left", "right")


@pytest.mark.parametrize(("angle", "moved"), [(0.0, False), (2e-4, True)])
def test_two_cameras_are_watched_under_a_projector_that_may_move(angle: float, moved: bool) -> None:
    """The lamp, which the calibration does not know, stands elsewhere each time; the right camera has turned or not."""
    known, right = cameras(), turned(RIGHT, angle)
    lamps = [BETWEEN, ABOVE, turned(ABOVE, 0.9), turned(BETWEEN, 0.3)]
    looks = [
        find_motion(seen_by_other(*seen("uv", LEFT, right, lamp)), pair_of(known, "left", "right")) for lamp in lamps
    ]
    assert [look.moved for look in looks] == [moved] * len(lamps)
    if moved:
        for look in looks:
            off = look.rotation_rad - [0, 0, angle]
            assert np.abs(off / np.sqrt(look.covariance.diagonal()[:3])).max() < 4
            assert look.residual_rms > 1.1 * look.corrected_rms


def test_labels_as_noisy_as_a_pixel_is_wide_have_points() -> None:
    """Of labels known to 0.8 px places scatter by more than 3 px; a fifth was taken for those of two surfaces."""
    phases = seen("u", lamp=ABOVE, noise=3.5)
    cloud = intersect_all(phases, cameras(), "left")
    known = intersect_all(phases, joint.calibration(LEFT, RIGHT, ABOVE), "left", rays="cameras")
    assert np.isfinite(cloud.xyz_mm[..., 2]).sum() > 0.95 * np.isfinite(known.xyz_mm[..., 2]).sum()
    error = joint.depth_errors(cloud, LEFT, SURFACES) / cloud.sigma_depth_mm
    assert np.mean(np.abs(error[np.isfinite(error)]) > 8) < 1e-3


def test_points_of_another_surface_are_off_their_light() -> None:
    """Labels of a lens that bends by 5 lines; one point of 200 has the label of a place 10 lines or more away."""
    rng = np.random.default_rng(3)
    X = rng.uniform([-150, -100, 700], [150, 100, 900], (20_000, 3))
    x, y = X[:, 0] / X[:, 2], X[:, 1] / X[:, 2]
    lines = 512 + 1500 * x * (1 - 0.4 * (x * x + y * y)) + rng.normal(0, 0.05, len(x))
    wrong = rng.random(len(x)) < 0.005
    lines[wrong] += rng.choice([-1, 1], wrong.sum()) * rng.uniform(10, 60, wrong.sum())
    assert (off_their_planes(X, lines, y) == wrong).all()
    flat = X[:, :2] @ [[1, 0, 0.1], [0, 1, -0.2]] + [0, 0, 800.0]  # a plane alone tells not all of the seven numbers
    lines = 512 + 1500 * flat[:, 0] / flat[:, 2] + rng.normal(0, 0.05, len(x))
    assert not off_their_planes(flat, lines, flat[:, 1]).any()


def test_what_cannot_be_done_is_refused() -> None:
    with pytest.raises(NoCoordinateError, match="only v was decoded, which hardly changes along their epipolar lines"):
        intersect_all(seen("v"), cameras(), "left")
    with pytest.raises(InputError, match="was seen by one camera alone, and projector is not calibrated"):
        intersect_all(seen("u")[:1], cameras(), "left")
    with pytest.raises(NoCoordinateError, match="no projector coordinate was decoded by both"):
        intersect_all([seen("u")[0], seen("v")[1]], cameras(), "left")
