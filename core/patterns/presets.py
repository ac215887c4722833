"""The sequences that have a name, each for any projector size, and the options that change it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import ceil, log, pi, sqrt
from typing import Any

from core.fields import Fields
from core.lazy import dataclass
from core.patterns.dense import dense_words
from core.patterns.kinds import Axis, Black, Lines, Pattern, White
from core.patterns.sequence import gray_and_phase

Reader = Callable[[Fields, str], Any]
Size = tuple[int, int]  # columns and rows of a projector

PERIOD = 16.0  # lines: a sine that any focus keeps, and four steps of which tell a hundredth of a line or so
LARGEST_RATIO = 12.0  # from a period to the next longer: four steps then name the right one by many sigmas
BEYOND = 1.1  # of the lines is the longest period: at its ends it must not begin again
MOST_FRAMES = 4096


@dataclass(frozen=True)
class Preset:
    """A named sequence: what it is in words, its options with their readers, and how it is made for a size."""

    words: str
    options: Mapping[str, Reader]
    make: Callable[[Size, Mapping[str, Any]], list[Pattern]]


def number(default: float | None, above: float = 0.0) -> Reader:
    """Read a number greater than `above`."""
    return lambda fields, key: fields.real(key, above=above, default=default)


def whole(default: int | None, least: int, most: int | None = None) -> Reader:
    """Read a whole number."""
    return lambda fields, key: fields.integer(key, least, most, default=default)


def steps(default: int, none: bool = False) -> Reader:
    """Read a number of phase steps: three or more, or 0 for none."""

    def read(fields: Fields, key: str) -> int:
        if none and fields.data.get(key) == 0 and not isinstance(fields.data.get(key), bool):
            return 0
        return int(fields.integer(key, 3, MOST_FRAMES, default=default))

    return read


def choice(default: str, *among: str) -> Reader:
    """Read one of several words."""
    return lambda fields, key: fields.text(key, default=default, among=among)


def flag(default: bool) -> Reader:
    """Read true or false."""
    return lambda fields, key: default if fields.data.get(key) is None else fields.flag(key)


def axes(fields: Fields, key: str) -> tuple[Axis, ...]:
    """Read the axes: "x", "y", "xy" or a list of them."""
    value = fields.data.get(key)
    every: dict[Any, tuple[Axis, ...]] = {
        None: ("x", "y"),
        "xy": ("x", "y"),
        "yx": ("y", "x"),
        "x": ("x",),
        "y": ("y",),
    }
    text = "".join(value) if isinstance(value, list) and all(isinstance(v, str) for v in value) else value
    if not isinstance(text, str | None) or text not in every:
        raise fields.refuse(key, value, 'use "x", "y" or "xy"')
    return every[text]


def periods(fields: Fields, key: str) -> tuple[float, ...] | None:
    """Read a list of periods in lines."""
    if fields.data.get(key) is None:
        return None
    items = fields.items(key)
    if not items:
        raise fields.refuse(key, items, "give at least one period in lines")
    return tuple(Fields({key: item}, fields.where).real(key, above=2.0) for item in items)


def _for_axes(size: Size, options: Mapping[str, Any], make: Callable[[Axis, int], list[Pattern]]) -> list[Pattern]:
    """Put the patterns of all axes one after the other, then white and black where they are wanted."""
    patterns: list[Pattern] = []
    for axis in options["axes"]:
        patterns += make(axis, size[axis == "y"])
    return [*patterns, White(), Black()] if options["plain"] else patterns


def _paper(size: Size, options: Mapping[str, Any]) -> list[Pattern]:
    def make(axis: Axis, lines: int) -> list[Pattern]:
        return gray_and_phase(axis, lines, cell=2, periods=[4], profile="square", first_shift_rad=pi / 2)

    return _for_axes(size, options, make)


def _gray(size: Size, options: Mapping[str, Any]) -> list[Pattern]:
    period, count = options["period"], options["steps"]
    cell = options["cell"] or (max(1, int(period // 2)) if count else 1)

    def make(axis: Axis, lines: int) -> list[Pattern]:
        return gray_and_phase(
            axis,
            lines,
            cell=cell,
            periods=[period] if count else [],
            steps=count,
            profile=options["profile"],
            kind=options["code"],
            inverse=options["inverse"],
            first_shift_rad=pi / 2 if options["profile"] == "square" else 0.0,
        )

    return _for_axes(size, options, make)


def ladder(finest: float, lines: int) -> list[float]:
    """Give periods from the finest to one beyond all lines, each at most `LARGEST_RATIO` times the one before.

    Examples
    --------
    >>> ladder(16.0, 640), ladder(16.0, 12)
    ([16.0, 106.132, 704.0], [16.0])
    """
    longest = BEYOND * lines
    if longest <= finest:
        return [finest]
    rungs = ceil(log(longest / finest) / log(LARGEST_RATIO))
    return [round(finest * (longest / finest) ** (k / rungs), 3) for k in range(rungs + 1)]


def neighbours(lines: int) -> list[float]:
    """Give the two whole periods, one line apart, whose beat is just beyond all lines.

    Examples
    --------
    >>> neighbours(640)
    [27.0, 28.0]
    """
    finest = max(3, ceil(sqrt(BEYOND * lines + 0.25) - 0.5))
    return [float(finest), float(finest + 1)]


def _phases(size: Size, options: Mapping[str, Any], chosen: Callable[[int], list[float]]) -> list[Pattern]:
    def make(axis: Axis, lines: int) -> list[Pattern]:
        every = gray_and_phase(
            axis,
            2,
            cell=1,
            periods=options["periods"] or chosen(lines),
            steps=options["steps"],
            profile=options["profile"],
        )
        return every[1:]  # without its one bit

    return _for_axes(size, options, make)


def _dense(size: Size, options: Mapping[str, Any]) -> list[Pattern]:
    each = max(3, (options["frames"] - 2 * options["plain"]) // len(options["axes"]))

    def make(axis: Axis, lines: int) -> list[Pattern]:
        words = dense_words(lines, each, options["blur"], options["seed"])
        return [Lines.of(axis, words[:, k]) for k in range(each)]

    return _for_axes(size, options, make)


_COMMON: dict[str, Reader] = {"axes": axes, "plain": flag(True)}
_GRAY: dict[str, Reader] = {
    "period": number(PERIOD, 2.0),
    "steps": steps(4, none=True),
    "cell": whole(None, 1),
    "code": choice("gray", "gray", "binary"),
    "profile": choice("sine", "sine", "square"),
    **_COMMON,
}
_PHASES: dict[str, Reader] = {"periods": periods, "profile": choice("sine", "sine", "square"), **_COMMON}

PRESETS: dict[str, Preset] = {
    "paper": Preset("Gray code of cell 2 and four square steps of period 4, as in 1999", _COMMON, _paper),
    "gray-sine": Preset("Gray code and sine steps", {**_GRAY, "inverse": flag(False)}, _gray),
    "gray-inverse": Preset(
        "Gray code, each frame followed by its inverse, and sine steps", {**_GRAY, "inverse": flag(True)}, _gray
    ),
    "multi-frequency": Preset(
        "sine steps of ever longer periods, without code",
        {"period": number(PERIOD, 2.0), "steps": steps(4), **_PHASES},
        lambda size, options: _phases(size, options, lambda lines: ladder(options["period"], lines)),
    ),
    "two-period": Preset(
        "sine steps of two neighbouring periods, without code",
        {"steps": steps(8), **_PHASES},
        lambda size, options: _phases(size, options, neighbours),
    ),
    "dense": Preset(
        "words in which half the frames switch at every line",
        {
            "frames": whole(28, 3, MOST_FRAMES),
            "axes": axes,
            "blur": number(0.55),
            "seed": whole(0, 0, 10**6),
            "plain": flag(False),
        },
        _dense,
    ),
}
