"""What a project hands to other programs as CSV: its tables, targets, profiles and deviations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from core.atomic import write_together
from core.errors import InputError
from core.model import DeviceSpec, PlaneEvaluation, Project, TargetSet
from core.pipeline.evaluate import load_evaluation
from core.pipeline.folders import result_path
from core.pipeline.measure import kept_targets
from core.pipeline.report import report_data
from core.progress import SILENT, Progress

if TYPE_CHECKING:
    from core.evaluate import Line, Profile

UM = 1000.0


def kept_evaluation(project: Project) -> tuple[PlaneEvaluation, ...]:
    """Give the evaluation the project has, none where there is none."""
    return load_evaluation(project) if result_path(project, "evaluation.npz").exists() else ()


def export_tables(
    project: Project, out: Path, evaluations: tuple[PlaneEvaluation, ...] | None = None, progress: Progress = SILENT
) -> list[Path]:
    """Write every table that the report would hold as CSV into a folder, and the targets measured; give the files."""
    from core.report import table_file, tables, write_table_csv

    found = tables(report_data(project, kept_evaluation(project) if evaluations is None else evaluations))
    targets = kept_targets(project)
    if not found and not targets:
        raise InputError(project.path, "no results yet", "run `stripe-core measure` or `stripe-core calibrate` first")
    files = []
    for table in progress.over(found, "{0.title}"):
        files.append(out / table_file(table))
        write_table_csv(files[-1], table)
    if targets:
        files.append(out / "targets.csv")
        write_targets_csv(files[-1], targets)
    return files


def export_report(project: Project, out: Path, progress: Progress = SILENT) -> list[Path]:
    """Copy the report the project has into a folder, with its tables as CSV; give the files."""
    written = [result_path(project, f"report/report.{kind}") for kind in ("html", "pdf")]
    if not all(file.is_file() for file in written):
        raise InputError(project.path, "the report is not written yet", "write it first (`stripe-core report`)")
    files = write_together({out / file.name: file.read_bytes() for file in written})
    return [*files, *export_tables(project, out, progress=progress)]


def read_profiles(
    project: Project,
    evaluations: Sequence[PlaneEvaluation],
    capture: str,
    line: Line | None = None,
    camera: str = "",
    projector: str = "",
) -> dict[str, Profile]:
    """Read the deviations of a plane along a line, by every method that knows the camera it was made with.

    Parameters
    ----------
    capture : str
        The plane.
    line : pair of (u, v), optional
        Ends in the camera's image, px; by default across the middle of what has deviations.
    camera, projector : str
        That saw it; the first if none is named.
    """
    from core.evaluate import line_across, read_profile

    own = [
        e
        for e in evaluations
        if e.capture == capture and all(a in ("", b) for a, b in zip((camera, projector), e.devices, strict=True))
    ]
    own = [e for e in own if e.devices == own[0].devices]
    if not own:
        known = ", ".join(dict.fromkeys(e.capture for e in evaluations)) or "none"
        if others := [e.devices for e in evaluations if e.capture == capture]:
            known = ", ".join(dict.fromkeys(f"{capture} by {' and '.join(devices)}" for devices in others))
            capture = f"{capture} by {' and '.join(name for name in (camera, projector) if name)}"
        raise InputError(project.path, f"no evaluation of {capture!r}", f"evaluate it first; evaluated: {known}")
    ends = line or line_across([e.deviation_mm for e in own])
    spec = project.rig.cameras[own[0].devices[0]]
    return {e.method: read_profile(e, spec, *ends) for e in own if e.camera is not None}


def read_all_profiles(
    project: Project, evaluations: Sequence[PlaneEvaluation], line: Line | None = None
) -> dict[str, dict[str, Profile]]:
    """Read the profiles of every plane along one line, by the names of their files, which name the devices as well."""
    return {
        f"profile-{capture}{_named(project, devices)}.csv": read_profiles(project, evaluations, capture, line, *devices)
        for capture, devices in dict.fromkeys((e.capture, e.devices) for e in evaluations)
    }


def export_profiles(found: Mapping[str, Mapping[str, Profile]], out: Path) -> list[Path]:
    """Write profiles by the names of their files into a folder; give the files."""
    for name, profiles in found.items():
        write_profile_csv(out / name, profiles)
    return [out / name for name in found]


def _named(project: Project, devices: tuple[str, str]) -> str:
    return "" if project.rig.is_pair else "-" + "-".join(devices).replace(" ", "-")


def export_deviations(
    project: Project, evaluations: Sequence[PlaneEvaluation], out: Path, progress: Progress = SILENT
) -> list[Path]:
    """Write ``deviations-CAPTURE-METHOD.csv``, every pixel of every plane, named as profiles are; give the files."""
    files = []
    for evaluation, part in zip(evaluations, progress.parts(len(evaluations)), strict=True):
        of = f"{evaluation.capture}-{evaluation.method}{_named(project, evaluation.devices)}"
        files.append(out / f"deviations-{of}.csv")
        write_deviations_csv(files[-1], evaluation, project.rig.cameras[evaluation.devices[0]], part)
    return files


def write_profile_csv(path: Path, found: Mapping[str, Profile]) -> None:
    """Write the profiles of one plane along one line, every method's side by side."""
    from core.report import write_columns_csv

    first = next(iter(found.values()))
    columns = {"u [px]": first.uv[:, 0], "v [px]": first.uv[:, 1]}
    for method, line in found.items():
        columns[f"length, {method} [mm]"] = line.length_mm
        columns[f"deviation, {method} [µm]"] = line.deviation_mm * UM
        columns[f"sigma, {method} [µm]"] = line.sigma_mm * UM
    write_columns_csv(path, columns, (2, 2, *(4, 2, 2) * len(found)))


