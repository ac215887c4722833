"""The published JSON Schema of the files that this room reads."""

from __future__ import annotations

from core.resources import resource


def files_schema() -> str:
    """Give the schema of project.json, capture.json, picks.json and network.json; tests compare it with the readers."""
    return resource("schemas", "files.schema.json").read_text(encoding="utf-8")
