"""Commands and answers as templates, filled in and recognised: text lines, or bytes.

A text template is the line itself with fields in braces: ``{tag} LOAD {slot:03d} {plate} {lines}``. A byte template is
a list of bytes in hexadecimal, of texts in quotes, and of fields with their width: ``{tag:u8} 10 'P' {slot:u16le}``; a
field without a width is a run of bytes whose length the device's number of lines gives. A field may be calculated from
its value, step by step from the left: ``{slot%24*4:u8}``. A bar separates the head of a frame from its body.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import field, replace
from itertools import chain
from typing import Any, Literal

from core.errors import InputError
from core.lazy import dataclass

Value = int | float | str | bytes
Values = Mapping[str, Value]
Words = Mapping[str, Mapping[str, Value]]  # of a field: what stands for each of its values
_STEPS = r"((?:[-+*&]\d+|[/%]0*[1-9]\d*)*)"
CALCULATED = re.compile(rf"(\w+){_STEPS}")  # a field and steps of calculation
_FIELD = re.compile(rf"\{{{CALCULATED.pattern}(?::([\w.]+))?\}}")
_NUMBER = re.compile(r"\d{0,3}(?:\.\d)?[dxXfg]")
_WIDTH = re.compile(r"u(8|16|24|32)(le)?")
_TOKEN = re.compile(r"'[^']*'|\||[^\s|]+")
_DEFAULTS = {"check": "04X", "lines": "hex", "column_lines": "hex", "row_lines": "hex"}  # formats in text
_TEXTS = ("plate", "axis", "kind", "profile")
_OPERATIONS = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a // b,
    "%": lambda a, b: a % b,
    "&": lambda a, b: a & b,
}


@dataclass(frozen=True)
class Field:
    """A field: its name, the steps of its calculation, its format, and the words for its values."""

    name: str
    steps: str
    form: str
    words: Mapping[str, Value]

    @property
    def binary(self) -> tuple[int, Literal["big", "little"]] | None:
        """How many bytes a number takes, and their order; None where it is written in digits."""
        found = _WIDTH.fullmatch(self.form)
        return (int(found[1]) // 8, "little" if found[2] else "big") if found else None

    @property
    def free(self) -> bool:
        """Whether it takes whatever the device says."""
        return not self.form and (self.name == "text" or self.name.startswith("_"))

    def written(self, values: Values) -> str | bytes:
        """Write the value: bytes as they are, numbers in bytes or in digits; ValueError where it has no room."""
        value = calculated(self.name + self.steps, values)
        value = self.words.get(str(int(value) if isinstance(value, bool) else value), value)
        try:
            if isinstance(value, bytes):
                return value
            if self.binary:
                return round(float(value)).to_bytes(*self.binary)
            text = _as_text(value, self.form)
            if len(text) <= _digits(self.form):
                return text
        except (ValueError, OverflowError):
            pass
        raise ValueError(f"{{{self.name}{self.steps}{':' * bool(self.form)}{self.form}}} has no room for {value!r}")

    def told(self, value: Value) -> tuple[str, Value]:
        """Give name and value of what was read; a calculation that cannot be undone stays in the name."""
        for key, word in self.words.items():
            if word == value:
                return self.name, int(key) if key.isdigit() else key
        if re.fullmatch(r"(?:[-+]\d+)*", self.steps) and isinstance(value, int):
            return self.name, value - sum(int(n) for n in re.findall(r"[-+]\d+", self.steps))
        return self.name + self.steps, value


def calculated(expression: str, values: Values) -> Any:
    """Calculate a field from its value: ``slot%24*4``, step by step from the left.

    Examples
    --------
    >>> calculated("slot%24*4", {"slot": 27})
    12
    """
    name, *steps = re.split(r"(?=[-+*/%&])", expression)
    value: Any = values[name]
    for step in steps:
        value = _OPERATIONS[step[0]](value, int(step[1:]))
    return value


@dataclass(frozen=True)
class Template:
    """A command or an answer with fields, of either kind."""

    text: str  #: as the profile has it
    words: Words = field(default_factory=dict)  #: what stands for values of the fields

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields, in their order."""
        return tuple(f.name for f in self.read_fields())

    @property
    def sizes(self) -> tuple[int | None, int | None]:
        """Bytes of the head and of the body; None where the length is not fixed."""
        return 0, None

    @property
    def fixed(self) -> tuple[int | None, ...]:
        """The bytes that are always the same, None for others; nothing for text."""
        return ()

    def read_fields(self) -> list[Field]:
        """Read the fields from the text."""
        return [self._field(m) for m in _FIELD.finditer(self.text)]

    def _field(self, m: re.Match[str]) -> Field:
        """Make a field of what `_FIELD` found."""
        return Field(m[1], m[2], m[3] or "", self.words.get(m[1], {}))

    def fill(self, values: Values) -> bytes:
        """Write the values in; ValueError names one for which its field has no room."""
        raise NotImplementedError

    def match(self, body: bytes) -> dict[str, Value] | None:
        """Read the values from a body; None if it is of another form."""
        raise NotImplementedError


