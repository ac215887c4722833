"""Whether a rig has moved: by one capture, and by all in a control chart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from core.errors import InputError
from core.lazy import dataclass
from core.model import Capture, DriftPoint, Project
from core.pipeline.orient import Wanted, orient_pairs
from core.pipeline.orient_words import ACTION, WARNING, motion_words
from core.progress import SILENT, Progress
from core.report import Number, Table
from core.report.numbers import DRIFT_ELEMENTS
from core.report.table import Cell
from stripe_gui.presenters.told import sentence, translate
from stripe_gui.widgets.plot import Curve

SCALE = np.array([scale for *_, scale in DRIFT_ELEMENTS])  # to µrad and µm


def element_names() -> tuple[str, ...]:
    """Name what a capture shows of a movement."""
    return (
        translate("Rig", "turned about X [µrad]"),
        translate("Rig", "about Y [µrad]"),
        translate("Rig", "about Z [µrad]"),
        translate("Rig", "shifted across the base [µm]"),
        translate("Rig", "and square to both [µm]"),
    )


def drift_curves(chart: Sequence[DriftPoint]) -> list[Curve]:
    """Draw what every capture shows less what those before it lead to expect, in sigmas, between the limits."""
    at = np.arange(1.0, len(chart) + 1)
    off = np.array([(point.value - point.expected) / point.sigma for point in chart])
    wide = np.concatenate([at - 0.5, at[-1:] + 0.5])
    limits = [
        Curve(text.format(s=s), wide, 0 * wide, style="dot", band=s + 0 * wide)
        for s, text in (
            (ACTION, translate("Rig", "±{s:g} σ: out of control beyond")),
            (WARNING, translate("Rig", "±{s:g} σ: warning beyond")),
        )
    ]
    styles = (("line", 0), ("dash", 0), ("dot", 0), ("line", 1), ("dash", 1))
    elements = zip(element_names(), off.T, styles, strict=True)
    return [
        *limits,
        *(Curve(name.split(" [")[0], at, y, tone, style, marked=True) for name, y, (style, tone) in elements),
    ]


def drift_table(chart: Sequence[DriftPoint]) -> Table:
    """List the captures of a control chart."""
    words = {
        "steady": translate("Rig", "in control"),
        "warning": translate("Rig", "warning"),
        "action": translate("Rig", "OUT OF CONTROL"),
    }
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            Number(i, "d"),
            point.capture,
            words[point.state],
            Number(point.p, ".2g"),
            *(
                f"{d:+.1f} ± {s:.1f}"
                for d, s in zip(SCALE * (point.value - point.expected), SCALE * point.sigma, strict=True)
            ),
        )
        for i, point in enumerate(chart, 1)
    )
    return Table("", ("", translate("Rig", "capture"), translate("Rig", "rig"), "p", *element_names()), rows)


@dataclass(frozen=True)
class Health:
    """What one capture says of the rig; `kind` is a notice's."""

    kind: str
    words: str
    more: str = ""


def health_of(project: Project, capture: Capture, progress: Progress = SILENT) -> Health:
    """Look whether projectors and other cameras stand as they were calibrated, by the frames of one camera.

    Nothing is kept: whoever looks at a capture changes no report.
    """
    try:
        motions, _ = orient_pairs(project, capture.name, Wanted(keep=False), camera=capture.camera, progress=progress)
    except InputError as error:
        return Health("info", sentence(error.seen))
    motion = min(motions, key=lambda motion: motion.p)
    first, *more = map(sentence, motion_words(motion))
    return Health("error" if motion.moved else "success", first, "\n".join(more))
