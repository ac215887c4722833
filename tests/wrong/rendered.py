"""Small projects by a renderer that shares no code with the program: rigs, boards, sequences, noise and lenses vary.

Pinholes with radial distortion look at flat boards of anti-aliased dots. Lines of the projector are blurred on a table
of 16 samples a line, straight between them, images by a Gaussian over 2x2 samples a pixel. A project of 300 images
takes about five seconds.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import cv2
import numpy as np

FINE = 2  # samples a pixel along each axis
BESIDE = 4  # px rendered beside the image, which blur draws from
CUT = slice(FINE * BESIDE, -FINE * BESIDE)
PARTS = (-0.375, -0.125, 0.125, 0.375)  # of a sample at a dot's rim, along each axis
MORE = 100  # number of the sound project from which sequences, responses and directions vary more
TABLE = 16  # samples a line
MARGIN = 6  # px and lines: targets nearer to an edge are not wanted

Array = np.ndarray
Pattern = dict[str, Any]


@dataclass(frozen=True)
class Optics:
    width: int
    height: int
    pitch_mm: float
    c_mm: float
    nominal_c_mm: float
    x0_mm: float
    y0_mm: float
    k: float  # radial distortion, per mm²

    def see(self, points: Array) -> Array:
        """Image coordinates, (n, 2), of points in the device's frame."""
        x, y = (-self.c_mm * points[..., i] / points[..., 2] for i in (0, 1))
        d = 1 + self.k * (x * x + y * y)
        u = (x * d + self.x0_mm) / self.pitch_mm + (self.width - 1) / 2
        v = (self.height - 1) / 2 - (y * d + self.y0_mm) / self.pitch_mm
        return np.stack([u, v], axis=-1)

    def rays(self, u: Array, v: Array) -> Array:
        """Directions with Z = -1."""
        xd = (u - (self.width - 1) / 2) * self.pitch_mm - self.x0_mm
        yd = ((self.height - 1) / 2 - v) * self.pitch_mm - self.y0_mm
        x, y = xd, yd
        for _ in range(8):
            d = 1 + self.k * (x * x + y * y)
            x, y = xd / d, yd / d
        return np.stack([x / self.c_mm, y / self.c_mm, np.full_like(x, -1.0)], axis=-1)

    def document(self) -> dict[str, Any]:
        size = {"width": self.width, "height": self.height}
        return {**size, "pitch_mm": [self.pitch_mm] * 2, "nominal_c_mm": round(self.nominal_c_mm, 3)}


@dataclass(frozen=True)
class Look:
    """A rig, what it shows and how its camera takes it."""

    camera: Optics
    projector: Optics
    R: Array  # projector from camera
    t_mm: Array
    distance_mm: float
    patterns: list[Pattern]
    noise: float  # grey values of 255
    blur_px: float
    blur_lines: float
    exposure: float  # grey value of white paper, of 255
    bits: int
    polarity: str
    gamma: float = 1.0  # light of a projector's level, as its power


def turn(axis: int, degrees: float) -> Array:
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    i, k = [j for j in range(3) if j != axis]
    R = np.eye(3)
    R[i, i] = R[k, k] = c
    R[i, k], R[k, i] = (-s, s) if axis != 1 else (s, -s)
    return R


def brightness(pattern: Pattern, i: Array) -> Array:
    """How bright lines are, as the contract says."""
    match pattern["kind"]:
        case "white" | "black":
            return np.full(len(i), float(pattern["kind"] == "white"))
        case "phase":
            wave = np.cos(2 * np.pi * (i + 0.5) / pattern["period"] - pattern["shift_rad"])
            return (wave > 0).astype(float) if pattern["profile"] == "square" else 0.5 + 0.5 * wave
    k = i // pattern["cell"]
    k = k ^ (k >> 1) if pattern["kind"] == "gray" else k
    on = (k >> (pattern["bits"] - 1 - pattern["bit"])) & 1
    return (on ^ int(pattern.get("inverse", False))).astype(float)


def sequence(
    size: tuple[int, int], cell: int, steps: int, period: float, profile: str, inverse: bool = False
) -> list[Pattern]:
    """Gray code and phase steps along both axes, a white and a black frame."""
    found: list[Pattern] = []
    for axis, lines in zip("xy", size, strict=True):
        bits = int(np.ceil(np.log2(np.ceil(lines / cell))))
        for b in range(bits):
            code = {"kind": "gray", "axis": axis, "bit": b, "bits": bits, "cell": cell}
            found += [{**code, "inverse": i} for i in ((False, True) if inverse else (False,))]
        wave = {"kind": "phase", "axis": axis, "period": period, "steps": steps, "profile": profile}
        begin = np.pi / 2 if profile == "square" else 0.3
        found += [{**wave, "step": k, "shift_rad": begin + 2 * np.pi * k / steps} for k in range(steps)]
    return [*found, {"kind": "white"}, {"kind": "black"}]


