"""What is known in a scene, lengths and points, and where a capture shows it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from core.errors import InputError
from core.fields import read_table
from core.model import Capture, KnownLength, KnownPoints, PhaseMap, Project, TargetSet
from core.pipeline.calibrate import load_adjustment
from core.pipeline.folders import find_capture
from core.pipeline.measure import boards_of, measured_targets

TARGETS = "targets"  # ends of a length that are targets: (row, col, 0)
CLICKED_PX = 0.1  # sigma of a place in an image that a file gives without one


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


def between_targets(project: Project, capture: Capture, length: KnownLength) -> KnownLength:
    """Say where in the image a length's targets are."""
    if length.kind != TARGETS:
        return length
    seen = _targets(project, capture)
    ends = []
    for row, col, _ in length.ends:
        if (int(row), int(col)) not in seen.keys:
            raise InputError(capture.name, f"target {row:g},{col:g} was not measured", "choose two that were")
        k = seen.keys.index((int(row), int(col)))
        ends.append((float(seen.camera_uv[k, 0]), float(seen.camera_uv[k, 1]), max(2.0, seen.diameter_px[k] / 2)))
    return replace(length, kind="points", ends=(ends[0], ends[1]))


def known_points(
    project: Project, capture: Capture, phase: PhaseMap, points: Path | Literal["testfield"]
) -> KnownPoints:
    """Set points measured before beside where camera and projector see them."""
    from core.orient import lines_at

    names: list[str]
    if isinstance(points, Path):
        optional = ("sigma_x_mm", "sigma_y_mm", "sigma_z_mm", "u", "v", "sigma_px")
        rows = read_table(points, ("point", "x_mm", "y_mm", "z_mm"), texts=("point",), optional=optional)
        names = [row.text("point") for row in rows]
        for row, name in zip(rows, names, strict=True):
            if rows[names.index(name)] is not row:
                raise InputError(row.where, f"point {name!r} is there already", "remove one of the two")
        xyz = np.array([[row.real(f"{axis}_mm") for axis in "xyz"] for row in rows])
        sigmas = np.array([[row.real(f"sigma_{axis}_mm", least=0.0, default=0.0) for axis in "xyz"] for row in rows])
        cov = sigmas[:, :, None] ** 2 * np.eye(3)
        places = np.array([[row.real(key, default=np.nan) for key in ("u", "v")] for row in rows])
        clicked = np.array([row.real("sigma_px", above=0.0, default=CLICKED_PX) for row in rows])
    else:
        adjustment = load_adjustment(project)
        names, xyz, cov = list(adjustment.network.point_names), adjustment.points_mm, adjustment.point_cov_mm2
        places = np.full((len(names), 2), np.nan)
    seen, seen_cov = np.full((len(names), 4), np.nan), np.zeros((len(names), 4, 4))
    for k in np.flatnonzero(np.isfinite(places).all(axis=1)):
        lines, sigma = lines_at(phase, *places[k])
        seen[k], seen_cov[k] = [*places[k], *lines], np.diag([clicked[k], clicked[k], *sigma]) ** 2
    if not np.isfinite(places).all():
        targets = _targets(project, capture)
        index = {f"{r}/{c}": i for i, (r, c) in enumerate(targets.keys)}
        for k in np.flatnonzero(~np.isfinite(places).all(axis=1)):
            if names[k] in index:
                i = index[names[k]]
                seen[k], seen_cov[k] = [*targets.camera_uv[i], *targets.projector_uv[i]], targets.cov[i]
    use = np.isfinite(seen).all(axis=1) & np.isfinite(xyz).all(axis=1)
    return KnownPoints(xyz[use], cov[use], seen[use], seen_cov[use])


def _targets(project: Project, capture: Capture) -> TargetSet:
    if capture.testfield is None:
        raise InputError(
            capture.path, "shows no testfield", "take a capture of role testfield, or give places in the image"
        )
    # the calibration's images help to tell which way round the board lies
    others = [c for c in boards_of(project) if c.role == capture.role and c.path != capture.path]
    found = measured_targets(project, [find_capture(project, str(capture.path)), *others])
    own = (capture.name, capture.camera, capture.projector)
    return next(t for t in found if (t.capture, t.camera, t.projector) == own)
