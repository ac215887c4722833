"""Points for other programs: a file in this folder with an `EXPORTER` is one kind of file, chosen by its ending."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from core.errors import InputError
from core.reconstruct.export.exporter import Exporter
from core.reconstruct.export.npz import write_npz
from core.reconstruct.export.ply import write_ply

EXPORTERS: dict[str, Exporter] = {
    found.ending: found
    for module in iter_modules(__path__)
    if (found := getattr(import_module(f"{__name__}.{module.name}"), "EXPORTER", None)) is not None
}


def exporter_for(path: Path, joined: bool = False) -> Exporter:
    """Choose by a file name's ending; `joined` for points of several images, which have no pixels.

    Raises
    ------
    InputError
        For an ending that is not known, or of a mesh that would have no triangles; it lists those that will do.
    """
    ending = path.suffix.lower()
    if ending not in EXPORTERS:
        known = ", ".join(sorted(EXPORTERS))
        raise InputError(path, f"ends in {path.suffix!r}", f"give a file name ending in one of {known}")
    if joined and EXPORTERS[ending].holds == "mesh":
        others = ", ".join(sorted(ending for ending, kind in EXPORTERS.items() if kind.holds != "mesh"))
        seen = "is of triangles between neighbouring pixels, which points of several images are not"
        raise InputError(path, seen, f"give a file name ending in one of {others}, or one capture's points by --camera")
    return EXPORTERS[ending]


__all__ = ["EXPORTERS", "Exporter", "exporter_for", "write_npz", "write_ply"]
