"""Deviations from planes: form apart from noise, angles, one method against the other."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise, product
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from core.model import Array, Concern, Floats, PlaneEvaluation
from core.numerics import median_of, sigma_by_median

WINDOW = 40.0  # the low pass's standard deviation is the image's larger side over this
SMOOTH_SIDES = 4.0  # of the squares that tell the low pass lie in its standard deviation
LEAST_COVERED, LEAST_SEEN = 0.6, 0.2  # share of the low pass's weight that must lie on the plane; at rims
DEGREE, FITTED = 4, 4000  # of the surface that calibrations bend a plane to; pixels that tell it
DOUBTFUL_RATIO, FAILED_RATIO = 1.5, 3.0  # r.m.s. over what the noise predicts
LEAST_RATIO = 0.4  # sharp square fringes of 8 lines reach 0.56, whose sigmas contain what they err alike
SHAPED = 0.3  # of the predicted r.m.s. may be form; of 60 sound planes on twelve rigs at most 0.11
GROSS = 6.0  # predicted sigmas beyond which a deviation is no noise
CORE, BEYOND_CORE = 2.0, 0.0455  # sigmas, and the share of noise beyond them
OWN_ANGLE_DEG, MOST_ANGLE_DEG = 1.0, 5.0  # angles between planes against angle_deg
APART = 0.01  # distance between the planes of two methods, over their distance from the camera
MOST_APART = 0.05


class Form(NamedTuple):
    """What the low pass leaves of the deviations: peak to valley, µm, r.m.s., mm; and the r.m.s. of the rest, mm.

    Nothing where no window is covered well enough.
    """

    pv_um: float | None
    rms_mm: float
    rest_mm: float


def form_of(deviation_mm: Floats) -> Form:
    """Low-pass the deviations from a plane, shape (H, W), NaN where there is no point."""
    valid = np.isfinite(deviation_mm)
    rows, cols = (np.flatnonzero(valid.any(axis=axis)) for axis in (1, 0))
    if valid.sum() < 50:
        return Form(None, 0.0, float(np.sqrt(np.mean(deviation_mm[valid] ** 2))) if len(rows) else 0.0)
    part = deviation_mm[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
    valid = np.isfinite(part)
    sigma = low_pass_px(deviation_mm.shape)
    weight = _blurred(valid.astype(np.float32), sigma)
    # towards the rim a mean over the window lags behind what rises there: that is not scatter
    left = part - _surface(part, valid)
    low = _blurred(_capped(left, valid), sigma) / np.maximum(weight, LEAST_SEEN)
    rest = float(np.sqrt(np.mean(np.square((left - np.where(weight > LEAST_SEEN, low, 0))[valid]))))
    use = valid & (weight > LEAST_COVERED)
    if not use.any():
        return Form(None, 0.0, rest)
    form = _blurred(_capped(part, valid), sigma)[use] / weight[use]
    return Form(float(1e3 * np.ptp(form)), float(np.sqrt(np.mean(form**2))), rest)


def _blurred(values: Floats, sigma: float) -> Floats:
    """Blur by a Gaussian, with zeros beyond the rim: between means over squares, which takes a tenth of the time.

    Squares and interpolation add a quarter of a side's square to the variance.
    """
    side = max(1, int(sigma / SMOOTH_SIDES))
    high, wide = (-(-n // side) for n in values.shape)
    padded = np.zeros((high * side, wide * side), np.float32)
    padded[: values.shape[0], : values.shape[1]] = values
    means = cv2.resize(padded, (wide, high), interpolation=cv2.INTER_AREA)
    rest = float(np.sqrt(sigma**2 - (side**2 / 4 if side > 1 else 0)))
    means = cv2.GaussianBlur(means, (0, 0), rest / side, borderType=cv2.BORDER_CONSTANT)
    found = cv2.resize(means, (wide * side, high * side), interpolation=cv2.INTER_LINEAR)
    return np.asarray(found[: values.shape[0], : values.shape[1]], np.float32)


def _capped(values: NDArray[np.floating], valid: NDArray[np.bool_]) -> Floats:
    """Values, 0 where there are none: single gross errors are not form."""
    most = 8 * sigma_by_median(values[valid])
    return np.clip(np.where(valid, values, 0.0), -most, most).astype(np.float32)


def _surface(values: Floats, valid: NDArray[np.bool_]) -> Floats:
    """Polynomial of the fourth degree through values, shape (H, W)."""
    y, x = (np.linspace(-1, 1, n)[:, None] ** np.arange(DEGREE + 1) for n in values.shape)
    i, k = np.nonzero(np.add.outer(np.arange(DEGREE + 1), np.arange(DEGREE + 1)) <= DEGREE)
    row, col = (at[:: max(1, len(at) // FITTED)] for at in np.nonzero(valid))
    A, seen = y[row][:, i] * x[col][:, k], values[row, col]
    fitted, terms = np.zeros(len(seen)), np.zeros((DEGREE + 1, DEGREE + 1))
    for _ in range(4):
        fitted = fitted + _capped(seen - fitted, np.ones(len(seen), bool))
        terms[i, k] = np.linalg.lstsq(A, fitted, rcond=None)[0]
        fitted = A @ terms[i, k]
    return (y @ terms @ x.T).astype(np.float32)


def low_pass_px(shape: tuple[int, ...]) -> float:
    """Standard deviation of the low pass's Gaussian for an image of this shape, px."""
    return max(shape[:2]) / WINDOW


