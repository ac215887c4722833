"""A file is either the old one or the whole new one, never something between."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from core.errors import InputError


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
    """
    if _is_stream(path):
        with path.open("wb") as stream:
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
        with os.fdopen(handle, "wb") as file:
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


def _unwritable(path: Path, error: OSError) -> InputError:
    return InputError(path, f"cannot be written ({error.strerror})", "choose a folder you may write to")


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
