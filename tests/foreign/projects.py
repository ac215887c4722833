"""Whole projects as another laboratory would hand them over: the contract's files, and beside them the truth."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.foreign.light import Light, Sensor, sequence
from tests.foreign.optics import Optics, Placed, looking, optics, turned
from tests.foreign.rendering import Seen
from tests.foreign.scenes import Board, Surface

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Laboratory:
    """Cameras and projectors by name, a board, and how light and sensors behave. The first camera counts as base."""

    cameras: dict[str, Optics]
    projectors: dict[str, Optics]
    distance_mm: float
    board: Board = field(default_factory=Board)
    light: Light = field(default_factory=Light)
    sensor: Sensor = field(default_factory=Sensor)
    period: float = 20.0
    steps: int = 4
    plates: tuple[float, ...] = ()
    views: int = 10
    seed: int = 1
    samples: int = 3  # of every pixel, each way

    def patterns(self, projector: str) -> list[dict[str, Any]]:
        p = self.projectors[projector]
        return sequence((p.width, p.height), self.period, self.steps)

    @cached_property
    def poses(self) -> dict[str, Placed]:
        """Ten convergent poses of the board, rolls of 90 degrees among them."""
        tilts = [(0, 0), (25, 5), (-25, -5), (5, 25), (-5, -25), (18, 18), (-18, 18), (18, -18), (0, 10), (-20, -16)]
        rng = np.random.default_rng(self.seed + 7)
        return {
            f"testfield-{n + 1:02d}": Placed(
                turned(*tilt, z=(0, 90, 180, 270)[n % 4] + rng.uniform(-8, 8)),
                np.array([0, 0, self.distance_mm]) + rng.uniform(-0.04, 0.04, 3) * self.distance_mm,
            )
            for n, tilt in enumerate(tilts[: self.views])
        }

    def plane(self, degrees: float) -> Surface:
        """A plate that faces the sensor, turned about the vertical, with faint texture."""
        size = 0.6 * self.distance_mm  # beyond what any camera sees

        def texture(x: Array, y: Array) -> Array:
            return 0.7 + 0.1 * np.sin(x / 17) * np.cos(y / 23)

        return Surface(Placed(turned(y=degrees), np.array([0, 0, self.distance_mm])), (size, size), albedo=texture)

    def relief(self) -> Surface:
        """A gently waved surface, several mm high."""
        size = 0.3 * self.distance_mm

        def waves(x: Array, y: Array) -> Array:
            return 6 * np.sin(2 * np.pi * x / size) * np.cos(2 * np.pi * y / (0.8 * size))

        return Surface(Placed(turned(y=4.0), np.array([0, 0, self.distance_mm])), (size, size), waves)

    def write(self, folder: Path, planes: tuple[float, ...] = (0.0, 15.0), relief: bool = True) -> Path:
        """The project with all its captures."""
        folder.mkdir(parents=True)
        (folder / "testfield.csv").write_text(self.board.csv())
        scenes: dict[str, tuple[dict[str, Any], Surface]] = {
            name: ({"role": "testfield", "testfield": "testfield.csv"}, self.board.at(place))
            for name, place in self.poses.items()
        }
        for z in self.plates:
            place = Placed(np.eye(3), np.array([0, 0, self.distance_mm - z]))
            scenes[f"depth{z:+04.0f}"] = (
                {"role": "depth", "testfield": "testfield.csv", "z_mm": z},
                self.board.at(place),
            )
        for angle in planes:
            scenes[f"plane{angle:+03.0f}"] = ({"role": "plane", "angle_deg": angle}, self.plane(angle))
        if relief:
            scenes["relief"] = ({"role": "object"}, self.relief())
        for number, (name, (what, surface)) in enumerate(scenes.items()):
            self.record(folder / "captures" / name, surface, what, number)
        (folder / "project.json").write_text(json.dumps(self.document(list(scenes))))
        return folder

    def record(self, folder: Path, surface: Surface, what: dict[str, Any], seed: int) -> None:
        """One capture: by every camera under every projector."""
        folder.mkdir(parents=True)
        rng = np.random.default_rng(1000 * self.seed + seed)
        frames = []
        for camera in self.cameras:
            for projector in self.projectors:
                names = {} if self.single else {"camera": camera, "projector": projector}
                patterns = self.patterns(projector)
                images = self.seen(surface, camera).frames(self.projectors[projector], self.light, patterns, rng)
                for pattern, image in zip(patterns, images, strict=True):
                    file = f"{len(frames):03d}.png"
                    cv2.imwrite(str(folder / file), image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
                    frames.append({"file": file, "pattern": pattern} | names)
        head = {"format": "stripe-capture", "version": 1 if self.single else 2}
        (folder / "capture.json").write_text(json.dumps(head | what | {"frames": frames}))

    def seen(self, surface: Surface, camera: str) -> Seen:
        return Seen(self.cameras[camera], surface, self.sensor, self.samples)

    @property
    def single(self) -> bool:
        return len(self.cameras) == len(self.projectors) == 1

    def document(self, captures: list[str]) -> dict[str, Any]:
        """project.json, with a scale bar between two targets of the board as it truly is, measured to its sigma."""
        start, end = (3, 3), (self.board.rows - 4, self.board.columns - 4)
        sigma, rng = 0.002, np.random.default_rng([self.seed, 3])
        length = float(np.hypot(*(self.board.true[end] - self.board.true[start])) + sigma * rng.standard_normal())
        devices: dict[str, Any] = {
            "cameras": {name: device.document() for name, device in self.cameras.items()},
            "projectors": {name: device.document() for name, device in self.projectors.items()},
        }
        if self.single:
            devices = {kind[:-1]: next(iter(named.values())) for kind, named in devices.items()}
        return {
            "format": "stripe-project",
            "version": 1 if self.single else 2,
            "name": "foreign",
            **devices,
            "scale": {
                "from": list(start),
                "to": list(end),
                "length_mm": length,
                "sigma_mm": sigma,
            },
            "captures": [f"captures/{name}" for name in captures],
        }


FLIP = np.diag([1.0, -1.0, -1.0])


def between(base: Optics, other: Optics) -> tuple[Array, Array]:
    """Rotation and translation from the base's frame to the other's, Y up and looking along -Z."""
    r = other.place.rotation.T @ base.place.rotation
    t = other.place.rotation.T @ (base.place.origin - other.place.origin)
    return FLIP @ r @ FLIP, FLIP @ t


def consumer(gamma: float = 1.0, seed: int = 1, scale: float = 1.0) -> Laboratory:
    """A small colour-free industrial camera beside a consumer projector whose lens shifts the image upwards."""
    base = Placed(np.eye(3), np.zeros(3))
    size = (int(640 * scale), int(480 * scale))
    camera = optics(*size, 0.006 / scale, 6.0, base, (-0.09, 0.06, 4e-4, -3e-4), (6.3, -4.1))
    target = np.array([0.0, 0.0, 480.0])
    beside = looking(np.array([150.0, -20.0, 10.0]), target, roll=1.5)
    projector = optics(854, 480, 0.0074, 10.5, beside, (-0.03, 0.02, 2e-4, 1e-4), (3.0, 60.0))
    return Laboratory(
        {"camera": camera}, {"projector": projector}, 480.0, light=Light(gamma=gamma), seed=seed, period=18.0
    )


def several(cameras: int = 2, projectors: int = 1, seed: int = 1) -> Laboratory:
    """Cameras either side of a projector, or of two."""
    target = np.array([0.0, 0.0, 500.0])
    lens, off = (-0.06, 0.03, -2e-4, 3e-4), (-4.4, 3.2)
    made = {}
    for n in range(cameras):
        place = looking(np.array([(0.0, 240.0, 120.0)[n], 8.0 * n, 5.0 * n]), target, n)
        made[f"c{n}"] = optics(560, 420, 0.0067, 6.2, place, lens, off)
    shine = {}
    for n in range(projectors):
        place = looking(np.array([110.0 + 40 * n, -90.0 - 20 * n, 0]), target)
        shine[f"p{n}"] = optics(640, 400, 0.009, 11.0, place, (0.02, 0, 0, 0), (1.0, 20.0))
    return Laboratory(made, shine, 500.0, Board(irregular_mm=0.3), seed=seed)


def black_dots(seed: int = 1, scale: float = 1.0) -> Laboratory:
    """A 12-bit camera with a long lens before a board of black dots, five steps of another period."""
    lab = consumer(seed=seed, scale=scale)
    board = Board(9, 13, 20.0, 11.0, white_on_black=False, soft_mm=0.08 / scale**2)
    return replace(lab, board=board, sensor=Sensor(0.6, 0.6, 0.006, bits=12), steps=5, period=24.0)


LABORATORIES: dict[str, Callable[[int], Laboratory]] = {
    "consumer": lambda seed: consumer(seed=seed),
    "gamma 2.2": lambda seed: consumer(2.2, seed),
    "black dots": black_dots,
    "two cameras": lambda seed: several(2, 1, seed),
    "two projectors": lambda seed: several(1, 2, seed),
    "two and two": lambda seed: several(2, 2, seed),
}
