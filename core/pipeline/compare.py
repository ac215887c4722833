"""Two kept runs side by side: every parameter with its sigma, and the differences in units of sigma."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from core.geometry import LENSES, rotation_vector_from_matrix
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
    """Compare the calibrations of devices in two runs, parameter by parameter; empty if one has none.

    The turn of the projector between the runs is given about the camera's axes: its components in the first run are
    zero by definition.
    """
    for method in first.figures.keys() & second.figures.keys():
        if "projector_from_camera" in first.figures[method]:
            return _of_devices(first.figures[method], second.figures[method])
    return ()


def _of_devices(a: dict[str, Any], b: dict[str, Any]) -> tuple[Difference, ...]:
    found = []
    first_devices, second_devices = (run.get("devices", run) for run in (a, b))
    for device in a.get("devices", DEVICES):
        one, other = first_devices[device], second_devices.get(device)
        lens = LENSES[one.get("model", "A1..A6")]
        if other is None or other.get("model", "A1..A6") != lens.name:
            continue
        same_zero = np.isclose(one.get("r0_mm", 0.0), other.get("r0_mm", 0.0), rtol=1e-9)
        for name, key, unit in zip(lens.names, lens.keys, lens.units, strict=True):
            values = [(float(d[key]["value"]), float(d[key]["sigma"])) for d in (one, other)]
            found.append(_difference(f"{device} {name}", unit, values[0], values[1], bool(same_zero)))
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
