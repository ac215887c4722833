"""The desktop entry, the AppStream data and the script that installs a bundle: one identity, the project's facts."""

from __future__ import annotations

import configparser
import re
import tomllib
from pathlib import Path
from xml.etree import ElementTree

import pytest

import core

ROOT = Path(__file__).parents[1]
DESKTOP = ROOT / "packaging" / "desktop"
LANGUAGE = "{http://www.w3.org/XML/1998/namespace}lang"


@pytest.fixture(scope="module")
def project() -> dict:
    return tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


@pytest.fixture(scope="module")
def entry() -> dict[str, str]:
    parser = configparser.RawConfigParser(delimiters="=", interpolation=None)
    parser.optionxform = str  # type: ignore[method-assign, assignment]  # keys are case-sensitive
    (path,) = DESKTOP.glob("*.desktop")
    parser.read(path, encoding="utf-8")
    assert parser.sections() == ["Desktop Entry"]
    return {**parser["Desktop Entry"], "id": path.stem}


@pytest.fixture(scope="module")
def component() -> ElementTree.Element:
    (path,) = DESKTOP.glob("*.metainfo.xml")
    root = ElementTree.parse(path).getroot()
    assert path.name == f"{root.findtext('id')}.metainfo.xml"  # where AppStream looks for it
    return root


def test_all_parts_know_the_program_by_one_id(entry: dict[str, str], component: ElementTree.Element) -> None:
    # the specification's form: at least three parts of letters, digits and underscores, none beginning with a digit
    assert re.fullmatch(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*){2,}", entry["id"])
    assert component.get("type") == "desktop-application"
    assert component.findtext("id") == entry["id"]
    assert component.findtext("launchable[@type='desktop-id']") == f"{entry['id']}.desktop"
    assert component.findtext("icon[@type='stock']") == entry["Icon"] == entry["id"]
    assert f"id={entry['id']}\n" in (DESKTOP / "install.sh").read_text()
    assert f'ID = "{entry["id"]}"' in (ROOT / "packaging/bundle.py").read_text()
    # by this name a desktop finds the icon of a window that is open
    assert f'setDesktopFileName("{entry["id"]}")' in (ROOT / "stripe_gui/app.py").read_text()


def test_the_programs_are_those_of_the_project(
    project: dict, entry: dict[str, str], component: ElementTree.Element
) -> None:
    programs = {*project["scripts"], *project["gui-scripts"]}
    assert {binary.text for binary in component.findall("provides/binary")} == programs
    assert entry["Exec"].split()[0] in project["gui-scripts"]
    assert f'programs="{" ".join(sorted(programs, reverse=True))}"' in (DESKTOP / "install.sh").read_text()


def test_the_latest_release_is_the_version_of_the_project(project: dict, component: ElementTree.Element) -> None:
    latest = component.find("releases/release")
    assert latest is not None
    assert latest.get("version") == core.__version__
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", latest.get("date", ""))
    assert component.findtext("project_license") == project["license"]


def test_what_the_specifications_ask_for_is_there(entry: dict[str, str], component: ElementTree.Element) -> None:
    assert {"Type", "Name", "Comment", "Exec", "Icon", "Terminal", "Categories"} <= set(entry)
    assert entry["Type"] == "Application"
    assert entry["Categories"].split(";")[0] == "Science"
    assert [category.text for category in component.findall("categories/category")] == ["Science", "Engineering"]
    assert component.findtext("metadata_license") == "CC0-1.0"
    summary = component.findtext("summary") or ""
    assert summary
    assert not summary.endswith(".")  # the specification: no sentence


def test_everything_is_told_in_german_too(entry: dict[str, str], component: ElementTree.Element) -> None:
    for key in ("Name", "GenericName", "Comment", "Keywords"):
        assert entry[f"{key}[de]"]
    assert entry["Name"] == component.findtext("name")
    for tag in ("name", "summary", "description/p", "description/ul/li"):
        texts = component.findall(tag)
        german = [text for text in texts if text.get(LANGUAGE) == "de"]
        assert len(texts) == 2 * len(german) > 0, tag
    german_name = next(name.text for name in component.findall("name") if name.get(LANGUAGE) == "de")
    assert german_name == entry["Name[de]"]
    texts = (ROOT / "resources/translations/stripe_de.ts").read_text(encoding="utf-8")
    assert re.search(rf"<source>{entry['Name']}</source>\s*<translation>{german_name}</translation>", texts)
