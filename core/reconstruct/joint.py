"""Forward intersection from all that saw a point: several cameras, several projectors.

A pixel of the camera whose cloud is made has a fixed ray, and the inverse depth q on it is the one unknown, as in
`intersect`. The projector coordinates that this camera decoded are observed once; another camera decoded them where the
point appears in its image, between pixels, and observes them once more:

    r = L(x(q)) - f(q),    L: coordinates decoded by that camera, interpolated at its image x(q) of the point

with the same projection f into the projector. Their noise is independent, so that plain weights hold. Of cameras alone,
the projector only labels corresponding places: ``r = L(x(q)) - L_own``, and neither the projector's orientation nor its
drift enters; the noise of L_own is common to the residuals of all other cameras. Newton's step is
``q <- q + Σ w J r / Σ w J²`` with ``J = -dr/dq``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from enum import IntEnum
from functools import partial
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from core.algebra import on_own_threads
from core.errors import InputError, NoCoordinateError
from core.geometry import project, ray_directions
from core.lazy import dataclass
from core.model import Array, Floats, PhaseMap, PhotogrammetricCalibration, PointCloud
from core.numerics import chi_square_limit, nearest, spaced
from core.parallel import run_in_bands
from core.progress import SILENT, Progress
from core.reconstruct.epipolar import depths_by_cameras
from core.reconstruct.intersect import LEAST_VARIANCE, intersect
from core.reconstruct.labels import Labels, labels_of
from core.reconstruct.placed import Device, moved, placed
from core.reconstruct.rays import camera_rays

Rays = Literal["all", "cameras"]
Along = Literal["camera", "base"]  # whose axes: the camera's, or those of the device that orientations refer to

STEPS = 2  # from one camera's own solution
SLIGHT = 1e-6  # relative change of q for a derivative
REACH_PX = 4.0  # another camera that sees other coordinates farther off than this looks at something else
BEYOND = 1e-6  # share of sound points whose rays may be called disagreeing
SAMPLES = 2000  # points at which the calibration's covariance is carried through
NEAR = 3  # of them tell that of any other point: one may lie at a rim


class Sight(IntEnum):
    """How a point was seen."""

    NONE = 0
    OWN = 1  # by the one camera; no other has coordinates there
    JOINT = 2  # by other cameras too
    HIDDEN = 3  # another camera sees something else where the point should appear; made without the others
    DISAGREE = 4  # others see it, but the rays miss one another; made without them, and its sigma holds the change
    TEXTURE = 5  # not decoded; matched in the images of two cameras


@dataclass(frozen=True)
class View:
    """The coordinates that a camera decoded of a projector."""

    camera: str
    projector: str
    labels: Labels


@dataclass(frozen=True)
class Terms:
    """Residuals r, slopes J and weights w of some pixels, each (n, 2 views)."""

    r: Array
    J: Array
    w: Array
    off_px: Array  # (n,), by how much other cameras see something else; NaN where none sees the point
    walk_px: Array  # (n,), how fast the point walks through other cameras' images with q


@dataclass(frozen=True)
class Scene:
    """The devices, what was decoded, and whose pixels are asked for."""

    devices: Mapping[str, Device]
    views: Sequence[View]
    camera: str
    rays: Rays
    along: Along = "camera"

    def turned(self, vectors: Array) -> Array:
        """Vectors (..., 3) of the camera's frame along the axes in which sigmas are wanted."""
        return vectors if self.along == "camera" else vectors @ self.devices[self.camera].from_base.rotation

    def directions(self, at: NDArray) -> Array:
        """Directions (n, 3) in which pixels (n, 2) look."""
        device = self.devices[self.camera]
        return ray_directions(device.spec, device.interior, at)

    def seen(self, name: str, directions: Array, q: Array) -> tuple[Array, Array]:
        """Where a device sees the points at inverse depths q (n,), (n, 2), and how that changes with q."""
        device = self.devices[name]
        pose = device.from_base @ self.devices[self.camera].from_base.inverse()
        here, beside = (
            project(device.spec, device.interior, directions / inverse[:, None], pose)
            for inverse in (q, q * (1 + SLIGHT))
        )
        return here, (beside - here) / (q * SLIGHT)[:, None]

    def terms(self, at: NDArray, directions: Array, q: Array) -> Terms:
        """Compare what was decoded with what pixels (n, 2) should see at inverse depths q (n,)."""
        own = {v.projector: v.labels.at_pixels(at) for v in self.views if v.camera == self.camera}
        views = [v for v in self.views if self.rays == "all" or (v.camera != self.camera and v.projector in own)]
        other = {v.camera for v in views} - {self.camera}
        lines = {v.projector for v in views} if self.rays == "all" else set()
        seen = {name: self.seen(name, directions, q) for name in other | lines}
        parts, like, off, unknown = [], [], [np.full(len(q), np.nan)], np.full((len(q), 2), np.nan)
        fastest = np.max([np.zeros(len(q)), *(np.linalg.norm(seen[name][1], axis=1) for name in other)], axis=0)
        for view in views:
            value, variance = own.get(view.projector, (unknown, unknown))
            expected, by_q = seen[view.projector] if self.rays == "all" else (value, np.zeros((len(q), 2)))
            if view.camera != self.camera:
                place, walk = seen[view.camera]
                value, variance, gradient = view.labels.between(place)
                by_q = by_q - np.einsum("nij,nj->ni", gradient, walk)
            rest = value - expected
            known = np.isfinite(rest) & np.isfinite(by_q)
            parts.append([np.where(known, x, 0.0) for x in (rest, by_q, 1 / np.maximum(variance, LEAST_VARIANCE))])
            like.append(view.projector)
            if view.camera != self.camera:
                away = np.where(known, np.abs(rest) / np.linalg.norm(gradient, axis=2), np.nan)
                off.append(np.fmax(away[:, 0], away[:, 1]))
        if self.rays == "cameras":
            parts += [
                _in_common([part for part, name in zip(parts, like, strict=True) if name == each], own[each][1])
                for each in dict.fromkeys(like)
            ]
        r, J, w = (np.concatenate(column, axis=1) for column in zip(*parts, strict=True))
        return Terms(r, J, w, np.fmax.reduce(off), fastest)

    def solve(self, at: NDArray, directions: Array, q: Array) -> tuple[Array, Array, Array, Array, NDArray]:
        """Give inverse depths, their variances by noise, weighted squares, numbers of observations, and sight."""
        terms = self.terms(at, directions, q)
        sight = np.where(np.isfinite(terms.off_px), np.uint8(Sight.JOINT), np.uint8(Sight.OWN))
        sight[terms.off_px > REACH_PX] = Sight.HIDDEN
        begin = q
        with np.errstate(invalid="ignore", divide="ignore"):
            for _ in range(STEPS):
                variance = 1 / np.sum(terms.w * terms.J**2, axis=1)
                q = q + np.sum(terms.w * terms.J * terms.r, axis=1) * variance
                terms = self.terms(at, directions, q)
        lost = ~(terms.off_px < REACH_PX) | (np.abs(q - begin) * terms.walk_px > 2 * REACH_PX)
        sight[(sight == Sight.JOINT) & lost] = Sight.HIDDEN  # it walked off what it should see
        return q, variance, np.sum(terms.w * terms.r**2, axis=1), np.count_nonzero(terms.w > 0, axis=1), sight


