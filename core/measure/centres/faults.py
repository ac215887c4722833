"""Dots that must not be measured, and why: cut, covered, lit in part, disturbed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from core.measure.centres.light import CUT
from core.measure.centres.profile import Profiles
from core.measure.centres.rays import Rays
from core.model import Array, Floats
from core.numerics import MEDIAN_OF_NORMAL, nearest, quantile_of, row_median, sigma_by_median

EVEN = 0.06  # deviations in units of the contrast that a clean dot may show inside and around it
UNLIT_SHARE = 0.01  # of an image's pixels, at least, show how dark the unlit board is
LIT = 0.45  # share of the dot's usual modulation below which a part of it counts as unlit


def shape_faults(
    image: Floats, rays: Rays, profile: Profiles, size: Array, noise: tuple[float, float], cut: NDArray[np.bool_]
) -> list[str]:
    """Say for every bright dot, (m,), why its centroid cannot be trusted; empty where it can.

    Rays start from the centroids; `size` is the diameter over the nominal one, `noise` that of `noise_model`; `cut` are
    `half_lit`.
    """
    uv, minor = rays.centre, rays.minor
    with np.errstate(all="ignore"):
        sigma = np.sqrt(np.maximum(noise[0] + noise[1] * (profile.plateau + profile.plane[:, 0]) / 2, 0.0))
        relative = sigma / profile.contrast  # noise in units of the contrast
        # an edge of blur s falls by 0.4 contrasts per s; three rays were averaged
        edge_px = relative * np.maximum(profile.blur, 0.5) / 0.4 / np.sqrt(3)
        scale, spread = _scale_among_neighbours(uv, size * profile.contour[:, 0])
        tilt = np.hypot(profile.contour[:, 3], profile.contour[:, 4]) / profile.contour[:, 0]
    faults = [""] * len(uv)

    def mark(bad: NDArray[np.bool_], text: str, *values: Array) -> None:
        for k in np.flatnonzero(bad).tolist():
            faults[k] = faults[k] or text.format(*(v[k] for v in values))

    mark(_beyond_border(image, rays, profile.window), "cut by the image border")
    mark(cut, CUT)
    mark(~(relative < 0.2), "no contrast: {:.1f} grey values", profile.contrast)
    mark(~np.isfinite(profile.roughness), "its contour is open: covered, lit in part, or touched by something bright")
    limit = 0.07 + 0.008 * minor + 2.0 * edge_px
    mark(
        ~(profile.roughness < limit),
        "its contour is {:.2f} px off an ellipse: covered or lit in part",
        profile.roughness,
    )
    limit = 0.03 + 0.005 * minor + 1.0 * edge_px
    mark(~(profile.outside < EVEN + 4.0 * relative), "something bright touches it")
    mark(
        ~(profile.off_centre < limit),
        "unevenly lit or disturbed: centroid {:.2f} px off its contour",
        profile.off_centre,
    )
    mark(~(np.abs(np.log(scale)) < np.clip(6.0 * spread, 0.05, 0.15)), "its size is {:.2f} of its neighbours'", scale)
    mark(~(tilt < 0.12 + 0.5 / minor), "it is not an ellipse of the expected shape")
    mark(~(profile.inside < EVEN + 4.0 * relative), "it is uneven inside: covered, lit in part, or glare")
    return faults


def _scale_among_neighbours(uv: Array, size: Array) -> tuple[Array, float]:
    """Sizes (m,) over the median of the nine nearest dots, and the robust spread of their logarithms."""
    place = np.where(np.isfinite(uv), uv, -1e6)
    near = nearest(place, min(9, len(uv)))
    scale = size / row_median(np.where(size > 0, size, np.nan)[near])
    return scale, sigma_by_median(np.log(scale))


def _beyond_border(image: Floats, rays: Rays, window: Array) -> NDArray[np.bool_]:
    """Whether the window of a dot reaches out of the image."""
    half = window[:, None] * np.linalg.norm(rays.ellipse, axis=2)
    limit = np.array([image.shape[1] - 1, image.shape[0] - 1])
    return ~np.all((rays.centre - half >= 0) & (rays.centre + half <= limit), axis=1)


def half_lit(image: Floats, modulation: Floats, rays: Rays, profile: Profiles, dark: bool) -> NDArray[np.bool_]:
    """Whether modulation or brightness drops on one side of a dot as it does where light ends.

    Looked at inside bright dots, at the foot of their edge and on the board around them; round dark ones, which
    modulate little themselves. Captures without modulation (nothing decoded) say less about the light.
    """
    around = profile.window[:, None] + np.array([0.0, 0.15, 0.3, 0.45])
    if dark:
        return _one_sided(rays.sample(modulation, around[:, :2]))[0]
    inside, scatter = _one_sided(rays.sample(modulation, np.array([0.3, 0.6, 0.8])))
    foot = (profile.contour[:, 0] * (1.0 + 0.4 * profile.blur / rays.minor))[:, None]
    # a black board hardly decodes, but it is brighter in the light than in the dark
    board = rays.sample(image, around) - np.float32(quantile_of(image[::4, ::4], UNLIT_SHARE))
    dim = np.nan_to_num(board).mean(axis=2)
    unlit = dim.min(axis=1) < LIT * np.median(dim)  # beside a bright speck the board is dark only by comparison
    return inside | _one_sided(rays.sample(modulation, foot), scatter)[0] | (unlit & _one_sided(board, most=True)[0])


def _one_sided(value: Floats, scatter: Array | None = None, *, most: bool = False) -> tuple[NDArray[np.bool_], Array]:
    """Whether samples (m, rays, k) sink far below the usual on neighbouring rays, and the rays' robust scatter.

    `most`: the dark may lie on most rays, so that the usual is what the brighter quarter has.
    """
    along = np.nan_to_num(value).mean(axis=2)
    along = (along + np.roll(along, 1, axis=1) + np.roll(along, -1, axis=1)) / 3
    usual = np.quantile(along, 0.8 if most else 0.5, axis=1)
    # between rays whose means share none; a half in the dark raises only the few differences across its edge
    apart = np.roll(along, 3, axis=1) if most else usual[:, None]
    spread = np.median(np.abs(along - apart), axis=1) / MEDIAN_OF_NORMAL / (np.sqrt(2) if most else 1.0)
    least = 6.0 * (spread if scatter is None else scatter)
    sunk = usual - along.min(axis=1)
    return (sunk > (1 - LIT) * usual) & (sunk > least) & (usual > 0), spread
