"""Which frame shows which pattern, found from the images alone, whatever their order.

Even frames are the brightest and the darkest. Of the others the direction of their edges tells the axis, and how many
edges there are tells the pattern, nearly: the steps of one period have equally many. That is where the search begins.
It ends where every pixel's values are those of some projector line: a wrong order asks for combinations of bright and
dark that no line has. Frames are exchanged as long as that makes the pixels fit better.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from core.errors import InputError
from core.lazy import dataclass
from core.numerics import distinct, polynomial, quantile_of, quantiles, spaced
from core.patterns import Axis, Code, Pattern, axis_of, brightness, cycle_lines, describe, level_of, use_of
from core.progress import SILENT, Progress
from core.verify.lookup import dictionary

Array = NDArray[np.float32]
Exchanges = list[tuple[int, int]]
Image = NDArray[np.uint8] | NDArray[np.uint16]

PIXELS = 400  # whose lines are looked up
STRIPS = 48  # rows and columns in which edges are counted
MOST_ROUNDS = 12
FITS = 0.15  # squared distance, white = 1, of a pixel that some line explains; of one wrong frame 1
SHARE = 0.8  # of the pixels that must be explained
STARTS = 6  # from which the search begins anew where it ended badly
ALIKE = 0.02  # in how evenly lines run: orders of steps within their cells, which the misfit tells
BENT = 0.1  # of full light, by which a response is taken out
BLURS = (1, 3)  # of the look-up's: sharp and soft


def recognise(
    images: Sequence[Image],
    patterns: Sequence[Pattern],
    lines: tuple[int, int],
    where: str,
    progress: Progress = SILENT,
) -> list[int]:
    """Give for every pattern the number of the image that shows it; `lines` are the projector's columns and rows.

    The projector's picture is taken to stand upright in the camera's where the images do not tell: mirrored, turned
    words can be words of the same code. Whether another order is possible is for `proof` to say.
    """
    for axis in ("x", "y"):
        uses = {use_of(p) for p in patterns if axis_of(p) == axis}
        if uses and not uses & {"code", "word"}:
            raise InputError(
                where,
                f"the frames of axis {axis} are phases alone, of which any step could be the first",
                "order the files by name, or by a list that says what each shows",
            )
    stack = np.stack([np.asarray(image, np.float32) for image in images])
    black, white = quantiles(stack[:, ::4, ::4], 0.05, 0.95)
    contrast = quantile_of(white - black, 0.98)
    if contrast < 4:
        raise InputError(where, "the images hardly differ from each other", "give frames lit by the patterns")
    strips = _strips(stack, contrast)
    found: list[int] = [-1] * len(patterns)
    rest = _level_frames(stack, patterns, found)
    best: tuple[float, dict[int, int]] | None = None
    for turned in (False, True):
        groups = _by_axis(strips, rest, patterns, turned)
        if groups is None:
            continue
        total = 0.0
        chosen: dict[int, int] = {}
        for axis, frames in groups.items():
            misfit, order = _order(stack, frames, patterns, axis, lines, strips, turned, progress)
            total += misfit
            chosen |= order
        if best is None or total < best[0]:
            best = total, chosen
        if total < FITS * len(groups):
            break
    if best is not None:
        for pattern, frame in best[1].items():
            found[pattern] = frame
        if best[0] < 2 * FITS or not best[1]:
            return found
    seen = "no order of these images was found in which they show the sequence"
    raise InputError(where, seen, "give the right --sequence, or order them by name or by a list")


def _level_frames(stack: Array, patterns: Sequence[Pattern], found: list[int]) -> list[int]:
    """Find the frames of patterns that light the whole field: in the order of their mean grey values."""
    levels = sorted((level, i) for i, p in enumerate(patterns) if (level := level_of(p)) is not None)
    middle = np.quantile(stack, 0.5, axis=0)
    share = [float(np.mean(image > middle) - np.mean(image < middle)) for image in stack]
    bright = sorted(range(len(stack)), key=lambda f: (share[f], float(stack[f].mean())))
    means = [float(image.mean()) for image in stack]
    low, high = means[bright[0]], means[bright[-1]]
    rest = list(range(len(stack)))
    for level, i in levels:
        if level in (0, 1):
            frame = min(rest, key=lambda f: means[f] if level == 0 else -means[f])
        else:
            frame = min(
                rest, key=lambda f: abs(means[f] - low - level * (high - low)) + 100 * _unevenness(stack[f], middle)
            )
        found[i] = frame
        rest.remove(frame)
    return rest


def _unevenness(image: Array, middle: Array) -> float:
    ratio = image[::4, ::4] / np.maximum(middle[::4, ::4], 1)
    return float(np.std(ratio) / max(float(np.mean(ratio)), 1e-6))


@dataclass(frozen=True)
class _Strips:
    """How many edges every frame has along the image's rows, along its columns, in lit places."""

    along_rows: Array
    along_columns: Array


