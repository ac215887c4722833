"""Calibrations over the working volume: how certain one is, by how much two differ."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from core.lazy import dataclass
from core.model import Array, Project
from core.pipeline.volumes import difference_figures, volume_figures
from core.progress import SILENT, Progress
from core.report import Number, Table
from core.report.adjusted import image_of_cells
from stripe_gui.presenters.maps import MapView, percentile, round_up
from stripe_gui.presenters.told import translate


@dataclass(frozen=True)
class Quantity:
    """What a map shows: its name, that of its column, its key in the figures, and values, (depths, rows, columns)."""

    name: str
    column: str
    key: str
    unit: str
    values: Array

    @property
    def digits(self) -> int:
        """Decimals of its values."""
        return 2 if self.unit == "σ" else 4


@dataclass(frozen=True)
class VolumeView:
    """Maps over the camera's image, of a `size` in px, one for every quantity and row of figures by depth."""

    said: str
    note: str
    rows: tuple[Mapping[str, Any], ...]
    quantities: tuple[Quantity, ...]
    size: tuple[int, int]

    @property
    def table(self) -> Table:
        """The r.m.s. of every quantity at every depth."""
        columns = (translate("Volume", "distance [mm]"), *(q.column for q in self.quantities))
        rows = [
            (Number(row["depth_mm"], ".0f"), *(Number(row[q.key], f".{q.digits}f") for q in self.quantities))
            for row in self.rows
        ]
        return Table("", columns, tuple(rows), (self.note,))

    def picture(self, quantity: int, row: int) -> MapView:
        """Give a map; those of one quantity have one scale at all depths."""
        q = self.quantities[quantity]
        top = max(round_up(percentile(q.values, 98)), 10.0**-q.digits)
        image = image_of_cells(q.values[self.rows[row]["layer"]], self.size)
        return MapView(image, (0.0, top), "map", q.unit, q.digits)

    def words(self, quantity: int, row: int) -> str:
        """Say what a map shows."""
        q, figures = self.quantities[quantity], self.rows[row]
        text = translate("Volume", "{d:.0f} mm away: {rms:.{n}f} {unit} r.m.s., {most:.{n}f} at most")
        rms, most = figures[q.key], figures[f"{q.key}_max"]
        return text.format(d=figures["depth_mm"], rms=rms, most=most, unit=q.unit, n=q.digits)


def uncertainty_view(
    project: Project, camera: str = "", projector: str = "", progress: Progress = SILENT
) -> VolumeView:
    """Show how certain the calibration in use is."""
    figures, maps = volume_figures(project, None, camera, projector)
    lit, column = translate("Volume", "σ of the projector's image"), translate("Volume", "projector [lines]")
    quantities = (
        (translate("Volume", "σ of points"), translate("Volume", "points [mm]"), "sigma_mm", "mm"),
        (translate("Volume", "σ of form"), translate("Volume", "form [mm]"), "form_sigma_mm", "mm"),
        (translate("Volume", "σ of the camera's image"), translate("Volume", "camera [px]"), "camera_px", "px"),
        (lit, column, "projector_lines", translate("Volume", "lines")),
    )
    said = translate(
        "Volume",
        "What the calibration's sigmas mean for points, shapes and images where the camera sees the projector's light.",
    )
    note = translate(
        "Volume",
        "R.m.s. over the image, without the noise of a capture. Form: after the best movement of all points as one; "
        "images: after the best place of the device. They grow where no target was captured.",
    )
    made = tuple(Quantity(*entry, maps[entry[2]]) for entry in quantities)
    return VolumeView(said, note, tuple(figures["depths"]), made, _size(project, camera))


def difference_view(
    project: Project, first: int, second: int, camera: str = "", projector: str = "", progress: Progress = SILENT
) -> VolumeView:
    """Set a kept run beside a first one, over the working volume of the first."""
    figures, maps = difference_figures(project, second, first, camera, projector)
    column = translate("Volume", "in σ")
    quantities = (
        (translate("Volume", "Difference"), translate("Volume", "difference [mm]"), "difference_mm", "mm"),
        (translate("Volume", "Difference in σ"), column, "in_sigmas", "σ"),
        (translate("Volume", "Form"), translate("Volume", "form [mm]"), "form_mm", "mm"),
        (translate("Volume", "Form in σ"), column, "form_in_sigmas", "σ"),
    )
    note = translate(
        "Volume",
        "R.m.s. over the image: how far apart both put the same point. Form: what is left of it after the best "
        "movement of all points as one.",
    )
    made = tuple(Quantity(*entry, maps[entry[2]]) for entry in quantities if entry[2] in maps)
    return VolumeView(_test_words(figures), note, tuple(figures["depths"]), made, _size(project, camera))


def _test_words(figures: Mapping[str, Any]) -> str:
    """Say whether two calibrations differ by more than chance."""
    if figures["significant"] is None:
        return translate("Volume", "One of them tells no sigmas, so that chance cannot be told from a difference.")
    if figures["significant"]:
        text = translate(
            "Volume", "They differ by more than chance: χ² {x:.3g} with {n} degrees of freedom, limit {limit:.3g}."
        )
    else:
        text = translate(
            "Volume", "They agree within their sigmas: χ² {x:.3g} with {n} degrees of freedom, limit {limit:.3g}."
        )
    said = text.format(x=figures["statistic"], n=figures["dof"], limit=figures["limit"])
    alone = translate("Volume", "Both are taken as independent; runs that share captures differ by less.")
    return f"{said} {alone}"


def _size(project: Project, camera: str) -> tuple[int, int]:
    spec = project.rig.cameras[camera or project.rig.camera_name]
    return spec.width, spec.height
