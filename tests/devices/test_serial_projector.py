"""The serial projector against bytes written by hand, lines that die, and devices that say no."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from core.devices import LINK_FAULTS, open_camera, open_projector
from core.devices.line.emulator import Emulator
from core.devices.line.framing import unwrap, wrap
from core.devices.line.link import Link
from core.devices.line.profile import Port
from core.devices.line.profiles import profile_names, read_profile
from core.devices.line.rs232 import SerialProjector
from core.devices.line.server import EmulatedLine
from core.devices.scene import FlatScene
from core.devices.virtual import Stage
from core.errors import Cancelled, DeviceError, InputError, NotThereError
from core.patterns import Black, Line, White, reference_sequence

PROFILES = ["stripe-lines", "stripe-frames"]


class Script:
    """A device at the other end of a socket that answers each chunk of bytes by a function."""

    def __init__(self, answer: Callable[[bytes], bytes | None]) -> None:
        self.answer, self.heard = answer, []
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.listener.settimeout(5)
        self.url = f"socket://127.0.0.1:{self.listener.getsockname()[1]}"
        self.thread = threading.Thread(target=self.serve, daemon=True)
        self.thread.start()

    def serve(self) -> None:
        try:
            host, _ = self.listener.accept()
        except OSError:
            return
        with host:
            while data := self.chunk(host):
                self.heard.append(data)
                reply = self.answer(data)
                if reply is None:
                    return
                host.sendall(reply)

    @staticmethod
    def chunk(host: socket.socket) -> bytes:
        try:
            return host.recv(4096)
        except OSError:
            return b""

    def close(self) -> None:
        self.listener.close()
        self.thread.join(5)


@pytest.fixture
def script() -> Iterator[Callable[..., Script]]:
    made: list[Script] = []

    def make(answer: Callable[[bytes], bytes | None]) -> Script:
        made.append(Script(answer))
        return made[-1]

    yield make
    for one in made:
        one.close()


def small(name: str) -> object:
    return replace(read_profile(name, 16, 8), answer_s=0.1, load_s=0.1, gap_s=0.01, retries=1)


def test_text_commands_are_the_bytes_of_the_guide(script: Callable[..., Script]) -> None:
    answers = {
        b"1 ID?\r\n": b"1 OK ID 16 8 64\r\n",
        b"2 LAMP 1\r\n": b"2 OK LAMP 1\r\n",
        # columns 4 to 7 of 16 lit: 0000 1111 0000 0000; CRCs by binascii.crc_hqx(data, 0xFFFF)
        b"3 LOAD 0 C 0F00\r\n": b"3 OK LOAD 0 C 0D31\r\n",
        b"4 LOAD 0 R 00\r\n": b"4 OK LOAD 0 R E1F0\r\n",
        b"5 STATE?\r\n": b"5 OK STATE 0 1 1\r\n",
        b"6 SHOW 0\r\n": b"6 OK SHOW 0\r\n",
    }
    device = script(lambda data: answers.get(data, b"0 ERR 5 what\r\n"))
    projector = SerialProjector(device.url, small("stripe-lines"))
    projector.show(Line("x", 4, 4))
    projector.close()
    assert device.heard == list(answers)


def test_binary_commands_are_the_bytes_of_the_guide(script: Callable[..., Script]) -> None:
    def frame(text: str) -> bytes:
        return wrap(read_profile("stripe-frames").framing, bytes.fromhex(text))

    answers = {
        frame("01 01"): frame("01 81 0010 0008 00C8"),
        frame("02 02 01"): frame("02 82 01"),
        # low bit first: columns 4 to 7 are F0 00; sum16 of F0 00 00 is 00F0
        frame("03 10 00 F0 00 00"): frame("03 90 00 00F0"),
        frame("04 30"): frame("04 B0 00 01 01"),
        frame("05 20"): frame("05 A0 00"),
    }
    assert next(iter(answers)) == bytes.fromhex("02 0002 0101 3E1F")  # CRC by binascii.crc_hqx(data, 0xFFFF)
    device = script(lambda data: answers.get(data, b""))
    projector = SerialProjector(device.url, small("stripe-frames"))
    projector.show(Line("x", 4, 4))
    projector.close()
    assert device.heard == list(answers)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_silent_device_ends_in_an_error_that_says_what_to_check(script: Callable[..., Script], profile: str) -> None:
    device = script(lambda data: b"")
    start = time.monotonic()
    with pytest.raises(DeviceError, match="baud rate"):
        SerialProjector(device.url, small(profile))
    assert time.monotonic() - start < 2.0


def test_a_device_with_another_number_of_lines_is_named(script: Callable[..., Script]) -> None:
    device = script(lambda data: data.split()[0] + b" OK ID 800 600 64\r\n")
    with pytest.raises(DeviceError, match="800x600 lines, the profile says 16x8"):
        SerialProjector(device.url, small("stripe-lines"))


def test_a_device_that_refuses_for_good_is_told_with_its_reason(script: Callable[..., Script]) -> None:
    device = script(lambda data: data.split()[0] + b" ERR 5 no such thing\r\n")
    with pytest.raises(DeviceError, match=r"refused \(unknown\)"):
        SerialProjector(device.url, small("stripe-lines"))


@pytest.mark.parametrize("url", ["/dev/no-such-port", "socket://127.0.0.1:1", "/dev/null", "strange://x"])
def test_a_port_that_cannot_be_opened_is_a_device_error(url: str) -> None:
    with pytest.raises(DeviceError, match="cannot be opened"):
        Link(url, Port(9600, 8, "none", 1.0, "none"))


@pytest.mark.parametrize(
    "place", ["/dev/no-such-port", "socket://127.0.0.1:1", "socket://127.0.0.1:99999", "hwgrep://0451:f432"]
)
def test_a_projector_that_is_not_at_its_url_is_bad_input(place: str) -> None:
    """Nothing has been done yet; a device that fails later is no fault of what was typed."""
    with pytest.raises((NotThereError, InputError), match=place.rpartition("/")[2]) as caught:
        open_projector(f"serial:{place}?profile=stripe-lines")
    assert caught.value.exit_code == 2
    assert isinstance(caught.value, InputError) == ("99999" in place)  # nothing but a number is a port


def test_a_second_program_cannot_open_the_port() -> None:
    projector = open_projector("emulated:flat")
    with pytest.raises(DeviceError, match="no other program"):
        Link(projector.line.url, projector.profile.port)
    projector.close()


@pytest.mark.parametrize("line", ["pty", "socket"])
def test_a_line_that_dies_for_good_is_an_error_within_seconds(line: str) -> None:
    projector = open_projector(f"emulated:flat?line={line}&answer_ms=20")
    projector.load([White(), Black()])
    projector.line.close()
    start = time.monotonic()
    with pytest.raises(DeviceError, match="check"):
        projector.step(0)
    assert time.monotonic() - start < 10.0
    projector.close()


class Impatience:
    """Cancels as soon as a device has told of a second try, and knows how long ago that was."""

    def __init__(self) -> None:
        self.since_s: float | None = None

    def note(self, who: str, what: str) -> None:
        if "try 2" in what:
            self.since_s = time.monotonic()

    def check(self) -> None:
        if self.since_s is not None:
            raise Cancelled

    @property
    def waited_s(self) -> float:
        assert self.since_s is not None
        return time.monotonic() - self.since_s


def fall_silent(line: EmulatedLine) -> Callable[[], None]:
    """Let the device at the other end hear nothing any more; gives what wakes it."""
    feed, line.emulator.feed = line.emulator.feed, lambda data: []
    return lambda: setattr(line.emulator, "feed", feed)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize(
    "call",
    [
        lambda projector, check: projector.load([Line("x", 8, 8)], check),
        lambda projector, check: projector.show(Line("x", 8, 8), check),
        lambda projector, check: projector.step(0, check),
    ],
    ids=["load", "show", "step"],
)
def test_a_command_that_is_being_repeated_is_cancelled_within_half_a_second(profile: str, call: Callable) -> None:
    person = Impatience()
    # three tries more would take another 0.9 s
    projector = open_projector(f"emulated:flat?profile={profile}&settle_ms=0&answer_ms=300", person.note)
    camera = open_camera("virtual:flat")
    projector.load([Black(), Black()])
    wake = fall_silent(projector.line)
    with pytest.raises(Cancelled):
        call(projector, person.check)
    assert person.waited_s < 0.5
    wake()
    projector.show(White())  # whatever the device did meanwhile
    assert camera.grab().pixels.mean() > 80
    projector.close()


def test_opening_a_silent_device_is_cancelled_within_half_a_second() -> None:
    person, profile = Impatience(), replace(read_profile("stripe-lines", 64, 64), answer_s=0.3)
    line = EmulatedLine(Emulator(profile, Stage(FlatScene())))
    fall_silent(line)
    with pytest.raises(Cancelled):
        SerialProjector(line.url, profile, person.note, check=person.check)
    assert person.waited_s < 0.5
    line.close()


def test_waiting_for_a_line_to_come_back_is_cancelled_within_half_a_second() -> None:
    def check() -> None:
        if time.monotonic() > start + 0.3:
            raise Cancelled

    projector = open_projector("emulated:flat")
    projector.load([White(), Black()])
    projector.line.close()
    start = time.monotonic()
    with pytest.raises(Cancelled):
        projector.step(0, check)
    assert time.monotonic() - start < 0.8
    projector.close()


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("fault", LINK_FAULTS)
@pytest.mark.parametrize("at", [9])
def test_every_fault_at_a_command_is_overcome_in_bounded_time(profile: str, fault: str, at: int) -> None:
    url = f"emulated:flat?profile={profile}&settle_ms=0&answer_ms=60&faults={fault}@{at}&fault_seed={at}"
    camera = open_camera("virtual:flat")
    start = time.monotonic()
    projector = open_projector(url)
    projector.load([White(), Line("x", 8, 8), Black()])
    for index in (0, 1, 2):
        projector.step(index)
    assert time.monotonic() - start < 5.0
    if fault not in ("repeated-pattern", "skipped-pattern", "slow-switching"):  # these only the image can tell
        assert camera.grab().pixels.mean() < 25
    projector.close()


def test_a_step_whose_answer_is_lost_is_not_made_twice() -> None:
    # commands: 0 identify, 1 lamp, 2 to 5 load, 6 query, 7 rewind, 8 step
    projector = open_projector("emulated:flat?profile=stripe-frames&settle_ms=0&answer_ms=60&faults=no-answer@8")
    camera = open_camera("virtual:flat")
    projector.load([Black(), White(), Black(), Black()])
    projector.step(1)
    assert camera.grab().pixels.mean() > 80
    projector.close()


@pytest.mark.parametrize("profile", PROFILES)
def test_a_device_that_was_reset_is_loaded_again(profile: str) -> None:
    told: list[str] = []
    projector = open_projector(f"emulated:flat?profile={profile}&settle_ms=0", lambda who, what: told.append(what))
    camera = open_camera("virtual:flat")
    projector.load(reference_sequence(64, 64))
    projector.line.emulator._power_on()
    projector.step(18)
    assert camera.grab().pixels.mean() > 80
    assert told[-1] == "restored"
    projector.close()


@pytest.mark.parametrize("name", PROFILES)
@pytest.mark.parametrize("seed", range(5))
def test_bodies_are_found_in_any_chunks_among_noise(name: str, seed: int) -> None:
    framing = read_profile(name).framing
    rng = np.random.default_rng(seed)
    bodies = [rng.integers(48, 58, rng.integers(1, 40)).astype(np.uint8).tobytes() for _ in range(20)]
    stream = b"".join(wrap(framing, body) for body in bodies)
    buffer, found, at = bytearray(), [], 0
    while at < len(stream):
        size = int(rng.integers(1, 9))
        buffer += stream[at : at + size]
        at += size
        while (body := unwrap(framing, buffer)) is not None:
            found.append(body)
    assert found == bodies


def test_profiles_come_with_the_program() -> None:
    assert set(profile_names()) >= set(PROFILES)


@pytest.mark.parametrize(
    ("change", "seen"),
    [
        (("[framing]", "[frame]"), "framing"),
        (('kind = "text"', 'kind = "morse"'), "morse"),
        (("baud = 115200", "baud = 0"), "baud"),
        (("retries = 3", "retries = -1"), "retries"),
        (('send = "{tag} SHOW {slot}"', 'send = "{tag} SHOW {page}"'), "page"),
        (("[commands.load]", "[commands.store]"), "load"),
        (("[commands.select]", "[commands.choose]"), "select"),
        (('send = "{tag} LOAD {slot} {plate} {lines}"', 'send = "{tag} LOAD {slot}"'), "lines"),
        (('send = "{tag} ID?"', 'send = "{tag ID?"'), "braces|fields as"),
        (("version = 1", "version = 2"), "version"),
        (('plates = ["C", "R"]', 'plates = ["C", "C"]'), "plates"),
        (("format =", "format ="), None),
    ],
)
def test_a_profile_of_ones_own_is_checked_entry_by_entry(tmp_path, change: tuple[str, str], seen: str | None) -> None:
    from core.resources import resource

    text = resource("profiles", "stripe-lines.toml").read_text()
    assert change[0] in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(*change, 1))
    if seen is None:
        assert read_profile(str(path)).name == "mine"
        return
    with pytest.raises(InputError, match=seen):
        read_profile(str(path))


@pytest.mark.parametrize("name", ["nobody", "missing.toml"])
def test_a_profile_that_does_not_exist_is_refused(name: str) -> None:
    with pytest.raises(InputError):
        read_profile(name)
