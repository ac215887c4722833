"""The test of the calibrated orientation, and the corrected one with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from core.errors import AdjustmentError, InputError, TooLittleSeenError
from core.geometry import cross_matrix, pair_for, perturbed
from core.model import Array, KnownLength, KnownPoints, Pair, PhaseMap, PhotogrammetricCalibration, RigMotion
from core.numerics import distinct, sigma_by_median
from core.orient.chance import significance_of, stretch_of
from core.orient.known import Observed, measured_length, observed_length, observed_points
from core.orient.residuals import Residuals, Sight, blocks_of, epipolar_residuals, of_middles
from core.progress import SILENT, Progress

HUBER = 2.0  # standard deviations beyond which a residual counts less
GROSS = 25.0  # and beyond which it is no measurement: a wrong word, or two surfaces in one pixel
TILES = 250  # lie on the object: residuals of one, and of neighbours, may hang together
CLEAR = 2.0  # of Politis' rule for how far neighbours agree, doi:10.1081/ETR-120021582
FEWEST_TILES, FEWEST_PIXELS = 30, 500
FOOTPRINT_PX2 = 0.2  # about what lenses and pixels have
FREE = 1e-6
CONTRADICTION = 6.0  # standard deviations: no drift, but another length or other places
LINEAR = 0.05  # standard deviations: residuals that come out as the linear estimate said need no other round
SHRUNK = 0.5  # of the drift that is allowed for: what stays above is not observed


@dataclass(frozen=True)
class OrientOptions:
    """How the rig is watched."""

    significance: float = 1e-3  #: share of captures of an unmoved rig that may be called moved
    #: rotation_prior_rad, shift_prior_mm, interior_prior: standard deviation of what rigs drift by, as observations of
    #: zero; that of c, x0 and y0 as a share of c
    rotation_prior_rad: float = 2e-3
    shift_prior_mm: float = 0.5
    interior_prior: float = 5e-4
    stretch: float = 1.0  #: times as much of shift and interior; a capture that contradicts it stretches it further
    most_places: int = 4_000  #: pixels are averaged over blocks down to about so many
    rounds: int = 4  #: of the linearised estimate, at the most


DEFAULT = OrientOptions()


@dataclass(frozen=True)
class Freedom:
    """What is estimated, along f directions."""

    directions: Array  # (k, f) in the space of the pair's parameters
    moves: Array  # (6, f), rotation and shift of the projector in the camera's frame
    drift: Array  # (f,), standard deviation of what is expected


@dataclass(frozen=True)
class _Estimate:
    """An estimate x (f,), its covariance by noise (f, f), and what it makes of errors of all parameters (f, k)."""

    x: Array
    noise: Array
    carried: Array
    rest: Array  # (n,), what remains of the residuals


@dataclass(frozen=True)
class _Places:
    """How places lie in the image: their rows and columns (n, 2) in a grid, of whose steps a tile has so many."""

    at: NDArray[np.int64]
    tile: float

    def together(self, residuals: Array, used: float) -> tuple[float, int]:
        """By how much the sum of residuals (n,) varies more than if they were independent, and its degrees of freedom.

        From their autocovariance by Bartlett's kernel over two tiles, but with a flat top as far as neighbours clearly
        agree (Politis and Romano, doi:10.1111/j.1467-9892.1995.tb00223.x): it would take too little of what they share.
        A fit has used up so many of what these sums show.
        """
        n, reach = len(residuals), int(np.ceil(2 * self.tile))
        at = self.at - self.at.min(axis=0)
        grid = np.zeros(at.max(axis=0) + 1)
        grid[at[:, 0], at[:, 1]] = residuals
        padded = [max(size, reach + 1) + reach for size in grid.shape]
        products = np.fft.irfft2(np.abs(np.fft.rfft2(grid, padded)) ** 2, padded)
        lag = np.arange(-reach, reach + 1)
        agreement = products[np.ix_(lag, lag)] / products[0, 0]
        fall = np.maximum(1 - np.abs(lag) / (2 * self.tile), 0.0)
        ring = np.rint(np.hypot(lag, lag[:, None])).astype(int)
        members = np.bincount(ring.ravel())[:reach]
        clear = np.bincount(ring.ravel(), agreement.ravel())[:reach] > CLEAR * np.sqrt(2 * members * np.log10(n) / n)
        flat = int(np.argmin(clear)) if not clear.all() else reach
        kernel = np.where(ring < flat, 1.0, fall * fall[:, None])
        left = max(1 - used * float(kernel.sum()) / n, 0.1)
        return max(float(np.sum(kernel * agreement)), 0.1) / left, int(n / np.sum(kernel**2))


@dataclass(frozen=True)
class _Equations:
    """Residuals as they were before any change of the parameters, with all that they change with."""

    e: Array
    A: Array  # (n, k)
    pulled: Array
    places: _Places
    known: Sequence[Observed]

    def solved(self, free: Freedom, prior: Array, weight: Array, noise: Array) -> _Estimate:
        """Estimate along free directions, with observations of zero of weights `prior` (f, f) on them.

        The covariance by `noise` (n,) is the sandwich form of White, doi:10.2307/1912934.
        """
        f = free.directions.shape[1]
        B = np.column_stack([self.A @ free.directions, self.pulled])
        whole = np.zeros((f + 1, f + 1))
        whole[:f, :f], whole[f, f] = prior, FOOTPRINT_PX2**-2.0
        weighted = B * weight[:, None]
        N, H, score, scatter = weighted.T @ B, weighted.T @ self.A, weighted.T @ self.e, np.zeros((f + 1, f + 1))
        for known in self.known:
            own = np.column_stack([known.A @ free.directions, np.zeros(len(known.A))])
            N, H, score = N + own.T @ own, H + own.T @ known.A, score + own.T @ known.rest
            scatter += own.T @ own
        inverse = np.linalg.inv(N + whole)
        x = inverse @ score
        rest = self.e - B @ x
        scores = weighted * noise[:, None]
        scatter += scores.T @ scores
        scatter[f, f] += whole[f, f]
        return _Estimate(x[:f], (inverse @ scatter @ inverse)[:f, :f], inverse[:f] @ H, rest)

    def noise(self, changes: Array, weight: Array) -> tuple[Array, int]:
        """Noise (n,) and its degrees of freedom: what remains where all parameters may change, (k, m) by a sigma each.

        Errors of the calibration leave patterns that no movement explains; they are the same in every capture, and
        accounted for as such. It is larger by what hangs together among neighbours.
        """
        Z = np.column_stack([self.A @ changes, FOOTPRINT_PX2 * self.pulled])
        weighted = Z * weight[:, None]
        N = weighted.T @ Z
        inverse = np.linalg.inv(N + np.eye(len(N)))
        used = float(np.trace(inverse @ N))
        rest = self.e - Z @ (inverse @ (weighted.T @ self.e))
        factor, freedom = self.places.together(weight * rest, used)
        return rest * np.sqrt(factor), freedom


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
    ``(I - E (N + P)⁻¹ H) (δ + E m) - E (N + P)⁻¹ noise``, whatever P is. The test is of no movement of the five, by the
    estimate without the drifts that is linear at the calibration: Rao's, doi:10.1017/S0305004100023987. Elsewhere the
    products of rotations and shifts that hardly show would exceed the sigma of those that show well.
    """
    pair = pair_for(phase, calibration)
    sight, side, tile = blocks_of(phase, options.most_places, TILES)
    sight = of_middles(sight, side, pair)
    sight, start = _checked(sight, epipolar_residuals(sight, pair), (side, tile), phase, capture)
    places = _Places(sight.at, tile)
    five = orientation_freedom(pair, options)
    every = _everything(pair, options)
    free = every if lengths or points is not None else five
    prior = np.diag(free.drift**-2.0)
    now, change = start, np.zeros(len(free.directions))
    for i in range(options.rounds):
        progress(0.2 + 0.6 * i / options.rounds, "turning the projector")
        progress.check()
        equations = _equations(now, pair, change, phase, lengths, points, places)
        if i == 0:
            first = equations
            _refuse_contradictions(equations.known, pair, free, capture)
        estimate, weight = _robust(equations, free, prior)
        change = free.directions @ estimate.x
        expected = equations.e - equations.A @ change
        now = epipolar_residuals(sight, perturbed(pair, change))
        if not np.isfinite(now.e).all():
            lines = float(np.median(np.abs(start.e) * np.linalg.norm(sight.sigma, axis=1) / np.sqrt(2)))
            raise AdjustmentError(
                capture,
                f"camera and projector see it {lines:.2g} lines off each other's rays, and no movement explains it",
                "one of them was turned round, exchanged or mirrored, or the frames are of another rig: see to that, "
                "or calibrate again",
            )
        if not equations.known and np.abs(now.e - expected).max() < LINEAR:
            break
    C = pair.covariance
    noise, freedom = equations.noise(
        np.column_stack([np.diag(np.sqrt(np.diagonal(C))), free.directions * free.drift]), weight
    )
    estimate = equations.solved(free, prior, weight, noise)
    shown = replace(first, known=()).solved(five, FREE * np.diag(five.drift**-2.0), weight, noise)
    of_shown = shown.noise + shown.carried @ C @ shown.carried.T
    p = significance_of(shown.x, of_shown, freedom)
    left = np.eye(len(C)) - free.directions @ estimate.carried
    drifted = C + free.directions @ np.diag(free.drift**2) @ free.directions.T
    by_noise = free.directions @ estimate.noise @ free.directions.T
    corrected = replace(perturbed(pair, change), covariance=left @ drifted @ left.T + by_noise)
    gain = estimate.carried
    missed = gain @ every.directions - free.moves.T @ every.moves
    by_rest, by_drift = estimate.noise + gain @ C @ gain.T, gain @ every.directions * every.drift
    spread = by_rest + missed @ np.diag(every.drift**2) @ missed.T
    stretch = stretch_of(estimate.x, by_rest, by_drift, free.drift)
    if stretch > 1:
        return find_motion(
            phase,
            calibration,
            lengths=lengths,
            points=points,
            capture=capture,
            options=replace(options, stretch=options.stretch * stretch),
            progress=progress,
        )
    by_depth = -np.median(now.by_xyz[:, 2], axis=0)
    return RigMotion(
        capture=capture,
        moved=bool(p < options.significance),
        p=p,
        rotation_rad=(free.moves @ estimate.x)[:3],
        shift_mm=(free.moves @ estimate.x)[3:],
        covariance=free.moves @ spread @ free.moves.T,
        depth_change_mm=float(np.median(start.xyz_mm[:, 2] - now.xyz_mm[:, 2])),
        depth_sigma_mm=float(np.sqrt(by_depth @ corrected.covariance @ by_depth)),
        pixels=len(sight.at) * side**2,
        residual_rms=_of_pixels(start.e, side),
        corrected_rms=_of_pixels(estimate.rest, side),
        pair=corrected,
        change=change,
        shown=shown.x,
        noise=shown.noise,
        by_calibration=shown.carried,
        tiles=freedom,
        lengths=tuple(lengths),
        lengths_mm=tuple(
            (measured_length(known, phase, pair)[0], measured_length(known, phase, corrected)[0]) for known in lengths
        ),
        points=0 if points is None else len(points.xyz_mm),
        stretch=options.stretch,
        camera=phase.camera,
        projector=phase.projector,
        **({} if free is five else {"unobserved": _unobserved(pair, corrected, options)}),
    )


