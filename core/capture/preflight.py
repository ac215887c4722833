"""The checks before the first calibration: is this rig fit to measure, and what is to be set first?

Each check returns a `Finding`: a sentence with its figures, and a picture or a curve to look at.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from math import acos, atan2, ceil, degrees

import numpy as np
from numpy.typing import NDArray

from core.capture.finding import Finding
from core.capture.identity import coordinates, identity
from core.capture.plan import Plan, guards_for
from core.capture.quality import LIT, Sampled, sample_grid, summarise
from core.devices import Camera, Check, Projector, no_check, wait_until
from core.errors import DeviceError
from core.patterns import Black, Pattern, Phase, White, reference_sequence
from core.progress import SILENT, Progress

Array = NDArray[np.float64]
LEVELS = 9  # of grey, black and white included
CURVED = 0.02  # of full light; a phase of four steps is then off by less than a hundredth of its period
TILE = 16  # px, of the pictures
SOFT = 0.15  # modulation of the finest stripes against white and black, below which noise rules
DELAYS_MS = (0, 2, 4, 6, 8, 11, 14, 18, 23, 30, 40, 55, 75, 100, 140, 200, 300)
STEADY = 0.02  # of the step from black to white


def preflight(
    projector: Projector, camera: Camera, progress: Progress = SILENT, *, rest_s: float = 0.2
) -> tuple[Finding, ...]:
    """Run every check that needs no help from the operator.

    Parameters
    ----------
    projector, camera
        Open devices that look at an even, bright surface at working distance.
    progress : Progress
    rest_s : float
        Certainly longer than the light takes to be steady.

    Raises
    ------
    DeviceError
        If a device fails.
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
        exposure(white, images[plan.shots.index(Black())], (1 << camera.bits) - 1),
        settle,
        linear,
        focus(plan, images),
        *order(plan, sampled, projector.size),
        orientation(plan, sampled, projector.size),
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


def grey_light(level: float) -> Phase:
    """Give even light of a level, 0 to 1: a cosine so long that all lines stand at the same place of it.

    Examples
    --------
    >>> from core.patterns import brightness
    >>> brightness(grey_light(0.25), [0, 639]).round(6)
    array([0.25, 0.25])
    """
    return Phase("x", 1e12, 3, 0, acos(2 * level - 1), "sine")


def linearity(projector: Projector, camera: Camera, wait_s: float, check: Check = no_check) -> Finding:
    """See whether twice the light is twice the grey value.

    A projector of grey values shows `LEVELS` of them, and the curve is its level against the light seen. One of black
    and white shows two complementary patterns, whose images must add up to those of white and black.
    """
    if projector.refusal(grey_light(0.5)) is None:
        shown = np.linspace(0, 1, LEVELS)
        images = [_image(projector, camera, grey_light(float(level)), wait_s, check) for level in shown]
        return linearity_of_levels(shown, images)
    halves = [Phase("x", 4.0, 4, k, k * np.pi / 2, "square") for k in (0, 2)]
    patterns: list[Pattern] = [White(), Black(), *halves]
    white, black, a, b = (_image(projector, camera, p, wait_s, check) for p in patterns)
    return linearity_of_halves(white, black, a, b)


def linearity_of_levels(shown: Array, images: Sequence[Array]) -> Finding:
    """Judge images (H, W) of even light of rising levels (n,), black first and white last."""
    lit = _lit(images[-1], images[0])
    if lit.mean() < LIT:
        return Finding("linearity", "bad", "too little of the image is lit to judge the linearity")
    span = np.median((images[-1] - images[0])[lit])
    seen = np.array([np.median((image - images[0])[lit]) for image in images]) / span
    off = float(np.max(np.abs(seen - shown)))
    inner = (shown > 0.05) & (shown < 0.95)
    usable = np.clip(seen[inner], 1e-3, 0.999)
    power = float(np.sum(np.log(usable) * np.log(shown[inner])) / np.sum(np.log(shown[inner]) ** 2))
    figures = {"deviation": off, "exponent": power}
    curve = tuple(zip(shown.tolist(), seen.tolist(), strict=True))
    if off > CURVED:
        text = (
            f"the light seen is about the {power:.2f}th power of the light meant, off by up to {off:.0%}: "
            "switch gamma off in the camera, and set the projector's gamma in its URL"
        )
        return Finding("linearity", "warning", text, figures, curve=curve)
    return Finding("linearity", "good", f"projector and camera are linear to {off:.1%}", figures, curve=curve)


