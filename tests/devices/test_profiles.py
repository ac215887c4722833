"""Profiles against devices that were written from their manuals, over a pseudo-terminal."""

import binascii
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from core.cli import main
from core.devices import offer_screens, open_projector
from core.devices.line import link
from core.devices.line.dialogue import Dialogue
from core.devices.line.emulator import Emulator
from core.devices.line.framing import CHECKS, CheckSum, unwrap, wrap
from core.devices.line.profiles import profile_names, read_profile
from core.devices.line.server import EmulatedLine
from core.devices.scene import FlatScene
from core.devices.virtual import Stage
from core.errors import DeviceError, InputError
from core.patterns import Black, Code, Level, Line, Phase, White, parse_sequence
from core.resources import resource
from tests.devices.manuals import Device, Dlpc350, Dlpc350OverI2c, Modbus, Optoma, Prompting, modbus_crc, plugged
from tests.devices.tables import DEVICES

PROMPTING = """
format = "stripe-projector-profile"
version = 1
[device]
columns = 16
rows = 1
slots = 9
first_slot = 1
plates = ["X"]
[framing]
kind = "text"
start = "$"
ending = "\\r"
answer_ending = "\\r\\n"
check = "sum8"
check_mark = "*"
prompt = "> "
echo = true
[timing]
answer_ms = 500
settle_ms = 1
[commands.load]
send = "L{slot:03d} {plate} {lines}"
expect = "A{slot:03d}"
[commands.select]
send = "S{slot:03d}"
expect = "A{slot:03d}"
"""


@pytest.mark.parametrize(
    ("name", "value"),  # of the catalogue of parametrised CRC algorithms, for "123456789"; the sums by hand
    [
        ("crc8", 0xF4),
        ("crc8-maxim", 0xA1),
        ("crc16", 0x29B1),
        ("crc16-xmodem", 0x31C3),
        ("crc16-kermit", 0x2189),
        ("crc16-arc", 0xBB3D),
        ("crc16-modbus", 0x4B37),
        ("crc32", 0xCBF43926),
        ("sum8", 0xDD),
        ("sum16", 0x01DD),
        ("lrc", 0x23),
        ("or8", 0x3F),
        ("xor8", 0x31),
        ("none", 0),
    ],
)
def test_check_values_are_those_of_the_catalogue(name: str, value: int) -> None:
    assert CHECKS[name].of(b"123456789") == value


def test_a_crc_by_its_parameters_is_the_one_of_binascii() -> None:
    data = bytes(range(200))
    assert CheckSum("crc", 16, 0x1021, 0xFFFF).of(data) == binascii.crc_hqx(data, 0xFFFF)
    assert CheckSum("crc", 32, 0x04C11DB7, 0xFFFFFFFF, True, 0xFFFFFFFF).of(data) == binascii.crc32(data)
    assert CheckSum("crc", 16, 0x1021, 0xFFFF, True, 0xFFFF).of(b"123456789") == 0x906E  # X.25 in the catalogue


@pytest.mark.parametrize(("kind", "value"), [("sum", 0x5E), ("lrc", 0x22), ("xor", 0x60), ("or", 0x7F)])  # by hand
def test_a_sum_of_seven_bits_takes_one_byte_without_its_highest_bit(kind: str, value: int) -> None:
    check = CheckSum(kind, 7)
    assert (check.width, check.of(bytes([0xF0, 0x3D, 0x0F, 0xA2]))) == (1, value)


def test_modbus_ascii_is_written_as_in_its_examples(own) -> None:
    text = FRAMED.format("start = \"':'\"\nend = '0D 0A'\nescapes = 'hex'\ncheck = 'lrc'")
    framing = read_profile(own(text)).framing
    body = bytes.fromhex("11 03 00 6B 00 03")  # read three registers from 108 of device 17; its LRC is 7E
    assert wrap(framing, body) == b":1103006B00037E\r\n"
    assert unwrap(framing, bytearray(b"?:1103006B00037E\r\n")) == body
    assert unwrap(framing, bytearray(b":1103006B00047E\r\n")) is None


