"""The camera's electronics: line jitter, shot and read noise, saturation, quantisation."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Floats

Image = NDArray[Any]


@dataclass(frozen=True)
class Sensor:
    """How light becomes grey values."""

    #: grey value of a white surface square to the projector at the reference distance, before blur and offset
    white_level: float = 100.0
    offset: float = 6.0  #: black level, grey values
    read_noise: float = 1.4  #: standard deviation that does not depend on the light, grey values
    shot_gain: float = 0.02  #: variance per grey value of signal: ``variance = read_noise² + shot_gain · signal``
    jitter_px: float = 0.0  #: standard deviation of the horizontal displacement of every video line
    bits: int = 8  #: 8 gives uint8 images; more gives uint16 with values to ``2^bits - 1``

    @property
    def ceiling(self) -> int:
        """The largest grey value."""
        return (1 << self.bits) - 1


def digitise(sensor: Sensor, light: Floats, rng: np.random.Generator) -> Image:
    """Turn light, (H, W) in grey values without offset, changed in place, into the camera's digital image.

    `rng` draws H displacements, then H·W normal deviates, whatever the image holds.
    """
    shift: Floats = np.float32(sensor.jitter_px) * rng.standard_normal(light.shape[:1], dtype=np.float32)
    noise = rng.standard_normal(light.shape, dtype=np.float32)
    if sensor.jitter_px > 0:
        light = shift_rows(light, shift)
    variance = light * np.float32(sensor.shot_gain)
    variance += np.float32(sensor.read_noise**2)
    np.sqrt(variance, out=variance)
    noise *= variance
    light += noise
    light += np.float32(sensor.offset)
    np.rint(light, out=light)
    np.clip(light, 0, sensor.ceiling, out=light)
    return light.astype(np.uint8 if sensor.bits <= 8 else np.uint16)


def shift_rows(image: Floats, shift_px: Floats) -> Floats:
    """Displace every row to the right by a small part of a pixel (shape (H,), well below ½).

    By the Taylor series to second order with central differences: ``I - δ I' + ½ δ² I''``.
    """
    d = shift_px[:, None]
    padded = np.pad(image, ((0, 0), (1, 1)), mode="edge")
    left, right = padded[:, :-2], padded[:, 2:]
    shifted = image * (1 - d * d)
    shifted += left * (0.5 * (d * d + d))
    shifted += right * (0.5 * (d * d - d))
    return np.asarray(np.maximum(shifted, 0.0), np.float32)
