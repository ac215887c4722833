"""Holes, printed marks and straight edges: found in the evenly lit image, intersected with the measured surface.

The image tells edges to a hundredth of a pixel where the coded light ends or is drawn to the brighter side; the coded
light tells the surface beside them. A blurred edge, as curved as it is there, is fitted to all pixels along it, so that
the noise of single pixels gives its covariance. Inverse depth is a smooth function of the image's place over the ring
around a feature, linear for a plane, and carries the edge's rays to the surface.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.geometry import pixel_to_image, project
from core.measure.centres.steps import MOST_LEVERAGE, Lay, covariance, light_within, width_px
from core.measure.identity.blobs import connected_spots
from core.measure.outlines import FEATURES, LEAST_RING_PX, Edge, before_lens, checked_place
from core.model import AdjustedDevice, Array, Feature, Floats, PhaseMap, PointCloud
from core.numerics import distinct, polynomial, sigma_by_median

LENS_PX = 0.7  # blur by which the fit begins
REACH = 4.0  # blurs on either side of an edge whose pixels take part, and LEAST_REACH px at least
LEAST_REACH = 2.5
RING_PX, RING = 3.0, 0.6  # the surface is taken from so far off the edge, over a share of its size
GROSS, ROUGH = 5.0, 4.0  # standard deviations: of single points, and of all where the surface bends too much
SIDES, AROUND = ((1, 0), (-1, 0), (0, 1), (0, -1)), 0.1  # share of the ring's points that each side has at least
WITHIN_PX, MOSTLY = 1.0, 5.0  # inside a mark, whose surface is taken where it tells so many times more
FEWEST_PIXELS, FEWEST_POINTS = 25, 20
FEWEST_ALIKE = 0.25  # share of an edge's pixels that look like one; half do where a lit wall is seen through a hole
CLIPPED = 0.2  # share of the pixels about a feature, not all of whose light is known, that explains why none is found
PASSES = 3
MOST_MOVED = 0.25  # of its size that an edge may lie off where it was said to be
MOST_VAGUE_PX = 0.3  # standard deviation of a shape that is one
LEAST_RADIUS_PX, FLATTEST, UNEVEN = 2.5, 0.3, 0.1  # of what is found: radius, ratio of axes, area off an ellipse's
SURROUNDINGS, LEAST_CONTRAST = 6, 0.15  # share of the width whose median is the ground; of its light
UNLIKE, OTHER = 0.1, 0.2  # of the step at an edge: what is farther off counts less, and not: a lit wall behind a hole
BESIDE_PX, FAR_PX = 5, 9  # side of the square around each of these that is left out; that shows how far they reach
SORTING = 3.0  # of the variance of half the difference: with it sorted axes of a circle hold their sigmas, in the mean
OVEREXPOSED = "expose shorter, or with several exposures, until the surface around it is below full scale"
NEAR_PX = 1e-7  # over which slopes are taken
CONTRAST = 10.0  # standard deviations of the grey values that an edge must step by


def find_circles(image: Floats) -> Array:
    """Find what is round in an image, brighter or darker than what surrounds it: u, v and radius (n, 3), px."""
    grey = np.nan_to_num(image)
    white = max(float(np.quantile(grey, 0.99)), 1e-6)
    around = cv2.medianBlur(np.clip(255 / white * grey, 0, 255).astype(np.uint8), image.shape[1] // SURROUNDINGS | 1)
    contrast = cv2.GaussianBlur(grey, (3, 3), 0.6) - around * np.float32(white / 255)
    limit = np.maximum(CONTRAST / 2 * sigma_by_median(contrast[::3, ::3]), LEAST_CONTRAST * around * (white / 255))
    found = []
    for more in (contrast, -contrast):
        spots = connected_spots(more > limit, more, 1)
        full = 4 * np.pi * np.sqrt(np.linalg.det(spots.cov_px2)) / spots.area_px  # 1 of an ellipse
        small, large = np.sqrt(np.linalg.eigvalsh(spots.cov_px2)).T
        radius = np.sqrt(spots.area_px / np.pi)
        use = ~spots.on_border & (np.abs(full - 1) < UNEVEN) & (small > FLATTEST * large) & (radius > LEAST_RADIUS_PX)
        found.append(np.column_stack([spots.uv, radius])[use])
    return np.concatenate(found)


def measure_feature(
    kind: str, given: Array, phase: PhaseMap, cloud: PointCloud, camera: AdjustedDevice, where: str = "feature"
) -> Feature:
    """Measure one feature from where it approximately is.

    Parameters
    ----------
    kind : str
        One of `FEATURES`.
    given : array
        For a circle u, v and radius in px; for a line its two ends u, v, u, v.
    phase, cloud
        Its `image` shows the edge; points of the same pixels.

    Raises
    ------
    InputError
        If it is no place of a feature, there is no edge, it is overexposed, or too little surface is beside it.
    """
    place = checked_place(kind, given, where)
    edge = FEATURES[kind][1](place, camera)
    if not np.isfinite(edge.contour(edge.start)).all():
        seen = "the lens of the camera does not reach so far"
        raise InputError(where, seen, "give places inside the image")
    if phase.image.shape != cloud.valid.shape:
        (h, w), (height, width) = phase.image.shape, cloud.valid.shape
        raise InputError(where, f"{width} x {height} points, {w} x {h} px", "give the points of this image's pixels")
    image = phase.image if phase.clipped is None else np.where(phase.clipped, np.nan, phase.image)
    try:
        shape, shape_cov, blur, pixels = _seen(edge, image, where)
    except InputError as error:
        every = np.indices(image.shape)[::-1].reshape(2, -1).T.astype(np.float64)
        lost = np.isnan(image).ravel()[edge.near(every)]
        if np.count_nonzero(lost) > CLIPPED * lost.size:
            raise InputError(where, f"{lost.mean():.0%} of the pixels about it are overexposed", OVEREXPOSED) from error
        raise
    surface, surface_cov, middle, scale = _surface(edge, shape, cloud, camera, where)
    own, k = np.concatenate([shape, surface]), len(shape)
    whole = np.zeros((len(own), len(own)))
    whole[:k, :k], whole[k:, k:] = shape_cov, surface_cov

    def carried(plain: Array, terms: Array) -> Array:
        x, y = ((plain - middle) / scale).T
        xy = pixel_to_image(camera.spec, plain) / camera.interior.c_mm
        return np.column_stack([xy, np.full(len(xy), -1.0)]) / (polynomial(x, y, 2) @ terms)[:, None]

    def figures(p: Array) -> tuple[Array, Array]:
        return edge.figures(carried(before_lens(camera, edge.contour(p[:k])), p[k:]))

    def found(p: Array) -> Array:
        centre, axes = figures(p)
        seen = project(camera.spec, camera.interior, centre)
        return np.concatenate([seen, centre, np.linalg.norm(axes, axis=1)])

    value, step = found(own), 0.1 * np.sqrt(np.diagonal(whole))
    J = np.stack([(found(own + d) - found(own - d)) / (2 * d.sum()) for d in np.diag(step)], axis=1)
    covariance = J @ whole @ J.T
    corners = carried(middle + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), surface)
    normal = np.cross(corners[2] - corners[0], corners[1] - corners[0])
    return Feature(
        kind=kind,
        uv=value[:2],
        uv_cov=covariance[:2, :2],
        centre_mm=value[2:5],
        cov_mm2=covariance[2:5, 2:5] + _by_calibration(cloud, value[:2], scale),
        axes_mm=figures(own)[1],
        sigma_mm=_sigma_of_lengths(value[5:], covariance[5:, 5:]),
        size_mm=(float(value[5:].mean()), float(np.sqrt(covariance[5:, 5:].mean()))),
        normal=-normal * np.sign(normal @ value[2:5]) / np.linalg.norm(normal),
        blur_px=blur,
        pixels=pixels,
        verdict=cloud.verdict,
    )


def _sigma_of_lengths(lengths: Array, covariance: Array) -> Array:
    """Standard deviations of semi-axes in order of length: noise makes a circle an ellipse, in whatever direction."""
    half = np.ptp(lengths) / 2
    of_half = float(np.array([1, -1]) @ covariance @ np.array([1, -1])) / 4 if len(lengths) == 2 else 0.0
    sorting = SORTING * of_half**2 / max(of_half + half**2 / 2, 1e-300)
    return np.sqrt(np.diagonal(covariance) + sorting)


def _seen(edge: Edge, image: Floats, where: str) -> tuple[Array, Array, float, int]:
    """Fit a blurred step to the pixels along an edge: shape, its covariance, blur, number of pixels.

    The light changes linearly along it; pixels that fit neither side are left out, with those around them. The
    covariance is the sandwich form of the pixels' own residuals.
    """
    from scipy.optimize import least_squares

    shape, lens, k = edge.start, LENS_PX, len(edge.start)
    rows, columns = np.nonzero(np.isfinite(image))
    every = np.stack([columns, rows], axis=1).astype(np.float64)
    every = every[edge.near(every)]
    for again in range(PASSES):
        at = every[np.abs(edge.distance(shape, every)) < max(REACH * width_px(lens), LEAST_REACH)]
        if again:
            at = at[_before_others(edge.distance(shape, at), image[tuple(at.astype(int).T[::-1])])]
        inside = edge.distance(shape, at) < 0
        if len(at) < FEWEST_PIXELS or inside.all() or not inside.any():
            raise InputError(where, "no such edge is seen there", "give its place and size to a few px")
        grey = image[at[:, 1].astype(int), at[:, 0].astype(int)].astype(np.float64)
        off = (at - at.mean(axis=0)) / np.ptp(at)
        lay = _lay(edge, shape, at, straight=not again)  # from afar a straight edge is found more surely
        outer, inner = float(np.median(grey[~inside])), float(np.median(grey[inside]))

        def rest(p: Array, at: Array = at, grey: Array = grey, off: Array = off, lay: Lay = lay) -> Array:
            step = light_within(edge.distance(p[:k], at), lay, p[-1])
            return np.asarray((p[k] + off @ p[k + 1 : k + 3]) * (1 + p[-2] * step) - grey)

        def slopes(p: Array, at: Array = at, _: Array = grey, off: Array = off, lay: Lay = lay) -> Array:
            away = edge.distance(p[:k], at)
            step, light = light_within(away, lay, p[-1]), p[k] + off @ p[k + 1 : k + 3]
            by_away = (light_within(away + NEAR_PX, lay, p[-1]) - step) / NEAR_PX
            by_blur = (light_within(away, lay, p[-1] + NEAR_PX) - step) / NEAR_PX
            moved = (edge.distance(p[:k] + d, at) - away for d in NEAR_PX * np.eye(k))
            by_shape = [p[-2] * light * by_away * more / NEAR_PX for more in moved]
            ground = (1 + p[-2] * step) * np.stack([np.ones(len(at)), *off.T])
            return np.stack([*by_shape, *ground, light * step, p[-2] * light * by_blur], axis=1)

        start = np.array([*shape, outer, 0.0, 0.0, inner / max(outer, 1e-6) - 1, lens])
        most = max(UNLIKE * abs(outer - inner), 1e-3)
        fit = least_squares(rest, start, slopes, x_scale="jac", max_nfev=50, loss="cauchy", f_scale=most)
        limit = max(GROSS * sigma_by_median(fit.fun), OTHER * abs(fit.x[-2] * fit.x[k]))
        unlike = np.zeros(image.shape, np.uint8)
        unlike[tuple(at[np.abs(fit.fun) > limit].astype(int).T[::-1])] = 1
        alike = cv2.dilate(unlike, np.ones((BESIDE_PX, BESIDE_PX)))[tuple(at.astype(int).T[::-1])] == 0
        if np.count_nonzero(alike) < max(FEWEST_PIXELS, FEWEST_ALIKE * len(at)):
            raise InputError(where, "no such edge is seen there", "give its place and size to a few px")
        at, chosen = at[alike], (at[alike], grey[alike], off[alike], Lay(*(each[alike] for each in lay)))
        fit = least_squares(rest, fit.x, slopes, x_scale="jac", max_nfev=50, args=chosen)
        shape, lens = fit.x[:k], float(fit.x[-1])
    begun = edge.contour(edge.start)
    moved = float(np.abs(edge.distance(shape, begun)).max())
    contrast = abs(fit.x[-2] * fit.x[k]) * np.sqrt(len(at)) / max(float(np.std(fit.fun)), 1e-9)
    row_moved = (rest(fit.x, at - (NEAR_PX, 0.0), *chosen[1:]) - fit.fun) / NEAR_PX
    cov = covariance(fit.jac, fit.fun, row_moved, at[:, 1].astype(int))
    vague = np.sqrt(np.diagonal(cov)[:k].max()) > MOST_VAGUE_PX
    if not contrast > CONTRAST or vague or moved > MOST_MOVED * np.ptp(begun):
        raise InputError(where, "no such edge is seen there", "give its place and size to a few px")
    kept = cv2.dilate(unlike, np.ones((FAR_PX, FAR_PX)))[tuple(at.astype(int).T[::-1])] == 0
    if not kept.all() and np.count_nonzero(kept) > FEWEST_PIXELS:  # light that is not alike reaches farther
        some = (*(each[kept] for each in chosen[:3]), Lay(*(each[kept] for each in chosen[3])))
        without = least_squares(rest, fit.x, slopes, x_scale="jac", max_nfev=50, args=some).x
        cov = cov + np.outer(without - fit.x, without - fit.x)
    return shape, cov[:k, :k], width_px(lens), len(at)


def _lay(edge: Edge, shape: Array, at: Array, straight: bool) -> Lay:
    """How an edge lies in pixels (n, 2); a straight one is not curved."""
    away, bent = edge.distance(shape, at), edge.curvature(shape, at)
    slopes = [(edge.distance(shape, at + step) - away) / NEAR_PX for step in NEAR_PX * np.eye(2)]
    u, v = slopes / np.maximum(np.hypot(*slopes), NEAR_PX)
    return Lay(np.zeros_like(bent) if straight else bent, u, v)


def _before_others(away: Array, grey: Array) -> NDArray[np.bool_]:
    """Choose the pixels (n,) on this side of where the light turns back: beyond a slot's middle its other edge acts."""
    chosen, step = np.ones(len(away), bool), np.abs(away * 2).astype(int)
    for side in (away < 0, away >= 0):
        found = distinct(step[side])
        level = np.array([np.median(grey[side & (step == each)]) for each in found])
        if len(level):
            turn = int(np.argmax(np.abs(level - level[0])))
            if abs(level[-1] - level[turn]) > UNLIKE * abs(level[turn] - level[0]):
                chosen &= ~side | (step <= found[turn])
    return chosen


