"""What programs give to `core.api`, as the arrays that the rest of the package calculates with, or refused by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import index
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from core.errors import InputError
from core.model import AdjustedDevice, Array, DeviceSpec, Interior
from core.patterns import KINDS, Pattern, pattern_from_dict

Device = AdjustedDevice | tuple[DeviceSpec, Interior]

_BESIDE = 0.5  # of a raster that coordinates may lie beside it: those of a projector are extrapolated at times


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


def as_known(name: str, given: Device) -> tuple[DeviceSpec, Interior]:
    """Give a device whose interior orientation is known."""
    known = (given.spec, given.interior) if isinstance(given, AdjustedDevice) else given
    match known:
        case (DeviceSpec() as spec, Interior() as interior):
            return as_device(name, spec), interior
    raise InputError(
        name, f"is of type {type(given).__name__}", "give what a calibration holds, or (DeviceSpec, Interior)"
    )


def as_board(name: str, given: ArrayLike) -> Array:
    """Give the points of a board, (n, 3), z being 0 where it is not given."""
    board = np.atleast_2d(as_numbers(name, given))
    if board.ndim != 2 or board.shape[1] not in (2, 3):
        raise InputError(name, f"has shape {board.shape}", "give (n, 3) or (n, 2)")
    if not np.isfinite(board).all():
        raise InputError(name, "has undefined values", "give approximate coordinates of every point")
    return board if board.shape[1] == 3 else np.column_stack([board, np.zeros(len(board))])


def as_positions(name: str, given: Sequence[ArrayLike], n: int, device: DeviceSpec) -> Array:
    """Give the coordinates (k, n, 2) of a board's points in a device, at its k positions."""
    size = np.array([device.width, device.height])
    arrays = [as_coordinates(f"{name}[{k}]", uv) for k, uv in enumerate(given)]
    for k, uv in enumerate(arrays):
        if uv.shape != (n, 2):
            raise InputError(f"{name}[{k}]", f"has shape {uv.shape}", f"give ({n}, 2), NaN where a point was not seen")
        beside = np.any((uv < -_BESIDE * size) | (uv > (1 + _BESIDE) * size), axis=1)
        if beside.any():
            u, v = uv[beside][0]
            seen = f"has ({u:.6g}, {v:.6g}), its device {size[0]}x{size[1]} pixels or lines"
            raise InputError(f"{name}[{k}]", seen, "give coordinates of this device, or its size")
    if not arrays:
        raise InputError(name, "is empty", "give one array for each position of the board")
    return np.stack(arrays)
