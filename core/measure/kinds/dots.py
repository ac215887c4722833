"""Round dots of one size and print: found as spots, told apart by the lattice they form, measured by their weight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from core.measure.board import Board
from core.measure.centres.centroid import centroids, noise_model
from core.measure.centres.circles import NOMINAL_SHARE, eccentricity, recentred, tangents, uncertain
from core.measure.centres.estimators import ESTIMATORS
from core.measure.centres.faults import half_lit, shape_faults
from core.measure.centres.grain import PLAIN, grain, of_lattice
from core.measure.centres.lighting import light_gradient, light_of_ground
from core.measure.centres.overlap import MODELLED, told_apart
from core.measure.centres.plateau import plateau_share
from core.measure.centres.profile import PLATEAU, Profiles, outlines, profiles
from core.measure.centres.rays import Rays
from core.measure.identity.blobs import find_blobs
from core.measure.identity.grow import Lattice
from core.measure.identity.identify import identify
from core.measure.identity.picks import check_picks, snap
from core.measure.identity.propose import find_dots, propose_picks
from core.measure.identity.single import dot_at
from core.measure.identity.view import fit_both_tilts
from core.measure.kinds.kind import Guesses, Marks, Sight, TargetKind
from core.measure.missing import EXCLUDED, reasons
from core.measure.rows import row_shifts
from core.model import Array, DeviceSpec, Floats, Seed, Testfield
from core.numerics import inverse_2x2, row_median

ASTRAY = 0.5  # radii that a dot's centroid may lie off its spot
SHADOW = 0.5  # of the usual share of the projector's light in all light: below, the projector does not reach a dot

TOUCHED = 0.7  # px: pixels are drawn that an outline touches


def _dark(testfield: Testfield) -> bool:
    return testfield.polarity == "black-on-white"


def measure_dots(sight: Sight, seeds: Sequence[Seed], coded: bool = False) -> Marks:
    """Find, identify and measure all dots from at least 4 picks that do not lie on one line."""
    board, camera, progress = sight.board, sight.camera, sight.progress
    image = -sight.image if _dark(sight.testfield) else sight.image
    picks = check_picks(board, seeds, (camera.width, camera.height), sight.where, sight.side)
    progress(0.0, "looking for dots")
    blobs = find_blobs(image, _diameters(board, picks.affine), picks.uv)
    spots, astray = snap(board, picks, blobs, (camera.width, camera.height))
    progress(0.3, "identifying targets")
    lattice, unlit = identify(board, camera, blobs, picks, spots, coded)
    progress(0.6, "measuring centroids")
    dots, fault = _measure_dots(sight, image, lattice, coded)
    fault = [EXCLUDED if t in sight.unwanted else f for t, f in zip(dots.target.tolist(), fault, strict=True)]
    return replace(_centred(sight, lattice, dots, fault), notes=(*astray, *unlit))


def _diameters(board: Board, affine: Array) -> tuple[float, float]:
    """Least and greatest diameter in px that dots may have, with room for perspective across the field."""
    long, short = np.linalg.svd(affine, compute_uv=False)
    return 1.2 * short * float(board.radius_mm.min()), 3.2 * long * float(board.radius_mm.max())


def _measure_dots(sight: Sight, image: Floats, lattice: Lattice, coded: bool) -> tuple[Marks, list[str]]:
    """Profiles and centroids of all identified dots, eccentric yet; and why each must not be used, empty if it may."""
    board, dark = lattice.board, _dark(sight.testfield)
    target = np.flatnonzero(lattice.known)
    if not len(target):
        pairs, matrices, none = np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros(0)
        return Marks(target, pairs, matrices, matrices, none, none, pairs, {}), []
    centre = lattice.blobs.uv[lattice.blob[target]]
    nominal = lattice.view.jacobian(board.xyz_mm[target]) * board.radius_mm[target, None, None]
    spacing = board.spacing_mm[target] / board.radius_mm[target]
    start = Rays(centre, nominal)
    first = outlines(image, start, spacing)
    # by now the size is known: again with rays that end where the contour is, from the centre it has
    size = np.clip(np.nan_to_num(first.contour[:, 0], nan=1.0), 0.5, 2.0)
    moved, _ = centroids(image, start, first, np.zeros_like(centre), (0.0, 0.0))
    moved = np.where(np.isfinite(moved), moved, centre)
    rays = Rays(moved, nominal * size[:, None, None])
    whole, usual = image, profiles(image, rays, spacing / size)
    image, profile = told_apart(whole, rays, spacing / size, usual)
    modulation = np.ascontiguousarray(sight.phase.modulation, np.float32)
    cut = half_lit(image, modulation, rays, profile, dark)
    shown = row_median(rays.sample(modulation, PLATEAU).reshape(len(target), -1)) / profile.contrast
    shadowed = shown < SHADOW * np.nanmedian(shown)
    bright = profile.contrast / plateau_share(rays.ellipse * profile.contour[:, 0, None, None], profile.blur)
    light, unsure = _light(moved, np.where(cut, np.nan, bright), profile, shadowed, dark)
    ground = PLAIN if coded else grain(image, rays, profile.window, (profile.gentle - TOUCHED) / rays.minor)
    noise = noise_model(image, rays, profile, ground)
    estimated = ESTIMATORS[sight.testfield.estimator]
    uv, cov = estimated(image, rays, profile, light, noise)
    if image is not whole:
        drawn = MODELLED * (uv - estimated(whole, rays, usual, light, noise)[0])
        cov = cov + drawn[:, :, None] * drawn[:, None, :]
    moment = rays.ellipse @ np.swapaxes(rays.ellipse, 1, 2) / 4  # what a change of the light moves a dot by
    cov = cov + moment @ unsure @ moment
    diameter = 2 * np.sqrt(np.abs(np.linalg.det(rays.ellipse)))
    cov = cov + of_lattice(ground, diameter, profile.spread)[:, None, None] * np.eye(2)
    profile = _recentred(profile, rays.ellipse, uv - moved, light)
    away = np.linalg.norm(inverse_2x2(rays.ellipse) @ (uv - centre)[..., None], axis=(1, 2))  # drawn to its neighbour
    profile = replace(
        profile, off_centre=np.where(away > ASTRAY, np.linalg.norm(uv - centre, axis=1), profile.off_centre)
    )
    fault = shape_faults(image, Rays(uv, rays.ellipse), profile, size, noise, cut)
    scale = profile.contour[:, 0]
    ellipse = rays.ellipse * scale[:, None, None]
    window = profile.window / scale
    good = np.array([not f for f in fault], dtype=bool)
    shifts = row_shifts(image, sight.phase, *(a[good] for a in (uv, ellipse, window, profile.plane)))
    seen, zero = None if dark else light, np.zeros_like(uv)
    return Marks(target, uv, cov, ellipse, window, profile.blur, zero, {}, row_shifts=shifts, light=seen), fault


def _light(
    uv: Array, contrast: Array, profile: Profiles, shadowed: NDArray[np.bool_], dark: bool
) -> tuple[Array, Array]:
    """Relative change of the light per px at every dot (m, 2), and its covariance (m, 2, 2).

    Dark dots lie in a bright surrounding, which shows it; for bright ones it follows from all of them.
    """
    if dark:  # the image is the negative
        gradient, unsure = light_of_ground(-profile.plane, contrast)
    else:
        gradient, unsure = light_gradient(uv, contrast, profile.tilt, np.pi / 4 * profile.gentle**4, shadowed)
    return np.clip(gradient, -0.05, 0.05), unsure


def _recentred(profile: Profiles, ellipse: Array, shift: Array, light: Array) -> Profiles:
    """Refer the contour's centre to centroids that have moved by `shift` (m, 2) px, and to even light.

    At half the contrast of the middle the contour of a dot lies further out where there is more light: an edge of blur
    s falls by 0.4 contrasts per s, and the light there is half the dot's.
    """
    size = np.sqrt(np.abs(np.linalg.det(ellipse)))[:, None]
    drawn = np.einsum("mij,mkj,mk->mi", ellipse, ellipse, light) / size * (profile.blur * np.sqrt(np.pi / 2))[:, None]
    offset = np.einsum("mij,mj->mi", ellipse, profile.contour[:, 1:3]) - shift - drawn
    return replace(profile, off_centre=np.linalg.norm(offset, axis=1))


def _centred(sight: Sight, lattice: Lattice, dots: Marks, fault: list[str]) -> Marks:
    """Leave out faulty dots, correct the others' eccentricity, and tell why the rest is missing."""
    board, good = lattice.board, np.array([not f for f in fault], dtype=bool)
    target, uv = dots.target[good], dots.uv[good]
    view, shift, along = lattice.view, np.zeros_like(uv), tangents(board.xyz_mm)[target]
    for _ in range(2):  # the second view is fitted to the circles' centres, no longer to the ellipses'
        if len(target) >= 6:
            view = fit_both_tilts(view, board.xyz_mm[target], uv - shift, radial=len(target) >= 12)
        shift = eccentricity(view, board.xyz_mm[target], board.radius_mm[target], along=along)
    faults = {int(t): f for t, f in zip(dots.target, fault, strict=True) if f}
    return Marks(
        target,
        uv - shift,
        dots.cov[good] + uncertain(shift, NOMINAL_SHARE),
        dots.ellipse[good],
        dots.window[good],
        dots.blur[good],
        shift,
        reasons(sight.phase, replace(lattice, view=view), faults),
        row_shifts=dots.row_shifts,
        light=None if dots.light is None else dots.light[good],
    )


def _guess(
    image: NDArray, testfield: Testfield, camera: DeviceSpec, known: Sequence[Seed], side: str
) -> tuple[Array, Guesses]:
    order = find_dots(image, dark=_dark(testfield))
    return order.uv, propose_picks(image, order, testfield, camera, known, side)


def _nearest(
    image: NDArray, testfield: Testfield, uv: tuple[float, float], reach_px: float
) -> tuple[float, float] | None:
    return dot_at(image, *uv, dark=_dark(testfield), reach_px=reach_px)


DOTS = TargetKind("dots", _guess, measure_dots, _nearest, recentred=recentred)
