"""A camera and a projector as most programs describe them: pinholes with radial and decentring distortion."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from core.errors import InputError
from core.geometry import Pose, calibration_of, distort, image_to_pixel, pair_of, pixel_to_image, project
from core.geometry.lens import MAIN, fitted
from core.geometry.rotation import cross_matrix
from core.lazy import dataclass
from core.model import AdjustedDevice, Array, DeviceSpec, Interior, PhotogrammetricCalibration, Verdict

DISTORTION = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")  # in OpenCV's order
VALUES = ("fx", "fy", "cx", "cy", *DISTORTION)
LIMIT_PX = 1.0  # r.m.s. that a fit may leave
SAME_PX = 0.005  # r.m.s. below which our own lens model says the same
FLIP = np.diag([1.0, -1.0, -1.0])
MODEL = "brown"


@dataclass(frozen=True)
class Pinhole:
    """A device in OpenCV's model and axes; pixels count from the centre of the top-left one.

    `distortion` holds k1, k2, p1, p2, k3, k4, k5, k6; `rms_px` is what fitting ours to it left. A file that does not
    give the image's size leaves it 0.
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
    """Camera and projector, and the projector's pose from the camera's: ``X_p = R X_c + t``, OpenCV's axes, mm.

    Or two cameras; `more` are further devices of a file, with R and t from the first one.

    `covariance` (30, 30), where it is known, is that of `VALUES` of the camera, of the projector, of a small rotation
    after R and of t.
    """

    camera: Pinhole
    projector: Pinhole
    rotation: Array
    translation_mm: Array
    covariance: Array | None = None
    more: tuple[tuple[Pinhole, Array, Array], ...] = ()


def fit_pair(
    calibration: PhotogrammetricCalibration, free: Sequence[str], camera: str = "", projector: str = ""
) -> Pair:
    """Say a camera and a projector (the first, if unnamed) in this model with a format's distortion parameters.

    Two cameras go the same way, the second one in the projector's place. A calibration that failed has no sigmas to
    hand on.

    Raises
    ------
    InputError
        If the model cannot hold a device to `LIMIT_PX`.
    """
    pair = pair_of(calibration, camera, projector)
    turned = pair.projector_from_camera
    pose = Pose(FLIP @ turned.rotation @ FLIP, FLIP @ turned.translation_mm)
    own = pair.camera, pair.projector
    names = (camera, projector) if projector in calibration.cameras else ("camera", "projector")
    found = [fit_device(n, d.spec, d.interior, free) for n, d in zip(names, own, strict=True)]
    covariance, failed = None, calibration.verdict is not None and calibration.verdict.state == "failed"
    if np.any(np.diagonal(pair.covariance) > 0) and not failed:
        use = [k for k, n in enumerate(VALUES) if n not in DISTORTION or n in free]
        ways = ((_ours(d), _theirs(p), p) for d, p in zip(own, found, strict=True))
        covariance = _carried(pair.covariance, ways, pose, np.eye(3), use)
    return Pair(found[0], found[1], pose.rotation, pose.translation_mm, covariance)


Way = tuple[Array, Callable[[Array, Array], Array]]  # parameters, and pixels (n, 2) by parameters and tangents (n, 2)


def _ours(device: AdjustedDevice) -> Way:
    at, spec = device.interior, device.spec

    def seen(values: Array, tangents: Array) -> Array:
        interior = Interior.from_vector(values, at.r0_mm, at.model)
        return project(spec, interior, np.column_stack([tangents * (1, -1), -np.ones(len(tangents))]))

    return at.vector, seen


def _theirs(p: Pinhole) -> Way:
    def seen(values: Array, tangents: Array) -> Array:
        lens = Interior(1.0, 0.0, 0.0, (*values[4:].tolist(), 0.0), 1.0, MODEL)
        return values[2:4] + values[:2] * (1, -1) * distort(lens, tangents * (1, -1))

    return np.array([p.fx, p.fy, p.cx, p.cy, *p.distortion]), seen


