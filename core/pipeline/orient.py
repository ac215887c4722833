"""Beside the road: has the rig moved since its calibration? From any one capture with columns and rows, or from all."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from core.errors import InputError, TooLittleSeenError
from core.fields import read_table
from core.geometry import knows, pair_for, pair_of
from core.model import (
    Adjustment,
    Capture,
    DriftPoint,
    KnownLength,
    KnownPoints,
    Pair,
    PhaseMap,
    PhotogrammetricCalibration,
    Project,
    RigMotion,
    TargetSet,
)
from core.pipeline.calibrate import photogrammetric_calibration
from core.pipeline.decode import decode_series, one_series
from core.pipeline.folders import all_captures, find_capture, result_path
from core.pipeline.inputs import decoded_from
from core.pipeline.measure import measured_targets
from core.pipeline.runs import calibration_file
from core.progress import SILENT, Progress
from core.project import load_archive, save_archive
from core.project.archive import read_head

TARGETS = "targets"  # ends of a length that are targets: (row, col, 0)
CLICKED_PX = 0.1  # sigma of a place in an image that a file gives without one
VERSION = 6  # raise it where the same capture and calibration give other figures: what is kept is then found again


def orient_capture(
    project: Project,
    name: str,
    *,
    camera: str = "",
    projector: str = "",
    correct: bool = False,
    keep: bool = True,
    significance: float = 1e-3,
    lengths: Sequence[KnownLength] = (),
    points: Path | Literal["testfield"] | None = None,
    progress: Progress = SILENT,
) -> RigMotion:
    """Say whether the projector still stands where the calibration put it, by one capture.

    Parameters
    ----------
    name : str
        The capture: its name, or its folder.
    camera, projector : str
        Which pair, where the capture holds frames of several.
    correct : bool
        Keep the corrected orientation, for `reconstruct_capture(..., orient=True)`. The calibration stays as it is.
    keep : bool
        Keep what was found for the control chart, which the report shows.
    significance : float
        Share of captures of an unmoved rig that may be called moved.
    lengths : sequence of KnownLength
        In the scene; kind "targets" is between targets (row, col) of the testfield. With one, the base's length and c,
        x0, y0 of both devices are estimated, too.
    points : Path or "testfield", optional
        Points measured before, as a table or as the calibration found those of the testfield: for all of that again.

    Raises
    ------
    InputError
        If there is no photogrammetric calibration, or too few pixels have both projector coordinates.
    """
    from core.orient import OrientOptions, find_motion

    if not 0 < significance < 1:
        raise InputError("the significance", f"is {significance:g}", "give a share between 0 and 1, such as 0.001")
    calibration = photogrammetric_calibration(project)
    capture = one_series(find_capture(project, name), camera, projector)
    phase = decode_series(capture, project, progress.part(0.0, 0.3))
    motion = find_motion(
        phase,
        calibration,
        lengths=[_between_targets(project, capture, length) for length in lengths],
        points=None if points is None else _known_points(project, capture, phase, points),
        capture=capture.name,
        options=OrientOptions(significance=significance),
        progress=progress.part(0.3, 1.0),
    )
    pair = pair_for(capture, calibration)
    with suppress(InputError):  # a project that may only be read is judged all the same, and again the next time
        if keep:
            save_archive(_drift(project, capture), motion, _made_from(project, capture, pair))
    if correct:
        save_archive(_corrected(project, capture), (motion, signature_of(pair)))
    return motion


def orient_pairs(
    project: Project,
    name: str,
    *,
    camera: str = "",
    projector: str = "",
    significance: float = 1e-3,
    progress: Progress = SILENT,
    **known: Any,
) -> tuple[list[RigMotion], dict[tuple[str, str], str]]:
    """Say it of every camera and projector of a capture, or of those named; for the rest see `orient_capture`.

    Returns
    -------
    found : list of RigMotion
    untold : dict
        By (camera, projector) why nothing can be told of others; where nothing can be told of any, that is raised.
    """
    capture = find_capture(project, name)
    pairs = [pair for pair in capture.pairs if camera in ("", pair[0]) and projector in ("", pair[1])]
    if not pairs or (known.get("lengths") and len({pair[0] for pair in pairs}) > 1):
        one_series(capture, camera, projector)  # places are in one camera's image
    calibration = photogrammetric_calibration(project)
    found: list[RigMotion] = []
    known_pairs = [pair for pair in pairs if knows(calibration, *pair)] or pairs[:1]  # of which what lacks is said
    because = f"the calibration in use is of {', '.join(calibration.devices)} alone"
    untold = {pair: because for pair in pairs if pair not in known_pairs}
    for i, (one, other) in enumerate(known_pairs):
        part = progress.part(i / len(known_pairs), (i + 1) / len(known_pairs))
        share = significance / len(known_pairs)
        try:
            found.append(
                orient_capture(project, name, camera=one, projector=other, significance=share, progress=part, **known)
            )
        except TooLittleSeenError as error:
            untold[one, other] = error.seen
            if not found and (one, other) == known_pairs[-1]:
                raise
    return found, untold


def drift_of(
    project: Project, *, significance: float = 1e-3, kept: bool = False, progress: Progress = SILENT
) -> dict[tuple[str, str], tuple[DriftPoint, ...]]:
    """Make the control chart of every camera and projector, from all captures of the project in their order.

    What a capture shows is kept, and found again only where its frames or the calibration have changed; `kept` looks at
    nothing else. Captures with one axis, or of too little, are left out.
    """
    from core.orient import OrientOptions, drift_chart

    calibration = photogrammetric_calibration(project)
    motions: dict[tuple[str, str], list[RigMotion]] = {}
    captures = all_captures(project)
    for i, capture in enumerate(captures):
        progress(i / len(captures), f"looking at {capture.name}")
        for series in capture.series:
            if {series.camera, series.projector} <= set(calibration.devices):
                motion = kept_motion(project, series, calibration)
                motion = motion or (None if kept else _motion_if_seen(project, series))
                motions.setdefault((series.camera, series.projector), []).extend([motion] if motion else [])
    options = OrientOptions(significance=significance)
    return {pair: drift_chart(found, pair_of(calibration, *pair), options) for pair, found in motions.items() if found}


def kept_motion(project: Project, capture: Capture, calibration: PhotogrammetricCalibration) -> RigMotion | None:
    """Give what one pair's frames of a capture showed, if neither they nor the calibration have changed since."""
    path = _drift(project, capture)
    try:
        if read_head(path).get("made_from") == _made_from(project, capture, pair_for(capture, calibration)):
            return load_archive(path, RigMotion)
    except InputError:
        pass
    return None