def test_escapes_as_hex_need_an_end(own) -> None:
    with pytest.raises(InputError, match=r"line \d+: framing.escapes: 'hex'; say which bytes end a frame"):
        read_profile(own(FRAMED.format("start = '3A'\nlength = 'u8'\nescapes = 'hex'")))


@pytest.mark.parametrize(("told", "missing"), [("{loaded}", ""), ("{slot}", "loaded"), ("ready", "loaded")])
def test_a_query_tells_what_is_needed(own, told: str, missing: str) -> None:
    text = own(f'{PROMPTING}[commands.query]\nsend = "Q"\nexpect = "N{told}"\n')
    if not missing:
        assert "query" in read_profile(text).commands
        return
    with pytest.raises(InputError, match=rf"line 28: commands.query: the answer tells no {missing}"):
        read_profile(text)


def test_a_query_of_stored_patterns_needs_neither(own) -> None:
    text = resource("profiles", "modbus.toml").read_text()
    query = '[commands.query]\nsend = "01"\nexpect = "01 {on:u8}"\n'
    assert "[commands.query]" not in text
    assert "query" in read_profile(own(text + query)).commands


@pytest.mark.parametrize("plates", ['[1, "1"]', "[true, 2]", "[1.5, 2]", "[1, 1]"])
def test_plates_are_two_texts_or_numbers(own, plates: str) -> None:
    with pytest.raises(InputError, match=r"line 9: device.plates"):
        read_profile(own(PROMPTING.replace('["X"]', plates)))


def test_plates_may_be_numbers(own) -> None:
    text = resource("profiles", "stripe-lines.toml").read_text().replace('"even"', '"none"')
    assert 'plates = ["C", "R"]' in text
    text = text.replace('plates = ["C", "R"]', "plates = [16, 17]").replace("{plate}", "{plate:03d}")
    line = EmulatedLine(Emulator(read_profile(own(text)), Stage(FlatScene(projector_size=(640, 640)))))
    try:
        projector = open_projector(f"serial:{line.url}?profile={own(text)}")
        projector.load([Line("x", 8, 16), Line("y", 8, 16)])
        projector.step(1)
        projector.close()
    finally:
        line.close()


def test_an_optoma_is_switched_on_and_waited_for_before_the_first_picture(own) -> None:
    device, shown = Optoma(), []
    surface = SimpleNamespace(size=(64, 48), present=lambda image: shown.append(len(device.commands)), close=list)
    offer_screens(lambda number: surface)
    text = resource("profiles", "optoma.toml").read_text().replace("every_ms = 1000", "every_ms = 1")
    try:
        with plugged(device) as port:
            projector = open_projector(f"screen:1?control={port}&profile={own(text.replace('= 100', '= 5'))}")
            projector.show(White())
            projector.close()
    finally:
        offer_screens(None)
    assert device.commands == ["~0000 1", "~00124 1", "~00124 1", "~00124 1", "~0002 0", "~0004 0"]
    assert shown == [6]


def test_a_profile_that_only_switches_says_how_it_is_used() -> None:
    with pytest.raises(InputError, match="screen:1\\?control="):
        open_projector("serial:/dev/null?profile=optoma")


def test_modbus_shows_every_stored_pattern_and_switches_the_lamp_off(own) -> None:
    text = resource("profiles", "modbus.toml").read_text().replace("500", "1")
    text = text.replace('parity = "even"', "")  # a pseudo-terminal has none
    device = Modbus(patterns=28)
    patterns = parse_sequence("paper").patterns((640, 640))
    with plugged(device) as port:
        projector = open_projector(f"serial:{port}?profile={own(text)}&settle_ms=0")
        assert device.lamp
        assert projector.sequence == patterns
        for number, pattern in enumerate(patterns, 1):
            projector.show(pattern)
            assert (device.shown, device.busy) == (number, 0)
        assert "not among" in projector.refusal(Line("x", 3))
        projector.close()
    assert not device.lamp


