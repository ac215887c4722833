"""Two kept runs side by side: every parameter with its sigma, and the differences in units of sigma."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from core.geometry import rotation_vector_from_matrix
from core.model import INTERIOR_NAMES
from core.pipeline.options import DEVICES
from core.pipeline.runs import Run


@dataclass(frozen=True)
class Difference:
    """One parameter in two runs.

    `first` and `second` are (value, sigma) in `unit`, sigma 0 where it was held. `in_sigmas` is the difference, second
    minus first, over the greater of both sigmas: not a test, since the runs share observations, but a measure of what a
    change was worth. It is None where neither run estimated the parameter or they are not comparable.
    """

    name: str
    unit: str
    first: tuple[float, float]
    second: tuple[float, float]
    difference: float
    in_sigmas: float | None


def compare_runs(first: Run, second: Run) -> tuple[Difference, ...]:
    """Compare the photogrammetric calibrations of two runs, parameter by parameter; empty if one has none.

    The turn of the projector between the runs is given about the camera's axes: its components in the first run are
    zero by definition.
    """
    a, b = (run.figures.get("photogrammetric") for run in (first, second))
    if a is None or b is None:
        return ()
    found = []
    for device in DEVICES:
        same_zero = np.isclose(a[device]["r0_mm"], b[device]["r0_mm"], rtol=1e-9)
        for name in INTERIOR_NAMES:
            key = name if name.startswith("A") else f"{name}_mm"
            unit = {"A1": "mm⁻²", "A2": "mm⁻⁴", "A5": "mm⁻¹", "A6": "mm⁻¹"}.get(name, "" if key == name else "mm")
            one, other = ((float(run[device][key]["value"]), float(run[device][key]["sigma"])) for run in (a, b))
            found.append(_difference(f"{device} {name}", unit, one, other, bool(same_zero)))
    return (*found, *_relative(a["projector_from_camera"], b["projector_from_camera"]))


def _relative(a: dict[str, Any], b: dict[str, Any]) -> list[Difference]:
    """Differences of the relative orientations; the shift and turn of the projector's frame."""
    turn = rotation_vector_from_matrix(np.array(b["rotation"]) @ np.array(a["rotation"]).T)
    found = []
    for i, axis in enumerate("XYZ"):
        sigmas = [1e3 * _sigma(run, "rotation_sigma_rad", i) for run in (a, b)]
        found.append(_difference(f"turn about {axis}", "mrad", (0.0, sigmas[0]), (1e3 * float(turn[i]), sigmas[1])))
    for i, axis in enumerate("XYZ"):
        one, other = ((float(run["translation_mm"][i]), _sigma(run, "translation_sigma_mm", i)) for run in (a, b))
        found.append(_difference(f"shift {axis}", "mm", one, other))
    return found


def _sigma(run: dict[str, Any], key: str, axis: int) -> float:
    return float(run[key][axis] or 0.0)


def _difference(
    name: str, unit: str, first: tuple[float, float], second: tuple[float, float], comparable: bool = True
) -> Difference:
    difference, sigma = second[0] - first[0], max(first[1], second[1])
    return Difference(name, unit, first, second, difference, difference / sigma if sigma > 0 and comparable else None)
