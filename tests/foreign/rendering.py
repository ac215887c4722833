"""Images of a scene: rays through every pixel's samples, light by table, the camera's blur, noise, grey values."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.foreign.light import FINE, Light, Sensor
from tests.foreign.optics import Optics
from tests.foreign.scenes import Surface

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Seen:
    """A scene as one camera sees it, `samples` x `samples` to a pixel."""

    camera: Optics
    surface: Surface
    sensor: Sensor
    samples: int = 3

    def frames(
        self, projector: Optics, light: Light, patterns: list[dict[str, Any]], rng: np.random.Generator
    ) -> Iterator[NDArray[Any]]:
        """One image a pattern."""
        world, albedo, normal = self._met()
        lines = projector.image(world)
        towards = projector.place.origin - world
        far = np.linalg.norm(towards, axis=-1)
        cosine = np.clip((towards * normal).sum(axis=-1) / far, 0, None)
        own = self.surface.place.to_own(world)
        shone = albedo * self.surface.light(own[..., 0], own[..., 1])
        bright = (light.grey * shone * cosine * (np.median(far) / far) ** 2).astype(np.float32)
        ambient = (light.ambient * albedo).astype(np.float32)
        places = [
            np.clip(((lines[..., axis] + 8.5) * FINE).astype(np.int32), 0, (count + 16) * FINE - 1)
            for axis, count in enumerate((projector.width, projector.height))
        ]
        sizes = (projector.width, projector.height)
        white = (light.table({"kind": "white"}, n).astype(np.float32) for n in sizes)
        full = [table.take(place) for table, place in zip(white, places, strict=True)]
        lit = [bright * full[1], bright * full[0]]  # what a pattern along x, along y is multiplied by
        for pattern in patterns:
            axis = "xy".find(pattern.get("axis", "x"))
            shown = light.table(pattern, sizes[axis]).astype(np.float32).take(places[axis])
            yield self._image(cv2.add(cv2.multiply(shown, lit[axis]), ambient), rng)

    def points(self) -> Array:
        """True points on every pixel's middle ray (H, W, 3) in the world, NaN beyond the rim."""
        v, u = np.mgrid[0 : self.camera.height, 0 : self.camera.width].astype(float)
        world, albedo, _ = self.surface.met_by(self.camera.place.origin, self.camera.rays(u, v))
        return np.where(albedo[..., None] > 0, world, np.nan)

    def _met(self) -> tuple[Array, Array, Array]:
        return self.surface.met_by(self.camera.place.origin, _sampled(self.camera, self.samples))

    def _image(self, light: Array, rng: np.random.Generator) -> NDArray[Any]:
        drawn = cv2.GaussianBlur(light, (0, 0), self.sensor.blur * self.samples)
        size = (self.camera.width, self.camera.height)
        return self.sensor.read(cv2.resize(drawn, size, interpolation=cv2.INTER_AREA), rng)


@lru_cache(maxsize=2)
def _sampled(camera: Optics, n: int) -> Array:
    v, u = np.mgrid[0 : camera.height * n, 0 : camera.width * n]
    return camera.rays((u + 0.5) / n - 0.5, (v + 0.5) / n - 0.5)
