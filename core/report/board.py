"""A testfield to be printed: one sheet at true size, as PDF and as SVG.

The sheet holds the targets on their ground, dots or what else their kind draws, and outside of it what nobody can
mistake for a target: small grey labels of rows and columns on all four sides, two bars to measure, and how to print.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from functools import cache
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING, Literal

import numpy as np

from core.errors import InputError
from core.lazy import dataclass
from core.model import Array, Testfield
from core.resources import resource

if TYPE_CHECKING:
    from reportlab.pdfgen.canvas import Canvas


MARGIN_MM = 12.0  # paper around everything: printers leave out up to 6 mm
BAR_SPACE_MM = 14.0  # for a bar, its ticks and its length
LEAST_WIDTH_MM = 120.0  # the text needs it
LARGEST_MM = 5000.0  # a PDF page ends at 200 inches
FLAT_MM = 1.0  # nominal heights may differ by so much: a sheet is flat
A4_MM = (210.0, 297.0)
BARS_MM = tuple(m * 10.0**e for e in (1, 2, 3) for m in (1, 1.5, 2, 2.5, 3, 4, 5, 6, 8))
FONT = "DejaVuSans"
LARGER_THAN_A4 = (
    "This page is larger than A4: a print shop prints it in one piece; a printer program can tile it over several "
    "sheets (poster), to be joined edge to edge."
)
TEXT_MM = 3.2
CHARACTER = 0.62  # of the font's size: a generous mean width, to break lines by


@dataclass(frozen=True)
class Text:
    """A line of text whose foot stands at a place on the sheet."""

    words: str
    x_mm: float
    y_mm: float
    size_mm: float
    anchor: Literal["start", "middle", "end"] = "start"
    upward: bool = False  # turned by 90°, read from the right
    faint: bool = False


@dataclass(frozen=True)
class Line:
    """A straight line, 0.2 mm wide."""

    x1_mm: float
    y1_mm: float
    x2_mm: float
    y2_mm: float


@dataclass(frozen=True)
class Sheet:
    """A printable testfield; places in mm from the top left corner of the sheet, x right, y down."""

    title: str
    #: width_mm, height_mm: of the page
    width_mm: float
    height_mm: float
    ground_mm: tuple[float, float, float, float]  #: left, top, width and height of the area that belongs to the targets
    inverse: bool  #: white targets on a black ground
    targets_mm: Array  #: (n, 3): centre x, y and diameter of every target, in the testfield's order
    dots: bool  #: the targets are dots, and printed
    #: outlines (k, 2) of further areas, each over those before; whether they have the targets' tone, or the ground's
    patches: tuple[tuple[Array, bool], ...]
    #: length of the bar across and of the one down: what a ruler must show between the end ticks
    bars_mm: tuple[float, float]
    lines: tuple[Line, ...]
    texts: tuple[Text, ...]


def board_sheet(
    testfield: Testfield, name: str = "", patches: Sequence[tuple[Array, bool]] = (), *, dots: bool = True
) -> Sheet:
    """Lay out a testfield for printing, its X to the right and its Y upwards.

    Parameters
    ----------
    name : str
        Of the project; printed beside the title.
    patches : sequence of ((k, 2) array, bool)
        What the kind of target draws: outlines on the board, mm, and whether they have the targets' tone.
    dots : bool
        The targets themselves are dots, and printed.

    Raises
    ------
    InputError
        If targets overlap, the board is not flat, or no page is large enough.

    Examples
    --------
    >>> rows, cols = (a.ravel() for a in np.mgrid[0:2, 0:3])
    >>> field = Testfield(rows, cols, np.stack([20.0 * cols, -20.0 * rows, 0.0 * rows], axis=1), np.full(6, 8.0))
    >>> sheet = board_sheet(field)
    >>> sheet.title, sheet.bars_mm
    ('Testfield 2 rows × 3 columns', (80.0, 60.0))
    >>> float(np.ptp(sheet.targets_mm[:, 0]))
    40.0
    """
    spacing = _checked(testfield)
    xy, diameter = testfield.xyz_mm[:, :2], testfield.diameter_mm
    label = float(np.clip(np.median(diameter) / 2, 1.2, 6.0))
    quiet = max(spacing, 0.75 * float(diameter.max()))  # from the outermost centres to the ground's edge
    lower, upper = xy.min(axis=0) - quiet, xy.max(axis=0) + quiet
    for outline, _ in patches:
        lower = np.minimum(lower, outline.min(axis=0) - quiet / 2)
        upper = np.maximum(upper, outline.max(axis=0) + quiet / 2)
    left, top = MARGIN_MM + 3.5 * label, MARGIN_MM + 2.5 * label
    wide, high = (upper - lower).tolist()
    right, foot = left + wide + 3.5 * label, top + high + 2.5 * label

    def on_sheet(places: Array) -> Array:
        return np.column_stack([places[:, 0] - lower[0] + left, upper[1] - places[:, 1] + top])

    targets = np.column_stack([on_sheet(xy), diameter])
    bars = _bar_length(wide), _bar_length(high)
    lines, texts = _bars(left, top, right, foot, bars)
    width = max(right + BAR_SPACE_MM + MARGIN_MM, LEAST_WIDTH_MM)
    title = f"Testfield {len(np.unique(testfield.row))} rows × {len(np.unique(testfield.col))} columns"
    words = _words(title, _facts(testfield, spacing, name, dots), (width, foot + BAR_SPACE_MM), bars)
    height = words[-1].y_mm + MARGIN_MM
    if max(width, height) > LARGEST_MM:
        seen = f"the board needs a page of {width:.0f} x {height:.0f} mm"
        raise InputError("testfield", seen, f"a page can have {LARGEST_MM:.0f} mm at most: print it in parts")
    ground = (left, top, wide, high)
    labels = _labels(testfield, targets, ground, label)
    inverse = dots and testfield.polarity == "white-on-black"
    drawn = tuple((on_sheet(outline), ink) for outline, ink in patches)
    texts = [*texts, *labels, *words]
    return Sheet(title, width, height, ground, inverse, targets, dots, drawn, bars, tuple(lines), tuple(texts))


def _checked(testfield: Testfield) -> float:
    """Refuse what no sheet can show; give the distance of neighbours, mm."""
    xyz, diameter = testfield.xyz_mm, testfield.diameter_mm
    name = [f"row {r}, col {c}" for r, c in testfield.keys]
    if len(name) < 2:
        raise InputError("testfield", f"{len(name)} target", "a testfield needs at least 4")
    if (height := float(np.ptp(xyz[:, 2]))) > FLAT_MM:
        raise InputError("testfield", f"z_mm spreads over {height:.4g} mm", "only a flat board can be printed")
    spacing = []
    for i, target in enumerate(name):
        apart = np.hypot(*(xyz - xyz[i])[:, :2].T)
        apart[i] = np.inf
        reach = (diameter + diameter[i]) / 2 * (1 - 1e-9)  # corners of squares touch
        if apart[j := int(np.argmin(apart - reach))] < reach[j]:
            seen = f"targets {target} and {name[j]} are {apart[j]:.4g} mm apart and overlap"
            raise InputError("testfield", seen, "correct their places or diameters")
        spacing.append(apart.min())
    return float(np.median(spacing))


def _facts(testfield: Testfield, spacing: float, name: str, dots: bool) -> str:
    least, most = float(testfield.diameter_mm.min()), float(testfield.diameter_mm.max())
    diameter = f"{least:.6g} mm" if least == most else f"{least:.6g} to {most:.6g} mm"
    facts = [f"spacing {spacing:.6g} mm"]
    facts += [f"target diameter {diameter}", testfield.polarity.replace("-", " ")] if dots else []
    facts += [f"{len(testfield.row)} targets", *([] if testfield.kind == "dots" else [f"kind: {testfield.kind}"])]
    return " · ".join([*facts, *([name] if name else [])])


def _bar_length(space_mm: float) -> float:
    """The longest round length that fits."""
    return max((length for length in BARS_MM if length <= space_mm), default=BARS_MM[0])


def _bars(
    left: float, top: float, right: float, foot: float, bars: tuple[float, float]
) -> tuple[list[Line], list[Text]]:
    """Two bars with ticks at every tenth: one below the board, one to its right."""
    across, down = bars
    y, x = foot + 5, right + 5
    lines = [Line(left, y, left + across, y), Line(x, top, x, top + down)]
    for k in range(11):
        tick = 3.0 if k in (0, 10) else 1.2
        at, level = left + across * k / 10, top + down * k / 10
        lines += [Line(at, y - tick, at, y + tick), Line(x - tick, level, x + tick, level)]
    texts = [
        Text(f"{across:g} mm", left + across / 2, y + 5.5, TEXT_MM, "middle"),
        Text(f"{down:g} mm", x + 5.5, top + down / 2, TEXT_MM, "middle", upward=True),
    ]
    return lines, texts


def _labels(testfield: Testfield, targets: Array, ground: tuple[float, float, float, float], size: float) -> list[Text]:
    """Names of rows and columns on all four sides of the ground, as many as there is room for."""
    left, top, wide, high = ground
    places: dict[str, list[tuple[str, float]]] = {}
    for kind, numbers in (("r", testfield.row), ("c", testfield.col)):
        of_line = [targets[numbers == n, :2] for n in np.unique(numbers)]
        spread = np.mean([np.ptp(line, axis=0) for line in of_line], axis=0)
        side = "beside" if spread[0] > spread[1] else "above"  # a row runs across, unless the board is turned
        level = 1 if side == "beside" else 0
        middles = [float(line[:, level].mean()) for line in of_line]
        names = [f"{kind}{n}" for n in np.unique(numbers)]
        places.setdefault(side, []).extend(zip(names, middles, strict=True))
    texts = []
    for words, x in _spaced(places.get("above", []), 2.6 * size):
        for y in (top - size, top + high + 1.75 * size):
            texts.append(Text(words, x, y, size, "middle", faint=True))
    for words, y in _spaced(places.get("beside", []), 1.5 * size):
        texts.append(Text(words, left - size, y + 0.36 * size, size, "end", faint=True))
        texts.append(Text(words, left + wide + size, y + 0.36 * size, size, faint=True))
    return texts


def _spaced(labels: list[tuple[str, float]], least: float) -> list[tuple[str, float]]:
    """Leave out labels that would touch the one before."""
    kept: list[tuple[str, float]] = []
    for words, place in sorted(labels, key=lambda label: label[1]):
        if not kept or place - kept[-1][1] >= least:
            kept.append((words, place))
    return kept


def _words(title: str, facts: str, room: tuple[float, float], bars: tuple[float, float]) -> list[Text]:
    """Title, facts and how to print, below each other from a height on; `room` is the page's width and that height."""
    width, y = room
    advice = [
        facts,
        f"Print at 100 % (actual size, not fitted to the page). The bars must measure {bars[0]:g} mm across and "
        f"{bars[1]:g} mm down, from end tick to end tick; if they do not, the printer has scaled the sheet.",
        "Use matt paper, and mount it without bubbles on a stiff, flat plate. The white rim with the names of rows (r) "
        "and columns (c) is no part of the testfield and may stay in the picture.",
    ]
    most = int((width - 2 * MARGIN_MM) / (CHARACTER * TEXT_MM))
    lines = [line for paragraph in advice for line in textwrap.wrap(paragraph, most)]
    if max(width, y + MARGIN_MM) > A4_MM[1] or min(width, y + MARGIN_MM) > A4_MM[0]:
        lines += textwrap.wrap(LARGER_THAN_A4, most)
    below = [Text(line, MARGIN_MM, y + 5.0 * k, TEXT_MM) for k, line in enumerate(lines, 2)]
    return [Text(title, MARGIN_MM, y + 5.0, 5.0), *below]


