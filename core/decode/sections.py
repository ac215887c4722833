"""Light sectioning: the centroid of the lit lines, pixel by pixel, over a sweep of line frames."""

from __future__ import annotations

import numpy as np

from core.decode.frames import AxisFrames
from core.decode.kernels.compiled import fast, load, part
from core.decode.noise import Noise
from core.decode.options import Flag
from core.decode.tables import TAIL as TAIL_PART
from core.decode.tables import AxisTable, Singles
from core.numerics import erf

LOW, SATURATED, NO_U = int(Flag.LOW_MODULATION), int(Flag.SATURATED), int(Flag.NO_U)
DISAGREEMENT, OUTSIDE = int(Flag.DISAGREEMENT), int(Flag.OUTSIDE)

F = np.float32
HALF, ONE, TWICE, TINY, TAIL = F(0.5), F(1), F(2), F(1e-20), F(TAIL_PART)
RIVAL = F(0.5)  # part of its height that light may reach far from the section
CHANCE = F(2)  # the brightest of some hundred frames is so many standard deviations higher by chance alone


BLURS = 0.1 * 1.1 ** np.arange(40)  # lines
USUAL = 0.5  # lines, blur where too few pixels tell it
FEWEST = 50  # pixels that tell it
ALIKE = 0.005  # parts of a section's light that lines share
CLEAR = 10.0  # standard deviations that their sections stand out


def measure_ripple(table: AxisTable, axis: AxisFrames | None, sample: Singles, noise: Noise) -> AxisTable:
    """Set what the discrete lines of a sweep do to the centroid, by the blur that its sections have in a sample.

    How few lines share a section's light, ``sum(w²) / sum(w)²``, tells the blur.
    """
    lines = axis.lines if axis else None
    if len(table.line_frames) == 0 or lines is None:
        return table
    grey = sample[table.line_frames]
    peak, dark = grey.max(axis=0), np.median(grey, axis=0)
    spread = np.sqrt(noise.variance(dark))
    clear = peak - dark > CLEAR * spread
    seen, cut = np.inf, TAIL_PART
    if clear.sum() >= FEWEST:
        height = (peak - dark)[clear]
        ground = np.maximum(TAIL_PART * height, 2 * spread[clear])
        cut = float(np.median(ground / height))
        near = np.abs(table.line_centre[:, None] - table.line_centre[grey[:, clear].argmax(axis=0)]) <= table.line_reach
        light = np.where(near, np.maximum(grey[:, clear] - dark[clear] - ground, 0), 0)
        seen = float(np.mean(np.square(light).sum(axis=0) / light.sum(axis=0) ** 2))
    shared, ripples = np.array([_sampled(lines.pitch, lines.width, blur, cut) for blur in BLURS]).T
    off = np.abs(shared - seen) if np.isfinite(seen) else np.abs(BLURS - USUAL)
    at = np.flatnonzero(off <= off.min() + ALIKE)[-1]  # of blurs that too wide gaps do not tell apart the greatest
    return table._replace(line_ripple=np.float32(ripples[at]))


def _sampled(pitch: float, width: int, blur: float, cut: float) -> tuple[float, float]:
    """How few lines share the light of a section above the part `cut` of the brightest; the centroid's r.m.s. error.

    Of the places that are lit: between lines wider apart than they are wide some see none.
    """
    u = (np.arange(32)[:, None] + 0.5) / 32 * pitch
    x = np.arange(-20, 22) * pitch
    light = erf((x + width / 2 - u) / (blur * np.sqrt(2))) - erf((x - width / 2 - u) / (blur * np.sqrt(2)))
    lit = light.max(axis=1) > cut * light.max()
    u, light = u[lit], light[lit]
    weight = np.maximum(light - cut * light.max(axis=1, keepdims=True), 0)
    total = weight.sum(axis=1)
    error = (weight * x).sum(axis=1) / total - u[:, 0]
    return float(np.mean(np.square(weight).sum(axis=1) / total**2)), float(np.sqrt(np.mean(np.square(error))))


