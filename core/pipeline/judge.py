"""The verdicts on calibrations and planes: what `core.checks` finds in a project's results, put together."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from core.model import (
    Adjustment,
    Calibration,
    Capture,
    DepthCalibration,
    Method,
    PhotogrammetricCalibration,
    PlaneEvaluation,
    PointCloud,
    Project,
    StationId,
    TargetSet,
    Testfield,
    Verdict,
)
from core.pipeline.folders import all_captures
from core.pipeline.options import CalibrateOptions
from core.pipeline.picking import current_target_sets, current_targets

if TYPE_CHECKING:
    from core.checks import Concern, Plates

FIGURE = re.compile(r"\d+(?:\.\d+)? ?%?")
DOUBTS = ("not rigid", "look like gross errors", "left out, fewer than")  # of the adjustment's own warnings
RESIDUAL_RATIO = 2.5  # of the depth calibration's residuals over those that its noise leaves


def judge_adjustment(adjustment: Adjustment) -> Adjustment:
    """Judge the adjustment of a network on its own."""
    from core.checks import adjustment_concerns, nominal_concerns, verdict_of

    concerns = [*adjustment_concerns(adjustment), *nominal_concerns(adjustment.devices)]
    return replace(adjustment, verdict=verdict_of([*concerns, *_warned(adjustment.warnings)], _sound(adjustment)))


def judge_calibrations(
    project: Project,
    calibrations: Mapping[Method, Calibration],
    adjustment: object,
    used: Mapping[Method, Sequence[Capture]],
    options: CalibrateOptions,
) -> dict[Method, Calibration]:
    """Judge the calibrations of one run, each by itself and against the other, and list what was left out."""
    from core.checks import (
        adjustment_concerns,
        code_concerns,
        left_out_of,
        nominal_concerns,
        repeated_frames,
        repeated_targets,
    )

    captures = all_captures(project)
    kept = current_targets(project)
    lines = project.projector.width, project.projector.height
    taking_part = {c.name for chosen in used.values() for c in chosen}
    sets = current_target_sets(project)
    shown = [c for c in captures if c.name in taking_part or c.role in ("plane", "object")]
    of_captures = [
        *(repeated_frames(shown, lines) or repeated_targets([t for t in sets if t.capture in taking_part])),
        *code_concerns(captures, project.projector),
        *noted({name: kept[name].notes for name in sorted(taking_part) if name in kept}),
    ]
    measured = {m: _of_captures(sets, chosen) for m, chosen in used.items()}
    result: dict[Method, Calibration] = {}
    photogrammetric = calibrations.get("photogrammetric")
    lengths: list[Concern] = []
    if isinstance(photogrammetric, PhotogrammetricCalibration) and isinstance(adjustment, Adjustment):
        targets = measured["photogrammetric"]
        rejected, lonely = _rejected(adjustment, targets)
        lengths = _of_lengths(
            project, photogrammetric, adjustment, used["photogrammetric"][0].testfield, captures, kept
        )
        concerns = [
            *adjustment_concerns(adjustment, rejected),
            *_warned(photogrammetric.warnings),
            *(c for c in lengths if not _of_plate(c, captures)),
            *nominal_concerns(photogrammetric.devices),
        ]
        result["photogrammetric"] = replace(
            photogrammetric,
            verdict=_verdict(of_captures, concerns, _sound(adjustment)),
            left_out=(
                *left_out_of(targets, rejected, _unused(captures, used, "photogrammetric", options)),
                *left_out_of([], lonely, why="seen from one place only"),
            ),
        )
    depth = calibrations.get("polynomial")
    if isinstance(depth, DepthCalibration):
        if not isinstance(photogrammetric, PhotogrammetricCalibration):
            lengths = _of_plates(depth, captures, kept)
        of_plates = [c for c in lengths if _of_plate(c, captures) or c.text.startswith("known lengths")]
        concerns = [*of_plates, *_of_depth(depth)]
        result["polynomial"] = replace(
            depth,
            verdict=_verdict(of_captures, concerns, (f"residuals of {depth.residual_rms_mm:.3g} mm r.m.s.",)),
            left_out=left_out_of(measured["polynomial"], None, _unused(captures, used, "polynomial", options)),
        )
    return result


def noted(notes: Mapping[str, Sequence[str]]) -> list[Concern]:
    """What captures say of themselves, alike ones together."""
    from core.checks import Concern

    by_text: dict[str, list[tuple[str, str]]] = {}
    for name, texts in notes.items():
        for text in texts:
            by_text.setdefault(FIGURE.sub("", text), []).append((name, text))
    concerns = []
    for entries in by_text.values():
        names = [name for name, _ in entries]
        told = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
        concerns.append(Concern("doubtful", f"{told}: {entries[0][1]}"))
    return concerns


def _verdict(of_captures: Sequence[Concern], concerns: Sequence[Concern], sound: Sequence[str]) -> Verdict:
    """Put causes before effects: where a result failed, what is wrong with its captures comes first."""
    from core.checks import verdict_of

    if any(c.state == "failed" for c in concerns):
        of_captures = [replace(c, state="failed") for c in of_captures]
    return verdict_of([*of_captures, *concerns], sound)


def judge_planes(
    evaluations: Sequence[PlaneEvaluation],
    calibration_rms_mm: Mapping[tuple[str, Method, str, str], float],
    notes: Mapping[str, Sequence[str]] | None = None,
) -> tuple[PlaneEvaluation, ...]:
    """Judge planes, each against its prediction and all against each other.

    `calibration_rms_mm` is by capture, method, camera and projector what the calibration's own uncertainty adds to the
    deviations; `notes` is by capture what it says of itself.
    """
    from core.checks import form_of, plane_concerns

    common = [c for pair in dict.fromkeys(e.devices for e in evaluations) for c in _common(evaluations, pair)]
    judged = []
    for e in evaluations:
        form_pv_um, form_rms_mm = form_of(e.deviation_mm)
        e = replace(e, form_pv_um=form_pv_um)
        concerns = plane_concerns(e, form_rms_mm, calibration_rms_mm.get((e.capture, e.method, *e.devices), 0.0))
        sound: list[str] = []
        if e.predicted_rms_mm:
            sound.append(f"noise dominates: {e.rms_mm / e.predicted_rms_mm:.2f} times what the noise predicts")
        of_capture = noted({e.capture: (notes or {}).get(e.capture, ())})
        named = [c for c in common if c.text.startswith(f"{e.capture}:") or not _names_one(c.text, evaluations)]
        judged.append(replace(e, verdict=_verdict(of_capture, [*concerns, *named], sound)))
    return tuple(judged)


def _common(evaluations: Sequence[PlaneEvaluation], devices: tuple[str, str]) -> list[Concern]:
    from core.checks import pair_concerns

    return pair_concerns([e for e in evaluations if e.devices == devices])


def calibration_rms(cloud: PointCloud) -> float:
    """What the calibration's uncertainty alone adds to the points' depths, mm r.m.s."""
    if cloud.sigma_mm is None or cloud.sigma_depth_mm is None:
        return 0.0
    squares = cloud.sigma_mm[..., 2] ** 2 - cloud.sigma_depth_mm**2
    squares = squares[np.isfinite(squares)]
    return float(np.sqrt(max(float(squares.mean()), 0.0))) if squares.size else 0.0


def _names_one(text: str, evaluations: Sequence[PlaneEvaluation]) -> bool:
    return any(text.startswith(f"{e.capture}:") for e in evaluations)


def _of_lengths(
    project: Project,
    calibration: PhotogrammetricCalibration,
    adjustment: Adjustment,
    board: Testfield | None,
    captures: Sequence[Capture],
    kept: Mapping[str, TargetSet],
) -> list[Concern]:
    from core.checks import length_concerns

    plates, plate = _plates(calibration, captures, kept)
    return length_concerns(adjustment, board, project.scale, plates, plate is not None and _same(plate, board))


def _of_plate(concern: Concern, captures: Sequence[Capture]) -> bool:
    """Whether a concern is about the plates alone, which the photogrammetric calibration does not use."""
    names = [c.name for c in captures if c.role == "depth"]
    return concern.text.startswith(("the plate", *(f"{name}:" for name in names)))


def _plates(
    calibration: PhotogrammetricCalibration, captures: Sequence[Capture], kept: Mapping[str, TargetSet]
) -> tuple[Plates | None, Testfield | None]:
    from core.checks import see_plates

    depth = [c for c in captures if c.role == "depth" and c.z_mm is not None and c.testfield is not None]
    if not depth or not any(c.name in kept for c in depth):
        return None, None
    board = depth[0].testfield
    assert board is not None
    z_mm = {
        c.name: c.z_mm for c in depth if c.z_mm is not None and c.testfield is not None and _same(c.testfield, board)
    }
    return see_plates(calibration, [kept[name] for name in z_mm if name in kept], z_mm, board), board


def _same(a: Testfield, b: Testfield | None) -> bool:
    return b is not None and a.index() == b.index() and bool(np.allclose(a.xyz_mm, b.xyz_mm))


def _of_depth(depth: DepthCalibration) -> list[Concern]:
    from core.checks import Concern

    if not depth.noise_rms_mm or depth.residual_rms_mm <= RESIDUAL_RATIO * depth.noise_rms_mm:
        return []
    ratio = depth.residual_rms_mm / depth.noise_rms_mm
    text = (
        f"residuals of {depth.residual_rms_mm:.3g} mm are {ratio:.3g} times what the noise leaves: a plate does not "
        "stand where z_mm says, it is not flat, or the degree is too low"
    )
    return [Concern("failed" if ratio > 2 * RESIDUAL_RATIO else "doubtful", text)]


def _of_plates(depth: DepthCalibration, captures: Sequence[Capture], kept: Mapping[str, TargetSet]) -> list[Concern]:
    """What the plates' own targets say of their positions, where no projector is calibrated."""
    from core.checks import length_concerns, pose_plates

    boards = [c for c in captures if c.role == "depth" and c.testfield is not None and c.name in kept]
    if not boards or boards[0].testfield is None:
        return []
    z_mm = {c.name: c.z_mm for c in boards if c.z_mm is not None}
    plates = pose_plates(depth.camera_spec, depth.camera, [kept[n] for n in z_mm], z_mm, boards[0].testfield)
    return length_concerns(None, None, None, plates, False)