# --------------------------------------------------------------------------------------------------------------- files


def sheet_svg(sheet: Sheet) -> str:
    """Write a sheet as SVG, one user unit to the millimetre."""
    ink, paper = ("#ffffff", "#000000") if sheet.inverse else ("#000000", "#ffffff")
    w, h = f"{sheet.width_mm:.4f}", f"{sheet.height_mm:.4f}"
    left, top, wide, high = sheet.ground_mm
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{w}mm" height="{h}mm" viewBox="0 0 {w} {h}">',
        f"<title>{escape(sheet.title)}</title>",
        f'<rect width="{w}" height="{h}" fill="#ffffff"/>',
        f'<rect id="ground" x="{left:.4f}" y="{top:.4f}" width="{wide:.4f}" height="{high:.4f}" fill="{paper}"/>',
        f'<g id="targets" fill="{ink}">',
        *(f'<circle cx="{x:.4f}" cy="{y:.4f}" r="{d / 2:.4f}"/>' for x, y, d in sheet.targets_mm if sheet.dots),
        *(_svg_patch(outline, "" if is_ink else f' fill="{paper}"') for outline, is_ink in sheet.patches),
        "</g>",
        '<g id="bars" stroke="#000000" stroke-width="0.2">',
        *(f'<line x1="{a.x1_mm:.4f}" y1="{a.y1_mm:.4f}" x2="{a.x2_mm:.4f}" y2="{a.y2_mm:.4f}"/>' for a in sheet.lines),
        "</g>",
        '<g id="words" font-family="DejaVu Sans">',
        *(_svg_text(text) for text in sheet.texts),
        "</g>",
        "</svg>",
    ]
    return "\n".join(parts) + "\n"


