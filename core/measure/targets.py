"""From a phase map and four picks to all visible targets."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from core.errors import InputError
from core.measure.blobs import find_blobs
from core.measure.board import Board, board_from_testfield
from core.measure.centroid import centroids, light_gradient, noise_model
from core.measure.eccentricity import eccentricity
from core.measure.faults import shape_faults
from core.measure.grow import Lattice
from core.measure.identify import identify
from core.measure.light import CUT, cut_by_edge, line_gradients
from core.measure.missing import EXCLUDED, reasons
from core.measure.options import MeasureOptions
from core.measure.picks import check_excluded, check_picks, snap
from core.measure.profile import Profiles, profiles
from core.measure.projector import around_dot, bilinear, decoded_inside, inside_dot, refuse_jumps
from core.measure.rays import Rays
from core.measure.view import View, fit_both_tilts
from core.model import DeviceSpec, MissingTarget, PhaseMap, Seed, TargetSet, Testfield
from core.progress import SILENT, Progress

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

ECCENTRICITY_SHARE = (
    0.05  # uncertainty of the correction: nominal focal length, one lens parameter, board taken as flat
)


@dataclass(frozen=True)
class Dots:
    """Measured dots, faulty ones included; one row per dot."""

    target: NDArray[np.int64]
    uv: Array  # (m, 2) px, weighted centroid
    cov: Array  # (m, 2, 2) px²
    ellipse: Array  # (m, 2, 2) px, the unit disc's map to the dot
    window: Array  # (m,) radius in the unit disc that holds the whole blurred dot
    blur: Array  # (m,) px, sigma of the edge
    fault: list[str]  # why it must not be used, empty where it may


def measure_targets(
    phase: PhaseMap,
    testfield: Testfield,
    seeds: Sequence[Seed],
    camera: DeviceSpec,
    *,
    projector: DeviceSpec | None = None,
    capture: str = "",
    excluded: Collection[tuple[int, int]] = (),
    options: MeasureOptions = MeasureOptions(),  # noqa: B008  frozen
    progress: Progress = SILENT,
) -> TargetSet:
    """Identify and measure all visible targets of a testfield from a few that an operator picked.

    Parameters
    ----------
    phase : PhaseMap
        Dots are found in `image`, projector coordinates read from `u`, `v` and their sigmas.
    testfield : Testfield
        Nominal coordinates, good to a few mm.
    seeds : sequence of Seed
        At least 4 targets, not on one line, clicked within a fraction of their spacing.
    camera : DeviceSpec
        Its nominal focal length gives the view of the board, needed for prediction and eccentricity only.
    projector : DeviceSpec, optional
        Its raster tells where the light ends: targets too near to that are left out.
    capture : str
        Name of the capture, for the result and for messages.
    excluded : collection of (row, col)
        Targets that the operator does not want used: they end in `missing`. They still help to tell who is who.
    options : MeasureOptions
    progress : Progress

    Returns
    -------
    targets : TargetSet
        Every target of the testfield is either measured or in `missing` with the reason.

    Raises
    ------
    InputError
        The testfield or the picks cannot be used: the message names the pick and what contradicts it.

    Examples
    --------
    >>> rows, cols = (x.ravel() for x in np.mgrid[0:5, 0:6])
    >>> field = Testfield(rows, cols, np.stack([20.0 * cols, 20.0 * rows, 0.0 * rows], axis=1), np.full(30, 8.0))
    >>> v, u = np.mgrid[0:120, 0:140]  # a board seen straight on, row 0 at the bottom, 1 px per mm
    >>> away = np.min([np.hypot(u - 20 - 20 * c, v - 100 + 20 * r) for r, c in zip(rows, cols)], axis=0)
    >>> image = (20 + 150 * np.clip(4.5 - away, 0, 1)).astype(np.float32)
    >>> nothing = np.full(image.shape, np.nan, np.float32)
    >>> phase = PhaseMap(nothing, nothing, nothing, nothing, 0 * image, image, np.zeros(image.shape, np.uint8))
    >>> seeds = [Seed(0, 0, 21, 99), Seed(0, 5, 119, 101), Seed(4, 5, 120, 20), Seed(4, 0, 19, 21)]
    >>> targets = measure_targets(phase, field, seeds, DeviceSpec(140, 120, (0.01, 0.01), 12.0))
    >>> len(targets.row), np.round(targets.camera_uv[7], 1)
    (30, array([40., 80.]))
    """
    board = board_from_testfield(testfield)
    where = f"{capture}/picks.json" if capture else "picks.json"
    image = _bright_dots(phase.image, testfield, camera, capture)
    picks = check_picks(board, seeds, (camera.width, camera.height), where, options.side)
    unwanted = check_excluded(board, excluded, where)
    progress(0.0, "looking for dots")
    blobs = find_blobs(image, _diameters(board, picks.affine), picks.uv)
    spots, notes = snap(board, picks, blobs)
    progress(0.3, "identifying targets")
    lattice = identify(board, camera, blobs, picks, spots)
    progress(0.6, "measuring centroids")
    dots = _measure_dots(
        image,
        np.ascontiguousarray(phase.modulation, np.float32),
        lattice,
        testfield.polarity == "black-on-white",
        options.threshold,
    )
    progress(0.9, "reading projector coordinates")
    fault = [EXCLUDED if int(t) in unwanted else f for t, f in zip(dots.target, dots.fault, strict=True)]
    found = _target_set(phase, lattice, replace(dots, fault=fault), unwanted, capture, projector, options)
    return replace(found, notes=notes)


def _bright_dots(image: Floats, testfield: Testfield, camera: DeviceSpec, capture: str) -> Floats:
    """Give the image with dots bright, whatever the polarity, after a look at its size and values."""
    where = capture or "image"
    if image.shape != (camera.height, camera.width):
        seen = f"the image has {image.shape[1]} x {image.shape[0]} px, the camera {camera.width} x {camera.height}"
        raise InputError(where, seen, "correct the camera's size in the project")
    values = np.ascontiguousarray(image, dtype=np.float32)
    if not np.isfinite(np.dot(values.ravel(), values.ravel())):
        valid = np.isfinite(values)
        if not np.any(valid):
            raise InputError(where, "the image has no finite grey value", "capture it again")
        values = np.where(valid, values, values[valid].min())
    return -values if testfield.polarity == "black-on-white" else values


def _diameters(board: Board, affine: Array) -> tuple[float, float]:
    """Least and greatest diameter in px that dots may have, with room for perspective across the field."""
    long, short = np.linalg.svd(affine, compute_uv=False)
    return 1.2 * short * float(board.radius_mm.min()), 3.2 * long * float(board.radius_mm.max())


def _measure_dots(image: Floats, modulation: Floats, lattice: Lattice, dark: bool, threshold: float) -> Dots:
    """Profiles and centroids of all identified dots."""
    board = lattice.board
    target = np.flatnonzero(lattice.known)
    if not len(target):
        return Dots(target, np.zeros((0, 2)), np.zeros((0, 2, 2)), np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0), [])
    centre = lattice.blobs.uv[lattice.blob[target]]
    nominal = lattice.view.jacobian(board.xyz_mm[target]) * board.radius_mm[target, None, None]
    spacing = board.spacing_mm[target] / board.radius_mm[target]
    start = Rays(centre, nominal)
    first = profiles(image, start, spacing)
    # by now the size is known: again with rays that end where the contour is, from the centre it has
    size = np.clip(np.nan_to_num(first.contour[:, 0], nan=1.0), 0.5, 2.0)
    moved, _ = centroids(image, start, first, np.zeros_like(centre), (0.0, 0.0), threshold)
    moved = np.where(np.isfinite(moved), moved, centre)
    rays = Rays(moved, nominal * size[:, None, None])
    profile = profiles(image, rays, spacing / size)
    light = light_gradient(moved, profile.contrast, profile.plane if dark else None)
    noise = noise_model(image, rays, profile)
    uv, cov = centroids(image, rays, profile, light, noise, threshold)
    profile = _recentred(profile, rays.ellipse, uv - moved)
    ellipse = rays.ellipse
    fault = shape_faults(image, modulation, Rays(uv, ellipse), profile, size, noise, dark)
    scale = profile.contour[:, 0]
    return Dots(target, uv, cov, ellipse * scale[:, None, None], profile.window / scale, profile.blur, fault)


def _recentred(profile: Profiles, ellipse: Array, shift: Array) -> Profiles:
    """Refer the contour's centre to centroids that have moved by `shift` (m, 2) px."""
    offset = np.einsum("mij,mj->mi", ellipse, profile.contour[:, 1:3]) - shift
    return replace(profile, off_centre=np.linalg.norm(offset, axis=1))