@dataclass(frozen=True)
class TextTemplate(Template):
    """A line of text.

    Examples
    --------
    >>> template = TextTemplate("{tag} OK SHOW {slot:03d}")
    >>> template.fill({"tag": 7, "slot": 3})
    b'7 OK SHOW 003'
    >>> template.match(b"8 OK SHOW 012")
    {'tag': 8, 'slot': 12}
    """

    def _field(self, m: re.Match[str]) -> Field:
        form = m[3] or _DEFAULTS.get(m[1]) or ("s" if m[1] in _TEXTS or self.words.get(m[1]) else "")
        return replace(super()._field(m), form=form)

    def fill(self, values: Values) -> bytes:
        """Write the values in; bytes are written in hexadecimal."""

        def written(m: re.Match[str]) -> str:
            value = self._field(m).written(values)
            return value.hex().upper() if isinstance(value, bytes) else value

        return _FIELD.sub(written, self.text).encode("ascii")

    def match(self, body: bytes) -> dict[str, Value] | None:
        parts, end, fields = [], 0, []
        for m in _FIELD.finditer(self.text):
            parts.append(re.escape(self.text[end : m.start()]))
            fields.append(self._field(m))
            parts.append(f"({_pattern(fields[-1])})")
            end = m.end()
        parts.append(re.escape(self.text[end:]))
        found = re.fullmatch("".join(parts), body.decode("ascii", "replace"))
        return None if found is None else dict(f.told(_read(g, f)) for f, g in zip(fields, found.groups(), strict=True))


@dataclass(frozen=True)
class ByteTemplate(Template):
    """Bytes.

    Examples
    --------
    >>> template = ByteTemplate("{tag:u8} A1 {slot:u16}", {})
    >>> template.fill({"tag": 7, "slot": 259}).hex(" ")
    '07 a1 01 03'
    >>> template.match(bytes([7, 0xA1, 1, 3]))
    {'tag': 7, 'slot': 259}
    """

    #: bytes of fields without a width; None: all that is left
    lengths: Mapping[str, int | None] = field(default_factory=dict)

    @property
    def sizes(self) -> tuple[int | None, int | None]:
        head, body = _head_and_body(self.text)
        return self._size(head), self._size(body)

    @property
    def fixed(self) -> tuple[int | None, ...]:
        tokens = self._tokens()
        return tuple(b for t in tokens for b in (t if isinstance(t, bytes) else [None] * (self._width(t) or 0)))

    def _size(self, written: list[str]) -> int | None:
        sizes = [len(t) if isinstance(t, bytes) else self._width(t) for t in self._tokens(written)]
        return None if None in sizes else sum(s for s in sizes if s is not None)

    def _tokens(self, written: list[str] | None = None) -> list[bytes | Field]:
        tokens: list[bytes | Field] = []
        for token in chain(*_head_and_body(self.text)) if written is None else written:
            m = _FIELD.fullmatch(token)
            if m is not None:
                tokens.append(self._field(m))
            else:
                tokens.append(token[1:-1].encode("ascii") if token[0] == "'" else bytes.fromhex(token))
        return tokens

    def _width(self, f: Field) -> int | None:
        """Bytes of a field; None: all that is left."""
        if f.binary:
            return f.binary[0]
        if f.form:
            return _digits(f.form, 1)
        return self.lengths.get(f.name)

    def fill(self, values: Values) -> bytes:
        parts = [token if isinstance(token, bytes) else token.written(values) for token in self._tokens()]
        return b"".join(part.encode("ascii") if isinstance(part, str) else part for part in parts)

    def match(self, body: bytes) -> dict[str, Value] | None:
        values: dict[str, Value] = {}
        at = 0
        for token in self._tokens():
            width = len(token) if isinstance(token, bytes) else self._width(token)
            if width is None:
                width = len(body) - at
            part, at = body[at : at + width], at + width
            if len(part) < width or (isinstance(token, bytes) and part != token):
                return None
            if isinstance(token, bytes):
                continue
            value: Value = part
            if token.binary:
                value = int.from_bytes(part, token.binary[1])
            elif token.form:
                text = part.decode("ascii", "replace")
                if not re.fullmatch(_pattern(token), text):
                    return None
                value = _read(text, token)
            name, value = token.told(value)
            values[name] = value
        return values if at == len(body) else None