def oriented(project: Project, capture: Capture, calibration: PhotogrammetricCalibration) -> Pair:
    """Give camera and projector of a calibration with the projector where a kept result of this capture has it.

    InputError if no corrected orientation is kept for the capture, or it belongs to another calibration.
    """
    path, pair = _corrected(project, capture), pair_for(capture, calibration)
    again = f"run `stripe-core orient {project.path} {capture.name} --correct` first"
    if not path.exists():
        raise InputError(path, "no corrected orientation is kept for this capture", again)
    motion, signature = load_archive(path, tuple)
    if signature != signature_of(pair):
        raise InputError(path, "was found with another calibration", again)
    corrected: Pair = motion.pair
    return corrected


def parse_length(words: Sequence[str]) -> KnownLength:
    """Read a known length as a command takes it: KIND FROM TO MM SIGMA."""
    from core.orient import LENGTHS

    kind, *ends, length, sigma = words
    kinds = (TARGETS, *LENGTHS)
    if kind not in kinds:
        raise InputError("--length", f"kind {kind!r}", f"choose among {', '.join(kinds)}")
    form, count = ("ROW,COL", 2) if kind == TARGETS else ("U,V,RADIUS", 3)
    try:
        places = [tuple(float(x) for x in end.split(",")) for end in ends]
        known = float(length), float(sigma)
    except ValueError as error:
        raise InputError("--length", str(error), f"give KIND {form} {form} MM SIGMA") from None
    if any(len(place) != count for place in places) or not np.isfinite([*places[0], *places[1], *known]).all():
        raise InputError("--length", " ".join(words), f"give {kind} {form} {form} MM SIGMA, all finite")
    if min(known) <= 0:
        raise InputError("--length", f"{known[0]:g} ± {known[1]:g} mm", "give a length and a sigma above 0")
    one, other = ((place[0], place[1], place[2] if count == 3 else 0.0) for place in places)
    return KnownLength(kind, (one, other), *known)


def _targets(project: Project, capture: Capture) -> TargetSet:
    if capture.testfield is None:
        raise InputError(
            capture.path, "shows no testfield", "take a capture of role testfield, or give places in the image"
        )
    found = measured_targets(project, [find_capture(project, str(capture.path))])
    return next(t for t in found if (t.camera, t.projector) == (capture.camera, capture.projector))


