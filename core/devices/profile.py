"""Command profiles: how a given projector is spoken to, as a data file in resources/profiles."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from core.devices.framing import PARTS, Framing
from core.devices.sums import CHECKS, CheckSum
from core.devices.template import Template, Value, Words, make_template
from core.errors import InputError
from core.fields import Fields
from core.patterns import Pattern, parse_sequence, pattern_from_dict
from core.patterns.kinds import KINDS
from core.resources import resource

SHOWN = ("axis", "bit", "bits", "cell", "inverse", "period", "steps", "step", "shift_deg", "profile", "index", "width")
COMMANDS: dict[str, set[str]] = {  # and the fields that can be sent with each, beside the tag
    "start": set(),
    "identify": set(),
    "lamp": {"on"},
    "load": {"slot", "plate", "axis", "lines", "column_lines", "row_lines", "check"},
    "select": {"slot"},
    "rewind": set(),
    "step": set(),
    **{f"show-{kind}": {*SHOWN, "level"} for kind in KINDS},
    "table": {"count", "shown", "images", "period_us"},
    "image": {"place", "image"},
    "entry": {"place", "slot", "swap"},
    "follow-entry": {"place", "slot", "swap"},
    "ready": set(),
    "run": {"count", "period_us"},
    "follow": {"count"},
    "query": set(),
    "stop": set(),
}
TOLD = {"columns", "rows", "slots", "slot", "loaded", "on", "code", "text", "tag"}  # what answers may tell beside these
MEANINGS = ("busy", "damaged", "empty", "range", "unknown")
LENGTHS = {
    "none": (0, "big"),
    "u8": (1, "big"),
    "u16": (2, "big"),
    "u16le": (2, "little"),
    "u32": (4, "big"),
    "u32le": (4, "little"),
}


@dataclass(frozen=True)
class Port:
    """How bytes travel."""

    baud: int
    bits: int
    parity: str
    stop: float
    flow: str


@dataclass(frozen=True)
class Step:
    """What is sent and what the device answers; None: it answers nothing.

    With `until` it is asked again, every `every_s` and for `within_s` at most, until the answer's values are among
    those. After it nothing is sent for `pause_s`.
    """

    send: Template
    expect: Template | None
    answer_s: float | None  # None: the profile's
    until: Mapping[str, tuple[Value, ...]]
    every_s: float
    within_s: float
    pause_s: float


Command = tuple[Step, ...]


@dataclass(frozen=True)
class Profile:
    """How a projector is spoken to.

    `framing` is that of what is sent, `answers` that of what comes back.
    """

    name: str
    title: str
    port: Port
    framing: Framing
    answers: Framing
    echo: bool
    columns: int
    rows: int
    slots: int
    first_slot: int
    plates: tuple[str, ...]
    axis: str
    first: str
    level_bits: int
    lines_check: str
    answer_s: float
    load_s: float
    gap_s: float
    settle_s: float
    period_s: float
    retries: int
    commands: Mapping[str, Command]
    refusal: Template | None
    codes: Mapping[int, str] = field(default_factory=dict)  # code to its meaning
    stored: Mapping[Pattern, int] = field(default_factory=dict)  # what stands in the device beforehand, and its slot
    per_image: int = 1  # of these slots
    two_swapped: bool = False  # two images are listed in reverse order

    @property
    def both_plates(self) -> bool:
        """Whether one load command carries the lines of both plates."""
        return "column_lines" in self.loaded_fields

    @property
    def by_axis(self) -> bool:
        """Whether a pattern is loaded as lines along its own axis."""
        return "axis" in self.loaded_fields or len(self.plates) == 1

    @property
    def loaded_fields(self) -> set[str]:
        """Fields that are sent to store a pattern."""
        return {f for step in self.commands.get("load", ()) for f in step.send.fields}

    @property
    def listed(self) -> bool:
        """Whether a sequence of stored patterns is a table of its own, written before it goes."""
        return "entry" in self.commands or "follow-entry" in self.commands

    def goes(self, command: str) -> bool:
        """Whether a loaded sequence goes by this command, "run" or "follow"."""
        table = "entry" if command == "run" else "follow-entry"
        return command in self.commands and not {"load", table}.isdisjoint(self.commands)

    @property
    def shows(self) -> bool:
        """Whether patterns can be shown by these commands, or the device only switched."""
        return any(name in self.commands for name in ("select", "step", *(f"show-{kind}" for kind in KINDS)))


@dataclass(frozen=True)
class Entries(Fields):
    """A table of a profile: it knows the lines of its keys, and refuses keys that nobody asked for."""

    lines: Mapping[str, int] = field(default_factory=dict)
    path: str = ""
    file: str = ""
    asked: set[str] = field(default_factory=set)

    def _get(self, key: str, default: Any) -> Any:
        self.asked.add(key)
        try:
            return super()._get(key, default)
        except InputError:
            if near := get_close_matches(key, set(self.data) - self.asked, 1, 0.7):
                raise InputError(self.place(near[0]), "no such key", f"write {key}") from None
            raise

    def place(self, key: str) -> str:
        """Name file, line and entry of a key."""
        path = f"{self.path}.{key}" if self.path else key
        line = self.lines.get(path)
        return f"{self.file}: {path}" if line is None else f"{self.file}, line {line}: {path}"

    def refuse(self, key: str, value: object, remedy: str) -> InputError:
        """Make the error for a key's value."""
        return InputError(self.place(key), f"{value!r}", remedy)

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
        return Entries(value, f"{self.file}: {path}", self.lines, path, self.file)

    def finish(self, known: Iterable[str] = ()) -> None:
        """Refuse what nobody asked for, with the nearest key that exists."""
        allowed = self.asked | set(known)
        for key in self.data:
            if key not in allowed:
                near = get_close_matches(key, allowed, 1, 0.7)
                remedy = f"write {near[0]}" if near else f"use {', '.join(sorted(allowed))}"
                raise InputError(self.place(key), "no such key", remedy)