def section_scratch(table: AxisTable) -> tuple[Singles, Singles]:
    """Make the scratch memory for decoding a sweep: as many pixels of all frames as stay in the cache."""
    frames = len(table.line_frames)
    tile = max(64, min(512, 65536 // frames // 16 * 16))
    return np.empty((frames, tile), F), np.empty((10, tile), F)


@fast
def decode_sections(  # type: ignore[no-untyped-def]
    start, stop, addresses, item_size, limits, table, scratch, axis, out
):
    """Decode an axis of a sweep (0 for u, 1 for v) for pixels start to stop - 1.

    Frames and `out` are as in `decode_pixels`: this axis' coordinates and sigmas are written, the modulation is lowered
    to this axis', the image raised to the brightest of its frames, and its flags are added. Scratch, of this thread
    alone: float32 (frames, tile) and (10, tile).

    ``u = sum(w x) / sum(w)`` over lines x near the brightest, with ``w = max(g - T, 0)`` and T at `TAIL` of the
    section's height above the background, but above its noise; ``var(u) = sum((x - u)² var(g)) / sum(w)²`` over the
    lines that count, besides what their discreteness causes. Where the first or last line of a sweep is lit though the
    projector has more, the section is cut off and the coordinate outside.
    """
    place, sigma, modulation, image, flags = out
    frames, centres, ripple = table.line_frames, table.line_centre, table.line_ripple
    grey, sums = scratch
    tile = grey.shape[1]
    for first in range(start, stop, tile):
        count = min(tile, stop - first)
        source = (addresses, item_size, first)
        load(frames, source, count, grey)
        peak, where, dark = sums[0], sums[1], sums[2]
        _find_peak(centres, grey, count, peak, where)
        rival, others = sums[3], sums[4]
        _background(centres, table.line_reach, grey, count, where, dark, rival, others)
        if len(table.black) > 0:
            load(table.black, source, count, sums[2:3])
        least = limits.snr + CHANCE
        total, moment, noise0, noise1, noise2 = sums[4], sums[5], sums[6], sums[7], sums[8]
        for i in range(count):
            ground = TWICE * np.sqrt(max(limits.dark + limits.shot * dark[i], limits.floor))
            sums[9, i] = dark[i] + max(TAIL * (peak[i] - dark[i]), ground)
        _moments(centres, table.line_reach, limits, grey, count, where, sums[9], total, moment, noise0, noise1, noise2)
        for i in range(count):
            height = peak[i] - dark[i]
            mean = moment[i] / (total[i] + TINY)
            u = where[i] + mean
            variance = noise2[i] - F(2) * mean * noise1[i] + mean * mean * noise0[i]
            noise = max(limits.dark + limits.shot * dark[i], limits.floor)
            weak = height < F(0) or height * height < least * least * noise
            flag = LOW if weak or HALF * height < limits.modulation else 0
            flag |= SATURATED if peak[i] >= limits.saturation else 0
            flag |= DISAGREEMENT if rival[i] - dark[i] > RIVAL * height else 0
            cut = _cut_off(table, grey, where, dark, sums[9], i)
            flag |= OUTSIDE if flag == 0 and (cut or u < -HALF or u > table.lines - HALF) else 0
            place[axis, first + i] = u if flag == 0 else F(np.nan)
            variance = max(variance, F(0)) / (total[i] * total[i] + TINY) + ripple * ripple
            sigma[axis, first + i] = np.sqrt(variance) if flag == 0 else F(np.nan)
            modulation[first + i] = min(modulation[first + i], HALF * height)
            image[first + i] = max(image[first + i], peak[i])
            flags[first + i] |= flag | (NO_U << axis) if flag != 0 else 0


@part
def _find_peak(centres, grey, count, peak, where):  # type: ignore[no-untyped-def]
    """Grey value and line of the brightest frame."""
    peak[:count] = F(-1)
    where[:count] = F(0)
    for n in range(len(centres)):
        row, centre = grey[n], centres[n]
        for i in range(count):
            brighter = row[i] > peak[i]
            peak[i] = row[i] if brighter else peak[i]
            where[i] = centre if brighter else where[i]


@part
def _background(centres, reach, grey, count, where, dark, rival, others):  # type: ignore[no-untyped-def]
    """Mean and maximum of the frames far from the brightest; of all but zero frames where none is far."""
    dark[:count] = F(0)
    rival[:count] = F(0)
    others[:count] = F(0)
    for n in range(len(centres)):
        row, centre = grey[n], centres[n]
        for i in range(count):
            far = abs(centre - where[i]) > reach
            dark[i] += row[i] if far else F(0)
            others[i] += ONE if far else F(0)
            rival[i] = max(rival[i], row[i]) if far else rival[i]
    for i in range(count):
        dark[i] = dark[i] / others[i] if others[i] > F(0) else F(0)


@part
def _cut_off(table, grey, where, dark, floor, i):  # type: ignore[no-untyped-def]
    """Whether light may come from lines that the sweep left out: its end, with more lines beyond, clearly has some."""
    centres, last = table.line_centre, len(table.line_centre) - 1
    clear = TWICE * floor[i] - dark[i]
    first = table.line_open[0] and where[i] - centres[0] <= table.line_reach and grey[0, i] > clear
    return first or (table.line_open[1] and centres[last] - where[i] <= table.line_reach and grey[last, i] > clear)


@part
def _moments(centres, reach, limits, grey, count, where, floor, total, moment, noise0, noise1, noise2):  # type: ignore[no-untyped-def]
    """Sums of weights and of weights times distance, and of the noise times distance to the power of 0, 1, 2."""
    for sums in (total, moment, noise0, noise1, noise2):
        sums[:count] = F(0)
    for n in range(len(centres)):
        row, centre = grey[n], centres[n]
        for i in range(count):
            x = centre - where[i]
            w = row[i] - floor[i]
            counts = w > F(0) and abs(x) <= reach
            w = w if counts else F(0)
            noise = max(limits.dark + limits.shot * row[i], limits.floor) if counts else F(0)
            total[i] += w
            moment[i] += w * x
            noise0[i] += noise
            noise1[i] += noise * x
            noise2[i] += noise * x * x
