"""Formats by name. A file in this folder with a `FORMAT` is one."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from core.exchange.formats.format import Format

FORMATS: dict[str, Format] = {
    found.name: found
    for module in iter_modules(__path__)
    if (found := getattr(import_module(f"{__name__}.{module.name}"), "FORMAT", None)) is not None
}

__all__ = ["FORMATS", "Format"]
