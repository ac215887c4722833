"""A serial line that is held, or that is lost again and again."""

import os
import pty
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from core.devices import open_projector
from core.devices.line import link
from core.devices.line.link import LineDownError, Link
from core.devices.line.profile import Port
from core.errors import Cancelled, DeviceError, InputError

XON, XOFF = b"\x11", b"\x13"
PORT = Port(9600, 8, "none", 1, "xonxoff")


@pytest.fixture
def line() -> Iterator[tuple[int, Link]]:
    """The device's end of a line with XON/XOFF, and the host's."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    opened = Link(os.ttyname(theirs), PORT)
    yield ours, opened
    opened.close()
    os.close(ours)
    os.close(theirs)


def test_a_line_that_is_held_is_left_at_once_when_the_work_is_cancelled(line: tuple[int, Link]) -> None:
    ours, opened = line
    os.write(ours, XOFF)
    begun = time.monotonic()

    def check() -> None:
        if time.monotonic() > begun + 0.1:
            raise Cancelled

    with pytest.raises(Cancelled):
        opened.send(b"LOAD 1", check)
    assert time.monotonic() - begun < 0.5  # two seconds before, of pyserial's own waiting


def test_what_a_held_line_was_sent_arrives_whole_once_it_goes_on(line: tuple[int, Link]) -> None:
    ours, opened = line
    os.write(ours, XOFF)
    sender = threading.Timer(0.1, os.write, (ours, XON))
    sender.start()
    opened.send(b"LOAD 1 C 0F0F\r")
    sender.join()
    assert os.read(ours, 100) == b"LOAD 1 C 0F0F\r"


def test_a_device_that_has_all_and_holds_the_line_while_it_works_is_waited_for(
    line: tuple[int, Link], monkeypatch
) -> None:
    """For pyserial, which then asks whether more could be sent, this is a line that is down."""
    ours, opened = line
    monkeypatch.setattr(link, "_WRITE_S", 0.05)
    write = os.write

    def written_then_held(number: int, data: bytes) -> int:
        count = write(number, data)
        if number != ours:
            write(ours, XOFF)
        return count

    monkeypatch.setattr(link.os, "write", written_then_held)
    opened.send(b"ON\r")
    monkeypatch.undo()
    os.write(ours, XON + b"P")
    assert os.read(ours, 100) == b"ON\r"
    assert opened.receive(time.monotonic() + 1.0) == b"P"


def test_a_line_that_is_held_for_good_says_so(line: tuple[int, Link], monkeypatch) -> None:
    ours, opened = line
    monkeypatch.setattr(link, "_WRITE_S", 0.05)
    os.write(ours, XOFF)
    with pytest.raises(LineDownError, match=r"does not take bytes \(the other end takes no more bytes\)"):
        opened.send(b"LOAD 1")


def test_a_line_that_is_lost_again_and_again_is_told_in_words_of_ones_own(tmp_path: Path) -> None:
    """What pyserial says of it, "device reports readiness to read but returned no data", names no cause."""
    name, there, end = tmp_path / "port", threading.Event(), threading.Event()

    def serve() -> None:
        while not end.is_set():
            ours, theirs = pty.openpty()
            tty.setraw(theirs)
            (tmp_path / "next").symlink_to(os.ttyname(theirs))
            (tmp_path / "next").replace(name)  # there is a port of this name at any time
            there.set()
            os.set_blocking(ours, False)
            while not end.is_set():
                with suppress(BlockingIOError):
                    if os.read(ours, 100):
                        break
                time.sleep(0.001)
            os.close(ours)
            os.close(theirs)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    assert there.wait(10)
    try:
        with pytest.raises(DeviceError, match=r"\(it was unplugged, .*\), for the 4th time .*check plugs") as told:
            open_projector(f"serial:{name}?profile=stripe-lines")
    finally:
        end.set()
        thread.join()
    assert "readiness" not in str(told.value)


@pytest.mark.parametrize(
    ("said", "told"),  # of pyserial's sources for Windows, sockets and POSIX
    [
        ("ClearCommError failed (PermissionError(13, 'The device does not recognize the command.'))", "unplugged"),
        ("WriteFile failed (OSError(22, 'x'))", "unplugged"),
        ("socket disconnected", "closed the connection"),
        ("Attempting to use a port that is not open", "closed meanwhile"),
    ],
)
def test_words_of_other_systems_are_told_as_plainly(line: tuple[int, Link], monkeypatch, said: str, told: str) -> None:
    import serial

    def fails(count: int) -> bytes:
        raise serial.SerialException(said)

    monkeypatch.setattr(line[1]._port, "read", fails)
    with pytest.raises(LineDownError, match=told):
        line[1].receive(time.monotonic() + 0.1)


def test_a_port_that_is_not_there_says_what_the_system_says(tmp_path: Path) -> None:
    with pytest.raises(LineDownError, match=r"cannot be opened \(No such file or directory\)"):
        Link(str(tmp_path / "ttyUSB0"), PORT)


@pytest.mark.parametrize("place", ["socket://127.0.0.1:", "socket://127.0.0.1", "rfc2217://127.0.0.1:99999"])
def test_an_address_needs_a_port(place: str) -> None:
    """For pyserial, '<=' was "not supported between instances of 'int' and 'NoneType'"."""
    with pytest.raises(InputError, match="give the port that the other end listens at"):
        Link(place, PORT)


def test_an_error_that_pyserial_wraps_keeps_what_the_system_says(line: tuple[int, Link], monkeypatch) -> None:
    import serial

    def fails(count: int) -> bytes:
        try:
            raise OSError(5, "Input/output error")
        except OSError as error:
            raise serial.SerialException(f"read failed: {error}")  # noqa: B904  as pyserial does

    monkeypatch.setattr(line[1]._port, "read", fails)
    with pytest.raises(LineDownError, match=r"\(Input/output error\)"):
        line[1].receive(time.monotonic() + 0.1)
