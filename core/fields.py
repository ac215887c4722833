"""The checked reading of files, of objects of a JSON file and rows of a table: all is tested where it enters, once."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from core.errors import InputError

_ABSENT: Any = object()

LARGEST = 1e12  # no length, angle or pixel of a rig comes near these; the squares of what lies between can be summed
SMALLEST = 1e-12


@dataclass(frozen=True)
class Fields:
    """An object read from a file, with the place it came from for the messages.

    Every reader raises `InputError` naming the file, the field, the value seen and what is allowed. A field with a
    default may be missing or null; unknown fields are ignored.

    Examples
    --------
    >>> Fields({"width": 748}, "project.json").integer("width", least=1)
    748
    >>> Fields({"width": "wide"}, "project.json").integer("width", least=1)
    Traceback (most recent call last):
    core.errors.InputError: ...
    """

    data: Mapping[str, Any]
    where: str

    @staticmethod
    def of(value: object, where: str) -> Fields:
        """Take a JSON value that must be an object."""
        if not isinstance(value, dict | Mapping):  # the common kind first: it is by far quicker to tell
            raise InputError(where, f"found {_short(value)}", "give an object with named fields")
        return Fields(value, where)

    def _get(self, key: str, default: Any) -> Any:
        value = self.data.get(key)
        if value is None:
            if default is _ABSENT:
                raise InputError(self.where, f"field {key!r} is missing", f"add {key!r}")
            return default
        return value

    def refuse(self, key: str, value: object, remedy: str) -> InputError:
        """Make the error for a field's value."""
        return InputError(self.where, f"{key} is {_short(value)}", remedy)

    def nested(self, key: str) -> Fields:
        """Read a nested object."""
        return Fields.of(self._get(key, _ABSENT), f"{self.where}: {key}")

    def items(self, key: str) -> list[Any]:
        """Read a list."""
        value = self._get(key, _ABSENT)
        if not isinstance(value, list):
            raise self.refuse(key, value, "give a list")
        return value

    def text(self, key: str, default: Any = _ABSENT, among: Sequence[str] | None = None) -> Any:
        """Read a string, of a closed set if `among` is given."""
        value = self._get(key, default)
        if value is default:
            return value
        if not isinstance(value, str) or (among and value not in among):
            raise self.refuse(key, value, f"use {_one_of(among)}" if among else "give a text")
        return value

    def integer(self, key: str, least: int | None = None, most: int | None = None, default: Any = _ABSENT) -> Any:
        """Read a whole number within bounds."""
        value = self._get(key, default)
        if value is default:
            return value
        if (
            not _is_number(value)
            or value != int(value)
            or (least is not None and value < least)
            or (most is not None and value > most)
        ):
            span = "" if least is None else f" from {least} on" if most is None else f" from {least} to {most}"
            raise self.refuse(key, value, f"give a whole number{span}")
        return int(value)

    def real(self, key: str, above: float | None = None, least: float | None = None, default: Any = _ABSENT) -> Any:
        """Read a finite number, greater than `above` by `SMALLEST` at least, and not below `least`."""
        value = self._get(key, default)
        if value is default:
            return value
        if (
            not _is_number(value)
            or (above is not None and value < above + SMALLEST)
            or (least is not None and value < least)
        ):
            bound = f" above {above:g}" if above is not None else f" from {least:g} on" if least is not None else ""
            raise self.refuse(key, value, f"give a finite number{bound}")
        return float(value)

    def pair(self, key: str, above: float | None = None) -> tuple[float, float]:
        """Read a list of two finite numbers."""
        values = self.items(key)
        if len(values) != 2:
            raise self.refuse(key, values, "give two numbers")
        one = Fields({"0": values[0], "1": values[1]}, f"{self.where}: {key}")
        return one.real("0", above), one.real("1", above)

    def flag(self, key: str, default: bool = False) -> bool:
        """Read true or false."""
        value = self._get(key, default)
        if not isinstance(value, bool):
            raise self.refuse(key, value, "use true or false")
        return value


def regular(path: Path) -> Path:
    """Give the path of what can be read to its end.

    Raises
    ------
    OSError
        If nothing is there, or a pipe or a device, which may keep a reader for ever.
    """
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise OSError(errno.EINVAL, "a pipe or a device, not a file", str(path))
    return path


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and -LARGEST <= value <= LARGEST


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _one_of(options: Sequence[str]) -> str:
    quoted = [f'"{o}"' for o in options]
    return quoted[0] if len(quoted) == 1 else ", ".join(quoted[:-1]) + " or " + quoted[-1]