def _checked(
    sight: Sight, found: Residuals, sides: tuple[int, float], phase: PhaseMap, capture: str
) -> tuple[Sight, Residuals]:
    """Leave out what is no measurement, and see that enough is left."""
    if len(sight.at):
        with np.errstate(invalid="ignore"):
            kept = np.abs(found.e - np.nanmedian(found.e)) < GROSS * max(float(np.nanstd(found.e)) / 5, 1.0)
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
    drifted = pair.covariance + free.directions @ np.diag(free.drift**2) @ free.directions.T
    for each in known:
        expected = np.sqrt(1 + np.einsum("nk,kl,nl->n", each.A, drifted, each.A))
        off = float(np.max(np.abs(each.rest) / expected))
        if off > CONTRADICTION:
            raise InputError(
                capture,
                f"{each.name} is {off:.0f} standard deviations from what the calibration and likely drifts allow",
                "check the places, that only the feature lies within their radius, and the length; or calibrate again",
            )


def _motion_of(pair: Pair) -> Array:
    """From changes of the pair's parameters to rotation and shift of the projector in the camera's frame, (6, k)."""
    # R' = R exp(-w) = exp(-R w) R, and t' = -R' (p + s)
    pose = pair.projector_from_camera
    R, t = pose.rotation, pose.translation_mm
    J = np.zeros((6, len(pair.covariance)))
    J[:3, -6:-3] = -R.T
    J[3:, -3:] = -R.T
    J[3:, -6:-3] = -R.T @ cross_matrix(t)
    return J