def test_modbus_recovers_from_damaged_answers_and_counts_them(own) -> None:
    text = resource("profiles", "modbus.toml").read_text().replace("500", "1").replace("300", "40")
    device, count = Modbus(patterns=28, warming=0), [0]

    def spoil(data: bytes) -> bytes:
        count[0] += 1
        return bytes([data[0], data[1] ^ 4, *data[2:]]) if count[0] % 5 == 4 else data

    device.spoil = spoil
    with plugged(device) as port:
        projector = open_projector(f"serial:{port}?profile={own(text.replace('even', 'none'))}&settle_ms=0")
        for number in (3, 9, 28):
            projector.show(projector.sequence[number - 1])
            assert device.shown == number
        repeats, asked = projector.repeats
        projector.close()
    assert repeats == sum(1 for n in range(1, asked + 1) if n % 5 == 4)


def test_a_modbus_exception_is_a_refusal_with_its_meaning(own) -> None:
    text = resource("profiles", "modbus.toml").read_text().replace("500", "1").replace('parity = "even"', "")
    with plugged(Modbus(patterns=5)) as port:
        projector = open_projector(f"serial:{port}?profile={own(text.replace('retries = 3', 'retries = 0'))}")
        with pytest.raises(DeviceError, match=r"refused \(range\)"):
            projector.show(projector.sequence[7])
        projector.close()


LIGHTCRAFTERS: dict[str, tuple[str, Callable[[], Dlpc350]]] = {
    "reports": ("lightcrafter4500", Dlpc350),
    "numbered reports": ("lightcrafter4500", lambda: Dlpc350(numbered=True)),
    "I2C": ("lightcrafter4500-i2c", Dlpc350OverI2c),
}


@pytest.fixture(params=LIGHTCRAFTERS)
def lightcrafter(request: pytest.FixtureRequest, own, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple]:
    """A projector with the device at the other end of its line."""
    name, make = LIGHTCRAFTERS[request.param]
    text = resource("profiles", f"{name}.toml").read_text().replace("pause_ms = 100", "")
    device = make()
    with plugged(device) as port:
        if device.numbered:  # what Linux calls hidraw takes the report's number before each report
            monkeypatch.setattr(link, "is_hid", lambda place: place == port)
        projector = open_projector(f"serial:{port}?profile={own(text)}&settle_ms=0")
        yield projector, device
        projector.close()
    assert device.running == 0


