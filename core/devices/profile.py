"""Command profiles: how a given projector is spoken to, as a data file in resources/profiles."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from core.devices.template import CHECKS, Template, make_template
from core.errors import InputError
from core.fields import Fields
from core.resources import resource

COMMANDS: dict[str, set[str]] = {  # and the fields that can be sent with each, beside the tag
    "identify": set(),
    "lamp": {"on"},
    "load": {"slot", "plate", "lines", "column_lines", "row_lines", "check"},
    "select": {"slot"},
    "rewind": set(),
    "step": set(),
    "query": set(),
}
MEANINGS = ("busy", "damaged", "empty", "range", "unknown")


@dataclass(frozen=True)
class Port:
    """How bytes travel."""

    baud: int
    bits: int
    parity: str
    stop: float
    flow: str


@dataclass(frozen=True)
class Framing:
    """How a body is wrapped: a line with an ending, or a frame of start, length, body and check value."""

    kind: str
    ending: bytes = b""
    start: bytes = b""
    length: int = 0
    check: str = ""


@dataclass(frozen=True)
class Command:
    """What is sent and what the device answers."""

    send: Template
    expect: Template


@dataclass(frozen=True)
class Profile:
    """How a projector is spoken to."""

    name: str
    title: str
    port: Port
    framing: Framing
    columns: int
    rows: int
    slots: int
    plates: tuple[str, str]
    first: str
    lines_check: str
    answer_s: float
    load_s: float
    gap_s: float
    settle_s: float
    retries: int
    commands: Mapping[str, Command]
    refusal: Template
    codes: Mapping[int, str] = field(default_factory=dict)  # code to its meaning

    @property
    def both_plates(self) -> bool:
        """Whether one load command carries the lines of both plates."""
        return "column_lines" in self.commands["load"].send.fields


def profile_names() -> list[str]:
    """Names of the profiles that come with the program."""
    return sorted(p.name.removesuffix(".toml") for p in resource("profiles").iterdir() if p.name.endswith(".toml"))


def read_profile(name: str, columns: int = 0, rows: int = 0) -> Profile:
    """Read a profile by its name, or a file of one's own by its path; for other numbers of lines if these are given.

    Raises
    ------
    InputError
        Naming the file, the entry and what is allowed.
    """
    if name.endswith(".toml"):
        path, where = Path(name), name
        try:
            text = path.read_text(encoding="utf-8")
        except OSError as error:
            raise InputError(
                path, f"cannot be read ({error.strerror})", "give the path of a command profile"
            ) from error
    else:
        if name not in profile_names():
            raise InputError("profile", f"{name!r}", f"use {', '.join(profile_names())}, or the path of a .toml file")
        where = f"{name}.toml"
        text = resource("profiles", where).read_text(encoding="utf-8")
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(where, f"not TOML ({error})", "mend the file") from error
    return _profile(Fields(data, where), Path(where).stem, columns, rows)


def _profile(top: Fields, name: str, columns: int, rows: int) -> Profile:
    top.text("format", among=("stripe-projector-profile",))
    top.integer("version", 1, 1)
    device, lines, timing = top.nested("device"), top.nested("lines"), top.nested("timing")
    columns, rows = columns or device.integer("columns", 1), rows or device.integer("rows", 1)
    framing = _framing(top.nested("framing"))
    lengths = {"column_lines": -(-columns // 8), "row_lines": -(-rows // 8)}
    plates = device.items("plates") if "plates" in device.data else ["C", "R"]
    if len(plates) != 2 or plates[0] == plates[1]:
        raise device.refuse("plates", plates, "name the column plate and the row plate")
    commands = _commands(top.nested("commands"), framing.kind, lengths)
    refusal = top.nested("refusal")
    codes = {refusal.nested("codes").integer(m, 0): m for m in MEANINGS if m in refusal.nested("codes").data}
    lines.text("as", among=("hex",) if framing.kind == "text" else ("bytes",))
    return Profile(
        name,
        top.text("title", default=name),
        _port(top.nested("port")),
        framing,
        columns,
        rows,
        device.integer("slots", 1),
        (str(plates[0]), str(plates[1])),
        lines.text("first", among=("high", "low")),
        lines.text("check", default="crc16", among=tuple(CHECKS)),
        timing.real("answer_ms", above=0.0) / 1000,
        timing.real("load_ms", above=0.0) / 1000,
        timing.real("gap_ms", above=0.0) / 1000,
        timing.real("settle_ms", least=0.0) / 1000,
        timing.integer("retries", 0, 20),
        commands,
        make_template(refusal.text("expect"), framing.kind, lengths, f"{refusal.where}: expect"),
        codes,
    )


def _port(port: Fields) -> Port:
    return Port(
        port.integer("baud", 1),
        port.integer("bits", 5, 8, default=8),
        port.text("parity", default="none", among=("none", "even", "odd", "mark", "space")),
        port.real("stop", default=1.0),
        port.text("flow", default="none", among=("none", "rtscts", "xonxoff", "dsrdtr")),
    )


def _framing(framing: Fields) -> Framing:
    if framing.text("kind", among=("text", "frame")) == "text":
        ending = framing.text("ending", default="\r\n")
        if not ending:
            raise framing.refuse("ending", ending, "give the characters that end a line")
        return Framing("text", ending.encode("ascii"))
    try:
        start = bytes.fromhex(framing.text("start"))
    except ValueError as error:
        raise framing.refuse("start", framing.data["start"], "write bytes as two hexadecimal digits") from error
    if not start:
        raise framing.refuse("start", "", "give at least one byte that starts a frame")
    length = {"u8": 1, "u16": 2}[framing.text("length", among=("u8", "u16"))]
    return Framing("frame", b"", start, length, framing.text("check", among=tuple(CHECKS)))


def _commands(table: Fields, kind: str, lengths: Mapping[str, int]) -> dict[str, Command]:
    commands = {}
    for name, sendable in COMMANDS.items():
        if name not in table.data:
            continue
        entry = table.nested(name)
        pair = [make_template(entry.text(key), kind, lengths, f"{entry.where}: {key}") for key in ("send", "expect")]
        commands[name] = Command(pair[0], pair[1])
        if strange := [f for f in pair[0].fields if f not in sendable | {"tag"}]:
            allowed = ", ".join(sorted(sendable | {"tag"}))
            raise InputError(f"{entry.where}: send", f"field {strange[0]!r}", f"use {allowed}")
    if "load" not in commands:
        raise InputError(table.where, "no command 'load'", "say how a pattern is stored in the device")
    if "select" not in commands and not {"rewind", "step"} <= commands.keys():
        raise InputError(table.where, "neither select nor rewind with step", "say how a stored pattern is shown")
    sent = set(commands["load"].send.fields)
    if not ({"slot", "plate", "lines"} <= sent or {"slot", "column_lines", "row_lines"} <= sent):
        raise InputError(
            f"{table.where}: load",
            f"fields {sorted(sent)}",
            "use slot, plate and lines, or slot, column_lines and row_lines",
        )
    if "query" in commands and not {"slot", "loaded"} <= set(commands["query"].expect.fields):
        raise InputError(f"{table.where}: query", "no slot or loaded in the answer", "the state must tell both")
    return commands
