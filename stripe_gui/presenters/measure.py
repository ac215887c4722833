"""The measured targets of a capture, in pictures and in a table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QCoreApplication

from core.model import Array, Capture, TargetSet
from core.patterns import White
from core.progress import SILENT, Progress
from core.report import Number, Table
from stripe_gui.presenters.capture import FrameView, load_frame
from stripe_gui.presenters.folder import ProjectFolder

translate = QCoreApplication.translate


@dataclass(frozen=True)
class MeasureView:
    """What the measure page shows of a capture; the target arrays have shape (n, 2) in px."""

    measured: Array
    picks: Array
    table: Table
    summary: str


def lit_frame(capture: Capture, progress: Progress = SILENT) -> FrameView:
    """Read the frame in which the board is lit evenly: the white one, else the first."""
    white = [frame for frame in capture.frames if isinstance(frame.pattern, White)]
    return load_frame((white or list(capture.frames))[0].path, progress)


def targets_of(folder: ProjectFolder, name: str) -> TargetSet | None:
    """Give the targets measured in a capture; None where it was not measured."""
    sets = folder.result("targets.npz", tuple) or ()
    return next((t for t in sets if t.capture == name), None)


def measure_view(capture: Capture, targets: TargetSet | None) -> MeasureView:
    """Put picks and targets together."""
    picks = np.array([[s.u, s.v] for s in capture.seeds]).reshape(-1, 2)
    columns = (
        translate("Measure", "row"),
        translate("Measure", "column"),
        "u [px]",
        "v [px]",
        "σ [px]",
        translate("Measure", "u projector [lines]"),
        translate("Measure", "v projector [lines]"),
        translate("Measure", "remark"),
    )
    if targets is None:
        text = translate("Measure", "{n} targets picked, not measured yet") if len(picks) else ""
        summary = text.format(n=len(picks)) or translate("Measure", "no targets picked yet")
        return MeasureView(np.zeros((0, 2)), picks, Table("", columns, ()), summary)
    sigma = np.sqrt(np.einsum("nii->n", targets.camera_cov) / 2)
    rows: list[tuple] = [
        (
            Number(int(targets.row[i]), "d"),
            Number(int(targets.col[i]), "d"),
            Number(float(targets.camera_uv[i, 0]), ".3f"),
            Number(float(targets.camera_uv[i, 1]), ".3f"),
            Number(float(sigma[i]), ".4f"),
            Number(float(targets.projector_uv[i, 0]), ".3f"),
            Number(float(targets.projector_uv[i, 1]), ".3f"),
            "",
        )
        for i in range(len(targets.row))
    ]
    for m in targets.missing:
        rows.append((Number(m.row, "d"), Number(m.col, "d"), None, None, None, None, None, m.reason))
    text = translate("Measure", "{n} targets measured, {m} missing").format(n=len(targets.row), m=len(targets.missing))
    if len(sigma):
        text += translate("Measure", "; σ of the centroids {s:.3f} px, median").format(s=float(np.median(sigma)))
    return MeasureView(targets.camera_uv, picks, Table("", columns, tuple(rows)), text)