def _surface(
    edge: Edge, shape: Array, cloud: PointCloud, camera: AdjustedDevice, where: str
) -> tuple[Array, Array, Array, float]:
    """Fit the inverse depth of the surface beside an edge: six terms, their covariance, their middle and scale.

    A plane's is linear in the image that the lens has not distorted.
    """
    seen = edge.contour(shape)
    contour = before_lens(camera, seen)
    middle = contour.mean(axis=0)
    scale = float(np.linalg.norm(contour - middle, axis=1).max())
    usable = cloud.valid & (cloud.xyz_mm[..., 2] < 0)
    if cloud.sigma_depth_mm is not None:
        usable &= cloud.sigma_depth_mm > 0
    rows, columns = np.nonzero(usable)
    at = np.stack([columns, rows], axis=1).astype(np.float64)
    at = at[near := edge.near(at)]
    away = edge.distance(shape, at)
    away = np.abs(away) if edge.inside else away
    z = cloud.xyz_mm[rows[near], columns[near]][:, 2].astype(np.float64)
    weight = np.ones_like(z)
    if cloud.sigma_depth_mm is not None:
        weight = (z**2 / cloud.sigma_depth_mm[rows[near], columns[near]]) ** 2
    ring = (away > RING_PX) & (away < RING_PX + max(RING * scale, LEAST_RING_PX))
    if weight[within := away < -WITHIN_PX].sum() > MOSTLY * weight[ring].sum():  # a bright mark on dark ground
        ring = within
    elif min(np.count_nonzero((at - seen.mean(axis=0))[ring] @ side > 0) for side in SIDES) < AROUND * np.count_nonzero(
        ring
    ):
        ring |= within  # beyond one side alone the surface is hardly known
    if np.count_nonzero(ring) < FEWEST_POINTS:
        few = f"{np.count_nonzero(ring)} points lie on the surface beside the edge"
        raise InputError(where, few, "capture it with more light on the surface around it")
    z, weight = z[ring], weight[ring]
    x, y = ((before_lens(camera, at[ring]) - middle) / scale).T
    A, q = polynomial(x, y, 2), -1 / z
    for _ in range(3):
        N = np.linalg.inv((A * weight[:, None]).T @ A)
        surface = N @ (A.T @ (weight * q))
        rest = np.sqrt(weight) * (q - A @ surface)
        weight = np.where(np.abs(rest) > GROSS * sigma_by_median(rest), 0.0, weight)
    if cloud.sigma_depth_mm is not None and (rough := sigma_by_median(rest)) > ROUGH:
        bumps = f"the surface beside the edge is off a smooth one by {rough:.1f} times its noise"
        raise InputError(where, bumps, "name an edge on a plane or a slightly curved surface")
    own = 1 - np.minimum(weight * np.einsum("ij,jk,ik->i", A, N, A), MOST_LEVERAGE)
    scores = A * (np.sqrt(weight / own) * rest)[:, None]
    return surface, N @ (scores.T @ scores) @ N, middle, scale


def _by_calibration(cloud: PointCloud, uv: Array, reach_px: float) -> Array:
    """What the calibration leaves uncertain (3, 3) of points around a place: along each axis, mm²."""
    if cloud.sigma_mm is None or cloud.sigma_depth_mm is None:
        return np.zeros((3, 3))
    u, v, r = int(uv[0]), int(uv[1]), int(reach_px + RING_PX + LEAST_RING_PX)
    part = np.s_[max(0, v - r) : v + r, max(0, u - r) : u + r]
    along = cloud.xyz_mm[part] / cloud.xyz_mm[part][..., 2:] * cloud.sigma_depth_mm[part][..., None]
    squares = cloud.sigma_mm[part].astype(np.float64) ** 2 - along**2
    return np.diag(np.maximum(np.nanmedian(squares.reshape(-1, 3), axis=0), 0.0))
