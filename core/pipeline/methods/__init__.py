"""Methods of calibration by name; others may be added to `METHODS`.

Commands, window, states, kept runs, reconstruction, evaluation and report know a method by its record alone.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from core.errors import InputError
from core.figures import picked, verdict_figures
from core.model import Calibration, Capture, Figures, Method
from core.pipeline.method import Calibrated, CalibrationMethod, Judgement
from core.pipeline.methods.photogrammetric import PHOTOGRAMMETRIC
from core.pipeline.methods.polynomial import POLYNOMIAL

METHODS: dict[Method, CalibrationMethod] = {"photogrammetric": PHOTOGRAMMETRIC, "polynomial": POLYNOMIAL}


def method_of(name: Method) -> CalibrationMethod:
    """Look up a method by its name."""
    if name not in METHODS:
        raise InputError("method", f"is {name!r}", f"choose among {', '.join(METHODS)}")
    return METHODS[name]


def shares(captures: Iterable[Capture], known: Collection[Method] = ()) -> dict[Method, list[Capture]]:
    """Give every method its captures: those of `known` methods, and of all others that could be used."""
    given = list(captures)
    found = {name: [c for c in given if method.uses(c)] for name, method in METHODS.items()}
    enough = {name for name, own in found.items() if len(own) >= METHODS[name].least}
    return {name: own for name, own in found.items() if name in known or (own and (name in enough or not enough))}


def archives_of(name: Method) -> dict[str, type]:
    """Give the archives of a run that hold a method's result, the calibration first, and what each holds."""
    return {f"{name}.npz": METHODS[name].result, **METHODS[name].beside}


def calibration_figures(calibrations: Mapping[Method, Calibration]) -> Figures:
    """Give every calibration as `calibrate --json` writes it."""
    return {
        name: {
            **METHODS[name].figures(calibration),
            "verdict": verdict_figures(calibration.verdict),
            "left_out": [picked(entry, "capture points of because") for entry in calibration.left_out],
            "warnings": list(calibration.warnings),
        }
        for name, calibration in calibrations.items()
    }


__all__ = [
    "METHODS", "Calibrated", "CalibrationMethod", "Judgement", "archives_of", "calibration_figures", "method_of",
    "shares",
]  # fmt: skip