def cells(pattern: Pattern, lines: int, blur: float, gamma: float) -> Array:
    """A table of brightness along lines, from half a line before the first to half a line after the last."""
    wide = 8
    on = brightness(pattern, np.arange(lines)) ** gamma
    table = np.pad(np.repeat(on, TABLE), wide * TABLE)
    return cv2.GaussianBlur(table[None].astype(np.float32), (0, 0), blur * TABLE, borderType=cv2.BORDER_REPLICATE)[0]


def render(look: Look, pose: tuple[Array, Array], dots: Array | None, radius: Array | None, rng: Any) -> list[Array]:
    """Images of a flat board: `dots` (n, 2) on it in mm, or none; pose is the camera's from the board's."""
    R, t = pose
    cam, pro = look.camera, look.projector
    high, wide = (FINE * (n + 2 * BESIDE) for n in (cam.height, cam.width))
    v, u = ((np.mgrid[:high, :wide].astype(np.float64) + 0.5) / FINE - 0.5 - BESIDE).reshape(2, -1)
    rays = cam.rays(u, v)
    depth = (R[:, 2] @ t) / (rays @ R[:, 2])
    points = rays * depth[:, None]
    on_board = (points - t) @ R
    albedo = np.full(len(u), 0.9)
    if dots is not None and radius is not None:
        albedo[:] = 0.9 if look.polarity == "black-on-white" else 0.12
        other = 1.02 - albedo[0]
        span = np.abs(points[:, 2]) * cam.pitch_mm / cam.c_mm / FINE  # of a sample, mm
        spacing = np.median([np.sort(np.hypot(*(dots - d).T))[1] for d in dots])
        corner, count = dots.min(axis=0) - spacing, np.ceil(np.ptp(dots, axis=0) / spacing + 2).astype(int)
        nearest = np.full((count[0] + 1, count[1] + 1), -1)
        place = np.floor((dots - corner) / spacing + 0.5).astype(int)
        nearest[place[:, 0], place[:, 1]] = np.arange(len(dots))
        at = np.floor((on_board[:, :2] - corner) / spacing + 0.5).astype(int)
        inside = np.all((at >= 0) & (at <= count), axis=1)
        which = np.where(inside, nearest[np.clip(at[:, 0], 0, count[0]), np.clip(at[:, 1], 0, count[1])], -1)
        near = np.flatnonzero(which >= 0)
        d = radius[which[near]] - np.hypot(*(on_board[near, :2] - dots[which[near]]).T)
        cover = (d > 0).astype(float)
        rim = np.abs(d) < 1.5 * span[near]
        at = near[rim]
        over = (on_board[at] - on_board[at - 1], on_board[at] - on_board[at - wide])  # the way to the next samples
        cover[rim] = 0
        for a, b in product(PARTS, PARTS):
            to = (on_board[at] + a * over[0] + b * over[1])[:, :2] - dots[which[at]]
            d = radius[which[at]] - np.hypot(*to.T)
            cover[rim] += np.clip(0.5 + d / span[at] * len(PARTS), 0, 1) / len(PARTS) ** 2
        albedo[near] += cover * (other - albedo[near])
    seen = pro.see(points @ look.R.T + look.t_mm)
    r2 = (u - cam.width / 2) ** 2 + (v - cam.height / 2) ** 2
    shade = albedo * (1 - 0.15 * r2 / (cam.width / 2) ** 2) * (1 + 0.2 * (seen[:, 0] / pro.width - 0.5))
    lines = {"x": (0, pro.width), "y": (1, pro.height)}
    place = [np.clip((seen[:, a] + 8.5) * TABLE - 0.5, 0, (n + 16) * TABLE - 1.001) for a, n in lines.values()]
    index = [each.astype(int) for each in place]
    part = [np.float32(each - low) for each, low in zip(place, index, strict=True)]

    def lit(p: Pattern, a: int, n: int) -> Array:
        table = cells(p, n, look.blur_lines, look.gamma)
        return table[index[a]] + part[a] * np.diff(table)[index[a]]

    frame = [lit({"kind": "white"}, a, n) for a, n in lines.values()]
    whole = frame[0] * frame[1]
    images = []
    for p in look.patterns:
        light = whole * float(p["kind"] == "white")
        if "axis" in p:
            a, n = lines[p["axis"]]
            light = lit(p, a, n) * frame[1 - a]
        grey = (look.exposure * shade * (0.04 + 0.01 * whole + light)).astype(np.float32)
        grey = cv2.GaussianBlur(grey.reshape(high, wide), (0, 0), look.blur_px * FINE)[CUT, CUT]
        grey = grey.reshape(cam.height, FINE, cam.width, FINE).mean(axis=(1, 3)) + 6
        grey += rng.normal(0, 1, grey.shape) * np.sqrt(look.noise**2 / 2 * (1 + np.maximum(grey, 0) / 128))
        full = 2**look.bits - 1
        images.append(np.clip(np.round(grey * full / 255), 0, full).astype(np.uint8 if look.bits == 8 else np.uint16))
    return images


