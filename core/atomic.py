"""A file is either the old one or the whole new one, never something between."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import platform
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

from core.errors import InputError, StripeError

PART = ".part"  # ends the name of what is being written
_ON_ONE_LINE = json.JSONEncoder(ensure_ascii=False, allow_nan=False)
# what no other name or folder on that disk would mend
_DISK = {getattr(errno, name) for name in ("ENOSPC", "EDQUOT", "EFBIG", "EIO") if hasattr(errno, name)}


def _nothing(*paths: Path) -> None:
    pass


# before a file is written, and when it is about to take its place, with the name it was written under
hooks: tuple[Callable[[Path], None], Callable[[Path, Path], None]] = _nothing, _nothing


@contextmanager
def atomic_write(path: Path, durable: bool = True) -> Iterator[BinaryIO]:
    """Open a binary file that takes the place of `path`, whose folder is made if need be, only once it is complete.

    With `durable` file and folder are flushed to the disk before this returns, so that a power cut cannot lose the file
    any more. InputError if the place cannot be written, StripeError if the disk is full or fails.
    """
    if _is_stream(path):
        with _told(path), path.open("wb") as stream:
            yield stream
        return
    try:
        path = Path(os.path.realpath(path))  # a link stays one
        hooks[0](path)
        make_folder(path.parent, durable)
        _sweep_once(path.parent)
    except OSError as error:
        raise unwritable(path, error) from error
    part = path.with_name(f"{part_prefix(path.name)}{os.urandom(4).hex()}{PART}")
    try:  # a signal between the name and the file leaves nothing
        try:
            file = part.open("xb")
        except OSError as error:
            raise unwritable(path, error) from error
        with _told(path), file:
            yield file
            file.flush()
            if durable:
                os.fsync(file.fileno())
        hooks[1](path, part)
        try:
            part.replace(path)
        except OSError as error:
            raise InputError(path, f"cannot be replaced ({error.strerror})", "move what is there away") from error
        if durable:
            flush_folder(path.parent)
    finally:
        with suppress(OSError):  # on a disk that may only be read it says so though nothing is there
            part.unlink()


def write_together(contents: Mapping[Path, bytes]) -> list[Path]:
    """Write files that belong together: where there is no room for one, none takes its place."""
    with ExitStack() as files:
        for path, content in contents.items():
            file = files.enter_context(atomic_write(path))
            file.write(content)
            file.flush()
    return list(contents)


def check_place(path: Path) -> None:
    """See that a file could be written before work that takes time, or writes other files first; else an InputError."""
    if os.path.isdir(path):
        raise InputError(path, "is a folder", "give the name of a file")
    hooks[0](path)
    if _is_stream(path):
        return
    try:
        with suppress(FileNotFoundError):
            path.lstat()  # a name may be too long
        nearest = next(parent for parent in path.absolute().parents if parent.exists())
        tempfile.TemporaryFile(dir=nearest).close()  # on Linux without a name, which a kill would leave
    except OSError as error:
        raise unwritable(path, error) from error


def make_folder(folder: Path, durable: bool = True) -> None:
    """Make a folder and those above it; `durable` so that a power cut cannot lose them any more."""
    new = [folder]
    while not new[-1].exists() and new[-1].parent != new[-1]:
        new.append(new[-1].parent)
    folder.mkdir(parents=True, exist_ok=True)
    for parent in new[:0:-1] if durable else ():
        flush_folder(parent)


def flush_folder(folder: Path) -> None:
    """Flush the names in a folder to the disk."""
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def part_prefix(name: str) -> str:
    """Begin the name of a file that is being written: it says for which file, and by which process of which machine."""
    return f".{name[:50]}.{os.getpid()}@{_machine()}."


@cache
def _machine() -> str:
    return hashlib.sha256(platform.node().encode()).hexdigest()[:6]


def is_leftover(path: Path) -> bool:
    """Whether a file that was being written belongs to a process that is not there any more.

    Of another machine's files nothing is known: they are none. Files and folders that name no machine are leftovers.
    """
    if not path.name.endswith(PART) or not path.name.startswith("."):
        return False
    pid, _, machine = next((p for p in path.name.split(".")[::-1] if "@" in p), "").partition("@")
    if not pid.isdigit():
        return True
    if machine != _machine() or int(pid) == os.getpid():
        return False
    return not is_running(int(pid))


def is_running(pid: int) -> bool:
    """Whether a process of this machine runs; where it cannot be told, it does."""
    if os.name == "nt":  # os.kill would end it there
        import ctypes

        kernel = ctypes.windll.kernel32  # type: ignore[attr-defined]
        handle = kernel.OpenProcess(0x1000, False, pid)  # PROCESS_QUERY_LIMITED_INFORMATION
        if not handle:
            return bool(kernel.GetLastError() == 5)  # ERROR_ACCESS_DENIED: it runs, and is another user's
        code = ctypes.c_ulong()
        kernel.GetExitCodeProcess(handle, ctypes.byref(code))
        kernel.CloseHandle(handle)
        return code.value == 259  # STILL_ACTIVE
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


@cache
def _sweep_once(folder: Path) -> None:
    """Sweep a folder that others may use too: what does not say that this program wrote it stays."""
    sweep(folder, f"@{_machine()}.")


def sweep(folder: Path, mark: str = "") -> list[Path]:
    """Remove what killed programs left in a folder while writing, if its name has the mark; give what went."""
    gone = []
    try:
        names = [entry for entry in os.scandir(folder) if entry.name.endswith(PART) and mark in entry.name]
    except OSError:
        return []
    for entry in names:
        path = Path(entry.path)
        if is_leftover(path):
            with suppress(OSError):
                shutil.rmtree(path) if entry.is_dir(follow_symlinks=False) else path.unlink()
                gone.append(path)
    return gone


def write_json(path: Path, value: Any) -> None:
    """Write a value as indented JSON, atomically."""
    text = _indented(value, "\n")
    with atomic_write(path) as file:
        file.write(text.encode(errors="backslashreplace") + b"\n")  # bytes of a name that are no text, as JSON has them


def _indented(value: Any, margin: str) -> str:
    """Give JSON with what holds no lists or objects on one line: json's own indentation is not compiled, and slow."""
    held = value.values() if isinstance(value, Mapping) else value if isinstance(value, list | tuple) else ()
    if not held or (margin != "\n" and not any(isinstance(one, Mapping | list | tuple) for one in held)):
        return _ON_ONE_LINE.encode(value)
    inner = f"{margin} "
    parts = [_indented(one, inner) for one in held]
    if isinstance(value, Mapping):
        parts = [f"{_ON_ONE_LINE.encode(str(key))}: {part}" for key, part in zip(value, parts, strict=True)]
    opened, closed = "{}" if isinstance(value, Mapping) else "[]"
    return f"{opened}{inner}{f',{inner}'.join(parts)}{margin}{closed}"


