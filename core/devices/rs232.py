"""A projector on a serial line, spoken to by a command profile.

Every command ends within a bounded time: acknowledged, repeated and acknowledged, or as a `DeviceError` that says what
to check. A command that must not be repeated blindly (a step forward whose answer was lost) is followed by the question
where the device stands. A device that has lost its sequence is loaded again, a line that was cut is opened again.
Whoever waits may cancel meanwhile: the check that a call brings is asked between short reads.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import TypeVar

from core.devices.link import LineDownError, Link, unwrap, wrap
from core.devices.profile import MEANINGS, Profile
from core.devices.protocol import Check, Note, check_sequence, no_check, no_note, pattern_at, refuse_grey, wait_until
from core.devices.template import Value, Values, checksum, pack_lines
from core.errors import Cancelled, DeviceError
from core.patterns import CrossPatternLcd, Pattern

_REOPEN_S = 3.0  # for a line to come back
_RECOVERIES = 3  # of a lost line or sequence, in one call
T = TypeVar("T")


class _EmptyError(DeviceError):
    """The device says that nothing is stored where something was."""


class _UnansweredError(DeviceError):
    """No valid answer, however often the question was repeated."""


class SerialProjector:
    """A cross-pattern LCD projector on a serial line."""

    def __init__(
        self,
        url: str,
        profile: Profile,
        note: Note = no_note,
        *,
        settle_s: float | None = None,
        check: Check = no_check,
    ) -> None:
        self.name = f"projector {profile.name} on {url}"
        self.profile, self.url, self.note = profile, url, note
        self.settle_s = profile.settle_s if settle_s is None else settle_s
        self.capacity = profile.slots
        self.sequence: tuple[Pattern, ...] | None = None
        self._lcd = CrossPatternLcd(profile.columns, profile.rows)
        self._loaded: tuple[Pattern, ...] = ()
        self._buffer, self._tag, self._shown = bytearray(), 0, -1
        self._open = True
        self._cancel = no_check  # of the call that is under way
        self._link: Link | None = Link(url, profile.port)
        try:
            self._recovering(self._greet, check)
        except BaseException:
            self.close()
            raise

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows, in lines."""
        return self._lcd.width, self._lcd.height

    def refusal(self, pattern: Pattern) -> str | None:
        """Why this pattern cannot be shown."""
        return refuse_grey(pattern)

    def show(self, pattern: Pattern, check: Check = no_check) -> None:
        """Load one pattern and show it."""
        if self._loaded != (pattern,):
            self.load([pattern], check)
        self.step(0, check)

    def load(self, patterns: Sequence[Pattern], check: Check = no_check) -> None:
        """Store a sequence in the device."""
        self._check_open()
        self._loaded = check_sequence(self, patterns, check)
        self._recovering(self._send_sequence, check, reload=False)

    def step(self, index: int, check: Check = no_check) -> None:
        """Show a pattern of the loaded sequence."""
        self._check_open()
        pattern_at(self, self._loaded, index)
        self._recovering(lambda: self._go(index), check)

    def close(self) -> None:
        """Let the line go."""
        self._open = False
        if self._link is not None:
            self._link.close()
            self._link = None

    def _check_open(self) -> None:
        if not self._open:
            raise DeviceError(self.name, "closed", "open it again")

    # -------------------------------------------------------------------------------- what a call is made of

    def _greet(self) -> None:
        """See who is there."""
        self._settle_line()
        if "identify" in self.profile.commands:
            answer = self._ask("identify")
            told = tuple(int(answer.get(k, self.size[i])) for i, k in enumerate(("columns", "rows")))
            if told != self.size:
                raise DeviceError(
                    self.name,
                    f"has {told[0]}x{told[1]} lines, the profile says {self.size[0]}x{self.size[1]}",
                    "use the profile of this device, or give columns= and rows= in the URL",
                )
            self.capacity = min(self.capacity, int(answer.get("slots", self.capacity)))
        self._shown = -1

    def _send_sequence(self) -> None:
        """Switch the lamp on, load, and see that both have lasted: a device may be reset without a word."""
        self._shown = -1
        if "lamp" in self.profile.commands:
            self._ask("lamp", on=1)
        for slot, pattern in enumerate(self._loaded):
            self._cancel()
            plates = [pack_lines(lines, self.profile.first) for lines in self._lcd.switch(pattern)]
            if self.profile.both_plates:
                total = checksum(self.profile.lines_check, plates[0] + plates[1])
                self._ask("load", slot=slot, column_lines=plates[0], row_lines=plates[1], check=self._check(total))
                continue
            for plate, lines in zip(self.profile.plates, plates, strict=True):
                total = checksum(self.profile.lines_check, lines)
                self._ask("load", slot=slot, plate=plate, lines=lines, check=self._check(total))
        if "query" in self.profile.commands:
            state = self._ask("query")
            if int(state["loaded"]) < len(self._loaded) or int(state.get("on", 1)) == 0:
                raise _EmptyError(self.name, "was reset while it was loaded", "check its supply")

    def _check(self, value: int) -> Value:
        return value if self.profile.framing.kind == "frame" else f"{value:04X}"

    def _go(self, index: int) -> None:
        """Make the device show a slot: by its number, or by going there step by step."""
        if "select" in self.profile.commands:
            self._ask("select", slot=index)
            return
        at = self._shown if self._shown >= 0 else None
        for _ in range(2 * len(self._loaded) + 4):
            if at is None or at > index:
                at = self._move("rewind", 0)
            elif at == index and self._shown == index:
                return
            elif at < index:
                at = self._move("step", at + 1)
            self._shown = -1 if at is None else at
        raise DeviceError(self.name, f"does not get to pattern {index}", "switch it off and on, then start again")

    def _move(self, command: str, expected: int) -> int | None:
        """Move forward or to the start; without an answer ask where the device stands. None: it must be rewound."""
        try:
            return int(self._ask(command, once=command == "step", slot=expected).get("slot", expected))
        except _UnansweredError:
            if "query" not in self.profile.commands:
                return None
            state = self._ask("query")
            if int(state["loaded"]) < len(self._loaded):
                raise _EmptyError(self.name, "has lost its sequence", "check its supply") from None
            return int(state["slot"]) if int(state["slot"]) == expected else None

    # -------------------------------------------------------------------------------- one question, one answer

    def _ask(self, command: str, once: bool = False, **values: Value) -> dict[str, Value]:
        """Send a command until it is acknowledged.

        Raises
        ------
        DeviceError
            When the device refuses, or all tries stay without a valid answer.
        LineDownError
            When the line is gone.
        """
        patience = self.profile.load_s if command == "load" else self.profile.answer_s
        reason = "no answer"
        for attempt in range(1 if once else self.profile.retries + 1):
            if attempt:
                self._settle_line()
                self.note(self.name, f"{command}: {reason}, try {attempt + 1}")
            self._tag = self._tag % 250 + 1
            sent = {**values, "tag": self._tag if self.profile.framing.kind == "frame" else str(self._tag)}
            self._up.send(wrap(self.profile.framing, self.profile.commands[command].send.fill(sent)))
            answer, reason = self._answer(command, sent, time.monotonic() + patience)
            if answer is not None:
                return answer
            if reason == "empty":
                raise _EmptyError(self.name, f"{command}: nothing is stored there", "check the device's supply")
        self._settle_line()
        if reason in MEANINGS:
            reason = f"refused ({reason})"
        raise _UnansweredError(
            self.name,
            f"{command}: {reason}, {self.profile.retries + 1} times",
            "check that the projector is on, the cable, the baud rate and the profile",
        )

    def _answer(self, command: str, sent: Values, until_s: float) -> tuple[dict[str, Value] | None, str]:
        """Wait for the answer to a command; answers to earlier ones are passed over."""
        expect, reason = self.profile.commands[command].expect, "no answer"
        wrong: list[bytes] = []
        while True:
            body = unwrap(self.profile.framing, self._buffer, wrong)
            if wrong:
                reason = "wrong checksum"
                wrong.clear()
            if body is None:
                data = self._up.receive(until_s, self._cancel)
                if not data:
                    return None, reason
                self._buffer += data
                continue
            if (values := expect.match(body)) is not None:
                differing = [k for k in values if k in sent and str(values[k]) != str(sent[k])]
                if not differing:
                    return values, ""
                if "tag" not in differing:
                    return None, f"the answer has another {differing[0]}"
                reason = "an answer to another question"
            elif (values := self.profile.refusal.match(body)) is not None and _tag_agrees(values, sent):
                return None, self.profile.codes.get(_number(values.get("code")), "unknown")
            else:
                reason = "an answer that cannot be read"

    def _settle_line(self) -> None:
        """Let late answers and noise pass."""
        self._up.drain(self.profile.gap_s, self._cancel)
        self._buffer.clear()

    # -------------------------------------------------------------------------------- lost lines, lost sequences

    @property
    def _up(self) -> Link:
        if self._link is None:
            raise LineDownError(self.name, "the line is closed", "open the projector again")
        return self._link

    def _recovering(self, action: Callable[[], T], check: Check, reload: bool = True) -> T:
        """Do something; if the line or the sequence is lost, restore it and do it again, a bounded number of times."""
        self._cancel = check
        for recovery in range(_RECOVERIES + 1):
            try:
                if recovery:
                    self._restore(reload)
                return action()
            except Cancelled:
                self._loaded, self._shown = (), -1  # the answer will not be waited for: nobody knows what was done
                raise
            except (LineDownError, _EmptyError, _UnansweredError) as error:
                self.note(self.name, str(error))
                if recovery == _RECOVERIES or isinstance(error, _UnansweredError):
                    raise
        raise AssertionError("unreachable")

    def _restore(self, reload: bool) -> None:
        """Open the line anew if it is gone, and load again what the device has lost."""
        try:
            self._settle_line()
        except LineDownError:
            self._reopen()
        self._greet()
        if self._loaded and reload:
            self._send_sequence()
        self.note(self.name, "restored")

    def _reopen(self) -> None:
        if self._link is not None:
            self._link.close()
        end = time.monotonic() + _REOPEN_S
        while True:
            try:
                self._link = Link(self.url, self.profile.port)
                self._buffer.clear()
                return
            except LineDownError as error:
                if time.monotonic() > end:
                    raise DeviceError(
                        self.name, f"the line did not come back within {_REOPEN_S:g} s", "check cable and supply"
                    ) from error
                wait_until(time.monotonic() + 0.02, self._cancel)


def _tag_agrees(values: Values, sent: Values) -> bool:
    return "tag" not in values or str(values["tag"]) == str(sent["tag"])


def _number(value: Value | None) -> int:
    try:
        return int(value) if value is not None else -1
    except ValueError:
        return -1
