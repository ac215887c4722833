"""The project on disk: captures and results, read once per version of their files."""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Any, Generic, TypeVar

from core.errors import StripeError
from core.lazy import dataclass
from core.model import Capture, Project
from core.pipeline.runs import calibration_file
from core.project import load_archive, read_capture, read_project

T = TypeVar("T")
MANY = 300  # captures


@dataclass(frozen=True)
class CaptureEntry:
    """One capture that project.json lists: read, or the error that says why not."""

    folder: Path
    capture: Capture | None
    error: StripeError | None

    @property
    def name(self) -> str:
        return self.folder.name

    @property
    def angle_deg(self) -> float | None:
        return self.capture.angle_deg if self.capture else None

    @property
    def role(self) -> str:
        """The role, empty where the capture cannot be read."""
        return self.capture.role if self.capture else ""


def frames_key(capture: Capture) -> tuple[Any, ...]:
    """Tell the frames of a capture from others, and from themselves after a change, whatever is picked in them."""
    newest = max(written_ns(frame.path) or 0 for frame in capture.frames)
    return capture.path, capture.camera, capture.projector, newest


class ProjectFolder:
    """A project folder as it is now: ask again after something was written."""

    def __init__(self, path: Path) -> None:
        self.path = Path(path)
        self._read: dict[Path, tuple[Any, Any]] = {}  # file -> (its version, what it held)
        self._listed: list[CaptureEntry] | None = None
        self._project = read_project(self.path)
        self._project_version = version(self.path / "project.json")

    @property
    def project(self) -> Project:
        now = version(self.path / "project.json")
        if now != self._project_version:
            self._project, self._project_version = read_project(self.path), now
        return self._project

    @property
    def large(self) -> bool:
        """Whether looking at all captures takes so long that it is done in the background, once for all pages."""
        return len(self.project.captures) > MANY

    def captures(self) -> list[CaptureEntry]:
        """Give every listed capture, in the project's order; of a large project as it was looked at last."""
        if self._listed is None or not self.large:
            boards = self._boards()
            self._listed = [self._entry(folder, boards) for folder in self.project.captures]
        return self._listed

    def look_again(self) -> None:
        """Take nothing as it was."""
        self._listed = None

    def of_role(self, *roles: str) -> list[CaptureEntry]:
        return [entry for entry in self.captures() if entry.role in roles]

    def entry(self, name: str) -> CaptureEntry | None:
        boards = self._boards()
        return next((self._entry(folder, boards) for folder in self.project.captures if folder.name == name), None)

    def result_file(self, name: str) -> Path:
        """Where a result is kept; the calibrations in use lie with the run they came from."""
        return calibration_file(self.project, name) or self.path / "results" / name

    def result(self, name: str, kind: type[T]) -> T | None:
        """Give a result, None where it was not computed."""
        path = self.result_file(name)
        now = version(path)
        if now is None:
            return None
        kept = self._read.get(path)
        if kept is None or kept[0] != now:
            kept = (now, load_archive(path, kind))
            self._read[path] = kept
        return kept[1]

    def _boards(self) -> tuple[Any, ...]:
        """Versions of the testfields: a capture names one of the project's CSV files."""
        return tuple(version(path) for path in sorted(self.path.glob("*.csv")))

    def _entry(self, folder: Path, boards: tuple[Any, ...]) -> CaptureEntry:
        now = (version(folder / "capture.json"), version(folder / "picks.json"), boards)
        kept = self._read.get(folder)
        capture: Capture | None = kept[1] if kept is not None and kept[0] == now else None
        if capture is None or not all(os.path.exists(frame.place) for frame in capture.frames):  # new, or gone
            try:
                capture = read_capture(folder, self.project)
            except StripeError as error:
                return CaptureEntry(folder, None, error)
            self._read[folder] = (now, capture)
        return CaptureEntry(folder, capture, None)


def version(path: Path) -> tuple[int, int] | None:
    """Tell one content of a file from another: time of writing in ns, and size; None where there is no file."""
    try:
        stat = os.stat(path)
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_size


def written_ns(path: Path) -> int | None:
    """When a file was written; None where there is none."""
    found = version(path)
    return found[0] if found else None


class Recent(Generic[T]):
    """What was made of captures, those asked for last, up to a limit on the sum of their sizes."""

    def __init__(self, limit: float, size: Callable[[T], float]) -> None:
        self._limit, self._size = limit, size
        self._kept: OrderedDict[tuple[Any, ...], T] = OrderedDict()

    def get(self, capture: Capture) -> T | None:
        """Give what was made of a capture if it is here and the frames have not changed."""
        key = frames_key(capture)
        if key in self._kept:
            self._kept.move_to_end(key)
        return self._kept.get(key)

    def put(self, capture: Capture, made: T) -> None:
        """Keep what was made of a capture; what was not asked for longest goes."""
        self._kept[frames_key(capture)] = made
        while len(self._kept) > 1 and sum(map(self._size, self._kept.values())) > self._limit:
            self._kept.popitem(last=False)