def profile_names() -> list[str]:
    """Names of the profiles that come with the program."""
    return sorted(p.name.removesuffix(".toml") for p in resource("profiles").iterdir() if p.name.endswith(".toml"))


def read_profile(name: str, columns: int = 0, rows: int = 0) -> Profile:
    """Read a profile by its name, or a file of one's own by its path; for other numbers of lines if these are given.

    Raises
    ------
    InputError
        Naming the file, the line, the entry and what is allowed.
    """
    if name.endswith(".toml"):
        path, where = Path(name), name
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
            raise InputError(path, f"cannot be read ({reason})", "give the path of a command profile") from error
    else:
        if name not in profile_names():
            raise InputError("profile", f"{name!r}", f"use {', '.join(profile_names())}, or the path of a .toml file")
        where = f"{name}.toml"
        text = resource("profiles", where).read_text(encoding="utf-8")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(where, f"not TOML ({error})", "mend the file") from error
    return _profile(Entries(data, where, key_lines(text), "", where), Path(where).stem, columns, rows)


def key_lines(text: str) -> dict[str, int]:
    """Find the line of every table and key of a TOML file.

    Examples
    --------
    >>> key_lines("[a.b]\\nc = 1\\n[[d]]\\ne = 2")
    {'a.b': 1, 'a.b.c': 2, 'd.0': 3, 'd.0.e': 4}
    """
    lines: dict[str, int] = {}
    counts: dict[str, int] = {}
    table = ""
    for number, line in enumerate(text.splitlines(), 1):
        if m := re.match(r"\s*\[\[\s*([^]]+?)\s*\]\]", line):
            counts[m[1]] = counts.get(m[1], -1) + 1
            table = f"{m[1]}.{counts[m[1]]}"
            lines[table] = number
        elif m := re.match(r"\s*\[\s*([^]]+?)\s*\]", line):
            table = m[1]
            lines[table] = number
        elif m := re.match(r"\s*([\w.-]+)\s*=", line):
            lines[f"{table}.{m[1]}" if table else m[1]] = number
    return lines


