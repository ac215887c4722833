"""Faults that a virtual device commits on demand, by name and rate."""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from core.errors import InputError

LINK_FAULTS = {
    "no-answer": "the command is carried out and nobody says so",
    "lost-command": "the command never arrives",
    "late-answer": "the answer comes after the host's patience has ended",
    "garbage": "random bytes in place of the answer",
    "half-reply": "the first half of the answer",
    "lost-byte": "one byte of the command is lost on the way",
    "flipped-byte": "one byte of the command arrives changed",
    "wrong-checksum": "the answer carries a wrong check value",
    "repeated-pattern": "acknowledged, and the previous pattern stays",
    "skipped-pattern": "acknowledged, and the pattern after it is shown",
    "refused": "the device says no, for this once",
    "reset": "the device restarts: what was loaded is lost, the light is dark",
    "hang-up": "the line goes dead and comes back",
    "slow-switching": "acknowledged, and the light follows ten settle times later",
}
CAMERA_FAULTS = {
    "stale-frame": "the image before this one comes again",
    "no-frame": "no image comes in time",
    "torn-frame": "the lower half is from the image before",
    "mixed-frame": "30 % of the light is of the image before",
}

TRIGGER_FAULTS = {  # whichever of projector and camera triggers the other
    "lost-trigger": "the other device does not see a trigger",
    "doubled-trigger": "it sees one trigger twice",
    "late-trigger": "it sees it a whole pattern later",
}


@dataclass
class Faults:
    """Decides at every opportunity whether a fault happens, and which.

    Examples
    --------
    >>> faults = Faults(at={1: "reset"})
    >>> [faults.next() for _ in range(3)]
    [None, 'reset', None]
    """

    rates: Mapping[str, float] = field(default_factory=dict)  #: probability of each fault by name
    #: opportunity number (0, 1, ...) to the fault that happens there, for certain
    at: Mapping[int, str] = field(default_factory=dict)
    seed: int = 0
    count: int = 0
    committed: list[tuple[int, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.random = random.Random(self.seed)

    def next(self, possible: Iterable[str] | None = None) -> str | None:
        """Name the fault of this opportunity; None: all goes well. `possible` limits it to what can happen here."""
        allowed = set(possible) if possible is not None else None
        number, self.count = self.count, self.count + 1
        name = self.at.get(number)
        if name is None:
            draw = self.random.random()
            for candidate, rate in self.rates.items():
                if draw < rate:
                    name = candidate
                    break
                draw -= rate
        if name is None or (allowed is not None and name not in allowed):
            return None
        self.committed.append((number, name))
        return name


def parse_faults(text: str, known: Mapping[str, str], where: str, seed: int = 0) -> Faults:
    """Read ``name:rate,name@number,...``; the number counts opportunities from 0.

    Examples
    --------
    >>> parse_faults("reset@3,garbage:0.1", LINK_FAULTS, "url").at
    {3: 'reset'}
    """
    rates: dict[str, float] = {}
    at: dict[int, str] = {}
    for item in filter(None, text.split(",")):
        sign = "@" if "@" in item else ":"
        name, _, value = item.partition(sign)
        if name not in known:
            raise InputError(where, f"fault {name!r}", f"use {', '.join(known)}")
        try:
            number = float(value)
        except ValueError:
            number = -1.0
        if sign == "@" and number >= 0 and number == int(number):
            at[int(number)] = name
        elif sign == ":" and 0 <= number <= 1:
            rates[name] = number
        else:
            raise InputError(
                where, f"fault {item!r}", "write NAME:RATE with a rate from 0 to 1, or NAME@COMMAND-NUMBER"
            )
    return Faults(rates, at, seed)