def _strips(stack: Array, contrast: float) -> _Strips:
    height, width = stack.shape[1:]
    rows, columns = (spaced(n, STRIPS) for n in (height, width))
    counted = []
    for part in (stack[:, rows, :], stack[:, :, columns].transpose(0, 2, 1)):
        low, high = quantiles(part, 0.1, 0.9)
        lit = high - low > 0.2 * contrast
        on = part > (high + low) / 2
        sure = np.abs(part - (high + low) / 2) > 0.15 * (high - low)
        edges = np.zeros(len(stack), np.float32)
        for f in range(len(stack)):
            for line_on, line_ok in zip(on[f], lit & sure[f], strict=True):
                edges[f] += np.count_nonzero(np.diff(line_on[line_ok]))
        counted.append((edges / max(1, int(lit.sum()))).astype(np.float32))
    return _Strips(*counted)


def _by_axis(
    strips: _Strips, rest: list[int], patterns: Sequence[Pattern], turned: bool
) -> dict[Axis, list[int]] | None:
    """Share the frames out between the axes; None where turning the projector changes nothing."""
    axes: list[Axis] = [a for a in ("x", "y") if any(axis_of(p) == a for p in patterns)]
    if len(axes) < 2:
        return None if turned or not axes else {axes[0]: rest}
    along, across = strips.along_rows[rest], strips.along_columns[rest]
    lean = (along - across) / (along + across + 1e-4)
    order = [rest[k] for k in np.argsort(lean if turned else -lean, kind="stable")]
    count = sum(axis_of(p) == "x" for p in patterns)
    return {"x": order[:count], "y": order[count:]}


