"""An independent renderer of testfields: circles cut by pixel rays, supersampled, then blurred, lit, and made noisy."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import cv2
import numpy as np
import pytest

from core.geometry import Pose, matrix_from_axis_angle, project, ray_directions
from core.model import DeviceSpec, Interior, PhaseMap, Seed, TargetSet, Testfield


@dataclass(frozen=True)
class Scene:
    """A board before a camera, with the truth of everything."""

    spec: DeviceSpec
    interior: Interior
    field: Testfield
    true_xyz: np.ndarray
    pose: Pose
    light: tuple[float, float] = (0.0, 0.0)  # relative change of the light per px
    fall: float = 0.0  # share of it that the corners lack, growing with the square of the radius
    blur: float = 0.8
    noise: float = 0.0
    black: float = 20.0
    white: float = 160.0
    lit_from: float | None = None  # column of the light's left end
    ambient: float = 0.1
    samples: int = 6
    extra: list[tuple[float, float, float, float]] = field(default_factory=list)  # spots: u, v, radius, share of white

    @property
    def true_uv(self) -> np.ndarray:
        return project(self.spec, self.interior, self.true_xyz, self.pose)

    def but(self, **changes) -> Scene:
        return replace(self, **changes)

    @cached_property
    def coverage(self) -> np.ndarray:
        """Share of each pixel that lies on a dot, before any blur."""
        h, w, n = self.spec.height, self.spec.width, self.samples
        cover = np.zeros((h, w))
        rays, slope_v, slope_u = _rays(self.spec, self.interior)
        steps = (np.arange(n) + 0.5) / n - 0.5
        su, sv = (g.ravel()[:, None] for g in np.meshgrid(steps, steps))
        radius = self.field.diameter_mm / 2
        centre = self.true_uv
        around = np.stack([self._shifted(d) for d in ([1, 0, 0], [0, 1, 0])]) - centre
        for i in range(len(centre)):
            if not np.all(np.isfinite(centre[i])):
                continue
            half = np.abs(around[:, i]).sum(axis=0) * radius[i] * 1.15 + 2
            (u0, v0), (u1, v1) = np.floor(centre[i] - half).astype(int), np.ceil(centre[i] + half).astype(int)
            box = np.s_[max(v0, 0) : max(v1 + 1, 0), max(u0, 0) : max(u1 + 1, 0)]
            if min(cover[box].shape) < 2:
                continue
            off = self._off(i, rays[box])
            away = np.linalg.norm(off, axis=-1)
            inside = (away < radius[i]).astype(float)
            pixel = [np.gradient(off, axis=axis) for axis in (0, 1)]
            cut = np.abs(away - radius[i]) < 0.6 * sum(np.linalg.norm(side, axis=-1) for side in pixel)
            ray, by_u, by_v = (x[box][cut][:, None] for x in (rays, slope_u, slope_v))
            off = self._off(i, ray + by_u * su + by_v * sv)
            away = np.maximum(np.linalg.norm(off, axis=-1), 1e-9)
            # a sample counts for the part of its own area that is inside: a hard edge moves dots by 0.004 px
            soft = np.hypot(*(np.einsum("psi,pi->ps", off, side[cut] / n) / away for side in pixel))
            inside[cut] = np.clip(0.5 + (radius[i] - away) / soft, 0, 1).mean(axis=-1)
            cover[box] = np.maximum(cover[box], inside)
        return cover

    def _off(self, i: int, xy: np.ndarray) -> np.ndarray:
        """How far from a dot (mm) rays (..., 2) meet the plane through it that is parallel to the board."""
        R, t = self.pose.rotation, self.pose.translation_mm
        d = np.concatenate([xy, -np.ones((*xy.shape[:-1], 1))], axis=-1)
        depth = (R[:, 2] @ (R @ self.true_xyz[i] + t)) / (d @ R[:, 2])
        return ((depth[..., None] * d - t) @ R)[..., :2] - self.true_xyz[i, :2]

    def _shifted(self, d) -> np.ndarray:
        return project(self.spec, self.interior, self.true_xyz + np.array(d, float), self.pose)

    def image(self, seed: int = 0, bits: bool = True) -> np.ndarray:
        """Render the grey image, 8 bit (or unrounded), as float32."""
        h, w = self.spec.height, self.spec.width
        v, u = np.mgrid[0:h, 0:w].astype(float)
        cover = self.coverage
        for su, sv, r, share in self.extra:
            cover = np.maximum(cover, share * np.clip(r - np.hypot(u - su, v - sv) + 0.5, 0, 1))
        dots, board = (self.white, self.black) if self.field.polarity == "white-on-black" else (self.black, self.white)
        light = (1 + self.light[0] * (u - w / 2)) * (1 + self.light[1] * (v - h / 2))
        light *= 1 - self.fall * np.hypot(2 * u / w - 1, 2 * v / h - 1) ** 2 / 2
        if self.lit_from is not None:
            light = light * np.clip(u - self.lit_from + 0.5, self.ambient, 1)
        image = (board + (dots - board) * cover) * light
        if self.blur:
            image = cv2.GaussianBlur(image, (0, 0), self.blur, borderType=cv2.BORDER_REPLICATE)
        if self.noise:
            image = image + np.random.default_rng(seed).normal(0, self.noise, image.shape)
        return np.clip(np.rint(image), 0, 255).astype(np.float32) if bits else image.astype(np.float32)

    def quick_image(self, seed: int = 0) -> np.ndarray:
        """Draw each dot as the ellipse that its neighbourhood maps to, softened: for identity, not for centroids."""
        h, w = self.spec.height, self.spec.width
        cover = np.zeros((h, w))
        centre = self.true_uv
        ellipse = np.stack([self._shifted([1, 0, 0]), self._shifted([0, 1, 0])], axis=2) - centre[:, :, None]
        ellipse *= self.field.diameter_mm[:, None, None] / 2
        shapes = [(c, e) for c, e in zip(centre, ellipse, strict=True) if np.all(np.isfinite(e))]
        shapes += [(np.array([u, v]), r * np.eye(2)) for u, v, r, _ in self.extra]
        share = [1.0] * (len(shapes) - len(self.extra)) + [x[3] for x in self.extra]
        for (c, e), bright in zip(shapes, share, strict=True):
            half = np.linalg.norm(e, axis=1) + 3
            (u0, v0), (u1, v1) = np.maximum(np.floor(c - half), 0).astype(int), np.ceil(c + half).astype(int) + 1
            if u1 <= u0 or v1 <= v0 or u0 >= w or v0 >= h:
                continue
            u, v = np.arange(u0, min(u1, w)), np.arange(v0, min(v1, h))
            x, y = np.einsum("ij,jab->iab", np.linalg.inv(e), np.stack(np.meshgrid(u - c[0], v - c[1])))
            soft = np.sqrt(abs(np.linalg.det(e))) / (2 * self.blur + 0.5)
            box = cover[v0 : v0 + len(v), u0 : u0 + len(u)]
            np.maximum(box, bright * np.clip((1 - np.hypot(x, y)) * soft + 0.5, 0, 1), out=box)
        return self._lit(cover, seed)

    def _lit(self, cover: np.ndarray, seed: int) -> np.ndarray:
        """Brightness from coverage: albedo, uneven light, its edge, noise, 8 bits."""
        h, w = cover.shape
        dots, board = (self.white, self.black) if self.field.polarity == "white-on-black" else (self.black, self.white)
        light = (1 + self.light[0] * (np.arange(w) - w / 2)) * (1 + self.light[1] * (np.arange(h)[:, None] - h / 2))
        if self.lit_from is not None:
            light = light * np.clip(np.arange(w) - self.lit_from + 0.5, self.ambient, 1)
        noise = np.random.default_rng(seed).standard_normal((h, w), dtype=np.float32) * self.noise
        return np.clip(np.rint((board + (dots - board) * cover) * light + noise), 0, 255).astype(np.float32)

    def phase(self, seed: int = 0, bits: bool = True, quick: bool = False) -> PhaseMap:
        """Give a phase map with the rendered image and u, v linear in the camera's pixels, see `true_projector`."""
        h, w = self.spec.height, self.spec.width
        v, u = np.mgrid[0:h, 0:w]
        image = self.quick_image(seed) if quick else self.image(seed, bits)
        lit = np.ones((h, w), bool) if self.lit_from is None else u >= self.lit_from
        a, b = np.moveaxis(true_projector(np.stack([u, v], axis=-1)), -1, 0)
        one = np.ones((h, w), np.float32)
        maps = [np.where(lit, x, np.nan).astype(np.float32) for x in (a, b, 0.03 * one, 0.04 * one)]
        return PhaseMap(*maps, np.where(lit, image / 4, 0).astype(np.float32), image, np.zeros((h, w), np.uint8))

    def seeds(self, cells, seed: int = 0, error_px: float = 2.0) -> list[Seed]:
        """Picks of (row, col) cells with an operator's error."""
        index, uv = self.field.index(), self.true_uv
        rng = np.random.default_rng(seed)
        clicks = [uv[index[c]] + rng.uniform(-error_px, error_px, 2) for c in cells]
        return [Seed(r, c, float(u), float(v)) for (r, c), (u, v) in zip(cells, clicks, strict=True)]


