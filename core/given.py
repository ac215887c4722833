"""What programs give to `core.api`, as the arrays that the rest of the package calculates with, or refused by name."""

from __future__ import annotations

from collections.abc import Mapping
from operator import index
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import InputError
from core.model import Array, DeviceSpec
from core.patterns import KINDS, Pattern, pattern_from_dict


def as_pattern(name: str, given: Pattern | Mapping[str, Any]) -> Pattern:
    """Give a pattern, or the one that its description means."""
    if isinstance(given, Mapping):
        return pattern_from_dict(dict(given), name)
    if getattr(given, "kind", None) not in KINDS:
        raise InputError(name, f"is of type {type(given).__name__}", "give a Pattern or its description")
    return given


def as_image(name: str, given: ArrayLike) -> NDArray[Any]:
    """Give an image as an array in the machine's byte order."""
    if np.ma.is_masked(given):
        raise InputError(name, "has masked pixels", "fill them, and leave the pixels out of the result")
    try:
        image = np.asarray(given)
    except (TypeError, ValueError):
        raise InputError(name, "is no array", "give an image (rows, columns)") from None
    return image.astype(image.dtype.newbyteorder("="), copy=False)


def as_size(name: str, given: tuple[int, int]) -> tuple[int, int]:
    """Give a device's columns and rows."""
    try:
        width, height = map(index, given)
    except (TypeError, ValueError):
        width = height = 0
    if min(width, height) < 1:
        raise InputError(name, f"is {given!r}", "give columns and rows, two whole numbers above 0")
    return width, height


def as_numbers(name: str, given: ArrayLike) -> Array:
    """Give numbers as an array; what is masked is NaN."""
    try:
        if np.iscomplexobj(given):
            raise TypeError
        masked = np.ma.getmaskarray(given) if isinstance(given, np.ma.MaskedArray) else False
        return np.where(masked, np.nan, np.asarray(given, np.float64))
    except (TypeError, ValueError):
        raise InputError(name, "is no array of real numbers", "give numbers in rows of equal length") from None


def as_coordinates(name: str, given: ArrayLike) -> Array:
    """Give coordinates as an array; what is masked or infinite is NaN."""
    values = as_numbers(name, given)
    return np.where(np.isfinite(values), values, np.nan)


def as_device(name: str, given: DeviceSpec) -> DeviceSpec:
    """Give a device that can be: its raster and its focal length are above 0."""
    if not isinstance(given, DeviceSpec):
        raise InputError(name, f"is of type {type(given).__name__}", "give a DeviceSpec")
    as_size(f"size of {name}", (given.width, given.height))
    lengths = as_numbers(f"{name}.pitch_mm", given.pitch_mm), as_numbers(f"{name}.nominal_c_mm", given.nominal_c_mm)
    for field, values, shape in zip(("pitch_mm", "nominal_c_mm"), lengths, ((2,), ()), strict=True):
        if values.shape != shape or not np.all((values > 0) & np.isfinite(values)):
            raise InputError(f"{name}.{field}", f"is {getattr(given, field)!r}", "give millimetres above 0")
    return given


def as_sigmas(name: str, sigma: ArrayLike, of: Array, *, exact: bool = True) -> Array:
    """Give a standard deviation to each coordinate; it may be undefined where that is, and 0 if `exact`."""
    values = as_numbers(name, sigma)
    try:
        spread = np.broadcast_to(values, of.shape)
    except ValueError:
        raise InputError(name, f"has shape {values.shape}", f"give what broadcasts to {of.shape}") from None
    if not np.all((np.isfinite(spread) & (spread >= 0) & (exact | (spread > 0))) | np.isnan(of)):
        seen = f"has {'' if exact else 'zero, '}negative or undefined values"
        raise InputError(name, seen, "give standard deviations")
    return spread
