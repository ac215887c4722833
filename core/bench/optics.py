"""How light gets from an LCD line to a camera pixel: apertures, defocus, falloff.

Everything is separable in the two axes of the device, so the blurred pattern is kept as tables along u and along v.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike
from scipy.special import erf

from core.bench.tables import PAD, PER_LINE
from core.lazy import dataclass
from core.model import Array, Floats

DEFOCUS_STEP = 0.02  # of |Z_focus / Z - 1| from one tabulated width to the next
WIDTHS = 16


@dataclass(frozen=True)
class Lcd:
    """The projector's plate and lens."""

    fill: float = 0.92  #: part of a line's pitch that switches; the gap between lines stays as if switched off
    contrast: float = 60.0  #: light of a bright line over that of a dark one
    blur_lines: float = 0.6  #: Gaussian sigma of the image of a point at the focus distance, lines
    #: Gaussian sigma added quadratically per unit of ``|Z_focus / Z - 1|``, lines (thin lens)
    defocus_lines: float = 1.5
    focus_mm: float = 600.0  #: distance of best focus from the projection centre, along the axis
    exponent: float = 1.0  #: light is the level it was told to this power

    def table_sigmas(self) -> Array:
        """Give the widths of the blur that are tabulated, ``sqrt(s0² + (k |Zf / Z - 1|)²)``, shape (WIDTHS,)."""
        e = (np.arange(WIDTHS) + 0.5) * DEFOCUS_STEP
        return np.hypot(self.blur_lines, self.defocus_lines * e)


@dataclass(frozen=True)
class Lens:
    """The camera's lens: Gaussian sigma of its point image in px."""

    blur_px: float = 0.35


def line_response(offset_lines: ArrayLike, aperture_lines: float, sigma_lines: ArrayLike) -> Array:
    """Light of one line, a rectangle of the given width blurred by a Gaussian, at offsets from its middle.

    ``½ [erf((x + a/2) / √2 σ) - erf((x - a/2) / √2 σ)]``
    """
    x, s = np.asarray(offset_lines, np.float64), np.sqrt(2) * np.maximum(np.asarray(sigma_lines, np.float64), 1e-6)
    return np.asarray(0.5 * (erf((x + aperture_lines / 2) / s) - erf((x - aperture_lines / 2) / s)))


def blurred_lines(lines: ArrayLike, aperture_lines: float, sigmas_lines: Array) -> Array:
    """Tabulate a line pattern, the transmission (n,) of every line, after its aperture (lines) and blurs (k,).

    Entry j of the table, (k, (n + 2 PAD) PER_LINE), belongs to the coordinate ``j / PER_LINE - PAD``.
    """
    reach = int(np.ceil(1 + 5.5 * np.max(sigmas_lines)))  # lines on either side that still shine into a place
    b = np.pad(np.asarray(lines, np.float64), PAD + reach)
    windows = sliding_window_view(b, 2 * reach + 1)  # (n + 2 PAD, 2 reach + 1)
    fraction = np.arange(PER_LINE) / PER_LINE
    offset = fraction[None, :] - np.arange(-reach, reach + 1)[:, None]
    kernel = line_response(offset[None], aperture_lines, sigmas_lines[:, None, None])  # (k, 2 reach + 1, PER_LINE)
    return np.asarray(windows @ kernel).reshape(len(sigmas_lines), -1)


def relative_tables(lcd: Lcd, lines: ArrayLike) -> Floats:
    """Tabulate the pattern relative to the blurred raster itself, shape as `blurred_lines`.

    The raster's blurred edge is common to all patterns and is kept with the geometry (`window_tables`).
    """
    sigmas = lcd.table_sigmas()
    pattern = blurred_lines(lines, lcd.fill, sigmas)
    window = blurred_lines(np.ones(np.shape(lines)), 1.0, sigmas)
    return np.asarray(pattern / np.maximum(window, 1e-9), np.float32)


def window_tables(lcd: Lcd, lines: int) -> Floats:
    """Tabulate the blurred raster of `lines` lines: 1 inside, 0 outside."""
    return blurred_lines(np.ones(lines), 1.0, lcd.table_sigmas()).astype(np.float32)


def pixel_weights(subsamples: int, blur_px: float) -> Floats:
    """Weights of the subsamples that form one pixel, along one axis: pixel area and lens blur together.

    Shape (subsamples + 2 m,), centred on the pixel, sum 1; m subsamples of the neighbours on either side.
    """
    margin = int(np.ceil(4 * blur_px * subsamples))
    x = (np.arange(-margin, subsamples + margin) + 0.5) / subsamples - 0.5
    w = line_response(x, 1.0, blur_px) if blur_px > 0 else np.where(np.abs(x) < 0.5, 1.0, 0.0)
    return np.asarray(w / w.sum(), np.float32)
