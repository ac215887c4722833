"""The verdicts on calibrations, planes and points: what `core.checks` finds in a project's results, put together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import combinations
from math import ceil, sqrt
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from core.errors import AdjustmentError, InputError
from core.geometry import knows, pair_of
from core.model import (
    UNJUDGED,
    Adjustment,
    Array,
    Calibration,
    Capture,
    Concern,
    DepthCalibration,
    Method,
    Network,
    Note,
    Pair,
    PhaseMap,
    PhotogrammetricCalibration,
    PlaneEvaluation,
    PointCloud,
    Verdict,
    named_by,
    verdict_of,
)
from core.numerics import median_of
from core.pipeline.evidence import (
    HARMLESS,
    Evidence,
    frames_named,
    has_one_value,
    is_white_of,
    noted,
    shows_all_or_no_light,
)
from core.pipeline.methods import METHODS
from core.project.contents import contents_of

if TYPE_CHECKING:
    from core.checks.planes import Form

BENT_BY = 150  # pixels tell how a calibration's errors bend a plane
MOST_PIXELS, PATCH_PX = 500_000, 96  # that are found in another camera's image; side of a patch
PLACES = 1000  # means of pixels that tell whether a rig has moved so far that it matters to points
OFF_EPIPOLAR = 1.2  # r.m.s. epipolar residuals over what the noise leaves; less matters to points in depth alone
OFF_IN_DEPTH = 4.0  # standard deviations of a change of depth; by chance once in 16,000 captures
FAR, MOST_FAR = 5.0, 0.05  # sigmas by which depths of a pixel differ by chance never; share of pixels that may be rims


def judge_adjustment(adjustment: Adjustment) -> Adjustment:
    """Judge the adjustment of a network on its own."""
    from core.calibrate import CALIBRATION_OPTIONS, AdjustOptions, adjust
    from core.checks import adjustment_concerns, given_concerns, nominal_concerns, sound_words

    nominal = nominal_concerns(adjustment.devices)

    def anew(network: Network, rejecting: bool) -> Adjustment:
        beyond = CALIBRATION_OPTIONS.reject_beyond if rejecting else None
        return adjust(network, options=AdjustOptions(reject_beyond=beyond))

    loose = (c for c in adjustment.doubts if c.about == "rigid")  # the cause of much that follows
    concerns = [*loose, *given_concerns(adjustment, anew), *adjustment_concerns(adjustment), *nominal]
    return replace(adjustment, verdict=verdict_of(concerns, sound_words(adjustment)))


def judge_calibrations(evidence: Evidence) -> dict[Method, Calibration]:
    """Judge the calibrations of one run, each by itself and against the other, and list what was left out."""
    from core.checks import code_concerns, grey_concerns, repeated_frames, repeated_targets, response_concerns

    projectors = evidence.project.rig.projectors
    taking_part = {c.name for chosen in evidence.used.values() for c in chosen}
    looked_at = [c for c in evidence.captures if c.name in taking_part or c.role in ("plane", "object")]
    known = contents_of(evidence.project.path).learn(frame.place for c in looked_at for frame in c.frames)
    used = {known.get(frame.place) for c in looked_at if c.name in taking_part for frame in c.frames}
    contents = {place: key for place, key in known.items() if key in used}  # of the rest, `evaluate` tells
    sets = [t for t in evidence.sets if t.capture in taking_part]
    looks = has_one_value, shows_all_or_no_light, is_white_of
    twice = repeated_frames(looked_at, projectors, contents, *looks, strange=frames_named(sets))
    twice = twice or repeated_targets(sets)
    of_captures, greys = ([*twice, *code_concerns(evidence.captures, projectors)], grey_concerns(sets))
    of_captures += response_concerns(sets, projectors)
    result: dict[Method, Any] = dict(evidence.calibrations)
    for name, calibration in result.items():
        found = METHODS[name].judge(evidence, name, calibration)
        verdict = _verdict([*of_captures, *evidence.said(name), *greys], found.concerns, found.sound)
        result[name] = replace(calibration, verdict=verdict, left_out=found.left_out)
    return result


def _verdict(of_captures: Sequence[Concern], concerns: Sequence[Concern], sound: Sequence[str]) -> Verdict:
    """Put causes before effects: where a result failed, what is wrong with its captures comes first."""
    if any(c.state == "failed" for c in concerns):
        of_captures = [replace(c, state="failed") for c in of_captures]
    return verdict_of([*of_captures, *concerns], sound)


def judge_planes(
    evaluations: Sequence[PlaneEvaluation],
    seen: Mapping[tuple[str, Method, str, str], tuple[Form, float, Sequence[str]]],
    verdicts: Mapping[Method, Verdict | None] | None = None,
    repeated: Mapping[str, str] | None = None,
) -> tuple[PlaneEvaluation, ...]:
    """Judge planes, each against its prediction and all against each other.

    `seen` is by capture, method, camera and projector the form of the deviations, what the calibration's own
    uncertainty adds to them, mm r.m.s., and what the capture and these devices say of themselves; `verdicts` are those
    of the calibrations, which no plane's is better than; `repeated` gives by capture the one whose frames it has, too.
    """
    from core.checks import pair_concerns, plane_concerns, plane_words

    common = [
        Concern("failed", f"{b} shows the frames of {a}, but for scale and noise: copied there? Record one again", name)
        for b, a in (repeated or {}).items()
        for name in (a, b)
    ]
    single = [e for e in evaluations if e.capture not in (repeated or {})]
    for devices in dict.fromkeys(e.devices for e in single):
        common += pair_concerns([e for e in single if e.devices == devices])
    judged = []
    for e in evaluations:
        form, rms, said = seen[e.capture, e.method, *e.devices]
        concerns = plane_concerns(e, form, rms)
        of_capture = noted({e.capture: tuple(dict.fromkeys(said))})
        named = [c for c in common if c.about in ("", e.capture)]
        if verdicts is not None and e.method in verdicts:
            named += based_on(e.method, verdicts[e.method])
        judged.append(replace(e, verdict=_verdict(of_capture, [*concerns, *named], plane_words(e))))
    return tuple(judged)


def judge_points(
    cloud: PointCloud,
    said: Mapping[str, Sequence[str]],
    method: Method,
    calibration: Calibration,
    extrapolated: int = 0,
) -> PointCloud:
    """Judge points by what their captures say of themselves (`said_of`, by name), and by their calibration.

    `extrapolated` of them lie where the calibration saw nothing.
    """
    notes = {name: [note for note in own if named_by(note) not in HARMLESS] for name, own in said.items()}
    concerns = [*based_on(method, calibration.verdict), *noted(notes)]
    count = int(np.count_nonzero(cloud.valid))
    if not count:
        concerns.append(Concern("failed", f"no points: {METHODS[method].outside}, every decoded pixel"))
    elif extrapolated:
        text = (
            f"{extrapolated} of {count} points lie beyond the calibrated depths, where nothing shows how curves go on: "
            "no sigma contains that"
        )
        concerns.append(Concern("doubtful", text))
    if cloud.sight is not None:
        from core.reconstruct import Sight

        miss = int(np.count_nonzero(cloud.sight[cloud.valid] == Sight.DISAGREE))
        if miss > MOST_FAR * count:
            text = (
                f"in {miss} of {count} points the rays of several devices miss one another: part of it moved between "
                "their images; these points have larger sigmas (sight 4)"
            )
            concerns.append(Concern("doubtful", text))
    return replace(cloud, verdict=verdict_of(concerns))


def based_on(method: Method, verdict: Verdict | None) -> list[Concern]:
    """Say what a calibration's verdict means for what is made with it, which is no better."""
    verdict = verdict or UNJUDGED
    if verdict.state == "passed" or not verdict.because:
        return []
    state: Literal["failed", "doubtful"] = "failed" if verdict.state == "failed" else "doubtful"
    return [Concern(state, f"its {method} calibration is {verdict.state}: {verdict.because[0]}")]


