"""Command profiles as files: those in resources/profiles, and one's own."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path

from core.devices.line.entries import Entries, key_lines
from core.devices.line.packing import LineBits
from core.devices.line.profile import COMMANDS, MEANINGS, SHOWN, TOLD, Command, Port, Profile, Step
from core.devices.line.template import (
    CALCULATED,
    Template,
    Value,
    Words,
    make_template,
    no_room,
    reads_text,
    takes_anything,
)
from core.devices.line.wrapping import free_of, read_check, read_framings
from core.errors import InputError
from core.fields import text_of
from core.lazy import dataclass
from core.patterns import Pattern, parse_sequence, pattern_from_dict
from core.resources import resource

Lengths = Mapping[str, int | None]  # of fields without a width; None: all that is left
TABLES = ("port", "device", "lines", "timing", "framing", "words", "commands", "refusal", "stored")
_STEP = ("send", "expect", "answer_ms", "until", "every_ms", "within_ms", "pause_ms", "only")
_MOST = 1 << 16  # lines, slots
_FLOW = b"\x11\x13"  # XON, XOFF
_WORDS = {"axis": ("x", "y"), "profile": ("sine", "square"), "inverse": ("false", "true"), "on": ("false", "true")}
_NEEDED = {"select": "slot", "entry": "slot", "follow-entry": "slot", "image": "image"}  # without it all mean the same


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
            text = text_of(path)
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
    return _profile(Entries(data, where, lines=key_lines(text), file=where), Path(where).stem, columns, rows)


@dataclass(frozen=True)
class _Dialogue:
    """What holds for every command and answer of a device."""

    kind: str  # of framing
    lengths: Lengths
    words: Words
    pause_ms: float  # after a command
    prompted: bool  # the device answers by a prompt where nothing else is expected

    def template(self, table: Entries, key: str, fields: Iterable[str], text: str | None = None) -> Template:
        """Read a command or an answer, and see that it has no other than these fields."""
        text = table.text(key) if text is None else text
        if not text.strip() and not table.path.startswith("commands.start"):  # an empty line may wake a device
            raise table.refuse(key, text, "write it out, or leave the entry out")
        if text.endswith(("\r", "\n")):
            raise table.refuse(key, text, "leave its end to [framing], which ends every line")
        made = make_template(text, self.kind, self.lengths, table.place(key), self.words)
        for name in made.fields:
            if name not in fields and not (key == "expect" and name.startswith("_")):
                near = get_close_matches(name, list(fields), 1, 0.6)
                allowed = f"write {near[0]}, or use " if near else "use "
                raise InputError(table.place(key), f"field {name!r}", allowed + ", ".join(sorted(fields)))
        return made


def _profile(top: Entries, name: str, columns: int, rows: int) -> Profile:
    top.text("format", among=("stripe-projector-profile",))
    top.integer("version", 1, 1)
    top.finish(("title", *TABLES))
    device, lines, timing = top.table("device"), top.table("lines"), top.table("timing")
    if "framing" not in top.data:
        raise InputError(top.where, "no table [framing]", "say how commands are wrapped")
    frames, told, stored = top.table("framing"), top.table("refusal"), top.table("stored")
    own = device.integer("columns", 1, _MOST), device.integer("rows", 1, _MOST)
    slots, first_slot = device.integer("slots", 1, _MOST, default=1), device.integer("first_slot", 0, default=0)
    size = columns or own[0], rows or own[1]
    plates, axis = _plates(device)
    device.finish()
    bits, chunk = _line_bits(lines), lines.integer("chunk", 0, default=0)
    kind = frames.text("kind", among=("text", "frame"))
    lines.text("as", default=None, among=("hex",) if kind == "text" else ("bytes",))
    lengths = _lengths(size, bits.depth, plates, axis, chunk)
    pause_ms = timing.real("pause_ms", least=0.0, default=0.0)
    dialogue = _Dialogue(kind, lengths, _words(top.table("words"), plates), pause_ms, "prompt" in frames.data)
    commands = _commands(top.table("commands"), dialogue)
    refusals = tuple(dialogue.template(told, "expect", TOLD, text) for text in told.texts("expect"))
    if "expect" in told.data and not refusals:
        raise told.refuse("expect", [], "say how the device refuses, or leave the entry out")
    sending, answers = read_framings(frames, kind, commands, refusals)
    answer_ms = timing.real("answer_ms", above=0.0)
    profile = Profile(
        name=name,
        title=top.text("title", default=name),
        port=_port(top.table("port")),
        framing=sending,
        answers=answers,
        echo=frames.flag("echo"),
        columns=size[0],
        rows=size[1],
        slots=slots,
        first_slot=first_slot,
        plates=plates,
        axis=axis,
        bits=bits,
        chunk=chunk,
        lines_check=read_check(lines, "check", "crc16"),
        answer_s=answer_ms / 1000,
        load_s=timing.real("load_ms", above=0.0, default=answer_ms) / 1000,
        gap_s=timing.real("gap_ms", above=0.0, default=30.0) / 1000,
        settle_s=timing.real("settle_ms", least=0.0) / 1000,
        period_s=timing.real("period_ms", least=0.0, default=0.0) / 1000,
        retries=timing.integer("retries", 0, 20, default=3),
        commands=commands,
        refusals=refusals,
        codes=_codes(told.table("codes")),
        per_image=stored.integer("per_image", 1, default=1),
        two_swapped=stored.text("two_images", default="in order", among=("in order", "swapped")) == "swapped",
        stored=_stored(stored, size),
    )
    for table in (lines, timing, told, stored):
        table.finish()
    _check_whole(top, profile)
    return profile


def _plates(device: Entries) -> tuple[tuple[int | str, ...], str]:
    """Read the plates, and the axis of the only one."""
    plates = tuple(device.items("plates", ["C", "R"]))
    plain = all(isinstance(plate, str | int) and not isinstance(plate, bool) for plate in plates)
    if not plain or not 1 <= len(plates) <= 2 or len({*map(str, plates)}) != len(plates):
        raise device.refuse("plates", list(plates), "name the column plate and the row plate, or the only one")
    return plates, device.text("axis", default="x", among=("x", "y"))


def _line_bits(lines: Entries) -> LineBits:
    bits = lines.integer("bits", 1, 8, default=1)
    if bits not in (1, 8):
        raise lines.refuse("bits", bits, "use 1 (on or off) or 8 (a grey value in a byte)")
    first = lines.text("first", default="high", among=("high", "low"))
    return LineBits(first, bits, lines.integer("lit", 0, 1, default=1), lines.flag("backward"))


def _lengths(size: tuple[int, int], bits: int, plates: tuple[int | str, ...], axis: str, chunk: int) -> Lengths:
    """Give how many bytes the lines of a pattern are, by the field that carries them."""
    column, row = (-(-count * bits // 8) for count in size)
    lengths: dict[str, int | None] = {"column_lines": column, "row_lines": row}
    if chunk:
        lengths["lines"] = None if column % chunk or row % chunk else chunk
    elif len(plates) == 1:
        lengths["lines"] = column if axis == "x" else row
    elif size[0] == size[1]:
        lengths["lines"] = column
    return lengths


def _codes(codes: Entries) -> dict[int, str]:
    """Read what the numbers mean that a device refuses by."""
    meanings = {codes.integer(m, 0): m for m in MEANINGS if m in codes.data}
    codes.finish(MEANINGS)
    for code, meaning in meanings.items():
        if twice := [m for m in MEANINGS if codes.data.get(m) == code and m != meaning]:
            raise codes.refuse(twice[0], code, f"another number: {meaning} has it")
    return meanings


def _check_whole(top: Entries, profile: Profile) -> None:
    """See that patterns can be shown by what there is."""
    table, commands = top.table("commands"), profile.commands
    where, load = table.where, table.place("load")
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
            load, f"fields {sorted(sent)}", "use slot, plate and lines, or slot, column_lines and row_lines"
        )
    if profile.chunk and not {"lines", "offset"} <= sent:
        raise InputError(load, f"fields {sorted(sent)}", "send the {offset} of every chunk of {lines}")
    ends = {*profile.stored.values()} or {profile.first_slot, profile.first_slot + profile.slots - 1}
    sends = [(name, step.send) for name, steps in commands.items() for step in steps if step.send]
    values: list[dict[str, Value]] = [{"slot": slot} for slot in sorted(ends)]
    values += [{"plate": plate} for plate in profile.plates]
    for name, send in sends:
        if why := next((why for value in values if (why := no_room(send, value))), None):
            raise InputError(table.place(name), why, "give the field another format, or the device fewer slots")
    if profile.port.flow == "xonxoff" and profile.framing.kind == "frame":
        sides = ((profile.framing, [send for _, send in sends]), (profile.answers, _expected(profile)))
        if not all(free_of(_FLOW, framing, templates) for framing, templates in sides):
            remedy = "say in [framing] what escapes them, or use another flow"
            raise InputError(top.table("port").place("flow"), "frames may hold its bytes 11 and 13", remedy)
    if profile.bits.depth == 8 and sent and not profile.by_axis:
        raise InputError(load, "grey values on two plates", "send {axis} and {lines}, or name one plate")
    for name in {*commands} - {"start", "identify", "stop"}:
        if not profile.refusals and any(s.expect and not s.until and takes_anything(s.expect) for s in commands[name]):
            remedy = "write what the device says when it is done, or in [refusal] how it says no"
            raise InputError(f"{table.place(name)}.expect", "any answer counts as done", remedy)
    query = {f for step in commands.get("query", ()) if step.expect for f in step.expect.fields}
    needed = {"loaded"} if "load" in commands else set[str]()
    needed |= {"slot"} if "step" in commands else set()
    if "query" in commands and (missing := sorted(needed - query)):
        raise InputError(table.place("query"), f"the answer tells no {missing[0]}", f"expect {{{missing[0]}}} in it")


def _expected(profile: Profile) -> list[Template]:
    steps = [step.expect for steps in profile.commands.values() for step in steps if step.expect]
    return [*steps, *profile.refusals]


def _port(port: Entries) -> Port:
    made = Port(
        port.integer("baud", 1, default=9600),
        port.integer("bits", 5, 8, default=8),
        port.text("parity", default="none", among=("none", "even", "odd", "mark", "space")),
        port.real("stop", default=1.0),
        port.text("flow", default="none", among=("none", "rtscts", "xonxoff", "dsrdtr")),
        port.flag("dtr", True),
        port.flag("rts", True),
        port.real("open_ms", least=0.0, default=0.0) / 1000,
        port.real("byte_ms", least=0.0, default=0.0) / 1000,
    )
    if made.stop not in (1, 1.5, 2):
        raise port.refuse("stop", made.stop, "use 1, 1.5 or 2")
    port.finish()
    return made


def _words(table: Entries, plates: tuple[int | str, ...]) -> Words:
    words: dict[str, dict[str, Value]] = {}
    for name in table.data:
        of = table.table(name)
        values = {**_WORDS, "plate": tuple(map(str, plates))}.get(name)
        for key in of.data:
            if not (key.isdigit() if values is None else key in values or (name in ("inverse", "on") and key in "01")):
                raise InputError(of.place(key), "no such value", f"use {', '.join(values or ('numbers',))}")
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
        where = table.place("sequence")
        for slot, pattern in enumerate(parse_sequence(text, where).patterns(lines, where), first):
            stored.setdefault(pattern, slot)
    for entry in table.tables("patterns"):
        slot = entry.integer("slot", 0)
        stored[pattern_from_dict({k: v for k, v in entry.data.items() if k != "slot"}, entry.where)] = slot
    return stored


def _commands(table: Entries, dialogue: _Dialogue) -> dict[str, Command]:
    commands: dict[str, Command] = {}
    table.finish({*COMMANDS, "expect"})
    for name, sendable in COMMANDS.items():
        if name in table.data:
            fields = sendable | {"tag"}
            commands[name] = tuple(_step(entry, table, dialogue, fields) for entry in table.tables(name))
            sent = [step.send for step in commands[name] if step.send]
            if not commands[name]:
                raise table.refuse(name, [], "give its steps, or leave it out")
            needed = _NEEDED.get(name)
            if needed and not any(needed in template.fields for template in sent):
                raise InputError(table.place(name), "nothing says which pattern is meant", f"send {{{needed}}}")
    return commands


def _only(table: Entries, sendable: set[str]) -> Mapping[str, Value]:
    """Read what a device takes for granted of the patterns that a command describes."""
    table.read.asked.update(sendable)
    table.finish()
    return table.data


def _step(entry: Entries, every: Entries, dialogue: _Dialogue, sendable: set[str]) -> Step:
    entry.finish(_STEP)
    until: dict[str, tuple[Value, ...]] = {}
    if not (waits := entry.table("until")).data and "until" in entry.data:
        raise entry.refuse("until", {}, "say what to wait for, or leave the entry out")
    for key, value in waits.data.items():
        until[key] = tuple(value) if isinstance(value, list) else (value,)
        if not until[key] or any(not isinstance(each, int | str) for each in until[key]):
            raise waits.refuse(key, value, "give a number or text to wait for, or a list of them")
        if not CALCULATED.fullmatch(key):
            raise waits.refuse(key, key, "name what the answer tells, as in on or on&1")
    waited = {re.split(r"\W", key)[0] for key in until}
    expect, answered = None, entry if "expect" in entry.data else every
    if answered.text("expect", default=""):
        expect = dialogue.template(answered, "expect", sendable | TOLD | waited)
    asked = set(expect.fields) if expect else set()
    if missing := sorted(waited - asked):
        raise InputError(entry.place("until"), f"{missing[0]!r}", "wait for what the answer tells")
    for name in waited - dialogue.words.keys():
        assert expect is not None  # what is waited for is among its fields
        texts = {isinstance(value, str) for value in until.get(name, (0,))}
        if False in texts and reads_text(expect, name):  # what the device says, letter by letter
            raise InputError(entry.place("until"), f"{name!r} is read as text", f"write {{{name}:d}} for a number")
        if True in texts and not reads_text(expect, name):
            raise InputError(entry.place("until"), f"{name!r} is read as a number", "wait for one, without quotes")
    silent = "send" not in entry.data
    if silent and (expect is None or until):
        raise InputError(entry.place("send"), "missing", "say what is sent, or expect what comes unasked")
    answer_ms = entry.real("answer_ms", above=0.0, default=None)
    step = Step(
        None if silent else dialogue.template(entry, "send", sendable),
        expect,
        dialogue.prompted and "expect" not in answered.data,
        None if answer_ms is None else answer_ms / 1000,
        until,
        entry.real("every_ms", above=0.0, default=200.0) / 1000,
        entry.real("within_ms", above=0.0, default=10_000.0) / 1000,
        entry.real("pause_ms", least=0.0, default=dialogue.pause_ms) / 1000,
        _only(entry.table("only"), sendable),
    )
    return step
