"""The emulated projector behind a pseudo-terminal or a socket, in a thread of its own; the device it makes."""

from __future__ import annotations

import os
import sched
import select
import socket
import tempfile
import threading
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from core.devices.faults import Faults
from core.devices.line.emulator import Emulator, HangUp
from core.devices.line.profile import Profile
from core.devices.line.rs232 import SerialProjector
from core.devices.protocol import Check, Note, no_check, no_note
from core.devices.virtual import Stage
from core.errors import InputError

DEAD_S = 0.05  # how long the line stays away after a hang-up
_GRAIN_S = 0.02  # of waiting for bytes


class _Pty:
    """A pseudo-terminal under a name that survives hang-ups."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="stripe-projector-")
        self.url = str(Path(self._folder.name) / "port")
        self._ends: list[int] = []
        self.restore()

    def restore(self) -> None:
        import tty

        self._ends = list(os.openpty())  # both kept open: reading never fails while nobody is connected
        self._ours, theirs = self._ends
        tty.setraw(theirs)
        os.set_blocking(self._ours, False)
        with suppress(FileNotFoundError):
            os.unlink(self.url)
        os.symlink(os.ttyname(theirs), self.url)

    def receive(self, wait_s: float) -> bytes:
        ready, _, _ = select.select([self._ours], [], [], wait_s)
        return os.read(self._ours, 4096) if ready else b""

    def send(self, data: bytes) -> None:
        with suppress(BlockingIOError):  # nobody reads: a device loses what does not fit
            os.write(self._ours, data)

    def cut(self) -> None:
        with suppress(OSError):
            os.unlink(self.url)
        while self._ends:
            os.close(self._ends.pop())

    def close(self) -> None:
        self.cut()
        self._folder.cleanup()


class _Socket:
    """A TCP socket that one host at a time may connect to."""

    def __init__(self) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._host: socket.socket | None = None
        self.url = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"

    def restore(self) -> None:
        """The next host may connect."""

    def receive(self, wait_s: float) -> bytes:
        source = self._host or self._listener
        ready, _, _ = select.select([source], [], [], wait_s)
        if not ready:
            return b""
        if self._host is None:
            self._host, _ = self._listener.accept()
            return b""
        try:
            data = self._host.recv(4096)
        except OSError:
            data = b""
        if not data:
            self.cut()
        return data

    def send(self, data: bytes) -> None:
        if self._host is not None:
            try:
                self._host.sendall(data)
            except OSError:
                self.cut()

    def cut(self) -> None:
        if self._host is not None:
            self._host.close()
            self._host = None

    def close(self) -> None:
        self.cut()
        self._listener.close()


class EmulatedLine:
    """An emulator that answers on a line until it is closed; `url` is what a host opens."""

    def __init__(self, emulator: Emulator, kind: str = "pty") -> None:
        if kind == "pty" and not hasattr(os, "openpty"):
            raise InputError("line", "no pseudo-terminals on this system", "use line=socket")
        self.emulator = emulator
        self._line = _Pty() if kind == "pty" else _Socket()
        self.url = self._line.url
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="emulated projector", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop answering; a second call does nothing."""
        if not self._end.is_set():
            self._end.set()
            self._thread.join()
            self._line.close()

    def _serve(self) -> None:
        waiting, last = sched.scheduler(), time.monotonic()
        while not self._end.is_set():
            next_s = waiting.run(blocking=False)
            data = self._line.receive(_GRAIN_S if next_s is None else min(_GRAIN_S, next_s))
            if not data:
                if time.monotonic() - last > _GRAIN_S:
                    self.emulator.gap()
                continue
            last = time.monotonic()
            try:
                for delay_s, answer in self.emulator.feed(data):
                    waiting.enter(delay_s, 0, self._line.send, (answer,))
            except HangUp:
                waiting = sched.scheduler()
                self._line.cut()
                self._end.wait(DEAD_S)
                self._line.restore()


class EmulatedProjector(SerialProjector):
    """A serial projector that brings the other end of its line along."""

    def __init__(
        self,
        stage: Stage,
        profile: Profile,
        faults: Faults,
        line: str = "pty",
        note: Note = no_note,
        settle_s: float | None = None,
        check: Check = no_check,
    ) -> None:
        if "load" not in profile.commands:
            remedy = "emulate one that is loaded, as stripe-lines; try this one on its device with `stripe-core probe`"
            raise InputError(profile.name, "patterns are not loaded by this profile", remedy)
        settle_s = profile.settle_s if settle_s is None else settle_s
        stage.switching_s = settle_s
        # a pseudo-terminal has no parity and refuses to be told of one
        profile = replace(profile, port=replace(profile.port, parity="none", bits=8, stop=1.0))
        self.line = EmulatedLine(Emulator(replace(profile, settle_s=settle_s), stage, faults), line)
        try:
            super().__init__(self.line.url, profile, note, settle_s=settle_s, check=check)
        except BaseException:
            self.line.close()
            raise

    def close(self) -> None:
        """Let both ends of the line go."""
        super().close()
        self.line.close()
