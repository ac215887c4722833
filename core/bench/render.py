"""Frames: prepare the geometry once, then expose as many patterns as wanted."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.bench.optics import pixel_weights, relative_tables
from core.bench.raycast import Samples, cast
from core.bench.rig import Rig
from core.bench.scene import Scene
from core.bench.sensor import digitise
from core.bench.tables import expose_rows, gather_columns
from core.parallel import THREADS, run_in_bands
from core.patterns import Pattern, axis_of, brightness
from core.progress import SILENT, Progress

Floats = NDArray[np.float32]
Array = NDArray[np.float64]
Image = NDArray[Any]
_OFF = np.zeros((1, 0), np.float32)
Bands = Callable[[Callable[[int, int], None], int], None]


@dataclass(frozen=True)
class Prepared:
    """A rig before a scene, ready to expose; the scene and the rig stand still.

    Attributes
    ----------
    rig : Rig
    scene : Scene
    samples : Samples
    room : array, shape (H, W)
        The image by the light of the room alone, white at the image's middle as 1.
    """

    rig: Rig
    scene: Scene
    samples: Samples
    room: Floats

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

    def light(
        self, columns: ArrayLike, rows: ArrayLike, *, lamp: float = 1.0, room: float = 1.0, bands: Bands = run_in_bands
    ) -> Floats:
        """Give the image before the camera's electronics, shape (H, W), grey values without offset and noise."""
        s, lcd = self.samples, self.rig.lcd
        weights = pixel_weights(self.rig.subsamples, self.rig.lens.blur_px)
        c, r = (relative_tables(lcd, lines) if np.any(lines) else _OFF for lines in (columns, rows))
        half = np.empty((s.u.shape[0], self.rig.camera.width), np.float32)
        out = np.empty((self.rig.camera.height, self.rig.camera.width), np.float32)
        per = self.rig.subsamples
        expose = (s.u, s.v, s.gain, s.width, c, r, 1 / lcd.contrast, weights, per, half)
        bands(lambda first, last: expose_rows(first, last, *expose), half.shape[0])
        bands(lambda first, last: gather_columns(first, last, half, weights, per, out), out.shape[0])
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
    return columns, rows


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
    weights = pixel_weights(rig.subsamples, rig.lens.blur_px)
    margin = (weights.size - rig.subsamples) // 2
    padded = np.pad(samples.reflect, ((0, 0), (margin, margin)), mode="edge")
    half = np.zeros((padded.shape[0], rig.camera.width), np.float32)
    for k, w in enumerate(weights):
        half += w * padded[:, k : k + rig.subsamples * rig.camera.width : rig.subsamples]
    room = np.empty((rig.camera.height, rig.camera.width), np.float32)
    gather_columns(0, room.shape[0], half, weights, rig.subsamples, room)
    return Prepared(rig, scene, samples, room)


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
    """Take frames, several at a time; frame k draws its noise from the seed (seed, k)."""
    stream = [seed] if isinstance(seed, int) else list(seed)

    def take(k: int) -> Image:
        e = exposures[k]
        columns, rows = lines_of(e.pattern, e.prepared.rig)
        light = e.prepared.light(columns, rows, lamp=e.lamp, room=e.room, bands=_in_this_thread)
        return digitise(e.prepared.rig.sensor, light, np.random.default_rng([*stream, k]))

    images = []
    with ThreadPoolExecutor(THREADS) as pool:
        waiting = [pool.submit(take, k) for k in range(len(exposures))]
        try:
            for k, job in enumerate(waiting):
                progress(k / len(waiting), "rendering")
                images.append(job.result())
        finally:
            for job in waiting:
                job.cancel()
    return images


def _in_this_thread(work: Callable[[int, int], None], rows: int) -> None:
    work(0, rows)
