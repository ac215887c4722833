"""A file is either the old one or the whole new one, never something between."""

from __future__ import annotations

import errno
import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from core.errors import InputError, StripeError

# what no other name or folder on that disk would mend
_DISK = {getattr(errno, name) for name in ("ENOSPC", "EDQUOT", "EFBIG", "EIO") if hasattr(errno, name)}


@contextmanager
def atomic_write(path: Path, durable: bool = True) -> Iterator[BinaryIO]:
    """Open a binary file that takes the place of `path` only once it is complete.

    Parameters
    ----------
    path : Path
        Its folder is made if need be.
    durable : bool
        Flush file and folder to the disk before returning, so that a power cut cannot lose the file any more.

    Raises
    ------
    InputError
        If the place cannot be written.
    StripeError
        If the disk is full or fails.
    """
    if _is_stream(path):
        with _told(path), path.open("wb") as stream:
            yield stream
        return
    try:
        path = Path(os.path.realpath(path))  # a link stays one
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    except OSError as error:
        raise _unwritable(path, error) from error
    part = Path(name)
    try:
        with _told(path), os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            if durable:
                os.fsync(file.fileno())
        part.chmod(0o666 & ~_umask())
        try:
            part.replace(path)
        except OSError as error:
            raise InputError(path, f"cannot be replaced ({error.strerror})", "move what is there away") from error
        if durable:
            _flush_folder(path.parent)
    finally:
        part.unlink(missing_ok=True)


def check_place(path: Path) -> None:
    """See that a file could be written, before work that takes time or writes other files first.

    Raises
    ------
    InputError
        If a folder is there, or nothing can be written into the one meant.
    """
    if os.path.isdir(path):
        raise InputError(path, "is a folder", "give the name of a file")
    if _is_stream(path):
        return
    try:
        nearest = next(parent for parent in path.absolute().parents if parent.exists())
        with tempfile.NamedTemporaryFile(prefix=f".{path.name}.", suffix=".part", dir=nearest):
            pass
    except OSError as error:
        raise _unwritable(path, error) from error


def write_json(path: Path, value: Any) -> None:
    """Write a value as indented JSON, atomically."""
    text = json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False)
    with atomic_write(path) as file:
        file.write(text.encode() + b"\n")


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
        raise _unwritable(path, error) from error


def _unwritable(path: Path, error: OSError) -> StripeError:
    seen = f"cannot be written ({error.strerror or error})"
    if error.errno in _DISK:
        return StripeError(path, seen, "make room on the disk, or take another, and run it again")
    return InputError(path, seen, "choose a folder you may write to")


def _is_stream(path: Path) -> bool:
    """Whether a device or a pipe is there, such as /dev/null, which must not be replaced by a file."""
    return os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _flush_folder(folder: Path) -> None:
    if os.name != "posix":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
