"""The drawings of the report, each with a title, a caption that says what to look at, and a text alternative.

canvas.py     colours that follow the page from light to dark, the drawing surface
strokes.py    one drawing for SVG and PDF
planes.py     deviation maps on one colour scale, histograms with the predicted normal curve
images.py     residual vectors and coverage over each device's image
network.py    the network from above and from the side, convergence, correlations
rig.py        the control chart, a projector's response, uncertainty over the working volume

Matplotlib is used through its objects, on its Agg and SVG renderers: no pyplot, no window, no current figure.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from matplotlib.artist import ArtistInspector


@contextmanager
def _undocumented() -> Iterator[None]:
    """Let matplotlib import its artists without listing their properties in docstrings: a third of the time."""
    inspector: Any = ArtistInspector
    listed = inspector.get_setters, inspector.get_aliases
    inspector.get_setters, inspector.get_aliases = (lambda _: []), (lambda _: {})
    try:
        yield
    finally:
        inspector.get_setters, inspector.get_aliases = listed


with _undocumented():
    from core.report.figures.canvas import Drawing, set_on_page, svg_text

__all__ = ["Drawing", "set_on_page", "svg_text"]
