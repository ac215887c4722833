"""What `orient` says: figures for `--json`, and sentences for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from core.digits import fixed
from core.figures import picked
from core.model import Array, DriftPoint, Figures, RigMotion

WARNING, ACTION = 1.96, 3.29  # sigmas: limits of the chart of one element, passed by one in 20 and in 1000 at rest


def motions_figures(motions: list[RigMotion], untold: Mapping[tuple[str, str], str]) -> Figures:
    """What `orient --json` writes: of one pair its figures, of several those of each under "pairs".

    The p of all together is the least of them times their number (Bonferroni).
    """
    if len(motions) == 1 and not untold:
        return motion_figures(motions[0])
    return {
        "capture": motions[0].capture,
        "moved": any(motion.moved for motion in motions),
        "p": min(1.0, len(motions) * min(motion.p for motion in motions)),
        "pairs": {f"{motion.camera}-{motion.projector}": motion_figures(motion) for motion in motions},
        "untold": {f"{camera}-{projector}": because for (camera, projector), because in untold.items()},
    }


def motion_figures(motion: RigMotion) -> Figures:
    """Give the figures of one pair."""
    sigma = motion.covariance.diagonal() ** 0.5
    return {
        **picked(motion, "capture camera projector moved p"),
        "rotation_urad": [float(x) for x in 1e6 * motion.rotation_rad],
        "sigma_urad": [float(x) for x in 1e6 * sigma[:3]],
        "shift_mm": [float(x) for x in motion.shift_mm],
        "sigma_mm": [float(x) for x in sigma[3:]],
        **picked(motion, "unobserved depth_change_mm depth_sigma_mm pixels points stretch"),
        **picked(motion, "residual_rms corrected_rms"),
        "lengths": [
            {
                "kind": known.kind,
                "length_mm": known.length_mm,
                "sigma_mm": known.sigma_mm,
                "calibrated_mm": before,
                "corrected_mm": after,
            }
            for known, (before, after) in zip(motion.lengths, motion.lengths_mm, strict=True)
        ],
        "interior_change": _interior_figures(motion) if motion.lengths or motion.points else {},
    }


def motion_words(motion: RigMotion) -> list[str]:
    """The same in sentences for people."""
    figures = motion_figures(motion)

    def three(key: str, sigma: str, scale: float = 1.0) -> str:
        return ", ".join(
            f"{axis} {scale * value:+.1f} ± {scale * s:.1f}"
            for axis, value, s in zip("XYZ", figures[key], figures[sigma], strict=True)
        )

    by = f"{motion.points} known points" if motion.points else f"{len(motion.lengths)} known length(s)"
    known = bool(motion.lengths or motion.points)
    sure = f"p = {motion.p:.2g}, {motion.pixels} pixels{f', {by}' if known else ''}"
    projector = "the projector" if motion.projector == "projector" else motion.projector
    camera = "the camera" if motion.camera == "camera" else motion.camera
    sign = "" if motion.moved else "no sign that "
    inner = " or an interior orientation has changed" if known else ""
    lines = [f"{motion.capture}: {sign}{projector} has moved against {camera}{inner} ({sure})"]
    if not motion.moved and not known:
        return lines
    if not motion.pair.camera.sigma.any():
        lines.append("the calibration tells no sigmas: its own errors count as movement")
    lines += [
        f"turned, µrad: {three('rotation_urad', 'sigma_urad')}",
        f"shifted{'' if known else ' across the base'}, µm: {three('shift_mm', 'sigma_mm', 1e3)}",
        f"depth changes by {fixed(motion.depth_change_mm, 3, '+')} mm (median); its sigma is then "
        f"{fixed(motion.depth_sigma_mm, 3)} mm",
    ]
    if motion.stretch > 1:
        lines.append(f"more has drifted than rigs usually do: {motion.stretch:.1f} times as much was allowed for")
    if not known:
        return [*lines, f"shape corrected, scale and distance not: {' and '.join(motion.unobserved)} cannot be seen"]
    for device, values in figures["interior_change"].items():
        changes = (f"{key[:-3]} {1e3 * v['change']:+.1f} ± {1e3 * v['sigma']:.1f}" for key, v in values.items())
        lines.append(f"{device}, changes in µm: {', '.join(changes)}")
    for length, (before, after) in zip(motion.lengths, motion.lengths_mm, strict=True):
        ends = " to ".join(f"{u:.1f},{v:.1f}" for u, v, _ in length.ends)
        was, now, known_mm = (fixed(mm, 4) for mm in (before, after, length.length_mm))
        lines.append(f"length {ends}: {was} mm as calibrated, {now} corrected, known {known_mm}")
    apart = f"; hardly told apart: {', '.join(motion.unobserved)}" if motion.unobserved else ""
    return [*lines, f"shape, scale and distance corrected, by {by}{apart}"]


def drift_figures(charts: Mapping[tuple[str, str], Sequence[DriftPoint]]) -> Figures:
    """What `orient --json` writes of all captures."""
    return {
        "trend": {
            f"{camera}-{projector}": [_point_figures(p) for p in chart] for (camera, projector), chart in charts.items()
        }
    }


def drift_words(charts: Mapping[tuple[str, str], Sequence[DriftPoint]]) -> list[str]:
    """The same as a table for people."""
    if not charts:
        return ["no capture shows both projector coordinates of enough pixels"]
    lines = []
    for (camera, projector), chart in charts.items():
        width = max(len(p.capture) for p in chart)
        lines.append(f"{projector} against {camera}: drift from what earlier captures led to expect, and its sigma")
        lines.append(f"{'':{width}}  turned about X, Y, Z, µrad{'':17}shifted across the base, µm         p")
        for p in chart:
            scale = 1e6 * np.array([1, 1, 1, 1e-3, 1e-3])
            off = "  ".join(
                f"{d:+8.1f} ± {s:5.1f}" for d, s in zip(scale * (p.value - p.expected), scale * p.sigma, strict=True)
            )
            lines.append(
                f"{p.capture:{width}}  {off}  {p.p:8.2g}  {'' if p.state == 'steady' else p.state.upper()}".rstrip()
            )
        alarms = [p.capture for p in chart if p.state == "action"]
        lines.append(f"out of control: {', '.join(alarms)}" if alarms else "in control")
    return lines


def _point_figures(point: DriftPoint) -> Figures:
    def parts(values: Array) -> Figures:
        return {"rotation_urad": [1e6 * float(x) for x in values[:3]], "shift_mm": [float(x) for x in values[3:]]}

    limits = {name: parts(times * point.sigma) for name, times in (("warning", WARNING), ("action", ACTION))}
    return {
        "capture": point.capture,
        "state": point.state,
        "p": point.p,
        **parts(point.value),
        "mean": parts(point.expected),
        "sigma": parts(point.sigma),
        **{f"{name}_limit": limit for name, limit in limits.items()},
    }


def _interior_figures(motion: RigMotion) -> Figures:
    sigma, first, found = motion.pair.covariance.diagonal() ** 0.5, 0, {}
    for name, device in ((motion.camera, motion.pair.camera), (motion.projector, motion.pair.projector)):
        found[name] = {
            key: {"change": float(motion.change[first + i]), "sigma": float(sigma[first + i])}
            for i, key in enumerate(("c_mm", "x0_mm", "y0_mm"))
        }
        first += len(device.interior.vector)
    return found
