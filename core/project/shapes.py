"""Whether what was read from an archive is what its dataclass says: the type of each field, the shape of each array."""

from __future__ import annotations

import dataclasses
import sys
import types
from collections.abc import Hashable, Mapping
from functools import cache
from typing import Any, Literal, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from core.geometry import Pose

# a letter stands for one length within an object, a number for itself; of lists their length
SHAPES: dict[str, dict[str, str]] = {
    "Pose": {"rotation": "3 3", "translation_mm": "3"},
    "Testfield": {"row": "n", "col": "n", "xyz_mm": "n 3", "diameter_mm": "n"},
    "TargetSet": {
        "row": "n",
        "col": "n",
        "camera_uv": "n 2",
        "camera_cov": "n 2 2",
        "projector_uv": "n 2",
        "projector_sigma": "n 2",
        "eccentricity_px": "n 2",
        "diameter_px": "n",
        "height_px": "n",
        "row_shifts": "3 3",
        "response": "k 2",
    },
    "Network": {
        "station_names": "s",
        "station_device": "s",
        "station_pose": "s",
        "point_names": "n",
        "point_xyz_mm": "n 3",
        "observation_station": "m",
        "observation_point": "m",
        "observation_uv": "m 2",
        "observation_sigma": "m 2",
    },
    "Adjustment": {
        "points_mm": "n 3",
        "point_cov_mm2": "n 3 3",
        "residuals": "m 2",
        "redundancy_numbers": "m 2",
        "parameter_names": "p",
        "parameter_cov": "p p",
    },
    "AdjustedDevice": {"sigma": "k"},
    "RigCorrection": {"devices": "d", "rotation_rad": "d 3", "shift_mm": "d 3", "sigma": "d 6"},
    "PhotogrammetricCalibration": {"covariance": "k k", "parameter_names": "k"},
    "DepthCalibration": {
        "depths_mm": "d",
        "coefficients": "c h w",
        "u_range": "2 h w",
        "axis_direction": "3",
        "covariance": "k k",
    },
    "PlaneEvaluation": {"plane": "4", "deviation_mm": "h w", "sigma_mm": "a b"},
}


def check_fields(value: Any) -> None:
    """See that every field of a dataclass has its type and shape; a ValueError names the first that has not."""
    kind = type(value)
    for name, hint in _hints(cast(Hashable, kind)).items():
        if not _fits(getattr(value, name), hint):
            raise ValueError(f"{kind.__name__}.{name} is no {_name(hint)}")
    sizes: dict[str, int] = {}
    for name, shape in SHAPES.get(kind.__name__, {}).items():
        item = getattr(value, name, None)
        if item is None:
            continue
        seen = np.shape(item) if isinstance(item, np.ndarray) else (len(item),)
        wanted = shape.split()
        fits = len(seen) == len(wanted)
        for letter, size in zip(wanted, seen, strict=False):
            fits &= size == (int(letter) if letter.isdigit() else sizes.setdefault(letter, size))
        if not fits:
            raise ValueError(f"{kind.__name__}.{name} has the shape {seen}, not {tuple(wanted)}")
    if kind.__name__ == "Network":
        _check_indices(value)


def _check_indices(network: Any) -> None:
    for name, of in (("observation_station", "station_names"), ("observation_point", "point_names")):
        indices, count = getattr(network, name), len(getattr(network, of))
        if indices.size and not 0 <= int(indices.min()) <= int(indices.max()) < count:
            raise ValueError(f"Network.{name} points beyond {of}")


@cache
def _hints(kind: Any) -> dict[str, Any]:
    module = sys.modules[kind.__module__]
    hints = get_type_hints(kind, vars(module), {"Pose": Pose})
    return {field.name: hints[field.name] for field in dataclasses.fields(kind)}


def _fits(value: Any, hint: Any) -> bool:
    origin, inner = get_origin(hint), get_args(hint)
    if hint is Any:
        return True
    if origin in (Union, types.UnionType):
        return any(_fits(value, one) for one in inner)
    if origin is Literal:
        return value in inner
    if origin is np.ndarray:
        kinds = "iu" if issubclass(get_args(inner[1])[0], np.integer) else "f"
        return isinstance(value, np.ndarray) and value.dtype.kind in kinds
    if origin is tuple:
        if not isinstance(value, tuple):
            return False
        if len(inner) == 2 and inner[1] is Ellipsis:
            return all(_fits(item, inner[0]) for item in value)
        return len(value) == len(inner) and all(_fits(item, one) for item, one in zip(value, inner, strict=True))
    if origin in (dict, Mapping):
        return isinstance(value, Mapping) and all(_fits(item, inner[1]) for item in value.values())
    if hint is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if hint is int:
        return isinstance(value, int) and not isinstance(value, bool)
    if hint is type(None):
        return value is None
    return not isinstance(hint, type) or isinstance(value, hint)


def _name(hint: Any) -> str:
    return getattr(hint, "__name__", None) or str(hint).rpartition(".")[2]
