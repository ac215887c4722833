"""Before stage 1: which sequence suits a rig, compared by what the decoder makes of it.

What the rig is like (contrast, ambient light, noise, blur, time a frame) comes from the pre-flight check and a capture
where there are any; what is assumed is said. Frames of a made-up field of places are drawn with that light and noise,
decoded, and compared with the places: noise, gross errors and validity are those of the decoder itself.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from math import exp, inf, log, log2, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from core.decode import decode
from core.decode.noise import spatial_residual
from core.errors import InputError
from core.fields import text_of
from core.lazy import dataclass
from core.model import Array, Capture, Project
from core.patterns import (
    Axis,
    Pattern,
    SequenceSpec,
    axis_of,
    brightness,
    finest_steps,
    grey_reason,
    level_of,
    shows_grey,
)
from core.progress import SILENT, Progress
from core.project import iterate_images, read_capture, read_project

HEIGHT, WIDTH = 32, 525  # px of the made-up field: large enough for the decoder to see a ripple
PERIODS = (6.0, 8.0, 12.0, 16.0, 24.0, 32.0)  # lines, that are tried
OUTLIER = 35.0  # times the median square, four standard deviations: edges of the scene
GROSS = 0.5  # of the finest period; of words two lines
FEWEST, USUAL, MOST = 8, 28, 200  # frames
NEAR = 1.03  # times the sigma that is wanted: as good, since the drawn noise differs by as much
WORD = 0.7  # of the bits that number all lines: a pixel sees its line's neighbours too
ONE = ("paper", "dense")  # have no options that change with the frames
MOST_GROSS, LEAST_VALID = 0.001, 0.9  # of a sequence that can be relied on


@dataclass(frozen=True)
class RigLight:
    """What a pixel sees: grey values of black and of white beyond it, noise ``dark + shot g``, blur, time a frame."""

    contrast: float = 60.0
    ambient: float = 15.0
    dark: float = 4.0
    shot: float = 0.0
    blur_lines: float = 0.6
    frame_ms: float = 100.0
    bits: int = 8
    known_from: tuple[str, ...] = ()


@dataclass(frozen=True)
class PlannedSequence:
    """A sequence and what it will give: r.m.s. error in lines, shares of wrong and of valid pixels, time for all."""

    preset: str
    options: dict[str, float]
    frames: int
    sigma_lines: float | None  # None where no pixel decodes
    gross: float
    valid: float
    seconds: float
    needs_grey: bool

    @property
    def reliable(self) -> bool:
        """Whether nearly all pixels decode, and nearly none wrongly."""
        return self.gross < MOST_GROSS and self.valid > LEAST_VALID

    @property
    def words(self) -> str:
        """As `--sequence` takes it."""
        options = ",".join(f"{key}={value:g}" for key, value in self.options.items())
        return self.preset + (options and f":{options}")


def plan_sequence(
    folder: Path,
    frames: int | None = None,
    sigma_lines: float | None = None,
    *,
    preflight: Path | None = None,
    progress: Progress = SILENT,
) -> tuple[RigLight, tuple[PlannedSequence, ...]]:
    """Compare the best sequence of each family for a project's rig.

    With at most `frames`, both axes together, 28 if nothing is given, or with the fewest that reach `sigma_lines`.
    `preflight` is what ``stripe-core preflight --json`` wrote.
    """
    if frames is not None and not FEWEST <= frames <= MOST:
        raise InputError("--frames", f"is {frames}", f"give {FEWEST} to {MOST} frames")
    if sigma_lines is not None and not 0 < sigma_lines < 1:
        raise InputError("--sigma", f"is {sigma_lines}", "give a standard deviation in lines, more than 0 and below 1")
    project = read_project(folder)
    progress(0.0, "looking what the rig is like")
    light = rig_light(project, preflight)
    size = project.projector.width, project.projector.height
    found = []
    for name in progress.over(("paper", "gray-sine", "gray-inverse", "multi-frequency", "two-period", "dense"), "{}"):
        planned = _best(name, frames or USUAL, size, light)
        if sigma_lines is not None and name != "paper":
            usual = planned or _best(name, frames or 2 * USUAL, size, light)
            planned = usual and _reaching(sigma_lines, usual, frames or MOST, size, light)
        if planned is not None:
            found.append(planned)
    return light, tuple(sorted(found, key=lambda p: inf if p.sigma_lines is None else p.sigma_lines))


def expected(spec: SequenceSpec, size: tuple[int, int], light: RigLight, seed: int = 0) -> PlannedSequence:
    """Draw frames of a sequence along the columns, decode them and compare with the truth."""
    per_axis = dict(spec.options)
    if spec.preset == "dense":
        plain = 2 * bool(per_axis.get("plain"))  # white and black, once for both axes
        per_axis["frames"] = (per_axis.get("frames", 28) - plain) // 2 + plain
    patterns = SequenceSpec(spec.preset, {**per_axis, "axes": "x"}).patterns(size)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(float)
    t = x / (WIDTH - 1)
    margin = min(4.0, size[0] / 8)
    truth = margin + (size[0] - 1 - 2 * margin) * t + 0.5 * np.sin(y / 3.1) + 0.02 * y
    rng = np.random.default_rng(seed)
    images = [_frame(pattern, truth, size[0], light, rng) for pattern in patterns]
    phase = decode(patterns, images, lines=size)
    good = np.isfinite(phase.u)
    error = (phase.u - truth)[good]
    period = finest_steps(patterns)[0]
    gross = np.abs(error) > (GROSS * period if period else 2.0)
    rms = float(np.sqrt(np.mean(np.square(error[~gross])))) if (~gross).any() else None
    whole = spec.patterns(size)
    return PlannedSequence(
        spec.preset or "",
        dict(spec.options),
        len(whole),
        rms,
        float(gross.mean()) if good.any() else 0.0,
        float(good.mean()),
        len(whole) * light.frame_ms / 1000,
        shows_grey(whole),
    )


def rig_light(project: Project, preflight: Path | None = None) -> RigLight:
    """Find what is known of a rig's light, and say from where."""
    light, said = RigLight(), []
    for path in reversed(project.captures):
        try:
            capture = read_capture(path, project).series[0]  # of the first camera and projector
            light, said = _from_capture(capture, light), [f"contrast, noise and blur from the capture {capture.name}"]
            break
        except (InputError, _UnsuitableError):
            continue
    if preflight is not None:
        try:
            findings = {f["check"]: f.get("figures", {}) for f in json.loads(text_of(preflight))["findings"]}
            settle = findings["settle"]
            light = replace(light, frame_ms=float(settle["settle_ms"]) + float(settle.get("image_ms", 0.0)))
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InputError(preflight, f"not what preflight writes ({error})", "give its --json file") from error
        said.append(f"time a frame from {preflight.name}")
    if not said or "contrast" not in said[0]:
        said.insert(0, "contrast, noise and blur assumed: there is no capture with white, black and fine stripes")
    if preflight is None:
        said.append(f"time a frame assumed: {light.frame_ms:g} ms")
    return replace(light, known_from=tuple(said))


