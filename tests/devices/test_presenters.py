"""Profiles of presentation projectors and of a DLPC900 against devices that were written from their manuals."""

import socket
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from core.cli import main
from core.devices import offer_screens, open_projector
from core.devices.line.profiles import read_profile
from core.errors import DeviceError, InputError
from core.patterns import Black, Line, White
from core.resources import resource
from tests.devices.manuals import Device, plugged
from tests.devices.presenters import Barco, Dlpc900, Epson, Hitachi, Nec, Panasonic, Pjlink, Ricoh, Sony
from tests.devices.tables import DEVICES, tried

QUICK = (
    ("every_ms = 1000", "every_ms = 1"),
    ("gap_ms = 100", "gap_ms = 5"),
    ("gap_ms = 50", "gap_ms = 5"),
    ("answer_ms = 2000", "answer_ms = 50"),
    ("pause_ms = 3000", "pause_ms = 1"),
    ("pause_ms = 500", "pause_ms = 1"),
    ('parity = "even"', ""),  # a pseudo-terminal has none
)


@pytest.fixture
def own(tmp_path: Path):
    """Write a profile of one's own; give its path."""

    def write(text: str) -> str:
        path = tmp_path / "mine.toml"
        for change in QUICK:
            text = text.replace(*change)
        path.write_text(text)
        return str(path)

    return write


