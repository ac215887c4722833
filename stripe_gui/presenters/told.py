"""What the core says, in the operator's language.

The core speaks English, with its figures within the sentences. `translations/core_LANGUAGE.json` has the pattern of
each sentence, ``{}`` for what varies, with its translation; what varies is looked up again.
"""

from __future__ import annotations

import json
import re
from functools import lru_cache

from PySide6.QtCore import QCoreApplication

from core.resources import resource

translate = QCoreApplication.translate  # of the window's own texts: context and text

EDGE = " ;:,."  # of a piece: belongs to where it stands
NAMES = 3  # words at most of what a sentence is of
PAUSES = ("; ", ". ", ": ", " (", ", ")  # between sentences that the core has put together
FIGURES = r"([-+±\d.,%°e]*)"
_patterns: list[tuple[str, re.Pattern[str], str]] = []  # longest fragment, pattern, translation; the surest first


def speak(language: str) -> None:
    """Take another language."""
    told.cache_clear()
    file = resource("translations", f"core_{language}.json")
    table = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    _patterns[:] = [_pattern(english, text) for english, text in sorted(table.items(), key=_weight, reverse=True)]


def _weight(item: tuple[str, str]) -> tuple[bool, int]:
    return not item[0].startswith("{}"), len(item[0].replace("{}", ""))


def _pattern(english: str, text: str) -> tuple[str, re.Pattern[str], str]:
    pieces = english.strip(EDGE).split("{}")
    said = sum(map(str.isalpha, "".join(pieces)))
    gap = FIGURES if said < 4 else "(.*?)"  # a word or two would be found in any sentence
    expression = gap.join(map(re.escape, pieces))
    if expression.startswith("(.*?)"):  # what stands before a colon is no part of it
        expression = f"((?:(?!: ).)*?){expression[5:]}"
    return max(pieces, key=len), re.compile(expression, re.DOTALL), text.strip(EDGE)


@lru_cache(maxsize=4096)
def told(text: str) -> str:
    """Give a text of the core as the operator reads it; unknown parts of it stay as they are."""
    said = text.strip(EDGE)
    if not _patterns or not said:
        return text
    before, _, after = text.partition(said)
    if (known := _known(said)) is not None:
        return f"{before}{known}{after}"
    name, colon, _ = said.partition(": ")
    first_of_all = (": ",) if colon and len(name.split()) <= NAMES and PAUSES[0] not in name else ()
    for pause in (*first_of_all, *PAUSES):
        if ends := [found.start() for found in re.finditer(re.escape(pause), said)]:
            end = next((end for end in ends if _known(said[:end]) is not None), ends[0])
            return f"{before}{told(said[:end])}{pause}{told(said[end + len(pause) :])}{after}"
    return f"{told(text[:-1])})" if text.endswith(")") else text


def _known(said: str) -> str | None:
    """Give the translation of what is one sentence of the table; None if it is not."""
    for fragment, pattern, translation in _patterns:
        if fragment in said and (found := pattern.fullmatch(said)):
            return translation.format(*map(told, found.groups()))
    return None


def sentence(text: str) -> str:
    """Say it in the operator's language, with a capital letter first; names of files, captures and symbols stay.

    Examples
    --------
    >>> sentence("out of memory")
    'Out of memory'
    >>> sentence("testfield-03: two picks on one target")
    'testfield-03: two picks on one target'
    """
    text = told(text)
    first = text.split(" ", 1)[0].rstrip(",;")
    return f"{text[:1].upper()}{text[1:]}" if first.isalpha() else text


def signed(value: float, unit: str) -> str:
    """Give a number with its sign, zero without.

    Examples
    --------
    >>> signed(-15.0, "°"), signed(0.0, " mm")
    ('-15°', '0 mm')
    """
    return f"{value:+g}{unit}" if value else f"0{unit}"
