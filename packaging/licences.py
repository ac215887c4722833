"""The licences of all that goes into the bundle, found by where its files come from; `stripe.spec` calls `collect`.

A file belongs to the program itself, to a Python distribution, to Python or to a Debian package. If it is not known
whose a file is, or what the owner's licence says, there is no bundle.
"""

from __future__ import annotations

import json
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable
from importlib.metadata import Distribution, distribution, distributions
from pathlib import Path

from bill import Component, bill, pypi

ROOT = Path(__file__).parents[1]
STDLIB = Path(sysconfig.get_path("stdlib")).resolve()
COMMON = Path("/usr/share/common-licenses")  # Debian's copies of the usual ones; its packages refer to them
NEEDED = {"LGPL-3": ("LGPL-3", "GPL-3"), "BSD": ("BSD",)}  # of these, by those that bring no text of their own
TEXT = re.compile(r"(LICEN[CS]E|COPYING|NOTICE)(?!.*\.py$)", re.IGNORECASE)

HEAD = """\
What this bundle is made of. Each part has a folder here with its licence; common/ has what these refer to.

Qt, PySide6 and shiboken6 are used under the LGPL 3: they are shared libraries in _internal, which you may replace.
Their sources: https://download.qt.io/official_releases. The works of others within Qt and their licences:
https://doc.qt.io/qt-6/licenses-used-in-qt.html. The sources of Debian's packages: https://snapshot.debian.org.
"""


class LicenceError(Exception):
    """The bundle may not be given on: whose a part is, or on which terms, is not known."""


def collect(sources: Iterable[str], folder: Path) -> None:
    """Write the licences of all that these files belong to, and lists of the parts: INDEX.txt, CycloneDX."""
    components = find_components({Path(source).resolve() for source in sources})
    for component in components:
        for place, text in component.texts.items():
            out = folder / component.name / place
            out.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(text, out)
    texts = [path.read_bytes() for path in folder.rglob("*") if path.is_file()]
    for name in {name.decode() for text in texts for name in re.findall(rb"/common-licenses/([\w.+-]*\w)", text)}:
        (folder / "common").mkdir(exist_ok=True)
        shutil.copyfile(common(name), folder / "common" / name)
    own = next(component for component in components if component.name == "stripe-workbench")
    listed = bill(own, [component for component in components if component is not own])
    (folder / "sbom.cdx.json").write_text(json.dumps(listed, indent=1) + "\n", encoding="utf-8")
    rows = [f"{c.name:28} {c.version:28} {c.licence}" for c in components]
    (folder / "INDEX.txt").write_text("\n".join([HEAD, *rows, ""]))


def find_components(files: set[Path]) -> list[Component]:
    """Tell the owners of files, in the order of their names."""
    owners = {
        Path(str(package.locate_file(file))).resolve(): package.name
        for package in distributions()
        for file in package.files or []
    }
    names = {owners[file] for file in files if file in owners} - {"stripe-workbench"}
    rest = {file for file in files - owners.keys() if not (is_own(file) or is_of_python(file))}
    found = [of_program(), of_python(), *(of_distribution(distribution(name)) for name in names)]
    found += [of_package(name) for name in debian_owners(rest)]
    return sorted(found, key=lambda component: component.name.lower())


def is_own(file: Path) -> bool:
    """Whether a file is the program's, or made while the bundle is built: below the project, not in an environment."""
    return file.is_relative_to(ROOT) and not file.is_relative_to(sys.prefix)


def is_of_python(file: Path) -> bool:
    """Whether a file belongs to Python itself."""
    return file.is_relative_to(STDLIB) or file.name.startswith("libpython")


def of_program() -> Component:
    """Tell the terms of the program itself and of the fonts it brings along."""
    metadata = distribution("stripe-workbench").metadata
    texts = {path.name: path for path in (ROOT / "LICENSE", *ROOT.glob("resources/fonts/LICENSE*"))}
    return Component(metadata["Name"], metadata["Version"], metadata["License-Expression"], texts)


def of_python() -> Component:
    """Tell the terms of Python and its library."""
    return Component("Python", platform.python_version(), "PSF-2.0", {"LICENSE.txt": existing(STDLIB / "LICENSE.txt")})


def of_distribution(package: Distribution) -> Component:
    """Tell the terms of a Python distribution: by its texts, else by what it says of itself and the common licence."""
    licence = stated(package)
    files = [file for file in package.files or [] if TEXT.match(file.name)]
    # a package may hold others with their own: below which folder tells whose
    texts = {"/".join(f.parts[1:]).replace("../", "") or f.name: Path(str(package.locate_file(f))) for f in files}
    if not texts:
        (kind,) = [kind for kind in NEEDED if kind in licence] or [""]
        if not kind:
            raise LicenceError(f"{package.name}: brings no licence text, and states {licence!r}; extend NEEDED")
        metadata = next(file for file in package.files or [] if file.name == "METADATA")
        texts = {"METADATA": Path(str(package.locate_file(metadata))), **{name: common(name) for name in NEEDED[kind]}}
    purl = f"pkg:pypi/{pypi(package.name)}@{package.version}"
    return Component(package.name, package.version, licence, texts, purl)


def stated(package: Distribution) -> str:
    """Give the licence in a word, as a distribution states it."""
    metadata = package.metadata
    told = metadata.get("License-Expression") or metadata.get("License", "")
    classifiers = [c.rpartition(" :: ")[2] for c in metadata.get_all("Classifier", []) if c.startswith("License")]
    return told if told and len(told) < 80 else ", ".join(classifiers)


def debian_owners(files: set[Path]) -> set[str]:
    """Name the packages that files come from."""
    # older packages know them below /lib, which is /usr/lib since
    names = {str(file): file for file in files} | {str(file).removeprefix("/usr"): file for file in files}
    told = subprocess.run(["dpkg-query", "-S", *names], capture_output=True, text=True, check=False).stdout
    owners = {names[path]: package for package, path in (line.split(": ", 1) for line in told.splitlines())}
    if unknown := sorted(str(file) for file in files if file not in owners):
        raise LicenceError(f"{unknown[0]}: belongs to no package, nor do {len(unknown) - 1} others; leave them out")
    return set(owners.values())


def of_package(name: str) -> Component:
    """Tell the terms of a Debian package."""
    short = name.partition(":")[0]
    told = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", name], capture_output=True, text=True, check=True)
    path = existing(Path("/usr/share/doc", short, "copyright"))
    kinds = dict.fromkeys(re.findall(r"^License: *(\S.*)", path.read_text(encoding="utf-8"), re.MULTILINE))
    licence = f"{next(iter(kinds))}{', and others' if len(kinds) > 1 else ''}" if kinds else "see its copyright file"
    return Component(short, told.stdout, licence, {"copyright": path}, f"pkg:deb/debian/{short}@{told.stdout}")


def common(name: str) -> Path:
    """Give the text of a common licence."""
    return existing(COMMON / name)


def existing(path: Path) -> Path:
    """Give back the path of a text that is there."""
    if not path.is_file():
        raise LicenceError(f"{path}: this licence is not there; build on a Debian or Ubuntu that keeps these texts")
    return path