@contextmanager
def undone_on_failure(folder: Path) -> Iterator[None]:
    """Remove again what the work within has added to a folder, and the folder if it is new, should the work fail."""
    new = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    before = set(os.listdir(folder)) if folder.exists() else set()
    try:
        yield
    except BaseException:
        for path in folder.iterdir() if folder.is_dir() else ():
            if path.name not in before:
                shutil.rmtree(path) if path.is_dir() else path.unlink()
        for parent in new:
            if parent.is_dir():
                parent.rmdir()
        raise


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Name the file when writing fails: the system names none for a file that is open."""
    try:
        yield
    except OSError as error:
        if error.filename is not None:
            raise
        raise unwritable(path, error) from error


def unwritable(
    path: Path, error: OSError, room: str = "make room on the disk, or take another, and run it again"
) -> StripeError:
    """Say why a place cannot be written: a full or failing disk, with the remedy `room`, or a place not to be used."""
    seen = f"cannot be written ({error.strerror or error})"
    if error.errno in _DISK:
        return StripeError(path, seen, room)
    too_long = error.errno == errno.ENAMETOOLONG
    return InputError(path, seen, "give a shorter name" if too_long else "choose a folder you may write to")


def _is_stream(path: Path) -> bool:
    """Whether a device or a pipe is there, such as /dev/null, which must not be replaced by a file."""
    return os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path)