def linearity_of_halves(white: Array, black: Array, a: Array, b: Array) -> Finding:
    """Judge images (H, W) of two complementary patterns: where stripes are half bright, a curve shows most."""
    lit = _lit(white, black)
    if lit.mean() < LIT:
        return Finding("linearity", "bad", "too little of the image is lit to judge the linearity")
    span = (white - black)[lit]
    half = np.abs(a - b)[lit] < 0.3 * span
    seen = np.full(white.shape, np.nan)
    seen[lit] = np.where(half, 0.5 + (a + b - white - black)[lit] / np.maximum(span, 1e-9) / 2, np.nan)
    picture = _tiles(seen, 0.01)
    figures = {"half_bright": float(half.mean())}
    if half.mean() < 0.01:
        text = "stripes are so sharp that hardly a pixel is half bright: linearity does not matter here"
        return Finding("linearity", "good", text, figures)
    off = float(np.median(((a + b - white - black)[lit] / span)[half])) / 2
    figures["deviation"] = off
    if abs(off) > CURVED:
        text = f"half the light is seen as {0.5 + off:.2f} of it: switch gamma and automatic contrast off in the camera"
        return Finding("linearity", "warning", text, figures, picture=picture)
    text = f"the camera is linear to {abs(off):.1%} at half light"
    return Finding("linearity", "good", text, figures, picture=picture)


def exposure(white: Array, black: Array, full: int) -> Finding:
    """Say by how much to change the exposure so that white uses 85 % of the range.

    `white` and `black` are images (H, W), `full` the grey value of saturation.
    """
    lit = _lit(white, black)
    picture = _tiles(np.where(lit, white / full, np.nan))
    if lit.mean() < LIT:
        text = "the projector lights too little of the image: open the aperture or expose ten times as long"
        return Finding("exposure", "bad", text, {"lit": float(lit.mean()), "factor": 10.0}, picture=picture)
    top = float(np.quantile(white[lit], 0.99)) / full
    share = float(np.mean(white[lit] >= full))
    factor = 0.85 / top if share < 0.002 else 0.5
    figures = {"brightest": top, "saturated": share, "factor": factor}
    if share >= 0.002:
        text = f"{share:.1%} of the lit pixels are saturated: expose half as long and check again"
        return Finding("exposure", "warning", text, figures, picture=picture)
    if top < 0.5:
        text = f"white uses {top:.0%} of the camera's range: expose {factor:.1f} times as long or open the aperture"
        return Finding("exposure", "warning", text, figures, picture=picture)
    return Finding("exposure", "good", f"white uses {top:.0%} of the camera's range", figures, picture=picture)


def focus(plan: Plan, images: Sequence[Array]) -> Finding:
    """Compare the modulation of the finest stripes with white and black: 1 is sharp, 0 is grey.

    The picture is that ratio in tiles of `TILE` px.
    """
    white, black = (images[plan.shots.index(p)] for p in (White(), Black()))
    steps = [(i, p) for i, p in enumerate(plan.shots) if isinstance(p, Phase)]
    if not steps:
        return Finding("focus", "good", "the sequence has no stripes to judge the focus by")
    finest = min(p.period for _, p in steps)
    ratio = np.full(white.shape, np.inf)
    for axis in ("x", "y"):
        fine = [images[i] for i, p in steps if p.period == finest and p.axis == axis]
        if fine:
            swing = np.ptp(np.stack(fine), axis=0)
            ratio = np.minimum(ratio, swing / np.maximum(white - black, 1e-9))
    picture = _tiles(np.where(_lit(white, black), ratio, np.nan))
    seen = picture[np.isfinite(picture)]
    if seen.size == 0:
        return Finding("focus", "bad", "too little of the image is lit to judge the focus", picture=picture)
    middle, worst = float(np.median(seen)), float(np.quantile(seen, 0.05))
    figures = {"modulation": middle, "worst": worst, "period_lines": finest}
    what = f"stripes of {finest:g} lines keep {middle:.0%} of the light, {worst:.0%} where they are worst"
    if worst < SOFT:
        text = f"{what}: focus projector and camera on the middle of the working depth, or close their apertures"
        return Finding("focus", "warning", text, figures, picture=picture)
    return Finding("focus", "good", what, figures, picture=picture)