def said_of(
    capture: Capture,
    phases: Sequence[PhaseMap],
    calibration: Calibration | Pair,
    rays: Literal["all", "cameras"] = "all",
) -> tuple[str, ...]:
    """What a capture and its phase maps say of themselves, and whether its devices stood as they were calibrated.

    Cameras are held against each other, too, unless a pair with a projector has told already: what moved between their
    images each of them sees as it should be. A corrected pair stands as it should. Of `rays` from cameras alone, the
    projector only labels places.
    """
    several = len({phase.camera for phase in phases}) > 1
    of_frames = [(f"{phase.camera}: " if several else "", note) for phase in phases for note in phase.notes]
    said: list[str] = [*capture.notes, *(Note(f"{by}{note}", named_by(note)) for by, note in of_frames)]
    if not isinstance(calibration, PhotogrammetricCalibration):
        return tuple(dict.fromkeys(said))
    moved: list[str] = []
    if rays == "all":
        for phase in phases:
            if knows(calibration, phase.camera, phase.projector):
                moved += _moved(phase, calibration, capture.name)
        moved += _depths_apart(phases, calibration)
    if not moved:
        from core.reconstruct import seen_by_other

        for own, other in combinations(phases, 2):
            if own.projector == other.projector and {own.camera, other.camera} <= set(calibration.devices):
                pair = pair_of(calibration, own.camera, other.camera)
                moved += _moved(seen_by_other(_in_patches(own), other), pair, capture.name)
    return tuple(dict.fromkeys([*said, *moved]))