@lru_cache(maxsize=2)
def _rays(spec: DeviceSpec, interior: Interior) -> tuple[np.ndarray, ...]:
    """X and Y of the pixels' rays (h, w, 2), and what they change by from row to row and column to column."""
    v, u = np.mgrid[0 : spec.height, 0 : spec.width].astype(float)
    rays = ray_directions(spec, interior, np.stack([u, v], axis=-1))[..., :2]
    return rays, *np.gradient(rays, axis=(0, 1))


def true_projector(uv: np.ndarray) -> np.ndarray:
    """Projector coordinates (..., 2) that every rendered phase map has at camera pixels (..., 2)."""
    u, v = uv[..., 0], uv[..., 1]
    return np.stack([100 + 0.7 * u + 0.1 * v, 50 - 0.2 * u + 0.6 * v], axis=-1)


def grid(rows=13, cols=19, pitch=14.0, diameter=5.0, polarity="white-on-black") -> Testfield:
    r, c = (x.ravel() for x in np.mgrid[0:rows, 0:cols])
    xyz = np.stack([(c - (cols - 1) / 2) * pitch, (r - (rows - 1) / 2) * pitch, np.zeros(len(r))], axis=1)
    return Testfield(r, c, xyz, np.full(len(r), diameter), polarity)


def look(tilt_deg=0.0, about_deg=0.0, roll_deg=0.0, distance=600.0, shift=(0.0, 0.0)) -> Pose:
    """Camera from board: tilted about an axis in the board, rolled about the line of sight."""
    about = np.radians(about_deg)
    R = matrix_from_axis_angle([np.cos(about), np.sin(about), 0], np.radians(tilt_deg))
    return Pose(matrix_from_axis_angle([0, 0, 1], np.radians(roll_deg)) @ R, np.array([*shift, -distance]))


