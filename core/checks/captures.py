"""Captures held against each other and their boards: the same frames twice, unlike grey values, dots of another size.

A camera never takes the same image again; grey values of one camera by the same settings are alike; eccentricities go
with the square of the dots' size.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from itertools import combinations, groupby
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from core.errors import listed
from core.model import Capture, Concern, DeviceSpec, Frame, PlaneEvaluation, TargetSet, Testfield
from core.numerics import median_of, quantile_of, sigma_by_median
from core.patterns import Pattern, alike, level_of

MOST_NAMED = 4
LOOKED_AT = 8  # captures with one white frame, beside the first
LEAST_COMMON = 8  # targets of two captures that are compared
SAME = 0.5  # of the sigmas of both, r.m.s.: two images of a board that stands still differ by 1
AT_ONE_PLACE = 2e-3  # of planes' normals, and of their distance over itself: what may be one
COPIED = 0.6  # of the noise of both images: two exposures differ by 1, a copy by what was added to it
BLOCK, ALONE = 8, 0.15  # px; of the noise that is not common, which each of two exposures has half of, and a copy all
ROUNDED = 0.4  # grey values: rounding once leaves 0.29, and two exposures 0.57 where their noise is but 0.3
CAPTURES = 4  # that tell which gaps in the grey values are usual
FEW = 0.25  # of the captures may be unlike the others; more are another setting, by choice
GAPS, USUAL_GAPS = 0.1, 0.02  # of the grey values; brighter by a tenth leaves out a tenth
DOTS = 8  # of a capture that tell their size
OFF = 1.25  # prints and blur change diameters by less; of six sound projects all were 0.98 to 1.00
RADIUS = 1.7, 2.4  # times as large: diameter_mm is the radius


def repeated_frames(
    captures: Sequence[Capture],
    projectors: Mapping[str, DeviceSpec],
    contents: Mapping[str, str | None],
    blank: Callable[[Frame], bool],
    whole: Callable[[Capture, Frame], bool] = lambda *_: False,
    own: Callable[[Capture, Frame], bool] = lambda *_: False,
    *,
    of_each: bool = False,
    strange: Mapping[str, Collection[int]] = MappingProxyType({}),
) -> list[Concern]:
    """Find frames whose bytes stand under another pattern or in another capture as well.

    Parameters
    ----------
    projectors : mapping
        By name; a camera may have the same image of patterns that are alike on all lines of its projector.
    contents : mapping
        Hash of every frame's file, by its place.
    blank : callable
        Whether a frame has one grey value: darkness without noise is the same everywhere.
    whole : callable
        Whether a frame shows all light of its capture, or none, without noise: so does every code frame that is on, or
        off, on all lines that the camera sees.
    own : callable
        Whether a white frame is as bright as the other frames of its capture, pixel by pixel: captures of what stands
        still may share it.
    of_each : bool
        Tell it of each of two captures, not of the later one alone.
    strange : mapping
        By capture the numbers of frames that contradict its others: of two that share one the other's it is.
    """
    places: dict[str, list[tuple[Capture, Frame]]] = {}
    for capture in captures:
        for frame in capture.frames:
            if (key := contents.get(frame.place)) is not None:
                places.setdefault(key, []).append((capture, frame))
    shared: dict[tuple[str, str], list[tuple[Frame, Frame]]] = {}
    for same in places.values():
        lit = [(c, f) for c, f in same if not _dark(f.pattern)]  # one black frame may serve many captures
        by_capture = groupby(lit, lambda held: held[0].path)
        within = [(x, y) for _, held in by_capture for x, y in combinations(held, 2)]
        found = [(x, y) for x, y in within if not _look_alike(x[1], y[1], projectors) and not whole(*x)]
        across = [y for y in lit[1:] if y[0] is not lit[0][0]]  # of many the first is enough
        if across and all(level_of(f.pattern) == 1 and own(c, f) for c, f in (lit[0], *across[:LOOKED_AT])):
            across = []
        found += [(lit[0], y) for y in across] + [(y, lit[0]) for y in across[: int(of_each)]]
        if found and not blank(lit[0][1]):
            for (a, f), (b, g) in found:
                shared.setdefault((a.name, b.name), []).append((f, g))
    frames = {c.name: len([f for f in c.frames if not _dark(f.pattern)]) for c in captures}
    odd = {c.frames[k].place for c in captures for k in strange.get(c.name, ()) if k < len(c.frames)}
    concerns = []
    for (first, second), pairs in shared.items():
        here, there = ({frame.place for frame in side} & odd for side in zip(*pairs, strict=True))
        if first != second and here and not there and not of_each:  # the first one has it from the second
            first, second, pairs = second, first, [(g, f) for f, g in pairs]
        concerns.append(_told(first, second, pairs, frames[first]))
    return concerns


def _look_alike(a: Frame, b: Frame, projectors: Mapping[str, DeviceSpec]) -> bool:
    if (a.camera, a.projector) != (b.camera, b.projector) or a.projector not in projectors:
        return False
    projector = projectors[a.projector]
    return alike(a.pattern, b.pattern, (projector.width, projector.height))


def repeated_targets(sets: Sequence[TargetSet]) -> list[Concern]:
    """Find captures whose measured targets are another's, whatever became of the files."""
    number: dict[tuple[int, int], int] = {}
    places = [np.array([number.setdefault(key, len(number)) for key in t.keys], np.int64) for t in sets]
    # by camera and by projector: both coordinates and their variances, NaN where a target was not measured
    value, variance = np.full((2, 2, len(sets), len(number), 2), np.nan)
    for k, (t, at) in enumerate(zip(sets, places, strict=True)):
        value[:, k, at] = t.camera_uv, t.projector_uv
        variance[:, k, at] = np.diagonal(t.camera_cov, axis1=1, axis2=2), t.projector_sigma**2
    concerns = []
    for k, a in enumerate(sets[:-1]):
        off = (value[:, k + 1 :] - value[:, k, None]) ** 2 / (variance[:, k + 1 :] + variance[:, k, None])
        known = np.isfinite(off)
        mean = np.sum(off, axis=(2, 3), where=known) / np.maximum(known.sum(axis=(2, 3)), 1)
        alike = (mean.max(axis=0) < SAME**2) & (np.count_nonzero(known[0, :, :, 0], axis=1) >= LEAST_COMMON)
        for b in (sets[k + 1 + i] for i in np.flatnonzero(alike).tolist()):
            if (a.camera, a.projector) == (b.camera, b.projector):
                text = f"{b.capture} has the same targets as {a.capture}, to half of their sigma: one capture measured "
                concerns.append(Concern("failed", f"{text}twice; take one out"))
    return concerns