def _carried(
    covariance: Array,
    ways: Iterable[tuple[Way, Way, Pinhole]],
    pose: Pose,
    axes: Array,
    use: Sequence[int] | None = None,
) -> Array:
    """Give the covariance of a pair, the orientation's too, of one model in the parameters of another.

    What one model leaves of the other, which no parameter holds, counts as an uncertainty of the same size, r.m.s. over
    the image: of the interior orientation and, as most of it looks like a turn, of where each device looks. `pose` is
    the projector's from the camera's with the other model's `axes`, a matrix that gives these from OpenCV's.
    """
    from scipy.linalg import block_diag  # only now: it takes a while to load

    followed, interior, turns = zip(*(_followed(*way, use) for way in ways), strict=True)
    by_camera, by_projector = (axes @ turn @ axes.T for turn in turns)
    about = np.vstack([np.eye(3), -cross_matrix(pose.translation_mm)])  # a projector that turns about its own centre
    orientation = about @ by_projector @ about.T
    orientation[:3, :3] += pose.rotation @ by_camera @ pose.rotation.T
    L = block_diag(*followed, FLIP, FLIP)
    return np.asarray(L @ covariance @ L.T + block_diag(*interior, orientation))


def _followed(of: Way, to: Way, p: Pinhole, use: Sequence[int] | None) -> tuple[Array, Array, Array]:
    """How those parameters of a model that are in `use` follow another's, (n, m), so that the image stays the same.

    Then the covariances, (n, n) of these and (3, 3) of turns about OpenCV's axes, whose effect over the image is as
    large, r.m.s., as what one model leaves of the other.
    """
    u, v = np.meshgrid(np.linspace(0, p.width - 1, 15), np.linspace(0, p.height - 1, 15))
    tangents = np.column_stack([(u.ravel() - p.cx) / p.fx, (v.ravel() - p.cy) / p.fy])
    rays = np.column_stack([tangents, np.ones(len(tangents))])

    def turned(turn: Array, rays: Array) -> Array:
        x, y, z = (rays + np.cross(turn, rays)).T
        return to[1](to[0], np.column_stack([x / z, y / z]))

    a, b, by_turn = _derivatives(of, tangents), _derivatives(to, tangents), _derivatives((np.zeros(3), turned), rays)
    chosen = np.arange(b.shape[1]) if use is None else np.array(use)
    scale, found, interior = (
        np.linalg.norm(b[:, chosen], axis=0),
        np.zeros((b.shape[1], a.shape[1])),
        np.zeros(2 * b.shape[1:]),
    )
    B = b[:, chosen] / scale
    found[chosen] = np.linalg.lstsq(B, a, rcond=None)[0] / scale[:, None]
    left = np.sum((of[1](of[0], tangents) - to[1](to[0], tangents)) ** 2)
    interior[np.ix_(chosen, chosen)] = left / len(chosen) * np.linalg.inv(B.T @ B) / np.outer(scale, scale)
    return found, interior, left / 3 * np.linalg.inv(by_turn.T @ by_turn)


def _derivatives(way: Way, tangents: Array) -> Array:
    values, seen = way
    steps = np.diag(1e-6 * np.maximum(np.abs(values), 1e-2))
    both = [
        (seen(values + step, tangents) - seen(values - step, tangents)).ravel() / (2 * step.sum()) for step in steps
    ]
    return np.stack(both, axis=1)


def fit_device(name: str, spec: DeviceSpec, interior: Interior, free: Sequence[str]) -> Pinhole:
    """Fit this model to a device over its whole image."""
    found, rms = fitted(spec, interior, MODEL, (*MAIN, *free, "b1"))
    if not rms <= LIMIT_PX:
        raise InputError(
            f"{name} of the calibration",
            f"with {', '.join(free) or 'no distortion'} alone it is off by {rms:.3g} px r.m.s., more than {LIMIT_PX:g}",
            "choose a format with more distortion parameters, or calibrate with fewer (--hold): these know no shear",
        )
    *k, b1 = found.a
    fx, fy = found.c_mm * (1 + b1) / spec.pitch_mm[0], found.c_mm / spec.pitch_mm[1]
    cx, cy = image_to_pixel(spec, [found.x0_mm, found.y0_mm]).tolist()
    return Pinhole(name, spec.width, spec.height, fx, fy, cx, cy, tuple(k), rms)


def _sized(p: Pinhole, spec: DeviceSpec) -> Pinhole:
    return p if p.width or p.height else replace(p, width=spec.width, height=spec.height)