@dataclass(frozen=True)
class Board:
    row: Array
    col: Array
    nominal: Array  # (n, 2) mm
    made: Array
    diameter_mm: float

    def index(self, row: int, col: int) -> int:
        return int(np.flatnonzero((self.row == row) & (self.col == col))[0])

    def write(self, path: Path, polarity: str) -> None:
        rows = [
            f"{r},{c},{x:.3f},{y:.3f},0,{self.diameter_mm:g}"
            for r, c, (x, y) in zip(self.row, self.col, self.nominal, strict=True)
        ]
        text = "\n".join([f"# polarity: {polarity}", "row,col,x_mm,y_mm,z_mm,diameter_mm", *rows, ""])
        path.write_text(text, encoding="utf-8")


def board(rows: int, cols: int, width_mm: float, rng: Any, off_mm: float) -> Board:
    spacing = width_mm / cols
    r, c = (a.ravel() for a in np.mgrid[:rows, :cols])
    xy = np.stack([(c - (cols - 1) / 2) * spacing, ((rows - 1) / 2 - r) * spacing], axis=1)
    return Board(r, c, np.round(xy, 3), xy + rng.normal(0, off_mm, xy.shape), round(0.45 * spacing, 1))


def write_capture(folder: Path, look: Look, images: list[Array], said: dict[str, Any]) -> None:
    folder.mkdir(parents=True)
    ending = "png" if look.bits == 8 else "tif"
    frames = []
    for k, (image, pattern) in enumerate(zip(images, look.patterns, strict=True)):
        cv2.imwrite(str(folder / f"{k:03d}.{ending}"), image)
        frames.append({"file": f"{k:03d}.{ending}", "pattern": pattern})
    document = {"format": "stripe-capture", "version": 1, **said, "frames": frames}
    (folder / "capture.json").write_text(json.dumps(document))


def picks_of(look: Look, b: Board, pose: tuple[Array, Array], rng: Any) -> dict[str, Any] | None:
    """Four targets that are seen, roughly."""
    points = np.column_stack([b.made, np.zeros(len(b.made))]) @ pose[0].T + pose[1]
    uv, lines = look.camera.see(points), look.projector.see(points @ look.R.T + look.t_mm)
    size = [(look.camera.width, look.camera.height), (look.projector.width, look.projector.height)]
    good = np.all([(s > MARGIN) & (s < np.array(n) - MARGIN) for s, n in zip((uv, lines), size, strict=True)], (0, 2))
    if good.sum() < 12:
        return None
    at = np.flatnonzero(good)
    wanted = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1.0]])
    chosen = [int(at[np.argmax(b.nominal[at] @ w)]) for w in wanted]
    if len(set(chosen)) < 4:
        return None
    seeds = [
        {"row": int(b.row[k]), "col": int(b.col[k]), "u": round(u, 1), "v": round(v, 1)}
        for k in chosen
        for u, v in [uv[k] + rng.normal(0, 0.7, 2)]
    ]
    return {"format": "stripe-picks", "version": 1, "seeds": seeds}


