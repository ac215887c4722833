"""The German window: every text translated, compiled and shown; the help chapters follow the English ones."""

from __future__ import annotations

import ast
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QTranslator
from PySide6.QtWidgets import QAbstractButton, QComboBox, QLabel, QMenu, QTabBar, QWidget

import stripe_gui
from core.resources import resource
from stripe_gui.widgets.help_panel import help_file

TS = resource("translations", "stripe_de.ts")
QM = resource("translations", "stripe_de.qm")
SOURCES = Path(stripe_gui.__file__).parent
CHAPTERS = sorted(path.stem for path in resource("help").glob("*.md"))
PLACEHOLDER = re.compile(r"\{[^}]*\}")
HOW_TO_UPDATE = "run resources/translations/update.sh and translate what is new"

Key = tuple[str, str]  # context, English text


def messages(ts: Path) -> dict[Key, ElementTree.Element]:
    """Give the translation element of every text in a .ts file."""
    found = {}
    for context in ElementTree.parse(ts).getroot().iter("context"):
        for message in context.iter("message"):
            element = message.find("translation")
            assert element is not None
            found[context.findtext("name", ""), message.findtext("source", "")] = element
    return found


@pytest.fixture(scope="module")
def german() -> dict[Key, str]:
    return {key: element.text or "" for key, element in messages(TS).items()}


@pytest.fixture
def german_window(program, finished: Path, qtbot):
    program.choose_language("de")
    with qtbot.waitExposed(program.window):
        program.window.show()
    program.window.open_path(finished)
    return program.window


def tool(name: str) -> str:
    """Give one of PySide's tools, as installed beside this Python."""
    found = shutil.which(name, path=str(Path(sys.executable).parent))
    assert found is not None, f"{name} comes with PySide6-Essentials"
    return found


def texts_in_code() -> Iterator[tuple[Path, str, list[ast.expr]]]:
    """Give every call that translates: its file, its context ("" where the call names it itself), its arguments."""

    def calls(file: Path, node: ast.AST, context: str) -> Iterator[tuple[Path, str, list[ast.expr]]]:
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            if called == "self.tr":
                yield file, context, node.args
            elif called in ("translate", "QCoreApplication.translate"):
                yield file, "", node.args
        for child in ast.iter_child_nodes(node):
            yield from calls(file, child, node.name if isinstance(node, ast.ClassDef) else context)

    for file in sorted(SOURCES.rglob("*.py")):
        yield from calls(file, ast.parse(file.read_text(encoding="utf-8")), "")


def test_every_text_is_translated() -> None:
    left = [key for key, element in messages(TS).items() if element.get("type") or not element.text]
    assert not left, HOW_TO_UPDATE


def test_placeholders_are_the_same_on_both_sides(german: dict[Key, str]) -> None:
    wrong = {
        key: text
        for key, text in german.items()
        if Counter(PLACEHOLDER.findall(key[1])) != Counter(PLACEHOLDER.findall(text))
    }
    assert not wrong


def test_spaces_and_ends_of_pieces_are_kept(german: dict[Key, str]) -> None:
    wrong = []
    for (context, english), text in german.items():
        ends = [(s[: len(s) - len(s.lstrip())], s[len(s.rstrip()) :], s.rstrip()[-1] in ".?:") for s in (english, text)]
        if ends[0] != ends[1]:
            wrong.append((context, english, text))
    assert not wrong


def test_all_texts_in_the_code_are_literal_and_in_the_table(german: dict[Key, str]) -> None:
    found = list(texts_in_code())
    spoilt = [
        f"{file.name}:{args[0].lineno}"
        for file, _, args in found
        if not all(isinstance(arg, ast.Constant) and isinstance(arg.value, str) for arg in args)
    ]
    assert not spoilt, "an f-string or a variable cannot be translated"
    keys = {
        (context, ast.literal_eval(args[0])) if context else (ast.literal_eval(args[0]), ast.literal_eval(args[1]))
        for _, context, args in found
    }
    assert len(keys) > 500
    assert keys - set(german) == set(), HOW_TO_UPDATE