def _target_set(
    phase: PhaseMap,
    lattice: Lattice,
    dots: Dots,
    unwanted: set[int],
    capture: str,
    projector: DeviceSpec | None,
    options: MeasureOptions,
) -> TargetSet:
    """Correct the eccentricity, read the projector coordinates, and tell why the rest is missing."""
    board = lattice.board
    faults = {int(t): f for t, f in zip(dots.target, dots.fault, strict=True) if f}
    good = np.array([not f for f in dots.fault], dtype=bool)
    target, uv, ellipse = dots.target[good], dots.uv[good], dots.ellipse[good]
    view, shift = lattice.view, np.zeros_like(uv)
    for _ in range(2):  # the second view is fitted to the circles' centres, no longer to the ellipses'
        view = _final_view(view, board, target, uv - shift)
        shift = eccentricity(view, board.xyz_mm[target], board.radius_mm[target])
    centre = uv - shift
    lines, sigma = _projector(phase, centre, ellipse, dots.window[good], options)
    gradient = line_gradients(centre, lines)
    cov = dots.cov[good] + ECCENTRICITY_SHARE**2 * shift[:, :, None] * shift[:, None, :]
    if projector is not None:
        cut = cut_by_edge(projector, lines, gradient, ellipse, dots.window[good], dots.blur[good])
        faults |= dict.fromkeys(target[cut].tolist(), CUT)
        target, centre, cov, lines, sigma, gradient, shift, ellipse = (
            x[~cut] for x in (target, centre, cov, lines, sigma, gradient, shift, ellipse)
        )
    shared = np.einsum("nij,njk,nik->ni", gradient, cov, gradient)
    missing = reasons(phase, replace(lattice, view=view), faults) | dict.fromkeys(sorted(unwanted), EXCLUDED)
    return TargetSet(
        capture=capture,
        row=board.row[target],
        col=board.col[target],
        camera_uv=centre,
        camera_cov=cov,
        projector_uv=lines,
        projector_sigma=np.sqrt(sigma**2 + np.nan_to_num(shared)),
        gradient=gradient,
        eccentricity_px=shift,
        diameter_px=2 * np.sqrt(np.abs(np.linalg.det(ellipse))),
        missing=tuple(MissingTarget(int(board.row[i]), int(board.col[i]), why) for i, why in missing.items()),
    )