@pytest.mark.parametrize(
    ("name", "device", "lit"),
    [
        ("epson", Epson(), lambda d: d.power == 1 and not d.warming and not d.muted),
        ("pjlink", Pjlink(), lambda d: d.power == 1 and not d.warming and d.muted == "30"),
        ("nec", Nec(), lambda d: d.on and not d.muted),
        ("hitachi", Hitachi(), lambda d: d.on == 1 and d.said == ["on", "power?"]),
        ("panasonic", Panasonic(), lambda d: d.on and not d.deaf and not d.stubborn and not d.shut),
        ("sony", Sony(), lambda d: d.on and not d.warming and not d.muted),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_projector_is_lit_before_the_first_picture(own, name: str, device: Device, lit) -> None:
    surface = SimpleNamespace(size=(64, 48), present=lambda image: seen.append(lit(device)), close=list)
    seen: list[bool] = []
    offer_screens(lambda number: surface)
    try:
        with plugged(device) as port:
            path = own(resource("profiles", f"{name}.toml").read_text())
            projector = open_projector(f"screen:1?control={port}&profile={path}")
            projector.show(White())
            projector.close()
    finally:
        offer_screens(None)
    assert seen == [True]


def test_a_projector_is_switched_on_over_the_network_too(own) -> None:
    """PJLink greets whoever connects."""
    device, seen = Pjlink(), []
    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        connection, _ = server.accept()
        connection.sendall(b"PJLINK 0\r")
        buffer = bytearray()
        while data := connection.recv(4096):
            buffer += data
            for answer in device.take(buffer):
                connection.sendall(answer)
        connection.close()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    surface = SimpleNamespace(size=(64, 48), present=lambda image: seen.append(device.muted), close=list)
    offer_screens(lambda number: surface)
    try:
        path = own(resource("profiles", "pjlink.toml").read_text())
        place = f"socket://127.0.0.1:{server.getsockname()[1]}"
        projector = open_projector(f"screen:1?control={place}&profile={path}")
        projector.show(White())
        projector.close()
    finally:
        offer_screens(None)
        server.close()
    assert seen == ["30"]


def test_a_pjlink_projector_with_a_password_is_told_with_what_it_said(capsys) -> None:
    """Class 1 in PJLink's own words: it greets with a random number, and hangs up on whoever does not use it."""
    server = socket.create_server(("127.0.0.1", 0))

    def serve() -> None:
        connection, _ = server.accept()
        connection.sendall(b"PJLINK 1 498e4a67\r")
        connection.recv(4096)
        connection.sendall(b"PJLINK ERRA\r")
        connection.close()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    assert main(["probe", "pjlink", f"socket://127.0.0.1:{server.getsockname()[1]}"]) in (1, 2)
    thread.join()
    server.close()
    assert "PJLINK ERRA" in (told := capsys.readouterr().out)
    assert "NOT UNDERSTOOD: refused" in told


@pytest.mark.parametrize(
    ("name", "device", "seen"),
    [
        ("epson", Epson(warming=10**6), r"on is 2 after"),
        ("pjlink", Pjlink(warming=10**6), r"on is 3 after"),
        ("panasonic", Panasonic(deaf=10**6), "start: no answer"),
    ],
    ids=["epson", "pjlink", "panasonic"],
)
def test_a_projector_that_does_not_get_warm_is_told(own, name: str, device: Device, seen: str) -> None:
    offer_screens(lambda number: SimpleNamespace(size=(64, 48), present=list, close=list))
    text = resource("profiles", f"{name}.toml").read_text().replace("within_ms = 90000", "within_ms = 100")
    try:
        with plugged(device) as port, pytest.raises(DeviceError, match=seen):
            open_projector(f"screen:1?control={port}&profile={own(text)}")
    finally:
        offer_screens(None)


@pytest.mark.parametrize("name", DEVICES)
def test_every_command_is_understood_though_answers_are_spoilt(name: str, tmp_path: Path) -> None:
    understood, whole, repeats, _ = tried(name, "one bit", tmp_path)
    assert understood == whole
    assert repeats >= 1


def test_a_lamp_that_is_not_warm_yet_is_waited_for_by_a_probe(tmp_path: Path) -> None:
    assert tried("optoma", "", tmp_path)[:2] == (2, 2)
    with plugged(Epson(warming=3)) as port:
        assert main(["probe", "epson", port]) == 0


def test_a_refusal_of_one_byte_and_one_of_three_are_told_at_once(own) -> None:
    device = Hitachi()
    text = resource("profiles", "hitachi.toml").read_text().replace("retries = 2", "retries = 0")
    with plugged(device) as port:
        device.spoil = lambda data: b"\x15"
        assert main(["probe", own(text), port]) == 1
        for answer, seen in ((b"\x15", "unknown"), (b"\x1c\x00\x00", "busy")):
            device.spoil = lambda data, answer=answer: answer
            with pytest.raises(DeviceError, match=rf"refused \({seen}\)"):
                open_projector(f"screen:1?control={port}&profile={own(text)}")


def test_only_a_device_that_has_answered_is_waited_for_in_silence_and_a_no_is_told_at_once(own) -> None:
    """Within 90 s, which the profile gives for the lamp, this test would not end."""
    device = Sony()
    path = own(resource("profiles", "sony.toml").read_text().replace("answer_ms = 1000", "answer_ms = 20"))
    refused = Sony.message(b"\x01\x01", 3)
    with plugged(device) as port:
        for answer, seen in ((b"", "no answer, 3 times"), (refused, r"refused \(unknown\), 3 times")):
            device.spoil = lambda data, answer=answer: answer
            with pytest.raises(DeviceError, match=seen):
                open_projector(f"screen:1?control={port}&profile={path}")


BARCO = """
format = "stripe-projector-profile"
version = 1
[device]
columns = 2048
rows = 1
slots = 256
plates = ["X"]
[framing]
kind = "frame"
start = "FE"
end = "FF"
check = "sum8"
escapes = { 80 = "80 00", FE = "80 7E", FF = "80 7F" }
[timing]
answer_ms = 500
settle_ms = 1
[[commands.load]]
send = "01 4C {slot:u8} {lines}"
expect = "01 00 06"
[[commands.load]]  # the answer after the acknowledge
expect = "01 4C {slot:u8}"
[[commands.select]]
send = "01 53 {slot:u8}"
expect = "01 00 06"
[[commands.select]]
expect = "01 53 {slot:u8}"
[refusal]
expect = "01 00 15"
"""


def test_bytes_of_start_and_end_are_converted_where_they_are_data(own) -> None:
    device = Barco()
    with plugged(device) as port:
        projector = open_projector(f"serial:{port}?profile={own(BARCO)}")
        patterns = [Black(), *(Line("x", 8 * n, 1) for n in range(126)), White(), Line("x", 8, 7)]
        projector.load(patterns)  # slots 7E, 7F and 80 are among them, FE and FF among the lines
        for slot in (0x7E, 0x7F, 0x80):
            projector.step(slot)
            assert device.shown == slot
        assert projector.repeats == (0, 2 * len(patterns) + 6)
        projector.close()
    for slot, pattern in enumerate(patterns):
        lit = np.unpackbits(np.frombuffer(device.stored[slot], np.uint8)).nonzero()[0]
        first, count = (pattern.index, pattern.width) if isinstance(pattern, Line) else (0, 2048 * (pattern == White()))
        assert lit.tolist() == list(range(first, first + count))


RICOH = """
format = "stripe-projector-profile"
version = 1
[device]
columns = 64
rows = 64
[framing]
kind = "frame"
start = "02"
end = "03"
answer_start = ""
answer_end = ""
[timing]
answer_ms = 500
settle_ms = 1
[commands.start]
send = "'PON'"
expect = "06 0D"
[commands.show-white]
send = "'WHT'"
expect = "06 0D"
[refusal]
expect = ["06 1B", "15"]
"""


def test_answers_of_one_and_two_bytes_need_no_frame(own) -> None:
    device = Ricoh()
    with plugged(device) as port:
        projector = open_projector(f"serial:{port}?profile={own(RICOH)}")
        projector.show(White())
        assert device.shown == "WHT"
        device.on = False
        begun = len(device.heard)
        with pytest.raises(DeviceError, match=r"refused \(unknown\), 4 times"):
            projector.show(White())
        assert device.heard[begun:] == b"\x02WHT\x03" * 4
        projector.close()


def test_answers_that_cannot_be_told_apart_are_refused(own) -> None:
    with pytest.raises(InputError, match="end cannot be told"):
        read_profile(own(RICOH.replace('["06 1B", "15"]', '["06 1B", "06"]')))


def test_a_dlpc900_shows_and_runs_the_bit_planes_of_its_images(own) -> None:
    text = resource("profiles", "lightcrafter6500.toml").read_text().replace("pause_ms = 100", "")
    device = Dlpc900()
    with plugged(device) as port:
        projector = open_projector(f"serial:{port}?profile={own(text)}&settle_ms=0")
        for slot in (0, 5, 23, 24, 27):
            projector.show(projector.sequence[slot])
            assert device.shown == [(slot // 24, slot % 24)]
        projector.load(projector.sequence)
        projector.run()
        assert device.shown == [(slot // 24, slot % 24) for slot in range(len(projector.sequence))]
        np.testing.assert_array_equal(np.diff(device.pulses), 8333)
        projector.follow(1 / 120)
        assert device.shown == []
        for pulse in range(len(projector.sequence)):
            device.trigger(9000 * pulse)
            assert device.shown[-1] == (pulse // 24, pulse % 24)
        projector.close()
    with plugged(Dlpc900()) as port:
        assert main(["probe", own(text), port]) == 0
