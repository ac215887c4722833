"""What is known of a capture before any pixel is decoded: what follows from its patterns, and what a sample tells."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.decode.balance import balance
from core.decode.chosen import in_steady_light, of_lit, take_sample
from core.decode.flicker import steady
from core.decode.frames import Image, SortedFrames, sort_frames
from core.decode.noise import Noise, contrasts
from core.decode.options import DecodeOptions
from core.decode.plan import plan_axis
from core.decode.sample import (
    bent_squares,
    check_duplicates,
    full_scale,
    limits_of,
    measure_fading,
    measure_noise,
)
from core.decode.sections import measure_ripple
from core.decode.tables import Array, AxisTable, Limits, Rows, Singles, axis_table, image_row, make_rows, no_axis
from core.decode.waves.fitting import estimate_response
from core.decode.waves.harmonics import SquareWave, measure_bend, square_waves
from core.decode.waves.response import Response, Wave, shade, straighten, waves_of
from core.errors import InputError
from core.lazy import dataclass
from core.patterns import Axis, Pattern

AXES: tuple[Axis, Axis] = ("x", "y")


@dataclass(frozen=True)
class Prepared:
    """What follows from the patterns alone, the same for every capture of a sequence."""

    frames: SortedFrames
    tables: tuple[AxisTable, AxisTable]
    waves: tuple[Wave, ...]
    sharp: tuple[Wave, ...]
    squares: tuple[tuple[SquareWave, ...], tuple[SquareWave, ...]]
    image_rows: Rows
    contrasts: NDArray[np.float64]

    def periods(self, axis: int) -> list[tuple[float, int]]:
        """Periods (lines) and numbers of steps of an axis of sine fringes; none where any of its fringes are square."""
        mine = [(w.frames.period, len(w.frames.frames)) for w in self.waves if w.axis == axis]
        return [] if self.squares[axis] else mine


@lru_cache(maxsize=16)
def prepare(patterns: tuple[Pattern, ...], lines: tuple[int, int] | None) -> Prepared:
    """Sort, plan and tabulate."""
    frames = sort_frames(patterns)
    if not frames.axes:
        raise InputError("", "no code, phase or line frames", "give the frames of at least one projector axis")
    tables = []
    for number, axis in enumerate(AXES):
        mine = frames.axes.get(axis)
        plan = plan_axis(mine, lines[number] if lines else None, "") if mine else None
        tables.append(axis_table(plan, mine, frames) if plan and mine else no_axis())
    sines, squares = waves_of(frames)
    x, y = shade(tables, sines)
    return Prepared(
        frames,
        (x, y),
        sines,
        squares,
        (square_waves(patterns, x), square_waves(patterns, y)),
        make_rows([image_row(frames)]),
        contrasts(frames, len(patterns)),
    )


class Seen(NamedTuple):
    """What a sample of the grey values (frames, pixels) tells before any pixel is decoded."""

    limits: Limits
    tables: tuple[AxisTable, AxisTable]
    response: Response | None
    light: Array | None
    sample: Singles
    camera: Array | None  # its curve, see `core.decode.waves.camera`


def measure(
    sequence: Prepared,
    patterns: Sequence[Pattern],
    images: Sequence[Image],
    options: DecodeOptions,
    where: str,
    known: Noise | None,
) -> Seen:
    """What a sample of the grey values tells: the thresholds, and how the stripes of both axes are blurred."""
    sample = take_sample(images)
    check_duplicates(sequence.frames, sample, where)
    measured = [n for table in sequence.tables for n in (*table.phase_frames, *table.line_frames)]
    saturation = full_scale(images, tuple(measured), sample, options)
    tables, light = steady(sequence.tables, images, saturation)
    sample = in_steady_light(sample, light)
    seek = options.camera and known is None
    response, camera = estimate_response(sequence.waves, patterns, sample, saturation, images, seek)
    found = sequence.contrasts
    bent = sequence.waves if response else bent_squares(sequence.sharp, found, sample, saturation)
    noise = measure_noise(sequence.frames, found, sample, saturation, images, bent, light)
    noise = known._replace(misfit=noise.misfit, unlit=noise.unlit) if known else noise
    tables = straighten(tables, response, sequence.waves) if response else tables
    x, y = (
        measure_ripple(table, sequence.frames.axes.get(axis), sample, noise)
        for table, axis in zip(tables, AXES, strict=True)
    )
    tables = (x, y)
    x, y = (measure_fading(balance(table, sample, noise), sample, noise) for table in tables)
    tables = (x, y)
    if any(sequence.squares):
        lit, places = of_lit(sample, images, light, [int(n) for table in tables for n in table.phase_frames])
        x, y = (
            measure_bend(table, squares, lit, places, noise, saturation)
            for table, squares in zip(tables, sequence.squares, strict=True)
        )
    return Seen(limits_of(noise, saturation, options, (x, y)), (x, y), response, light, sample, camera)
