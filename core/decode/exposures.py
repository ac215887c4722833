"""Several exposures in one capture: the frames of a pattern made one, of more depth than any of them.

Grey values above the camera's black level grow with the exposure. What is saturated in a long exposure is seen in a
shorter one, what is dark in that one in the longer: every sample counts by the square of its exposure, none that is
saturated counts.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from core.decode.chosen import take_sample
from core.decode.frames import Image, sort_frames
from core.decode.noise import TINY, Noise, contrasts, estimate_noise
from core.decode.options import DecodeOptions
from core.decode.sample import full_scale, measure_noise, smoothest
from core.decode.tables import Array, Singles
from core.errors import InputError
from core.numerics import quantum, sigma_by_median
from core.patterns import Axis, Pattern, axis_of, brightness, cycle_lines, level_of, use_of

DEEPEST = 65535
FINEST = 16  # steps that one grey value is divided into
ROUNDED = 1 / 12  # variance that whole steps add
SAME = 1e-6  # part by which equal exposures may differ
FEWEST, RANGE = 200, 8.0  # pixels that tell how exposures compare; standard deviation of their grey values
OTHER = 0.08  # part by which the light of an exposure differs that is told
DIFFERENT = 0.4  # the same of two frames of one exposure, as a logarithm: no lamp flickers that much
FEW = 3  # frames that are named one by one
FINE, HALF, LIT, MOST = 64, 0.1, 0.5, 0.8  # lines of which fine stripes light half, to this part; part of the usual
# swing that lit pixels have; part of these that must not be saturated
LONGER, ALIKE = 1.8, 1.1  # times that exposures differ by at least; those of the same stripes
FOLLOWED = 0.15, 0.2  # power of the exposure by which light grows, 1, or 0.2 by a camera's gamma; of unlike stripes
FLAT = 0.05  # least part of the steepness squared with which a step counts
OUTLIER, ROUNDS = 4.0, 3  # standard deviations


class Fused(NamedTuple):
    """One image of all exposures of every pattern.

    `images` are uint16, of `steps` to a grey value of the longest exposure, less than one where the others see beyond
    16 bits of them; where all samples are saturated 65535. An exposure's grey values are ``ground + gain light`` up to
    `full`, its gain 1 for the longest; `own` are the gains of every pattern's, `gains` those that most phase steps
    have, without these most patterns. `raw` is their noise, None where neither a pattern nor the fringes have several.
    """

    patterns: list[Pattern]
    images: list[Image]
    steps: float
    ground: float
    own: list[tuple[float, ...]]
    gains: tuple[float, ...]
    full: float
    raw: Noise | None
    notes: tuple[str, ...]

    @property
    def noise(self) -> Noise | None:
        """Noise of the images where no sample is saturated."""
        if self.raw is None:
            return None
        low, high = (self.steps * (self.ground + part * (self.full - self.ground)) for part in (0.0, 0.5))
        dark, bright = (self.variance(np.array([level]), self.gains)[0] for level in (low, high))
        slope = (bright - dark) / (high - low)
        floor = ROUNDED + self.steps**2 * self.raw.floor / sum(gain**2 for gain in self.gains)
        return Noise(float(dark - slope * low), float(slope), floor, upto=self.steps * self.full)

    def variance(self, level: NDArray[np.floating], gains: Sequence[float]) -> Array:
        """Give the variance at grey values of an image of such exposures: it jumps where longer ones are saturated."""
        assert self.raw is not None
        light = level / self.steps - self.ground
        total, weights = np.zeros(level.shape), np.full(level.shape, TINY)
        for gain in gains:
            seen = self.ground + light * gain
            weight = np.where(seen < self.full, gain**2, 0)
            weights += weight
            total += np.square(weight / gain) * self.raw.variance(seen)
        return np.asarray(ROUNDED + self.steps**2 * total / np.square(weights))

    def widen(self, sigma: Singles, axis: Axis) -> None:
        """Hold in sigmas (H, W) by `noise` what steps of other exposures show, or where longer ones are saturated.

        A step tells the phase by how steeply its light changes with it: the brightest and the darkest tell nothing.
        """
        mine = [n for n, p in enumerate(self.patterns) if axis_of(p) == axis and use_of(p) == "phase"]
        if self.noise is None or not mine:
            return
        at = np.max([self.images[n] for n in mine], axis=0) >= self.steps * self.full
        if any(self.own[n] != self.gains for n in mine):
            at[:] = True
        levels = np.stack([self.images[n][at].astype(np.float32) for n in mine])
        seen = levels < DEEPEST
        count = np.maximum(np.count_nonzero(seen, axis=0), 1)
        off = np.where(seen, levels - np.sum(levels, axis=0, where=seen) / count, 0)
        cosine = np.square(off) / np.maximum(2 * np.sum(np.square(off), axis=0) / count, 1)
        steep = np.where(seen, np.maximum(1 - cosine, FLAT), 0)
        usual = np.sum(steep * self.noise.variance(levels), axis=0)
        told = np.stack([self.variance(level, self.own[n]) for level, n in zip(levels, mine, strict=True)])
        sigma[at] *= np.sqrt(np.sum(steep * told, axis=0) / np.maximum(usual, TINY))


def fuse_exposures(
    patterns: Sequence[Pattern],
    images: Sequence[Image],
    exposures_ms: Sequence[float | None],
    options: DecodeOptions,
    where: str,
) -> Fused | None:
    """Make one image of all exposures of a pattern; None where there is but one exposure.

    How much light an exposure has is told by the patterns that were taken with several; `exposures_ms` by that of the
    others. InputError where some frames have no exposure, and others have.
    """
    known = [e for e in exposures_ms if e is not None]
    if not known or (max(known) - min(known) <= SAME * max(known) and len(known) == len(exposures_ms)):
        return None
    if len(known) < len(exposures_ms):
        missing = list(exposures_ms).index(None)
        raise InputError(f"{where}, frame {missing}", 'no "exposure_ms", which other frames have', "give it to all")
    sample = take_sample(images)
    full = full_scale(images, tuple(range(len(images))), sample, options)
    groups: dict[Pattern, list[int]] = defaultdict(list)
    for n, pattern in enumerate(patterns):
        groups[pattern].append(n)
    classes = np.array(sorted(set(known), reverse=True))
    classes = classes[np.append(True, classes[1:] < (1 - SAME) * classes[:-1])]
    own = [int(np.argmin(np.abs(classes - e))) for e in known]
    _check_alike(list(groups.values()), own, classes, sample, full, where)
    if all(len({own[n] for n in numbers}) == 1 for numbers in groups.values()):
        _check_followed(patterns, known, images, sample, full, where)
    light, ground, residual, level = _compare(list(groups.values()), own, classes, sample, full)
    raw = estimate_noise(residual, level, quantum(sample) if images[0].itemsize > 1 else 1.0) if len(level) else None
    raw = raw or _noise_of_one(patterns, own, images, full)
    gains = light / light.max()
    deepest = float(DEEPEST / (full / gains.min()))
    steps = min(FINEST, int(deepest)) or deepest
    fused: list[Image] = []
    for numbers in groups.values():
        total = np.zeros(images[0].shape, np.float32)
        weights = np.zeros_like(total)
        for n in numbers:
            gain = np.float32(gains[own[n]])
            weight = np.where(images[n] < full, gain, np.float32(0))
            total += weight * (images[n].astype(np.float32) - np.float32(ground))
            weights += weight * gain
        seen = np.divide(total, weights, out=np.full_like(total, np.inf), where=weights > 0) + np.float32(ground)
        fused.append(np.clip(np.rint(seen * steps), 0, DEEPEST).astype(np.uint16))
    _dim_white(list(groups), fused)
    telling = [numbers for pattern, numbers in groups.items() if use_of(pattern) == "phase"] or [*groups.values()]
    usual = Counter(tuple(sorted({own[n] for n in numbers})) for numbers in telling).most_common(1)[0][0]
    each = [tuple(gains[sorted({own[n] for n in numbers})].tolist()) for numbers in groups.values()]
    mine, told = tuple(gains[list(usual)].tolist()), tuple(_other(own, classes, light))
    return Fused(list(groups), fused, steps, ground, each, mine, full, raw, told)


def _noise_of_one(patterns: Sequence[Pattern], own: list[int], images: Sequence[Image], full: float) -> Noise | None:
    """Noise by the frames of the longest exposure, the brightest, where the fringes have several and no pattern has."""
    fringes = {own[n] for n, pattern in enumerate(patterns) if use_of(pattern) == "phase"}
    if len(fringes) < 2:
        return None
    mine = [n for n, exposure in enumerate(own) if exposure == min(fringes)]
    some, seen = [patterns[n] for n in mine], [images[n] for n in mine]
    frames = sort_frames(some)
    return measure_noise(frames, contrasts(frames, len(some)), take_sample(seen), full, seen)


def _dim_white(patterns: Sequence[Pattern], fused: list[Image]) -> None:
    """Make white where all its samples are saturated as bright as the brightest of the others, seen shorter."""
    for n in [n for n, pattern in enumerate(patterns) if level_of(pattern) == 1]:
        others = [image for image, pattern in zip(fused, patterns, strict=True) if level_of(pattern) is None]
        if others and (over := fused[n] == DEEPEST).any():
            seen = np.array([image[over] for image in others])
            seen[(seen == DEEPEST) & (seen < DEEPEST).any(axis=0)] = 0  # what is saturated does not tell
            fused[n][over] = seen.max(axis=0)


def _check_alike(
    groups: list[list[int]], own: list[int], classes: Array, sample: Singles, full: float, where: str
) -> None:
    """Refuse frames of one pattern and one exposure that have different light."""
    for numbers in groups:
        for n, other in combinations(numbers, 2):
            one, two = sample[n].astype(float), sample[other].astype(float)
            told = _line(one, two, full) if own[n] == own[other] else None
            if told is not None and abs(np.log(abs(told[0]))) > DIFFERENT:
                seen = f"frame {other} has {told[0]:.3g} times the light of frame {n}, of one pattern, both"
                raise InputError(where, f"{seen} of {classes[own[n]]:g} ms", 'correct "exposure_ms" or pattern of one')


def _check_followed(
    patterns: Sequence[Pattern],
    exposures_ms: Sequence[float],
    images: Sequence[Image],
    sample: Singles,
    full: float,
    where: str,
) -> None:
    """Refuse exposures that the frames of fine stripes do not follow, each half lit, by mean nor by contrast.

    An offset of the camera lets the mean grow less than the exposure, and other stripes change the contrast: only both
    together tell, and frames of the same stripes alone where these have several exposures.
    """
    kinds = [(axis_of(p), use_of(p), cycle_lines(p)) for p in patterns]
    parts = [brightness(p, np.arange(8 * FINE)).reshape(8, FINE).mean(axis=1) for p in patterns]
    fine = [n for n, part in enumerate(parts) if kinds[n][0] is not None and np.ptp([*part, 0.5]) < HALF]
    if len(fine) < FEW or full <= 0:
        return
    seen = sample[fine]
    swing = np.ptp(seen, axis=0)
    seen = seen[:, swing > LIT * np.quantile(swing, 0.95)].astype(float)
    whole = seen.max(axis=0) < full
    if np.count_nonzero(whole) < max(FEWEST, MOST * len(whole)):
        return
    seen = seen[:, whole]
    low, high = np.quantile(seen, (0.05, 0.95), axis=1)
    told = np.log([[exposures_ms[n] for n in fine], np.maximum(seen.mean(axis=1), TINY), high - low + TINY])
    apart = told - told.mean(axis=1, keepdims=True)
    within = told.copy()
    for kind in {kinds[n] for n in fine}:
        same = np.array([kinds[n] == kind for n in fine])
        within[:, same] -= within[:, same].mean(axis=1, keepdims=True)
    alike = np.ptp(within[0]) > np.log(ALIKE)
    apart, longer, followed = (within, ALIKE, FOLLOWED[0]) if alike else (apart, LONGER, FOLLOWED[1])
    if np.ptp(apart[0]) <= np.log(longer) or (apart[1:] @ apart[0]).max() >= followed * (apart[0] @ apart[0]):
        return
    if (high - low).min() < RANGE * sigma_by_median(smoothest(images, full)[0]):
        return  # what is seen of so little light is the camera's offset and its noise
    seen_ms = f"goes from {min(exposures_ms):g} to {max(exposures_ms):g} ms, but the frames' light does not follow it"
    raise InputError(f"{where}, exposure_ms", seen_ms, "correct it in capture.json, or leave it out of all frames")


def _compare(
    groups: list[list[int]], own: list[int], classes: Array, sample: Singles, full: float
) -> tuple[Array, float, Array, Array]:
    """Light of every exposure, the grey value that needs none, and residuals of unit norm with their levels."""
    light, grounds, found = np.asarray(classes / classes[0]), [], []
    shown = [{own[n]: n for n in numbers} for numbers in groups]
    first, *others = np.argsort([-own.count(c) for c in range(len(classes))], kind="stable").tolist()
    known = [first]
    for c in others:
        near = max(known, key=lambda k: (sum(k in each and c in each for each in shown), -abs(k - c)))
        pairs = [(each[near], each[c]) for each in shown if near in each and c in each]
        light[c] = light[near] * classes[c] / classes[near]
        known.append(c)
        if not pairs:
            continue
        one, other = (sample[list(some)].ravel().astype(float) for some in zip(*pairs, strict=True))
        told = _line(one, other, full)
        if told is not None:
            slope, start, *left = told
            light[c] = light[near] * slope
            grounds += [start / (1 - slope)] if abs(slope - 1) > OTHER else []  # equal light tells nothing
            found.append(left)
    ground = float(np.median(grounds)) if grounds else 0.0
    residual, level = (np.concatenate([each[k] for each in found]) if found else np.zeros(0) for k in (0, 1))
    return light, ground, residual, level


def _line(one: Array, other: Array, full: float) -> tuple[float, float, Array, Array] | None:
    """Slope and start of the line from grey values to others, residuals of unit norm, levels; None if unclear."""
    good = np.maximum(one, other) < full
    one, other = one[good], other[good]
    for _ in range(ROUNDS):
        if len(one) < FEWEST or max(one.std(), other.std()) < RANGE:
            return None
        (a, both), (_, b) = np.cov(one, other)
        slope = (b - a + np.hypot(b - a, 2 * both)) / (2 * both)  # noise in either
        start, square = other.mean() - slope * one.mean(), 1 + slope * slope
        apart = (other - start - slope * one) / np.sqrt(square)
        middle = (one + slope * (other - start)) / square  # of the noise of both
        most = OUTLIER * sigma_by_median(apart) + TINY
        whole = np.minimum(middle, start + slope * middle) > most / 2  # what is cut off at 0 shows half its noise
        level = (start + slope * middle + slope * slope * middle) / square
        left = apart[whole], level[whole]
        inner = whole & (np.abs(apart) < 2 * most)  # the brightest are noisier
        one, other = one[inner], other[inner]
    return float(slope), float(start), *left


def _other(own: list[int], classes: Array, light: Array) -> Iterator[str]:
    """Say which exposures have other light than their times, as a part of the most frequent one's."""
    usual = max(range(len(classes)), key=own.count)
    for c, ms in enumerate(classes):
        seen, told = light[c] / light[usual], ms / classes[usual]
        if abs(seen / told - 1) > OTHER:
            numbers = [str(n) for n, k in enumerate(own) if k == c]
            who = f"Frames of {ms:g} ms have" if len(numbers) > FEW else f"Frame {', '.join(numbers)} ({ms:g} ms) has"
            yield (
                f"{who} {seen:.3g} times the light of those of {classes[usual]:g} ms, by exposure_ms {told:.3g} times: "
                "a time is wrong, or the camera bends its grey values. The light is what was used."
            )
