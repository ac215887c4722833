"""Codes without phases, on request: the place within a cell, by the likelihood of all frames.

The bits alone tell a cell. Blurred, or seen by pixels that straddle them, the stripes of all widths are words whose
grey values change steadily from line to line: what looks up such words (likelihood.py) tells parts of a line by them.
How far their model fails - a camera's gamma, lines so sharp that pixels see one alone - shows in coordinates that are
rougher than their sigmas, which then hold it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.decode.compressed import APART, roughness
from core.decode.frames import Image
from core.decode.options import DecodeOptions, Flag
from core.decode.surface.agreement import widen
from core.decode.surface.mixed import doubt_mixtures
from core.decode.tables import CODE, AxisTable, Singles
from core.decode.words.book import FEWEST
from core.decode.words.likelihood import decode_words
from core.model import PhaseMap
from core.patterns import Axis, Code, Lines, Pattern, axis_of, brightness
from core.progress import Progress

WIDEST = 2  # lines of a cell: of wider ones, middles look alike
AGREED = 3.0  # standard deviations of what the bits tell, by which a place in their cell may differ


def codes_alone(tables: tuple[AxisTable, AxisTable]) -> dict[Axis, int]:
    """Axes that a Gray code alone tells, finely and by enough frames to tell more by them, and their numbers of lines.

    Not binary code: its edges lie together, so that blurred stripes tell little between them.
    """
    axes: tuple[Axis, Axis] = ("x", "y")
    return {
        axis: int(table.lines)
        for axis, table in zip(axes, tables, strict=True)
        if table.start == CODE
        and table.gray
        and not len(table.period)
        and table.cell <= WIDEST
        and len(table.sign) >= FEWEST - 1
    }


def refine_codes(
    phase: PhaseMap,
    patterns: Sequence[Pattern],
    images: Sequence[Image],
    lines: dict[Axis, int],
    options: DecodeOptions,
    where: str,
    progress: Progress,
) -> PhaseMap:
    """Put coordinates along the axes of `lines`, which codes alone tell, where all frames fit best.

    `lines` gives the projector's number of lines along each. Where no word fits, or it contradicts the bits, or is no
    surer, a coordinate stays as it is; where the bits left a pixel open, it is that of the word.
    """
    some = [n for n, pattern in enumerate(patterns) if (axis_of(pattern) or next(iter(lines))) in lines]
    shown = [_word(patterns[n], lines) for n in some]
    extent = lines.get("x", 1), lines.get("y", 1)
    found = decode_words(shown, [images[n] for n in some], extent, options, where, progress, lambda _: phase)
    for place, sigma in ((found.u, found.sigma_u), (found.v, found.sigma_v)):
        doubt_mixtures(place, sigma)
        widen(sigma, np.maximum(*(roughness(place, sigma, apart) for apart in (1, APART))))
    u, v, flags = phase.u, phase.v, phase.flags
    sigma_u, sigma_v = phase.sigma_u, phase.sigma_v
    if "x" in lines:
        u, sigma_u, flags = _taken(u, sigma_u, found.u, found.sigma_u, flags, Flag.NO_U)
    if "y" in lines:
        v, sigma_v, flags = _taken(v, sigma_v, found.v, found.sigma_v, flags, Flag.NO_V)
    lacks = sum(int(lack) for lack, place in ((Flag.NO_U, u), (Flag.NO_V, v)) if np.isfinite(place).any())
    flags = np.where(flags & np.uint8(lacks) == 0, flags & np.uint8(Flag.NO_U | Flag.NO_V), flags)
    return replace(phase, u=u, v=v, sigma_u=sigma_u, sigma_v=sigma_v, flags=flags)


def _word(pattern: Pattern, lines: dict[Axis, int]) -> Pattern:
    """Give a pattern of a code line by line."""
    if not isinstance(pattern, Code):
        return pattern
    return Lines.of(pattern.axis, brightness(pattern, np.arange(lines[pattern.axis])))


def _taken(
    place: Singles, sigma: Singles, other: Singles, its: Singles, flags: NDArray[np.uint8], lack: Flag
) -> tuple[Singles, Singles, NDArray[np.uint8]]:
    """Take the other coordinates where there are any, surer than the bits and not contradicted by them."""
    worse = (np.abs(other - place) > AGREED * np.maximum(sigma, its)) | (its >= sigma)  # False where either is NaN
    better = np.isfinite(other) & ~worse
    flags = np.where(better, flags & np.uint8(255 - lack), flags)
    return np.where(better, other, place), np.where(better, its, sigma), flags
