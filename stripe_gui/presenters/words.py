"""How texts and numbers of the core are written in the window."""

from __future__ import annotations

from stripe_gui.presenters.told import told


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
