"""What a command profile says of a projector, and what its commands and answers may tell."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from core.devices.line.framing import CheckSum, Framing
from core.devices.line.packing import LineBits
from core.devices.line.template import Template, Value
from core.lazy import dataclass
from core.patterns import Pattern
from core.patterns.kinds import KINDS

SHOWN = ("axis", "bit", "bits", "cell", "inverse", "period", "steps", "step", "shift_deg", "profile", "index", "width")
COMMANDS: dict[str, set[str]] = {  # and the fields that can be sent with each, beside the tag
    "start": set(),
    "identify": set(),
    "lamp": {"on"},
    "load": {"slot", "plate", "axis", "lines", "offset", "column_lines", "row_lines", "check"},
    "select": {"slot"},
    "rewind": set(),
    "step": set(),
    **{f"show-{kind}": {*SHOWN, "level"} for kind in KINDS},
    "table": {"count", "shown", "images", "period_us"},
    "image": {"place", "image"},
    "entry": {"place", "slot", "swap", "period_us"},
    "follow-entry": {"place", "slot", "swap", "period_us"},
    "ready": {"count", "shown", "images", "period_us"},
    "run": {"count", "period_us"},
    "follow": {"count"},
    "query": set(),
    "stop": set(),
}
TOLD = {"columns", "rows", "slots", "slot", "loaded", "on", "code", "text", "tag"}  # what answers may tell beside these
MEANINGS = ("busy", "damaged", "empty", "range", "unknown")


@dataclass(frozen=True)
class Port:
    """How bytes travel."""

    baud: int
    bits: int
    parity: str
    stop: float
    flow: str
    dtr: bool = True  # the lines as they are set when the port is opened
    rts: bool = True
    open_s: float = 0.0  # after opening, before anything is sent
    byte_s: float = 0.0  # between two bytes that are sent


@dataclass(frozen=True)
class Step:
    """What is sent, if anything, and what the device answers; None: nothing, but for its prompt if `prompted`.

    With `until` it is asked again, every `every_s` and for `within_s` at most, until the answer's values are among
    those. After it nothing is sent for `pause_s`.
    """

    send: Template | None
    expect: Template | None
    prompted: bool
    answer_s: float | None  # None: the profile's
    until: Mapping[str, tuple[Value, ...]]
    every_s: float
    within_s: float
    pause_s: float
    only: Mapping[str, Value] = field(default_factory=dict)  # of a pattern: what the device takes for granted


Command = tuple[Step, ...]


@dataclass(frozen=True)
class Profile:
    """How a projector is spoken to.

    `framing` is that of what is sent, `answers` that of what comes back.
    """

    name: str
    title: str
    port: Port
    framing: Framing
    answers: Framing
    echo: bool
    columns: int
    rows: int
    slots: int
    first_slot: int
    plates: tuple[int | str, ...]
    axis: str
    bits: LineBits
    chunk: int  # bytes that one command loads at most; 0: all
    lines_check: CheckSum
    answer_s: float
    load_s: float
    gap_s: float
    settle_s: float
    period_s: float
    retries: int
    commands: Mapping[str, Command]
    refusals: tuple[Template, ...]
    codes: Mapping[int, str] = field(default_factory=dict)  # code to its meaning
    stored: Mapping[Pattern, int] = field(default_factory=dict)  # what stands in the device beforehand, and its slot
    per_image: int = 1  # of these slots
    two_swapped: bool = False  # two images are listed in reverse order

    @property
    def lowest(self) -> int:
        """The first slot with a pattern, where the device stands after `rewind`."""
        return min(self.stored.values(), default=self.first_slot)

    @property
    def both_plates(self) -> bool:
        """Whether one load command carries the lines of both plates."""
        return "column_lines" in self.loaded_fields

    @property
    def by_axis(self) -> bool:
        """Whether a pattern is loaded as lines along its own axis."""
        return "axis" in self.loaded_fields or len(self.plates) == 1

    @property
    def loaded_fields(self) -> set[str]:
        """Fields that are sent to store a pattern."""
        return {f for step in self.commands.get("load", ()) if step.send for f in step.send.fields}

    @property
    def listed(self) -> bool:
        """Whether a sequence of stored patterns is a table of its own, written before it goes."""
        return "entry" in self.commands or "follow-entry" in self.commands

    def goes(self, command: str) -> bool:
        """Whether a loaded sequence goes by this command, "run" or "follow"."""
        table = "entry" if command == "run" else "follow-entry"
        return command in self.commands and not {"load", table}.isdisjoint(self.commands)

    @property
    def shows(self) -> bool:
        """Whether patterns can be shown by these commands, or the device only switched."""
        return any(name in self.commands for name in ("select", "step", *(f"show-{kind}" for kind in KINDS)))
