"""The drawing surface: colours that follow the page from light to dark.

Figures are drawn in the colours of the light page. In the SVG every one of them is replaced by a CSS variable of the
page, which the style sheet sets for light, dark and print. The colours of images (deviation maps and the like) stay.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import Any

import matplotlib as mpl
from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.ft2font import FT2Font
from reportlab.pdfgen.canvas import Canvas

from core.lazy import dataclass
from core.report.figures.strokes import Mark, draw_once

NO_DATA = "#9aa1a9"
WIDTH_IN = 8.4
BAR_IN = 0.75  # for a colour scale below panels, with its numbers and label
INK, MUTED, GRID, SURFACE = "#1b1f24", "#57606b", "#d5dae0", "#fefeff"
CAMERA, PROJECTOR, THIRD = "#0b6bb5", "#b8480b", "#2f7d4f"  # distinct in lightness and hue for every colour vision
FILL = "#8fb4d6"
CSS_VARIABLES = {
    INK: "--ink",
    MUTED: "--muted",
    GRID: "--grid",
    SURFACE: "--surface",
    CAMERA: "--camera",
    PROJECTOR: "--projector",
    THIRD: "--third",
    FILL: "--fill",
}

_RC = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.titleweight": "normal",
    "axes.titley": 1.0,  # above the axes, where nothing else stands: it need not be looked for
    "axes.labelsize": 8.5,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "text.color": INK,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.facecolor": "none",
    "axes.linewidth": 0.7,
    "axes.grid": False,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "figure.facecolor": "none",
    "savefig.facecolor": "none",
    "text.usetex": False,
    "text.parse_math": False,  # a capture may be called "$1"
    "axes.formatter.use_mathtext": False,
    "axes.unicode_minus": True,
    "svg.fonttype": "path",
    "svg.hashsalt": "report",
    "path.simplify": True,
}


@dataclass(frozen=True)
class Drawn:
    """What a figure has become: its size, an SVG element for a page, and what sets the same on a page of a PDF."""

    size_in: tuple[float, float]
    svg: str
    marks: tuple[Mark, ...]


@dataclass(frozen=True)
class Drawing:
    """A figure of the report."""

    key: str  #: its name in the files, unique in a report: lower-case letters, digits and hyphens
    title: str
    caption: str  #: what to look at, in words
    alternative: str  #: what is seen, for whom it cannot be shown
    figure: Figure | Drawn  #: drawn once for both files

    @property
    def size_in(self) -> tuple[float, float]:
        """Width and height."""
        if isinstance(self.figure, Drawn):
            return self.figure.size_in
        width, height = self.figure.get_size_inches()
        return float(width), float(height)


@contextmanager
def drawing_style() -> Iterator[None]:
    """Draw in the report's style, whatever the user's matplotlib settings are."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_RC)  # type: ignore[arg-type]
        yield


def new_figure(
    height_in: float,
    rows: int = 1,
    columns: int = 1,
    *,
    left: float = 0.75,
    right: float = 0.15,
    top: float = 0.15,
    bottom: float = 0.45,
    across: float = 0.5,
    down: float = 0.5,
    **options: Any,
) -> tuple[Figure, Any]:
    """Make a figure and its panels, (rows, columns); around and between them are so many inches.

    Nothing of it is measured: to lay a figure out by the size of its texts takes as long as to draw it.
    """
    width = (WIDTH_IN - left - right - (columns - 1) * across) / columns
    height = (height_in - top - bottom - (rows - 1) * down) / rows
    figure = Figure(figsize=(WIDTH_IN, height_in))
    places = {"left": left / WIDTH_IN, "right": 1 - right / WIDTH_IN, "wspace": across / width}
    places |= {"bottom": bottom / height_in, "top": 1 - top / height_in, "hspace": down / height}
    return figure, figure.subplots(rows, columns, squeeze=False, gridspec_kw=places, **options)


def drawn(drawing: Drawing) -> Drawing:
    """Draw the figure, inside `drawing_style`."""
    return replace(drawing, figure=_strokes(drawing))


def _strokes(drawing: Drawing) -> Drawn:
    figure = drawing.figure
    if isinstance(figure, Drawn):
        return figure
    svg, marks = draw_once(figure)
    return Drawn(drawing.size_in, _element(svg, drawing.key), marks)


def svg_text(drawing: Drawing) -> str:
    """Give the drawing as an SVG element to stand in a page, its colours as CSS variables."""
    with drawing_style():
        return _strokes(drawing).svg


def _element(svg: str, key: str) -> str:
    text = svg[svg.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, count=1, flags=re.DOTALL)
    # names are unique in one drawing only, but must be in the whole page
    text = text.replace(' id="', f' id="{key}-')
    text = text.replace('href="#', f'href="#{key}-').replace("url(#", f"url(#{key}-")
    for colour, variable in CSS_VARIABLES.items():
        text = text.replace(colour, f"var({variable})")
    return text.strip()


def set_on_page(drawing: Drawing, canvas: Canvas) -> None:
    """Set the drawing on a page of a PDF, its lower left corner at the origin, in points."""
    with drawing_style():
        marks = _strokes(drawing).marks
    for mark in marks:
        mark(canvas)


def drawable(text: str) -> str:
    """Replace characters that the figures' font lacks by a box, so that a name is never a reason to fail.

    Examples
    --------
    >>> drawable("Prüffeld 計")
    'Prüffeld □'
    """
    return "".join(c if ord(c) in _characters() else "□" for c in text)


def shortened(text: str, length: int = 24) -> str:
    """Give the text in at most `length` characters, its middle left out."""
    if len(text) <= length:
        return text
    return f"{text[: length // 2 - 1]}…{text[-(length - length // 2) :]}"


def plain_axes(axes: Axes) -> None:
    """Take the upper and right frame away, and lay a light grid behind the data."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_axisbelow(True)
    axes.grid(True)


def colour_bar(image: ScalarMappable, axes: Axes, label: str, **options: Any) -> None:
    """Set the colour scale of an image into axes of its own."""
    figure = axes.get_figure()
    assert isinstance(figure, Figure)
    bar = figure.colorbar(image, cax=axes, **options)
    bar.set_label(label)
    bar.outline.set_edgecolor(MUTED)
    if bar.solids is not None:
        bar.solids.set_rasterized(True)  # as strokes its many cells would show seams


def axes_below(figure: Figure) -> Axes:
    """Add axes for a colour scale below all panels, which leave `BAR_IN` inches for it."""
    height_in = figure.get_figheight()
    return figure.add_axes((0.2, 0.46 / height_in, 0.6, 0.11 / height_in))


def width_in(text: str, size_pt: float) -> float:
    """Tell how wide a line of text is in the figures' font, in inches.

    Examples
    --------
    >>> width_in("iiii", 8) < width_in("mm", 8) == width_in("mm", 16) / 2 < 0.25
    True
    """
    font = _font()
    font.set_size(100, 72)  # of such letters the whole pixels to which they are hinted matter little
    font.set_text(text)
    return float(font.get_width_height()[0]) / 64 / 100 * size_pt / 72


def device_colour(index: int) -> str:
    """Colour of the first, second, … device; the first two are camera and projector."""
    return (CAMERA, PROJECTOR, THIRD)[index % 3]


@cache
def _font() -> FT2Font:
    return FT2Font(font_manager.findfont("DejaVu Sans"))


@cache
def _characters() -> frozenset[int]:
    return frozenset(_font().get_charmap())