class _UnsuitableError(Exception):
    """A capture that does not tell the light."""


def _from_capture(capture: Capture, light: RigLight) -> RigLight:
    levels = [level_of(frame.pattern) for frame in capture.frames]
    patterns = [frame.pattern for frame in capture.frames]
    if 1 not in levels or 0 not in levels or not finest_steps(patterns, "x")[1]:
        raise _UnsuitableError
    images = list(iterate_images(capture))
    white, black = (images[levels.index(level)].astype(float) for level in (1, 0))
    span = white - black
    lit = span > 0.5 * np.quantile(span, 0.98)
    usual = float(np.median(span[lit]))
    squares = [_blur(patterns, images, axis, lit, usual) for axis in ("x", "y")]
    known = [square for square in squares if square is not None]
    blur = sqrt(sum(known) / len(known)) if known else light.blur_lines
    inner = lit[:, 1:-1]
    variances, means = [], []
    for image in (white, black):
        residual, mean = spatial_residual(image.astype(np.float32))
        square = np.square(residual[inner])  # whole grey values: their median would be one of few numbers
        variances.append(float(np.mean(square[square < OUTLIER * np.median(square)])))
        means.append(float(np.median(mean[inner])))
    shot = max(0.0, (variances[0] - variances[1]) / max(means[0] - means[1], 1e-9))
    dark = max(variances[1] - shot * means[1], 1 / 12 - shot * means[1])
    bits, ambient = 8 if images[0].itemsize == 1 else 16, float(np.median(black[lit]))
    contrast = _usual(span[lit], dark + shot * ambient, shot / 2)
    return replace(light, contrast=contrast, ambient=ambient, dark=dark, shot=shot, blur_lines=blur, bits=bits)


def _blur(
    patterns: Sequence[Pattern], images: Sequence[NDArray[Any]], axis: Axis, lit: NDArray[np.bool_], contrast: float
) -> float | None:
    """Variance of an axis' blur in lines², by what is left of its finest steps; None where that tells little."""
    period, steps = finest_steps(patterns, axis)
    if not steps or period > 8:
        return None
    fine = np.stack([images[i].astype(float) for i in steps])[:, lit]
    shifts = np.exp(1j * np.array([getattr(patterns[i], "shift_rad", 0.0) for i in steps]))
    swing = float(np.median(np.abs(2 * np.mean(fine * shifts[:, None], axis=0))))
    sharp = 2 / pi * contrast  # of a square wave
    if grey_reason(patterns[steps[0]]):
        sharp = 0.5 * contrast * float(np.sinc(1 / period))
    return log(max(sharp / max(swing, 1e-9), 1.0)) / 2 * (period / pi) ** 2


def _usual(contrast: Array, still: float, growing: float) -> float:
    """Contrast whose noise in lines, ``(still + growing * contrast) / contrast²``, is the r.m.s. of all pixels'."""
    still = max(still, 1 / 12)
    mean = float(np.mean(still / np.square(contrast) + growing / contrast))
    return 2 * still / (sqrt(growing**2 + 4 * still * mean) - growing)