def repeated_planes(
    evaluations: Sequence[PlaneEvaluation], pairs: Callable[[str, str], Iterable[tuple[NDArray, NDArray]]]
) -> dict[str, str]:
    """Find planes whose frames are another's, whatever became of the files, and give the other's name by theirs.

    `pairs` gives images of two captures under the same stripes. A camera's noise is another in each; frames that were
    written again, scaled or given a little noise follow from the first ones but for that.
    """
    repeated: dict[str, str] = {}
    for a, b in combinations(evaluations, 2):
        together = (a.method, a.devices) == (b.method, b.devices) and not {a.capture, b.capture} & {*repeated}
        if together and np.abs((a.plane - b.plane) / (1, 1, 1, abs(a.plane[3]) or 1)).max() < AT_ONE_PLACE:
            off = [_unlike(*pair) for pair in pairs(a.capture, b.capture)]
            if off and max(off) < 1:
                repeated[b.capture] = a.capture
    return repeated


def _unlike(a: NDArray, b: NDArray) -> float:
    """R.m.s. of what one image leaves of the other where it is bright and neither clipped, over what copies leave."""
    x, y = (image.astype(np.float64).ravel() for image in (a, b))
    use = (x > x.mean()) & (x < x.max()) & (y > y.min()) & (y < y.max())
    if a.shape != b.shape or use.sum() < LEAST_COMMON or np.ptp(x[use]) == 0:
        return np.inf
    gain, offset = np.polyfit(x[use], y[use], 1)
    left = float(np.sqrt(np.mean((y[use] - gain * x[use] - offset) ** 2)))
    return left / max(ROUNDED * max(1.0, abs(gain)), COPIED * _common_noise(a, b, use.reshape(a.shape)))


