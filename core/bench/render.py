"""Frames: prepare the geometry once, then expose as many patterns as wanted."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.bench.optics import Lcd, pixel_weights, relative_tables
from core.bench.raycast import Samples, cast
from core.bench.rig import Rig
from core.bench.scene import Scene
from core.bench.sensor import digitise
from core.bench.tables import expose_pixels
from core.lazy import dataclass
from core.model import Array, DeviceSpec, Floats
from core.parallel import THREADS, run_in_bands
from core.patterns import Pattern, axis_of, brightness
from core.progress import SILENT, Progress

Image = NDArray[Any]
_OFF = np.zeros((1, 0, 1), np.float32)
_AT_ONCE = 8  # patterns in one way through the rays: 160 MB at 5 Mpx


@dataclass(frozen=True)
class Prepared:
    """A rig before a scene, ready to expose; the scene and the rig stand still."""

    rig: Rig
    scene: Scene
    samples: Samples
    room: Floats  #: (H, W): the image by the light of the room alone, white at the image's middle as 1

    def frame(self, pattern: Pattern, seed: int | Sequence[int] = 0, *, lamp: float = 1.0, room: float = 1.0) -> Image:
        """Take one image, shape (H, W), of a pattern; equal seeds give equal noise.

        `lamp` and `room` multiply the light of the projector and of the room.
        """
        return self.frame_lines(*lines_of(pattern, self.rig), seed, lamp=lamp, room=room)

    def frame_lines(
        self,
        columns: ArrayLike,
        rows: ArrayLike,
        seed: int | Sequence[int] = 0,
        *,
        lamp: float = 1.0,
        room: float = 1.0,
    ) -> Image:
        """Take one image with these column lines, shape (width,), and row lines, shape (height,), 0 to 1, switched.

        Light passes where exactly one of the two is on; grey columns with all rows off show as they are.
        """
        light = self.light(columns, rows, lamp=lamp, room=room)
        return digitise(self.rig.sensor, light, np.random.default_rng(seed))

    def light(self, columns: ArrayLike, rows: ArrayLike, *, lamp: float = 1.0, room: float = 1.0) -> Floats:
        """Give the image before the camera's electronics, shape (H, W), grey values without offset and noise."""
        c, r = (
            _OFF if not np.any(lines) else relative_tables(self.rig.lcd, lines)[..., None] for lines in (columns, rows)
        )
        return self.lit(self.passed(c, r, 1)[0], lamp, room)

    def passed(self, columns: Floats, rows: Floats, count: int) -> Floats:
        """Give the light that passes, white as 1, shape (P, H, W), under tables (k, n, P) of P = `count` patterns."""
        return _gathered(self.rig, self.samples, self.samples.gain, columns, rows, 1 / self.rig.lcd.contrast, count)

    def lit(self, out: Floats, lamp: float, room: float) -> Floats:
        """Make of light that passes (changed in place) the image before the camera's electronics."""
        for detour in self.scene.detours:
            spread = cv2.GaussianBlur(out, (0, 0), detour.spread * out.shape[1])
            out += detour.share * (spread[:, ::-1] * self.room if detour.mirrored else spread - out)
        out *= np.float32(self.rig.sensor.white_level * lamp)
        out += self.room * np.float32(self.scene.ambient * room)
        return out


def lines_of(pattern: Pattern, rig: Rig) -> tuple[Array, Array]:
    """Give brightness of the column lines, shape (width,), and row lines, shape (height,), that show a pattern."""
    columns, rows = np.zeros(rig.projector.width), np.zeros(rig.projector.height)
    if axis_of(pattern) == "y":
        rows = brightness(pattern, np.arange(rows.size))
    else:
        columns = brightness(pattern, np.arange(columns.size))
    return columns**rig.lcd.exponent, rows**rig.lcd.exponent


