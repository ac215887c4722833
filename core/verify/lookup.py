"""What patterns look like on every projector line, and which line fits what a pixel saw."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from core.compiling import njit
from core.lazy import dataclass
from core.numerics import median_of, spaced
from core.patterns import Pattern, brightness

Array = NDArray[np.float32]
Numbers = NDArray[np.intp]

BLURS_LINES = (0.35, 0.6, 0.9, 1.3, 1.8, 2.6)  # from sharp to a period of 4 lines that is nearly gone
CONTRADICTION = 0.12  # squared distance, white = 1: on the virtual bench right frames leave below 0.05, a wrong bit 1
NEAR = 0.01  # of squared distance: lines that fit so much alike cannot be told apart
LEAST = 12  # pixels for a judgement of bright and dark
ENOUGH = 40  # pixels for a judgement of grey values
AGREEMENT = 0.9  # share of pixels at which a frame is bright or dark as the others say; wrong frames have 0.5
UNLIKE = 0.5  # difference from what the others say against the spread of that; a step of a quarter period has 1.4
_AT_ONCE = 50  # pixels looked up
_LEAVE_ONE = 1000  # pixels for the search of the wrong frame
_BANDS = 5  # of image rows: a torn frame is wrong in some of them only


@dataclass(frozen=True)
class Fit:
    """The frames of one axis: their numbers, normalised values (k, n) and the possible ones (k, m) for lines (m,).

    Shots of the same pattern share its `weight` (k,).
    """

    shots: tuple[int, ...]
    values: Array
    possible: Array
    lines: Array
    weight: Array


@dataclass(frozen=True)
class LeftOut:
    """For every frame: what the others say without it."""

    share: list[float]  # of pixels at which the others contradict each other
    wrong: list[bool]  # the frame is not what the others say
    judged: list[bool]  # whether the others say anything about it
    best: list[Numbers]


def dictionary(patterns: list[Pattern], count: int, blurs: tuple[float, ...] = BLURS_LINES) -> tuple[Array, Array]:
    """Give what patterns look like on every half line, sharp to blurred: (k, m), and those lines (m,)."""
    reach = int(np.ceil(3 * blurs[-1]))
    fine = np.arange(-reach * 4, (count + reach) * 4)  # quarters of a line
    inside = np.clip(fine // 4, 0, count - 1)
    stack = np.array([brightness(p, np.arange(count))[inside] for p in patterns], dtype=np.float32)
    keep = np.arange(reach * 4, (count + reach) * 4, 2)
    offsets = np.arange(-4 * reach, 4 * reach + 1)
    kernels = np.exp(-0.5 * (offsets[:, None] / (4 * np.array(blurs))) ** 2)
    kernels /= kernels.sum(axis=0)
    blurred = [(sliding_window_view(line, len(offsets))[: 2 * len(keep) : 2] @ kernels).T.ravel() for line in stack]
    at = (fine[keep] + 0.5) / 4 - 0.5
    return np.array(blurred, np.float32), np.tile(at, len(blurs)).astype(np.float32)


def nearest(values: Array, possible: Array) -> tuple[Array, NDArray[np.intp]]:
    """Find the possible column nearest to each column of values: squared distance (n,) and number (n,)."""
    terms = np.concatenate([-2 * possible, np.sum(possible**2, axis=0, keepdims=True)])
    own = np.concatenate([values, np.ones_like(values[:1])]).T
    cost, best = np.empty(len(own), own.dtype), np.empty(len(own), np.intp)
    distance = np.empty((_AT_ONCE, terms.shape[1]), np.result_type(own, terms))  # so many pixels stay in the cache
    for i in range(0, len(own), _AT_ONCE):
        part = np.matmul(own[i : i + _AT_ONCE], terms, out=distance[: len(own) - i])
        best[i : i + _AT_ONCE] = number = np.argmin(part, axis=1)
        cost[i : i + _AT_ONCE] = part[np.arange(len(number)), number]
    return cost + np.sum(values**2, axis=0), best


def nearest_within(values: Array, possible: Array, enough: float | Array) -> tuple[Array, NDArray[np.intp]]:
    """Do so in a `dictionary`; a column at or beside the best line of one blur will do, if it is within `enough`."""
    m = possible.shape[1] // len(BLURS_LINES)
    sparse = slice(m * (len(BLURS_LINES) // 2 - 1), m * (len(BLURS_LINES) // 2), 2)
    line = 2 * nearest(values, possible[:, sparse])[1]
    beside = np.clip(line[:, None] + np.arange(-2, 3), 0, m - 1)
    among = (beside[:, None] + m * np.arange(len(BLURS_LINES))[:, None]).reshape(len(line), -1)
    distance = np.zeros(among.shape, np.float32)
    for own, light in zip(values, possible, strict=True):
        distance += (light.take(among) - own[:, None]) ** 2
    at = np.arange(len(line)), np.argmin(distance, axis=1)
    cost, best = distance[at], among[at]
    if (far := cost > enough).any():
        cost[far], best[far] = nearest(values[:, far], possible)
    return cost, best


def some(count: int, frames: int) -> Numbers:
    """Choose pixels for leaving frames out: fewer where there are many frames."""
    return spaced(count, min(_LEAVE_ONE, max(200, 20_000 // frames)))


def as_blurred(fit: Fit, best: Numbers) -> Fit:
    """Keep those blurs that the image has."""
    m = fit.possible.shape[1] // len(BLURS_LINES)
    used = np.bincount(best // m, minlength=len(BLURS_LINES)) > 0.05 * len(best)
    keep = np.repeat(used, m)
    return Fit(fit.shots, fit.values, fit.possible[:, keep], fit.lines[keep], fit.weight)


def leave_one_out(fit: Fit, few: Numbers, limit: Array, tolerance: Array, rows: Numbers) -> LeftOut:
    """Look `few` pixels up again without frame j, for every j, and compare the frame with what the others say of it.

    For each, (n,): the squared distance above which the others contradict each other; noise, white = 1; image row.
    """
    result = LeftOut([], [], [], [])
    values, weight = fit.values[:, few], fit.weight[:, None]
    whole = np.sum(weight * fit.possible**2, axis=0)[None, :] - 2 * ((weight * values).T @ fit.possible)
    whole += np.sum(weight * values**2, axis=0)[:, None]
    near = np.float32(NEAR) + 4 * tolerance.astype(np.float32) ** 2
    bands = np.minimum(np.argsort(np.argsort(rows, kind="stable")) * _BANDS // len(few), _BANDS - 1)
    told: Array = np.empty((len(values), 4, len(few)), np.float32)
    best = np.empty(values.shape, np.intp)
    weigh_lines(whole, values, fit.possible, fit.weight, near, CONTRADICTION, told, best)
    for seen, possible, (bright, dark, low, high), own in zip(values, fit.possible, told, best, strict=True):
        least = np.minimum(bright, dark)
        # where the lines that make the frame bright fit clearly better than the dark ones, or the reverse
        clear = (np.abs(bright - dark) > CONTRADICTION) & (np.abs(seen - 0.5) > 0.15)
        agrees = (seen > 0.5) == (bright < dark)
        # where all lines that fit well enough agree about the frame
        sure = (high - low < 0.35 * np.ptp(possible)) & (least <= limit)
        expected: Array = (low + high) / 2
        parts = [np.ones(len(few), bool), *(bands == band for band in range(_BANDS))]
        judged, wrong = False, False
        for part in parts:
            known, denied = _denied(part & clear, agrees)
            alike, unlike = _unlike(seen, expected, tolerance, part & sure)
            judged, wrong = judged or known or alike, wrong or denied or unlike
        result.share.append(float(np.mean(least > limit)))
        result.wrong.append(wrong)
        result.judged.append(judged)
        result.best.append(own)
    return result


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"nnan", "nsz"})
def weigh_lines(
    whole: Array, values: Array, possible: Array, weight: Array, near: Array, far: float, told: Array, best: Numbers
) -> None:
    """Weigh lines (m,) for pixels (n,) by what all frames but one say, for each of k frames: `whole` (n, m) less it.

    told (k, 4, n): least distance of lines on which the frame is bright, and of those where it is dark; lowest and
    highest value on lines that are at most `near` (n,) above the least. best (k, n): the first line of the least. Lines
    that are further than `near` and `far` above the least whatever frame is left out are not looked at.
    """
    half, never = np.float32(0.5), np.float32(np.inf)
    among, light, distance = np.empty(whole.shape[1], np.intp), np.empty_like(whole[0]), np.empty_like(whole[0])
    brightest, darkest = np.empty_like(weight), np.empty_like(weight)
    for k in range(len(values)):
        brightest[k], darkest[k] = possible[k].max(), possible[k].min()
    for i in range(whole.shape[0]):
        limit, reach = never, np.float32(0.0)
        for j in range(whole.shape[1]):
            limit = min(limit, whole[i, j])
        for k in range(len(values)):
            high, low = brightest[k] - values[k, i], darkest[k] - values[k, i]
            reach = max(reach, weight[k] * max(high * high, low * low))
        limit += reach + max(near[i], np.float32(far))
        count = 0
        for j in range(whole.shape[1]):
            if whole[i, j] <= limit:
                among[count] = j
                count += 1
        for k in range(len(values)):
            bright, dark, low, high, first = never, never, never, -never, 0
            for c in range(count):
                light[c] = possible[k, among[c]]
                off = values[k, i] - light[c]
                distance[c] = whole[i, among[c]] - weight[k] * (off * off)
                if light[c] > half:
                    bright = min(bright, distance[c])
                else:
                    dark = min(dark, distance[c])
            least = min(bright, dark)
            for c in range(count - 1, -1, -1):
                if distance[c] <= least + near[i]:
                    low, high = min(low, light[c]), max(high, light[c])
                    if distance[c] <= least:
                        first = among[c]
            told[k, 0, i], told[k, 1, i], told[k, 2, i], told[k, 3, i] = bright, dark, low, high
            best[k, i] = first


def _denied(clear: NDArray[np.bool_], agrees: NDArray[np.bool_]) -> tuple[bool, bool]:
    """Whether enough pixels tell bright from dark, and too many of them deny the frame."""
    count = int(clear.sum())
    told = count >= max(LEAST, 0.03 * len(clear))
    return told, told and float(agrees[clear].mean()) < AGREEMENT


def _unlike(seen: Array, expected: Array, tolerance: Array, sure: NDArray[np.bool_]) -> tuple[bool, bool]:
    """Whether enough pixels should vary and the frame does not with them; by medians, as some words are wrong.

    An image may be sharper than any that is looked up: brighter where it should be bright, darker where dark.
    """
    if np.count_nonzero(sure) < ENOUGH:
        return False, False
    own, noise = expected[sure], median_of(tolerance[sure]) + 0.03
    spread = median_of(np.abs(own - median_of(own)))
    if spread < 2 * noise:
        return False, False
    off, side = seen[sure] - own, np.sign(own - 0.5)
    if float(np.mean((seen[sure] - 0.5) * side > -noise)) > AGREEMENT:
        off = np.where(off * side > 0, 0.0, off)
    return True, median_of(np.abs(off)) > UNLIKE * spread + noise