def plane_concerns(e: PlaneEvaluation, form: Form, calibration_rms_mm: float = 0.0) -> list[Concern]:
    """Hold the deviations of one plane against what their noise and the calibration's sigma predict.

    Noise of independent pixels passes the low pass by ``1 / (2 σ √π)``; ten times as much, for neighbouring pixels
    share some of theirs, and three sigmas of the calibration, is form that needs no explanation.
    """
    where = f"{e.capture}, {e.method}"
    beside = []
    if e.elsewhere:
        share = f"{where}: {e.elsewhere} points lie on other surfaces than the plane of the {e.n} others"
        beside.append(Concern("doubtful", f"{share}: left out; check that they do not belong to the plane-table"))
    if e.predicted_rms_mm is None or not e.predicted_rms_mm > 0:
        return beside
    told = f"{where}: deviations are {e.rms_mm / e.predicted_rms_mm:.3g} times what the noise predicts"
    told += f" ({e.rms_mm:.3g} mm r.m.s.)"
    shape = f"{1e3 * form.rms_mm:.0f} µm r.m.s. of it is form, {form.pv_um or 0:.0f} µm peak to valley"
    # what the low pass takes away is no matter of the calibration, however uncertain that is
    scatter = form.rest_mm / e.predicted_rms_mm
    excess = e.rms_mm / float(np.hypot(DOUBTFUL_RATIO * e.predicted_rms_mm, 3 * calibration_rms_mm))
    if max(excess, scatter / DOUBTFUL_RATIO) > 1:
        cause = (
            "the calibration does not hold for this capture (rig moved, patterns or rig described wrongly), or it "
            "shows no plane"
        )
        if form.rms_mm < 0.5 * e.rms_mm:
            cause = _scattered(e)
        failed = max(excess, scatter / DOUBTFUL_RATIO) > FAILED_RATIO / DOUBTFUL_RATIO
        return [Concern("failed" if failed else "doubtful", f"{told}; {shape}: {cause}"), *beside]
    if e.rms_mm * (1 + 3 / np.sqrt(2 * e.n)) < LEAST_RATIO * e.predicted_rms_mm:
        text = (
            f"{told}: its sigmas are too large, as frames that contradict each other or a gamma of the camera's make "
            "them; record frames as the sensor gives them"
        )
        return [Concern("doubtful", text), *beside]
    passed = 10 * e.predicted_rms_mm / (2 * np.sqrt(np.pi) * low_pass_px(e.deviation_mm.shape))
    limit = max(SHAPED * e.predicted_rms_mm, float(np.hypot(passed, 3 * calibration_rms_mm)))
    if form.rms_mm > limit:
        text = (
            f"{where}: {shape}, more than noise and calibration explain: is the plane flat, does the lens model hold?"
        )
        return [Concern("doubtful", text), *beside]
    return beside


def is_noise(e: PlaneEvaluation, form: Form) -> bool:
    """Whether deviations and form are no more than the predicted noise leaves."""
    predicted = e.predicted_rms_mm or np.inf
    return e.rms_mm < DOUBTFUL_RATIO * predicted and form.rms_mm <= SHAPED * predicted


def plane_words(e: PlaneEvaluation) -> tuple[str, ...]:
    """What to say of a plane that nothing speaks against: whether its noise or its calibration explains it."""
    if not e.predicted_rms_mm:
        return ()
    source = "noise dominates" if e.noisy else "within three sigmas of the calibration"
    return (f"{source}: {e.rms_mm / e.predicted_rms_mm:.2f} times what the noise predicts",)


def _scattered(e: PlaneEvaluation) -> str:
    """Why deviations scatter more than their noise: a few gross errors, or noise that is told too small."""
    mapped = e.sigma_mm.shape == e.deviation_mm.shape
    off = np.abs(e.deviation_mm / (e.sigma_mm if mapped else np.float64(e.predicted_rms_mm or np.nan)))
    off = off[np.isfinite(off)]
    gross = int(np.count_nonzero(off > GROSS))
    if gross and np.mean(off > CORE) < 2 * BEYOND_CORE:
        return (
            f"gross errors, not form: {gross} of {len(off)} pixels are more than {GROSS:g} sigmas off, the others are "
            "as their noise says: decoding is wrong in places, or the plane is not clean, or ends within the light"
        )
    return "gross errors, not form: decoding is wrong in places, or the plane is not clean"


def pair_concerns(evaluations: Sequence[PlaneEvaluation]) -> list[Concern]:
    """Hold the planes against each other: angles within a method, places between methods."""
    return [*_angles(evaluations), *_methods(evaluations)]


