"""How a profile wraps what is sent and what comes back: its table [framing]."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping

from core.devices.line.entries import Entries
from core.devices.line.framing import CHECKS, KINDS, PARTS, CheckSum, Framing, agree
from core.devices.line.profile import Command
from core.devices.line.template import Template, raw
from core.errors import InputError

FRAME_PARTS = tuple(p for p in PARTS if p != "mark")
_OF_BOTH = {"text": ("kind", "echo", "prompt", "check_mark"), "frame": ("kind", "echo")}
_OF_EACH = {
    "text": ("start", "ending", "check", "check_over"),
    "frame": (
        *("start", "end", "length", "length_over", "length_add", "check", "check_over", "check_order"),
        *("check_as", "escapes", "layout", "pad"),
    ),
}  # and the same of answers
LENGTHS = {
    "none": (0, "big"),
    "u8": (1, "big"),
    "u16": (2, "big"),
    "u16le": (2, "little"),
    "u32": (4, "big"),
    "u32le": (4, "little"),
}


def read_framings(
    table: Entries, kind: str, commands: Mapping[str, Command], refusals: tuple[Template, ...]
) -> tuple[Framing, Framing]:
    """Read how what is sent and what comes back is wrapped."""
    table.finish((*_OF_BOTH[kind], *_OF_EACH[kind], *(f"answer_{key}" for key in _OF_EACH[kind])))
    sent = [step.send for steps in commands.values() for step in steps if step.send]
    back = [step.expect for steps in commands.values() for step in steps if step.expect]
    return _framing(table, kind, "", sent), _framing(table, kind, "answer_", [*back, *refusals])


def _framing(table: Entries, kind: str, side: str, templates: list[Template]) -> Framing:
    """Read one direction: entries of the answers stand in for those of both where they are given."""

    def key(name: str) -> str:
        return side + name if side + name in table.data else name

    if kind == "text":
        return _lines(table, key, _ascii(table, "prompt") if side else b"")
    check = read_check(table, key("check"))
    order = "little" if table.text(key("check_order"), default="high", among=("high", "low")) == "low" else "big"
    start, end = _bytes(table, key("start")), _bytes(table, key("end"))
    length, byte_order = LENGTHS[table.text(key("length"), default="none", among=tuple(LENGTHS))]
    heads = {t.sizes[0] for t in templates} or {0}
    if len(heads) != 1 or None in heads:
        raise InputError(table.where, "heads of several lengths", "put the bar | behind as many bytes everywhere")
    given = [
        p for p, there in zip(PARTS, (start, heads != {0}, length, True, False, check.bits, end), strict=True) if there
    ]
    layout = _parts(table, key("layout"), tuple(given), FRAME_PARTS)
    parts = tuple(p for p in layout if p in given)  # the others are empty
    if sorted(parts) != sorted(given):
        raise table.refuse(key("layout"), " ".join(layout), f"name each of {', '.join(given)} once")
    sizes = {t.sizes[1] for t in templates}
    if not length and not end and (None in sizes or (not check.bits and not _told_apart(templates))):
        remedy = "give a length, an end or a check value, and a fixed length to every field"
        raise InputError(table.where, "frames whose end cannot be told", remedy)
    return Framing(
        "frame",
        parts,
        start,
        end,
        b"",
        next(iter(heads)) or 0,
        length,
        byte_order,  # type: ignore[arg-type]
        _parts(table, key("length_over"), ("body",), FRAME_PARTS),
        table.integer(key("length_add"), default=0),
        check,
        _parts(table, key("check_over"), tuple(p for p in ("head", "body") if p in parts), FRAME_PARTS),
        order,  # type: ignore[arg-type]
        table.text("check_as", default="bytes", among=("bytes", "hex")) == "hex",
        table.integer(key("pad"), 0, default=0),
        _escapes(table, key("escapes"), start, end),
        () if length or end else tuple(templates),
    )


def _lines(table: Entries, key: Callable[[str], str], prompt: bytes) -> Framing:
    """Read how lines of text are wrapped; `key` gives the name of an entry in this direction."""
    ending = _ascii(table, key("ending"), "\r\n")
    if not ending:
        raise table.refuse(key("ending"), "", "give the characters that end a line")
    return Framing(
        "text",
        ("start", "body", "mark", "check", "end"),
        _ascii(table, key("start")),
        ending,
        _ascii(table, "check_mark"),
        check=read_check(table, key("check")),
        check_over=_parts(table, key("check_over"), ("body",), ("start", "body", "mark")),
        check_text=True,
        prompt=prompt,
    )


def free_of(bytes_: bytes, framing: Framing, templates: Iterable[Template]) -> bool:
    """Tell whether no frame of these holds any of some bytes: they are escaped, or all is written in other ones."""
    if all(bytes([byte]) in framing.escapes for byte in bytes_):
        return True
    if (
        framing.length
        or (framing.check.bits and not framing.check_text)
        or set(bytes_) & {*framing.start, *framing.end}
    ):
        return False
    return not any(raw(template) or set(bytes_) & set(template.fixed) for template in templates)


def _parts(table: Entries, key: str, default: tuple[str, ...], among: tuple[str, ...]) -> tuple[str, ...]:
    parts = tuple(table.text(key, default=" ".join(default)).split())
    if strange := [p for p in parts if p not in among]:
        raise table.refuse(key, strange[0], f"name parts among {', '.join(among)}")
    return parts


def _told_apart(templates: list[Template]) -> bool:
    """Whether no body of one form can be the beginning of another's."""
    forms = {t.fixed for t in templates}
    return not any(len(a) < len(b) and agree(a, b) for a in forms for b in forms)


