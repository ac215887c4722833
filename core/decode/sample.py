"""What a sample of the pixels tells before all are decoded: noise, full scale, the contrast of every bit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from core.decode.chosen import BRIGHT, SAMPLE, in_steady_light, of_all_rows, places_of, spread, take_sample
from core.decode.frames import Image, LineFrames, Numbers, SortedFrames
from core.decode.kernels.words import BLURRED
from core.decode.noise import (
    LEAST,
    MEDIAN_OF_SQUARE,
    Noise,
    Told,
    estimate_noise,
    robust_variance,
    spatial_residual,
    without_harmonics,
)
from core.decode.options import DecodeOptions
from core.decode.tables import Array, AxisTable, Limits, Singles, image_row, lifted, sums_of
from core.decode.waves.response import Wave
from core.errors import InputError
from core.numerics import cut_off, quantile_of, quantum
from core.parallel import run_in_bands

RESIDUALS, FEWEST = 32768, 512  # residuals that are enough, but from no fewer pixels
BENT = 4096, 2048  # the same where waves are bent, of which every pixel takes longer
UNSATURATED = 100  # pixels without a saturated step, fewer do not tell the noise
WHOLE = 1, 0.25  # steps of the grey values, part of a frame that must lie in one and not be saturated to tell it
BY_LEVEL = 8, 0.01  # the same where bright places tell noise that dark ones do not
FEW_ROWS = 8192  # pixels in rows of the image that tell the noise of bent waves
LIT = 0.1  # part of the brightest pixels' amplitude that one must have to tell it
CLEAR = 1.0  # standard deviations above 0 from which no more than a sixth of the noise is cut off
DIM = 0.5  # part of the brightest pixels' range of grey values, less of which is no light
ALIKE = 0.15  # correlation of neighbours in what should be noise, beyond which some of it is misfit; also
# part of its squares that harmonics explain: sigma is 8 % too large by as much
ALONG = 35 / 18  # of second differences along a row, that tell as much as one residual alone
CHANCE = 3.0  # standard deviations of noise of bent waves beyond which there is misfit
OWN = 0.7  # part of the contrast of white and black that that of bits and their inverses should have
SEVERAL = 0.03  # part of the lit pixels in which it is less, from which the bits themselves tell the contrast
USUAL = 0.6  # part of the usual contrast that a code alone must have
RESOLVED = 0.15  # part of the whole contrast that a fine bit must have in the mean for its sign to tell anything
BY_NOISE = 1.1  # of its standard deviation: noise alone shows 0.8 in the mean
LEAST_CONTRAST = np.float32(1e-6)  # that divides
CONFLICT = 0.25  # part of the range of grey values by which frames of one pattern may differ, in the median


def check_duplicates(frames: SortedFrames, sample: Singles, where: str) -> None:
    """Refuse frames of equal pattern that show different things, by name and by how much they differ."""
    if not frames.duplicates:
        return
    low, high = (quantile_of(sample, share) for share in (0.01, 0.99))
    for first, *others in frames.duplicates:
        for other in others:
            difference = float(np.mean(np.abs(sample[first] - sample[other])))
            if difference > CONFLICT * float(high - low) / 2 and difference > 2:
                seen = f"frames {first} and {other} have the same pattern but differ by {difference:.0f} grey values"
                raise InputError(where, seen, "correct the pattern of one of them")


def full_scale(images: Sequence[Image], numbers: Numbers, sample: Singles, options: DecodeOptions) -> float:
    """Grey value from which a pixel is saturated."""
    if options.saturation is not None:
        return options.saturation
    top = int(np.iinfo(images[0].dtype).max)
    if not numbers:
        return float(top)
    seen = sample[list(numbers)]
    if (highest := float(seen.max())) < top and cut_off(seen):
        return highest
    if top == 255:
        return float(top)
    step = int(quantum(sample))
    tops: list[int] = []
    run_in_bands(lambda a, b: tops.extend(int(images[n][a:b].max()) for n in numbers), len(images[0]), 128)
    levels = max(tops) // step + 1
    sensor = levels >= 256 and levels & (levels - 1) == 0
    return float(max(tops) if sensor else top - top % step)


def measure_noise(
    frames: SortedFrames,
    found: Array,
    sample: Singles,
    saturation: float,
    images: Sequence[Image],
    bent: Sequence[Wave] = (),
    light: Array | None = None,
) -> Noise:
    """Noise model from the redundancy of the frames, their `contrasts`; without any, from the scene's smoothness.

    What the harmonics of `bent` waves explain of that is none: of sine waves by a response, of square ones by
    `bent_squares`. `light` led to `sample`, see `flicker.steady`.
    """
    step = quantum(sample) if images[0].itemsize > 1 else 1.0
    lines = [axis.lines for axis in frames.axes.values() if axis.lines is not None]
    if len(found):
        used = np.abs(found).max(axis=0) > 0
        numbers = np.arange(len(used)) if bent else np.flatnonzero(used)
        number = SAMPLE if bent else max(SAMPLE, RESIDUALS // len(found))
        shown, mixed = [images[n] for n in numbers.tolist()], None if light is None else light[np.ix_(numbers, numbers)]
        sample = sample[numbers] if number == SAMPLE else in_steady_light(take_sample(shown, number), mixed)
        sample, rows = of_all_rows(sample, found[:, numbers], shown, mixed, number)
        enough, fewest = BENT if bent else (RESIDUALS, FEWEST)
        every = max(1, min(len(found) * sample.shape[1] // enough, sample.shape[1] // fewest))
        telling, places = _with_more_bright(sample, rows, every, shown, mixed, number, bool(bent))
        g = telling[used[numbers]]
        g_top, swing = g.max(axis=0), np.ptp(g, axis=0)
        g = np.compress(g_top < saturation, g, axis=1)  # an index would leave it in a slower order
        lit = swing > DIM * quantile_of(swing, 0.9)
        if np.count_nonzero(lit & (g_top < saturation)) < UNSATURATED < np.count_nonzero(lit & (g_top >= saturation)):
            return estimate_noise(*smoothest(images, saturation, *BY_LEVEL), step)
        lowest = float(telling.min())
        # not by matrix product: for so little work its threads would only wait, and slow down the kernel's
        residual, unlit = np.einsum("kf,fn->kn", found[:, used].astype(np.float32), g), 0.0
        level = np.einsum("kf,fn->kn", np.square(found[:, used]).astype(np.float32), g)
        if bent:
            good = g_top < saturation
            whole, places = np.compress(good, telling, axis=1), np.compress(good, places, axis=1)
            waves = [told(wave, whole) for wave in bent]
            lit = _lit(waves)
            left = without_harmonics(residual, found, whole, waves, places, of=lit)
            residual, level = (each[:, lit] for each in left)
        elif np.count_nonzero(whole := g.min(axis=0) > 0) >= FEWEST:  # what is cut off at 0 shows half its noise
            dim = ~whole & (np.ptp(g, axis=0) < DIM * quantile_of(np.ptp(g, axis=0), 0.9))
            unlit = robust_variance(residual[:, dim].ravel())
            # near 0, pixels of which no value is cut off are quiet by chance; the noise itself must not choose
            darkest = (g - np.einsum("kf,kn->fn", found[:, used].astype(np.float32), residual)).min(axis=0)
            usual = robust_variance(np.compress(whole, residual, axis=1)[:, :: 1 + whole.size // SAMPLE].ravel()) ** 0.5
            clear = whole & (darkest > CLEAR * usual)
            whole = clear if np.count_nonzero(clear) >= FEWEST else whole
            residual, level = (np.compress(whole, each, axis=1) for each in (residual, level))
        if bent or np.sum(residual[:, 1:] * residual[:, :-1]) > ALIKE * np.sum(np.square(residual)):
            crude = estimate_noise(residual.ravel(), level.ravel(), step, lowest)._replace(unlit=unlit)
            return _without_misfit(crude, (residual, level), found, images, saturation, bent, step)
        return estimate_noise(residual.ravel(), level.ravel(), step, lowest)._replace(unlit=unlit)
    if lines:
        return _sweep_noise(lines[0], sample, saturation, images)
    residual, level = _smoothness(frames, images, saturation, bent)
    return estimate_noise(residual.ravel(), level.ravel(), step)


def bent_squares(waves: Sequence[Wave], found: Array, sample: Singles, saturation: float) -> tuple[Wave, ...]:
    """Square waves, if their second harmonic explains much of what should be noise: a camera's gamma makes it."""
    if not waves or not len(found):
        return ()
    g = sample[:, :: max(1, sample.shape[1] // FEWEST)]
    g = np.compress((g.max(axis=0) < saturation) & (g.min(axis=0) > 0), g, axis=1)
    residual, explained = np.einsum("kf,fn->kn", found.astype(np.float32), g), 0.0
    for wave in waves:
        seen = wave.seen(g)
        twice = np.square(seen) / np.maximum(np.abs(seen), 1e-6)
        both = np.square(np.abs(np.einsum("kn,n->k", residual, twice)))  # cosine and sine part
        explained += 2 * float(both.sum() / max(np.sum(np.square(np.abs(twice))), 1e-6))
    return tuple(waves) if explained > ALIKE * float(np.sum(np.square(residual))) else ()


def told(wave: Wave, shown: Singles) -> Told:
    """A wave as the grey values (frames, ...) of all frames show it."""
    numbers = wave.frames.frames
    seen = np.tensordot(wave.both.astype(np.complex64), shown[list(numbers)], 1)
    return Told(numbers, wave.both, np.asarray(seen, np.complex64))


def _lit(waves: Sequence[Told]) -> NDArray[np.bool_]:
    """Where all waves are seen: what is not lit is often cut off at 0, and shows no noise."""
    amplitude = np.abs(np.array([wave.seen for wave in waves]))
    lit = amplitude.min(axis=0) > LIT * quantile_of(amplitude, 0.9)
    return lit if lit.sum() >= LEAST else np.ones_like(lit)


def _unlit(waves: Sequence[Told], lit: NDArray[np.bool_], shown: Singles) -> NDArray[np.bool_]:
    """Of the pixels without stripes, those that no frame lights: frames out of order leave others without them, too."""
    usual = min(quantile_of(np.abs(wave.seen), 0.9) for wave in waves)
    return np.asarray(~lit & (np.ptp(shown, axis=0) < usual))


def _with_more_bright(
    sample: Singles,
    rows: NDArray[np.intp],
    every: int,
    images: Sequence[Image],
    light: Array | None,
    number: int,
    placed: bool,
) -> tuple[Singles, Array]:
    """Every so many pixels of a sample, which is of such rows, and if wanted their places; where few are bright, which
    show shot noise, with neighbours."""
    size = images[0].shape
    parts = spread(size, number)
    columns = np.arange(size[1])[parts[1]]
    places = places_of(size, rows[:, None], columns).reshape(5, -1) if placed else np.zeros((5, 0))
    level = sample.mean(axis=0)
    low, high = (quantile_of(level, share) for share in (0.005, 0.995))
    limit = low + BRIGHT * (high - low)
    bright = np.flatnonzero(level > limit)
    if len(bright) > FEWEST * number // SAMPLE:
        return sample[:, ::every], places[:, ::every]
    around: list[NDArray[np.intp]] = []
    for index, each, part in zip(np.divmod(bright, len(columns)), (rows, columns), parts, strict=True):
        reach = min(1, (part.step - 1) // 2)  # none twice
        around.append(np.clip(each[index][:, None] + np.arange(-reach, reach + 1), 0, size[len(around)] - 1))
    down, across = (each.ravel() for each in np.broadcast_arrays(around[0][:, :, None], around[1][:, None, :]))
    more = in_steady_light(np.stack([image[down, across].astype(np.float32) for image in images]), light)
    good = more.mean(axis=0) > limit
    sample = np.concatenate([sample[:, ::every], np.compress(good, more, axis=1)], axis=1)
    near = places_of(size, down[good], across[good]) if placed else places
    return sample, np.concatenate([places[:, ::every], near], axis=1)


def _without_misfit(
    whole: Noise,
    alone: tuple[Array, Array],
    found: Array,
    images: Sequence[Image],
    saturation: float,
    bent: Sequence[Wave],
    step: float,
) -> Noise:
    """Noise from the second differences of the contrasts along some rows; what residuals of pixels `alone`, which with
    their levels made `whole`, show besides is misfit. Of bent waves both tell the noise where that is none."""
    height, width = images[0].shape
    count = min(32, max(4, FEW_ROWS // width)) if bent else 32
    rows = slice(height // (2 * count), None, max(1, height // count))
    used = np.flatnonzero(np.abs(found).max(axis=0) > 0) if not bent else np.arange(len(images))
    g = np.stack([images[int(n)][rows] for n in used]).astype(np.float32)
    factors = found[:, used].astype(np.float32)
    below = g[np.abs(factors).max(axis=0) > 0].max(axis=0) < saturation
    good = below[:, 1:-1] & below[:, :-2] & below[:, 2:]
    if not good.any():  # too narrow an image, or nothing in it below saturation
        return whole
    residual, waves = spatial_residual(np.einsum("kf,frw->krw", factors, g))[0], [told(wave, g) for wave in bent]
    if bent:
        lit = _lit(waves)
        dark = good & _unlit(waves, lit, g)[:, 1:-1]
        whole = whole._replace(unlit=robust_variance(residual[:, dark].ravel()))
        good &= lit[:, 1:-1]
        if not good.any():
            return whole
        places = places_of((height, width), np.arange(height)[rows, None], np.arange(width))
        residual, level = without_harmonics(residual, factors, g, waves, places, spatial_residual, good)
        light = np.mean(np.square(np.abs(np.array([wave.seen for wave in waves]))), axis=0)
    else:
        light = np.square(np.ptp(g, axis=0)) / 4
        level = np.einsum("kf,frw->krw", np.square(factors), g)[..., 1:-1]
    noise = estimate_noise(residual[:, good].ravel(), level[:, good].ravel(), step, float(g.min()))
    if bent and noise.shot == 0 < whole.shot:  # they show no slope, but pixels alone do: its shape stands
        part = noise.dark / float(whole.variance(level[:, good]).mean())
        noise = noise._replace(dark=part * whole.dark, shot=part * whole.shot)
    weight = np.where(
        good, np.square(light[:, 1:-1]), 0
    )  # misfit grows with the light; where there is little, edges make more
    if not weight.any():  # frames without any light
        return whole
    own = np.average(noise.variance(level).mean(axis=0), weights=weight)
    beyond = float(np.average(whole.variance(level).mean(axis=0), weights=weight) - own)
    near = residual[:, good], level[:, good]
    if bent and beyond <= CHANCE * own * np.sqrt(2 / alone[0].size + 2 * ALONG / near[0].size):
        residual, level = (np.concatenate([a.ravel(), b.ravel()]) for a, b in zip(alone, near, strict=True))
        return estimate_noise(residual, level, step, float(g.min()))._replace(unlit=whole.unlit)
    if beyond <= 0:
        return whole
    misfit = beyond / max(float(np.average(light[:, 1:-1], weights=weight)), 1.0)
    return noise._replace(misfit=misfit, unlit=whole.unlit)


def _sweep_noise(lines: LineFrames, sample: Singles, saturation: float, images: Sequence[Image]) -> Noise:
    """Dark part from the frames that leave a pixel unlit, shot part from the smoothness of the light summed over lines.

    Nearly all sections leave a pixel unlit: the lower half of its values tells the noise of its background.
    """
    frames, half = [*lines.frames], len(lines.frames) // 2
    lower = np.sort(sample[frames], axis=0)[: half + 1]
    dark = estimate_noise((lower[:half] - lower[half]).ravel(), np.zeros(half * lower.shape[1]), quantum(sample))
    ground = max(dark.dark, dark.floor)
    height = images[0].shape[0]
    rows = slice(height // 32, None, max(1, height // 16))
    g = np.stack([images[n][rows] for n in frames]).astype(np.float32)
    centre = np.array(lines.centre, np.float32)
    near = np.abs(centre[:, None, None] - centre[g.argmax(axis=0)]) <= lines.width + 2
    total, number = np.where(near, g, 0).sum(axis=0), near.sum(axis=0)
    lit = (g.max(axis=0) < saturation) & (g.max(axis=0) > lower[half].mean() + 10 * np.sqrt(ground))
    if lit[:, 1:-1].sum() < LEAST:
        return dark
    variance = np.median(np.square(spatial_residual(total)[0][lit[:, 1:-1]])) / MEDIAN_OF_SQUARE
    shot = (variance - ground * number[lit].mean()) / total[lit].mean()
    return Noise(dark.dark, max(0.0, float(shot)), dark.floor)


def _smoothness(
    frames: SortedFrames, images: Sequence[Image], saturation: float, bent: Sequence[Wave] = ()
) -> tuple[Array, Array]:
    """Second differences along some rows of the evenly lit image, else of the smoothest frame, and their levels."""
    height = images[0].shape[0]
    rows = slice(height // 64, None, max(1, height // 32))
    even = image_row(frames)
    if even:
        norm = np.sqrt(sum(value**2 for value in even.values()))
        scale = sum(even.values())
        scene = np.sum([value * images[n][rows].astype(np.float32) for n, value in even.items()], axis=0)
        residual, level = spatial_residual(scene)
        residual, level = residual / norm, level / scale
        good = level < saturation
        if bent:
            shown = np.stack([image[rows] for image in images]).astype(np.float32)
            factors = np.zeros((1, len(images)))
            factors[0, list(even)] = np.array(list(even.values())) / norm
            waves = [told(wave, shown) for wave in bent]
            places = places_of(images[0].shape, np.arange(height)[rows, None], np.arange(shown.shape[2]))
            left = without_harmonics(residual[None], factors, shown, waves, places, spatial_residual)
            residual, level = (each[0] for each in left)
        return residual[good], level[good]
    return smoothest(images, saturation)


def smoothest(
    images: Sequence[Image], saturation: float, steps: int = WHOLE[0], least: float = WHOLE[1]
) -> tuple[Array, Array]:
    """Second differences along some rows, and their levels: in every step of levels of the frame smoothest there."""
    height = images[0].shape[0]
    best, found = np.full(steps, np.inf), [(np.zeros(0), np.zeros(0))] * steps
    for image in images:
        grey = image[height // 64 :: max(1, height // 32)].astype(np.float32)
        good = np.maximum(np.maximum(grey[:, 2:], grey[:, :-2]), grey[:, 1:-1]) < saturation
        residual, level = (each[good] for each in spatial_residual(grey))
        part = (level * (steps / saturation)).astype(int)
        for n in np.flatnonzero(np.bincount(part, minlength=steps) > least * good.size):
            median = float(np.median(np.abs(residual[part == n])))
            if median < best[n]:
                best[n], found[n] = median, (residual[part == n], level[part == n])
    return np.concatenate([each for each, _ in found]), np.concatenate([each for _, each in found])


def limits_of(noise: Noise, saturation: float, options: DecodeOptions, tables: Sequence[AxisTable] = ()) -> Limits:
    """Pack the thresholds for the kernel; no amplitude counts that the noise of unlit pixels may show."""
    cofactor = max((float(table.covariance[:, [0, 2]].max(initial=0)) for table in tables), default=0.0)
    dimmest = max(options.min_modulation, options.min_snr * float(np.sqrt(cofactor * noise.unlit)))
    values = (*noise[:3], options.min_snr, dimmest, saturation, options.bit_margin, noise.misfit)
    return Limits(*(np.float32(value) for value in values))


def measure_fading(table: AxisTable, sample: Singles, noise: Noise) -> AxisTable:
    """Set the contrast of every bit relative to the whole: fine bits fade where the projection is out of focus."""
    bits = len(table.sign)
    if bits == 0:
        return table
    sample = sample[:, ::4]
    threshold, contrast, *bit_sums = sums_of(table.rows, sample)
    threshold, contrast = lifted(table, sample, threshold, contrast)
    raw = np.stack(bit_sums)
    if not table.has_threshold:
        shown = -np.where(table.sign == 0, -1, table.sign)[:, None] * raw
        threshold = (shown.max(axis=0) + shown.min(axis=0)) / 2
    raw = np.abs(raw + table.sign[:, None] * threshold)
    if not table.has_contrast:
        contrast = raw.max(axis=0)
    lit = contrast > 5 * np.sqrt(noise.variance(threshold))
    if lit.sum() < 100:
        return table
    if table.has_contrast and not table.sign.any():
        own = raw.max(axis=0)
        if np.mean(own[lit] < OWN * contrast[lit]) > SEVERAL:  # scattered light: white is brighter than lit lines
            table, contrast = table._replace(has_contrast=False), own
    # a triangle wave's mean is half its peak: only bits below that have faded
    share = np.einsum("rn,n->r", raw, lit / np.maximum(contrast, LEAST_CONTRAST)) / lit.sum()
    alone = not table.has_contrast and len(table.period) == 0
    usual = np.median(contrast[lit] / np.maximum(threshold[lit], 1)) if alone else 0
    fading = np.minimum(np.maximum(1.5 * share, 0.2), 1.0).astype(np.float32)
    if len(table.period) == 0:  # nothing but the bits tells the place
        grain = np.sqrt(noise.variance(threshold)) / np.maximum(contrast, LEAST_CONTRAST)
        by_noise = BY_NOISE * np.sqrt(table.spread) * np.median(grain[lit])
        fading[len(share) - int(np.argmax((share > np.maximum(RESOLVED, by_noise))[::-1])) :] = BLURRED
    return table._replace(fading=fading, least_contrast=np.float32(USUAL * usual))
