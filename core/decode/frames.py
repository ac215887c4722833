"""Sorting the frames by what they tell, and refusing what cannot be a capture."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.lazy import dataclass
from core.numerics import distinct
from core.patterns import Axis, Pattern, Phase, axis_of, level_of, use_of

Image = NDArray[np.uint8] | NDArray[np.uint16]
Numbers = tuple[int, ...]


@dataclass(frozen=True)
class CodeFrames:
    """The frames of one Gray or binary code: of every bit the frames that show it and those that show its inverse."""

    kind: str
    bits: int
    cell: int
    direct: dict[int, Numbers]
    inverse: dict[int, Numbers]

    @property
    def name(self) -> str:
        """How messages call this code."""
        return f"{self.kind} code of {self.bits} bits in cells of {self.cell}"


@dataclass(frozen=True)
class PhaseFrames:
    """The frames of one period and profile."""

    period: float
    frames: Numbers
    patterns: tuple[Phase, ...]


@dataclass(frozen=True)
class LineFrames:
    """Frames of a light section: the centre of the lit lines and how many there are, in ascending order."""

    centre: tuple[float, ...]
    width: int
    frames: Numbers

    @property
    def pitch(self) -> float:
        """Distance between neighbouring sections in lines."""
        return float(np.median(np.diff(distinct(self.centre)))) if len(set(self.centre)) > 1 else 1.0

    def open_ends(self, lines: int) -> tuple[bool, bool]:
        """Whether the projector, of so many lines, has further lines before the first section and after the last."""
        beside = (self.width - 1) / 2 + max(self.pitch - self.width, 0)
        return self.centre[0] - beside > 0, self.centre[-1] + beside < lines - 1


@dataclass(frozen=True)
class AxisFrames:
    """All that a capture tells about one projector axis."""

    axis: Axis
    codes: tuple[CodeFrames, ...]
    phases: tuple[PhaseFrames, ...]
    lines: LineFrames | None


@dataclass(frozen=True)
class SortedFrames:
    """A capture's frames (numbers in its list) by what they tell."""

    white: Numbers
    black: Numbers
    axes: dict[Axis, AxisFrames]
    duplicates: tuple[Numbers, ...] = field(default=())


def check_images(patterns: Sequence[Pattern], images: Sequence[Image], where: str) -> list[Image]:
    """Give the images as contiguous arrays of one shape (H, W) and integer type; else, or without any, an
    InputError.
    """
    if len(images) == 0:
        raise InputError(where, "no frames", "give at least the frames of one projector axis")
    if len(images) != len(patterns):
        raise InputError(where, f"{len(images)} images but {len(patterns)} patterns", "give every frame its pattern")
    first = np.asarray(images[0])
    for number, image in enumerate(images):
        place, array = f"{where}, frame {number}", np.asarray(image)
        if array.dtype not in (np.uint8, np.uint16):
            raise InputError(place, f"grey values of type {array.dtype}", "give 8- or 16-bit unsigned grey values")
        if array.ndim != 2 or array.size == 0:
            raise InputError(place, f"an image of shape {array.shape}", "give single-channel images (rows, columns)")
        if array.shape != first.shape:
            seen = f"{array.shape[1]} × {array.shape[0]} px where frame 0 has {first.shape[1]} × {first.shape[0]}"
            raise InputError(place, seen, "give frames of one camera at one size")
        if array.dtype != first.dtype:
            raise InputError(place, f"{array.dtype} where frame 0 has {first.dtype}", "give all frames at one depth")
    contiguous: list[Any] = [np.ascontiguousarray(image) for image in images]
    return contiguous


def sort_frames(patterns: Sequence[Pattern]) -> SortedFrames:
    """Sort frames by axis and kind; frames of equal pattern stay together and are averaged later."""
    same: dict[Pattern, list[int]] = defaultdict(list)
    for number, pattern in enumerate(patterns):
        same[pattern].append(number)
    axes: dict[Axis, AxisFrames] = {}
    for axis in ("x", "y"):
        mine = {p: tuple(n) for p, n in same.items() if axis_of(p) == axis}
        if mine:
            axes[axis] = AxisFrames(axis, _codes(mine), _phases(mine), _lines(mine))
    duplicates = tuple(tuple(n) for n in same.values() if len(n) > 1)
    white, black = (
        tuple(n for p, numbers in same.items() if level_of(p) == level for n in numbers) for level in (1, 0)
    )
    return SortedFrames(white, black, axes, duplicates)


def _codes(patterns: dict[Pattern, Numbers]) -> tuple[CodeFrames, ...]:
    groups: dict[tuple[str, int, int], CodeFrames] = {}
    for pattern, numbers in _used(patterns, "code"):
        key = (pattern.kind, pattern.bits, pattern.cell)
        group = groups.setdefault(key, CodeFrames(*key, {}, {}))
        (group.inverse if pattern.inverse else group.direct)[pattern.bit] = numbers
    return tuple(groups.values())


def _phases(patterns: dict[Pattern, Numbers]) -> tuple[PhaseFrames, ...]:
    groups: dict[tuple[str, str], list[tuple[int, Phase]]] = defaultdict(list)
    for pattern, numbers in _used(patterns, "phase"):
        groups[f"{pattern.period:.9g}", pattern.profile] += [(number, pattern) for number in numbers]
    phases = [PhaseFrames(g[0][1].period, tuple(n for n, _ in g), tuple(p for _, p in g)) for g in groups.values()]
    return tuple(sorted(phases, key=lambda phase: phase.period))


def _lines(patterns: dict[Pattern, Numbers]) -> LineFrames | None:
    lines = [(p.index + (p.width - 1) / 2, p.width, n) for p, numbers in _used(patterns, "section") for n in numbers]
    if not lines:
        return None
    centre, width, frames = zip(*sorted(lines), strict=True)
    return LineFrames(centre, max(width), frames)


def _used(patterns: dict[Pattern, Numbers], use: str) -> list[tuple[Any, Numbers]]:
    return [(pattern, numbers) for pattern, numbers in patterns.items() if use_of(pattern) == use]