def _profile(top: Entries, name: str, columns: int, rows: int) -> Profile:
    top.text("format", among=("stripe-projector-profile",))
    top.integer("version", 1, 1)
    device, lines, timing = top.table("device"), top.table("lines"), top.table("timing")
    if "framing" not in top.data:
        raise InputError(top.where, "no table [framing]", "say how commands are wrapped")
    own = device.integer("columns", 1), device.integer("rows", 1)
    columns, rows = columns or own[0], rows or own[1]
    frames = top.table("framing")
    kind = frames.text("kind", among=("text", "frame"))
    plates = tuple(device.items("plates")) if "plates" in device.data else ("C", "R")
    axis = device.text("axis", default="x", among=("x", "y"))
    if not 1 <= len(plates) <= 2 or len(set(plates)) != len(plates):
        raise device.refuse("plates", list(plates), "name the column plate and the row plate, or the only one")
    bits = lines.integer("bits", 1, 8, default=1)
    if bits not in (1, 8):
        raise lines.refuse("bits", bits, "use 1 (on or off) or 8 (a grey value in a byte)")
    sizes = {axis_: -(-count * bits // 8) for axis_, count in (("column", columns), ("row", rows))}
    lengths = {"column_lines": sizes["column"], "row_lines": sizes["row"]}
    if len(plates) == 1:
        lengths["lines"] = sizes["column" if axis == "x" else "row"]
    elif columns == rows:
        lengths["lines"] = sizes["column"]
    words = _words(top.table("words"))
    answer_s = timing.real("answer_ms", above=0.0) / 1000
    load_s = timing.real("load_ms", above=0.0, default=1000 * answer_s) / 1000
    commands = _commands(top.table("commands"), kind, lengths, words)
    told = top.table("refusal")
    refusal = _template(told, "expect", kind, lengths, words, TOLD) if "expect" in told.data else None
    codes = told.table("codes")
    meanings = {codes.integer(m, 0): m for m in MEANINGS if m in codes.data}
    codes.finish(MEANINGS)
    lines.text("as", default=None, among=("hex",) if kind == "text" else ("bytes",))
    sending, answers = _framings(frames, kind, commands, refusal)
    stored = top.table("stored")
    per_image = stored.integer("per_image", 1, default=1)
    two_swapped = stored.text("two_images", default="in order", among=("in order", "swapped")) == "swapped"
    profile = Profile(
        name,
        top.text("title", default=name),
        _port(top.table("port")),
        sending,
        answers,
        frames.flag("echo"),
        columns,
        rows,
        device.integer("slots", 1, default=1),
        device.integer("first_slot", 0, default=0),
        tuple(map(str, plates)),
        axis,
        lines.text("first", default="high", among=("high", "low")),
        bits,
        lines.text("check", default="crc16", among=tuple(CHECKS)),
        answer_s,
        load_s,
        timing.real("gap_ms", above=0.0, default=30.0) / 1000,
        timing.real("settle_ms", least=0.0) / 1000,
        timing.real("period_ms", least=0.0, default=0.0) / 1000,
        timing.integer("retries", 0, 20, default=3),
        commands,
        refusal,
        meanings,
        _stored(stored, (columns, rows)),
        per_image,
        two_swapped,
    )
    for table in (top, device, lines, timing, frames, told):
        table.finish()
    _check_whole(top, profile)
    return profile


def _check_whole(top: Entries, profile: Profile) -> None:
    """See that patterns can be shown by what there is."""
    where, commands = f"{top.where}: commands", profile.commands
    selects = "select" in commands or {"rewind", "step"} <= commands.keys()
    if "load" in commands and not selects:
        raise InputError(where, "neither select nor rewind with step", "say how a stored pattern is shown")
    if selects and "load" not in commands and not profile.stored:
        raise InputError(
            where, "no command 'load'", "say how a pattern is stored, or in [stored] what is there already"
        )
    sent = profile.loaded_fields
    plain = {"slot", "lines"} <= sent and (profile.by_axis or "plate" in sent)
    if sent and not (plain or {"slot", "column_lines", "row_lines"} <= sent):
        raise InputError(
            f"{where}.load",
            f"fields {sorted(sent)}",
            "use slot, plate and lines, or slot, column_lines and row_lines",
        )
    if profile.level_bits == 8 and sent and not profile.by_axis:
        raise InputError(f"{where}.load", "grey values on two plates", "send {axis} and {lines}, or name one plate")
    query = {f for step in commands.get("query", ()) if step.expect for f in step.expect.fields}
    if query and not {"slot", "loaded"} <= query:
        raise InputError(f"{where}.query", "no slot or loaded in the answer", "the state must tell both")


def _port(port: Entries) -> Port:
    made = Port(
        port.integer("baud", 1, default=9600),
        port.integer("bits", 5, 8, default=8),
        port.text("parity", default="none", among=("none", "even", "odd", "mark", "space")),
        port.real("stop", default=1.0),
        port.text("flow", default="none", among=("none", "rtscts", "xonxoff", "dsrdtr")),
    )
    port.finish()
    return made


def _words(table: Entries) -> Words:
    words: dict[str, dict[str, Value]] = {}
    for name in table.data:
        of = table.table(name)
        words[name] = {{"false": "0", "true": "1"}.get(key, key): word for key, word in of.data.items()}
        if strange := [w for w in words[name].values() if isinstance(w, bool) or not isinstance(w, int | str)]:
            raise of.refuse(next(k for k, w in of.data.items() if w is strange[0]), strange[0], "give a number or text")
    table.finish({*SHOWN, "level", "slot", "plate", "on"})
    return words


def _stored(table: Entries, lines: tuple[int, int]) -> dict[Pattern, int]:
    """Read which patterns stand in the device beforehand, and where."""
    stored: dict[Pattern, int] = {}
    first = table.integer("first_slot", 0, default=0)
    if (text := table.text("sequence", default=None)) is not None:
        for slot, pattern in enumerate(parse_sequence(text).patterns(lines, table.place("sequence")), first):
            stored.setdefault(pattern, slot)
    for entry in table.tables("patterns"):
        slot = entry.integer("slot", 0)
        stored[pattern_from_dict({k: v for k, v in entry.data.items() if k != "slot"}, entry.where)] = slot
    table.finish()
    return stored


def _template(
    table: Entries, key: str, kind: str, lengths: Mapping[str, int], words: Words, fields: Iterable[str]
) -> Template:
    made = make_template(table.text(key), kind, lengths, table.place(key), words)
    for name in made.fields:
        if name not in fields and not (key == "expect" and name.startswith("_")):
            near = get_close_matches(name, list(fields), 1, 0.6)
            allowed = f"write {near[0]}, or use " if near else "use "
            raise InputError(table.place(key), f"field {name!r}", allowed + ", ".join(sorted(fields)))
    return made


def _commands(table: Entries, kind: str, lengths: Mapping[str, int], words: Words) -> dict[str, Command]:
    commands: dict[str, Command] = {}
    for name, sendable in COMMANDS.items():
        if name not in table.data:
            continue
        steps = table.tables(name)
        commands[name] = tuple(_step(entry, kind, lengths, words, sendable | {"tag"}) for entry in steps)
    table.finish(COMMANDS)
    return commands


def _step(entry: Entries, kind: str, lengths: Mapping[str, int], words: Words, sendable: set[str]) -> Step:
    until: dict[str, tuple[Value, ...]] = {}
    for key, value in entry.table("until").data.items():
        until[key] = tuple(value) if isinstance(value, list) else (value,)
    waited = {re.split(r"\W", key)[0] for key in until}
    expect = None
    if entry.data.get("expect"):
        expect = _template(entry, "expect", kind, lengths, words, sendable | TOLD | waited)
    asked = set(expect.fields) if expect else set()
    entry.asked.add("expect")
    if missing := sorted(waited - asked):
        raise InputError(entry.place("until"), f"{missing[0]!r}", "wait for what the answer tells")
    answer_ms = entry.real("answer_ms", above=0.0, default=None)
    step = Step(
        _template(entry, "send", kind, lengths, words, sendable),
        expect,
        None if answer_ms is None else answer_ms / 1000,
        until,
        entry.real("every_ms", above=0.0, default=200.0) / 1000,
        entry.real("within_ms", above=0.0, default=10_000.0) / 1000,
        entry.real("pause_ms", least=0.0, default=0.0) / 1000,
    )
    entry.finish()
    return step


def _framings(
    table: Entries, kind: str, commands: Mapping[str, Command], refusal: Template | None
) -> tuple[Framing, Framing]:
    """Read how what is sent and what comes back is wrapped."""
    sent = [step.send for steps in commands.values() for step in steps]
    back = [step.expect for steps in commands.values() for step in steps if step.expect] + [refusal] * bool(refusal)
    return _framing(table, kind, "", sent), _framing(table, kind, "answer_", [t for t in back if t])


def _framing(table: Entries, kind: str, side: str, templates: list[Template]) -> Framing:
    """Read one direction: entries of the answers stand in for those of both where they are given."""

    def key(name: str) -> str:
        table.asked.update((name, f"answer_{name}"))
        return side + name if side + name in table.data else name

    check = _check(table, key("check"))
    order = "little" if table.text(key("check_order"), default="high", among=("high", "low")) == "low" else "big"
    prompt = table.text("prompt", default="").encode("ascii") if side or kind == "frame" else b""
    table.asked.add("prompt")
    if kind == "text":
        ending = table.text(key("ending"), default="\r\n")
        if not ending:
            raise table.refuse(key("ending"), ending, "give the characters that end a line")
        start = table.text(key("start"), default="").encode("ascii")
        over = _parts(table, key("check_over"), ("body",), ("start", "body", "mark"))
        mark = table.text("check_mark", default="").encode("ascii")
        return Framing(
            "text",
            ("start", "body", "mark", "check", "end"),
            start,
            ending.encode("ascii"),
            mark,
            check=check,
            check_over=over,
            check_text=True,
            prompt=prompt,
        )
    start, end = _bytes(table, key("start")), _bytes(table, key("end"))
    length, byte_order = LENGTHS[table.text(key("length"), default="none", among=tuple(LENGTHS))]
    heads = {t.sizes[0] for t in templates} or {0}
    if len(heads) != 1 or None in heads:
        raise InputError(table.where, "heads of several lengths", "put the bar | behind as many bytes everywhere")
    given = [
        p for p, there in zip(PARTS, (start, heads != {0}, length, True, False, check.bits, end), strict=True) if there
    ]
    parts = _parts(table, key("layout"), tuple(given), tuple(given))
    if set(parts) != set(given):
        raise table.refuse(key("layout"), " ".join(parts), f"name each of {', '.join(given)} once")
    sizes = {t.sizes[1] for t in templates}
    if not length and not end and (None in sizes or (not check.bits and len(sizes) > 1)):
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
        _parts(table, key("length_over"), ("body",), PARTS),
        table.integer(key("length_add"), default=0),
        check,
        _parts(table, key("check_over"), tuple(p for p in ("head", "body") if p in parts), PARTS),
        order,  # type: ignore[arg-type]
        table.text("check_as", default="bytes", among=("bytes", "hex")) == "hex",
        table.integer(key("pad"), 0, default=0),
        () if length or end else tuple(templates),
    )


def _parts(table: Entries, key: str, default: tuple[str, ...], among: tuple[str, ...]) -> tuple[str, ...]:
    parts = tuple(table.text(key, default=" ".join(default)).split())
    if strange := [p for p in parts if p not in among]:
        raise table.refuse(key, strange[0], f"name parts among {', '.join(among)}")
    return parts


def _bytes(table: Entries, key: str) -> bytes:
    try:
        return bytes.fromhex(table.text(key, default=""))
    except ValueError as error:
        raise table.refuse(key, table.data[key], "write bytes as two hexadecimal digits") from error


def _check(table: Entries, key: str) -> CheckSum:
    """Read a check value: by its name, or a CRC by its parameters."""
    if not isinstance(table.data.get(key), Mapping):
        return CHECKS[table.text(key, default="none", among=tuple(CHECKS))]
    crc = table.table(key)
    bits = crc.integer("bits", 8, 32)
    if bits % 8:
        raise crc.refuse("bits", bits, "use 8, 16, 24 or 32")
    most = (1 << bits) - 1
    poly, init, xor = (crc.integer(k, 0, most, default=0) for k in ("poly", "init", "xor"))
    made = CheckSum("crc", bits, poly, init, crc.flag("reflect"), xor)
    crc.finish()
    return made
