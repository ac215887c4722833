"""The test of the calibrated orientation, and the corrected one with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from core.algebra import on_own_threads
from core.errors import AdjustmentError, InputError, TooLittleSeenError
from core.geometry import pair_for, perturbed
from core.lazy import dataclass
from core.model import Array, KnownLength, KnownPoints, Pair, PhaseMap, PhotogrammetricCalibration, RigMotion
from core.numerics import distinct, median_of, sigma_by_median
from core.orient.equations import Equations, Estimate, Places, robust_estimate
from core.orient.freedom import (
    DEFAULT,
    Freedom,
    OrientOptions,
    motion_of,
    orientation_freedom,
    significance_of,
    stretch_of,
    whole_freedom,
)
from core.orient.known import Observed, calibrated_length, measured_length, observed_length, observed_points
from core.orient.residuals import Residuals, Sight, blocks_of, epipolar_residuals, of_middles
from core.progress import SILENT, Progress

GROSS = 25.0  # and beyond which it is no measurement: a wrong word, or two surfaces in one pixel
MOST_BEHIND = 0.5  # share of places whose points may lie behind the rig or nowhere
TILES = 250  # lie on the object: residuals of one, and of neighbours, may hang together
FEWEST_TILES, FEWEST_PIXELS = 30, 500
FREE = 1e-6
CONTRADICTION = 6.0  # standard deviations: no drift, but another length or other places
LINEAR = 0.05  # standard deviations: residuals that come out as the linear estimate said need no other round
SHRUNK = 0.5  # of the drift that is allowed for: what stays above is not observed


@dataclass(frozen=True)
class _Scene:
    """What a capture shows of a pair of devices, and what is known of the scene."""

    capture: str
    phase: PhaseMap
    pair: Pair
    sight: Sight
    start: Residuals  # by the calibration
    places: Places
    lengths: Sequence[KnownLength]
    points: KnownPoints | None

    def equations(self, now: Residuals, change: Array) -> Equations:
        """Refer residuals after a change of the parameters to the calibration."""
        there = perturbed(self.pair, change)
        known = [observed_length(length, self.phase, there) for length in self.lengths]
        known += [] if self.points is None else [observed_points(self.points, there)]
        referred = [replace(each, rest=each.rest + each.A @ change) for each in known]
        return Equations(now.e + now.A @ change, now.A, now.pulled, self.places, referred)


@dataclass(frozen=True)
class _Turned:
    """The equations at the calibration and of the last round, weights (n,), and the change they led to."""

    first: Equations
    last: Equations
    weight: Array
    change: Array
    now: Residuals


@dataclass(frozen=True)
class _Judged:
    """What the turned projector tells, and how well; `shown` is the estimate of the five without drifts."""

    estimate: Estimate
    shown: Estimate
    p: float
    tiles: int
    corrected: Pair
    covariance: Array  # (6, 6), of rotation and shift
    stretch: float


@on_own_threads()
def find_motion(
    phase: PhaseMap,
    calibration: PhotogrammetricCalibration | Pair,
    *,
    lengths: Sequence[KnownLength] = (),
    points: KnownPoints | None = None,
    capture: str = "capture",
    options: OrientOptions = DEFAULT,
    progress: Progress = SILENT,
) -> RigMotion:
    """Say whether the projector still stands where the calibration put it, and where it stands now.

    Parameters
    ----------
    phase : PhaseMap
        Of any object, with columns and rows.
    lengths, points
        What is known of the scene; targets measured before.

    Raises
    ------
    TooLittleSeenError
        If too few pixels have both coordinates.
    InputError
        If what is known of the scene contradicts the calibration, or too few pixels lie on it.
    AdjustmentError
        If the rig is another one altogether.

    Notes
    -----
    Estimated are three rotations and two shifts across the base; with something known in the scene the base's length,
    too, and c, x0 and y0 of both devices. The estimate is by Huber's weights, with drifts of the given size as
    observations; the pixels' footprint, which draws coordinates to the brighter side, is estimated with it.

    With N the normal equations, P the weights of the drifts, and H what the normals make of all parameters of the
    calibration, the estimate is ``x = (N + P)⁻¹ s`` of scores ``s = H (δ + E m) + noise``, of the calibration's errors
    δ and movements m along the free directions E. The corrected parameters' errors are therefore
    ``(I - E (N + P)⁻¹ H) (δ + E m) - E (N + P)⁻¹ noise``, whatever P is. The test is of no movement of the five, with
    something known of all six, by the estimate without the drifts that is linear at the calibration: Rao's,
    doi:10.1017/S0305004100023987. Elsewhere the products of rotations and shifts that hardly show would exceed the
    sigma of those that show well. A drift of c, x0 and y0 counts as the movement that it looks like.
    """
    pair = pair_for(phase, calibration)
    sight, side, tile = blocks_of(phase, options.most_places, TILES)
    sight = of_middles(sight, side, pair)
    sight, start = _checked(sight, epipolar_residuals(sight, pair), (side, tile), phase, capture)
    scene = _Scene(capture, phase, pair, sight, start, Places(sight.at, tile), lengths, points)
    calibrated_mm = [calibrated_length(known, phase, pair) for known in lengths]
    while True:
        five, every = orientation_freedom(pair, options), whole_freedom(pair, options)
        free = every if lengths or points is not None else five
        turned = _turned(scene, free, options, progress)
        found = _judged(scene, turned, five, free, every)
        if found.stretch <= 1:
            break
        options = replace(options, stretch=options.stretch * found.stretch)
    estimate, shown, now, corrected = found.estimate, found.shown, turned.now, found.corrected
    by_depth = np.array([median_of(of_one) for of_one in now.by_depth.T])
    return RigMotion(
        capture=capture,
        moved=bool(found.p < options.significance),
        p=found.p,
        rotation_rad=(free.moves @ estimate.x)[:3],
        shift_mm=(free.moves @ estimate.x)[3:],
        covariance=found.covariance,
        depth_change_mm=median_of(start.xyz_mm[:, 2] - now.xyz_mm[:, 2]),
        depth_sigma_mm=float(np.sqrt(by_depth @ corrected.covariance @ by_depth)),
        pixels=len(sight.at) * side**2,
        residual_rms=_of_pixels(start.e, side),
        corrected_rms=_of_pixels(estimate.rest, side),
        pair=corrected,
        change=turned.change,
        shown=shown.x,
        noise=shown.noise,
        by_calibration=shown.carried,
        tiles=found.tiles,
        lengths=tuple(lengths),
        lengths_mm=tuple(
            (before, measured_length(known, phase, corrected)[0])
            for known, before in zip(lengths, calibrated_mm, strict=True)
        ),
        points=0 if points is None else len(points.xyz_mm),
        stretch=options.stretch,
        camera=phase.camera,
        projector=phase.projector,
        **({} if free is five else {"unobserved": _unobserved(pair, corrected, options)}),
    )


def _turned(scene: _Scene, free: Freedom, options: OrientOptions, progress: Progress) -> _Turned:
    """Turn the projector until the residuals come out as the linear estimate says."""
    pair, now, change = scene.pair, scene.start, np.zeros(len(free.directions))
    first = last = scene.equations(now, change)
    _refuse_contradictions(first.known, pair, free, scene.capture)
    for i in range(options.rounds):
        progress(0.2 + 0.6 * i / options.rounds, "turning the projector")
        progress.check()
        last = scene.equations(now, change) if i else first
        estimate, weight = robust_estimate(last, free, np.diag(free.drift**-2.0))
        change = free.directions @ estimate.x
        expected = last.e - last.A @ change
        now = epipolar_residuals(scene.sight, perturbed(pair, change))
        if not np.isfinite(now.e).all():
            sigma = np.linalg.norm(scene.sight.sigma, axis=1) / np.sqrt(2)
            lines = float(np.median(np.abs(scene.start.e) * sigma))
            raise AdjustmentError(
                scene.capture,
                f"{scene.phase.camera} and {scene.phase.projector} see it {lines:.2g} lines off each other's rays, and "
                "no movement explains it",
                "one of them was turned round, exchanged or mirrored, or the frames are of another rig: see to that, "
                "or calibrate again",
            )
        if not last.known and np.abs(now.e - expected).max() < LINEAR:
            break
    return _Turned(first, last, weight, change, now)


def _judged(scene: _Scene, turned: _Turned, five: Freedom, free: Freedom, every: Freedom) -> _Judged:
    """Test whether anything that shows has moved, and say how well all is known; see the notes of `find_motion`."""
    pair, C, last, weight = scene.pair, scene.pair.covariance, turned.last, turned.weight
    changes = np.column_stack([np.diag(np.sqrt(np.diagonal(C))), free.directions * free.drift])
    noise, tiles = last.noise(changes, weight)
    estimate = last.solved(free, np.diag(free.drift**-2.0), weight, noise)
    shown = replace(turned.first, known=()).solved(five, FREE * np.diag(five.drift**-2.0), weight, noise)
    six = free.of_pose
    tested = turned.first.solved(six, FREE * np.diag(six.drift**-2.0), weight, noise) if turned.first.known else shown
    p = significance_of(tested.x, tested.noise + tested.carried @ C @ tested.carried.T, tiles)
    gain = estimate.carried
    left = np.eye(len(C)) - free.directions @ gain
    drifted = C + free.covariance
    by_noise = free.directions @ estimate.noise @ free.directions.T
    corrected = replace(perturbed(pair, turned.change), covariance=left @ drifted @ left.T + by_noise)
    missed = gain @ every.directions - free.moves.T @ every.moves
    by_rest, by_drift = estimate.noise + gain @ C @ gain.T, gain @ every.directions * every.drift
    spread = by_rest + missed @ np.diag(every.drift**2) @ missed.T
    stretch = stretch_of(estimate.x, by_rest, by_drift, free.drift)
    return _Judged(estimate, shown, p, tiles, corrected, free.moves @ spread @ free.moves.T, stretch)


def _checked(
    sight: Sight, found: Residuals, sides: tuple[int, float], phase: PhaseMap, capture: str
) -> tuple[Sight, Residuals]:
    """Leave out what is no measurement, and see that enough is left."""
    if len(sight.at) and np.mean(found.xyz_mm[:, 2] < 0) < MOST_BEHIND:
        seen = f"rays of {phase.camera} and {phase.projector} meet behind the rig, or nowhere"
        remedy = "one of them was turned round or exchanged, or the calibration is of another rig or frame: see to that"
        raise AdjustmentError(capture, seen, remedy)
    if len(sight.at):
        with np.errstate(invalid="ignore"):
            kept = np.abs(found.e - median_of(found.e)) < GROSS * max(float(np.nanstd(found.e)) / 5, 1.0)
            kept &= found.xyz_mm[:, 2] < 0
        sight, found = sight.only(kept), found.only(kept)
    side, tile = sides
    if len(sight.at) * side**2 < FEWEST_PIXELS or len(distinct(sight.at // tile @ (1e6, 1.0))) < FEWEST_TILES:
        both = int(np.count_nonzero(np.isfinite(phase.u) & np.isfinite(phase.v)))
        raise TooLittleSeenError(
            capture,
            f"{both or 'no'} pixels have both projector coordinates",
            "capture columns and rows of an object that fills more of the field: else nothing tells of a movement",
        )
    return sight, found


def _refuse_contradictions(known: Sequence[Observed], pair: Pair, free: Freedom, capture: str) -> None:
    """See that what is known of a scene is within what calibration and drifts leave open."""
    drifted = pair.covariance + free.covariance
    for each in known:
        expected = np.sqrt(1 + np.einsum("nk,kl,nl->n", each.A, drifted, each.A))
        off = float(np.max(np.abs(each.rest) / expected))
        if off > CONTRADICTION:
            raise InputError(
                capture,
                f"{each.name} is {off:.0f} standard deviations from what the calibration and likely drifts allow",
                "check the places, that only the feature lies within their radius, and the length; or calibrate again",
            )


def _of_pixels(e: Array, side: int) -> float:
    """The spread of residuals of blocks as that of single pixels, whose own noise is what it is said to be."""
    return float(np.sqrt(max(1 + (sigma_by_median(e) ** 2 - 1) / side**2, 0.0)))


def _unobserved(pair: Pair, corrected: Pair, options: OrientOptions) -> tuple[str, ...]:
    """Name what is known hardly better than how rigs drift."""
    i = len(pair.camera.interior.vector)
    base = pair.projector_from_camera.origin_mm
    along = np.concatenate([np.zeros(3), base / np.linalg.norm(base)]) @ motion_of(pair)
    sigma = np.sqrt(np.diagonal(corrected.covariance))
    named = (
        ("base length", float(np.sqrt(along @ corrected.covariance @ along)), options.shift_prior_mm),
        ("c of the camera", sigma[0], options.interior_prior * pair.camera.interior.c_mm),
        ("c of the projector", sigma[i], options.interior_prior * pair.projector.interior.c_mm),
    )
    return tuple(name for name, left, drift in named if left > SHRUNK * drift)
