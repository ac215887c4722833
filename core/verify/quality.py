"""The checks of a capture's light: saturation, modulation, movement, the lamp. Each returns one finding in words."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from core.lazy import dataclass
from core.model import Array, Plan
from core.model.finding import Finding, Level
from core.numerics import cut_off, distinct, quantile_of, quantiles_in, row_median, sigma_about_median
from core.patterns import cycle_lines, finest_steps, level_of

SAMPLES = 100_000
BRIGHT = 0.3  # of nearly the highest contrast
LIT = 0.01  # of the image must be lit by the projector
MOVED_PX = 0.1  # a tenth of a pixel is ten times the centroid's precision
MOVED_LINES = 0.15  # about what the phase of the reference rig resolves in a single pixel
REPEATS = 0.02  # of all commands: a sound line needs none
DRIFT = 0.02  # two per cent of light between first and last frame is a fifth of a phase step's noise


@dataclass(frozen=True)
class Sampled:
    """The grey values of all shots at a hundred thousand pixels.

    `grey` is (shots, n); `at` (2, n) holds the rows and columns of the pixels; `white`, `black` (n,) the brightest and
    darkest light, `noise` the standard deviation of a grey value. `full` is the grey value of saturation. `ordered`
    holds the grey values without those of guards, ascending at each pixel.
    """

    grey: Array
    at: NDArray[np.intp]
    shape: tuple[int, int]
    white: Array
    black: Array
    noise: float
    full: int
    ordered: Array

    @property
    def contrast(self) -> Array:
        """How much brighter white is than black, (n,)."""
        return self.white - self.black

    @property
    def lit(self) -> NDArray[np.bool_]:
        """Which pixels the projector lights well enough to judge, (n,)."""
        return self.contrast > max(10 * self.noise, 0.02 * self.full)

    @property
    def bright(self) -> NDArray[np.bool_]:
        """Which pixels it lights well, and no frame saturates, (n,)."""
        least = max(0.05 * self.full, 12 * self.noise, BRIGHT * quantile_of(self.contrast, 0.97))
        return (self.contrast > least) & (self.grey.max(axis=0) < self.full)

    def between(self, pixels: NDArray[np.intp], inverted: bool = False) -> NDArray[np.float32]:
        """All shots at some pixels, 0 where as dark as black and 1 where as bright as white, (shots, pixels)."""
        grey = self.full - self.grey[:, pixels] if inverted else self.grey[:, pixels]
        return ((grey - self.black[pixels]) / self.contrast[pixels]).astype(np.float32)


def sample_grid(shape: tuple[int, int]) -> NDArray[np.intp]:
    """Choose about `SAMPLES` pixels evenly over an image, shape (2, n) of rows and columns."""
    stride = max(1.0, sqrt(shape[0] * shape[1] / SAMPLES))
    rows, cols = (distinct(np.arange(stride / 2, n, stride).astype(np.intp)) for n in shape)
    grid = np.meshgrid(rows, cols, indexing="ij")
    return np.stack([axis.ravel() for axis in grid])


def summarise(plan: Plan, grey: Array, at: NDArray[np.intp], shape: tuple[int, int], full: int) -> Sampled:
    """Find white, black and noise of the sampled pixels in a way that a few wrong shots cannot spoil.

    White is the median of all white shots and of the 90 % level, black the darker of the black shot and the 10 %
    level of all shots. What the camera cannot exceed is saturated, below `full` too.
    """
    shots = plan.shots
    if (highest := int(grey.max())) < full and cut_off(grey):
        full = highest
    ordered = np.sort(grey[list(plan.own)], axis=0)
    high, low = quantiles_in(ordered, 0.9, 0.1)
    whites = [grey[i] for i, pattern in enumerate(shots) if level_of(pattern) == 1]
    blacks = [grey[i] for i, pattern in enumerate(shots) if level_of(pattern) == 0]
    white = row_median(np.transpose([*whites, high])) if whites else high
    black = np.min([*blacks, low], axis=0)
    noise = 1.0
    if plan.guards:
        pairs = [
            (grey[i], grey[k])
            for i, k in plan.guard_pairs
            if level_of(shots[i]) != 0 and not np.array_equal(grey[i], grey[k])
        ]
        rows = min(grey, key=np.mean).reshape(len(distinct(at[0])), -1)
        equal = noise_of_one(rows)  # a replay shows the same image twice
        noise = min((_noise(a, b) for a, b in pairs), default=equal)
        bright = white - black > max(10 * noise, 0.02 * full)  # where the light is, the noise is greater
        if bright.any() and pairs:
            noise = min(_noise(a[bright], b[bright]) for a, b in pairs)
    return Sampled(grey, at, shape, white, black, max(noise, 0.3), full, ordered)  # 0.3: rounding to whole grey values


def saturation(sampled: Sampled) -> Finding:
    """See whether the brightest light exceeds what the camera can tell."""
    lit = sampled.lit if sampled.lit.any() else np.ones_like(sampled.lit)
    share = float(np.mean(sampled.white[lit] >= sampled.full))
    top = quantile_of(sampled.white[lit], 0.98) / sampled.full
    figures = {"saturated": share, "brightest": top}
    if share > 0.002:
        advice = "shorten the exposure or close the aperture"
        return Finding("saturation", "warning", f"{share:.1%} of the lit pixels are saturated: {advice}", figures)
    return Finding("saturation", "good", f"nothing is saturated, the brightest light uses {top:.0%} of range", figures)


def modulation(plan: Plan, sampled: Sampled) -> Finding:
    """See whether the projector lights the scene, and what its finest stripes are worth."""
    lit = sampled.lit
    share = float(lit.mean())
    if share < LIT:
        text = (
            f"only {share:.1%} of the image is lit by the projector: look whether its lamp is on, its lens is open "
            "and the exposure is long enough"
        )
        return Finding("modulation", "bad", text, {"lit": share}, tuple(plan.own))
    words, figures = [f"{share:.0%} of the image is lit"], {"lit": share}
    level: Level = "good"
    for axis, along in (("x", "columns"), ("y", "rows")):
        period, steps = finest_steps(plan.patterns, axis)  # type: ignore[arg-type]
        if not steps:
            continue
        fine = [plan.own[i] for i in steps]
        swing = np.ptp(sampled.grey[fine][:, lit], axis=0) / 2
        c = float(np.median(swing))
        sigma = sampled.noise / max(sqrt(2) * c, 1e-9) * period / (2 * pi)
        figures |= {f"modulation_{axis}": c, f"sigma_{axis}_lines": sigma}
        words.append(f"stripes across {along}: modulation {c:.0f} grey values, {sigma:.2f} lines in one pixel")
        if c < 5 * sampled.noise:
            level = "warning"
            words.append("which is little: focus, darken the room or expose longer")
    return Finding("modulation", level, "; ".join(words), figures)


def lamp(plan: Plan, sampled: Sampled) -> Finding:
    """Compare the light before and after."""
    if not plan.guards or not sampled.lit.any():
        return Finding("lamp", "good", "the lamp was not compared")
    first, last = plan.guard_pairs[0]
    before, after = sampled.grey[first][sampled.lit], sampled.grey[last][sampled.lit]
    drift = float(np.median(after) / max(float(np.median(before)), 1e-9) - 1)
    if abs(drift) > DRIFT:
        text = f"the light changed by {drift:+.1%} during the capture: let the lamp warm up, keep daylight out"
        return Finding("lamp", "warning", text, {"drift": drift})
    return Finding("lamp", "good", f"the light changed by {drift:+.2%}", {"drift": drift})


def line(repeats: int, asked: int) -> Finding:
    """Judge how often the projector had to be asked again."""
    figures = {"repeats": float(repeats), "asked": float(asked)}
    text = f"{repeats} of {asked} commands to the projector had to be repeated"
    if repeats > max(2, REPEATS * asked):
        text += ": look at the cable, its length, the baud rate and answer_ms of the profile"
        return Finding("line", "warning", text, figures)
    return Finding("line", "good", text, figures)


def movement(plan: Plan, first: list[Array], last: list[Array], noise: float) -> Finding:
    """Compare the guards before and after, shape (H, W) each: white for the object, stripes for its depth.

    The shift of the white image is estimated by least squares from its gradients; the stripes' movement from the
    difference that noise does not explain.
    """
    if not first:
        return Finding("movement", "good", "movement was not looked for: the sequence has no guards")
    shift, sigma = _shift(first[0], last[0], noise)
    figures = {"shift_px": shift, "shift_sigma_px": sigma}
    lines = 0.0
    if len(first) > 1 and level_of(plan.guards[1]) != 0:
        stripes = float(np.std(first[1] - np.median(first[1] / np.maximum(first[0], 1)) * first[0]))
        gain = float(np.sum(first[1] * last[1]) / max(float(np.sum(first[1] ** 2)), 1e-9))
        rest = last[1] - gain * first[1]
        excess = sqrt(max(float(np.mean(rest**2)) - 2.2 * noise**2, 0.0))
        period = cycle_lines(plan.guards[1]) or 4.0
        lines = excess / max(stripes, 1e-9) * period / (2 * pi)
        figures["stripes_lines"] = lines
    if (shift > MOVED_PX and shift > 5 * sigma) or lines > MOVED_LINES:
        text = (
            f"the scene moved between first and last frame (image {shift:.2f} px, stripes {lines:.2f} lines): "
            "fasten camera, projector and object, and capture again"
        )
        return Finding("movement", "warning", text, figures)
    return Finding("movement", "good", f"nothing moved (image {shift:.3f} px, stripes {lines:.2f} lines)", figures)


def _noise(a: Array, b: Array) -> float:
    """Standard deviation of a grey value from two shots of the same light, whatever the lamp did between."""
    gain = float(np.median(b)) / max(float(np.median(a)), 1e-9)
    return sigma_about_median(b - gain * a) / sqrt(1 + gain**2)


def noise_of_one(rows: Array) -> float:
    """Standard deviation of a grey value from rows of one image: what neighbours in a row do not share.

    Fourth differences: of fringes of 20 pixels they leave a hundredth, of which second differences leave a tenth.
    """
    bend = np.diff(rows, 4, axis=1)
    return sigma_about_median(bend) / sqrt(70) if bend.size else 1.0


def _shift(a: Array, b: Array, noise: float) -> tuple[float, float]:
    """Estimate how far image b is shifted against a, px, and the standard deviation of that, px."""
    gain = float(np.median(b)) / max(float(np.median(a)), 1e-9)
    smooth = (a[1:-1, 1:-1] + (b / max(gain, 1e-9))[1:-1, 1:-1]) / 2
    gy, gx = np.gradient(smooth)
    d = (b / max(gain, 1e-9) - a)[1:-1, 1:-1]
    N = np.array([[np.sum(gx * gx), np.sum(gx * gy)], [np.sum(gx * gy), np.sum(gy * gy)]])
    N += np.eye(2) * 1e-9 * max(float(np.trace(N)), 1.0)
    shift = -np.linalg.solve(N, np.array([np.sum(gx * d), np.sum(gy * d)]))
    sigma = sqrt(2) * noise / sqrt(max(float(np.linalg.eigvalsh(N)[0]), 1e-9))
    return float(np.hypot(*shift)), sigma
