"""Bills of materials, as CycloneDX 1.5 has them: what a bundle holds, and what a wheel holds and asks for."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from datetime import UTC, datetime
from email.message import Message
from pathlib import Path

FONTS = "DejaVu fonts", "2.35", "Bitstream-Vera"  # in resources/fonts


@dataclass(frozen=True)
class Component:
    """A part: what its owner calls it, the licence in a word, its texts by their place in a folder."""

    name: str
    version: str
    licence: str
    texts: dict[str, Path] = field(default_factory=dict)
    purl: str = ""  # where it comes from
    asked: str = ""  # what a wheel asks for, which pip then chooses


def bill(own: Component, components: list[Component]) -> dict[str, object]:
    """List the parts of a program; the same parts give the same list, whenever and wherever it is made."""
    metadata: dict[str, object] = {"component": {"type": "application", "bom-ref": own.name, **_listed(own)}}
    if epoch := os.environ.get("SOURCE_DATE_EPOCH"):
        metadata["timestamp"] = datetime.fromtimestamp(int(epoch), UTC).isoformat()
    parts = [{"type": "library", "bom-ref": c.name, **_listed(c)} for c in components]
    uses = [{"ref": own.name, "dependsOn": [c.name for c in components]}]
    head = {"bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1}
    return {**head, "metadata": metadata, "components": parts, "dependencies": uses}


def of_wheel(metadata: Message) -> dict[str, object]:
    """List what a wheel holds, and what its metadata asks for beside it; what an extra asks for is optional."""
    own = Component(metadata["Name"], metadata["Version"], metadata["License-Expression"])
    asked: dict[str, list[str]] = {}
    for line in metadata.get_all("Requires-Dist", []):
        asked.setdefault(pypi(re.split(r"[^\w.-]", line)[0]), []).append(line)
    asked.pop(pypi(own.name), None)  # extras that hold others
    parts = [Component(name, "", "", purl=f"pkg:pypi/{name}", asked=" | ".join(asked[name])) for name in sorted(asked)]
    return bill(own, [Component(*FONTS), *parts])


def pypi(name: str) -> str:
    """Write a distribution's name as the index does."""
    return re.sub("[-_.]+", "-", name).lower()


def _listed(component: Component) -> dict[str, object]:
    listed: dict[str, object] = {"name": component.name}
    if component.version:
        listed["version"] = component.version
    if component.purl:
        listed["purl"] = component.purl
    if not component.asked:
        return {**listed, "licenses": [{"license": {"name": component.licence or "see its text"}}]}
    optional = all("extra ==" in line for line in component.asked.split(" | "))
    told = {"scope": "optional" if optional else "required"}
    return {**listed, **told, "properties": [{"name": "requirement", "value": component.asked}]}
