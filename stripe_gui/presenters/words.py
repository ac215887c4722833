"""How texts and numbers of the core are written in the window."""

from __future__ import annotations


def sentence(text: str) -> str:
    """Begin with a capital letter, unless the first word is no plain word: names of files, captures and symbols stay.

    Examples
    --------
    >>> sentence("out of memory")
    'Out of memory'
    >>> sentence("testfield-03: two picks on one target")
    'testfield-03: two picks on one target'
    """
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