def write_deviations_csv(
    path: Path, evaluation: PlaneEvaluation, camera: DeviceSpec, progress: Progress = SILENT
) -> None:
    """Write every pixel that has a deviation: its place in the image, its point, the deviation and its sigma."""
    from core.evaluate import points_on_plane
    from core.report import write_columns_csv

    rows, cols = np.nonzero(np.isfinite(evaluation.deviation_mm))
    points = np.full((len(rows), 3), np.nan)
    if evaluation.camera is not None:
        seen, off = np.stack([cols, rows], axis=1), evaluation.deviation_mm[rows, cols]
        points = points_on_plane(evaluation.plane, camera, evaluation.camera, seen, off)
    known = evaluation.sigma_mm.shape == evaluation.deviation_mm.shape
    columns = {
        "u [px]": cols,
        "v [px]": rows,
        "X [mm]": points[:, 0],
        "Y [mm]": points[:, 1],
        "Z [mm]": points[:, 2],
        "deviation [µm]": evaluation.deviation_mm[rows, cols] * UM,
        "sigma [µm]": evaluation.sigma_mm[rows, cols] * UM if known else np.full(len(rows), np.nan),
    }
    write_columns_csv(path, columns, (0, 0, 4, 4, 4, 2, 2), progress=progress)


def write_targets_csv(path: Path, targets: Sequence[TargetSet]) -> None:
    """Write the targets of all captures, those that are missing with the reason."""
    from core.report import Number, Table, write_table_csv

    columns = ("capture", "row", "col", "u [px]", "v [px]", "sigma [px]", "u projector [lines]", "v projector [lines]")
    rows: list[tuple[str | Number | None, ...]] = []
    for t in targets:
        sigma = np.sqrt(np.einsum("nii->n", t.camera_cov) / 2)
        for i in range(len(t.row)):
            values = [
                *(Number(float(x), ".4f") for x in t.camera_uv[i]),
                Number(float(sigma[i]), ".4f"),
                *(Number(float(x), ".4f") for x in t.projector_uv[i]),
            ]
            rows.append((t.capture, Number(int(t.row[i]), "d"), Number(int(t.col[i]), "d"), *values, ""))
        rows += [(t.capture, Number(m.row, "d"), Number(m.col, "d"), *[None] * 5, m.reason) for m in t.missing]
    write_table_csv(path, Table("Targets", (*columns, "missing because"), tuple(rows)))
