"""A projector made of bytes: understands the commands of a profile, switches a virtual stage, and errs on demand."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import takewhile

import numpy as np

from core.devices.faults import LINK_FAULTS, Faults
from core.devices.line.framing import unwrap, wrap
from core.devices.line.profile import Profile
from core.devices.line.template import Value, Values
from core.devices.scene import Lines
from core.devices.virtual import Stage
from core.patterns import Black

_BYTE_FAULTS = ("lost-byte", "flipped-byte")
SLOW = 10  # settle times that a slow switching takes


class HangUp(Exception):  # noqa: N818  not an error: what the emulated cable does
    """The line goes dead."""


@dataclass
class Emulator:
    """The device's side of the line.

    Examples
    --------
    >>> from core.devices.line.profiles import read_profile
    >>> from core.devices.scene import FlatScene
    >>> emulator = Emulator(read_profile("stripe-lines", 64, 64), Stage(FlatScene()))
    >>> emulator.feed(b"1 ID?\\r\\n")
    [(0.0, b'1 OK ID 64 64 64\\r\\n')]
    """

    profile: Profile
    stage: Stage  #: what its light falls on
    faults: Faults = field(default_factory=Faults)  #: one opportunity for every command that arrives
    refusals: dict[str, int] = field(init=False)

    def __post_init__(self) -> None:
        self._buffer = bytearray()
        self._random = random.Random(self.faults.seed)
        self.refusals = {meaning: code for code, meaning in self.profile.codes.items()}
        self._power_on()

    def _power_on(self) -> None:
        columns, rows = self.profile.columns, self.profile.rows
        self._slots: dict[int, tuple[Lines, Lines]] = {}
        self._chunks = bytearray()
        self._dark = np.zeros(columns, bool), np.zeros(rows, bool)
        self._slot, self._lamp = self.profile.first_slot, int("lamp" not in self.profile.commands)
        self.stage.switch(Black())

    def gap(self) -> None:
        """Nothing has come for a while: a frame that was not completed is given up."""
        if self.profile.framing.kind == "frame":
            self._buffer.clear()

    def feed(self, data: bytes) -> list[tuple[float, bytes]]:
        """Take bytes; give answers, each with the delay in s after which it is sent; HangUp when the line goes dead."""
        self._buffer += data
        answers = []
        while (body := unwrap(self.profile.framing, self._buffer)) is not None:
            fault = self.faults.next(LINK_FAULTS)
            if fault in _BYTE_FAULTS:
                self._buffer[:0] = self._damage(wrap(self.profile.framing, body), fault)
                body = unwrap(self.profile.framing, self._buffer)
                fault = None
                if body is None:
                    break
            answers += self._commit(body, fault)
        return answers

    def _damage(self, raw: bytes, fault: str) -> bytes:
        at = self._random.randrange(len(raw))
        if fault == "lost-byte":
            return raw[:at] + raw[at + 1 :]
        return raw[:at] + bytes([raw[at] ^ (1 << self._random.randrange(7))]) + raw[at + 1 :]

    def _commit(self, body: bytes, fault: str | None) -> list[tuple[float, bytes]]:
        """Carry a command out, with a fault."""
        if fault == "lost-command":
            return []
        if fault == "reset":
            self._power_on()
            return []
        if fault == "hang-up":
            raise HangUp
        profile = self.profile
        answers = self._refuse(body, "busy") if fault == "refused" else self._execute(body, fault)
        if answers is None or fault == "no-answer":
            return []
        raw = b"".join(wrap(profile.answers, answer) for answer in answers)
        if fault == "garbage":
            raw = self._random.randbytes(len(raw))
        elif fault == "half-reply":
            raw = raw[: len(raw) // 2]
        elif fault == "wrong-checksum":
            last = len(raw) - 1 - len(profile.answers.end)  # byte of the check value
            raw = raw[:last] + bytes([raw[last] ^ 1]) + raw[last + 1 :]
        raw = wrap(profile.answers, body) * profile.echo + raw + profile.answers.prompt
        return [(2.5 * profile.answer_s if fault == "late-answer" else 0.0, raw)]

    def _execute(self, body: bytes, fault: str | None) -> list[bytes] | None:
        """Give what is answered, in one message or several; None: nothing at all."""
        for name, steps in self.profile.commands.items():
            asked = ((s, v) for s in steps if s.send and (v := s.send.match(body)) is not None)
            step, values = next(asked, (None, {}))
            if step is None:
                continue
            if step.expect is None:
                return [] if step.prompted else None
            actions: dict[str, Callable[[Values], str | dict[str, Value]]] = {
                "identify": lambda v: {"columns": self.profile.columns, "rows": self.profile.rows},
                "lamp": self._switch_lamp,
                "load": self._load,
                "select": lambda v: self._show(int(v["slot"]), fault),
                "rewind": lambda v: self._show(self.profile.first_slot, fault),
                "step": lambda v: self._show(self._slot + 1, fault),
                "run": lambda v: self._sequence(int(v["count"]), int(v["period_us"]) / 1e6),
                "follow": lambda v: self._sequence(int(v["count"])),
            }
            outcome = actions[name](values) if name in actions else {}
            if isinstance(outcome, str):
                return self._refuse(body, outcome)
            state: dict[str, Value] = {
                "slot": self._slot,
                "slots": self.profile.slots,
                "loaded": len(self._slots),
                "on": self._lamp,
                "tag": 0,
            }
            unasked = takewhile(lambda s: s.send is None, steps[steps.index(step) + 1 :])
            told = {**state, **values, **outcome}
            return [s.expect.fill(told) for s in (step, *unasked) if s.expect]
        return self._refuse(body, "unknown")

    def _refuse(self, body: bytes, meaning: str) -> list[bytes] | None:
        """Say no, with the tag of the command as far as it can be read."""
        if not self.profile.refusals:
            return None
        code = self.refusals.get(meaning, 0)
        matched = (s.send.match(body) for steps in self.profile.commands.values() for s in steps if s.send)
        tag: Value = next((values.get("tag", 0) for values in matched if values is not None), 0)
        if tag == 0 and self.profile.framing.kind == "text":
            head = body.split(b" ", 1)[0]
            tag = int(head) if head.isdigit() else 0
        elif tag == 0 and body:
            tag = body[0]
        return [self.profile.refusals[0].fill({"tag": tag, "code": code, "text": meaning})]

    def _switch_lamp(self, values: Values) -> dict[str, Value]:
        self._lamp = int(values["on"])
        return {}

    def _load(self, values: Values) -> str | dict[str, Value]:
        slot, profile = int(values["slot"]), self.profile
        if not 0 <= slot - profile.first_slot < profile.slots:
            return "range"
        sent = {"x": "column_lines", "y": "row_lines"}
        if not profile.both_plates:
            axis = values.get("axis") or profile.axis
            if not profile.by_axis:
                plates, plate = [*map(str, profile.plates)], str(values["plate"])
                if plate not in plates:
                    return "range"
                axis = "xy"[plates.index(plate)]
            sent = {str(axis): "lines"}
        held = dict(zip("xy", self._slots.get(slot, self._dark), strict=True))
        if profile.by_axis:
            held = dict(zip("xy", self._dark, strict=True))
        check = profile.lines_check.of(b"".join(_bytes(values[n]) for n in sent.values()))
        for axis, name in sent.items():
            count, data = {"x": profile.columns, "y": profile.rows}[axis], _bytes(values[name])
            size = -(-count * profile.bits.depth // 8)
            if profile.chunk:
                if int(values["offset"]) > len(self._chunks):
                    return "damaged"
                self._chunks[int(values["offset"]) :] = data
                data = bytes(self._chunks)
                if len(data) < size:
                    return {"check": check}
            if len(data) != size:
                return "damaged"
            if profile.bits.depth == 8:
                return "range"  # the stage behind it is lit by lines that are on or off
            held[axis] = profile.bits.unpack(data, count)
        self._slots[slot] = (held["x"], held["y"])
        return {"check": check}

    def _show(self, slot: int, fault: str | None) -> str | dict[str, Value]:
        """Show a slot, and tell which; with a fault tell the same and show another."""
        if slot not in self._slots:
            return "empty"
        self._slot = slot
        first = self.profile.first_slot
        shown = (slot + 1 - first) % len(self._slots) + first if fault == "skipped-pattern" else slot
        if fault != "repeated-pattern" and self._lamp:
            delay = SLOW * max(self.profile.settle_s, 0.002) if fault == "slow-switching" else 0.0
            self.stage.switch(self._slots.get(shown, self._dark), delay)
        return {"slot": slot}

    def _sequence(self, count: int, period_s: float = 0.0) -> str | dict[str, Value]:
        """Let the first slots go by the clock, or by triggers where there is no period."""
        slots = range(self.profile.first_slot, self.profile.first_slot + count)
        if any(slot not in self._slots for slot in slots):
            return "empty"
        lights = [self._slots[slot] if self._lamp else self._dark for slot in slots]
        if period_s:
            self.stage.run(lights, period_s)
        else:
            self.stage.follow(lights)
        return {}


def _bytes(value: Value) -> bytes:
    return value if isinstance(value, bytes) else b""