def device_from(p: Pinhole, spec: DeviceSpec) -> AdjustedDevice:
    """Make a device of the project's raster from this model; nothing is known of its sigmas.

    The program's own lens model is taken where it says the same to `SAME_PX`, else that of OpenCV.
    """
    if spec.labels_only:
        seen = f"has neither pitch_mm nor nominal_c_mm of {p.name}"
        raise InputError("project.json", seen, "give both, or import the calibration of the cameras alone (--cameras)")
    if (p.width, p.height) != (spec.width, spec.height):
        raise InputError(
            f"{p.name} of the calibration",
            f"is {p.width} x {p.height}, the one in project.json has {spec.width} x {spec.height}",
            "import it into a project of the same devices; --camera, --projector and --cameras name them",
        )
    if min(p.fx, p.fy) <= 0:
        raise InputError(f"{p.name} of the calibration", f"fx {p.fx:g} and fy {p.fy:g} px", "export it again")
    c = p.fy * spec.pitch_mm[1]
    b1 = p.fx * spec.pitch_mm[0] / c - 1
    x0, y0 = pixel_to_image(spec, [p.cx, p.cy])
    interior = Interior(float(c), float(x0), float(y0), (*p.distortion, float(b1)), spec.zero_radius_mm, MODEL)
    own, rms_px = fitted(spec, interior, "A1..A6")
    if rms_px <= SAME_PX:
        interior = own
    spec = replace(spec, interior=None if interior.model == "A1..A6" else interior, interior_sigma=())
    return AdjustedDevice(spec, interior, np.zeros(len(interior.vector)), (0.0, 0.0), 0)


def pair_to_calibration(
    pair: Pair, specs: Mapping[str, DeviceSpec], source: str, cameras: Sequence[str] = ("camera",)
) -> PhotogrammetricCalibration:
    """Make a calibration of this program's from devices that another one calibrated.

    `specs` are those of project.json by name, in the order of the file. `cameras` are the cameras among them; the
    others are projectors.
    """
    others = [(pair.projector, pair.rotation, pair.translation_mm), *pair.more]
    found = [replace(p, name=name) for name, p in zip(specs, (pair.camera, *(p for p, _, _ in others)), strict=True)]
    theirs = [_sized(p, spec) for p, spec in zip(found, specs.values(), strict=True)]
    devices = [device_from(p, spec) for p, spec in zip(theirs, specs.values(), strict=True)]
    poses = {}
    for name, (_, rotation, translation_mm) in zip([*specs][1:], others, strict=True):
        R = FLIP @ rotation @ FLIP
        if not (np.isfinite(R).all() and np.abs(R @ R.T - np.eye(3)).max() < 1e-4 and np.linalg.det(R) > 0):
            raise InputError(source, "the rotation between its devices is none", "export it again")
        if not np.any(translation_mm):
            raise InputError(source, "its devices are at the same place", "export it again")
        U, _, Vt = np.linalg.svd(R)
        poses[name] = Pose(U @ Vt, FLIP @ np.asarray(translation_mm, float))
    ends = np.cumsum([len(device.interior.vector) for device in devices])
    covariance = np.zeros((ends[-1] + 6 * len(poses),) * 2)
    if pair.covariance is not None:
        ways = ((_theirs(p), _ours(d), p) for p, d in zip(theirs, devices, strict=True))
        covariance = _carried(pair.covariance, ways, next(iter(poses.values())), FLIP)
    known = pair.covariance is not None
    parts = np.split(np.sqrt(np.maximum(np.diagonal(covariance), 0)), ends)
    unknown = (
        f"imported from {source}, which tells no sigmas: those of points are of the phase alone; judge it by a plane"
    )
    told = [f"imported from {source}" if known else unknown]
    if theirs != found:
        told.append(f"{source} gives no image sizes: those of project.json are taken")
    if len(cameras) == len(specs):
        told.append("of cameras alone: the projector is not calibrated, and only labels corresponding places")
    return calibration_of(
        {name: replace(device, sigma=part) for name, device, part in zip(specs, devices, parts, strict=False)},
        poses,
        covariance,
        cameras=tuple(cameras),
        verdict=Verdict("passed" if known else "doubtful", tuple(told)),
    )