def _escapes(table: Entries, key: str, start: bytes, end: bytes) -> dict[bytes, bytes]:
    """Read what is sent in place of which bytes; "hex": two digits in place of each."""
    if table.data.get(key) == "hex":
        if not end:
            raise table.refuse(key, "hex", "say which bytes end a frame")
        return {bytes([byte]): b"%02X" % byte for byte in range(256)}
    given = table.table(key)
    try:
        escapes = {bytes.fromhex(byte): bytes.fromhex(given.text(byte)) for byte in given.data}
    except ValueError as error:
        raise table.refuse(key, dict(given.data), 'write bytes as two hexadecimal digits: { FF = "80 7F" }') from error
    if escapes and not end:
        raise table.refuse(key, dict(given.data), "say which bytes end a frame")
    if unescaped := [b for b in (start[:1], end[:1]) if escapes and b and b not in escapes]:
        raise table.refuse(key, dict(given.data), f"say what is sent in place of {unescaped[0].hex().upper()}")
    return escapes


def _ascii(table: Entries, key: str, default: str = "") -> bytes:
    text: str = table.text(key, default=default)
    if not text.isascii():
        raise table.refuse(key, text, "use ASCII characters")
    return text.encode("ascii")


def _bytes(table: Entries, key: str) -> bytes:
    try:
        return bytes.fromhex(re.sub("'([ -&(-~]*)'", lambda m: m[1].encode().hex(), table.text(key, default="")))
    except ValueError as error:
        raise table.refuse(key, table.data[key], "write bytes as two hexadecimal digits, or 'text'") from error


def read_check(table: Entries, key: str, default: str = "none") -> CheckSum:
    """Read a check value: by its name, or by its parameters."""
    if not isinstance(table.data.get(key), Mapping):
        return CHECKS[table.text(key, default=default, among=tuple(CHECKS))]
    crc = table.table(key)
    kind, bits = crc.text("kind", default="crc", among=KINDS), crc.integer("bits", 1, 32)
    if kind == "crc" and bits % 8:
        raise crc.refuse("bits", bits, "use 8, 16, 24 or 32 for a CRC")
    most = (1 << bits) - 1
    poly, init, xor = (crc.integer(k, 0, most, default=0) for k in ("poly", "init", "xor"))
    made = CheckSum(kind, bits, poly, init, crc.flag("reflect"), xor)
    crc.finish()
    return made
