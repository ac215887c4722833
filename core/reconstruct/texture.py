"""Points where the code fails, by the texture that two cameras see: in gloss, on dark paint, in the projector's shadow.

The surface found so far is continued from the rim of a hole inwards, by a plane for each pixel; the window round the
pixel is matched along the epipolar line from there (`matching`). What was found counts as surface in the next round.
A match is refused where the texture explains too little of the grey values, where a second place looks alike, where
its sigma is too large, where it misfits more than others do, or where the other camera has decoded something else.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.geometry import project
from core.lazy import dataclass
from core.model import Array, Floats, PhotogrammetricCalibration, PointCloud
from core.parallel import run_in_bands
from core.progress import SILENT, Progress
from core.reconstruct.joint import Scene, Sight, Terms, by_calibration
from core.reconstruct.matching import FOUND, REACH_PX, match_windows
from core.reconstruct.placed import Device, placed
from core.reconstruct.rays import camera_rays

HALF = 9  # px either side of the pixel
AROUND = 12  # px either side from which a surface is continued
LEAST_KNOWN = 0.2  # of them
MOST_ACROSS = 1 / 8  # of the image's width: holes and bays up to twice as wide are filled
ROUNDS = 40
EXPLAINED = 0.5  # of the grey values' scatter in a window
RIVAL = 2.0  # what another place explains less, by so much more misfit at least
MOST_SIGMA_PX = 0.15  # along the epipolar line
ALIKE = 400  # matches of about the same grey value that tell the usual misfit
USUAL, MISFIT = 0.25, 1.5  # share of them that misfit less than usual; times the usual misfit
SMOOTH = 5  # times a window, over which a surface that bends bends alike
TWIST = 0.7  # of xy beside x² + y²: a fold's bend is then the same, within a fifth, whichever way it runs
BEND_SIGMA, FOLDED = 2.8, 3.0  # a bend's sigma in sigmas of inverse depth; sigmas from which it is a fold
CREST = 0.85  # of the largest bend nearby: the fold runs through the window's middle
FOLD, FLANK = 0.33, 0.14  # of the bend, by which the middle is off at a fold, and beside it
ELSEWHERE_PX = 2.0  # what the other camera decoded there appears farther off: it looks at something else
CELLS = 256  # of the table of the other camera's pixels


@dataclass(frozen=True)
class _Match(Scene):
    """A scene in which another camera saw a pixel's window where the devices as calibrated have it."""

    other: str = ""
    calibrated: Mapping[str, Device] = field(default_factory=dict)

    def terms(self, at: NDArray, directions: Array, q: Array) -> Terms:
        there = replace(self, devices=self.calibrated)
        found = there.seen(self.other, there.directions(at), q)[0]
        place, walk = self.seen(self.other, directions, q)
        length = np.linalg.norm(walk, axis=1)
        r = np.einsum("ni,ni->n", found - place, walk) / length
        return Terms(r[:, None], length[:, None], np.ones((len(q), 1)), np.zeros(len(q)), length)


def object_of(cloud: PointCloud) -> NDArray[np.bool_]:
    """The object in an image: pixels with points, and holes and bays among them that are not too wide."""
    r = int(MOST_ACROSS * cloud.xyz_mm.shape[1])
    unknown = np.pad(np.isnan(cloud.xyz_mm[..., 2]), r + 1, constant_values=True).astype(np.uint8)
    near = cv2.distanceTransform(unknown, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) <= r
    closed = cv2.distanceTransform(near.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) > r
    return np.asarray(closed[r + 1 : -r - 1, r + 1 : -r - 1])


