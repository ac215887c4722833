"""From a phase map and picks to all visible targets, of whatever kind."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from core.algebra import on_own_threads
from core.errors import InputError
from core.measure.board import board_from_testfield
from core.measure.centres.course import bends
from core.measure.centres.defocus import LIGHT, WIDE, widening
from core.measure.centres.grain import balanced
from core.measure.centres.light import CUT, cut_by_edge, line_gradients
from core.measure.centres.profile import READ_BETWEEN
from core.measure.identity.picks import Side, check_excluded
from core.measure.kinds import Marks, Sight, kind_of
from core.measure.missing import EXCLUDED
from core.measure.projector import INTERIOR, RING, bilinear, decoded_inside, middle_of_surface, refuse_jumps
from core.model import Array, DeviceSpec, Floats, MissingTarget, PhaseMap, Seed, TargetSet, Testfield
from core.progress import SILENT, Progress

DEEP = 0.2  # of a board's size that its targets' z may span; more is said where its picks do not fit
READ_DOUBT = 0.5  # share of the softer side's light that depends on the print round a target, per px of its widening
BESIDE_CODE = 1.05  # radii from a code to where the board around a dot begins to count: 0.8, and the code's blur
RIM_BLURS = 4.0  # from a dot's edge to where its light changes by less than noise
BLURRED = 0.7  # part of what the light's slope does that decoding leaves in a dot without such a middle: 0.5 to 1
ROUGH = 2.0  # times that of four pixels: with a greater sigma a dot is decoded wrongly towards its rim


@on_own_threads()
def measure_targets(
    phase: PhaseMap,
    testfield: Testfield,
    seeds: Sequence[Seed],
    camera: DeviceSpec,
    *,
    projector: DeviceSpec | None = None,
    capture: str = "",
    excluded: Collection[tuple[int, int]] = (),
    side: Side = "front",
    progress: Progress = SILENT,
) -> TargetSet:
    """Identify and measure all visible targets of a testfield from a few that an operator picked.

    Parameters
    ----------
    phase : PhaseMap
        Targets are found in `image`, projector coordinates read from `u`, `v` and their sigmas.
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
    side : "front", "back" or "either"
        From which side the camera sees the board. The nominal coordinates are right-handed, so that their Z axis
        points to the viewer ("front"); a field written with y downwards and z = 0 is seen from its "back". Picks that
        show the other side are refused as mirrored.

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
    kind = kind_of(testfield)
    board = board_from_testfield(testfield)
    image = balanced(_checked(phase.image, camera, capture or "image"))
    where = f"{capture}/picks.json" if capture else "picks.json"
    unwanted = frozenset(check_excluded(board, excluded, where))
    sight = Sight(image, phase, testfield, board, camera, unwanted, where, side, progress)
    try:
        marks = kind.measure(sight, seeds)
    except InputError as error:
        x, y, z = np.ptp(testfield.xyz_mm, axis=0)
        if z > DEEP * max(x, y):
            deep = f"look at z_mm of the testfield as well, which spans {z:g} mm: is it in µm instead of mm?"
            raise InputError(error.where, error.seen, f"{error.remedy}; {deep}") from error
        raise
    progress(0.9, "reading projector coordinates")
    return _target_set(sight, marks, capture, projector)


def _checked(image: Floats, camera: DeviceSpec, where: str) -> Floats:
    """Give the image with finite grey values, after a look at its size."""
    if image.shape != (camera.height, camera.width):
        seen = f"the image has {image.shape[1]} x {image.shape[0]} px, the camera {camera.width} x {camera.height}"
        raise InputError(where, seen, "correct the camera's size in the project")
    values = np.ascontiguousarray(image, dtype=np.float32)
    if np.isfinite(np.dot(values.ravel(), values.ravel())):
        return values
    valid = np.isfinite(values)
    if not np.any(valid):
        raise InputError(where, "the image has no finite grey value", "capture it again")
    return np.where(valid, values, values[valid].min())