def _common_noise(a: NDArray, b: NDArray, use: NDArray[np.bool_]) -> float:
    """Standard deviation of both images' noise where one has none of its own, by second differences along the stripes.

    0 where both have some: then they are two exposures, and what they have in common is the surface.
    """
    x, y = (image.astype(np.float64) for image in (a, b))
    side = min(BLOCK, *x.shape)
    height, width = (size // side for size in x.shape)
    p, q = (g[: height * side, : width * side].reshape(height, side, width, side).mean(axis=(1, 3)) for g in (x, y))
    gain = float(np.std(q) / max(float(np.std(p)), 1e-9))  # of means, with little noise, and the same of both
    ways = ((gain * x, y, use), (gain * x.T, y.T, use.T))
    rough = [tuple(np.diff(each, n=2)[where[:, 1:-1]] for each in both) for *both, where in ways]
    first, second = min(rough, key=lambda both: float(np.var(both[0])))
    own = np.mean(first * (first - second)), np.mean(second * (second - first))
    if abs(min(own)) > ALONE * sum(own):
        return 0.0
    return float(np.hypot(sigma_by_median(first), sigma_by_median(second)) / 6**0.5)


def _told(a: str, b: str, pairs: list[tuple[Frame, Frame]], frames: int) -> Concern:
    f, g = pairs[0]
    if a == b:
        more = f" and {len(pairs) - 1} pairs more" if len(pairs) > 1 else ""
        text = f"{a}: {f.path.name} and {g.path.name} are the same image under two patterns{more}: record one again"
        return Concern("failed", text, b)
    if len({f.path.name for f, _ in pairs}) >= 0.9 * frames:
        return Concern("failed", f"{b} has the same frames as {a}: one capture under two names; take one out", b)
    names = listed(sorted({g.path.name for _, g in pairs}), MOST_NAMED)
    text = f"{b}: {names} also stands in {a}: a file of another capture; record it again"
    if len(pairs) > 1:
        text = f"{b}: {names} also stand in {a}: files of another capture; record them again"
    return Concern("failed", text, b)


def _dark(pattern: Pattern) -> bool:
    return level_of(pattern) == 0


def grey_concerns(sets: Sequence[TargetSet]) -> list[Concern]:
    """Find captures whose frames leave grey values out that those of the others of the same camera take."""
    concerns = []
    for camera in dict.fromkeys(t.camera for t in sets):
        gaps = {t.capture: t.gaps for t in sets if t.camera == camera and t.gaps is not None}
        usual = quantile_of([*gaps.values()], 1 - FEW) if len(gaps) >= CAPTURES else 1.0
        for name, share in gaps.items():
            if usual < USUAL_GAPS and share > GAPS:
                text = (
                    f"{name}: its frames leave out {share:.0%} of the grey values, those of the other captures "
                    f"{usual:.0%}: they were brightened, given a gamma or cut to fewer bits after the camera; record "
                    "it with the settings of the others"
                )
                concerns.append(Concern("doubtful", text))
    return concerns


def size_concerns(targets: Sequence[TargetSet], boards: Mapping[str, Testfield | None]) -> list[Concern]:
    """Compare diameters with the dots' distances from each other, by boards (by capture) of one file."""
    found = {t.capture: size for t in targets if (size := _size(t, boards.get(t.capture))) is not None}
    size = median_of([*found.values()]) if found else 1.0
    if 1 / OFF <= size <= OFF:
        return []
    names = listed(sorted(found), 1)
    remedy = "correct it, or name the board that was captured"
    if RADIUS[0] < size < RADIUS[1]:
        remedy = "is it the radius, or are x_mm and y_mm of another board?"
    text = f"{names}: dots are seen {size:.2f} times as large as diameter_mm of their testfield file says; {remedy}"
    return [Concern("doubtful", text)]


def _size(t: TargetSet, board: Testfield | None) -> float | None:
    """Seen over nominal diameter, by the affinity from the board to the image."""
    if board is None or board.kind != "dots" or len(t.row) < DOTS:
        return None
    at = [board.index()[key] for key in t.keys]
    A = np.column_stack([board.xyz_mm[at, :2] - board.xyz_mm[at, :2].mean(axis=0), np.ones(len(at))])
    area = abs(np.linalg.det(np.linalg.lstsq(A, t.camera_uv, rcond=None)[0][:2]))
    return median_of(t.diameter_px / board.diameter_mm[at]) / float(np.sqrt(area)) if area > 0 else None
