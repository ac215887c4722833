"""A new project: regular boards by rows and columns, and a folder written whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np

from core.atomic import undone_on_failure
from core.errors import InputError, listed
from core.model import DeviceSpec, ScaleBar, Testfield
from core.patterns import SequenceSpec
from core.project.captures import write_project, write_testfield


def nominal_testfield(
    rows: int,
    cols: int,
    pitch_mm: float,
    diameter_mm: float,
    polarity: Literal["white-on-black", "black-on-white"] = "white-on-black",
) -> Testfield:
    """Lay out a regular field, row 0 at the top and column 0 at the left, its middle at the origin, z = 0.

    Examples
    --------
    >>> field = nominal_testfield(13, 19, 12.0, 5.0)
    >>> len(field.row), field.xyz_mm[0]
    (247, array([-108.,   72.,    0.]))
    """
    row, col = (a.ravel() for a in np.meshgrid(np.arange(rows), np.arange(cols), indexing="ij"))
    x, y = (col - (cols - 1) / 2) * pitch_mm, ((rows - 1) / 2 - row) * pitch_mm
    xyz = np.column_stack([x, y, np.zeros(row.size)])
    return Testfield(row, col, xyz, np.full(row.size, diameter_mm), polarity)


def refuse_used_folder(folder: Path) -> None:
    """See that a folder is new or empty."""
    try:
        if folder.exists() and not folder.is_dir():
            raise InputError(folder, "is a file", "choose a new or empty folder")
        held = sorted(path.name for path in folder.iterdir()) if folder.exists() else []
    except OSError as error:
        raise InputError(folder, f"cannot be used ({error.strerror})", "choose a folder you may write to") from error
    if held:
        raise InputError(folder, f"is not empty: it holds {listed(held, 1)}", "choose a new or empty folder")


def create_project(
    folder: Path,
    name: str,
    camera: DeviceSpec | Mapping[str, DeviceSpec],
    projector: DeviceSpec | Mapping[str, DeviceSpec],
    boards: Mapping[str, Testfield],
    scale: ScaleBar | None = None,
    sequence: SequenceSpec | None = None,
) -> None:
    """Write a project without captures: its boards by file name first, then project.json, which needs them.

    `camera` and `projector` are one each, or several by name.

    Raises
    ------
    InputError
        If the folder is neither new nor empty, or cannot be written; nothing is left behind then.
    """
    folder = Path(folder)
    refuse_used_folder(folder)
    with undone_on_failure(folder):
        for file, testfield in boards.items():
            write_testfield(folder / file, testfield, f"nominal targets, {name}")
        write_project(folder, name, camera, projector, scale, sequence=sequence)
