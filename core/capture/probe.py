"""A device tried command by command, with every byte shown."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

from core.devices.line.dialogue import Dialogue, shown
from core.devices.line.link import LineDownError
from core.devices.line.profile import COMMANDS, Profile
from core.devices.line.profiles import read_profile
from core.devices.line.rs232 import described, load_values
from core.devices.line.template import Value
from core.errors import DeviceError
from core.lazy import dataclass
from core.patterns import Code, Level, Line, Lines, Pattern, Phase, White
from core.progress import SILENT, Progress

_SAMPLES: tuple[Pattern, ...] = (White(), Level(0.5), Line("x", 0), Lines("x", (1.0, 0.0)), Phase("x", 16.0, 4, 0, 0.0))


@dataclass(frozen=True)
class Exchange:
    """One step of a command: the bytes that went, the bytes that came, and what became of it."""

    command: str
    sent: bytes
    heard: bytes
    understood: bool
    words: str
    seconds: float

    def as_dict(self) -> dict[str, object]:
        """Give it as `--json` writes it."""
        return {
            "command": self.command,
            "sent": self.sent.hex(" "),
            "heard": self.heard.hex(" "),
            "understood": self.understood,
            "words": self.words,
            "ms": round(1000 * self.seconds, 1),
        }


def probe_device(profile: str, port: str, progress: Progress = SILENT) -> Iterator[Exchange]:
    """Go through every command of a profile once, in the order in which a capture uses them; nothing is repeated."""
    once = replace(read_profile(profile), retries=0)
    talk = Dialogue(port, replace(once, commands={k: c for k, c in once.commands.items() if k != "stop"}))
    talk.cancel = progress.check
    try:
        talk.settle()
        for name, values in questions(once):
            yield from _steps(talk, once, name, values)
    finally:
        talk.close()


def questions(profile: Profile) -> Iterator[tuple[str, dict[str, Value]]]:
    """Give the commands, each with the values of a first pattern."""
    first = profile.lowest
    for name in profile.commands:
        if name == "load":
            slots = (first, first + 1) if "step" in profile.commands else (first,)
            yield from ((name, {"slot": slot, **v}) for slot in slots for v in load_values(profile, White()))
        elif name.startswith("show-"):
            kind = name.removeprefix("show-")
            bit = Code("binary" if kind == "binary" else "gray", "x", 0, 6)
            yield name, described(next((p for p in _SAMPLES if p.kind == kind), bit))
        elif name == "step":
            yield name, {"slot": first + 1}
        else:
            table = {"place": 0, "image": first // profile.per_image, "swap": 1, "images": 1, "shown": 1}
            values = {"slot": first, "on": 1, "count": 1, "period_us": 100_000, **table}
            # no more than is sent: a lamp that is still off answers `start` as it may
            yield name, {k: v for k, v in values.items() if k in COMMANDS[name] or name == "rewind"}


def _steps(talk: Dialogue, profile: Profile, name: str, values: dict[str, Value]) -> Iterator[Exchange]:
    for number, step in enumerate(profile.commands[name], 1):
        begun, lost = time.monotonic(), None
        try:
            told = talk.take(name, step, True, values)
            words, understood = ", ".join(f"{k} = {shown(v)}" for k, v in told.items() if k != "tag"), True
            words = words or ("understood" if step.expect else "sent; the profile expects no answer")
        except DeviceError as error:
            lost = error if isinstance(error, LineDownError) else None
            understood, words = False, error.seen.removeprefix(f"{name}: ")
        title = name if len(profile.commands[name]) == 1 else f"{name} {number}/{len(profile.commands[name])}"
        yield Exchange(title, talk.sent, bytes(talk.heard), understood, words, time.monotonic() - begun)
        if lost is not None:
            raise lost
