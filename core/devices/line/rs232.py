"""A projector on a serial line, spoken to by a command profile.

A command that must not be repeated blindly (a step forward whose answer was lost) is followed by the question where
the device stands. A device that has lost its sequence is loaded again, a line that was cut is opened again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from core.devices.line.dialogue import Dialogue, EmptyError, UnansweredError
from core.devices.line.link import LineDownError
from core.devices.line.profile import Profile
from core.devices.line.template import Template, Value, calculated, no_room
from core.devices.protocol import Check, Note, check_sequence, no_check, no_note, pattern_at, refuse_grey
from core.errors import Cancelled, DeviceError, InputError
from core.patterns import CrossPatternLcd, Pattern, axis_of, brightness, reference_sequence
from core.patterns.kinds.kind import fields_of

_RECOVERIES = 3  # of a lost line or sequence, in one call
_MANY = 4096  # patterns that need no place in the device
ROUNDED = 0.001  # of a period: a tenth of a line in a hundred
T = TypeVar("T")


class SerialProjector:
    """A projector on a serial line: its patterns are loaded, stand in it beforehand, or are described to it."""

    def __init__(
        self,
        url: str,
        profile: Profile,
        note: Note = no_note,
        *,
        settle_s: float | None = None,
        check: Check = no_check,
    ) -> None:
        if not profile.shows:
            remedy = f"use it beside a screen: screen:1?control={url}&profile={profile.name}"
            raise InputError(profile.name, "switches a projector and shows no patterns", remedy)
        self.profile, self.url, self.note = profile, url, note
        self.size = profile.columns, profile.rows
        self.settle_s = profile.settle_s if settle_s is None else settle_s
        self.period_s = profile.period_s if profile.goes("run") else 0.0
        self.can_follow = profile.goes("follow")
        self.capacity = profile.slots if "load" in profile.commands or profile.listed else _MANY
        self.sequence: tuple[Pattern, ...] | None = tuple(profile.stored) or None
        if "load" in profile.commands and len(profile.plates) == 1:
            whole = reference_sequence(profile.columns, profile.rows)
            self.sequence = tuple(p for p in whole if axis_of(p) in (None, profile.axis))
        self._loaded: tuple[Pattern, ...] = ()
        self._shown, self._open = -1, True
        self._listed: tuple[object, ...] = ()  # by which entries the sequence goes, its period, and the sequence
        self.dialogue = Dialogue(url, profile, note)
        self.name = self.dialogue.name
        try:
            self._recovering(self._greet, check)
        except BaseException:
            self.close()
            raise

    @property
    def repeats(self) -> tuple[int, int]:
        """How many questions had to be repeated, of how many."""
        return self.dialogue.repeats, self.dialogue.asked

    def refusal(self, pattern: Pattern) -> str | None:
        profile = self.profile
        if "load" in profile.commands:
            if len(profile.plates) == 1 and axis_of(pattern) not in (None, profile.axis):
                return f"it has lines along {profile.axis} only"
            return refuse_grey(pattern) if profile.bits.depth == 1 else None
        if profile.stored:
            return None if pattern in profile.stored else "it is not among the patterns that are stored in the device"
        if f"show-{pattern.kind}" not in profile.commands:
            return f"the profile has no command show-{pattern.kind}"
        return _unsaid(profile, pattern)

    def show(self, pattern: Pattern, check: Check = no_check) -> None:
        if self._loaded != (pattern,):
            self.load([pattern], check)
        self.step(0, check)

    def load(self, patterns: Sequence[Pattern], check: Check = no_check) -> None:
        self._check_open()
        self._loaded = check_sequence(self, patterns, check)
        if "load" in self.profile.commands:
            self._recovering(self._send_sequence, check, reload=False)

    def step(self, index: int, check: Check = no_check) -> None:
        self._check_open()
        pattern = pattern_at(self, self._loaded, index)
        if not self.profile.stored and "load" not in self.profile.commands:
            self._recovering(lambda: self.dialogue.do(f"show-{pattern.kind}", **described(pattern)), check)
            return
        self._listed = ()
        slot = self.profile.stored[pattern] if self.profile.stored else self.profile.first_slot + index
        self._recovering(lambda: self._go(slot), check)

    def run(self, check: Check = no_check) -> None:
        self._begin("run", self.period_s, check)

    def follow(self, period_s: float, check: Check = no_check) -> None:
        self._begin("follow", period_s, check)

    def _begin(self, command: str, period_s: float, check: Check) -> None:
        """Let the loaded sequence go by a clock or by triggers; never asked twice, it may have begun."""
        self._check_open()
        self._shown = -1
        period_us, entry = round(1e6 * period_s), "follow-entry" if command == "follow" else "entry"
        if self.profile.listed and self._listed != (entry, period_us, self._loaded):
            self._recovering(lambda: self._list(entry, period_us), check)
            self._listed = entry, period_us, self._loaded
        self.dialogue.cancel = check
        self.dialogue.do(command, once=True, count=len(self._loaded), period_us=period_us)

    def close(self) -> None:
        self._open = False
        self.dialogue.close()

    def _check_open(self) -> None:
        if not self._open:
            raise DeviceError(self.name, "closed", "open it again")

    # -------------------------------------------------------------------------------- what a call is made of

    def _list(self, entry: str, period_us: int) -> None:
        """Write the table of a sequence of stored patterns: images in the order they are needed, then the patterns."""
        profile, images, entries = self.profile, list[int](), list[tuple[int, bool]]()
        for pattern in self._loaded:
            slot = profile.stored[pattern]
            swap = not images or images[-1] != slot // profile.per_image
            entries.append((slot, swap))
            images += [slot // profile.per_image] * swap
        whole: dict[str, Any] = {
            "count": len(entries),
            "shown": len(entries),
            "images": len(images),
            "period_us": period_us,
        }
        self.dialogue.do("table", **whole)
        for place, image in enumerate(images[::-1] if profile.two_swapped and len(images) == 2 else images):
            self.dialogue.do("image", place=place, image=image)
        for place, (slot, swap) in enumerate(entries):
            self.dialogue.do(entry, place=place, slot=slot, swap=int(swap), period_us=period_us)
        self.dialogue.do("ready", **whole)

    def _greet(self) -> None:
        """Start the device, and see who is there."""
        self.dialogue.settle()
        self.dialogue.do("start")
        answer = self.dialogue.do("identify")
        told = tuple(_whole(answer.get(k, self.size[i])) for i, k in enumerate(("columns", "rows")))
        if told != self.size:
            raise DeviceError(
                self.name,
                f"has {told[0]}x{told[1]} lines, the profile says {self.size[0]}x{self.size[1]}",
                "use the profile of this device, or give columns= and rows= in the URL",
            )
        self.capacity = min(self.capacity, _whole(answer.get("slots", self.capacity)))
        if "load" not in self.profile.commands:
            self.dialogue.do("lamp", on=1)
        self._shown = -1

    def _send_sequence(self) -> None:
        """Switch the lamp on, load, and see that both have lasted: a device may be reset without a word."""
        self._shown = -1
        self.dialogue.do("lamp", on=1)
        for slot, pattern in enumerate(self._loaded, self.profile.first_slot):
            self.dialogue.cancel()
            for values in load_values(self.profile, pattern):
                self.dialogue.do("load", slot=slot, **values)
        if "query" in self.profile.commands:
            state = self.dialogue.do("query")
            if _whole(state["loaded"]) < len(self._loaded) or _whole(state.get("on", 1)) == 0:
                raise EmptyError(self.name, "was reset while it was loaded", "check its supply")

    def _go(self, slot: int) -> None:
        """Make the device show a slot: by its number, or by going there step by step."""
        if "select" in self.profile.commands:
            self.dialogue.do("select", slot=slot)
            return
        at = self._shown if self._shown >= 0 else None
        for _ in range(2 * slot + 8):
            if at is None or at > slot:
                at = self._move("rewind", self.profile.lowest)
            elif at == slot and self._shown == slot:
                return
            elif at < slot:
                at = self._move("step", at + 1)
            self._shown = -1 if at is None else at
        raise DeviceError(self.name, f"does not get to slot {slot}", "switch it off and on, then start again")

    def _move(self, command: str, expected: int) -> int | None:
        """Move forward or to the start; without an answer ask where the device stands. None: it must be rewound."""
        try:
            return _whole(self.dialogue.do(command, once=command == "step", slot=expected).get("slot", expected))
        except UnansweredError:
            if "query" not in self.profile.commands:
                if command == "rewind":
                    raise
                return None
            state = self.dialogue.do("query")
            if "loaded" in state and _whole(state["loaded"]) < len(self._loaded):
                raise EmptyError(self.name, "has lost its sequence", "check its supply") from None
            return _whole(state["slot"]) if _whole(state["slot"]) == expected else None

    # -------------------------------------------------------------------------------- lost lines, lost sequences

    def _recovering(self, action: Callable[[], T], check: Check, reload: bool = True) -> T:
        """Do something; if the line or the sequence is lost, restore it and do it again, a bounded number of times."""
        self.dialogue.cancel = check
        for recovery in range(_RECOVERIES + 1):
            try:
                if recovery:
                    self._restore(reload)
                return action()
            except Cancelled:
                self._loaded, self._shown = (), -1  # the answer will not be waited for: nobody knows what was done
                raise
            except (LineDownError, EmptyError, UnansweredError) as error:
                self.note(self.name, str(error))
                if recovery == _RECOVERIES and isinstance(error, LineDownError):
                    seen = f"{error.seen}, for the {recovery + 1}th time in one call"
                    raise LineDownError(self.name, seen, "check plugs, cable and the device's supply") from error
                if recovery == _RECOVERIES or isinstance(error, UnansweredError):
                    raise
        raise AssertionError("unreachable")

    def _restore(self, reload: bool) -> None:
        """Open the line anew if it is gone, and load again what the device has lost."""
        self.dialogue.restore()
        self._greet()
        if self._loaded and reload and "load" in self.profile.commands:
            self._send_sequence()
        self.note(self.name, "restored")


def load_values(profile: Profile, pattern: Pattern) -> list[dict[str, Any]]:
    """Give what the commands that load a pattern carry: its lines, and their check value."""
    if profile.by_axis:
        axis = axis_of(pattern) or profile.axis
        light = brightness(pattern, np.arange(profile.rows if axis == "y" else profile.columns))
        plate = profile.plates[axis == "y" and len(profile.plates) > 1]
        loads: list[dict[str, Any]] = [{"plate": plate, "axis": axis, "lines": profile.bits.pack(light)}]
    else:
        lcd = CrossPatternLcd(profile.columns, profile.rows)
        columns, rows = map(profile.bits.pack, lcd.switch(pattern))
        loads = [{"plate": p, "lines": lines} for p, lines in zip(profile.plates, (columns, rows), strict=True)]
        if profile.both_plates:
            loads = [{"column_lines": columns, "row_lines": rows}]
    if profile.chunk:
        loads = [
            {**v, "offset": at, "lines": v["lines"][at : at + profile.chunk]}
            for v in loads
            for at in range(0, len(v["lines"]), profile.chunk)
        ]
    check = profile.lines_check
    return [{**v, "check": check.of(b"".join(d for d in v.values() if isinstance(d, bytes)))} for v in loads]


def described(pattern: Pattern) -> dict[str, Any]:
    """Give the fields by which a pattern is described to a device: its own, angles in degrees, levels up to 255."""
    values = fields_of(pattern)
    values.pop("kind", None)
    if "shift_rad" in values:
        values["shift_deg"] = float(np.rad2deg(values.pop("shift_rad")) % 360)
    if "value" in values:
        values["level"] = round(255 * values.pop("value"))
    return values


def _unsaid(profile: Profile, pattern: Pattern) -> str | None:
    """Say what of a pattern its command would not tell the device; None where it is all told, or taken for granted."""
    steps, values = profile.commands[f"show-{pattern.kind}"], described(pattern)
    sent = {f for step in steps if step.send for f in step.send.fields}
    granted = {"inverse": False, "profile": "sine", **{k: v for step in steps for k, v in step.only.items()}}
    if sent & {"step", "shift_deg"}:  # one of them tells the other
        sent |= {"step", "steps", "shift_deg"}
    lines = profile.rows if values.get("axis") == "y" else profile.columns
    if "bits" in sent and values.get("cell", 0) << values.get("bits", 0) == lines:
        sent |= {"cell"}  # the whole width, in equal cells
    unsaid = [k for k, v in values.items() if k not in sent and (k not in granted or granted[k] != v)]
    if not unsaid:
        return next((why for step in steps if step.send and (why := _no_room(step.send, values))), None)
    told = f"show-{pattern.kind} of the profile does not send {unsaid[0]}, which is {values[unsaid[0]]}"
    return f"{told}: send it, or say what the device takes for granted by `only`"


def _no_room(template: Template, values: Mapping[str, Any]) -> str | None:
    """Say for which value a command has no room, and which period would be another one when it is rounded."""
    if (why := no_room(template, values)) is not None:
        return why
    for key, value in (template.match(template.fill({"tag": 1, **values})) or {}).items():
        if key.startswith("period") and abs(float(value) / calculated(key, values) - 1) > ROUNDED:
            return f"{{{key}}} in {template.text!r} rounds a period of {values['period']:g}"
    return None


def _whole(value: Value) -> int:
    return int(value)