def _in_common(parts: Sequence[Sequence[Array]], variance: Array) -> list[Array]:
    """What allows for the error of the label that residuals r, slopes J, weights w (n, 2) of cameras have in common.

    The inverse of ``diag(1/w) + variance 1 1ᵀ`` is ``diag(w) - w wᵀ / (1/variance + Σ w)``: of any such sum the second
    part is that of one more residual, the mean of all, of negative weight.
    """
    r, J, w = (np.stack(column) for column in zip(*parts, strict=True))
    total = np.maximum(w.sum(axis=0), np.finfo(float).tiny)
    label = np.maximum(np.nan_to_num(variance, nan=1.0), LEAST_VARIANCE)
    return [(w * r).sum(axis=0) / total, (w * J).sum(axis=0) / total, -(total**2) / (1 / label + total)]


@on_own_threads()
def intersect_all(
    phases: Sequence[PhaseMap],
    calibration: PhotogrammetricCalibration,
    camera: str,
    *,
    rays: Rays = "all",
    along: Along = "camera",
    progress: Progress = SILENT,
) -> PointCloud:
    """Intersect the pixels of one camera with all that saw the same points.

    Parameters
    ----------
    phases : sequence of PhaseMap
        Of one capture, one for each camera and projector.
    camera : str
        Whose pixels; it must be among `phases`.
    rays : {"all", "cameras"}
        Cameras and projectors, or cameras alone, for which the projector labels places and no more.
    along : {"camera", "base"}
        The axes of sigmas; "base" also lets them hold what is not known of where the camera stands.

    Returns
    -------
    cloud : PointCloud
        In this camera's frame. `sight` holds a `Sight` for each pixel. Of cameras alone, only joint points remain.

    Raises
    ------
    InputError
        If `phases` lack the camera, or cameras alone are wanted and there is but one.
    """
    views = [View(p.camera, p.projector, labels_of(p)) for p in phases]
    own = [phase for phase in phases if phase.camera == camera]
    if not own:
        known = ", ".join(sorted({p.camera for p in phases}))
        raise InputError("the capture", f"holds nothing decoded of {camera}", f"choose one of {known}")
    lit = {phase.projector for phase in own} <= set(calibration.devices)
    rays = rays if lit else "cameras"
    if rays == "cameras" and len(own) == len(phases):
        seen = "was seen by one camera alone" + ("" if lit else f", and {own[0].projector} is not calibrated")
        remedy = "use rays from the projector too" if lit else "capture by two calibrated cameras, or calibrate it too"
        raise InputError("the capture", seen, remedy)
    scene = Scene(placed(calibration), views, camera, rays, along)
    starts = _starts(scene, own, calibration, lit)
    plane = camera_rays(scene.devices[camera].spec, scene.devices[camera].interior)  # they are made by now
    directions = np.concatenate([plane, np.full_like(plane[..., :1], -1.0)], axis=-1, dtype=np.float64)
    progress(0.3, "intersecting all rays")
    begin = starts[0]
    for more in starts[1:]:  # where the first projector's light does not reach, or the first other camera
        begin = np.where(np.isfinite(begin), begin, more)
    q = begin.copy()
    sight = np.where(np.isfinite(q), np.uint8(Sight.OWN), np.uint8(Sight.NONE))
    rss, count, noise = np.zeros(q.shape), np.zeros(q.shape, int), np.full(q.shape, np.nan)

    def solve(scene: Scene, which: NDArray) -> None:
        def band(first: int, last: int) -> None:
            progress.check()
            rows, columns = np.nonzero(which[first:last])
            place = rows + first, columns
            if len(rows):
                q[place], noise[place], rss[place], count[place], sight[place] = scene.solve(
                    np.stack([columns, rows + first], axis=1), directions[place], begin[place]
                )

        run_in_bands(band, len(q))

    solve(scene, sight != Sight.NONE)
    noise *= _tell_disagreeing(sight, rss, count)
    disagree, of_all, missed = sight == Sight.DISAGREE, q.copy(), rss / np.maximum(count - 1, 1)
    by_itself, told = replace(scene, views=[v for v in views if v.camera == camera]), sight.copy()
    if rays == "all":
        solve(by_itself, (sight == Sight.HIDDEN) | (sight == Sight.DISAGREE))
    else:
        told[told != Sight.JOINT] = Sight.NONE
    inside = cv2.erode(np.isfinite(begin).astype(np.uint8), np.ones((5, 5))) > 0  # a jump there shows two surfaces
    noise[disagree] *= np.where(inside, missed, 1.0)[disagree]
    noise[disagree] += (q - of_all)[disagree] ** 2
    q[told == Sight.NONE] = np.nan
    sigma_depth = np.sqrt(noise) / q**2
    variance = scene.turned(directions * sigma_depth[..., None]) ** 2
    for which, by in ((told == Sight.JOINT, scene), ((told != Sight.JOINT) & (told != Sight.NONE), by_itself)):
        variance[which] += by_calibration(by, calibration, which, q)
    progress(1.0, "points are reconstructed")
    with np.errstate(over="ignore"):  # where rays are all but parallel to the light
        xyz, sigma, depth = (a.astype(np.float32) for a in (directions / q[..., None], np.sqrt(variance), sigma_depth))
    return PointCloud(xyz, sigma, depth, told)


