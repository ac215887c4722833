"""Calibrations for other programs, and theirs for this one.

pinhole.py   the model that all of them share, in OpenCV's axes, and the fit of ours to it
formats/     one file a format; a new one is a file with a `FORMAT`

Conventions, told once: in OpenCV's axes X is right, Y down, Z forward; ours have Y up and look along -Z, so coordinates
change by ``F = diag(1, -1, -1)`` and a pose R, t becomes F R F, F t. Pixel coordinates of ours and OpenCV's count from
the centre of the top-left pixel; formats that count from its corner or from 1 say so in their file.
"""

from core.exchange.formats import FORMATS, Format
from core.exchange.pinhole import Pair, Pinhole, fit_pair, pair_to_calibration

__all__ = ["FORMATS", "Format", "Pair", "Pinhole", "fit_pair", "pair_to_calibration"]