def _of_captures(sets: Sequence[TargetSet], captures: Sequence[Capture]) -> list[TargetSet]:
    wanted = {c.name for c in captures}
    return [t for t in sets if t.capture in wanted]


def _rejected(
    adjustment: Adjustment, targets: Sequence[TargetSet]
) -> tuple[dict[str, tuple[int, int]], dict[str, tuple[int, int]]]:
    """By station, observations left out of how many: gross errors, and points that nothing else sees."""
    network = adjustment.network
    points = set(network.point_names)
    count = np.bincount(network.observation_station, minlength=len(network.station_names))
    left = dict(zip(network.station_names, count.tolist(), strict=True))
    gross, lonely = {}, {}
    for t in targets:
        names = [f"{r}/{c}" for r, c in zip(t.row.tolist(), t.col.tolist(), strict=True)]
        camera = np.asarray(np.isfinite(t.camera_uv).all(axis=1))
        projected = np.asarray(np.isfinite(t.projector_uv).any(axis=1))
        for device, other, seen in ((t.camera, t.projector, camera), (t.projector, t.camera, camera & projected)):
            station, of = str(StationId(t.capture, device)), int(seen.sum())
            if station not in left and (by := str(StationId(t.capture, device, other))) in left:
                station = by
            alone = sum(1 for name, s in zip(names, seen.tolist(), strict=True) if s and name not in points)
            lost = of - left.get(station, 0) - alone
            gross[station] = max(lost, 0), of
            lonely[station] = alone, of
    return gross, lonely


def _unused(
    captures: Sequence[Capture], used: Mapping[Method, Sequence[Capture]], method: Method, options: CalibrateOptions
) -> list[tuple[str, str]]:
    role = "testfield" if method == "photogrammetric" else "depth"
    names = {c.name for c in used[method]}
    idle = [c for c in captures if c.role == role and c.name not in names]
    return [(c.name, "left out by choice" if c.name in options.without else "names no testfield") for c in idle]


def _warned(warnings: Sequence[str]) -> list[Concern]:
    """Those warnings of the adjustment that put its result in doubt."""
    from core.checks import Concern

    return [Concern("doubtful", text) for text in warnings if any(doubt in text for doubt in DOUBTS)]


def _sound(adjustment: Adjustment) -> tuple[str, ...]:
    from core.checks import variance_ratios

    told = ", ".join(f"{name} {ratio:.2f}" for name, ratio in variance_ratios(adjustment).items())
    return (f"residuals over the sigmas given: {told}; nothing systematic",) if told else ()
