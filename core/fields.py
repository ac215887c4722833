"""The checked reading of files, of objects of a JSON file and rows of a table: all is tested where it enters, once."""

from __future__ import annotations

import csv
import errno
import json
import math
import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from core.errors import InputError
from core.lazy import dataclass

_ABSENT: Any = object()

LARGEST = 1e12  # no length, angle or pixel of a rig comes near these; the squares of what lies between can be summed
SMALLEST = 1e-12
VERSIONS = (1, 2)  # of the interchange format
LIKE = 0.7  # of difflib's ratio: "angle" for "angle_deg" has 0.71
DOCUMENT_BYTES, TABLE_BYTES = 64 << 20, 512 << 20  # far beyond any project's; a table of 10 million observations


@dataclass(frozen=True)
class Read:
    """What was asked for of an object, and the objects in it that were read."""

    asked: set[str] = field(default_factory=set)
    parts: list[Fields] = field(default_factory=list)


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
    read: Read | None = field(default=None, compare=False, repr=False)  # of documents

    @staticmethod
    def of(value: object, where: str) -> Fields:
        """Take a JSON value that must be an object."""
        if not isinstance(value, dict | Mapping):  # the common kind first: it is by far quicker to tell
            raise InputError(where, f"found {_short(value)}", "give an object with named fields")
        return Fields(value, where)

    def tracked(self) -> Fields:
        """Give the same, noting what is asked for."""
        return replace(self, read=Read())

    def get(self, key: str) -> Any:
        """Give a field's value unchecked; None where it is missing."""
        if self.read is not None:
            self.read.asked.add(key)
        return self.data.get(key)

    def misspelt(self) -> Iterator[tuple[str, str, str]]:
        """Name fields of a document that nobody asked for beside a like one that is missing: where, it, that."""
        if self.read is None:
            return
        missing = sorted(self.read.asked - self.data.keys())
        for key in sorted(self.data.keys() - self.read.asked) if missing else ():
            from difflib import get_close_matches

            if like := get_close_matches(key, missing, 1, LIKE):
                yield self.where, key, like[0]
        for part in self.read.parts:
            yield from part.misspelt()

    def _part(self, value: object, where: str) -> Fields:
        part = Fields.of(value, where)
        if self.read is not None:
            self.read.parts.append(part := part.tracked())
        return part

    def _get(self, key: str, default: Any) -> Any:
        value = self.get(key)
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
        return self._part(self._get(key, _ABSENT), f"{self.where}: {key}")

    def optional(self, key: str) -> Fields | None:
        """Read a nested object; None where there is none."""
        return None if self.get(key) is None else self.nested(key)

    def objects(self, key: str, one: str, default: Any = _ABSENT) -> list[Fields]:
        """Read a list of objects; `one` is what messages call each, before its number."""
        return [self._part(item, f"{self.where}: {one} {i}") for i, item in enumerate(self.items(key, default))]

    def items(self, key: str, default: Any = _ABSENT) -> list[Any]:
        """Read a list."""
        value = self._get(key, default)
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
    """Give the path of what can be read to its end; OSError for none, or a pipe or device that may keep a reader."""
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):
        raise OSError(errno.EINVAL, "a pipe or a device, not a file", str(path))
    return path


def text_of(path: Path, most_bytes: int = DOCUMENT_BYTES) -> str:
    """Read a file of UTF-8 text, whose beginning may be marked.

    OSError for what cannot be read, a pipe, a device or more than `most_bytes`, before any of it is read;
    UnicodeDecodeError for other text.
    """
    if (size := regular(path).stat().st_size) > most_bytes:
        raise OSError(errno.EFBIG, f"{size} bytes, more than {most_bytes >> 20} MiB", str(path))
    return path.read_text(encoding="utf-8-sig")


