"""What is really so: projector coordinates of every pixel, places of every target. For tests and comparison columns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.bench.raycast import cast
from core.bench.rig import Rig
from core.bench.scene import Scene
from core.geometry import project
from core.lazy import dataclass
from core.model import Array, Seed

MARGIN = 2.0  # px or lines from the edge of an image
_RIM = 24  # points of a target's edge that are looked at


@dataclass(frozen=True)
class TruthMaps:
    """What the single ray through every pixel's centre meets."""

    #: u, v: (H, W): true projector coordinates in lines, NaN where the ray meets nothing that the projector's raster
    #: lights
    u: Array
    v: Array
    xyz_mm: Array  #: (H, W, 3): where the ray ends, in the camera's frame, NaN where it meets nothing
    lit: NDArray[np.bool_]  #: (H, W): met, within the projector's raster and not in shadow
    #: (H, W): light received from a fully bright projector, white square to it at the reference distance as 1
    gain: Array


@dataclass(frozen=True)
class TrueTargets:
    """Where the targets of a board really are, one row of every array per target.

    `camera_uv` (n, 2) px and `projector_uv` (n, 2) lines of the circles' centres; `xyz_mm` (n, 3) in the board's frame;
    `visible`: the whole circle is within the camera's image and lit.
    """

    row: NDArray[np.int64]
    col: NDArray[np.int64]
    xyz_mm: Array
    camera_uv: Array
    projector_uv: Array
    visible: NDArray[np.bool_]


def truth_maps(rig: Rig, scene: Scene) -> TruthMaps:
    """Find what every pixel's central ray meets, and project that into the projector with `core.geometry`."""
    samples, points = cast(rig, scene, 1, with_points=True)
    projector_from_board = rig.projector_from_camera @ scene.camera_from_board
    uv = project(rig.projector, rig.projector_interior, points, projector_from_board)
    size = np.array([rig.projector.width, rig.projector.height])
    lit = (samples.gain > 0) & np.all((uv >= -0.5) & (uv <= size - 0.5), axis=-1)
    uv[~lit] = np.nan
    return TruthMaps(uv[..., 0], uv[..., 1], scene.camera_from_board.apply(points), lit, samples.gain.astype(float))


def true_targets(rig: Rig, scene: Scene) -> TrueTargets:
    """Find where a scene's targets appear and whether they are wholly seen and lit.

    Shadows of spheres and blocks are not considered: testfields have none.
    """
    t = scene.board.targets
    if t is None:
        raise ValueError("the board has no targets")
    projector_from_board = rig.projector_from_camera @ scene.camera_from_board
    angle = np.linspace(0, 2 * np.pi, _RIM, endpoint=False)
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(_RIM)], axis=-1)
    edge = t.xyz_mm[:, None, :] + rim * t.diameter_mm[:, None, None] / 2
    inside = np.ones((len(t.row), _RIM), bool)
    for spec, interior, pose in (
        (rig.camera, rig.camera_interior, scene.camera_from_board),
        (rig.projector, rig.projector_interior, projector_from_board),
    ):
        uv = project(spec, interior, edge, pose)
        last = np.array([spec.width - 1, spec.height - 1])
        inside &= np.all((uv >= MARGIN) & (uv <= last - MARGIN), axis=-1)
        facing = np.einsum("ij,j->i", pose.origin_mm - t.xyz_mm, [0.0, 0.0, 1.0]) > 0
        inside &= facing[:, None]
    camera_uv = project(rig.camera, rig.camera_interior, t.xyz_mm, scene.camera_from_board)
    projector_uv = project(rig.projector, rig.projector_interior, t.xyz_mm, projector_from_board)
    return TrueTargets(t.row, t.col, t.xyz_mm, camera_uv, projector_uv, np.asarray(inside.all(axis=1)))


def operator_picks(targets: TrueTargets, rng: np.random.Generator) -> tuple[Seed, ...]:
    """Click on the four visible targets nearest to the corners of the visible part, each 1.5 px (1 sigma) beside it."""
    seen = np.flatnonzero(targets.visible)
    if seen.size < 4:
        raise ValueError(f"{seen.size} targets are visible: four are needed for picking")
    r, c = targets.row[seen].astype(float), targets.col[seen].astype(float)
    chosen: list[int] = []
    for down, right in ((-1, -1), (-1, 1), (1, 1), (1, -1)):
        order = seen[np.argsort(-(down * (r - r.mean()) + right * (c - c.mean())), kind="stable")]
        chosen.append(next(int(n) for n in order if n not in chosen))
    clicks = targets.camera_uv[chosen] + rng.normal(size=(4, 2)) * 1.5
    return tuple(
        Seed(int(targets.row[n]), int(targets.col[n]), round(float(u), 1), round(float(v), 1))
        for n, (u, v) in zip(chosen, clicks, strict=True)
    )