def fill_by_texture(
    cloud: PointCloud,
    others: Mapping[str, PointCloud],
    images: Mapping[str, Floats],
    calibration: PhotogrammetricCalibration,
    camera: str,
    *,
    progress: Progress = SILENT,
) -> PointCloud:
    """Add points that two cameras see alike where none was decoded; their `sight` is `Sight.TEXTURE`.

    Parameters
    ----------
    cloud, others
        Of the pixels of `camera`, with `sight`; of the other cameras by name, each in its own frame.
    images : mapping
        Grey values (H, W) of all of them in the same light, NaN where they are not known.

    Raises
    ------
    InputError
        If there is no other camera.

    Notes
    -----
    Sigmas are from the grey values' misfit and the calibration's covariance, along the camera's axes, as `cloud` has
    them. Neighbouring matched points share most of their windows: their errors hang together over some `HALF` pixels.
    """
    if not others:
        raise InputError("--fill texture", "the capture was seen by one camera alone", "leave it out")
    devices = placed(calibration)
    rays = camera_rays(devices[camera].spec, devices[camera].interior)
    q = -1 / cloud.xyz_mm[..., 2].astype(np.float64)
    wanted = (covered := object_of(cloud)) & np.isnan(q) & np.isfinite(rays).all(axis=-1)
    best = np.full(q.shape, np.inf)
    xyz, sigma, depth, sight = (np.array(a) for a in (cloud.xyz_mm, cloud.sigma_mm, cloud.sigma_depth_mm, cloud.sight))
    for (name, other), part in zip(others.items(), progress.parts(len(others)), strict=True):
        scene = _Match(devices, (), camera, "all", "camera", name, devices)
        there, variance = _matched(scene, (images[camera], images[name]), rays, q, wanted, part)
        _refuse_elsewhere(scene, other, there)
        better = np.isfinite(there) & (variance < best)
        best[better] = variance[better]
        rows, columns = np.nonzero(better)
        directions = scene.directions(np.stack([columns, rows], axis=1))
        noise = np.sqrt(variance[better]) / there[better] ** 2
        by = by_calibration(scene, calibration, better, there)
        xyz[better] = directions / there[better][:, None]
        sigma[better] = np.sqrt(scene.turned(directions * noise[:, None]) ** 2 + by)
        depth[better], sight[better] = noise, Sight.TEXTURE
    return replace(cloud, xyz_mm=xyz, sigma_mm=sigma, sigma_depth_mm=depth, sight=sight, object_px=int(covered.sum()))


