"""project.json, testfield.csv, capture.json and picks.json, read with every check and written whole."""

from __future__ import annotations

import csv
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from core.atomic import atomic_write, write_json
from core.errors import InputError
from core.fields import Fields, regular
from core.model import Capture, DeviceSpec, Frame, Project, ScaleBar, Seed, Testfield
from core.patterns import Pattern, pattern_from_dict, pattern_to_dict
from core.project.images import Image, write_image
from core.project.unfinished import unfinished_status

VERSION = 1
MOST_PIXELS = 1_000_000  # along one side of a device
ROLES = ("testfield", "depth", "plane", "object")
_COLUMNS = ("row", "col", "x_mm", "y_mm", "z_mm", "diameter_mm")


# ------------------------------------------------------------------------------------------------------------- reading


def read_document(path: Path, kind: str) -> Fields:
    """Read a JSON file and check its format name and version.

    Raises
    ------
    InputError
        If it is missing, not JSON, or of another format or version.
    """
    try:
        data = json.loads(regular(path).read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", f"give a folder that holds {path.name}") from error
    except UnicodeDecodeError as error:
        raise InputError(path, f"byte {error.start} is not UTF-8 text", "store the file as UTF-8") from error
    except (ValueError, RecursionError) as error:  # a number of thousands of digits is a ValueError too
        raise InputError(path, f"not JSON ({error})", "mend or restore the file") from error
    fields = Fields.of(data, str(path))
    fields.text("format", among=(kind,))
    version = fields.integer("version")
    if version != VERSION:
        raise fields.refuse(
            "version", version, f"this program reads version {VERSION}: convert the file or update the program"
        )
    return fields


def read_device(fields: Fields) -> DeviceSpec:
    """Read a camera or projector of project.json or network.json."""
    return DeviceSpec(
        fields.integer("width", 1, MOST_PIXELS),
        fields.integer("height", 1, MOST_PIXELS),
        fields.pair("pitch_mm", above=0.0),
        fields.real("nominal_c_mm", above=0.0),
        fields.real("r0_mm", least=0.0, default=None),
    )


def read_project(folder: Path) -> Project:
    """Read project.json and see that every capture it lists is there.

    Raises
    ------
    InputError
    """
    folder = Path(folder)
    fields = read_document(folder / "project.json", "stripe-project")
    scale = None
    if fields.data.get("scale") is not None:
        bar = fields.nested("scale")
        ends = [(round(a), round(b)) for a, b in (bar.pair("from"), bar.pair("to"))]
        if ends[0] == ends[1]:
            raise bar.refuse("to", list(ends[1]), "name two different targets")
        scale = ScaleBar(ends[0], ends[1], bar.real("length_mm", 0.0), bar.real("sigma_mm", 0.0))
    names = fields.items("captures") if "captures" in fields.data else []
    captures = []
    for name in names:
        if not isinstance(name, str) or not name:
            raise fields.refuse("captures", name, "list the folders of captures as texts")
        if not os.path.isdir(folder / name):  # false for any text that cannot be a path, too
            raise InputError(
                folder / "project.json",
                f"captures lists {name!r}, which is not there",
                "restore that folder or remove its name",
            )
        if folder / name in captures:
            raise fields.refuse("captures", name, "list every capture once")
        captures.append(folder / name)
    reference = fields.data.get("reference")  # other programs may mean something else by it
    return Project(
        folder,
        fields.text("name", default=folder.resolve().name),
        read_device(fields.nested("camera")),
        read_device(fields.nested("projector")),
        scale,
        tuple(captures),
        reference if isinstance(reference, str) else None,
    )


def find_project(folder: Path) -> Path | None:
    """Look for the project that a capture's folder belongs to, upwards from it."""
    for parent in Path(folder).resolve().parents:
        if (parent / "project.json").is_file():
            return parent
    return None


def read_capture(folder: Path, project: Project | None = None) -> Capture:
    """Read capture.json, the testfield it names and picks.json where there is one; the frames stay on disk.

    Parameters
    ----------
    folder : Path
    project : Project, optional
        Where the testfield's path starts; without it the project above the folder, or the folder itself.

    Raises
    ------
    InputError
        Naming the file, the field and the value.
    """
    folder = Path(folder)
    path = folder / "capture.json"
    fields = read_document(path, "stripe-capture")
    role = fields.text("role", among=ROLES)
    if fields.data.get("state") == "taking":
        status = unfinished_status(folder, len(fields.items("planned")))
        raise InputError(path, str(status), "start the same capture again: it goes on where it stopped")
    frames, place, where = [], str(folder), str(path)
    for i, item in enumerate(fields.items("frames")):
        entry = Fields.of(item, f"{where}: frame {i}")
        name = entry.text("file")
        if not os.path.isfile(os.path.join(place, name)):
            raise InputError(folder / name, "the frame is not there", "record it again, or take it out of capture.json")
        frames.append(
            Frame(folder / name, pattern_from_dict(entry.data.get("pattern"), f"{where}: frame {i} ({name})"))
        )
    if not frames:
        raise fields.refuse("frames", [], "a capture needs frames: record it again")
    testfield = None
    if role in ("testfield", "depth") and (name := fields.text("testfield", default=None)) is not None:
        root = project.path if project else find_project(folder) or folder
        testfield = read_testfield(root / name)
    seeds, excluded = read_picks(folder / "picks.json") if (folder / "picks.json").exists() else ((), ())
    return Capture(
        folder,
        role,
        tuple(frames),
        testfield,
        fields.real("z_mm") if role == "depth" else None,
        fields.real("angle_deg", default=None),
        seeds,
        excluded,
    )


def read_picks(path: Path) -> tuple[tuple[Seed, ...], tuple[tuple[int, int], ...]]:
    """Read the targets an operator picked, and those (row, col) that he excluded.

    Raises
    ------
    InputError
    """
    fields = read_document(path, "stripe-picks")
    seeds = []
    for i, item in enumerate(fields.items("seeds")):
        seed = Fields.of(item, f"{path}: seed {i}")
        seeds.append(Seed(seed.integer("row"), seed.integer("col"), seed.real("u"), seed.real("v")))
    excluded: dict[tuple[int, int], None] = {}
    for i, item in enumerate(fields.items("excluded") if fields.data.get("excluded") is not None else ()):
        if not isinstance(item, list) or len(item) != 2:
            raise fields.refuse(f"excluded, entry {i},", item, "give [row, col]")
        target = Fields({"row": item[0], "col": item[1]}, f"{path}: excluded, entry {i}")
        excluded[target.integer("row"), target.integer("col")] = None
    return tuple(seeds), tuple(excluded)


def read_testfield(path: Path) -> Testfield:
    """Read the nominal targets of a board.

    Raises
    ------
    InputError
        Naming the line: a missing column, a value that is no number, a target twice, an unknown polarity.
    """
    polarity, rows = "white-on-black", read_table(path, _COLUMNS)
    for line in path.read_text(encoding="utf-8-sig").splitlines():
        if line.startswith("#") and line[1:].partition(":")[0].strip() == "polarity":
            polarity = line.partition(":")[2].strip()
    if polarity not in ("white-on-black", "black-on-white"):
        raise InputError(path, f"polarity is {polarity!r}", 'use "white-on-black" or "black-on-white"')
    seen: dict[tuple[int, int], str] = {}
    for row in rows:
        key = row.integer("row"), row.integer("col")
        if key in seen:
            raise InputError(
                row.where, f"target row {key[0]}, col {key[1]} is there already ({seen[key]})", "remove one of the two"
            )
        seen[key] = row.where.rpartition(": ")[2]
    return Testfield(
        np.array([k[0] for k in seen], np.int64),
        np.array([k[1] for k in seen], np.int64),
        np.array([[row.real(f"{axis}_mm") for axis in "xyz"] for row in rows]),
        np.array([row.real("diameter_mm", above=0.0) for row in rows]),
        polarity,  # type: ignore[arg-type]
    )


def read_table(path: Path, columns: Sequence[str], texts: Sequence[str] = ()) -> list[Fields]:
    """Read a CSV file with a header; `#` starts a comment; all columns are numbers but those named in `texts`.

    Raises
    ------
    InputError
        If a column is missing, a row is too short, or the table is empty.
    """
    try:
        lines = regular(path).read_text(encoding="utf-8-sig").splitlines()
    except (OSError, ValueError) as error:
        undecoded = isinstance(error, UnicodeDecodeError)
        reason = error.strerror if isinstance(error, OSError) else "not UTF-8 text" if undecoded else "no file name"
        raise InputError(
            path, f"cannot be read ({reason})", "restore the file, or correct the name that points to it"
        ) from error
    numbered = [(i, line.partition("#")[0]) for i, line in enumerate(lines, 1)]
    numbered = [(i, line) for i, line in numbered if line.strip()]
    if not numbered:
        raise InputError(path, "the table is empty", f"give a header {','.join(columns)} and a line for each")
    header = _cells(path, *numbered[0])
    if missing := [c for c in columns if c not in header]:
        raise InputError(
            path, f"the header is {','.join(header)!r}, without {missing[0]!r}", f"start with {','.join(columns)}"
        )
    if twice := [c for c in columns if header.count(c) > 1]:
        raise InputError(
            path, f"the header has {twice[0]!r} {header.count(twice[0])} times", "keep one of these columns"
        )
    if len(numbered) == 1:
        raise InputError(path, "the table has a header and no rows", "add the rows")
    table = []
    for i, line in numbered[1:]:
        record = dict(zip(header, _cells(path, i, line), strict=False))
        where = f"{path}: line {i}"
        values: dict[str, Any] = {}
        for name in columns:
            cell = record.get(name, "")
            values[name] = cell or None if name in texts else _number(cell, name, where)
        table.append(Fields(values, where))
    return table


def _cells(path: Path, number: int, line: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line]))]
    except csv.Error as error:
        raise InputError(f"{path}: line {number}", f"{len(line)} characters ({error})", "mend that line") from error