def test_the_table_holds_what_lupdate_finds_now(tmp_path: Path, german: dict[Key, str]) -> None:
    copy = tmp_path / "stripe_de.ts"
    files = [str(file) for file in sorted(SOURCES.rglob("*.py"))]
    command = [tool("pyside6-lupdate"), *files, "-no-obsolete", "-locations", "none", "-ts", str(copy)]
    subprocess.run(command, check=True, capture_output=True, timeout=60)
    assert set(messages(copy)) == set(german), HOW_TO_UPDATE


def test_the_compiled_table_is_that_of_the_texts(tmp_path: Path, german: dict[Key, str]) -> None:
    fresh = tmp_path / "stripe_de.qm"
    command = [tool("pyside6-lrelease"), str(TS), "-qm", str(fresh)]
    subprocess.run(command, check=True, capture_output=True, timeout=60)
    for file in (fresh, QM):
        translator = QTranslator()
        assert translator.load(str(file))
        assert {key: translator.translate(*key) for key in german} == german, f"{file}: {HOW_TO_UPDATE}"


@pytest.mark.parametrize("language", ["en", "de"])
def test_letters_of_the_menus_are_unique(program, language: str) -> None:
    program.choose_language(language)
    bar = program.window.menuBar()
    for actions in (bar.actions(), *(menu.actions() for menu in bar.findChildren(QMenu))):
        texts = [action.text().replace("&&", "") for action in actions if "&" in action.text()]
        letters = Counter(text[text.index("&") + 1].lower() for text in texts)
        assert max(letters.values(), default=0) <= 1, texts


def only_english() -> set[str]:
    """Texts that no German window shows."""
    table = {key[1]: element.text for key, element in messages(TS).items()}
    return set(table) - set(table.values())


def said(widget: QWidget) -> Iterator[str]:
    """Give what labels, buttons, choices and tabs say, and what a screen reader reads."""
    for child in widget.findChildren(QWidget):
        yield child.accessibleName()
        if isinstance(child, QLabel | QAbstractButton):
            yield child.text().strip()
        elif isinstance(child, QComboBox):
            yield from (child.itemText(i) for i in range(child.count()))
        elif isinstance(child, QTabBar):
            yield from (child.tabText(i) for i in range(child.count()))


def test_titles_buttons_and_the_help_are_german(german_window) -> None:
    for page, title, word in (
        ("capture", "Aufnehmen", "Bilder"),
        ("measure", "Messen", "Alle messen"),
        ("calibrate", "Kalibrieren", "Kalibrieren"),
        ("evaluate", "Beurteilen", "Beurteilen"),
        ("report", "Bericht", "Bericht schreiben"),
    ):
        german_window.show_page(page)
        assert german_window.page.heading.text() == title
        assert word in set(said(german_window.page))
    german_window.help.show_topic("calibrate")
    assert german_window.help.browser.toPlainText().startswith("Kalibrieren")


@pytest.mark.parametrize("chapter", CHAPTERS)
def test_a_german_chapter_follows_the_english_one(chapter: str) -> None:
    file = help_file(chapter, "de")
    assert file is not None
    assert file.parent.name == "de", f"{chapter}.md is not translated"
    english = resource("help", f"{chapter}.md").read_text(encoding="utf-8")
    text = file.read_text(encoding="utf-8")
    for pattern in (
        r"^#+ ",  # headings, with their depth
        r"^(?:    .*|)$\n?(?=    )|^    .*$",  # blocks of code
        r"(?<=\]\()(?:\.\./)?([^)]*)",  # links and images
        r"^\|",  # rows of tables
        r"^\d+\. ",  # steps
    ):
        assert re.findall(pattern, text, re.MULTILINE) == re.findall(pattern, english, re.MULTILINE)
    for link in re.findall(r"(?<=\]\()[^)#:]*", text):
        assert (file.parent / link).is_file() or resource("help", link).is_file(), link


def test_the_help_names_buttons_as_the_window_does(german: dict[Key, str]) -> None:
    texts = {text.replace("&", "").removesuffix("…").strip(" .:") for text in german.values()}
    named = {
        name
        for chapter in CHAPTERS
        for name in re.findall(
            r"(?<![*\w])\*([^*\n]+)\*(?!\*)", resource("help", "de", f"{chapter}.md").read_text(encoding="utf-8")
        )
    }
    unknown = {name for name in named if not all(part.strip() in texts for part in re.split("[>›]", name))}
    assert not unknown
