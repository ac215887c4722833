"""What stands where in the report: the one order of content that HTML and PDF both set."""

from __future__ import annotations

from collections.abc import Callable

from core.lazy import dataclass
from core.model import DeviceSpec
from core.progress import SILENT, Progress
from core.report.chapters import CHAPTERS, drawings
from core.report.data import ReportData
from core.report.figures import Drawing
from core.report.numbers import published_of
from core.report.table import Table
from core.report.words import Highlight, Summary, highlights, summary


@dataclass(frozen=True)
class Section:
    """A chapter of the report."""

    key: str
    title: str
    tables: tuple[Table, ...]
    drawings: tuple[Drawing, ...]


@dataclass(frozen=True)
class Document:
    """The whole report before it is set in HTML or PDF."""

    title: str
    facts: tuple[str, ...]
    highlights: tuple[Highlight, ...]
    summary: Summary
    sections: tuple[Section, ...]
    source: str  # of the published values; empty where there are none


def compose(
    data: ReportData, *, progress: Progress = SILENT, meanwhile: Callable[[], object] = lambda: None
) -> Document:
    """Put tables, figures and words in order; see `drawings`."""
    published, drawn = published_of(data), drawings(data, progress=progress, meanwhile=meanwhile)
    sections = tuple(
        Section(key, chapter.title, tuple(chapter.tables(data)), drawn[key]) for key, chapter in CHAPTERS.items()
    )
    sections = tuple(section for section in sections if section.tables or section.drawings)
    source = published.source if published else ""
    return Document(data.name, _facts(data), highlights(data), summary(data), sections, source)


def _facts(data: ReportData) -> tuple[str, ...]:
    """Lines of the title block."""
    project = data.project
    facts = []
    for kind, unit, devices in (
        ("Camera", "pixels", project.rig.cameras),
        ("Projector", "lines", project.rig.projectors),
    ):
        facts += [f"{kind}{f' {n}' if len(devices) > 1 else ''}: {_device(spec, unit)}" for n, spec in devices.items()]
    if project.scale is not None:
        s = project.scale
        facts.append(
            f"Scale: {s.length_mm:g} mm ± {s.sigma_mm:g} mm from target {s.start[0]},{s.start[1]} (row, column) to "
            f"{s.stop[0]},{s.stop[1]}"
        )
    facts.append(f"Captures: {len(project.captures)}")
    if project.reference and published_of(data) is None:
        facts.append(f"Reference: no results are known under {project.reference!r}, so none stand beside the own ones")
    made = " ".join(part for part in (data.made_on, f"by {data.made_by}" if data.made_by else "") if part)
    return (*facts, f"Report made {made}") if made else tuple(facts)


def _device(spec: DeviceSpec, unit: str) -> str:
    if spec.labels_only:
        return f"{spec.width} × {spec.height} {unit}, which label places"
    pitch = " × ".join(f"{1000 * p:g}" for p in spec.pitch_mm)
    return f"{spec.width} × {spec.height} {unit}, pitch {pitch} µm, nominal c {spec.nominal_c_mm:g} mm"