def order(plan: Plan, sampled: Sampled, lines: tuple[int, int]) -> list[Finding]:
    """See whether patterns come in the order they were asked for; the picture is how far the frames contradict."""
    picture = _map(sampled, coordinates(plan, sampled, lines)[2])
    bad = [f for f in identity(plan, sampled, lines) if f.level == "bad"]
    if not bad:
        return [Finding("order", "good", "the patterns come in their order", picture=picture)]
    return [Finding("order", "bad", f.text, f.figures, picture=picture) for f in bad]


def orientation(plan: Plan, sampled: Sampled, lines: tuple[int, int]) -> Finding:
    """See how the projector's columns and rows lie in the camera's image: turned, upside down, mirrored.

    Projector u grows to the right of the scene as camera u does, and v downwards, when both stand upright. The picture
    is the projector's column.
    """
    u, v = (axis.astype(np.float64) for axis in coordinates(plan, sampled, lines)[:2])
    picture = _map(sampled, u)
    at = sampled.at[:, sampled.lit]
    if at.shape[1] < 50:
        return Finding("orientation", "bad", "too little of the image is lit to tell how the lines lie")
    A = np.column_stack([at[1], at[0], np.ones(at.shape[1])])
    if not (np.isfinite(u).all() and np.isfinite(v).all()):
        return Finding("orientation", "good", "one axis only: mirroring cannot be told", picture=picture)
    (ux, uy), (vx, vy) = _robust_plane(A, u)[:2], _robust_plane(A, v)[:2]
    mirrored = ux * vy - uy * vx < 0
    turned = round(degrees(atan2(uy, ux)), 1) + 0.0
    figures = {"turned_deg": turned, "mirrored": float(mirrored), "lines_per_px": float(np.hypot(ux, uy))}
    if mirrored:
        text = "the projector's picture is mirrored: switch rear or ceiling projection off, or exchange the line order"
        return Finding("orientation", "bad", text, figures, picture=picture)
    if abs(turned) > 45:
        text = f"the projector is turned by {turned:g}° against the camera: turn one, or exchange columns and rows"
        return Finding("orientation", "warning", text, figures, picture=picture)
    text = f"columns and rows lie as in the camera, turned by {turned:g}°"
    return Finding("orientation", "good", text, figures, picture=picture)


def visibility(depths_mm: Sequence[float], stacks: Sequence[Sequence[Array]], noise: float) -> Finding:
    """Judge the finest stripes over the working depth.

    Parameters
    ----------
    depths_mm : sequence of float
        Where the plate stood.
    stacks : sequence of sequences of array, all of one shape at a depth
        The phase steps of the finest period at each depth, where the projector lights the plate.
    noise : float
        Standard deviation of a grey value.
    """
    swing = [float(np.median(np.ptp(np.stack(list(stack)), axis=0))) / 2 for stack in stacks]
    curve = tuple(zip([float(d) for d in depths_mm], swing, strict=True))
    good = [d for d, c in curve if c > 5 * noise]
    figures = {"least": min(swing), "greatest": max(swing)}
    if len(good) == len(curve):
        text = (
            f"stripes are clear from {min(depths_mm):g} to {max(depths_mm):g} mm ({min(swing):.0f} grey values or more)"
        )
        return Finding("visibility", "good", text, figures, curve=curve)
    where = f"from {min(good):g} to {max(good):g} mm only" if good else "nowhere"
    text = f"stripes are clear {where}: focus on the middle of the depth, close the apertures, or work in less depth"
    return Finding("visibility", "warning", text, figures, curve=curve)