def _order(
    stack: Array,
    frames: list[int],
    patterns: Sequence[Pattern],
    axis: Axis,
    lines: tuple[int, int],
    strips: _Strips,
    turned: bool,
    progress: Progress,
) -> tuple[float, dict[int, int]]:
    """Find the frames of one axis' patterns: how badly the pixels fit, and the frame of every pattern."""
    mine = [i for i, p in enumerate(patterns) if axis_of(p) == axis]
    count = lines[axis == "y"]
    search = _Search.of(stack, frames, [patterns[i] for i in mine], count)
    edges = strips.along_columns if (axis == "y") != turned else strips.along_rows
    shown = [int(np.count_nonzero(np.diff(brightness(patterns[i], np.arange(count)) > 0.5))) for i in mine]
    # from frames with few edges to those with many; `order[j]` is the frame (of this axis') that shows pattern j
    by_edges = np.argsort(edges[frames], kind="stable")
    order = np.empty(len(mine), np.intp)
    order[np.argsort(shown, kind="stable")] = by_edges
    # steps of one period have equally many edges, but for one at the end
    like = [
        (use_of(p), cycle_lines(p) if use_of(p) == "phase" else n)
        for p, n in zip([patterns[i] for i in mine], shown, strict=True)
    ]
    alike = [np.array([k for k, own in enumerate(like) if own == one]) for one in dict.fromkeys(like)]
    draw, ends = np.random.default_rng(1), []
    for start in range(STARTS):
        progress.check()
        ends += search.ends(order, alike)
        order = min(ends, key=lambda end: end[0])[1].copy()
        for group in alike if start % 2 == 0 else [np.arange(len(order))]:
            some = draw.permutation(group)[: max(2, len(group) // 2)]
            order[some] = order[draw.permutation(some)]
    # several orders can be words of the code: lines then run as in the camera, from left to right and down
    enough = 1.3 * min(misfit for misfit, _ in ends) + 0.01
    likely = [(search.runs(end, axis, turned), misfit, end) for misfit, end in ends if misfit <= enough]
    most = max(runs for runs, _, _ in likely)
    order = min(((misfit, end) for runs, misfit, end in likely if runs > most - ALIKE), key=lambda one: one[0])[1]
    phases = [group for group in alike if like[group[0]][0] == "phase"]
    over, others = _of_bits([patterns[i] for i in mine])
    for exchanges in 2 * [*over, *others]:
        other = search.with_bits(order, exchanges, phases)
        if search.misfit(other) <= enough and search.unsteady(other) < search.unsteady(order):
            order = other
    back = search.with_bits(order, [pair for each in over for pair in each], phases)  # as steady, the other way
    if search.misfit(back) <= enough and search.runs(back, axis, turned) > search.runs(order, axis, turned) + ALIKE:
        order = back
    misfit = search.misfit(order)
    return misfit, {i: frames[k] for i, k in zip(mine, order, strict=True)}


def _of_bits(patterns: Sequence[Pattern]) -> tuple[list[Exchanges], list[Exchanges]]:
    """Which frames to exchange to turn each bit of all numbers over, and for what else makes words of the words: from
    one bit of a Gray code on all are turned over, or two are exchanged.

    Bits can only be turned over by their inverse frames.
    """
    frames = {(p.bit, p.inverse): k for k, p in enumerate(patterns) if isinstance(p, Code)}
    each = {bit: [frames[key] for key in ((bit, False), (bit, True)) if key in frames] for bit, _ in sorted(frames)}
    both = {bit: (own[0], own[1]) for bit, own in each.items() if len(own) == 2}
    gray = any(isinstance(p, Code) and p.kind == "gray" for p in patterns)  # a bit of the number is in two of the code
    over = [[both[b] for b in (bit, bit + 1)[: 1 + gray] if b in both] for bit in both]
    exchanged = [[*zip(each[a], each[b], strict=False)] for a, b in combinations(each, 2)]
    return over, [*([pair] for pair in both.values() if gray), *exchanged]


@dataclass(frozen=True)
class _Search:
    """The values (frames, n) of some pixels, their places, and what patterns show (patterns, m) on lines (m,)."""

    values: Array
    possible: Array
    lines: Array
    at: NDArray[np.intp]

    @staticmethod
    def of(stack: Array, frames: list[int], patterns: list[Pattern], count: int) -> _Search:
        part = stack[frames]
        high, low = part.max(axis=0), part.min(axis=0)
        lit = high - low > 0.5 * quantile_of(high - low, 0.98)
        rows, columns = np.nonzero(lit)
        some = spaced(len(rows), PIXELS)
        some = distinct((some + 7919 * np.arange(len(some))) % len(rows))  # off the grid of any stripe
        at = np.stack([rows[some], columns[some]])
        seen = part[:, at[0], at[1]]
        bottom, top = seen.min(axis=0), seen.max(axis=0)
        values = ((seen - bottom) / np.maximum(top - bottom, 1e-6)).astype(np.float32)
        possible, at_lines = dictionary(patterns, count)
        per = possible.shape[1] // 6
        keep = np.concatenate([np.arange(b * per, (b + 1) * per, 2) for b in BLURS])
        possible = possible[:, keep]
        bottom, top = possible.min(axis=0), possible.max(axis=0)
        possible = (possible - bottom) / np.maximum(top - bottom, 0.1)
        # what pixels see from dark to bright, against what lines show, tells the response whatever the order
        seen, shown = (np.sort(each, axis=0).mean(axis=1) for each in (values, possible))
        if np.abs(seen - shown).max() > BENT:
            values = np.interp(values, seen + 1e-6 * np.arange(len(seen)), shown).astype(np.float32)
        return _Search(values, possible, at_lines[keep], at)

    def distances(self, order: NDArray[np.intp]) -> Array:
        """Squared distance (n, m) of every pixel from every line."""
        seen = self.values[order]
        power = np.sum(self.possible**2, axis=0)[None, :] + np.sum(seen**2, axis=0)[:, None]
        return np.asarray(power - 2 * (seen.T @ self.possible), np.float32)

    def misfit(self, order: NDArray[np.intp]) -> float:
        """How badly the pixels fit."""
        return _misfit(self.distances(order))

    def unsteady(self, order: NDArray[np.intp]) -> float:
        """How far the lines are off a smooth course over the image: their mean deviation from a quadratic surface."""
        found = self.lines[np.argmin(self.distances(order), axis=1)].astype(np.float64)
        v, u = self.at / self.at.max()
        A = polynomial(u, v, 2)
        return float(np.mean(np.abs(found - A @ np.linalg.lstsq(A, found, rcond=None)[0])))

    def improve(self, order: NDArray[np.intp], alike: list[NDArray[np.intp]]) -> tuple[float, NDArray[np.intp]]:
        """Exchange frames as long as it helps: two at a time, and the steps of a period among themselves."""
        order = order.copy()
        distance = self.distances(order)
        misfit = _misfit(distance)
        for _ in range(MOST_ROUNDS):
            before = misfit
            for i, j in combinations(range(len(order)), 2):
                seen = self.values[order[i]] - self.values[order[j]]
                # what exchanging two frames adds to the squares
                changed = distance + 2 * np.outer(seen, self.possible[i] - self.possible[j])
                if (new := _misfit(changed)) < misfit - 1e-4:
                    misfit, distance = new, changed
                    order[i], order[j] = order[j], order[i]
            for group in alike:
                for turn in self._turns(group):
                    tried = order.copy()
                    tried[group] = order[turn]
                    if (new := _misfit(self.distances(tried))) < misfit - 1e-4:
                        misfit, order = new, tried
                        distance = self.distances(order)
            if misfit > before - 1e-4:
                break
        return misfit, order

    def turned(self, order: NDArray[np.intp], group: NDArray[np.intp]) -> NDArray[np.intp]:
        """Put the steps of a period in the order among themselves that fits best."""
        ways = [order]
        for turn in self._turns(group):
            ways.append(order.copy())
            ways[-1][group] = order[turn]
        return min(ways, key=self.misfit)

    def with_bits(
        self, order: NDArray[np.intp], exchanges: Exchanges, phases: list[NDArray[np.intp]]
    ) -> NDArray[np.intp]:
        """Exchange frames of a code, and put the steps of its periods in the order that fits best then."""
        order = order.copy()
        for a, b in exchanges:
            order[[a, b]] = order[[b, a]]
        for group in phases:
            order = self.turned(order, group)
        return order

    def _turns(self, group: NDArray[np.intp]) -> list[NDArray[np.intp]]:
        if len(group) < 3:
            return []
        if len(group) <= 4:
            return [np.array(p) for p in permutations(group)]
        both = (group, group[::-1])
        return [np.roll(g, k) for g in both for k in range(len(group))]

    def ends(self, order: NDArray[np.intp], alike: list[NDArray[np.intp]]) -> list[tuple[float, NDArray[np.intp]]]:
        """Where the search ends that begins with an order, and where that ends which begins with its mirror image."""
        first = self.improve(order, alike)
        found = self.lines[np.argmin(self.distances(first[1]), axis=1)]
        mirrored = np.argmin(np.abs(self.lines[None, :] - (self.lines.max() - found)[:, None]), axis=1)
        cost = np.array([[np.mean((v - p[mirrored]) ** 2) for p in self.possible] for v in self.values])
        rows, columns = linear_sum_assignment(cost)
        other = np.empty_like(order)
        other[columns] = rows
        return [first, self.improve(other, alike)]

    def runs(self, order: NDArray[np.intp], axis: Axis, turned: bool) -> float:
        """How evenly the lines run along the image: 1 as in the camera, -1 against it."""
        found = self.lines[np.argmin(self.distances(order), axis=1)]
        along = self.at[int((axis == "x") != turned)]
        if np.ptp(along) == 0 or np.ptp(found) == 0:
            return 0.0
        ranks = [np.argsort(np.argsort(a, kind="stable"), kind="stable").astype(float) for a in (along, found)]
        even = float(np.corrcoef(ranks)[0, 1])
        return abs(even) if turned else even


def _misfit(distance: Array) -> float:
    """Mean of the nearest line's squared distance, of those pixels that can be explained at all."""
    least = np.sort(np.maximum(distance.min(axis=1), 0.0))
    return float(least[: max(1, int(SHARE * len(least)))].mean())


def order_in_words(files: Sequence[str], patterns: Sequence[Pattern], found: Sequence[int]) -> str:
    """Say how the frames lie against the sequence."""
    moved = [i for i, f in enumerate(found) if i != f]
    if not moved:
        return "the files' names already give the order of the sequence"
    first = moved[0]
    return (
        f"{len(moved)} of {len(found)} files were put in order; {files[found[first]]} shows {describe(patterns[first])}"
    )
