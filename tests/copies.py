"""Copies of recorded projects to work on, which share their frames and archives with the original."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

SHARED = (".png", ".tif", ".npz")  # what the program replaces by a new file and never writes into


def copied(folder: Path, to: Path) -> Path:
    """Copy a project in a twentieth of the time that whole copies take: large files are links to the original's.

    A test that writes into such a file, or changes its times, takes it as its `own` first.
    """
    return Path(shutil.copytree(folder, to, copy_function=_copy))


def own(path: Path) -> Path:
    """Put a copy in the place of a file that is shared with the original, its times kept."""
    part = path.with_name(f"{path.name}.own")
    shutil.copy2(path, part)
    return part.replace(path)


def _copy(source: str, to: str) -> str:
    return os.link(source, to) or to if source.endswith(SHARED) else shutil.copy2(source, to)


def stamps(folder: Path) -> str:
    """What tells that a shared file was written into: sizes and times."""
    files = sorted(path for path in folder.rglob("*") if path.suffix in SHARED)
    return json.dumps({str(path): [(s := path.stat()).st_size, s.st_mtime_ns] for path in files})


def written_into(folder: Path, before: str) -> list[str]:
    """Shared files of an original that are not as they were."""
    now, then = json.loads(stamps(folder)), json.loads(before)
    return [path for path, stamp in then.items() if now.get(path) != stamp]
