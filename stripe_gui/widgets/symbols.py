"""Thin marks for points in an image, where the usual ones are filled shapes that hide what they mark."""

from __future__ import annotations

from functools import cache

from PySide6.QtGui import QPainterPath


@cache
def plus() -> QPainterPath:
    """Two strokes across each other."""
    path = QPainterPath()
    for x, y in ((1, 0), (0, 1)):
        path.moveTo(-0.5 * x, -0.5 * y)
        path.lineTo(0.5 * x, 0.5 * y)
    return path


@cache
def cross_hairs() -> QPainterPath:
    """Four strokes that leave the middle free."""
    path = QPainterPath()
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        path.moveTo(0.18 * x, 0.18 * y)
        path.lineTo(0.5 * x, 0.5 * y)
    return path