def make_template(
    text: str, kind: str, lengths: Mapping[str, int | None], where: str, words: Words | None = None
) -> Template:
    """Make the template of a kind of framing.

    InputError for braces or bytes that cannot be read, a field that is written twice or whose format is not known.
    """
    if "{" in _FIELD.sub("", text) or "}" in _FIELD.sub("", text):
        raise InputError(where, f"{text!r}", "write fields as {name}, {name:03d} or {name:u8}")
    found = list(_FIELD.finditer(text))
    names = [m[1] + m[2] for m in found]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(where, f"field {{{twice[0]}}} twice in {text!r}", "write every field once")
    for m in found:
        form = m[3] or ""
        if form and not _NUMBER.fullmatch(form) and form not in ("s", "hex") and not _WIDTH.fullmatch(form):
            raise InputError(
                where, f"format {form!r} of {m[0]}", "use d, x or X with a width as in 03d, or u8 to u32le"
            )
        if _WIDTH.fullmatch(form) and kind == "text":
            raise InputError(where, f"format {form!r} of {m[0]}", "give numbers of text a format as 03d or 02X")
    if kind == "text":
        if not text.isascii():
            raise InputError(where, f"{text!r}", "use ASCII characters")
        return TextTemplate(text, words or {})
    for token in chain(*_head_and_body(text)):
        one = _FIELD.fullmatch(token)
        if one is None and not re.fullmatch(r"[0-9A-Fa-f]{2}|'[ -&(-~]*'", token):
            raise InputError(
                where, f"byte {token!r}", "write bytes as two hexadecimal digits, separated by spaces, or 'text'"
            )
        if one is not None and not one[3] and one[1] not in (*lengths, "text"):
            raise InputError(where, f"field {token!r}", f"give its width, as in {{{one[1]}:u8}}")
    return ByteTemplate(text, words or {}, lengths)


def _head_and_body(text: str) -> tuple[list[str], list[str]]:
    """Give the bytes, texts and fields before the bar, and those behind it; without a bar all are behind it."""
    tokens = _TOKEN.findall(text)
    bar = tokens.index("|") if "|" in tokens else -1
    return tokens[: max(bar, 0)], tokens[bar + 1 :]


def _digits(form: str, default: int = 1000) -> int:
    """Give how many characters a format of text has room for."""
    found = re.match(r"\d+", form)
    return int(found[0]) if found else default


def no_room(template: Template, values: Values) -> str | None:
    """Say for which of some values a template has no room; None where it has, and for fields without a value."""
    try:
        for f in template.read_fields():
            if f.name in values:
                f.written(values)
    except ValueError as error:
        return str(error)
    return None


def reads_text(template: Template, name: str) -> bool:
    """Tell whether a field is read as text, and not as a number."""
    return any(f.form == "s" or f.free for f in template.read_fields() if f.name == name)


def raw(template: Template) -> bool:
    """Tell whether a template of bytes has a field whose bytes may be any."""
    return any(f.binary or not f.form for f in template.read_fields() if f.name != "text")


def room_of(template: Template, name: str) -> int | None:
    """Give the largest number for which a template has room in a field, None without a width.

    Examples
    --------
    >>> room_of(TextTemplate("{tag:02d} SHOW {slot}"), "tag")
    99
    """
    for f in template.read_fields():
        if (f.name, f.steps) != (name, ""):
            continue
        if f.binary:
            return int(256 ** f.binary[0]) - 1
        if digits := re.fullmatch(r"(\d+)([dxX])", f.form):
            return int((10 if digits[2] == "d" else 16) ** int(digits[1])) - 1
    return None


def takes_anything(template: Template) -> bool:
    """Tell whether whatever a device says is the answer, its refusals too."""
    return template.match(b"?!?") is not None


def _pattern(f: Field) -> str:
    """Give the regular expression of a field in text."""
    if f.words:
        return "|".join(re.escape(_as_text(w, f.form)) for w in f.words.values())
    if f.free:
        return ".*?"
    if f.form == "s":
        return r"\S+"
    if f.form == "hex" or f.form[-1:] in ("x", "X"):
        width = int(f.form[:-1]) if f.form[:-1].isdigit() else 0
        return "[0-9A-Fa-f]" + (f"{{{width},}}" if width else "+")
    return r"-?[0-9]+(?:\.[0-9]+)?" if f.form[-1:] in ("f", "g") else r" *-?[0-9]+"


def _read(text: str, f: Field) -> Value:
    if f.words:
        return next(w for w in f.words.values() if _as_text(w, f.form) == text)
    if f.free or f.form == "s":
        return text
    if f.form == "hex":
        return bytes.fromhex(text) if len(text) % 2 == 0 else b""
    if f.form[-1:] in ("x", "X"):
        return int(text, 16)
    return float(text) if f.form[-1:] in ("f", "g") else int(text)


def _as_text(value: Value, form: str) -> str:
    if isinstance(value, bytes):
        return value.hex().upper()
    if form and form not in ("s", "hex"):
        return format(round(float(value)) if form[-1] in "dxX" else float(value), form)
    return f"{value:g}" if isinstance(value, float) else str(int(value) if isinstance(value, bool) else value)
