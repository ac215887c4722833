"""Tables of a TOML file that know the lines of their keys, and what is no key of theirs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import field
from difflib import get_close_matches
from typing import Any

from core.errors import InputError
from core.fields import LIKE, Fields, Read
from core.lazy import dataclass


@dataclass(frozen=True)
class Entries(Fields):
    """A table of a profile: it knows the lines of its keys, and refuses keys that nobody asked for."""

    lines: Mapping[str, int] = field(default_factory=dict)
    path: str = ""
    file: str = ""
    read: Read = field(default_factory=Read, compare=False, repr=False)

    def _get(self, key: str, default: Any) -> Any:
        try:
            return super()._get(key, default)
        except InputError:
            if near := get_close_matches(key, set(self.data) - self.read.asked, 1, LIKE):
                raise InputError(self.place(near[0]), "no such key", f"write {key}") from None
            raise

    def place(self, key: str) -> str:
        """Name file, line and entry of a key."""
        path = f"{self.path}.{key}" if self.path else key
        line = self.lines.get(path, self.lines.get(self.path) if self.path else None)
        return f"{self.file}: {path}" if line is None else f"{self.file}, line {line}: {path}"

    def refuse(self, key: str, value: object, remedy: str) -> InputError:
        """Make the error for a key's value."""
        return InputError(self.place(key), f"{value!r}", remedy)

    def texts(self, key: str) -> list[str]:
        """Read a string, or a list of them, or nothing."""
        value = self._get(key, [])
        texts = value if isinstance(value, list) else [value]
        if not all(isinstance(text, str) for text in texts):
            raise self.refuse(key, value, "give a text, or a list of them")
        return texts

    def table(self, key: str) -> Entries:
        """Read a table that may be missing."""
        return self._table(self._get(key, {}), key)

    def tables(self, key: str) -> list[Entries]:
        """Read a table, or a list of them."""
        value = self._get(key, [])
        if not isinstance(value, list):
            return [self._table(value, key)]
        return [self._table(item, f"{key}.{number}") for number, item in enumerate(value)]

    def _table(self, value: object, key: str) -> Entries:
        if not isinstance(value, Mapping):
            raise self.refuse(key, value, "write it as a table")
        path = f"{self.path}.{key}" if self.path else key
        return Entries(value, self.place(key), lines=self.lines, path=path, file=self.file)

    def finish(self, known: Iterable[str] = ()) -> None:
        """Refuse what nobody asked for, with the nearest key that exists."""
        allowed = self.read.asked | set(known)
        for key in self.data:
            if key not in allowed:
                near = get_close_matches(key, allowed, 1, LIKE)
                remedy = f"write {near[0]}" if near else f"use {', '.join(sorted(allowed))}"
                raise InputError(self.place(key), "no such key", remedy)


def key_lines(text: str) -> dict[str, int]:
    """Find the line of every table and key of a TOML file.

    Examples
    --------
    >>> key_lines("[a.b]\\nc = 1\\n[[d]]\\ne = 2")
    {'a.b': 1, 'a': 1, 'a.b.c': 2, 'd.0': 3, 'd': 3, 'd.0.e': 4}
    """
    lines: dict[str, int] = {}
    counts: dict[str, int] = {}
    table = ""
    for number, line in enumerate(text.splitlines(), 1):
        if m := re.match(r"\s*\[\[\s*([^]]+?)\s*\]\]", line):
            counts[m[1]] = counts.get(m[1], -1) + 1
            table = f"{m[1]}.{counts[m[1]]}"
            lines[table] = number
            lines.setdefault(m[1], number)
            lines.setdefault(m[1].partition(".")[0], number)
        elif m := re.match(r"\s*\[\s*([^]]+?)\s*\]", line):
            table = m[1]
            lines[table] = number
            lines.setdefault(table.partition(".")[0], number)
        elif m := re.match(r"\s*([\w.-]+)\s*=", line):
            lines[f"{table}.{m[1]}" if table else m[1]] = number
    return lines