def orientation_freedom(pair: Pair, options: OrientOptions) -> Freedom:
    """What the residuals alone show: all rotations, and two shifts across the base."""
    base = pair.projector_from_camera.origin_mm
    across = np.linalg.svd(base[None])[2][1:]
    moves = np.zeros((6, 5))
    moves[:3, :3], moves[3:, 3:] = np.eye(3), across.T
    drift = np.repeat([options.rotation_prior_rad, options.stretch * options.shift_prior_mm], [3, 2])
    return Freedom(_moves(pair) @ moves, moves, drift)


def _everything(pair: Pair, options: OrientOptions) -> Freedom:
    """What something known shows as well: the whole orientation, and c, x0, y0 of both devices."""
    i, k = len(pair.camera.interior.vector), len(pair.covariance)
    inner = np.zeros((k, 6))
    inner[[0, 1, 2, i, i + 1, i + 2], range(6)] = 1.0
    c = np.repeat([pair.camera.interior.c_mm, pair.projector.interior.c_mm], 3)
    drift = np.repeat([options.rotation_prior_rad, options.stretch * options.shift_prior_mm], 3)
    directions = np.column_stack([_moves(pair), inner])
    return Freedom(directions, np.eye(6, 12), np.concatenate([drift, options.stretch * options.interior_prior * c]))