def _angles(evaluations: Sequence[PlaneEvaluation]) -> list[Concern]:
    """Angles between planes of one method against angle_deg.

    Tilts may be about any axes: between two planes the angle is at most the sum of theirs and at least the difference.
    Signs are judged only where all normals lie in one plane, and three or more others agree about its axis or some
    angle is negative: amounts need no signs.
    """
    method = evaluations[0].method if evaluations else None
    planes = [e for e in evaluations if e.method == method and e.angle_deg is not None and np.isfinite(e.plane).all()]
    if len(planes) < 2:
        return []
    normals = np.array([e.plane[:3] for e in planes])
    given = np.array([e.angle_deg for e in planes], np.float64)
    found = np.degrees(np.arccos(np.clip(normals @ normals.T, -1, 1)))
    tilt = np.abs(given)
    least, most = np.abs(np.subtract.outer(tilt, tilt)), np.add.outer(tilt, tilt)
    misfit = np.maximum(np.maximum(least - found, found - most), 0)
    np.fill_diagonal(misfit, 0)
    odd: list[int] = []
    sign = False
    if misfit.max() <= OWN_ANGLE_DEG:
        odd, off, sign = _against_axis(normals, given)
        if not odd:
            return []
        misfit[k := odd[0]] = off
    else:
        k = int(np.argmax(np.median(misfit, axis=1) if len(planes) > 2 else misfit.max(axis=1)))
    told = ", ".join(f"{off:.1f}°" for off in np.delete(misfit[k], k)[:4])
    e = planes[k]
    about = e.capture
    text = f"{about}: angle_deg {e.angle_deg:g} differs from the angles to the other planes by {told}: "
    pair = np.flatnonzero((misfit > OWN_ANGLE_DEG).any(axis=1))
    if len(pair) == 2 and not sign:  # one angle, which tells of neither
        a, b = (planes[i].capture for i in pair)
        about, text = "", f"{a} and {b}: the angle between them differs from angle_deg by {misfit.max():.1f}°: "
    if len(odd) > 1:
        names = " or ".join(planes[i].capture for i in odd)
        about, text = "", f"{names}: all planes were turned about one axis, by other angles: "
    text += (
        "the sign of angle_deg is reversed"
        if sign
        else "correct angle_deg, or the plane-table was not turned as it says"
    )
    return [Concern("failed" if misfit.max() > MOST_ANGLE_DEG else "doubtful", text, about)]


def _against_axis(normals: Array, given: Array) -> tuple[list[int], float, bool]:
    """Find planes of which one contradicts the axis that the others agree about; how far off, and is it the sign."""
    _, _, (first, second, axis) = np.linalg.svd(normals)
    if len(given) < 3 or np.degrees(np.abs(normals @ axis)).max() > OWN_ANGLE_DEG:
        return [], 0.0, False
    turned = np.degrees(np.arctan2(normals @ second, normals @ first))
    turned = (turned - turned[0] + 180) % 360 - 180
    odd = []
    for k, way in product(range(len(given)), (1, -1)):
        zero = turned - way * given
        others, angles = np.delete(zero, k), np.delete(given, k)
        off = abs(float(zero[k]) - median_of(others))
        if np.ptp(others) <= OWN_ANGLE_DEG and np.ptp(angles) > MOST_ANGLE_DEG and off > MOST_ANGLE_DEG:
            odd.append((k, off, abs(off - 2 * abs(given[k])) <= OWN_ANGLE_DEG))
    if len(given) == 3:  # two agree about some axis by chance: only a sign can be told
        said = min(float(np.ptp(turned - way * given)) for way in (1, -1))
        signs = [k for k, _, sign in odd if sign] if (given < 0).any() and said > MOST_ANGLE_DEG else []
        return signs, said, True
    return ([odd[0][0]], *odd[0][1:]) if len(odd) == 1 else ([], 0.0, False)


def _methods(evaluations: Sequence[PlaneEvaluation]) -> list[Concern]:
    """Distance of the same plane by two methods, over its distance from the camera."""
    on_axis: dict[str, dict[str, float]] = {}
    for e in evaluations:
        on_axis.setdefault(e.method, {})[e.capture] = _on_axis(e.plane)
    concerns = []
    for (first, a), (second, b) in pairwise(on_axis.items()):
        names = [name for name in a if name in b]
        middle = median_of([b[name] / a[name] - 1 for name in names]) if names else 0.0
        if abs(middle) > APART:
            text = (
                f"the planes of both methods are {abs(middle):.1%} of their distance apart ({', '.join(names[:4])}), "
                f"{'farther' if middle > 0 else 'nearer'} by {second} than by {first}: scale bar, board or z_mm is "
                f"wrong, or the camera of the {second} method is poorly known"
            )
            concerns.append(Concern("failed" if abs(middle) > MOST_APART else "doubtful", text))
    return concerns


def _on_axis(plane: Array) -> float:
    """Distance at which the camera's axis meets a plane."""
    return float(abs(plane[3]) / max(abs(float(plane[2])), 1e-6))
