"""What files hold, as short hashes, remembered by what the file system says of them: hashed once, known for good.

As git's index does it, a hash is believed as long as size, times of writing and inode are what they were. A file that
was written within the file system's resolution of its hashing may have been written again unseen: it is hashed anew.
Copies, unpacked archives and touched files are hashed anew too and found equal. Losing the memory costs time only.
"""

from __future__ import annotations

import hashlib
import json
import os
import threading
import time
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

from core.atomic import atomic_write
from core.errors import StripeError
from core.parallel import run_in_bands
from core.resources import user_cache

FILE = ".contents.json"  # in results/
DIGITS = 20  # of SHA-256 in hexadecimal: 80 bits tell a project's files apart
_VERSION = 1
_TICK_NS = 100_000_000  # file systems tell times to 10 ms or better ...
_COARSE_NS = 2_000_000_000  # ... or to whole seconds, FAT to two

Seen = tuple[int, int, int, int]  # size, time of writing and of any change in ns, inode


class Contents:
    """Hashes of the files of one project; one object a project serves all threads.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as name:
    ...     _ = (Path(name) / "a.txt").write_text("stripe")
    ...     Contents(Path(name)).of(Path(name) / "a.txt")
    '2bed2032ed3d8300b771'
    """

    def __init__(self, folder: Path) -> None:
        self.folder = Path(folder)
        self._root = f"{self.folder}{os.sep}"
        self._known: dict[str, tuple[Seen, int, str]] = {}  # by path: what was seen, when it was hashed, the hash
        self._changed = False
        self._lock = threading.Lock()
        self._read()

    def of(self, path: Path | str) -> str | None:
        """Give the hash of a file's content; None where there is no file that can be read."""
        name = str(path)
        seen = _look(name)
        if seen is None:
            return None
        known = self._known.get(self._key(name))
        if known is not None and known[0] == seen and _settled(seen, known[1]):
            return known[2]
        at = time.time_ns()
        value = hash_file(name)
        if value is not None:
            with self._lock:
                self._known[self._key(name)] = seen, at, value
                self._changed = True
        return value

    def learn(self, paths: Iterable[Path | str]) -> dict[str, str | None]:
        """Give the hashes of many files by path; what is not known yet is hashed on several threads."""
        found: dict[str, str | None] = {}
        due = []
        for name in map(str, paths):
            known, seen = self._known.get(self._key(name)), _look(name)
            if seen is None:
                found[name] = None
            elif known is not None and known[0] == seen and _settled(seen, known[1]):
                found[name] = known[2]
            else:
                due.append(name)
        run_in_bands(lambda start, stop: found.update({n: self.of(n) for n in due[start:stop]}), len(due), least=2)
        return found

    def keep(self) -> None:
        """Remember for the next time; where nothing can be written nothing is, and no word is lost on it."""
        if not self._changed:
            return
        with self._lock:
            text = json.dumps({"version": _VERSION, "files": self._known}, separators=(",", ":"))
            self._changed = False
        for path in self._places():
            try:
                with atomic_write(path, durable=False) as file:
                    file.write(text.encode())
                return
            except (StripeError, OSError):
                continue

    def _key(self, name: str) -> str:
        return name.removeprefix(self._root)

    def _places(self) -> list[Path]:
        """Where the memory may be: with the results, or with the user where these cannot be written."""
        own = self.folder / "results"
        name = hashlib.sha256(os.fsencode(self.folder.resolve())).hexdigest()[:DIGITS]
        with_results = [own / FILE] if own.is_dir() and os.access(own, os.W_OK) else []
        return with_results + ([base / "contents" / f"{name}.json"] if (base := user_cache()) else [])

    def _read(self) -> None:
        for path in self._places():
            try:
                stored = json.loads(path.read_bytes())
                if stored["version"] == _VERSION:
                    self._known = {
                        str(k): (tuple(seen), int(at), str(v)) for k, (seen, at, v) in stored["files"].items()
                    }
                    return
            except (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
                continue


class Look:
    """The files of a project at one moment: each is looked at once, however often it is asked for."""

    def __init__(self, contents: Contents) -> None:
        self.keep = contents.keep
        self._contents = contents
        self._hashes: dict[str, str | None] = {}

    def of(self, path: Path | str) -> str | None:
        """Give the hash of a file's content; None where there is no file that can be read."""
        name = str(path)
        if name not in self._hashes:
            self._hashes[name] = self._contents.of(name)
        return self._hashes[name]

    def learn(self, paths: Iterable[Path | str]) -> None:
        """Look at many files at once."""
        self._hashes |= self._contents.learn(paths)


_opened = lru_cache(maxsize=8)(Contents)


def contents_of(folder: Path) -> Contents:
    """Give the hashes of a project, read once in a process."""
    return _opened(Path(folder).absolute())


def hash_file(path: Path | str) -> str | None:
    """Hash the content of a file; None where there is none that can be read."""
    try:
        with open(path, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()[:DIGITS]
    except OSError:
        return None


def hash_value(value: Any) -> str:
    """Hash a value of numbers, texts, lists and dictionaries."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


def _look(name: str) -> Seen | None:
    try:
        stat = os.stat(name)
    except (OSError, ValueError):
        return None
    if stat.st_mode & 0o170000 != 0o100000:  # a folder, or a pipe that would keep a reader for ever
        return None
    changed = stat.st_ctime_ns if os.name == "posix" else stat.st_mtime_ns
    return stat.st_size, stat.st_mtime_ns, changed, stat.st_ino


def _settled(seen: Seen, at: int) -> bool:
    """Whether a file hashed at a time cannot have been written again within the same tick of its clock."""
    return seen[2] + (_TICK_NS if seen[2] % 1_000_000_000 else _COARSE_NS) < at
