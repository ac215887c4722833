"""The checks before the first calibration: is this rig fit to measure, and what is to be set first?

Each check returns a `Finding`: a sentence with its figures, and a picture or a curve to look at. Here the images are
taken; fitness.py judges them.
"""

from __future__ import annotations

import time
from math import ceil

import numpy as np

from core.capture import fitness
from core.capture.plan import guards_for, own_sequence
from core.devices import Camera, Check, Projector, no_check, wait_until
from core.errors import DeviceError
from core.model import Array, Plan, Subject
from core.model.finding import Finding
from core.numerics import sigma_about_median
from core.patterns import Black, Level, Pattern, Phase, White, axis_of, finest_steps
from core.progress import SILENT, Progress
from core.verify.quality import LIT, sample_grid, summarise

LEVELS = 9  # of grey, black and white included
DELAYS_MS = (0, 2, 4, 6, 8, 11, 14, 18, 23, 30, 40, 55, 75, 100, 140, 200, 300)
STEADY = 0.02  # of the step from black to white


def preflight(
    projector: Projector, camera: Camera, progress: Progress = SILENT, *, rest_s: float = 0.2
) -> tuple[Finding, ...]:
    """Run every check that needs no help from the operator.

    The devices are open and look at an even, bright surface at working distance; `rest_s` is certainly longer than the
    light takes to be steady.
    """
    progress(0.0, "settle time")
    settle = measure_settle(projector, camera, rest_s, progress.check)
    wait_s = max(projector.settle_s, settle.figures["settle_ms"] / 1000)
    progress(0.3, "linearity")
    linear = linearity(projector, camera, wait_s, progress.check)
    plan, images = _sequence(projector, camera, wait_s, progress.part(0.4, 0.9))
    progress(0.9, "judging the images")
    at = sample_grid(images[0].shape)
    grey = np.array([image[at[0], at[1]] for image in images])
    sampled = summarise(plan, grey, at, (images[0].shape[0], images[0].shape[1]), (1 << camera.bits) - 1)
    white = images[plan.shots.index(White())]
    findings = (
        fitness.exposure(white, images[plan.shots.index(Black())], (1 << camera.bits) - 1),
        settle,
        linear,
        fitness.focus(plan, images),
        *fitness.order(plan, sampled, projector.size),
        fitness.orientation(plan, sampled, projector.size),
    )
    progress(1.0, "checked")
    return findings


def measure_settle(projector: Projector, camera: Camera, rest_s: float = 0.2, check: Check = no_check) -> Finding:
    """Measure how long after the acknowledgement the light is steady, dark to bright and bright to dark.

    Before every step the light rests for `rest_s`. An image is taken a growing time after the acknowledgement, and
    stands for the time at which it was really begun; the light is steady from the first image on after which all differ
    by less than `STEADY` from the last. The curve is delay in ms against the light, 0 to 1.
    """

    def level(before: Pattern, after: Pattern, delay_s: float) -> tuple[float, float, float]:
        """Give the mean grey value, when the image was begun and how long it took, in ms."""
        projector.show(before, check)
        wait_until(time.monotonic() + rest_s, check)
        projector.show(after, check)
        acknowledged = time.monotonic()
        wait_until(acknowledged + delay_s, check)
        begun = time.monotonic()
        image = camera.grab(check=check)
        took = time.monotonic() - begun
        return float(image.pixels.astype(np.float64).mean()), 1000 * (begun - acknowledged), 1000 * took

    dark, bright = level(White(), Black(), rest_s)[0], level(Black(), White(), rest_s)[0]
    step = bright - dark
    if step < 0.01 * (1 << camera.bits):
        return Finding(
            "settle",
            "bad",
            "between white and black the image hardly changes: look whether the projector's light reaches the camera",
            {"settle_ms": 1000 * projector.settle_s, "step": step},
        )
    curve, needed, steady, grabbing = [], 0.0, True, []
    for delay_ms in DELAYS_MS:
        up, up_at, took = level(Black(), White(), delay_ms / 1000)
        down, down_at, _ = level(White(), Black(), delay_ms / 1000)
        grabbing.append(took)
        curve.append((up_at, (up - dark) / step))
        before, steady = steady, max(bright - up, down - dark) <= STEADY * step
        if steady and not before:
            needed = max(up_at, down_at)
        if steady and delay_ms > 3 * needed + 20:
            break
    if not steady:
        needed = float("inf")
    image_ms = float(np.median(grabbing))
    figures = {"settle_ms": min(needed, float(DELAYS_MS[-1])), "image_ms": image_ms}
    words = f"the light is steady {needed:.0f} ms after the acknowledgement, an image takes {image_ms:.0f} ms"
    if needed == float("inf"):
        text = f"the light is not steady {DELAYS_MS[-1]} ms after the acknowledgement: look for automatic exposure"
        return Finding("settle", "bad", text, figures, curve=tuple(curve))
    if needed > 1000 * projector.settle_s + 0.5:
        text = f"{words}; it is waited for {1000 * projector.settle_s:.0f} ms: set settle_ms={ceil(needed)}"
        return Finding("settle", "warning", text, figures, curve=tuple(curve))
    return Finding("settle", "good", words, figures, curve=tuple(curve))