SPEC = DeviceSpec(748, 576, (0.008, 0.008), 12.0)
PART = DeviceSpec(440, 360, (0.008, 0.008), 12.0)  # of the same sensor, as large as 7 x 9 dots need
PAPER = Interior(
    12.102765,
    -0.081293,
    -0.114492,
    (-0.603793e-3, 0.308968e-5, -0.143177e-1, 0.308307e-4, -0.121978e-3, -0.757670e-4),
    2.51,
)


def scene(pose=None, spec=SPEC, interior=PAPER, field=None, bend_mm=0.0, off_mm=0.0, seed=0, **more) -> Scene:
    """A scene with a board that is bent by `bend_mm` and whose dots are `off_mm` off their nominal places."""
    field = field or grid()
    xyz = field.xyz_mm.copy()
    span = np.abs(xyz[:, :2]).max()
    xyz[:, 2] += bend_mm * (xyz[:, 0] ** 2 - 0.5 * xyz[:, 0] * xyz[:, 1]) / span**2
    xyz[:, :2] += np.random.default_rng(seed).normal(0, 1, (len(xyz), 2)) * off_mm
    return Scene(spec, interior, field, xyz, pose or look(), **more)


def compare(found: TargetSet, truth: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the measured targets in the field, and their errors (n, 2) px."""
    index = truth.field.index()
    which = np.array([index[key] for key in zip(found.row.tolist(), found.col.tolist(), strict=True)], int)
    return which, found.camera_uv - truth.true_uv[which]


class Bench:
    """What the tests need of this file."""

    scene, grid, look = staticmethod(scene), staticmethod(grid), staticmethod(look)
    compare, true_projector = staticmethod(compare), staticmethod(true_projector)
    spec, part, paper, interior = SPEC, PART, PAPER, Interior
    corners = ((0, 0), (0, 18), (12, 18), (12, 0))
    middle = ((4, 6), (4, 12), (8, 12), (8, 6))


@pytest.fixture(scope="session")
def bench() -> type[Bench]:
    return Bench