def _target_set(sight: Sight, marks: Marks, capture: str, projector: DeviceSpec | None) -> TargetSet:
    """Read the projector coordinates, leave out what the light's edge cuts, and say what each missing target lacks."""
    board, target, missing = sight.board, marks.target, dict(marks.missing)
    drawn = widening(marks.uv, marks.blur**2)
    lines, sigma = _projector(sight, marks, drawn)
    gradient = line_gradients(marks.uv + marks.shift, lines)
    lines -= np.einsum("nij,nj->ni", np.nan_to_num(gradient), marks.shift + _drawn_by_light(marks))
    keep = np.ones(len(target), bool)
    if projector is not None:
        keep = ~cut_by_edge(projector, lines, gradient, marks.ellipse, marks.window, marks.blur)
        missing |= dict.fromkeys(target[~keep].tolist(), CUT)
    missing = dict(sorted(missing.items())) | dict.fromkeys(sorted(sight.unwanted), EXCLUDED)
    found = TargetSet(
        capture=capture,
        row=board.row[target[keep]],
        col=board.col[target[keep]],
        camera_uv=marks.uv[keep],
        camera_cov=marks.cov[keep],
        projector_uv=lines[keep],
        projector_sigma=sigma[keep],
        gradient=gradient[keep],
        eccentricity_px=marks.shift[keep],
        diameter_px=2 * np.sqrt(np.abs(np.linalg.det(marks.ellipse[keep]))),
        missing=tuple(MissingTarget(int(board.row[i]), int(board.col[i]), why) for i, why in missing.items()),
        notes=marks.notes,
        row_shifts=marks.row_shifts,
        height_px=2 * np.linalg.norm(marks.ellipse[keep, 1], axis=1),
    )
    cov = found.camera_cov.copy()
    shifts = np.zeros((3, 3)) if marks.row_shifts is None else marks.row_shifts
    by_row = found.row_variance[:, None]
    cov[:, :1, 0] += by_row * shifts[0, 0]
    read = cov + READ_DOUBT**2 * np.einsum("ni,nj->nij", *2 * [drawn[keep]])
    shared = np.einsum("nij,njk,nik->ni", gradient[keep], read, gradient[keep])
    by_row = by_row * gradient[keep, :, 0] ** 2
    own = np.maximum(found.projector_sigma**2, np.nan_to_num(by_row * np.diagonal(shifts)[1:]))  # of few: no gradient
    sigma = np.sqrt(own + np.nan_to_num(shared + 2 * by_row * shifts[0, 1:]))
    return replace(found, camera_cov=cov, projector_sigma=sigma)


def _drawn_by_light(marks: Marks) -> Array:
    """How far (m, 2), px, to the brighter side of uneven light it is that projector coordinates are read.

    Decoding takes out what changes of the light do that are beyond noise, as at a dot's rim. The light's own slope, in
    the middle of a dot, is not; where the rim's blur reaches the middle, some of it is.
    """
    if marks.light is None:
        return np.zeros_like(marks.uv)
    radius = np.sqrt(np.abs(np.linalg.det(marks.ellipse)))
    middle = np.clip((radius - RIM_BLURS * marks.blur) / (INTERIOR * radius), 0, 1)
    share = BLURRED + (1 - BLURRED) * middle
    return (share * np.maximum(marks.blur**2 - READ_BETWEEN, 0) / WIDE)[:, None] * marks.light


def _projector(sight: Sight, marks: Marks, drawn: Array) -> tuple[Array, Array]:
    """Projector coordinates (n, 2) and sigmas at the targets' centres as measured, round which their pixels lie.

    `drawn`, (n, 2), is how blur that varies draws them, as `widening` gives it.

    Where a pixel at the centre is not decoded, or wrong, the rest of the dot tells; where the dot is not, or is printed
    dark, the board round it, which lies in the same surface.
    """
    phase, (ellipse, window) = sight.phase, (marks.ellipse, marks.window)
    # what is seen there is round the target's centre
    centre = marks.uv + marks.shift - LIGHT * drawn
    ground, dark = np.minimum(window, marks.code - BESIDE_CODE), sight.testfield.polarity == "black-on-white"
    coordinate, sigma = np.full((len(centre), 2), np.nan), np.full((len(centre), 2), np.nan)
    for axis, (values, spread) in enumerate(((phase.u, phase.sigma_u), (phase.v, phase.sigma_v))):
        found, error = bilinear(values, spread, centre)
        found[refuse_jumps(values, centre, ellipse, found, error)] = np.nan
        lost = ~np.isfinite(found)
        lit = decoded_inside(values, centre, ellipse)
        inside = lit & (not dark), np.zeros_like(window), np.minimum(window, INTERIOR)
        around = dark | (lost & ~lit), ground, ground + RING
        unread, bend = dark | lost, np.full((len(centre), 4), np.nan)
        for rough in (ROUGH, 1.0):  # how the surface bends, all targets tell together
            for which, *rest in (inside, around):
                dots = (each[which] for each in (centre, ellipse, *rest, bend))
                value, its_error = middle_of_surface(values, spread, *dots)
                valid = np.isfinite(value) & (unread[which] | (its_error < rough * error[which]))
                better = np.flatnonzero(which)[valid]
                found[better], error[better] = value[valid], its_error[valid]
            unread = np.isnan(found)
            if rough > 1.0 and np.isnan(bend := bends(centre, found, error)).all():
                break
        error[~np.isfinite(found)] = np.nan
        coordinate[:, axis], sigma[:, axis] = found, error
    return coordinate, sigma
