"""A figure is drawn once for both files: what goes into the SVG is kept for a page of the PDF.

Marks are in points from the figure's lower left corner, in the order they are drawn. Hatching is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from io import StringIO
from typing import Any

import numpy as np
from matplotlib import _path
from matplotlib.backends.backend_mixed import MixedModeRenderer
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D
from PIL.Image import fromarray
from reportlab.lib.utils import ImageReader
from reportlab.pdfgen.canvas import Canvas

Mark = Callable[[Canvas], None]
Look = tuple[str, tuple[float, float]]
FONT, BOLD = "ReportSans", "ReportSans-Bold"
CAPS, JOINS = {"butt": 0, "round": 1, "projecting": 2}, {"miter": 0, "round": 1, "bevel": 2}
DPI = 200  # of images
OPERATORS = [b"m", b"l", b"", b"c", b"h"]  # quadratic curves become cubic ones


def draw_once(figure: Figure) -> tuple[str, tuple[Mark, ...]]:
    """Draw a figure that is laid out: the SVG file's text, and what sets the same on a page of a PDF."""
    out = StringIO()
    figure.set_dpi(72)
    width, height = figure.get_size_inches()
    vector = _Kept(width * 72, height * 72, out, image_dpi=DPI, metadata={"Date": None, "Creator": None})
    mixed: Any = MixedModeRenderer(figure, width, height, DPI, vector)
    figure.draw(mixed)
    mixed.finalize()
    return out.getvalue(), tuple(vector.marks)


class _Kept(RendererSVG):
    """Writes SVG, and keeps every mark."""

    def __init__(self, *args: Any, **options: Any) -> None:
        self.marks: list[Mark] = []
        super().__init__(*args, **options)

    def draw_path(self, gc: Any, path: Any, transform: Any, rgbFace: Any = None) -> None:
        super().draw_path(gc, path, transform, rgbFace)
        edge = (0.0, 0.0, self.width, self.height) if rgbFace is None else None
        code = _code(path, transform, edge, path.should_simplify and rgbFace is None) + _painted(gc, rgbFace)
        self.marks.append(partial(_stroke, _look(gc, rgbFace), code))

    def draw_markers(
        self, gc: Any, marker_path: Any, marker_trans: Any, path: Any, trans: Any, rgbFace: Any = None
    ) -> None:
        super().draw_markers(gc, marker_path, marker_trans, path, trans, rgbFace)
        code = _code(marker_path, marker_trans) + _painted(gc, rgbFace)
        places = (points[-2:] for points, _ in path.iter_segments(trans, simplify=False) if len(points))
        every = "\n".join(f"q 1 0 0 1 {x:.3f} {y:.3f} cm {code} Q" for x, y in places)
        self.marks.append(partial(_stroke, _look(gc, rgbFace), every))

    def draw_path_collection(self, *args: Any, **options: Any) -> None:
        super(RendererSVG, self).draw_path_collection(*args, **options)  # path by path

    def draw_image(self, gc: Any, x: float, y: float, im: Any, transform: Any = None) -> None:
        if im.size and (im[..., 3] == 255).all():
            im = im[..., :3]  # packed in three quarters of the time
        super().draw_image(gc, x, y, im, transform)
        if im.size:
            place = transform or Affine2D().scale(*(72 * n / self.image_dpi for n in im.shape[1::-1]))
            matrix = Affine2D(place.get_matrix()).translate(x, y).to_values()
            self.marks.append(partial(_image, _look(gc, None), matrix, np.ascontiguousarray(im[::-1])))

    def draw_text(
        self, gc: Any, x: float, y: float, s: str, prop: Any, angle: float, ismath: Any = False, mtext: Any = None
    ) -> None:
        super().draw_text(gc, x, y, s, prop, angle, ismath, mtext)
        font = BOLD if prop.get_weight() in ("bold", 700) else FONT
        look = _look(gc, gc.get_rgb())
        self.marks.append(partial(_text, look, (x, self.height - y), angle, s, font, prop.get_size_in_points()))


def _code(path: Any, transform: Any, edge: tuple[float, ...] | None = None, simplify: bool = False) -> str:
    """Give a path as operators of a PDF page; `edge`, the figure's, takes off what lies far beyond."""
    convert: Any = vars(_path)["convert_to_string"]
    return str(convert(path, transform, edge, simplify, None, 3, OPERATORS, True), "ascii")


def _painted(gc: Any, fill: Any) -> str:
    """Give the operator that ends a path."""
    stroked = gc.get_linewidth() > 0 and gc.get_rgb()[3] > 0
    filled = fill is not None and (len(fill) < 4 or fill[3] > 0)
    return " B" if stroked and filled else " S" if stroked else " f" if filled else " n"


def _look(gc: Any, fill: Any) -> Look:
    """Take over how a mark is drawn, as operators of a PDF page and two opacities: matplotlib changes the object."""
    path, transform = gc.get_clip_path()
    clip = gc.get_clip_rectangle()
    how = []
    if clip is not None:
        how.append("{:.3f} {:.3f} {:.3f} {:.3f} re W n".format(*clip.bounds))
    if path is not None:
        how.append(f"{_code(path, transform)} W n")
    how.append("{:.4f} {:.4f} {:.4f} RG".format(*gc.get_rgb()[:3]))
    if fill is not None:
        how.append("{:.4f} {:.4f} {:.4f} rg".format(*fill[:3]))
    how.append(f"{gc.get_linewidth():.3f} w {CAPS[gc.get_capstyle()]} J {JOINS[gc.get_joinstyle()]} j")
    offset, dashes = gc.get_dashes()
    if dashes is not None:
        how.append(f"[{' '.join(f'{dash:.3f}' for dash in dashes)}] {offset:.3f} d")
    alphas = gc.get_rgb()[3], fill[3] if fill is not None and len(fill) > 3 else 1.0
    return " ".join(how), (gc.get_alpha(),) * 2 if gc.get_forced_alpha() else alphas


@contextmanager
def _drawn(canvas: Canvas, look: Look) -> Iterator[None]:
    """Draw on a page as a mark looks."""
    how, (stroke, fill) = look
    canvas.saveState()
    canvas.addLiteral(how)
    if (stroke, fill) != (1.0, 1.0):
        canvas.setStrokeAlpha(stroke)
        canvas.setFillAlpha(fill)
    yield
    canvas.restoreState()


def _stroke(look: Look, code: str, canvas: Canvas) -> None:
    with _drawn(canvas, look):
        canvas.addLiteral(code)


def _image(look: Look, matrix: tuple[float, ...], pixels: Any, canvas: Canvas) -> None:
    with _drawn(canvas, look):
        canvas.transform(*matrix)
        canvas.drawImage(ImageReader(fromarray(pixels)), 0, 0, 1, 1, mask="auto")


def _text(look: Look, at: tuple[float, float], angle: float, text: str, font: str, size: float, canvas: Canvas) -> None:
    with _drawn(canvas, look):
        canvas.translate(*at)
        canvas.rotate(angle)
        canvas.setFont(font, size)
        canvas.drawString(0, 0, text)