def _number(cell: str, name: str, where: str) -> float:
    try:
        value = math.nan if "_" in cell else float(cell)  # Python's 1_000 is no number anywhere else
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(where, f"{name} is {cell!r}", "give a finite number")
    return value


# ------------------------------------------------------------------------------------------------------------- writing


def write_project(
    folder: Path,
    name: str,
    camera: DeviceSpec,
    projector: DeviceSpec,
    scale: ScaleBar | None = None,
    captures: Sequence[str] = (),
    **extra: Any,
) -> None:
    """Write project.json; `captures` are paths from the project, `extra` further keys (such as "reference")."""
    data: dict[str, Any] = {"format": "stripe-project", "version": VERSION, "name": name}
    data["camera"], data["projector"] = device_to_dict(camera), device_to_dict(projector)
    if scale is not None:
        data["scale"] = {
            "from": list(scale.start),
            "to": list(scale.stop),
            "length_mm": scale.length_mm,
            "sigma_mm": scale.sigma_mm,
        }
    write_json(Path(folder) / "project.json", {**data, "captures": list(captures), **extra})


def device_to_dict(spec: DeviceSpec) -> dict[str, Any]:
    """Give a device as project.json holds it."""
    data = {
        "width": spec.width,
        "height": spec.height,
        "pitch_mm": list(spec.pitch_mm),
        "nominal_c_mm": spec.nominal_c_mm,
    }
    return data if spec.r0_mm is None else {**data, "r0_mm": spec.r0_mm}