def project(
    folder: Path, look: Look, seed: int, *, grid: tuple[int, int], poses: int, plates: int, span_mm: float, picks: bool
) -> None:
    """Write a project with captures of all roles but objects, and its documents."""
    rng = np.random.default_rng(seed)
    d, cam = look.distance_mm, look.camera
    # the smaller of what camera and projector have in common
    height = d * cam.height * cam.pitch_mm / cam.c_mm
    field = board(*grid, 0.74 * height * grid[1] / grid[0], rng, 0.08)
    plate = board(5, 7, 0.95 * height, rng, 0.05)
    folder.mkdir(parents=True)
    bright = "black-on-white"  # depth is calibrated on the plate itself, between the targets
    field.write(folder / "testfield.csv", look.polarity)
    plate.write(folder / "plate.csv", bright)
    names = []

    def take(name: str, said: dict[str, Any], pose: tuple[Array, Array], b: Board | None, own: Look) -> bool:
        seeds = picks_of(own, b, pose, rng) if b is not None else None
        if b is not None and seeds is None:
            return False
        radius = None if b is None else np.full(len(b.made), b.diameter_mm / 2)
        write_capture(
            folder / "captures" / name, own, render(own, pose, None if b is None else b.made, radius, rng), said
        )
        if seeds is not None and picks:
            (folder / "captures" / name / "picks.json").write_text(json.dumps(seeds))
        names.append(f"captures/{name}")
        return True

    k = 0
    while len(names) < poses:
        k += 1
        tilt, about = ((6, 27)[k % 4 > 0] + rng.normal(0, 2), 360 * k / poses + rng.normal(0, 10))
        R = turn(2, about) @ turn(0, tilt) @ turn(2, -about) @ turn(2, 90 * (k % 4) * (k % 2 or 2) + rng.normal(0, 3))
        at = np.array([*rng.normal(0, 0.03 * height, 2), -d * (1 + rng.uniform(-0.06, 0.06))])
        said = {"role": "testfield", "testfield": "testfield.csv"}
        take(f"testfield-{len(names) + 1:02d}", said, (R, at), field, look)
        if k > 4 * poses:
            raise RuntimeError("the rig does not see its board")
    square = turn(0, rng.normal(0, 0.4)) @ turn(1, rng.normal(0, 0.4))
    for i, z in enumerate(np.linspace(-span_mm / 2, span_mm / 2, plates)):
        at = np.array([0, 0, -d]) + square[:, 2] * (z + rng.normal(0, 0.004))
        said = {"role": "depth", "testfield": "plate.csv", "z_mm": round(float(z), 3)}
        take(f"depth-{i + 1:02d}", said, (square, at), plate, replace(look, polarity=bright))
    for angle in (0, 15, -15):
        R = turn(1, angle) @ square
        take(f"plane{angle:+03d}", {"role": "plane", "angle_deg": angle}, (R, np.array([0, 0, -d])), None, look)
    a, b = field.index(grid[0] - 1, 0), field.index(0, grid[1] - 1)
    length = float(np.hypot(*(field.made[a] - field.made[b]))) + rng.normal(0, 0.005)
    ends = {"from": [grid[0] - 1, 0], "to": [0, grid[1] - 1]}
    document = {
        "format": "stripe-project",
        "version": 1,
        "name": folder.name,
        "camera": cam.document(),
        "projector": look.projector.document(),
        "scale": {**ends, "length_mm": round(length, 4), "sigma_mm": 0.005},
        "captures": names,
    }
    (folder / "project.json").write_text(json.dumps(document))


def placed(camera: Optics, projector: Optics, distance_mm: float, angle: float, about: float, **more: Any) -> Look:
    """A projector that looks at what the camera looks at, `angle` degrees beside it, in a direction about its axis."""
    R = turn(2, -about) @ turn(1, angle) @ turn(2, about)
    base = np.array([0, 0, -distance_mm]) - R.T @ np.array([0, 0, -distance_mm])
    return Look(camera, projector, R, -R @ base, distance_mm, **more)


def unlike(folder: Path) -> None:
    """The rig that is unlike the bench's: sine waves in six steps, projector left of the camera, twelve bits."""
    camera = Optics(400, 300, 0.0072, 8.31, 8.2, 0.021, -0.013, -8e-4)
    projector = Optics(320, 200, 0.0171, 13.07, 13.0, 0.05, -0.08, 2e-4)
    shown = sequence((320, 200), 10, 6, 20.0, "sine")
    more = {"noise": 1.4, "blur_px": 0.55, "blur_lines": 0.5, "exposure": 190.0, "bits": 12}
    look = placed(camera, projector, 430.0, -21.0, 3.0, patterns=shown, polarity="black-on-white", **more)
    project(folder, look, 5, grid=(7, 9), poses=9, plates=5, span_mm=60.0, picks=True)


def waves(size: tuple[int, int], periods: Callable[[int], list[float]], steps: int) -> list[Pattern]:
    """Phase steps of several periods along both axes, and nothing else."""
    return [
        {"kind": "phase", "axis": axis, "period": p, "steps": steps, "step": k, "profile": "sine", "shift_rad": s}
        for axis, lines in zip("xy", size, strict=True)
        for p in periods(lines)
        for k, s in enumerate(2 * np.pi * np.arange(steps) / steps)
    ]