def intersect_each(
    phases: Sequence[PhaseMap],
    calibration: PhotogrammetricCalibration,
    cameras: Sequence[str],
    *,
    rays: Literal["all", "cameras"] = "all",
    along: Literal["camera", "base"] = "camera",
    progress: Progress = SILENT,
) -> dict[str, PointCloud]:
    """Points of several cameras by `intersect_all`, by camera.

    A camera whose frames tell no points has none; NoCoordinateError if there is no other.
    """
    clouds, refused = {}, None
    for each, part in zip(cameras, progress.parts(len(cameras)), strict=True):
        try:
            clouds[each] = intersect_all(phases, calibration, each, rays=rays, along=along, progress=part)
        except NoCoordinateError as error:  # of one axis, that changes along no epipolar lines, or in the dark
            refused = error
    if refused and not clouds:
        raise refused
    return clouds


def _starts(scene: Scene, own: Sequence[PhaseMap], calibration: PhotogrammetricCalibration, lit: bool) -> list[Array]:
    """Inverse depths (H, W) of a camera's pixels by each calibrated projector, or by each other camera.

    A single axis may change along the epipolar lines of some of them alone: NoCoordinateError if of none. Of cameras
    alone, where the projector stands does not matter, and its light helps at the image's rim.
    """

    def by_light(phase: PhaseMap) -> Array:
        return np.asarray(-1 / intersect(phase, calibration).xyz_mm[..., 2].astype(np.float64))

    labels = {view.projector: view.labels for view in scene.views if view.camera == scene.camera}
    others = [view for view in scene.views if view.camera != scene.camera and view.projector in labels]
    devices, here = scene.devices, scene.devices[scene.camera]
    lights = [partial(by_light, phase) for phase in own] if lit else []
    cameras = [partial(depths_by_cameras, here, labels[v.projector], devices[v.camera], v.labels) for v in others]
    found, refused = [], None
    for ways in [lights, cameras] if scene.rays == "all" else [[*cameras, *lights]]:
        for way in ways:
            try:
                found.append(way())
            except NoCoordinateError as error:
                refused = error
        if found and not refused:
            break
    if refused and not found:
        raise refused
    return found