def _svg_patch(outline: Array, fill: str) -> str:
    return f'<path d="M{" ".join(f"{x:.4f},{y:.4f}" for x, y in outline)}z"{fill}/>'


def _svg_text(text: Text) -> str:
    x, y, size = f"{text.x_mm:.3f}", f"{text.y_mm:.3f}", f"{text.size_mm:.3f}"
    turned = f' transform="rotate(-90 {x} {y})"' if text.upward else ""
    colour = "#707070" if text.faint else "#000000"
    return (
        f'<text x="{x}" y="{y}" font-size="{size}" text-anchor="{text.anchor}" fill="{colour}"{turned}>'
        f"{escape(text.words)}</text>"
    )


def sheet_pdf(sheet: Sheet) -> bytes:
    """Write a sheet as PDF on one page of its own size; viewers are asked not to scale it."""
    from reportlab.lib.units import mm  # only where a PDF is asked for: slow to import
    from reportlab.pdfgen.canvas import Canvas

    _register_font()
    out = BytesIO()
    canvas = Canvas(out, (sheet.width_mm * mm, sheet.height_mm * mm), pageCompression=1, invariant=1, lang="en")
    canvas.setTitle(sheet.title)
    canvas.setAuthor("")
    canvas.setCreator("stripe-core")
    canvas.setViewerPreference("PrintScaling", "None")
    canvas.scale(mm, mm)
    canvas.translate(0, sheet.height_mm)  # places count downwards from here
    left, top, wide, high = sheet.ground_mm
    ink, paper = (1, 0) if sheet.inverse else (0, 1)
    canvas.setFillGray(paper)
    canvas.rect(left, -top - high, wide, high, stroke=0, fill=1)
    canvas.setFillGray(ink)
    for x, y, diameter in sheet.targets_mm.tolist() if sheet.dots else ():
        canvas.circle(x, -y, diameter / 2, stroke=0, fill=1)
    for outline, is_ink in sheet.patches:
        path = canvas.beginPath()
        path.moveTo(*(outline[0] * (1, -1)).tolist())
        for x, y in outline[1:].tolist():
            path.lineTo(x, -y)
        path.close()
        canvas.setFillGray(ink if is_ink else paper)
        canvas.drawPath(path, stroke=0, fill=1)
    canvas.setLineWidth(0.2)
    for line in sheet.lines:
        canvas.line(line.x1_mm, -line.y1_mm, line.x2_mm, -line.y2_mm)
    for text in sheet.texts:
        _pdf_text(canvas, text)
    canvas.showPage()
    canvas.save()
    return out.getvalue()


def _pdf_text(canvas: Canvas, text: Text) -> None:
    canvas.saveState()
    canvas.setFont(FONT, text.size_mm)
    canvas.setFillGray(0.44 if text.faint else 0)
    canvas.translate(text.x_mm, -text.y_mm)
    if text.upward:
        canvas.rotate(90)
    draw = {"start": canvas.drawString, "middle": canvas.drawCentredString, "end": canvas.drawRightString}
    draw[text.anchor](0, 0, text.words)
    canvas.restoreState()


@cache
def _register_font() -> None:
    from reportlab.pdfbase import pdfmetrics
    from reportlab.pdfbase.ttfonts import TTFont

    pdfmetrics.registerFont(TTFont(FONT, str(resource("fonts", "DejaVuSans.ttf"))))