def _in_patches(phase: PhaseMap) -> PhaseMap:
    """Keep patches of a large image, spread over it: to find all its pixels in another one takes long."""
    n = ceil(sqrt(np.count_nonzero(np.isfinite(phase.u) & np.isfinite(phase.v)) / MOST_PIXELS))
    if n < 2:
        return phase
    row, column = (np.arange(size) // PATCH_PX % n == 0 for size in phase.u.shape)
    return replace(phase, u=np.where(row[:, None] & column, phase.u, np.float32(np.nan)))


def _moved(phase: PhaseMap, calibration: PhotogrammetricCalibration | Pair, capture: str) -> tuple[str, ...]:
    """Say whether two devices see an object off each other's epipolar lines."""
    from core.orient import OrientOptions, find_motion

    try:
        motion = find_motion(phase, calibration, capture=capture, options=OrientOptions(most_places=PLACES))
    except InputError:  # one axis, or too few pixels
        return ()
    except AdjustmentError as error:
        return (f"{error.seen}: {error.remedy}",)
    deeper, sigma = motion.depth_change_mm, motion.depth_sigma_mm
    off = motion.residual_rms >= OFF_EPIPOLAR * motion.corrected_rms
    if not motion.moved or not (off or abs(deeper) > OFF_IN_DEPTH * sigma):
        return ()
    if not off:  # turned in the plane of both axes, a device hardly leaves the epipolar lines
        return (
            f"{phase.camera} and {phase.projector} do not see it as they were calibrated: with the movement taken out, "
            f"depths change by {deeper:+.2g} ± {sigma:.1g} mm (p = {motion.p:.1g}): one of them moved since, or the "
            "frames are shifted or of another rig; see `stripe-core orient`, or calibrate again",
        )
    return (
        f"{phase.camera} and {phase.projector} do not see it as they were calibrated: epipolar residuals of "
        f"{motion.residual_rms:.2g} where noise leaves {motion.corrected_rms:.2g} (p = {motion.p:.1g}): one of them "
        "moved since, or the frames are shifted or of another rig; see `stripe-core orient`, or calibrate again",
    )


def _depths_apart(phases: Sequence[PhaseMap], calibration: PhotogrammetricCalibration) -> Iterator[str]:
    """Say where a camera sees an object at other depths by one projector than by another, each of which fits it."""
    from core.reconstruct import reconstruct

    def seen(phase: PhaseMap) -> tuple[Array, Array, Array]:
        """Z of the pixels, and the variances of it by noise and by all."""
        cloud = reconstruct(phase, calibration)
        assert cloud.sigma_mm is not None
        assert cloud.sigma_depth_mm is not None
        z, noise, whole = (
            a.astype(float) for a in (cloud.xyz_mm[..., 2], cloud.sigma_depth_mm, cloud.sigma_mm[..., 2])
        )
        return z, noise**2, whole**2

    several = Counter(phase.camera for phase in phases)
    found = []
    for phase in phases:
        if several[phase.camera] > 1 and knows(calibration, phase.camera, phase.projector):
            with suppress(InputError):  # one axis, or none of it in front
                found.append((phase, *seen(phase)))
    for (one, a, *of_a), (two, b, *of_b) in combinations(found, 2):
        if one.camera != two.camera:
            continue
        off, noise, variance = a - b, of_a[0] + of_b[0], of_a[1] + of_b[1]
        both = np.isfinite(off)
        if np.count_nonzero(both) < PLACES:
            continue
        off, noise, variance = off[both], noise[both], variance[both]
        deeper, far = median_of(off), float(np.mean(np.abs(off) > FAR * np.sqrt(variance)))
        # as if both erred by themselves: what they have in common by the camera makes their difference surer
        sigma = float(np.sqrt(max(median_of(variance - noise), 0.0) + median_of(noise) / PLACES))
        if abs(deeper) > OFF_IN_DEPTH * sigma or far > MOST_FAR:
            yield (
                f"{one.camera} sees it at other depths by {two.projector} than by {one.projector}: {deeper:+.2g} ± "
                f"{sigma:.1g} mm in the median, and {far:.0%} of the pixels by more than {FAR:g} sigmas: it moved "
                "between their frames, or a device did since the calibration; capture it again, or calibrate again"
            )


def bend_rms(e: PlaneEvaluation, cloud: PointCloud, calibration: Calibration) -> float:
    """What the calibration's uncertainty alone makes of a plane's deviations, mm r.m.s.: it bends the plane.

    Of points by several devices, what it adds to their depths, though much of that moves the plane as a whole.
    """
    from core.checks import bend_of_plane, fields_at, independent_errors
    from core.evaluate import points_on_plane
    from core.reconstruct.lookup import moved_points

    of_pair = isinstance(calibration, PhotogrammetricCalibration) and e.devices[1] in calibration.projectors
    if e.camera is None or not (of_pair or isinstance(calibration, DepthCalibration)):
        return _depth_rms(cloud)
    row, column = np.nonzero(np.isfinite(e.deviation_mm))
    uv = np.stack([column, row], axis=1)[:: max(1, len(row) // BENT_BY)].astype(float)
    if isinstance(calibration, DepthCalibration):
        xyz = points_on_plane(e.plane, calibration.camera_spec, e.camera, uv)
        errors = () if calibration.covariance is None else independent_errors(calibration.covariance)
        return bend_of_plane(moved_points(calibration, uv, xyz, errors), xyz, e.plane[:3])
    assert isinstance(calibration, PhotogrammetricCalibration)
    pair = pair_of(calibration, *e.devices)
    xyz = points_on_plane(e.plane, pair.camera.spec, e.camera, uv)
    return bend_of_plane(fields_at(pair, uv, xyz), xyz, e.plane[:3])


def _depth_rms(cloud: PointCloud) -> float:
    if cloud.sigma_mm is None or cloud.sigma_depth_mm is None:
        return 0.0
    squares = cloud.sigma_mm[..., 2] ** 2 - cloud.sigma_depth_mm**2
    squares = squares[np.isfinite(squares)]
    return float(np.sqrt(max(float(squares.mean()), 0.0))) if squares.size else 0.0