def each_once(clouds: Mapping[str, PointCloud]) -> dict[str, PointCloud]:
    """Take joint and matched points of several cameras from the first one alone; elsewhere they become NaN."""
    left: dict[str, PointCloud] = {}
    for name, cloud in clouds.items():
        assert cloud.sight is not None
        twice = (cloud.sight == Sight.JOINT) | (cloud.sight == Sight.TEXTURE)
        again = (twice & bool(left))[..., None]
        left[name] = replace(cloud, xyz_mm=np.where(again, np.float32(np.nan), cloud.xyz_mm))
    return left


def merged(
    clouds: Mapping[str, PointCloud], images: Mapping[str, Floats], calibration: PhotogrammetricCalibration
) -> tuple[PointCloud, Floats]:
    """Join the clouds of several cameras, each point once, in the frame of the device that orientations refer to.

    From those of `intersect_all` and the grey values (H, W) of the same cameras to a cloud (1, n, 3), with `source`,
    and grey values (1, n). A joint or matched point is taken from the first camera; sigmas stay along the axes that the
    clouds have them in.
    """
    devices = placed(calibration)
    parts = [
        (devices[name], cloud, np.full(images[name].shape, i, np.uint8), images[name])
        for i, (name, cloud) in enumerate(each_once(clouds).items())
    ]
    cloud, image = in_one_frame(parts)
    return replace(cloud, object_px=next(iter(clouds.values())).object_px), image


