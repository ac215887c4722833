"""The measured targets of a capture, in pictures and in a table."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QCoreApplication

from core.errors import InputError
from core.model import Adjustment, Array, Capture, DeviceSpec, Network, TargetSet
from core.patterns import level_of
from core.progress import SILENT, Progress
from core.report import Number, Table
from stripe_gui.presenters.capture import FrameView, load_frame
from stripe_gui.presenters.folder import ProjectFolder, written_ns

translate = QCoreApplication.translate


@dataclass(frozen=True)
class MeasureView:
    """What the measure page shows of a capture; the target arrays have shape (n, 2) in px."""

    measured: Array
    picks: Array
    missing: Array  # where the targets of `missing_table` should be, NaN where that is not known
    targets: tuple[tuple[int, int], ...]  # (row, col) of every row of `table`, then of `missing_table`
    table: Table
    missing_table: Table
    summary: str

    def missing_inside(self, camera: DeviceSpec) -> Array:
        """Places of the missing targets that lie in the image."""
        with np.errstate(invalid="ignore"):
            inside = np.all((self.missing > -0.5) & (self.missing < (camera.width - 0.5, camera.height - 0.5)), axis=1)
        return self.missing[inside]


def lit_frame(capture: Capture, progress: Progress = SILENT) -> FrameView:
    """Read the frame in which the board is lit evenly: the white one, else the first."""
    white = [frame for frame in capture.frames if level_of(frame.pattern) == 1]
    return load_frame((white or list(capture.frames))[0].path, progress)


def targets_of(folder: ProjectFolder, name: str) -> TargetSet | None:
    """Give the targets measured in a capture, None where it was not measured.

    The later of measuring and calibrating, which measures too, is what counts; a calibration keeps no reasons for
    missing targets.
    """
    measured, adjusted = (written_ns(folder.result_file(f"{n}.npz")) or 0 for n in ("targets", "adjustment"))
    sets = folder.result("targets.npz", tuple) or ()
    found = next((t for t in sets if t.capture == name), None)
    if found is not None and measured >= adjusted:
        return found
    adjustment = folder.result("adjustment.npz", Adjustment)
    return (_from_network(adjustment.network, name) if adjustment else None) or found


def _from_network(network: Network, name: str) -> TargetSet | None:
    """Take a capture's targets out of an adjusted network: those of its first two stations, camera and projector."""
    own = [s for s, station in enumerate(network.station_ids) if station.capture == name]
    if not own:
        return None
    seen, matched = (np.flatnonzero(network.observation_station == s) for s in (*own, -1)[:2])
    points = network.observation_point[seen]
    projector = {int(network.observation_point[i]): i for i in matched}
    other = np.array([projector.get(int(p), -1) for p in points], dtype=np.int64)
    lit = (other >= 0)[:, None]
    identity = np.array([[network.point_ids[p].row, network.point_ids[p].col] for p in points]).reshape(-1, 2)
    n = len(seen)
    return TargetSet(
        capture=name,
        row=identity[:, 0],
        col=identity[:, 1],
        camera_uv=network.observation_uv[seen],
        camera_cov=np.einsum("ni,ij->nij", network.observation_sigma[seen] ** 2, np.eye(2)),
        projector_uv=np.where(lit, network.observation_uv[other], np.nan),
        projector_sigma=np.where(lit, network.observation_sigma[other], np.nan),
        eccentricity_px=np.full((n, 2), np.nan),
        diameter_px=np.full(n, np.nan),
    )


def measure_view(capture: Capture, targets: TargetSet | None, camera: DeviceSpec | None = None) -> MeasureView:
    """Put picks and targets together; with the camera the missing ones get their places."""
    picks = np.array([[s.u, s.v] for s in capture.seeds]).reshape(-1, 2)
    row, col = translate("Measure", "row"), translate("Measure", "column")
    columns = (
        row,
        col,
        "u [px]",
        "v [px]",
        "σ [px]",
        translate("Measure", "u projector [lines]"),
        translate("Measure", "v projector [lines]"),
    )
    why = (row, col, translate("Measure", "why it is missing"))
    if targets is None:
        text = translate("Measure", "{n} targets picked, not measured yet") if len(picks) else ""
        summary = text.format(n=len(picks)) or translate("Measure", "no targets picked yet")
        none = np.zeros((0, 2))
        return MeasureView(none, picks, none, (), Table("", columns, ()), Table("", why, ()), summary)
    sigma = np.sqrt(np.einsum("nii->n", targets.camera_cov) / 2)
    rows = tuple(
        (
            Number(int(targets.row[i]), "d"),
            Number(int(targets.col[i]), "d"),
            Number(float(targets.camera_uv[i, 0]), ".3f"),
            Number(float(targets.camera_uv[i, 1]), ".3f"),
            Number(float(sigma[i]), ".4f"),
            Number(float(targets.projector_uv[i, 0]), ".3f"),
            Number(float(targets.projector_uv[i, 1]), ".3f"),
        )
        for i in range(len(targets.row))
    )
    gone = tuple((Number(m.row, "d"), Number(m.col, "d"), m.reason) for m in targets.missing)
    identities = [
        *zip(targets.row.tolist(), targets.col.tolist(), strict=True),
        *((m.row, m.col) for m in targets.missing),
    ]
    return MeasureView(
        targets.camera_uv,
        picks,
        _places(capture, targets, camera),
        tuple(identities),
        Table("", columns, rows),
        Table("", why, gone),
        _summary(targets, sigma),
    )


def _summary(targets: TargetSet, sigma: Array) -> str:
    """Count the targets, and the reasons of the missing ones."""
    text = translate("Measure", "{n} measured").format(n=len(targets.row))
    if len(sigma):
        text += translate("Measure", ", σ {s:.3f} px").format(s=float(np.median(sigma)))
    if not targets.missing:
        return text + translate("Measure", "; none missing")
    kinds = Counter(m.reason.partition(":")[0] for m in targets.missing)
    listed = ", ".join(f"{count} {reason}" for reason, count in kinds.most_common(2))
    more = translate("Measure", "; {m} missing: {kinds}").format(m=len(targets.missing), kinds=listed)
    return text + more + (" …" if len(kinds) > 2 else "")


def _places(capture: Capture, targets: TargetSet, camera: DeviceSpec | None) -> Array:
    """Where the missing targets should be, shape (n, 2) px, NaN where nothing tells."""
    from core.measure import measured_view

    nowhere = np.full((len(targets.missing), 2), np.nan)
    if camera is None or capture.testfield is None or not targets.missing:
        return nowhere
    try:
        view = measured_view(capture.testfield, camera, capture.seeds, targets)
    except InputError:  # the picks were changed since
        return nowhere
    index = capture.testfield.index()
    known = [(m.row, m.col) in index for m in targets.missing]
    at = [index[m.row, m.col] for m in targets.missing if (m.row, m.col) in index]
    nowhere[known] = view.project(capture.testfield.xyz_mm[at])
    return nowhere
