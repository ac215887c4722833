"""A simulator of measured targets that shares no code with the program: pinholes with radial distortion, own rotations.

A rig of any size and optics sees a bent board in many poses and a plate at known positions; what is measured carries
noise of the sigmas that it states, more or less (`honest`), as centroids do.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from core.model import DeviceSpec, Rig, ScaleBar, TargetSet, Testfield


@dataclass(frozen=True)
class Optics:
    spec: DeviceSpec
    c_mm: float
    x0_mm: float
    y0_mm: float
    k: float  # radial, per mm²
    seventh: float = 0.0  # and of the radius' sixth power, 1 at the corner

    def see(self, points: np.ndarray) -> np.ndarray:
        x, y = (-self.c_mm * points[..., i] / points[..., 2] for i in (0, 1))
        s = self.spec
        corner = np.hypot(s.width * s.pitch_mm[0], s.height * s.pitch_mm[1]) / 2
        d = 1 + self.k * (x * x + y * y) + self.seventh * ((x * x + y * y) / corner**2) ** 3
        u = (x * d + self.x0_mm) / s.pitch_mm[0] + (s.width - 1) / 2
        v = (s.height - 1) / 2 - (y * d + self.y0_mm) / s.pitch_mm[1]
        return np.stack([u, v], axis=-1)


def turn(axis: str, degrees: float) -> np.ndarray:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return {
        "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
        "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
        "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
    }[axis]


@dataclass(frozen=True)
class Project:
    """What a project's documents say, and what was measured."""

    rig: Rig
    board: Testfield
    plate: Testfield
    scale: ScaleBar
    camera: Optics
    fields: tuple[TargetSet, ...]
    plates: tuple[TargetSet, ...]
    z_mm: dict[str, float]


RIGS = {
    "paper": (DeviceSpec(748, 576, (0.008, 0.008), 12.0), DeviceSpec(640, 640, (0.09, 0.09), 182.0), 250.0, 600.0),
    "modern": (
        DeviceSpec(2448, 2048, (0.00345, 0.00345), 16.0),
        DeviceSpec(1280, 800, (0.0076, 0.0076), 28.0),
        180.0,
        520.0,
    ),
}


def board(rows: int, cols: int, spacing: float) -> Testfield:
    r, c = (a.ravel() for a in np.mgrid[:rows, :cols])
    xyz = np.stack([(c - (cols - 1) / 2) * spacing, ((rows - 1) / 2 - r) * spacing, 0.0 * r], axis=1)
    return Testfield(r.astype(np.int64), c.astype(np.int64), xyz, np.full(len(r), 5.0))


def varied(rng: np.random.Generator, name: str) -> tuple[DeviceSpec, DeviceSpec, float, float]:
    """A rig like one of `RIGS`, none of its figures the same."""
    camera, projector, base, distance = RIGS[name]
    f, g = rng.uniform(0.8, 1.3, 2)
    pitch = camera.pitch_mm[0] * g
    camera = replace(camera, pitch_mm=(pitch, pitch), nominal_c_mm=camera.nominal_c_mm * g)
    projector = replace(projector, nominal_c_mm=projector.nominal_c_mm * float(rng.uniform(0.95, 1.1)))
    return camera, projector, base * f * float(rng.uniform(0.8, 1.3)), distance * f


def simulate(
    name: str, seed: int, *, vary: bool = False, poses: int = 9, honest: float = 1.0, seventh: float = 0.0
) -> Project:
    rng = np.random.default_rng(seed)
    camera_spec, projector_spec, base, distance = varied(rng, name) if vary else RIGS[name]
    camera = Optics(
        camera_spec, camera_spec.nominal_c_mm * rng.uniform(0.99, 1.03), *rng.normal(0, 0.05, 2), -2e-4, seventh
    )
    projector = Optics(
        projector_spec, projector_spec.nominal_c_mm * rng.uniform(0.99, 1.03), *rng.normal(0, 0.2, 2), 0.0
    )
    angle = np.rad2deg(np.arctan2(base, distance))
    R = turn("y", -angle) @ turn("z", rng.normal(0, 0.3))
    t = -R @ np.array([base, 0.0, 0.0])
    size = 0.62 * distance * camera_spec.height * camera_spec.pitch_mm[1] / camera_spec.nominal_c_mm
    field = board(7, 9, size / 7)
    plate = board(5, 5, size / 6)
    made = field.xyz_mm + rng.normal(0, [0.05, 0.05, 0.02], field.xyz_mm.shape)
    made[:, 2] += 0.2 * np.sin(made[:, 0] / size * 3)

    def measure(capture: str, nominal: Testfield, points: np.ndarray) -> TargetSet:
        uv, lines = camera.see(points), projector.see(points @ R.T + t)
        inside = np.ones(len(points), bool)
        for seen, spec in ((uv, camera_spec), (lines, projector_spec)):
            inside &= np.all((seen > 4) & (seen < [spec.width - 5, spec.height - 5]), axis=1)
        n = int(inside.sum())
        sigma_px, sigma_lines = rng.uniform(0.008, 0.015, (n, 2)), rng.uniform(0.03, 0.06, (n, 2))
        return TargetSet(
            capture,
            nominal.row[inside],
            nominal.col[inside],
            uv[inside] + rng.normal(size=(n, 2)) * sigma_px * honest,
            np.einsum("ni,ij->nij", sigma_px**2, np.eye(2)),
            lines[inside] + rng.normal(size=(n, 2)) * sigma_lines * honest,
            sigma_lines,
            np.zeros((n, 2)),
            np.full(n, 12.0),
        )

    fields = []
    for k in range(poses):
        tilt = (5, 28)[k >= 3] + rng.normal(0, 2)
        about = 360 * k / poses + rng.normal(0, 8)
        pose = turn("z", about) @ turn("x", tilt) @ turn("z", -about) @ turn("z", 90 * (k % 4) + rng.normal(0, 2))
        at = np.array([*rng.normal(0, 0.04 * size, 2), -distance + rng.uniform(-0.07, 0.07) * distance])
        fields.append(measure(f"testfield-{k + 1:02d}", field, made @ pose.T + at))
    seen = [set(zip(t.row.tolist(), t.col.tolist(), strict=True)) for t in fields]
    pairs = [((k, k), (6 - k, 8 - k)) for k in range(3)]
    ends = next(pair for pair in pairs if all(sum(end in s for s in seen) > 2 for end in pair))
    length = float(np.linalg.norm(made[field.index()[ends[1]]] - made[field.index()[ends[0]]]))
    scale = ScaleBar(*ends, length + rng.normal(0, 0.005), 0.005)
    z_mm = {f"depth-{i + 1:02d}": z for i, z in enumerate(np.linspace(-50, 50, 7).tolist())}
    dots = plate.xyz_mm + rng.normal(0, [0.02, 0.02, 0.0], plate.xyz_mm.shape)
    square = turn("x", rng.normal(0, 0.5)) @ turn("y", rng.normal(0, 0.5))
    axis = square @ np.array([0, 0, 1.0])
    plates = tuple(
        measure(n, plate, dots @ square.T + axis * (z + rng.normal(0, 0.005)) + np.array([0, 0, -distance]))
        for n, z in z_mm.items()
    )
    rig = Rig({"camera": camera_spec}, {"projector": projector_spec})
    return Project(rig, field, plate, scale, camera, tuple(fields), plates, z_mm)