def _moves(pair: Pair) -> Array:
    """From rotation and shift of the projector in the camera's frame to the pair's parameters, (k, 6)."""
    moves = np.zeros((len(pair.covariance), 6))
    moves[-6:] = np.linalg.inv(_motion_of(pair)[:, -6:])
    return moves


def _equations(
    now: Residuals,
    pair: Pair,
    change: Array,
    phase: PhaseMap,
    lengths: Sequence[KnownLength],
    points: KnownPoints | None,
    places: _Places,
) -> _Equations:
    """Refer residuals after a change of the parameters to the calibration."""
    there = perturbed(pair, change)
    known = [observed_length(length, phase, there) for length in lengths]
    known += [] if points is None else [observed_points(points, there)]
    referred = [replace(each, rest=each.rest + each.A @ change) for each in known]
    return _Equations(now.e + now.A @ change, now.A, now.pulled, places, referred)


def _robust(equations: _Equations, free: Freedom, prior: Array) -> tuple[_Estimate, Array]:
    """Estimate by Huber's weights, iterated to rest; give the weights, too."""
    weight, last = np.ones(len(equations.e)), np.full(free.directions.shape[1], np.inf)
    for _ in range(8):
        estimate = equations.solved(free, prior, weight, np.zeros(len(weight)))
        if np.abs(estimate.x - last).max() < 1e-9:
            break
        limit, last = HUBER * max(sigma_by_median(estimate.rest), 1.0), estimate.x
        weight = np.minimum(1.0, limit / np.maximum(np.abs(estimate.rest), 1e-12))
    return estimate, weight


def _of_pixels(e: Array, side: int) -> float:
    """The spread of residuals of blocks as that of single pixels, whose own noise is what it is said to be."""
    return float(np.sqrt(max(1 + (sigma_by_median(e) ** 2 - 1) / side**2, 0.0)))


def _unobserved(pair: Pair, corrected: Pair, options: OrientOptions) -> tuple[str, ...]:
    """Name what is known hardly better than how rigs drift."""
    i = len(pair.camera.interior.vector)
    base = pair.projector_from_camera.origin_mm
    along = np.concatenate([np.zeros(3), base / np.linalg.norm(base)]) @ _motion_of(pair)
    sigma = np.sqrt(np.diagonal(corrected.covariance))
    named = (
        ("base length", float(np.sqrt(along @ corrected.covariance @ along)), options.shift_prior_mm),
        ("c of the camera", sigma[0], options.interior_prior * pair.camera.interior.c_mm),
        ("c of the projector", sigma[i], options.interior_prior * pair.projector.interior.c_mm),
    )
    return tuple(name for name, left, drift in named if left > SHRUNK * drift)