SEQUENCES: dict[str, Callable[[tuple[int, int]], list[Pattern]]] = {
    "square 4, period 4": lambda size: sequence(size, 2, 4, 4.0, "square"),
    "sine 4, period 8": lambda size: sequence(size, 4, 4, 8.0, "sine"),
    "sine 3, period 12": lambda size: sequence(size, 6, 3, 12.0, "sine"),
    "sine 8, period 16": lambda size: sequence(size, 8, 8, 16.0, "sine"),
    "sine 4 with inverse code": lambda size: sequence(size, 8, 4, 16.0, "sine", True),
    "sine 5, period 20": lambda size: sequence(size, 10, 5, 20.0, "sine"),
}
OTHER_SEQUENCES = {
    "three periods": lambda size: waves(size, lambda n: [float(n), n / 5, n / 25], 4),
    "two periods that beat": lambda size: waves(size, lambda n: [16.0, 16 * n / (n - 16)], 5),
    "binary code": lambda size: [
        {**p, "kind": "binary"} if p["kind"] == "gray" else p for p in sequence(size, 6, 4, 12.0, "sine")
    ],
    "no white, no black": lambda size: sequence(size, 8, 4, 16.0, "sine")[:-2],
    "square 4, period 8": lambda size: sequence(size, 4, 4, 8.0, "square"),
}


def varied(folder: Path, seed: int) -> str:
    """A sound project of a rig of its own; give what it is like."""
    rng = np.random.default_rng([seed, 1])
    width, height = [(320, 240), (360, 270), (300, 300), (400, 260)][rng.integers(4)]
    pitch = float(rng.uniform(0.004, 0.012))
    half = float(np.deg2rad(rng.uniform(8, 14)))  # of the smaller field angle
    c = min(width, height) * pitch / 2 / np.tan(half)
    size = width * pitch
    camera = Optics(
        width,
        height,
        pitch,
        c,
        c * rng.uniform(0.97, 1.03),
        *rng.normal(0, 0.01 * size, 2),
        rng.normal(0, 0.04) / size**2,
    )
    distance = float(rng.uniform(250, 900))
    lines = [(160, 160), (240, 200), (320, 200), (256, 192)][rng.integers(4)]
    own = float(rng.uniform(0.008, 0.2))
    # lights a little more than the camera sees
    reach = 1.3 * max(width, height) * pitch / c
    c_projector = min(lines) * own / reach
    projector = Optics(
        *lines, own, c_projector, c_projector * rng.uniform(0.97, 1.03), *rng.normal(0, 0.01 * lines[0] * own, 2), 0.0
    )
    kind, gamma = list(SEQUENCES)[rng.integers(len(SEQUENCES))], 1.0
    angle, about = float(rng.uniform(14, 28) * rng.choice([-1, 1])), float(rng.normal(0, 5))
    shown = SEQUENCES | OTHER_SEQUENCES
    if seed >= MORE:
        more = np.random.default_rng([seed, 2])
        kind = list(shown)[more.integers(len(shown))]
        about += float(more.choice([0, 0, 90, 45]))
        gamma = float(more.choice([1.0, more.uniform(1.1, 2.2)]))
        gamma = 1.0 if kind == "sine 3, period 12" else gamma  # three steps cannot tell a response
    look = placed(
        camera,
        projector,
        distance,
        angle,
        about,
        patterns=shown[kind](lines),
        gamma=gamma,
        noise=float(rng.uniform(0.6, 2.2)),
        blur_px=float(rng.uniform(0.4, 0.8)),
        blur_lines=float(rng.uniform(0.25, 0.5)),
        exposure=float(rng.uniform(130, 215)),
        bits=int(rng.choice([8, 8, 10, 12])),
        polarity=str(rng.choice(["black-on-white", "white-on-black"])),
    )
    grid = [(7, 9), (6, 8), (7, 7), (8, 9)][rng.integers(4)]
    poses, plates, span = int(rng.integers(7, 10)), int(rng.integers(4, 7)), 0.16 * distance
    picks = bool(rng.random() < 0.8)
    project(folder, look, seed, grid=grid, poses=poses, plates=plates, span_mm=span, picks=picks)
    return (
        f"{width}x{height}, {lines[0]}x{lines[1]} lines, {kind}, {distance:.0f} mm, {angle:+.0f}°, "
        f"noise {look.noise:.1f}, blur {look.blur_px:.2f} px {look.blur_lines:.2f} lines, {look.bits} bits, "
        f"gamma {gamma:.1f}, {about:+.0f}° about, {look.polarity}, "
        f"board {grid[0]}x{grid[1]}, {poses} poses, {plates} plates{'' if picks else ', no picks'}"
    )
