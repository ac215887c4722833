"""Mistakes in a profile are named where they stand, before anything is sent."""

import re

import numpy as np
import pytest

from core.cli import main
from core.devices import open_projector
from core.devices.line.dialogue import Dialogue
from core.devices.line.profiles import profile_names, read_profile
from core.errors import DeviceError, InputError
from core.patterns import Code, Phase
from core.resources import resource
from tests.devices.manuals import Device, plugged

FRAMES = """format = "stripe-projector-profile"
version = 1
[device]
columns = 64
rows = 64
[framing]
kind = "frame"
start = "02"
end = "03"
[timing]
answer_ms = 100
settle_ms = 1
[commands.show-gray]
send = "10 {axis:u8} {bit:u8} {bits:u8} {inverse:u8} {cell:u8}"
expect = "06"
[commands.show-phase]
send = "20 {axis:u8} {period:u8} {steps:u8} {step:u8}"
expect = "06"
"""
WORDS = "[words.axis]\nx = 0\ny = 1\n"


class Content(Device):
    """Acknowledges every frame."""

    def take(self, buffer: bytearray):
        while (end := buffer.find(b"\x03")) >= 0:
            del buffer[: end + 1]
            yield b"\x02\x06\x03"


def misspelt(text: str):
    """Give the text with two letters of one key or table name exchanged, for each; the line and the name."""
    lines, seen = text.splitlines(), set()
    for number, line in enumerate(lines, 1):
        names = [] if line.startswith("#") else re.findall(r"(?:^|[{,] *)([a-z_][\w-]*)(?= *=)", line)
        names += [n for m in re.findall(r"^\[+([\w.-]+)\]", line) for n in m.split(".")]
        for name in set(names) - seen:
            seen.add(name)
            wrong = name[:-2] + name[-1] + name[-2] if name[-1] != name[-2] else name + "s"
            changed = re.sub(rf"(?<![\w-]){name}(?![\w-])", wrong, line, count=1)
            yield number, wrong, "\n".join([*lines[: number - 1], changed, *lines[number:]])


@pytest.mark.parametrize("name", profile_names())
def test_every_key_and_table_of_a_profile_may_be_misspelt_and_is_named(own, name: str) -> None:
    tried = 0
    for number, wrong, text in misspelt(resource("profiles", f"{name}.toml").read_text()):
        with pytest.raises(InputError, match=rf"mine.toml, line {number}: .*\b{wrong}\b"):
            read_profile(own(text))
        tried += 1
    assert tried > 15


@pytest.mark.parametrize(
    ("profile", "change", "seen"),
    [
        ("stripe-frames", ("slots = 200", "slots = 300"), r"line 53: commands.load: {slot:u8} has no room for 299"),
        ("stripe-lines", ("SHOW {slot}", "SHOW {slot:01d}"), r"commands.select: {slot:01d} has no room for 63"),
        ("modbus", ("{slot:u16}", "{slot-5:u16}"), r"commands.select: {slot-5:u16} has no room for -4"),
        ("stripe-lines", ("{plate} {lines}", "{plate:03d} {lines}"), r"commands.load: {plate:03d} has no room for 'C'"),
        ("stripe-lines", ("SHOW {slot}", "SHOW {slot:0999999d}"), "format '0999999d'"),
        ("stripe-lines", ("columns = 640", "columns = 640000000"), "line 23: device.columns: 640000000"),
        ("lightcrafter4500", ("| 24 1A 00", "| 24 | 1A 00"), r"line \d+: commands.select.0.send: byte '\|'"),
        ("optoma", ("{ on = 1 }", '{ on = "1" }'), r"line 40: commands.start.1.until: 'on' is read as a number"),
        ("stripe-frames", ('flow = "none"', 'flow = "xonxoff"'), r"line 20: port.flow: frames may hold its bytes 11 "),
        (
            "stripe-lines",
            ('ending = "\\r\\n"', 'ending = "\\r\\n"\ncheck_order = "low"'),
            "framing.check_order: no such",
        ),
    ],
)
def test_what_cannot_work_is_refused_before_the_port_is_opened(own, profile, change, seen) -> None:
    text = resource("profiles", f"{profile}.toml").read_text()
    assert change[0] in text
    with pytest.raises(InputError, match=seen):
        read_profile(own(text.replace(*change)))


def test_words_are_of_values_that_there_are(own) -> None:
    with pytest.raises(InputError, match=r"line 20: words.axis.X: no such value; use x, y"):
        read_profile(own(FRAMES + WORDS.replace("x =", "X =")))
    assert read_profile(own(FRAMES + WORDS + "[words.inverse]\nfalse = 0\ntrue = 255\n"))


def test_a_pattern_for_which_a_command_has_no_room_is_refused_beforehand(own, capsys) -> None:
    with plugged(Content()) as port:
        projector = open_projector(f"serial:{port}?profile={own(FRAMES + WORDS)}")
        assert projector.refusal(Phase("x", 16.0, 4, 0, 0.0)) is None
        assert "{period:u8} has no room for 1140.0" in projector.refusal(Phase("x", 1140.0, 4, 0, 0.0))
        assert "rounds a period of 16.5" in projector.refusal(Phase("x", 16.5, 4, 0, 0.0))
        projector.close()
        projector = open_projector(f"serial:{port}?profile={own(FRAMES)}")  # no word for x and y
        assert "{axis:u8} has no room for 'x'" in projector.refusal(Code("gray", "x", 0, 6))
        with pytest.raises(DeviceError, match="has no room for 'x'"):
            projector.load([Code("gray", "x", 0, 6)])
        projector.close()
        assert main(["probe", own(FRAMES), port]) == 1  # it was a traceback
    assert "NOT UNDERSTOOD: {axis:u8} has no room for 'x'" in capsys.readouterr().out


def test_a_number_is_rounded_and_not_cut_off(own) -> None:
    text = FRAMES.replace("{steps:u8} {step:u8}", "{shift_deg*10:u16}") + WORDS
    device = Content()
    with plugged(device) as port:
        projector = open_projector(f"serial:{port}?profile={own(text)}")
        projector.show(Phase("x", 16.0, 4, 0, np.deg2rad(7.5)))  # 74.99999999999999 tenths
        projector.close()
    assert device.heard == bytes.fromhex("02 20 00 10 00 4B 03")


def test_a_bar_in_quotes_is_a_character(own) -> None:
    text = FRAMES.replace('"10 {axis:u8}', "\"'A|B' {axis:u8}") + WORDS
    device = Content()
    with plugged(device) as port:
        talk = Dialogue(port, read_profile(own(text)))
        talk.do("show-gray", axis="x", bit=1, bits=6, inverse=False, cell=1)
        talk.close()
    assert device.heard == b"\x02A|B\x00\x01\x06\x00\x01\x03"


@pytest.mark.parametrize(
    "escapes", ["'hex'", "{ 11 = '1B 31', 13 = '1B 33', 02 = '1B 22', 03 = '1B 23', 1B = '1B 1B' }"]
)
def test_frames_may_be_held_by_xon_and_xoff_where_their_bytes_are_escaped(own, escapes: str) -> None:
    flow = FRAMES.replace("[device]", '[port]\nflow = "xonxoff"\n[device]') + WORDS
    assert read_profile(own(flow.replace('end = "03"', f'end = "03"\nescapes = {escapes}')))
    digits = re.sub(r"(?<=\{)(\w+):u8", r"\1:02d", flow)
    assert read_profile(own(digits))  # all is written in digits
    with pytest.raises(InputError, match=r"port\.flow"):
        read_profile(own(digits.replace('"20 ', '"11 ')))
