"""Sequences of patterns."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, log2, pi

from core.patterns.kinds import Axis, Black, Code, Line, Pattern, Phase, White
from core.patterns.pattern import axis_of, cycle_lines, use_of


def gray_and_phase(
    axis: Axis,
    lines: int,
    *,
    cell: int,
    periods: Sequence[float],
    steps: int = 4,
    profile: str = "sine",
    kind: str = "gray",
    inverse: bool = False,
    first_shift_rad: float = 0.0,
) -> list[Pattern]:
    """Code bits for `lines` lines in cells of `cell`, then `steps` phase steps of every period.

    Parameters
    ----------
    inverse : bool
        Follow every code pattern by its complement.
    first_shift_rad : float
        Shift of step 0; the others follow at equal distances of 2 pi / steps.

    Examples
    --------
    >>> len(gray_and_phase("x", 640, cell=2, periods=[4], profile="square", first_shift_rad=pi / 2))
    13
    """
    bits = max(1, ceil(log2(ceil(lines / cell))))
    patterns: list[Pattern] = []
    for bit in range(bits):
        patterns.append(Code(kind, axis, bit, bits, cell))  # type: ignore[arg-type]
        if inverse:
            patterns.append(Code(kind, axis, bit, bits, cell, True))  # type: ignore[arg-type]
    for period in periods:
        for k in range(steps):
            shift = first_shift_rad + 2 * pi * k / steps
            patterns.append(Phase(axis, period, steps, k, shift, profile))  # type: ignore[arg-type]
    return patterns


def reference_sequence(width: int = 640, height: int = 640, axes: Sequence[Axis] = ("x", "y")) -> list[Pattern]:
    """The cross-pattern LCD's sequence: Gray bits of cell 2 and four square steps of period 4 per axis, white, black.

    Brenner, Böhm, Gühring (1999), section 2: 9 Gray bits for 640 lines; the last resolves the phase's ambiguity.
    """
    patterns: list[Pattern] = []
    for axis in axes:
        lines = width if axis == "x" else height
        patterns += gray_and_phase(axis, lines, cell=2, periods=[4], profile="square", first_shift_rad=pi / 2)
    return [*patterns, White(), Black()]


def light_sections(axis: Axis, lines: int, width: int = 1, pitch: int = 1) -> list[Pattern]:
    """One line of `width` at a time, every `pitch` lines; then black."""
    return [*(Line(axis, i, width) for i in range(0, lines - width + 1, pitch)), Black()]


def finest_steps(patterns: Sequence[Pattern], axis: Axis | None = None) -> tuple[float, list[int]]:
    """Find the phase steps of the finest stripes, along one axis or either: period in lines, 0 without, and numbers.

    Examples
    --------
    >>> finest_steps(reference_sequence(), "y")
    (4.0, [22, 23, 24, 25])
    """
    cycles = {
        i: cycle
        for i, p in enumerate(patterns)
        if use_of(p) == "phase" and axis in (None, axis_of(p)) and (cycle := cycle_lines(p))
    }
    least = min(cycles.values(), default=0.0)
    return float(least), [i for i, cycle in cycles.items() if cycle == least]