def prepare(rig: Rig, scene: Scene) -> Prepared:
    """Cast all rays of a rig before a scene.

    Examples
    --------
    >>> from core.bench import experiment
    >>> from core.patterns import Black, White
    >>> e = experiment("quick")
    >>> prepared = prepare(e.rig, e.shot("plane+00").scene)
    >>> white, black = prepared.frame(White(), seed=1), prepared.frame(Black(), seed=2)
    >>> white.shape, white.dtype, bool(white.mean() > 4 * black.mean())
    ((240, 320), dtype('uint8'), True)
    """
    samples, _ = cast(rig, scene, rig.subsamples)
    (room,) = _gathered(rig, samples, samples.reflect, _OFF, _OFF, 1.0, 1)
    return Prepared(rig, scene, samples, room)


def _gathered(rig: Rig, s: Samples, gain: Floats, columns: Floats, rows: Floats, dark: float, count: int) -> Floats:
    weights = pixel_weights(rig.subsamples, rig.lens.blur_px)
    out = np.empty((count, rig.camera.height, rig.camera.width), np.float32)
    expose = (s.u, s.v, gain, s.width, columns, rows, dark, weights, rig.subsamples, out)
    run_in_bands(lambda first, last: expose_pixels(first, last, *expose), out.shape[1])
    return out


def render(
    scene: Scene, rig: Rig, patterns: Sequence[Pattern], seed: int = 0, *, progress: Progress = SILENT
) -> list[Image]:
    """Take one image per pattern of a scene that stands still.

    The result depends on the seed alone, not on the number of threads.
    """
    prepared = prepare(rig, scene)
    exposures = [Exposure(prepared, pattern) for pattern in patterns]
    return expose(exposures, seed, progress=progress)


@dataclass(frozen=True)
class Exposure:
    """One frame to take: what stands there, what is shown, and how bright lamp and room are at that moment."""

    prepared: Prepared
    pattern: Pattern
    lamp: float = 1.0
    room: float = 1.0


def expose(exposures: Sequence[Exposure], seed: int | Sequence[int], *, progress: Progress = SILENT) -> list[Image]:
    """Take frames, several of what stands still at once; frame k draws its noise from the seed (seed, k)."""
    stream = [seed] if isinstance(seed, int) else list(seed)
    images: dict[int, Image] = {}
    alike: dict[tuple[int, bool], list[int]] = {}
    for k, e in enumerate(exposures):
        alike.setdefault((id(e.prepared), axis_of(e.pattern) == "y"), []).append(k)
    groups = [
        (along, group[k : k + _AT_ONCE]) for (_, along), group in alike.items() for k in range(0, len(group), _AT_ONCE)
    ]

    with ThreadPoolExecutor(THREADS) as pool:
        for n, (along_y, group) in enumerate(groups):
            progress(n / len(groups), "rendering")
            p = exposures[group[0]].prepared
            tables = _tables(p.rig.lcd, p.rig.projector, tuple(exposures[k].pattern for k in group))
            lights = p.passed(_OFF if along_y else tables, tables if along_y else _OFF, len(group))

            def take(k: int, light: Floats) -> Image:
                e = exposures[k]
                lit = e.prepared.lit(light, e.lamp, e.room)
                return digitise(e.prepared.rig.sensor, lit, np.random.default_rng([*stream, k]))

            images |= zip(group, pool.map(take, group, lights), strict=True)
    return [images[k] for k in range(len(exposures))]


@lru_cache(maxsize=8)
def _tables(lcd: Lcd, projector: DeviceSpec, patterns: tuple[Pattern, ...]) -> Floats:
    """Tabulate patterns along one axis, side by side; all captures of an experiment show the same ones."""
    count = projector.height if axis_of(patterns[0]) == "y" else projector.width
    shown = (brightness(pattern, np.arange(count)) ** lcd.exponent for pattern in patterns)
    return np.stack([relative_tables(lcd, lines) for lines in shown], axis=-1)