def _projector(
    phase: PhaseMap, centre: Array, ellipse: Array, window: Array, options: MeasureOptions
) -> tuple[Array, Array]:
    """Projector coordinates (n, 2) and sigmas at the targets' centres.

    Where a pixel at the centre is not decoded, or wrong, the rest of the dot tells; where the dot is not, the board
    round it.
    """
    coordinate, sigma = np.full((len(centre), 2), np.nan), np.full((len(centre), 2), np.nan)
    for axis, (values, spread) in enumerate(((phase.u, phase.sigma_u), (phase.v, phase.sigma_v))):
        if options.projector == "plane":
            found, error = inside_dot(values, spread, centre, ellipse, window)
        else:
            found, error = bilinear(values, spread, centre)
        found[refuse_jumps(values, centre, ellipse, found, error)] = np.nan
        lost = ~np.isfinite(found)
        lit = decoded_inside(values, centre, ellipse)
        for which, fit in ((lost & lit, inside_dot), (lost & ~lit, around_dot)):
            found[which], error[which] = fit(values, spread, centre[which], ellipse[which], window[which])
        error[~np.isfinite(found)] = np.nan
        coordinate[:, axis], sigma[:, axis] = found, error
    return coordinate, sigma


def _final_view(view: View, board: Board, target: NDArray[np.int64], uv: Array) -> View:
    """Fit the view to measured targets, where there are enough."""
    return fit_both_tilts(view, board.xyz_mm[target], uv, radial=len(target) >= 12) if len(target) >= 6 else view
