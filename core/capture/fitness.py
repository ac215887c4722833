"""What images tell about a rig: each judgement gives a `Finding`, from arrays alone."""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, degrees

import numpy as np
from numpy.typing import NDArray

from core.model import Array, Plan
from core.model.finding import Finding
from core.numerics import quantile_of
from core.patterns import axis_of, finest_steps, level_of
from core.verify.identity import coordinates, identity
from core.verify.quality import LIT, Sampled

CURVED = 0.02  # of full light; a phase of four steps is then off by less than a hundredth of its period
TILE = 16  # px, of the pictures
SOFT = 0.15  # modulation of the finest stripes against white and black, below which noise rules


def linearity_of_levels(shown: Array, images: Sequence[Array]) -> Finding:
    """Judge images (H, W) of even light of rising levels (n,), black first and white last."""
    lit = lit_pixels(images[-1], images[0])
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
    lit = lit_pixels(white, black)
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
    lit = lit_pixels(white, black)
    picture = _tiles(np.where(lit, white / full, np.nan))
    if lit.mean() < LIT:
        text = "the projector lights too little of the image: open the aperture or expose ten times as long"
        return Finding("exposure", "bad", text, {"lit": float(lit.mean()), "factor": 10.0}, picture=picture)
    top = quantile_of(white[lit], 0.99) / full
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
    levels = [level_of(p) for p in plan.shots]
    white, black = (images[levels.index(level)] for level in (1, 0))
    finest, steps = finest_steps(plan.shots)
    if not steps:
        return Finding("focus", "good", "the sequence has no stripes to judge the focus by")
    ratio = np.full(white.shape, np.inf)
    for axis in ("x", "y"):
        fine = [images[i] for i in steps if axis_of(plan.shots[i]) == axis]
        if fine:
            swing = np.ptp(np.stack(fine), axis=0)
            ratio = np.minimum(ratio, swing / np.maximum(white - black, 1e-9))
    picture = _tiles(np.where(lit_pixels(white, black), ratio, np.nan))
    seen = picture[np.isfinite(picture)]
    if seen.size == 0:
        return Finding("focus", "bad", "too little of the image is lit to judge the focus", picture=picture)
    middle, worst = float(np.median(seen)), quantile_of(seen, 0.05)
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

    For each depth of the plate its phase steps of the finest period, where the projector lights it, all of one shape;
    `noise` is the sigma of a grey value.
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


def lit_pixels(white: Array, black: Array) -> NDArray[np.bool_]:
    """Where the projector's light arrives: a fifth of what the brightest places get."""
    light = white - black
    return light > max(0.2 * quantile_of(light, 0.99), 3.0)


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