def test_a_dlpc350_shows_the_bit_plane_that_holds_a_pattern(lightcrafter: tuple) -> None:
    projector, device = lightcrafter
    for slot in (0, 5, 23, 24, 27):
        projector.show(projector.sequence[slot])
        assert device.shown == [(slot // 24, slot % 24)]


def test_a_dlpc350_runs_a_stored_sequence_with_a_pulse_for_each_pattern(lightcrafter: tuple) -> None:
    projector, device = lightcrafter
    chosen = [22, 23, 24, 25, 3]  # of image 0, of image 1, and back
    for slots in (range(28), chosen, chosen[:4], chosen):
        projector.load([projector.sequence[slot] for slot in slots])
        for _ in range(2):
            projector.run()
            assert device.shown == [(slot // 24, slot % 24) for slot in slots]
            np.testing.assert_array_equal(np.diff(device.pulses), 8333)  # 120 patterns a second
    exposure = int.from_bytes(device.state[0x1A29][:4], "little")
    assert exposure == 8333 - 230
    projector.show(projector.sequence[7])
    assert device.shown == [(0, 7)]


def test_a_dlpc350_follows_triggers_of_a_camera(lightcrafter: tuple) -> None:
    projector, device = lightcrafter
    projector.load(projector.sequence)
    projector.follow(1 / 125)
    assert device.shown == []
    assert struct.unpack("<II", device.state[0x1A29]) == (8000 - 230, 8000)  # over before the next trigger
    count = len(projector.sequence)
    for pulse in range(count):
        device.trigger(9000 * pulse)
        assert device.shown[-1] == (pulse // 24, pulse % 24)
    device.trigger(9000 * count)  # once through, then no more
    assert len(device.shown) == count


def test_a_dlpc350_that_finds_a_table_wrong_is_told(own) -> None:
    text = resource("profiles", "lightcrafter4500.toml").read_text().replace("pause_ms = 100", "")
    with plugged(Dlpc350()) as port:
        path = own(text.replace("within_ms = 3000", "within_ms = 50"))
        projector = open_projector(f"serial:{port}?profile={path}&period_ms=0.4")  # 170 us of exposure: too little
        projector.load(projector.sequence[:3])
        with pytest.raises(DeviceError, match=r"_status&131 is 1 after 0.05 s"):
            projector.run()
        projector.close()


def test_a_controller_with_prompt_echo_and_checksum_shows_one_plate(own) -> None:
    device = Prompting()
    with plugged(device) as port:
        projector = open_projector(f"serial:{port}?profile={own(PROMPTING)}")
        projector.load([White(), Line("x", 4, 4), Black()])
        projector.step(1)
        assert "along x only" in projector.refusal(Line("y", 2))
        projector.close()
    assert device.slots == {1: b"\xff\xff", 2: b"\x0f\x00", 3: b"\0\0"}
    assert device.shown == 2


DESCRIBED = """
format = "stripe-projector-profile"
version = 1
[device]
columns = 64
rows = 64
[words.axis]
x = "V"
y = "H"
[words.inverse]
false = 0
true = 1
[framing]
kind = "text"
ending = "\\n"
[timing]
answer_ms = 500
settle_ms = 1
[commands.show-gray]
send = "GRAY {axis} {bit+1:02X}/{bits} {inverse}"
expect = "OK"
only = { cell = 1 }
[commands.show-phase]
send = "SINE {axis} {period:.2f} {shift_deg:05.1f}"
expect = "OK"
[commands.show-level]
send = "FULL {level:02X}"
expect = "OK"
"""


class Describing(Device):
    """Says OK to every line."""

    def take(self, buffer: bytearray):
        while (end := buffer.find(b"\n")) >= 0:
            del buffer[: end + 1]
            yield b"OK\n"


def test_patterns_are_described_by_their_parameters(own) -> None:
    device = Describing()
    with plugged(device) as port:
        projector = open_projector(f"serial:{port}?profile={own(DESCRIBED)}")
        for pattern in (Code("gray", "y", 9, 12, 1, True), Phase("x", 12.5, 4, 1, np.pi / 2), Level(0.5)):
            projector.show(pattern)
        assert "show-white" in projector.refusal(White())
        assert "does not send cell, which is 2" in projector.refusal(Code("gray", "x", 0, 4, 2))
        assert projector.refusal(Code("gray", "x", 0, 5, 2)) is None  # the whole width in 32 cells
        assert "profile, which is square" in projector.refusal(Phase("x", 4.0, 4, 0, 0.0, "square"))
        projector.close()
    assert device.heard == b"GRAY H 0A/12 1\nSINE V 12.50 090.0\nFULL 80\n"


def test_grey_lines_are_loaded_a_byte_each(own) -> None:
    text = PROMPTING.replace("[timing]", "[lines]\nbits = 8\n[timing]")
    device = Prompting()
    with plugged(device) as port:
        projector = open_projector(f"serial:{port}?profile={own(text)}")
        projector.show(Phase("x", 16.0, 4, 0, 0.0))
        projector.close()
    light = 0.5 + 0.5 * np.cos(2 * np.pi * (np.arange(16) + 0.5) / 16)
    assert list(device.slots[1]) == np.rint(255 * light).astype(int).tolist()


MODBUS_WIRE = (b"S\2\1" + modbus_crc(b"S\2\1")).hex(" ").upper()
FRAMED = PROMPTING[: PROMPTING.index("[framing]")] + "[framing]\nkind = 'frame'\n{}\n"
FRAMED += "[timing]\nanswer_ms = 100\nsettle_ms = 1\n[commands.load]\nsend = \"4C {{slot:u16le}} 'P' {{lines}}\"\n"
FRAMED += "expect = '4C {{slot:u16le}}'\n[commands.select]\nsend = '53 {{slot:u16le}}'\nexpect = '53 {{slot:u16le}}'\n"


@pytest.mark.parametrize(
    ("entries", "wire"),  # of "select slot 258", written by hand
    [
        ("start = '02'\nlength = 'u8'\ncheck = 'sum8'", "02 03 53 02 01 56"),
        ("start = '02'\nlength = 'u16le'\nlength_over = 'body check'\ncheck = 'xor8'", "02 04 00 53 02 01 50"),
        (
            "start = 'AA'\nlength = 'u8'\nlength_over = 'start length body check end'\n"
            "check = 'lrc'\ncheck_over = 'length body'\nend = '03'",
            "AA 07 53 02 01 A3 03",
        ),
        ("start = '02'\nend = '03'\ncheck = 'sum8'\ncheck_as = 'hex'", "02 53 02 01 35 36 03"),
        (
            "start = '02'\nend = '0D'\nlayout = 'start length check body end'\nlength = 'u8'\ncheck = 'sum8'",
            "02 03 56 53 02 01 0D",
        ),
        ("check = {{ bits = 16, poly = 0x8005, init = 0xFFFF, reflect = true }}\ncheck_order = 'low'", MODBUS_WIRE),
        ("start = '02'\nlength = 'u8'\nlength_add = 1\npad = 8", "02 04 53 02 01 00 00 00"),
        (
            "start = '02'\nend = '03'\nlength = 'u8'\ncheck = 'sum8'\n"
            "escapes = {{ 02 = '1B 82', 03 = '1B 83', 1B = '1B 9B' }}",
            "02 1B 83 53 1B 82 01 56 03",
        ),
        ("start = \"':'\"\nend = '0D 0A'\nescapes = 'hex'\ncheck = 'lrc'", "3A 35 33 30 32 30 31 41 41 0D 0A"),
        (
            "start = \"'$' 02\"\nlength = 'u8'\ncheck = 'sum8'\nlayout = 'start head length body check end'",
            "24 02 03 53 02 01 56",
        ),
        ("start = '02'\nlength = 'u8'\ncheck = {{ kind = 'sum', bits = 7, init = 64 }}", "02 03 53 02 01 16"),
    ],
)
def test_frames_are_the_bytes_written_by_hand(own, entries: str, wire: str) -> None:
    profile = read_profile(own(FRAMED.format(entries.replace("{{", "{").replace("}}", "}"))))
    body = profile.commands["select"][0].send.fill({"slot": 258})
    assert wrap(profile.framing, body).hex(" ").upper() == wire
    assert profile.commands["load"][0].send.fill({"slot": 1, "lines": b"\x0f\xf0"}).hex() == "4c0100500ff0"
    for noise in (b"", b"\x55\x00\x55"):
        buffer = bytearray(noise + bytes.fromhex(wire) + b"\x99")
        while (found := unwrap(profile.answers, buffer)) is not None and found != body:
            pass
        assert found == body


@pytest.mark.parametrize(
    ("profile", "change", "seen"),
    [
        ("stripe-lines", ("settle_ms", "settel_ms"), "line 41: timing.settel_ms: no such key; write settle_ms"),
        ("stripe-lines", ("[commands.query]", "[commands.qurey]"), "commands.qurey: no such key; write query"),
        ("stripe-frames", ('check = "crc16"', 'check = "crc16"\nend_byte = "03"'), "framing.end_byte: no such key"),
        ("stripe-lines", ("{tag} SHOW {slot}", "{tag} SHOW {slot} {slot}"), r"line \d+: commands.select.send: .*twice"),
        ("stripe-lines", ("OK SHOW {slot}", "OK SHOW {slott}"), r"line \d+: commands.select.expect: .*write slot"),
        ("stripe-lines", ("SHOW {slot}", "SHOW {slot:u8}"), r"line \d+: commands.select.send: format 'u8'"),
        ("stripe-lines", ('"{tag} SHOW {slot}"', '" "'), r"line 57: commands.select.send: ' '; write it out"),
        ("stripe-lines", ('"{tag} OK SHOW {slot}"', "[]"), r"line 58: commands.select.expect: \[\]; give a text"),
        (
            "stripe-lines",
            ('"{tag} SHOW {slot}"', '"{tag} SHOW"'),
            "line 56: commands.select: nothing says which pattern",
        ),
        ("stripe-lines", ('"{tag} ERR {code} {text}"', "[]"), r"line \d+: refusal.expect: \[\]; say how"),
        ("stripe-lines", ("busy = 1", "busy = 3"), r"line \d+: refusal.codes.busy: 3; another number"),
        ("stripe-lines", ("stop = 1", "stop = 3"), r"line \d+: port.stop: 3.0; use 1, 1.5 or 2"),
        ("stripe-lines", ('ending = "', 'ending = "ü'), r"line \d+: framing.ending: 'ü.*use ASCII"),
        ("modbus", ('"_warm&1" = 1', '"_cold&1" = 1'), r"commands.start.1.until: '_cold'"),
        ("optoma", ("until = { on = 1 }", "until = { on = [] }"), r"line \d+: commands.start.1.until.on: \[\]"),
        ("optoma", ("until = { on = 1 }", "until = {}"), r"line \d+: commands.start.1.until: {}; say what to wait for"),
        ("stripe-lines", ("SHOW {slot}", r"SHOW {slot}\r"), r"line 57: commands.select.send: .*leave its end to"),
        ("lightcrafter4500", ("{image:u8}", "00"), "commands.image: nothing says which pattern is meant; send {image}"),
        ("optoma", ("until = { on = 1 }", "until = { on = nan }"), r"commands.start.1.until.on: nan; give a number"),
        ("optoma", ("until = { on = 1 }", 'until = { "on&x" = 1 }'), r"line \d+: .*'on&x'; name what the answer"),
        ("lightcrafter4500", ("{slot/24:u8}", "{slot/0:u8}"), r"line \d+: commands.select.5.send: .*slot/0"),
        ("lightcrafter4500", ('sequence = "', 'sequence = "s'), r"line \d+: stored.sequence: no preset"),
        (
            "optoma",
            ("until = { on = 1 }", "until = { _k = 1 }"),
            r"commands.start.1.until: '_k' is read as text",
        ),
        ("modbus", ('check = "crc16-modbus"', ""), "end cannot be told"),
        ("modbus", ('sequence = "paper"', 'sequence = "papre"'), "papre"),
        ("lightcrafter4500", ('"40 {tag:u8} | 24', '"{tag:u8} | 24'), "heads of several lengths"),
        ("lightcrafter4500-i2c", ('"F0"', '"F0 {slto:u8}"'), r"line \d+: commands.expect: field 'slto'.*write slot"),
    ],
)
def test_a_wrong_entry_is_named_with_its_line(own, profile: str, change: tuple[str, str], seen: str) -> None:
    text = resource("profiles", f"{profile}.toml").read_text()
    assert change[0] in text
    with pytest.raises(InputError, match=seen):
        read_profile(own(text.replace(*change, 1)))


def test_an_answer_that_may_be_anything_is_no_acknowledgement_where_the_device_can_refuse(own) -> None:
    text = PROMPTING.replace('send = "S{slot:03d}"\nexpect = "A{slot:03d}"', 'send = "S{slot:03d}"\nexpect = "{text}"')
    with pytest.raises(InputError, match=r"commands\.select\.expect: any answer counts as done"):
        read_profile(own(text))
    profile = own(text + '[refusal]\nexpect = "A{code}"')
    with plugged(Prompting()) as port:
        projector = open_projector(f"serial:{port}?profile={profile}")
        projector.load([White()])
        with pytest.raises(DeviceError, match="select: refused"):
            projector.step(0)
        projector.close()


@pytest.mark.parametrize("name", DEVICES)
def test_every_profile_that_comes_along_says_what_it_was_tried_on(name: str) -> None:
    assert name in profile_names()
    assert "Tried against an emulator" in resource("profiles", f"{name}.toml").read_text()


def test_probe_shows_every_byte_and_what_was_not_understood(own, capsys) -> None:
    device = Prompting()
    with plugged(device) as port:
        assert main(["probe", own(PROMPTING), port]) == 0
        good = capsys.readouterr().out
        device.spoil = lambda data: b"what?\r\n"
        text = PROMPTING.replace("answer_ms = 500", "answer_ms = 50")
        assert main(["probe", own(text), port, "--json", "-"]) == 1
    bad = capsys.readouterr()
    sent = b"$L001 X FFFF*"
    sent += b"%02X\r" % (sum(b"L001 X FFFF") & 0xFF)
    assert f"> {sent.hex(' ')}   $L001 X FFFF*" in good
    assert "ok: slot = 1" in good
    assert "NOT UNDERSTOOD" in bad.err
    assert b"what?".hex(" ") in bad.err
    assert "2 of 2 commands were not understood (load, select)" in bad.err


def test_a_probe_shows_what_came_before_the_line_was_lost(own, monkeypatch, capsys) -> None:

    def receive(self: link.Link, until_s: float, check: object = None) -> bytes:
        if (data := next(lines, None)) is None:
            raise link.LineDownError("port", "the line is gone", "check the cable")
        return data

    with plugged(Prompting()) as port:
        monkeypatch.setattr(link.Link, "drain", lambda *a: 0)
        lines = iter([b"$A0"])
        monkeypatch.setattr(link.Link, "receive", receive)
        assert main(["probe", own(PROMPTING), port]) == 1
    told = capsys.readouterr()
    assert "< 24 41 30   $A0" in told.out
    assert "the line is gone" in told.err


def test_an_answer_that_says_something_else_is_told_with_both(own) -> None:
    device = Prompting()
    device.spoil = lambda data: data.replace(b"$A001*D2", b"$A003*D4")
    with plugged(device) as port:
        talk = Dialogue(port, read_profile(own(PROMPTING)))
        with pytest.raises(DeviceError, match="says slot 3 in place of 1"):
            talk.do("load", once=True, slot=1, plate="X", lines=b"\xff\xff")
        talk.close()


class TwoDigits(Device):
    """Lines of a fixed form, ``nn S kk``: columns 0 and 1 are a number that it repeats, 5 and 6 the slot."""

    def take(self, buffer: bytearray) -> Iterator[bytes]:
        while (end := buffer.find(b"\r")) >= 0:
            yield buffer[:2] + (b" K " + buffer[5:7] if buffer[2:5] == b" S " else b" ??") + b"\r"
            del buffer[: end + 1]


def test_tags_have_no_more_digits_than_the_device_has_room_for(own) -> None:
    """From the hundredth command on the tag had three: the device understood none of them."""
    text = PROMPTING.replace(
        'answer_ending = "\\r\\n"\ncheck = "sum8"\ncheck_mark = "*"\nprompt = "> "\necho = true\n', ""
    )
    text = text.replace('start = "$"\n', "").replace("= 500", "= 40")
    text = text.replace(
        '"S{slot:03d}"\nexpect = "A{slot:03d}"', '"{tag:02d} S {slot:02d}"\nexpect = "{tag:02d} K {slot:02d}"'
    )
    with plugged(TwoDigits()) as port:
        talk = Dialogue(port, read_profile(own(text)))
        for _ in range(101):
            talk.do("select", once=True, slot=7)
        talk.close()


def test_a_device_that_an_edge_would_reset_is_opened_without_one(own, monkeypatch: pytest.MonkeyPatch) -> None:
    set_, text = [], PROMPTING.replace("[device]", "[port]\ndtr = false\n[device]")

    class Port(SimpleNamespace):
        def __setattr__(self, name: str, value: object) -> None:
            set_.append((name, value))

        def open(self) -> None:
            set_.append(("open", True))

    monkeypatch.setattr(link, "_pyserial", lambda: SimpleNamespace(serial_for_url=lambda *a, **k: Port()))
    link.Link("/dev/none", read_profile(own(text)).port)
    assert set_ == [("dtr", False), ("rts", True), ("open", True)]


def test_bytes_that_cannot_be_read_are_shown_in_the_error(own) -> None:
    device = Prompting()
    device.spoil = lambda data: b"\xfe\xff\x00"
    with plugged(device) as port:
        talk = Dialogue(port, read_profile(own(PROMPTING.replace("= 500", "= 40"))))
        with pytest.raises(DeviceError, match=r"bytes that cannot be read \(fe ff 00\)"):
            talk.do("select", slot=1)
        talk.close()


def test_a_device_that_comes_back_under_another_name_is_found_by_its_serial_number(own, monkeypatch) -> None:
    told: list[str] = []
    first, second = Prompting(), Prompting()
    there: dict[str, str] = {}
    monkeypatch.setattr(
        link,
        "_ports",
        lambda: [SimpleNamespace(device=name, vid=0x403, pid=0x6001, serial_number=s) for name, s in there.items()],
    )
    with plugged(first) as old:
        there[old] = "FT1"
        projector = open_projector(f"serial:{old}?profile={own(PROMPTING)}", lambda who, what: told.append(what))
        projector.show(White())
    del there[old]
    with plugged(Describing()) as other, plugged(second) as new:
        there.update({other: "FT2", new: "FT1"})
        projector.show(Line("x", 4, 4))
        assert second.slots[1] == b"\x0f\x00"
        assert f"came back as {new}" in told
        projector.close()


def test_a_port_that_does_not_open_says_whose_it_is_or_which_are_there(tmp_path: Path, monkeypatch) -> None:
    port = tmp_path / "ttyUSB0"
    port.write_bytes(b"")
    monkeypatch.setattr(link.os, "access", lambda place, mode: False)
    port.chmod(0o660)
    assert f"usermod -aG {port.group()}" in link.opening_remedy(str(port))
    port.chmod(0o600)  # as /dev/hidraw0 is: its group, root, would not help
    told = link.opening_remedy(str(port))
    assert "usermod" not in told
    assert f"setfacl -m u:$USER:rw {port}" in told
    monkeypatch.setattr(link, "_BY_ID", tmp_path)
    assert str(port) in link.opening_remedy(str(tmp_path / "ttyUSB7"))


@pytest.mark.parametrize("name", ["stripe-lines", "stripe-frames"])
def test_every_command_of_an_emulated_projector_is_understood_by_a_probe(own, name: str) -> None:
    path = own(resource("profiles", f"{name}.toml").read_text().replace('"even"', '"none"'))
    line = EmulatedLine(Emulator(read_profile(path), Stage(FlatScene(projector_size=(640, 640)))))
    try:
        assert main(["probe", path, line.url]) == 0
    finally:
        line.close()
