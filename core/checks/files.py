"""The same frames twice: under two patterns, or in two captures. A camera never takes the same image again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from core.model import Capture, Concern, Frame, TargetSet
from core.patterns import Pattern, axis_of, brightness, level_of

MOST_NAMED = 4
LEAST_COMMON = 8  # targets of two captures that are compared
SAME = 0.2  # of sigma, r.m.s.: two images of a board that stands still differ by 1.4


def repeated_frames(
    captures: Sequence[Capture], lines: tuple[int, int], contents: Mapping[str, str | None]
) -> list[Concern]:
    """Find frames whose bytes stand under another pattern or in another capture as well.

    Parameters
    ----------
    lines : (int, int)
        Columns and rows of the projector; patterns that are alike on all of them may share an image.
    contents : mapping
        Hash of every frame's file, by its place.
    """
    places: dict[str, list[tuple[Capture, Frame]]] = {}
    for capture in captures:
        for frame in capture.frames:
            if (key := contents.get(frame.place)) is not None:
                places.setdefault(key, []).append((capture, frame))
    shared: dict[tuple[str, str], list[tuple[Frame, Frame]]] = {}
    for alike in places.values():
        for (a, f), (b, g) in combinations(alike, 2):
            if _dark(f.pattern) or _dark(g.pattern):
                continue  # darkness may look the same twice
            if a is b and _look_alike(f.pattern, g.pattern, lines):
                continue
            shared.setdefault((a.name, b.name), []).append((f, g))
    frames = {c.name: len([f for f in c.frames if not _dark(f.pattern)]) for c in captures}
    return [_told(a, b, pairs, frames[a]) for (a, b), pairs in shared.items()]


def repeated_targets(sets: Sequence[TargetSet]) -> list[Concern]:
    """Find captures whose measured targets are another's, whatever became of the files."""
    concerns = []
    for a, b in combinations(sets, 2):
        if (a.camera, a.projector) != (b.camera, b.projector):
            continue
        keys = [[*zip(t.row.tolist(), t.col.tolist(), strict=True)] for t in (a, b)]
        index = {key: k for k, key in enumerate(keys[1])}
        first = np.array([k for k, key in enumerate(keys[0]) if key in index], np.int64)
        if len(first) < LEAST_COMMON:
            continue
        second = np.array([index[keys[0][k]] for k in first])
        off = a.camera_uv[first] - b.camera_uv[second]
        variance = np.diagonal(a.camera_cov[first], axis1=1, axis2=2)
        if np.mean(off**2 / variance) < SAME**2:
            text = f"{b.capture} has the same targets as {a.capture}, to a fifth of their sigma: one capture measured "
            concerns.append(Concern("failed", f"{text}twice; take one out"))
    return concerns


def _told(a: str, b: str, pairs: list[tuple[Frame, Frame]], frames: int) -> Concern:
    f, g = pairs[0]
    if a == b:
        more = f" and {len(pairs) - 1} pairs more" if len(pairs) > 1 else ""
        text = f"{a}: {f.path.name} and {g.path.name} are the same image under two patterns{more}: record one again"
        if f.path == g.path:
            text = f"{a}: {f.path.name} stands under two patterns{more}: correct capture.json or record it again"
        return Concern("failed", text)
    if len({f.path.name for f, _ in pairs}) >= 0.9 * frames:
        return Concern("failed", f"{b} has the same frames as {a}: one capture under two names; take one out")
    names = ", ".join(sorted({g.path.name for _, g in pairs})[:MOST_NAMED])
    return Concern("failed", f"{b}: {names} also stands in {a}: a file of another capture; record it again")


def _dark(pattern: Pattern) -> bool:
    return level_of(pattern) == 0


def _look_alike(a: Pattern, b: Pattern, lines: tuple[int, int]) -> bool:
    """Whether two patterns light all lines alike."""
    return all(np.array_equal(x, y) for x, y in zip(_lights(a, lines), _lights(b, lines), strict=True))


def _lights(pattern: Pattern, lines: tuple[int, int]) -> Iterator[np.ndarray]:
    for axis, count in zip("xy", lines, strict=True):
        own = axis_of(pattern)
        if own is None or own == axis:
            yield np.asarray(brightness(pattern, np.arange(count)))
        else:
            yield np.full(1, -1.0)
