"""What a capture holds, or shall hold: the frames of one sequence, and what the projector was meant to show in each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from core.lazy import dataclass
from core.model.finding import Note
from core.model.targets import Seed, Testfield

if TYPE_CHECKING:
    from core.patterns import Pattern

Role = Literal["testfield", "depth", "plane", "object"]


@dataclass(frozen=True)
class Frame:
    """One image of a capture and what the projector was meant to show in it."""

    place: str  # of its file
    pattern: Pattern
    camera: str = "camera"
    projector: str = "projector"
    exposure_ms: float | None = None

    @property
    def path(self) -> Path:
        """Its file."""
        return Path(self.place)


@dataclass(frozen=True)
class Subject:
    """What a new capture is of, as its capture.json says it."""

    role: Role = "testfield"
    name: str = ""  #: the capture's folder
    z_mm: float | None = None  #: the plate's position along its axis, role depth
    angle_deg: float | None = None  #: the plane's angle, role plane
    testfield: str | None = None  #: the board, a path from the project
    #: camera, projector: names in the rig, where it has several; empty for those meant where none is named
    camera: str = ""
    projector: str = ""

    @property
    def facts(self) -> dict[str, str | float | None]:
        """What capture.json keeps beside the frames, by its names."""
        return {key: getattr(self, key) for key in ("role", "testfield", "z_mm", "angle_deg")}


@dataclass(frozen=True)
class Plan:
    """The patterns of a capture in the order they are shown, and what the capture is for.

    Before the first and after the last pattern the `guards` are shown: frames that are compared with each other to see
    movement and the lamp's drift, and that are no part of the capture.
    """

    subject: Subject
    patterns: tuple[Pattern, ...]
    guards: tuple[Pattern, ...]
    devices: Mapping[str, str] = field(default_factory=dict)  # "camera", "projector": where they need names

    @property
    def shots(self) -> tuple[Pattern, ...]:
        """Everything that is shown: guards, patterns, and the guards in reverse."""
        return (*self.guards, *self.patterns, *self.guards[::-1])

    @property
    def own(self) -> range:
        """Which shots are frames of the capture."""
        return range(len(self.guards), len(self.guards) + len(self.patterns))

    def place(self, shot: int) -> str:
        """Name a shot in words, by its number among the capture's frames."""
        return f"frame {shot - self.own.start}" if shot in self.own else "a guard frame"

    @property
    def guard_pairs(self) -> list[tuple[int, int]]:
        """Shots of the same guard, before and after."""
        return [(i, len(self.shots) - 1 - i) for i in range(len(self.guards))]


@dataclass(frozen=True)
class Capture:
    """One sequence of frames: a folder with `capture.json`."""

    path: Path
    role: Role
    frames: tuple[Frame, ...]
    testfield: Testfield | None = None
    z_mm: float | None = None
    angle_deg: float | None = None
    seeds: tuple[Seed, ...] = ()
    excluded: tuple[tuple[int, int], ...] = ()  # (row, col) of targets that the operator does not want used
    notes: tuple[Note, ...] = ()  # on capture.json

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.path.name

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Camera and projector of every series of frames, in the order of their first frames."""
        return tuple(dict.fromkeys((frame.camera, frame.projector) for frame in self.frames))

    @property
    def camera(self) -> str:
        """Name of the camera that took the first frame."""
        return self.frames[0].camera if self.frames else "camera"

    @property
    def projector(self) -> str:
        """Name of the projector of the first frame."""
        return self.frames[0].projector if self.frames else "projector"

    @property
    def series(self) -> tuple[Capture, ...]:
        """The same capture for every camera with every projector, each with its own frames and picks."""
        if len(pairs := self.pairs) <= 1:
            return (self,)
        found = []
        for camera, projector in pairs:
            frames = tuple(f for f in self.frames if (f.camera, f.projector) == (camera, projector))
            found.append(replace(self, frames=frames, seeds=self.seeds_in(camera)))
        return tuple(found)

    def seen_by(self, camera: str, projector: str) -> Capture:
        """Give one camera's and one projector's series; the first where there is none of these."""
        series = self.series
        return next((s for s in series if (s.camera, s.projector) == (camera, projector)), series[0])

    def seeds_in(self, camera: str) -> tuple[Seed, ...]:
        """Give the picks in one camera's image; those that name none count for the capture's first camera."""
        return tuple(seed for seed in self.seeds if (seed.camera or self.camera) == camera)