def measure_stripes(
    projector: Projector, camera: Camera, wait_s: float, progress: Progress = SILENT
) -> tuple[list[Array], float]:
    """Take the steps of the finest stripes, as `visibility` takes them, and measure the noise.

    Returns
    -------
    stack : list of array, shape (n,)
        At the pixels that the projector lights.
    noise : float
        Standard deviation of a grey value.

    Raises
    ------
    DeviceError
        If a device fails, or the projector lights too little of the image.
    """
    steps = [p for p in projector.sequence or reference_sequence(*projector.size) if isinstance(p, Phase)]
    fine = [p for p in steps if p.period == min(s.period for s in steps) and p.axis == steps[0].axis]
    patterns: list[Pattern] = [White(), White(), Black(), *fine]
    white, again, black, *stack = (
        _image(projector, camera, pattern, wait_s, progress.check) for pattern in progress.over(patterns, "stripes")
    )
    lit = _lit(white, black)
    if lit.mean() < LIT or not stack:
        seen = "too little of the image is lit" if stack else "the sequence has no stripes"
        raise DeviceError(projector.name, seen, "put a bright plate where both look, and expose longer")
    difference = (again - white)[lit]
    noise = 1.4826 * float(np.median(np.abs(difference - np.median(difference)))) / 2**0.5
    return [image[lit] for image in stack], max(noise, 0.3)


def _sequence(projector: Projector, camera: Camera, wait_s: float, progress: Progress) -> tuple[Plan, list[Array]]:
    """Take the projector's sequence in memory, with white and black."""
    patterns = tuple(projector.sequence or reference_sequence(*projector.size))
    patterns = (*patterns, *(p for p in (White(), Black()) if p not in patterns))
    plan = Plan("pre-flight", "object", patterns, guards_for(patterns, projector.size))
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


def _lit(white: Array, black: Array) -> NDArray[np.bool_]:
    """Where the projector's light arrives: a fifth of what the brightest places get."""
    light = white - black
    return light > max(0.2 * float(np.quantile(light, 0.99)), 3.0)


def _map(sampled: Sampled, values: NDArray[np.floating]) -> Array:
    """Put values (n,) of the lit pixels into a coarse image; NaN where nothing is lit."""
    wide = 48
    step = max(sampled.shape[1] / wide, 1.0)
    shape = (int(np.ceil(sampled.shape[0] / step)), int(np.ceil(sampled.shape[1] / step)))
    at = (sampled.at[:, sampled.lit] / step).astype(int)
    cell = at[0] * shape[1] + at[1]
    known = np.isfinite(values)
    count = np.bincount(cell[known], minlength=shape[0] * shape[1])
    total = np.bincount(cell[known], weights=values[known], minlength=shape[0] * shape[1])
    return np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(shape)


def _tiles(values: Array, least: float = 0.25) -> Array:
    """Median in tiles of `TILE` px, NaN where less than the share `least` of a tile has values."""
    h, w = (n // TILE * TILE for n in values.shape)
    parts = values[:h, :w].reshape(h // TILE, TILE, w // TILE, TILE).swapaxes(1, 2).reshape(h // TILE, w // TILE, -1)
    enough = np.isfinite(parts).mean(axis=2) >= least
    return np.where(enough, np.nanmedian(np.where(enough[..., None], parts, 0.0), axis=2), np.nan)


def _robust_plane(A: Array, values: Array) -> Array:
    """Fit a plane in the pixel coordinates, three times without what lies far off."""
    keep = np.ones(len(values), bool)
    x: Array = np.zeros(A.shape[1])
    for _ in range(4):
        x = np.asarray(np.linalg.lstsq(A[keep], values[keep], rcond=None)[0], np.float64)
        off = np.abs(values - A @ x)
        keep = off <= 3 * np.median(off) + 1e-6
    return x