def in_one_frame(parts: Iterable[tuple[Device, PointCloud, NDArray, Floats]]) -> tuple[PointCloud, Floats]:
    """Join the clouds of devices, with what made every pixel and grey values, in the frame that orientations refer to.

    Of the cloud (1, n, 3) and grey values (1, n) `source` is what made the points.
    """
    found = []
    for device, cloud, made, image in parts:
        keep = np.isfinite(cloud.xyz_mm[..., 2])
        assert cloud.sigma_mm is not None
        assert cloud.sigma_depth_mm is not None
        assert cloud.sight is not None
        xyz = device.from_base.inverse().apply(cloud.xyz_mm[keep]).astype(np.float32)
        own = (cloud.sigma_mm, cloud.sigma_depth_mm, cloud.sight, made, image)
        found.append((xyz, *(values[keep] for values in own)))
    xyz, sigma, depth, sight, made, image = (np.concatenate(column)[None] for column in zip(*found, strict=True))
    return PointCloud(xyz, sigma, depth, sight, made), image


def _tell_disagreeing(sight: NDArray, rss: Array, count: NDArray) -> Array:
    """Mark points whose rays, of several pairs, miss one another by more than chance and the image's usual misfit.

    Give that misfit (H, W) over what noise makes of it, squared, at least 1: how all devices stand is no point's fault,
    but each point is off by that.
    """
    misfit, seen = np.ones(sight.shape), sight.copy()
    for kind, pair in ((Sight.JOINT, 1), (Sight.OWN, 2)):  # a pair by itself has its epipolar residual alone
        for n in np.unique(count[(seen == kind) & (count > pair)]):
            alike = (seen == kind) & (count == n)
            usual = max(1.0, float(np.median(rss[alike])) / chi_square_limit(int(n) - 1, 0.5))
            misfit[alike] = usual
            sight[alike & (rss > usual * chi_square_limit(int(n) - 1, BEYOND))] = Sight.DISAGREE
    return misfit


def by_calibration(scene: Scene, calibration: PhotogrammetricCalibration, which: NDArray, q: Array) -> Array:
    """Variances (n, 3), mm², of some points by the calibration's covariance.

    They are worked out for points spread over the image; every point has the median of the nearest of these.
    """
    rows, columns = np.nonzero(which)
    C = calibration.covariance
    uncertain = np.flatnonzero(np.diag(C) > 0)
    if not len(rows) or not len(uncertain):
        return np.zeros((len(rows), 3))
    some = spaced(len(rows), SAMPLES)
    at, depths = np.stack([columns[some], rows[some]], axis=1), q[rows[some], columns[some]]
    directions = scene.directions(at)
    terms = scene.terms(at, directions, depths)
    per = terms.w * terms.J / np.sum(terms.w * terms.J**2, axis=1)[:, None]

    def points(scene: Scene, directions: Array, depths: Array) -> Array:
        found = directions / depths[:, None]
        return found if scene.along == "camera" else scene.devices[scene.camera].from_base.inverse().apply(found)

    start, G = points(scene, directions, depths), np.empty((len(some), 3, len(uncertain)))
    for k, parameter in enumerate(uncertain):
        step = np.zeros(len(C))
        step[parameter] = np.sqrt(C[parameter, parameter])  # so little that one side of it tells the slope
        there = replace(scene, devices=moved(scene.devices, calibration, step))
        turned = there.directions(at)
        depth = depths + np.sum(per * (there.terms(at, turned, depths).r - terms.r), axis=1)
        G[:, :, k] = (points(there, turned, depth) - start) / step[parameter]
    variance = np.maximum(np.einsum("nik,kl,nil->ni", G, C[np.ix_(uncertain, uncertain)], G), 0.0)
    sound = np.isfinite(variance).all(axis=1)
    if not sound.any():
        return np.full((len(rows), 3), np.nan)
    places = np.stack([columns, rows, q[which]], axis=1) / [*which.shape[::-1], np.median(depths)]
    few = 1 if len(some) == len(rows) else NEAR
    near = nearest(places[some[sound]], min(few, int(sound.sum())), of=places)
    return np.asarray(np.median(variance[sound][near], axis=1))