def _frame(pattern: Pattern, place: Array, lines: int, light: RigLight, rng: np.random.Generator) -> NDArray[Any]:
    """What a camera sees of lines that are boxes, blurred by a Gaussian, with noise and whole grey values."""
    fine = np.arange(-4 * 16, (lines + 4) * 16) / 16
    shown = brightness(pattern, np.arange(lines))
    if axis_of(pattern) is None:
        seen = np.full(place.shape, shown[0])
    else:
        steps = np.diff(np.concatenate([[0.0], shown, [0.0]]))
        soft, edges = np.zeros_like(fine), np.flatnonzero(steps)
        for i in edges:
            low, high = np.searchsorted(fine, (i - 0.5 - 6 * light.blur_lines, i - 0.5 + 6 * light.blur_lines))
            soft[low:high] += steps[i] * 0.5 * (1 + erf((fine[low:high] - i + 0.5) / (sqrt(2) * light.blur_lines)))
            soft[high:] += steps[i]
        seen = np.interp(place, fine, soft)
    grey = light.ambient + light.contrast * seen
    grey = grey + rng.normal(size=grey.shape) * np.sqrt(np.maximum(light.dark + light.shot * grey, 1 / 12))
    kind = np.uint8 if light.bits <= 8 else np.uint16
    return np.clip(np.rint(grey), 0, 2**light.bits - 1).astype(kind)


def _best(name: str, frames: int, size: tuple[int, int], light: RigLight) -> PlannedSequence | None:
    """See what the best of a family gives with so many frames; None where there are too few."""
    spec = _chosen(name, frames, size, light)
    try:
        return None if spec is None else expected(spec, size, light)
    except InputError:  # so short words are the same at several lines
        return None


def _reaching(
    sigma_lines: float, usual: PlannedSequence, most: int, size: tuple[int, int], light: RigLight
) -> PlannedSequence:
    """Find the fewest frames of a family that reach a sigma reliably; the nearest to it where none do."""
    tries, known = [min(most, usual.frames)], usual.sigma_lines
    if known is not None:
        less = sigma_lines / known * _relative(usual.preset, usual.frames, size, light)
        enough = (n for n in range(FEWEST, most) if _relative(usual.preset, n, size, light) <= less)
        tries = [next(enough, most)]
    while tries[-1] < most:
        tries.append(min(most, tries[-1] + max(2, tries[-1] // 8)))
    found = usual
    for frames in tries:
        planned = _best(usual.preset, frames, size, light)
        if planned is not None and planned.reliable and planned.sigma_lines is not None:
            found = planned
            if planned.sigma_lines <= NEAR * sigma_lines:
                break
    return found


def _relative(name: str, frames: int, size: tuple[int, int], light: RigLight) -> float:
    """Noise of the best of a family, to be compared with that of other numbers of frames; infinite for too few."""
    if name == "dense":  # words as short as that repeat
        return sqrt(1 / frames) if frames / 2 >= WORD * log2(max(size)) else inf
    spec = _chosen(name, frames, size, light)
    return inf if spec is None else _noise(spec.patterns(size), light)


def _chosen(name: str, frames: int, size: tuple[int, int], light: RigLight) -> SequenceSpec | None:
    """Choose among the options of a family that the frames allow; None where there are too few."""
    if name in ONE:
        return _choices(name, frames, size)[0]
    choices = [spec for spec in _choices(name, frames, size) if len(spec.patterns(size)) <= frames]
    return min(choices, key=lambda spec: _noise(spec.patterns(size), light), default=None)


def _choices(name: str, frames: int, size: tuple[int, int]) -> Sequence[SequenceSpec]:
    if name == "paper":
        return [SequenceSpec(name)]
    if name == "dense":
        return [SequenceSpec(name, {"frames": frames - frames % 2})]  # half of them an axis
    if name == "two-period":
        return [SequenceSpec(name, {"steps": n}) for n in range(3, (frames - 2) // 4 + 1)][-1:]
    specs = []
    for period in PERIODS:
        least = len(SequenceSpec(name, {"period": period, "steps": 3}).patterns(size))
        each = len(SequenceSpec(name, {"period": period, "steps": 4}).patterns(size)) - least
        count = 3 + (frames - least) // max(each, 1)
        if count >= 3:
            specs.append(SequenceSpec(name, {"period": period, "steps": count}))
    return specs


def _noise(patterns: Sequence[Pattern], light: RigLight) -> float:
    """Noise in lines by the closed form of the finest period's steps: good enough to choose a period."""
    period, steps = finest_steps(patterns, "x")
    if not steps:
        return 0.0
    left = 0.5 * float(np.sinc(1 / period)) * exp(-2 * (pi * light.blur_lines / period) ** 2)
    return period / (2 * pi) * sqrt(2 / len(steps)) / max(left, 1e-6)


def plan_figures(light: RigLight, planned: Sequence[PlannedSequence]) -> dict[str, Any]:
    """Give what `--json` writes."""
    rows = [{**asdict(p), "sequence": p.words} for p in planned]
    return {"rig": {**asdict(light), "known_from": list(light.known_from)}, "sequences": rows}
