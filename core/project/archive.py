"""The program's own results, one file each: any dataclass of `core.model`, or the one asked for, with its arrays.

An archive is an uncompressed NPZ: the arrays as they are, and one JSON text that holds everything else and points to
them. Only these dataclasses are ever made when one is read, so a file cannot run code.
"""

from __future__ import annotations

import dataclasses
import json
import tokenize
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from core import model
from core.atomic import atomic_write
from core.errors import InputError
from core.fields import regular
from core.geometry import Pose
from core.project.shapes import check_fields

T = TypeVar("T")
VERSION = 1
# what numpy, zipfile and json say of files that are cut off, changed or foreign; unknown compression is a RuntimeError
DAMAGE = (
    *(OSError, ValueError, LookupError, TypeError, AttributeError, EOFError, RuntimeError, MemoryError),
    *(zipfile.BadZipFile, zlib.error, tokenize.TokenError, SyntaxError),
)
_CLASSES: dict[str, type] = {
    "Pose": Pose,
    "Note": model.Note,
    **{name: c for name, c in vars(model).items() if isinstance(c, type) and dataclasses.is_dataclass(c)},
}


def save_archive(path: Path, value: object, made_from: Mapping[str, Any] | None = None) -> None:
    """Write a dataclass of `core.model` (or a tuple of them), atomically, with the record of what it was made from."""
    arrays: dict[str, Any] = {}
    tree = _pack(value, arrays)
    head = {"format": "stripe-result", "version": VERSION, "value": tree}
    text = json.dumps(head if made_from is None else {**head, "made_from": made_from})
    with atomic_write(path) as file:
        np.savez(file, tree=np.array(text), **arrays)


def load_archive(path: Path, kind: type[T], of: type | None = None) -> T:
    """Read what `save_archive` wrote; `kind` is the class expected, `of` that of the items of a tuple.

    Every field is tested for its type, every array for its shape.

    Raises
    ------
    InputError
        If the file is not there, is damaged, or holds something else.
    """
    with _opened(path) as (head, stored):
        arrays = {name: stored[name] for name in stored.files if name != "tree"}
        classes = {**_CLASSES, **{c.__name__: c for c in (kind, of) if dataclasses.is_dataclass(c)}}
        value = _unpack(head["value"], arrays, classes) if head.get("version") == VERSION else None
    items = [item for item in value if not isinstance(item, of)] if of and isinstance(value, tuple) else []
    if items or not isinstance(value, kind):
        value = items[0] if items else value
        raise InputError(
            path, f"holds {type(value).__name__}", f"delete it and run the step that writes {kind.__name__}"
        )
    return value


def read_head(path: Path) -> dict[str, Any]:
    """Read all of an archive but its arrays: "value" as a tree, and "made_from" if it is known."""
    with _opened(path) as (head, _):
        return head


@contextmanager
def _opened(path: Path) -> Iterator[tuple[dict[str, Any], Any]]:
    """Open an archive; what is wrong with it, or with what is made of it inside, is told."""
    try:
        with regular(path).open("rb") as file:
            if file.read(2) != b"PK":  # numpy would offer to run what is in it
                raise ValueError("no archive")
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            head = json.loads(str(stored["tree"]))
            if not isinstance(head, dict) or "value" not in head:
                raise ValueError("no result")
            yield head, stored
    except FileNotFoundError as error:
        raise InputError(path, "not there", "run the step that writes it") from error
    except DAMAGE as error:
        raise InputError(path, f"damaged ({error})", "delete it and run the step again") from error


def _pack(value: Any, arrays: dict[str, Any]) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {f.name: _pack(getattr(value, f.name), arrays) for f in dataclasses.fields(value)}
        return {"class": type(value).__name__, "fields": fields}
    if isinstance(value, model.Note):
        return {"class": "Note", "fields": {"text": str(value), "names": value.names}}
    if isinstance(value, np.ndarray):
        name = f"a{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, tuple | list):
        return [_pack(item, arrays) for item in value]
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Path):
        return {"path": str(value)}
    if isinstance(value, str | int | float | None):
        return value
    return {"map": {str(k): _pack(v, arrays) for k, v in dict(value).items()}}


def _unpack(tree: Any, arrays: dict[str, Any], classes: Mapping[str, type]) -> Any:
    if isinstance(tree, list):
        return tuple(_unpack(item, arrays, classes) for item in tree)
    if not isinstance(tree, dict):
        return tree
    if "array" in tree:
        return arrays[tree["array"]]
    if "path" in tree:
        return Path(tree["path"])
    if "map" in tree:
        return {k: _unpack(v, arrays, classes) for k, v in tree["map"].items()}
    fields = {k: _unpack(v, arrays, classes) for k, v in tree["fields"].items()}
    made = classes[tree["class"]](**fields)
    if dataclasses.is_dataclass(made):
        check_fields(made)
    return made