def _matched(
    scene: _Match,
    images: tuple[Floats, Floats],
    rays: Floats,
    known: Array,
    wanted: NDArray[np.bool_],
    progress: Progress,
) -> tuple[Array, Array]:
    """Inverse depths of wanted pixels and their variances, NaN where nothing was matched."""
    device = scene.devices[scene.other]
    pose = device.from_base @ scene.devices[scene.camera].from_base.inverse()
    table, grid = _table(device)
    own, other = (np.ascontiguousarray(image, np.float32) for image in images)
    q, variance, misfit, grey, bend, twist = (np.full(known.shape, np.nan) for _ in range(6))
    surface, left = known.copy(), wanted.copy()
    for turn in range(ROUNDS):
        progress(turn / ROUNDS, "matching texture")
        rows, columns, seeds = _continued(surface, left)
        if not len(rows):
            break
        at, found = np.stack([columns, rows], axis=1), np.empty((len(rows), FOUND))
        which = (at, seeds, HALF, own, other, rays, pose.rotation, pose.translation_mm, table, grid, surface, found)
        run_in_bands(partial(_bands_of, which), len(rows))
        left[rows, columns] = False
        value, square, square_px, explained, rest, light, away, rival, bent, twisted = found.T
        with np.errstate(invalid="ignore"):
            good = (explained > EXPLAINED) & (rival > RIVAL) & (away < REACH_PX) & (value > 0)
            good &= np.sqrt(square_px) < MOST_SIGMA_PX
        place = rows[good], columns[good]
        surface[place] = q[place] = value[good]
        variance[place], misfit[place], grey[place] = square[good], rest[good], light[good]
        bend[place], twist[place] = bent[good], twisted[good]
    order = np.argsort(grey, axis=None)[: np.count_nonzero(np.isfinite(grey))]
    for alike in np.array_split(order, max(1, len(order) // ALIKE)) if len(order) else ():  # noise grows with light
        rest = misfit.flat[alike]
        q.flat[alike[rest > MISFIT * np.quantile(rest, USUAL)]] = np.nan
    _refuse_folds(q, variance, np.stack([bend, twist], axis=-1), surface)
    return q, variance


def _refuse_folds(q: Array, variance: Array, bend: Array, surface: Array) -> None:
    """Drop matches in the middle of whose window the surface folds; elsewhere a fold's bias joins the variance.

    A parabola rounds a fold off: it bends more there, `bend` (H, W, 2), x² + y² and xy over half a window, than the
    surface does over a wider one. Its middle is off by a fifth of the bend at the fold, and the other way beside it.
    """
    rows, columns = np.nonzero(np.isfinite(q))
    own, noise = bend[rows, columns], BEND_SIGMA * np.sqrt(variance[rows, columns])
    smooth = _fitted(surface, rows, columns, SMOOTH * HALF, 2)[:, 3:] @ (HALF**2 * np.array([[1, 0], [0, 1], [1, 0]]))
    more = np.fmin(*(np.abs(each) @ [1, TWIST] for each in (own, own - smooth)))
    excess = np.zeros(q.shape)
    excess[rows, columns] = np.sqrt(np.maximum(more**2 - noise**2, 0))
    crest = (excess > CREST * cv2.dilate(excess, np.ones((HALF, HALF))))[rows, columns]
    variance[rows, columns] += (np.where(crest, FOLD, FLANK) * excess[rows, columns]) ** 2
    folded = crest & (more > FOLDED * noise)
    q[rows[folded], columns[folded]] = np.nan


def _bands_of(which: tuple, first: int, last: int) -> None:
    match_windows(first, last, *which)


def _continued(surface: Array, left: NDArray[np.bool_]) -> tuple[NDArray, NDArray, Array]:
    """Rows, columns and seeds (n, 3) of pixels left that have enough surface round them: a plane fitted to it."""
    size = (2 * AROUND + 1, 2 * AROUND + 1)
    known = cv2.boxFilter(np.isfinite(surface).astype(np.float64), -1, size, borderType=cv2.BORDER_CONSTANT)
    rows, columns = np.nonzero(left & (known > LEAST_KNOWN))
    fit = _fitted(surface, rows, columns, AROUND, 1)
    fit[:, 0] += fit[:, 1] * columns + fit[:, 2] * rows
    return rows, columns, fit


def _fitted(surface: Array, rows: NDArray, columns: NDArray, half: int, degree: int) -> Array:
    """Fit planes or parabolas to what is known round pixels: 1, x, y, x², xy, y² of the image, by px (n, 3 or 6)."""
    weight, size = np.isfinite(surface).astype(np.float64), (2 * half + 1, 2 * half + 1)

    def sums(values: Array) -> Array:
        every = cv2.boxFilter(values, cv2.CV_64F, size, normalize=False, borderType=cv2.BORDER_CONSTANT)
        return np.asarray(every)[rows, columns]

    height, width = surface.shape
    y, x = np.mgrid[:height, :width] / width
    terms = [x**i * y ** (n - i) for n in range(degree + 1) for i in range(n, -1, -1)]
    value = np.where(weight > 0, surface, 0.0)
    N = np.array([[sums(weight * a * b) for a in terms] for b in terms])
    right = np.array([sums(value * a) for a in terms])
    fit = np.linalg.solve(np.moveaxis(N, 2, 0), right.T[..., None])[..., 0]
    return np.asarray(fit / np.array([1, width, width, *[width**2] * 3])[: len(terms)])


def _table(device: Device) -> tuple[Array, Array]:
    """Pixels of a device (n, n, 2) over its directions, and the table's corner and cells by unit of direction (4,)."""
    seen = camera_rays(device.spec, device.interior)
    low, high = np.nanmin(seen, axis=(0, 1)).astype(float), np.nanmax(seen, axis=(0, 1)).astype(float)
    a, b = (np.linspace(low[k], high[k], CELLS + 1) for k in (0, 1))
    directions = np.stack([*np.meshgrid(a, b), np.full((CELLS + 1, CELLS + 1), -1.0)], axis=-1)
    return project(device.spec, device.interior, directions), np.array([*low, *(CELLS / (high - low))])


def _refuse_elsewhere(scene: _Match, other: PointCloud, q: Array) -> None:
    """Drop matches at whose place in the other camera's image that camera has a point that this one sees elsewhere."""
    rows, columns = np.nonzero(np.isfinite(q))
    at = np.stack([columns, rows], axis=1)
    place = scene.seen(scene.other, scene.directions(at), q[rows, columns])[0]
    height, width = other.xyz_mm.shape[:2]
    column, row = np.clip(np.rint(place), 0, [width - 1, height - 1]).astype(int).T
    point = other.xyz_mm[row, column].astype(np.float64)
    devices = scene.devices
    pose = devices[scene.camera].from_base @ devices[scene.other].from_base.inverse()
    device = devices[scene.camera]
    with np.errstate(invalid="ignore"):
        away = np.linalg.norm(project(device.spec, device.interior, point, pose) - at, axis=1) > ELSEWHERE_PX
    q[rows[away], columns[away]] = np.nan