def write_testfield(path: Path, testfield: Testfield, comment: str = "") -> None:
    """Write the nominal targets of a board."""
    lines = [f"# {line}" for line in comment.splitlines()]
    lines += [f"# polarity: {testfield.polarity}", ",".join(_COLUMNS)]
    for row, col, xyz, diameter in zip(
        testfield.row, testfield.col, testfield.xyz_mm, testfield.diameter_mm, strict=True
    ):
        lines.append(",".join([str(row), str(col), *(f"{value:.10g}" for value in (*xyz, diameter))]))
    with atomic_write(Path(path)) as file:
        file.write(("\n".join(lines) + "\n").encode())


def write_picks(path: Path, seeds: Sequence[Seed], excluded: Sequence[tuple[int, int]] = ()) -> None:
    """Write picks.json: the picks, and the targets (row, col) that must not be used in this capture."""
    picks = [{"row": s.row, "col": s.col, "u": s.u, "v": s.v} for s in seeds]
    data: dict[str, Any] = {"format": "stripe-picks", "version": VERSION, "seeds": picks}
    if excluded:
        data["excluded"] = [[row, col] for row, col in excluded]
    write_json(Path(path), data)


def write_capture(
    folder: Path,
    role: str,
    frames: Sequence[tuple[Pattern, Image]],
    *,
    testfield: str | None = None,
    z_mm: float | None = None,
    angle_deg: float | None = None,
    seeds: Sequence[Seed] = (),
    suffix: str = ".png",
    durable: bool = True,
    extra: Mapping[str, Any] | None = None,
) -> None:
    """Write a capture: the frames first, then picks.json, then capture.json, so that what it lists is there.

    `testfield` is a path from the project.
    """
    folder = Path(folder)
    entries = []
    for i, (pattern, image) in enumerate(frames):
        name = f"{i:03d}{suffix}"
        write_image(folder / name, image, durable)
        entries.append((name, pattern))
    if seeds:
        write_picks(folder / "picks.json", seeds)
    write_capture_json(folder, role, entries, testfield=testfield, z_mm=z_mm, angle_deg=angle_deg, extra=extra)


def write_capture_json(
    folder: Path,
    role: str,
    frames: Sequence[tuple[str, Pattern]],
    *,
    testfield: str | None = None,
    z_mm: float | None = None,
    angle_deg: float | None = None,
    extra: Mapping[str, Any] | None = None,
) -> None:
    """Write capture.json for frames (file name and pattern) that are in the folder already."""
    optional = {"testfield": testfield, "z_mm": z_mm, "angle_deg": angle_deg}
    data: dict[str, Any] = {"format": "stripe-capture", "version": VERSION, "role": role}
    data |= {key: value for key, value in optional.items() if value is not None}
    data["frames"] = [{"file": name, "pattern": pattern_to_dict(pattern)} for name, pattern in frames]
    write_json(Path(folder) / "capture.json", {**data, **(extra or {})})


def add_capture(folder: Path, name: str) -> None:
    """List one more capture (a path from the project) in project.json, leaving all else as it is."""
    path = Path(folder) / "project.json"
    fields = read_document(path, "stripe-project")
    names = list(fields.items("captures")) if "captures" in fields.data else []
    if name not in names:
        write_json(path, {**fields.data, "captures": [*names, name]})