def linearity(projector: Projector, camera: Camera, wait_s: float, check: Check = no_check) -> Finding:
    """See whether twice the light is twice the grey value.

    A projector of grey values shows `LEVELS` of them, and the curve is its level against the light seen. One of black
    and white shows two complementary patterns, whose images must add up to those of white and black.
    """
    if projector.refusal(Level(0.5)) is None:
        shown = np.linspace(0, 1, LEVELS)
        images = [_image(projector, camera, Level(float(level)), wait_s, check) for level in shown]
        return fitness.linearity_of_levels(shown, images)
    halves = [Phase("x", 4.0, 4, k, k * np.pi / 2, "square") for k in (0, 2)]
    patterns: list[Pattern] = [White(), Black(), *halves]
    white, black, a, b = (_image(projector, camera, p, wait_s, check) for p in patterns)
    return fitness.linearity_of_halves(white, black, a, b)


def measure_stripes(
    projector: Projector, camera: Camera, wait_s: float, progress: Progress = SILENT
) -> tuple[list[Array], float]:
    """Take the steps of the finest stripes for `fitness.visibility`, and measure the noise of a grey value.

    Each, (n,), is at the pixels that the projector lights; DeviceError if those are too few.
    """
    shown = own_sequence(projector)
    steps = [shown[i] for i in finest_steps(shown)[1]]
    fine = [p for p in steps if axis_of(p) == axis_of(steps[0])]
    patterns: list[Pattern] = [White(), White(), Black(), *fine]
    white, again, black, *stack = (
        _image(projector, camera, pattern, wait_s, progress.check) for pattern in progress.over(patterns, "stripes")
    )
    lit = fitness.lit_pixels(white, black)
    if lit.mean() < LIT or not stack:
        seen = "too little of the image is lit" if stack else "the sequence has no stripes"
        raise DeviceError(projector.name, seen, "put a bright plate where both look, and expose longer")
    noise = sigma_about_median((again - white)[lit]) / 2**0.5
    return [image[lit] for image in stack], max(noise, 0.3)


def _sequence(projector: Projector, camera: Camera, wait_s: float, progress: Progress) -> tuple[Plan, list[Array]]:
    """Take the projector's sequence in memory, with white and black."""
    patterns = own_sequence(projector)
    patterns = (*patterns, *(p for p in (White(), Black()) if p not in patterns))
    plan = Plan(Subject("object", "pre-flight"), patterns, guards_for(patterns, projector.size))
    images = [
        _image(projector, camera, plan.shots[i], wait_s, progress.check)
        for i in progress.over(range(len(plan.shots)), "pattern {}")
    ]
    if len({image.shape for image in images}) > 1:
        raise DeviceError(camera.name, "images of several sizes", "set the camera to one size")
    return plan, images


def _image(projector: Projector, camera: Camera, pattern: Pattern, wait_s: float, check: Check) -> Array:
    projector.show(pattern, check)
    wait_until(time.monotonic() + wait_s, check)
    return camera.grab(check=check).pixels.astype(np.float64)
