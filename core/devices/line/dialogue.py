"""A conversation with a device by a command profile: questions, answers, repetitions, and waiting for a state.

Every command ends within a bounded time: acknowledged, repeated and acknowledged, or as a `DeviceError` that says what
to check. Whoever waits may cancel meanwhile: the check that a call brings is asked between short reads.
"""

from __future__ import annotations

import time
from contextlib import suppress

from core.devices.line.framing import unwrap, wrap
from core.devices.line.link import LineDownError, Link
from core.devices.line.profile import MEANINGS, Profile, Step
from core.devices.line.template import Template, Value, Values, calculated, room_of, takes_anything
from core.devices.protocol import Check, Note, no_check, no_note, wait_until
from core.errors import DeviceError, NotThereError

_REOPEN_S = 3.0  # for a line to come back
_SHOWN_BYTES = 24  # of an answer that cannot be read
_TAGS = 250  # different ones, or as many as the commands have room for


class EmptyError(DeviceError):
    """The device says that nothing is stored where something was."""


class UnansweredError(DeviceError):
    """No valid answer, however often the question was repeated."""


class RefusedError(UnansweredError):
    """The device says no, and not that it is busy."""


class Dialogue:
    """A line and the profile that is spoken on it.

    `asked` counts the questions, `repeats` those that had to be put again, `heard` the last bytes that came; `answered`
    is true once a question was.
    """

    def __init__(self, url: str, profile: Profile, note: Note = no_note) -> None:
        self.name = f"projector {profile.name} on {url}"
        self.url, self.profile, self.note = url, profile, note
        self.cancel: Check = no_check  # of the call that is under way
        self.asked, self.repeats, self.answered = 0, 0, False
        self.sent, self.heard = b"", bytearray()
        self._buffer, self._tag = bytearray(), 0
        sent = [step.send for steps in profile.commands.values() for step in steps if step.send is not None]
        self._tags = min([_TAGS, *(room for each in sent if (room := room_of(each, "tag")) is not None)])
        try:
            self._link: Link | None = Link(url, profile.port)
        except LineDownError as error:
            raise NotThereError(*error.args) from error

    def do(self, command: str, once: bool = False, **values: Value) -> dict[str, Value]:
        """Go through the steps of a command; give all that was answered. One that is not in the profile does nothing.

        DeviceError when the device refuses, all tries stay without a valid answer, or the state that is waited for does
        not come; LineDownError when the line is gone.
        """
        told: dict[str, Value] = {}
        for step in self.profile.commands.get(command, ()):
            told |= self.take(command, step, once, values)
        return told

    def take(self, command: str, step: Step, once: bool, values: Values) -> dict[str, Value]:
        """Take one step of a command, again and again while its state has to be waited for.

        A device that has answered before may be silent or busy meanwhile, as some are while their lamp starts.
        """
        end = time.monotonic() + step.within_s
        while True:
            late = time.monotonic() > end
            try:
                told = self._ask(command, step, once, values)
            except UnansweredError as error:
                if late or not step.until or not self.answered or isinstance(error, RefusedError):
                    raise
                wait_until(time.monotonic() + step.every_s, self.cancel)
                continue
            waiting = [key for key, wanted in step.until.items() if calculated(key, told) not in wanted]
            if not waiting:
                wait_until(time.monotonic() + step.pause_s, self.cancel)
                return told
            if late:
                seen = f"{waiting[0]} is {calculated(waiting[0], told)} after {step.within_s:g} s"
                wanted = ", ".join(map(str, step.until[waiting[0]]))
                raise DeviceError(
                    self.name, f"{command}: {seen}, {wanted} was waited for", "look what the device waits for"
                )
            wait_until(time.monotonic() + step.every_s, self.cancel)

    def _ask(self, command: str, step: Step, once: bool, values: Values) -> dict[str, Value]:
        """Send a command until it is acknowledged."""
        reason = "no answer"
        patience = step.answer_s or (self.profile.load_s if command == "load" else self.profile.answer_s)
        tries = 1 if once or step.send is None else self.profile.retries + 1
        for attempt in range(tries):
            if attempt:
                self.settle()
                self.repeats += 1
                self.note(self.name, f"{command}: {reason}, try {attempt + 1}")
            self.asked += 1
            if step.send is not None:  # what comes unasked has the last one
                self._tag = self._tag % self._tags + 1
            sent = {**values, "tag": self._tag}
            self.sent, self.heard = b"", bytearray()
            if step.send is not None:
                self.sent = self._filled(command, step.send, sent)
                self.up.send(self.sent, self.cancel)
            if step.expect is None and not step.prompted:
                return {}
            answer, reason = self._answer(step, sent, time.monotonic() + patience)
            if answer is not None:
                self.answered = True
                return answer
            if reason == "empty":
                raise EmptyError(self.name, f"{command}: nothing is stored there", "check the device's supply")
        error = RefusedError if reason in MEANINGS and reason != "busy" else UnansweredError
        try:
            self.settle()
        except LineDownError:
            if error is not RefusedError:  # it may hang up on whom it refuses
                raise
        told = f"refused ({reason})" if reason in MEANINGS else reason
        raise error(
            self.name,
            f"{command}: {told}" + f", {tries} times" * (tries > 1),
            "check that the projector is on, the cable, the baud rate and the profile",
        )

    def _filled(self, command: str, template: Template, values: Values) -> bytes:
        try:
            return wrap(self.profile.framing, template.fill(values))
        except ValueError as error:
            raise DeviceError(self.name, f"{command}: {error}", "give the field more room in the profile") from error

    def _answer(self, step: Step, sent: Values, until_s: float) -> tuple[dict[str, Value] | None, str]:
        """Wait for the answer to a command; answers to earlier ones are passed over."""
        reason = "no answer"
        wrong: list[bytes] = []
        echo = self.profile.echo and step.send is not None
        while True:
            echo = echo and not self._past_echo()
            body = unwrap(self.profile.answers, self._buffer, wrong)
            if wrong:
                reason = "wrong checksum"
                wrong.clear()
            if body is None:
                if step.prompted and self.profile.answers.prompt in self._buffer:
                    self._await_prompt(until_s)
                    return {}, ""
                data = self.up.receive(until_s, self.cancel)
                if not data:
                    rest = self._buffer[:_SHOWN_BYTES].hex(" ")
                    return None, f"bytes that cannot be read ({rest})" if rest and reason == "no answer" else reason
                self._buffer += data
                self.heard += data
                continue
            refused = self._refused(body, sent)
            expect = step.expect
            if refused is not None and expect is not None and takes_anything(expect):
                expect = None  # it says no, whatever else it might be
            if echo and step.send is not None and body == step.send.fill(sent):
                echo = False
            elif expect is not None and (values := expect.match(body)) is not None:
                differing = [k for k in values if _base(k) in sent and not _same(calculated(k, sent), values[k])]
                if not differing:
                    self._await_prompt(until_s)
                    return values, ""
                if "tag" not in differing:
                    told, meant = (shown(v) for v in (values[differing[0]], calculated(differing[0], sent)))
                    return None, f"the answer says {differing[0]} {told} in place of {meant}"
                reason = "an answer to another question"
            elif refused is not None:
                self._await_prompt(until_s)
                return None, refused
            else:
                reason = f"an answer that cannot be read ({body[:_SHOWN_BYTES].hex(' ')})"

    def _past_echo(self) -> bool:
        """Take what was sent out of the bytes that came, with its own end or with that of answers."""
        ends = {self.profile.framing.end, self.profile.answers.end}
        stem = self.sent.removesuffix(self.profile.framing.end)
        for end in sorted(ends, key=len, reverse=True):
            more = [e for e in ends if e != end and e.startswith(end) and len(self._buffer) < len(stem + e)]
            if self._buffer.startswith(stem + end) and not more:
                del self._buffer[: len(stem + end)]
                return True
        return False

    def _refused(self, body: bytes, sent: Values) -> str | None:
        """Say what a refusal means; None where a body is none of this question."""
        values = next((v for r in self.profile.refusals if (v := r.match(body)) is not None), None)
        if values is None or values.get("tag", sent["tag"]) != sent["tag"]:
            return None
        code = values.get("code")
        return self.profile.codes.get(code, "unknown") if isinstance(code, int) else "unknown"

    def _await_prompt(self, until_s: float) -> None:
        """Wait until a device that says so is ready for the next line."""
        prompt = self.profile.answers.prompt
        while prompt and prompt not in self._buffer:
            data = self.up.receive(until_s, self.cancel)
            if not data:
                return
            self._buffer += data
        if prompt:
            del self._buffer[: self._buffer.index(prompt) + len(prompt)]

    def settle(self) -> None:
        """Let late answers and noise pass."""
        self.up.drain(self.profile.gap_s, self.cancel)
        self._buffer.clear()

    # ------------------------------------------------------------------------------------------- the line itself

    @property
    def up(self) -> Link:
        if self._link is None:
            raise LineDownError(self.name, "the line is closed", "open the projector again")
        return self._link

    def restore(self) -> None:
        """See that the line is there and quiet, and open it anew if it is gone."""
        try:
            self.settle()
        except LineDownError:
            self._reopen()

    def _reopen(self) -> None:
        identity = None
        if self._link is not None:
            identity = self._link.identity
            self._link.close()
        end = time.monotonic() + _REOPEN_S
        while True:
            try:
                self._link = Link(self.url, self.profile.port, identity)
                if self._link.place != self.url:
                    self.note(self.name, f"came back as {self._link.place}")
                self._buffer.clear()
                return
            except LineDownError as error:
                if time.monotonic() > end:
                    raise DeviceError(
                        self.name, f"the line did not come back within {_REOPEN_S:g} s", "check cable and supply"
                    ) from error
                wait_until(time.monotonic() + 0.02, self.cancel)

    def close(self) -> None:
        """Go through the commands that switch the device off, as far as it answers, and let the line go."""
        link, self.cancel = self._link, no_check
        if link is not None:
            if "stop" in self.profile.commands:
                with suppress(DeviceError):
                    self.do("stop")
            link.close()
            self._link = None


def shown(value: Value) -> str:
    """Write a value down, bytes in hexadecimal."""
    return value[:_SHOWN_BYTES].hex(" ") if isinstance(value, bytes) else str(value)


def _same(sent: Value, told: Value) -> bool:
    """Tell whether a field came back as it was sent; a number may come back as text."""
    return sent == told or str(sent) == str(told)


def _base(name: str) -> str:
    """Give the field that a calculated value belongs to."""
    return next(part for part in [name.split(sign)[0] for sign in "+-*/%&"] if part.isidentifier())
