"""Frames that were recorded before, by whatever program: do they show what capture.json claims?

Told from the images and from what was decoded of them. Recorded captures were checked frame by frame when they were
taken (`identity`); here a capture is judged as a whole, with limits that no sound one of any rig reaches, and where it
contradicts itself the descriptions that people get wrong are tried until one fits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import combinations, permutations

import cv2
import numpy as np
from numpy.typing import NDArray

from core.algebra import on_own_threads
from core.model import Capture, PhaseMap, Plan, Subject
from core.model.finding import Finding
from core.numerics import median_of, quantile_of, quantiles_in, ranked, spaced
from core.patterns import Axis, Code, Line, axis_of, level_of
from core.verify.beside import beside_code
from core.verify.contradictions import PIXELS, Looked
from core.verify.misplaced import exchanged_frames, exchanged_steps, odd_steps, steps_of_periods
from core.verify.mistakes import BEYOND, degrees, explanation, left_unexplained, more_lines, too_fine
from core.verify.overlapping import overlapping
from core.verify.pixels import (
    GRID,
    IRRATIONAL,
    LEAST_LIT,
    blank,
    bytes_exchanged,
    combed,
    compressed,
    edited,
    enlarged,
    mosaic,
    scattered,
)
from core.verify.quality import BRIGHT, Sampled, noise_of_one, summarise
from core.verify.unchanging import unchanging

Array = NDArray[np.float32]

# of the pixels that contradict themselves; sound captures have below 0.05, twice that where only what is dim beside
# saturated light can be looked at
SHARE = 0.12
FEW = 200  # pixels that nearly always show it: half of that where it is 0.15 comes once in 15,000 captures
DARK = 0.01  # of the image that must be lit
SATURATED = 0.05  # of the lit pixels
SATURATED_DOTS = 0.25  # of the bright pixels, on a board
OFF_PLANE = 0.35  # share of the pixels that no projective map holds
PLANE_LINES = 3.0
LEAST_OF_PLANE = 0.3  # share of the pixels by which a plane is found
DRAWS = (60, 300, 300, 300)  # of five pixels: for the only plane, and for those that may be lit behind a board
WRONG_HAND = 0.5
MOVED_PX = 0.5
UNLIKE = 0.7  # of the difference that putting back what moved leaves; of bare boards at rest 0.79 and more, by 300
MOVED_RESPONSE = 0.45  # of the correlation's peak: bare boards show 0.35 by chance, what moved 0.55 and more
DRIFT = 0.15
SPARSE = 0.7  # of the grey values that a black frame takes which reaches over all: noise alone, spread, takes fewer
ALL_ROUND = 0.3  # mean of phases as unit vectors: some periods are seen
DOUBLED, FAR, THIN = 0.03, 0.05, 8000  # of squared differences, those that are none; 1 - cos of shifts apart; pixels
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
        found = [*_light(sampled, capture.role in ("testfield", "depth")), *named]
        checks = {f.check for f in found}
        if "light" not in checks:
            most = SHARE * (1 + ("saturation" in checks))
            found += edited(_doubled(plan, images, sampled) or _contradictions(plan, sampled, lines, most), images)
        found += _halves(plan, images)
    bad = {f.check for f in found if f.level == "bad"} - {"movement"}
    if phase is not None and bad <= {"lines"}:
        maps: list[tuple[Axis, NDArray, str]] = [("x", phase.u, "columns"), ("y", phase.v, "rows")]
        if jumping := exchanged_frames(patterns, maps):
            found = [f for f in found if f.check != "lines"]  # exchanged bits name lines that are not there
        if jumping or not bad:
            found += [*_hand(phase), *(jumping or (_planes(capture, phase) if capture.role != "object" else []))]
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
    noise = max(found.noise, noise_of_one(darkest.astype(np.float64)))
    return replace(found, white=np.maximum(found.white, bright), noise=noise)


def _light(sampled: Sampled, board: bool) -> list[Finding]:
    contrast = sampled.contrast
    lit = contrast > 0.03 * sampled.full
    if lit.mean() < DARK:
        text = "hardly any light of the projector in the image: lamp, lens, exposure, or frames of another capture"
        return [Finding("light", "bad", text, {"lit": float(lit.mean())})]
    full = np.max(sampled.grey, axis=0) >= sampled.full
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
        along = "columns" if axis == "x" else "rows"
        if told := (share > most and too_fine(looked)) or overlapping(plan, looked, share, most):
            found.append(Finding("identity", "bad", told, {"contradicting": share}, names="mistake"))
        elif told := more_lines(looked, share, left):
            found.append(Finding("lines", "bad", told, {"contradicting": share}, names="mistake"))
        elif share > most:
            text = f"frames across {along} contradict each other in {share:.0%} of the pixels"
            cause, shot = explanation(plan, values, looked, share)
            shown = () if shot is None else (shot,)
            figures = {"contradicting": share}
            found.append(Finding("identity", "bad", text + cause, figures, shown, names=cause.names))
    steps = plan.shots, sampled.grey, sampled.lit, sampled.full
    return found or exchanged_steps(*steps) or odd_steps(*steps)


def _doubled(plan: Plan, images: Sequence[NDArray], sampled: Sampled) -> list[Finding]:
    """Find steps that differ by hardly more than noise, where others of their period differ as their shifts say.

    Where one is saturated its neighbour may be, too, and they are alike.
    """
    # a grid may beat with the lines
    row, column = (scattered(n, THIN, factor) for n, factor in zip(images[0].shape, IRRATIONAL, strict=True))
    at = row * images[0].shape[1] + column
    for _, own, shifts in (period for period in steps_of_periods(plan.shots) if len(period[1]) >= 3):
        grey = np.array([images[k].ravel()[at] for k in own], np.float64)
        swing = np.ptp(grey, axis=0)
        striped = swing > max(BRIGHT * quantile_of(swing, 0.97), 5 * sampled.noise)
        grey = grey[:, striped & (grey.max(axis=0) < sampled.full)]
        wave = np.array([1, 1j]) @ (np.stack([np.cos(shifts), np.sin(shifts)]) @ (grey - grey.mean(axis=0)))
        if grey.shape[1] < LEAST_LIT or abs(np.mean(wave / np.maximum(np.abs(wave), 1e-9))) > ALL_ROUND:
            continue  # less than a period is seen
        pairs = [(i, k, 1 - np.cos(shifts[i] - shifts[k])) for i, k in combinations(range(len(own)), 2)]
        if not (pairs := [pair for pair in pairs if pair[2] > FAR]):
            continue
        squares = [float(np.dot(away := grey[i] - grey[k], away)) / len(away) for i, k, _ in pairs]
        ratios = [square / meant for square, (*_, meant) in zip(squares, pairs, strict=True)]
        at_least = int(np.argmin(ratios))
        least, usual = ratios[at_least], median_of(ratios)
        if least < DOUBLED * usual and squares[at_least] < DOUBLED * median_of(squares):
            first, second = (own[n] for n in pairs[at_least][:2])
            text = (
                f"frames {first} and {second} show the same stripes: they differ by {(least / usual) ** 0.5:.0%} of "
                "what their shifts make; one stands for the other, or the projector did not change: record it again"
            )
            return [Finding("identity", "bad", text, shots=(first, second), names="value")]
    return []


def _hand(phase: PhaseMap) -> list[Finding]:
    """Camera and projector see a surface from the same side: their images of it are never mirror images."""
    d = max(3, min(phase.u.shape) // 80)
    thin = max(1, d // 3)

    def slopes(values: NDArray) -> tuple[NDArray, NDArray]:
        corner = values[:-d:thin, :-d:thin]
        return values[:-d:thin, d::thin] - corner, values[d::thin, :-d:thin] - corner

    (ux, uy), (vx, vy) = slopes(phase.u), slopes(phase.v)
    det = ux * vy - uy * vx
    det = det[np.isfinite(det)]
    if len(det) < LEAST_LIT // 3:
        return []
    share = float(np.mean(det < 0))
    if share <= WRONG_HAND + 0.2:
        return []
    text = (
        "columns and rows of the projector are exchanged, or one of them is reversed: the camera's image is mirrored "
        "against the projector's; correct axis in the patterns, or mirror the frames back"
    )
    return [Finding("axes", "bad", text, {"mirrored": share}, names="mistake")]


def _planes(capture: Capture, phase: PhaseMap) -> list[Finding]:
    """On a plane each projector coordinate is a projective function of the camera's; few planes may be lit.

    Pieces of a mistaken binary code may look like planes, those of a Gray code are told by their jumps.
    """
    binary = {f.pattern.axis for f in capture.frames if isinstance(f.pattern, Code) and f.pattern.kind == "binary"}
    found = []
    for axis, values, along in (("x", phase.u, "columns"), ("y", phase.v, "rows")):
        valid = np.flatnonzero(np.isfinite(values))
        if len(valid) < 2000:
            continue
        chosen = valid[scattered(len(valid), 600)]
        y, x = np.divmod(chosen, values.shape[1])
        lines = values.ravel()[chosen].astype(np.float64)
        limit = max(PLANE_LINES, 0.02 * (quantile_of(lines, 0.95) - quantile_of(lines, 0.05)))
        off = np.ones(len(lines), bool)
        for draws in DRAWS[:1] if axis in binary else DRAWS:
            if off.mean() > OFF_PLANE:
                at = x[off] / values.shape[1], y[off] / values.shape[1]
                off[off] = _off_projective(*at, lines[off], draws) > limit
        share = float(off.mean())
        if share > OFF_PLANE:
            text = (
                f"{along} do not rise steadily over the plane ({share:.0%} of the pixels are off): code frames were "
                "exchanged, or cell, bits or period of the patterns are wrong"
            )
            found.append(Finding("order", "bad", text, {f"off_{axis}": share}, names="mistake"))
    return found


def _off_projective(x: NDArray, y: NDArray, u: NDArray, count: int) -> NDArray:
    """Distances in lines from the projective function that the most pixels agree on."""
    one = np.ones_like(x)
    A = np.stack([one, x, y, -u * x, -u * y], axis=1)
    draws = scattered(len(u), 5 * count).reshape(count, 5)
    try:
        p = np.linalg.solve(A[draws], u[draws][..., None])[..., 0]
    except np.linalg.LinAlgError:  # five on one line
        p = (np.linalg.pinv(A[draws]) @ u[draws][..., None])[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        off = np.abs(p[:, :3] @ A[:, :3].T / (1 + p[:, 3:] @ A[:, 1:3].T) - u)
    off = np.nan_to_num(off, nan=np.inf)
    best = off[np.argmin(ranked(off, LEAST_OF_PLANE))]
    for _ in range(3):  # least squares over those that agree, for distortion bends the map a little
        near = best <= max(4.0 * float(ranked(best, LEAST_OF_PLANE)), 0.5)
        A = np.stack([one, x, y, -u * x, -u * y, x * x, x * y, y * y], axis=1)
        p, *_ = np.linalg.lstsq(A[near], u[near], rcond=None)
        curved = p[0] + p[1] * x + p[2] * y + p[5] * x * x + p[6] * x * y + p[7] * y * y
        best = np.minimum(best, np.abs(curved / (1 + p[3] * x + p[4] * y) - u))
    return best


def _halves(plan: Plan, images: Sequence[NDArray]) -> list[Finding]:
    """The steps of each axis add up to an evenly lit image: compare these, taken at different times."""
    even = []
    for axis in ("x", "y"):
        steps = [i for i, p in enumerate(plan.shots) if axis_of(p) == axis and hasattr(p, "steps")]
        if not steps:
            continue
        first = plan.shots[steps[0]]
        same = [i for i in steps if getattr(plan.shots[i], "period", 0) == getattr(first, "period", 0)]
        if len(same) == getattr(first, "steps", 0) >= 4:
            even.append(_mean([images[i] for i in same]))
    if len(even) < 2:
        return []
    side = int(np.clip(min(even[0].shape) // 64 * 64, 64, 512))  # OpenCV is half a pixel off at odd sizes
    a, b = (np.asarray(cv2.resize(e, (side, side), interpolation=cv2.INTER_AREA), np.float32) for e in even)
    few = [each.ravel()[::17] for each in (a, b)]  # which meets every column
    lit = few[0] > 0.1 * quantile_of(a[::4, ::4], 0.98)
    gain = median_of(few[1][lit]) / max(median_of(few[0][lit]), 1e-9)
    if abs(gain - 1) > DRIFT:
        text = f"the light changed by {gain - 1:+.0%} between the steps of columns and of rows: warm the lamp up"
        return [Finding("lamp", "warning", text, {"drift": gain - 1})]
    one, other, window = _texture(a), _texture(b), _window(side)
    shift, response = cv2.phaseCorrelate(one, other, window)
    moved = float(np.hypot(*np.multiply(shift, images[0].shape[::-1]))) / side
    if moved <= MOVED_PX or response <= MOVED_RESPONSE:
        return []
    back = np.array([[1, 0, -shift[0]], [0, 1, -shift[1]]])
    beside = cv2.warpAffine(other, back, (side, side), borderMode=cv2.BORDER_REPLICATE)
    if np.sum(window * (one - beside) ** 2) < UNLIKE * np.sum(window * (one - other) ** 2):
        text = f"the scene moved by {moved:.1f} px between the frames of columns and of rows: fasten all, record again"
        return [Finding("movement", "bad", text, {"shift_px": moved, "response": float(response)})]
    return []


@cache
def _window(side: int) -> Array:
    """Let an image fade out to its edges."""
    return np.asarray(cv2.createHanningWindow((side, side), cv2.CV_32F), np.float32)


def _texture(image: Array) -> Array:
    """What stands out of the light, over the light."""
    light = cv2.blur(cv2.blur(image, (15, 15)), (15, 15)) + 0.05 * float(image.max()) + 1e-6
    return np.asarray(np.clip((image - light) / light, -0.5, 0.5), np.float32)


def _mean(images: Sequence[NDArray]) -> Array:
    thin = max(1, min(images[0].shape) // 500)
    short = images[0].dtype == np.uint8 and len(images) <= 257  # whose sums 16 bits hold
    summed = images[0][::thin, ::thin].astype(np.uint16 if short else np.float32)
    for image in images[1:]:
        np.add(summed, image[::thin, ::thin], out=summed)
    return summed.astype(np.float32) / np.float32(len(images))