def kept_object(path: Path) -> dict[str, Any]:
    """Read a JSON object that the program keeps for itself; an empty one where none is that can be read."""
    try:
        found = json.loads(text_of(path))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def read_document(path: Path, kind: str) -> Fields:
    """Read a JSON file of this format; InputError if it is missing, not JSON, has a field twice or another version."""

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(pairs)
        if len(found) < len(pairs):
            names = [name for name, _ in pairs]
            twice = next(name for name in names if names.count(name) > 1)
            raise InputError(path, f"field {twice!r} is there twice", "remove one of the two")
        return found

    try:
        data = json.loads(text_of(path), object_pairs_hook=once)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", f"give a folder that holds {path.name}") from error
    except UnicodeDecodeError as error:
        raise InputError(path, f"byte {error.start} is not UTF-8 text", "store the file as UTF-8") from error
    except (ValueError, RecursionError) as error:  # a number of thousands of digits is a ValueError too
        raise InputError(path, f"not JSON ({error})", "mend or restore the file") from error
    fields = Fields.of(data, str(path)).tracked()
    fields.text("format", among=(kind,))
    version = fields.integer("version")
    if version not in VERSIONS:
        known = " and ".join(map(str, VERSIONS))
        raise fields.refuse(
            "version", version, f"this program reads versions {known}: convert the file or update the program"
        )
    return fields


def read_table(
    path: Path, columns: Sequence[str], texts: Sequence[str] = (), optional: Sequence[str] = ()
) -> list[Fields]:
    """Read a CSV file with a header; `#` starts a comment; all columns are numbers but those named in `texts`.

    Those named in `optional` may be missing, or empty in a row. Numbers are as `Fields.real` would have them.
    InputError if a column is missing, a row is too short or too long, or the table is empty.
    """
    try:
        lines = text_of(path, TABLE_BYTES).splitlines()
    except (OSError, ValueError) as error:
        undecoded = isinstance(error, UnicodeDecodeError)
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text" if undecoded else "no file name"
        remedy = "store the file as UTF-8" if undecoded else "restore the file, or correct the name that points to it"
        raise InputError(path, f"cannot be read ({reason})", remedy) from error
    numbered = [(i, line.partition("#")[0]) for i, line in enumerate(lines, 1)]
    numbered = [(i, line) for i, line in numbered if line.strip()]
    if not numbered:
        raise InputError(path, "the table is empty", f"give a header {','.join(columns)} and a line for each")
    header = _cells(path, *numbered[0])
    if missing := [c for c in columns if c not in header]:
        raise InputError(
            path, f"the header is {','.join(header)!r}, without {missing[0]!r}", f"start with {','.join(columns)}"
        )
    if twice := [c for c in columns if header.count(c) > 1]:
        raise InputError(
            path, f"the header has {twice[0]!r} {header.count(twice[0])} times", "keep one of these columns"
        )
    if len(numbered) == 1:
        raise InputError(path, "the table has a header and no rows", "add the rows")
    table, place = [], f"{path}: line "
    for i, line in numbered[1:]:
        cells, where = _cells(path, i, line), f"{place}{i}"
        if any(cells[len(header) :]):
            seen, remedy = (
                f"{len(cells)} fields, and the header {len(header)}",
                "write decimals with a point, or name the columns",
            )
            raise InputError(where, seen, remedy)
        values: dict[str, Any] = dict(zip(header, cells, strict=False))
        for name in columns:
            cell = values.get(name, "")
            values[name] = cell or None if name in texts else _number(cell, name, where)
        for name in optional:
            values[name] = _number(values[name], name, where) if values.get(name) else None
        table.append(Fields(values, where))
    return table


def _cells(path: Path, number: int, line: str) -> list[str]:
    if '"' not in line and len(line) < 1000:  # nothing that only `csv` understands: a third of its time
        return [cell.strip() for cell in line.split(",")]
    try:
        return [cell.strip() for cell in next(csv.reader([line]))]
    except csv.Error as error:
        raise InputError(f"{path}: line {number}", f"{len(line)} characters ({error})", "mend that line") from error


def _number(cell: str, name: str, where: str) -> float:
    try:
        value = math.nan if "_" in cell else float(cell)  # Python's 1_000 is no number anywhere else
    except ValueError:
        value = math.nan
    if not -LARGEST <= value <= LARGEST:
        raise InputError(where, f"{name} is {cell if math.isfinite(value) else repr(cell)}", "give a finite number")
    return value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and -LARGEST <= value <= LARGEST


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _one_of(options: Sequence[str]) -> str:
    quoted = [f'"{o}"' for o in options]
    return quoted[0] if len(quoted) == 1 else ", ".join(quoted[:-1]) + " or " + quoted[-1]
