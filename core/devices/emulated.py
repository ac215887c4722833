"""The serial projector and its emulator as one device: the bytes between them are those of a real line."""

from __future__ import annotations

from dataclasses import replace

from core.devices.emulator import Emulator
from core.devices.faults import Faults
from core.devices.profile import Profile
from core.devices.protocol import Check, Note, no_check, no_note
from core.devices.rs232 import SerialProjector
from core.devices.server import EmulatedLine
from core.devices.virtual import Stage
from core.errors import InputError


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