def _between_targets(project: Project, capture: Capture, length: KnownLength) -> KnownLength:
    """Say where in the image a length's targets are."""
    if length.kind != TARGETS:
        return length
    seen = _targets(project, capture)
    names = [(int(r), int(c)) for r, c in zip(seen.row, seen.col, strict=True)]
    ends = []
    for row, col, _ in length.ends:
        if (int(row), int(col)) not in names:
            raise InputError(capture.name, f"target {row:g},{col:g} was not measured", "choose two that were")
        k = names.index((int(row), int(col)))
        ends.append((float(seen.camera_uv[k, 0]), float(seen.camera_uv[k, 1]), max(2.0, seen.diameter_px[k] / 2)))
    return replace(length, kind="points", ends=(ends[0], ends[1]))


def _known_points(
    project: Project, capture: Capture, phase: PhaseMap, points: Path | Literal["testfield"]
) -> KnownPoints:
    """Set points measured before beside where camera and projector see them."""
    from core.orient import lines_at

    names: list[str]
    if isinstance(points, Path):
        optional = ("sigma_x_mm", "sigma_y_mm", "sigma_z_mm", "u", "v", "sigma_px")
        rows = read_table(points, ("point", "x_mm", "y_mm", "z_mm"), texts=("point",), optional=optional)
        names = [row.text("point") for row in rows]
        xyz = np.array([[row.real(f"{axis}_mm") for axis in "xyz"] for row in rows])
        sigmas = np.array([[row.real(f"sigma_{axis}_mm", least=0.0, default=0.0) for axis in "xyz"] for row in rows])
        cov = sigmas[:, :, None] ** 2 * np.eye(3)
        places = np.array([[row.real(key, default=np.nan) for key in ("u", "v")] for row in rows])
        clicked = np.array([row.real("sigma_px", above=0.0, default=CLICKED_PX) for row in rows])
    else:
        adjustment = load_archive(
            calibration_file(project, "adjustment.npz") or result_path(project, "adjustment.npz"), Adjustment
        )
        names, xyz, cov = list(adjustment.network.point_names), adjustment.points_mm, adjustment.point_cov_mm2
        places = np.full((len(names), 2), np.nan)
    seen, seen_cov = np.full((len(names), 4), np.nan), np.zeros((len(names), 4, 4))
    for k in np.flatnonzero(np.isfinite(places).all(axis=1)):
        lines, sigma = lines_at(phase, *places[k])
        seen[k], seen_cov[k] = [*places[k], *lines], np.diag([clicked[k], clicked[k], *sigma]) ** 2
    if not np.isfinite(places).all():
        targets = _targets(project, capture)
        index = {f"{r}/{c}": i for i, (r, c) in enumerate(zip(targets.row, targets.col, strict=True))}
        for k in np.flatnonzero(~np.isfinite(places).all(axis=1)):
            if names[k] in index:
                i = index[names[k]]
                seen[k], seen_cov[k] = [*targets.camera_uv[i], *targets.projector_uv[i]], targets.cov[i]
    use = np.isfinite(seen).all(axis=1) & np.isfinite(xyz).all(axis=1)
    return KnownPoints(xyz[use], cov[use], seen[use], seen_cov[use])


def _motion_if_seen(project: Project, capture: Capture) -> RigMotion | None:
    try:
        return orient_capture(project, str(capture.path), camera=capture.camera, projector=capture.projector)
    except InputError:  # one axis, too few pixels, or frames that do not decode
        return None


def _made_from(project: Project, capture: Capture, pair: Pair) -> dict[str, Any]:
    return {**decoded_from(project, capture), "calibration": signature_of(pair), "orient": VERSION}


def signature_of(pair: Pair) -> str:
    """What tells one calibration from another: the digits of its orientation and interiors."""
    pose, interiors = pair.projector_from_camera, (pair.camera.interior.vector, pair.projector.interior.vector)
    return hashlib.sha256(b"".join(a.tobytes() for a in (pose.rotation, pose.translation_mm, *interiors))).hexdigest()


def _corrected(project: Project, capture: Capture) -> Path:
    return result_path(project, "orientations") / _file_name(project, capture)


def _drift(project: Project, capture: Capture) -> Path:
    return result_path(project, "drift") / _file_name(project, capture)


def _file_name(project: Project, capture: Capture) -> str:
    of = "" if project.rig.is_pair else f".{capture.camera}-{capture.projector}"
    return f"{capture.name}{of}.npz"
