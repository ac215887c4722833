"""Frames that were recorded before, by whatever program: do they show what capture.json claims?

Told from the images and from what was decoded of them. Recorded captures were checked frame by frame when they were
taken (`identity`); here a capture is judged as a whole, with limits that no sound one of any rig reaches, and where it
contradicts itself the descriptions that people get wrong are tried until one fits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from core.algebra import on_own_threads
from core.model import Capture, PhaseMap, Plan, Subject
from core.model.finding import Finding
from core.numerics import median_of, quantile_of, quantiles_in, spaced
from core.patterns import Axis, Code, Line, Pattern, Phase, axis_of, level_of
from core.verify.beside import beside_code
from core.verify.between import halves
from core.verify.bits import wrong_bits
from core.verify.contradictions import PIXELS, Looked
from core.verify.exchanged import coded_axes, exchanged_frames
from core.verify.misfit import HELD_BY_ALL, misfitting_steps
from core.verify.mistakes import BEYOND, degrees, explanation, left_unexplained, more_lines, told_otherwise, too_fine
from core.verify.overlapping import overlapping
from core.verify.pixels import (
    GRID,
    LEAST_LIT,
    blank,
    bytes_exchanged,
    combed,
    compressed,
    edited,
    enlarged,
    mosaic,
)
from core.verify.quality import BRIGHT, Sampled, noise_of_one, summarise
from core.verify.steps import doubled_steps, exchanged_steps, odd_steps
from core.verify.surface import hand, planes
from core.verify.unchanging import unchanging

Array = NDArray[np.float32]

# of the pixels that contradict themselves; sound captures have below 0.05, twice that where only what is dim beside
# saturated light can be looked at
SHARE = 0.12
FEW = 200  # pixels that nearly always show it: half of that where it is 0.15 comes once in 15,000 captures
DARK = 0.01  # of the image that must be lit
SATURATED = 0.05  # of the lit pixels
SATURATED_DOTS = 0.25  # of the bright pixels, on a board
SPARSE = 0.7  # of the grey values that a black frame takes which reaches over all: noise alone, spread, takes fewer
LONGER, DARKER = 1.2, 0.9  # exposures that differ, and light that contradicts them


@on_own_threads()
def check_stored(
    capture: Capture, images: Sequence[NDArray], phase: PhaseMap | None, lines: tuple[int, int]
) -> list[Finding]:
    """Check a capture whose frames were recorded before; give what is not good, with the frames' numbers.

    `images`, (H, W), are in its order, `phase` is what was decoded of them, `lines` the projector's columns and rows.
    """
    if len({(f.camera, f.projector) for f in capture.frames}) > 1:
        return []  # frames of several devices are no one sequence
    patterns = [frame.pattern for frame in capture.frames]
    if told := [*bytes_exchanged(images), *blank(patterns, images), *enlarged(images), *combed(images)]:
        return told
    exposures = sorted({f.exposure_ms for f in capture.frames if f.exposure_ms is not None})
    if len(exposures) > 1:
        found = _mislabelled(capture, images)
        for ms in exposures if not found else ():  # what one saturates another sees
            own = [k for k, frame in enumerate(capture.frames) if frame.exposure_ms == ms]
            plan, sampled = _looked_at(capture, images, own)
            told = [*_plain(plan, sampled), *_contradictions(plan, sampled, lines)]
            found += [
                replace(f, text=f"of the frames of {ms:g} ms: {f.text}", shots=tuple(own[k] for k in f.shots))
                for f in told
            ]
    else:
        plan, sampled = _looked_at(capture, images, range(len(images)))
        named = _stretched(_plain(plan, sampled), images, sampled.full)
        found = [*_light(patterns, sampled, capture.role in ("testfield", "depth")), *named]
        checks = {f.check for f in found}
        if "light" not in checks:
            most = SHARE * (1 + ("saturation" in checks))
            found += edited(doubled_steps(plan, images, sampled) or _contradictions(plan, sampled, lines, most), images)
        found += halves(plan, images)
    bad = {f.check for f in found if f.level == "bad"} - {"movement"}
    if phase is not None and bad <= {"lines"}:
        maps: list[tuple[Axis, NDArray, str]] = [("x", phase.u, "columns"), ("y", phase.v, "rows")]
        coded = coded_axes(patterns, maps)
        jumping, mirrored = exchanged_frames(coded), hand(phase)
        doubtful = mirrored or bad or phase.notes or any(axis.odd for axis in coded)
        if doubtful and len(exposures) <= 1 and (wrong := wrong_bits(patterns, images)):
            jumping, mirrored = wrong, []
        if jumping:
            found = [f for f in found if f.check != "lines"]  # bits in wrong places name lines that are not there
        if jumping or not bad:
            found += [*mirrored, *(jumping or (planes(capture, phase) if capture.role != "object" else []))]
        if not jumping and not bad:
            own = [k for k, f in enumerate(capture.frames) if f.exposure_ms == (exposures[0] if exposures else None)]
            found += beside_code([patterns[k] for k in own], [images[k] for k in own], maps, lines)
    return [*found, *compressed(capture, images), *mosaic(capture, images), *unchanging(patterns, images)]


def _mislabelled(capture: Capture, images: Sequence[NDArray]) -> list[Finding]:
    """Frames that are darker than others of the same pattern, though they were exposed longer."""
    shown = [
        (f.pattern, f.exposure_ms or 0.0, float(i[::8, ::8].mean()))
        for f, i in zip(capture.frames, images, strict=True)
    ]
    wrong = [
        (i, k)
        for i, k in permutations(range(len(shown)), 2)
        if shown[i][0] == shown[k][0] and shown[i][1] > LONGER * shown[k][1] and shown[i][2] < DARKER * shown[k][2]
    ]
    if not wrong:
        return []
    i, k = wrong[0]
    more = f" ({len(wrong)} such pairs)" if len(wrong) > 1 else ""
    text = f"frame {i} with exposure_ms {shown[i][1]:g} is darker than frame {k} with {shown[k][1]:g}, though both show"
    text += f" the same{more}: correct exposure_ms in capture.json, or put the frames in order"
    return [Finding("identity", "bad", text, shots=(i, k))]


def _looked_at(capture: Capture, images: Sequence[NDArray], numbers: Sequence[int]) -> tuple[Plan, Sampled]:
    plan = Plan(Subject(capture.role, capture.name), tuple(capture.frames[k].pattern for k in numbers), ())
    return plan, _sample(plan, [images[k] for k in numbers])


def _sample(plan: Plan, images: Sequence[NDArray]) -> Sampled:
    height, width = images[0].shape
    stride = max(1, round((height * width / GRID) ** 0.5))
    at = np.mgrid[stride // 2 : height : stride, stride // 2 : width : stride].reshape(2, -1)
    grey = np.array([image[stride // 2 :: stride, stride // 2 :: stride].ravel() for image in images], np.float64)
    full = 255 if images[0].dtype == np.uint8 else 2 ** max(8, int(max(i.max() for i in images)).bit_length()) - 1
    found = summarise(plan, grey, at, (height, width), full)
    # a frame that only claims to be white is no measure of brightness, and light sections are bright in few frames
    bright = grey.max(axis=0) if any(isinstance(p, Line) for p in plan.shots) else quantiles_in(found.ordered, 0.9)[0]
    codes = [i for i, p in enumerate(plan.shots) if isinstance(p, Code)]
    if len(codes) > 2 and not any(level_of(p) == 1 for p in plan.shots):  # blur dims fringes beside them
        bright = np.maximum(bright, np.partition(grey[codes], -2, axis=0)[-2])
    darkest = min(images, key=lambda image: float(image[::8, ::8].mean()))[::4]  # it shows the least of the surface
    noise = max(found.noise, noise_of_one(darkest.astype(np.float32)))
    return replace(found, white=np.maximum(found.white, bright), noise=noise)


def _light(patterns: Sequence[Pattern], sampled: Sampled, board: bool) -> list[Finding]:
    """Hardly any light, or too much of it: on a `board`, whose dots are measured in whole fields, in any frame."""
    contrast = sampled.contrast
    lit = contrast > 0.03 * sampled.full
    if lit.mean() < DARK and np.median(sampled.grey) >= sampled.full:
        text = "the frames are saturated all over: shorten the exposure or close the aperture, and record again"
        return [Finding("light", "bad", text, {"saturated": 1.0})]
    if lit.mean() < DARK:
        text = "hardly any light of the projector in the image: lamp, lens, exposure, or frames of another capture"
        return [Finding("light", "bad", text, {"lit": float(lit.mean())})]
    stepped = any(isinstance(p, Phase) for p in patterns) and not board  # whole fields then tell no coordinates
    telling = [k for k, p in enumerate(patterns) if axis_of(p) is not None or not stepped]
    full = np.max(sampled.grey[telling], axis=0) >= sampled.full
    dots = contrast > BRIGHT * quantile_of(contrast, 0.97)  # of a black board, small beside what is lit
    for share, most, what in (
        (float(np.mean(full[lit])), SATURATED, "lit"),
        (float(np.mean(full[dots])) if board else 0.0, SATURATED_DOTS, "bright"),
    ):
        if share > most:
            text = (
                f"{share:.0%} of the {what} pixels are saturated: shorten the exposure or close the aperture, and "
                "record again"
            )
            return [Finding("saturation", "warning", text, {"saturated": share})]
    return []


def _plain(plan: Plan, sampled: Sampled) -> list[Finding]:
    """White frames must be bright and black ones dark, where the others vary."""
    bright, dark = quantiles_in(sampled.ordered, 0.85, 0.1)
    contrast = bright - dark
    chosen = contrast > max(0.05 * sampled.full, quantile_of(contrast, 0.8))
    if chosen.sum() < LEAST_LIT:
        return []
    wrong = []
    for i, pattern in enumerate(plan.shots):
        level = level_of(pattern)
        if level in (0.0, 1.0):
            value = median_of(((sampled.grey[i] - dark) / np.maximum(contrast, 1e-9))[chosen])
            if (level - value if level else value) > 0.6:  # beside blurred stripes white is brighter, and black darker
                wrong.append((i, f"claims {'white' if level else 'black'} and is {'dark' if level else 'bright'}"))
    told = [(i, f"frame {i} {text}: exchanged or inverted") for i, text in wrong]
    return [Finding("identity", "bad", text, shots=(i,), names="value") for i, text in told]


def _stretched(named: list[Finding], images: Sequence[NDArray], full: int) -> list[Finding]:
    """Say where all frames, bright black ones among them, reach from 0 to `full` that each was stretched by itself."""
    black = [images[f.shots[0]] for f in named if "claims black" in f.text]
    if not black or any(i.min() > 0 or i.max() < full for i in images):
        return named
    if min(np.count_nonzero(np.bincount(i.ravel())) for i in black) >= SPARSE * full:
        hint = f", or, as all frames reach from 0 to {full:g}, each stretched or equalised"
        return [replace(f, text=f.text + hint) for f in named]
    text = (
        f"as all frames reach from 0 to {full:g}, each was stretched or equalised: write frames as the camera gives "
        f"them; else frame {named[0].shots[0]} was exchanged"
    )
    return [Finding("identity", "bad", text, shots=named[0].shots, names="mistake")]


def _contradictions(plan: Plan, sampled: Sampled, lines: tuple[int, int], most: float = SHARE) -> list[Finding]:
    good = np.flatnonzero(sampled.bright)
    if len(good) < LEAST_LIT:
        return []
    good = good[spaced(len(good), PIXELS)]
    values, inverted = sampled.between(good), sampled.between(good, inverted=True)
    found: list[Finding] = []
    steps = misfitting_steps(plan, sampled)
    axes: tuple[Axis, ...] = ("x", "y")
    for axis in axes:
        shots = tuple(i for i, p in enumerate(plan.shots) if axis_of(p) == axis)
        if len(shots) < 4:
            continue
        own = list(shots)
        looked = Looked.of(
            shots, [plan.shots[i] for i in shots], values[own], inverted[own], lines, sampled.at[:, good]
        )
        if told := degrees(looked):
            found.append(Finding("identity", "bad", told, shots=shots, names="mistake"))
            continue
        share, left = left_unexplained(looked, FEW)
        if share > SHARE / 2 or share - left > BEYOND / 2:
            share, left = left_unexplained(looked)
        if share > most and axis in steps and HELD_BY_ALL in steps[axis].figures:
            found.append(steps[axis])
            continue
        along = "columns" if axis == "x" else "rows"
        wider = more_lines(looked, share, left)
        otherwise = bool(wider) and told_otherwise(plan, values, looked, left)
        if told := (share > most and too_fine(looked)) or overlapping(plan, looked, share, most):
            found.append(Finding("identity", "bad", told, {"contradicting": share}, names="mistake"))
        elif wider and not otherwise:
            found.append(Finding("lines", "bad", wider, {"contradicting": share}, names="mistake"))
        elif share > most or otherwise:
            text = f"frames across {along} contradict each other in {share:.0%} of the pixels"
            cause, shot = explanation(plan, values, looked, share)
            shown = () if shot is None else (shot,)
            figures = {"contradicting": share}
            found.append(Finding("identity", "bad", text + cause, figures, shown, names=cause.names))
    if found and all(f.names == "capture" and not f.shots for f in found):  # which names nothing closer
        found = [f for f in steps.values() if f.level == "bad"] or found
    seen = plan.shots, sampled.grey, sampled.lit, sampled.full
    return found or exchanged_steps(*seen) or [*steps.values()] or odd_steps(*seen)
