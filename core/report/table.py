"""A table of plain numbers, without layout, and its form in a terminal."""

from __future__ import annotations

import unicodedata
from math import floor, isfinite, log10

from core.digits import fixed
from core.lazy import dataclass

MISSING = "–"


@dataclass(frozen=True)
class Number:
    """A number and how many of its digits mean something.

    `spec` is a format specification; ``"E6"`` for six digits after a leading ``0.`` with an exponent, as additional
    parameters are usually printed; or ``"F4"`` as `fixed` writes it. `mark` refers to a note of the table.

    Examples
    --------
    >>> Number(12.1027651, ".6f").text, Number(-0.000603793, "E6").text, Number(-0.001, ".2f").text
    ('12.102765', '-0.603793e-3', '0.00')
    """

    value: float
    spec: str
    mark: str = ""

    @property
    def text(self) -> str:
        """The number in its digits, with its mark."""
        if not isfinite(self.value):
            body = MISSING
        elif self.spec.startswith("E"):
            body = _leading_zero(self.value, int(self.spec[1:]))
        elif self.spec.startswith("F"):
            body = fixed(self.value, int(self.spec[1:]))
        else:
            body = format(self.value, self.spec)
            body = body if float(body) else body.replace("-", "")  # nothing is left of the sign of a rounded zero
        return f"{body} ({self.mark})" if self.mark else body


Cell = Number | str | None


@dataclass(frozen=True)
class Table:
    """A table; the first cell of every row names the row.

    Columns may name their unit in square brackets. `notes` stand below the table.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    notes: tuple[str, ...] = ()


def cell_text(cell: Cell) -> str:
    """Give a cell as text; what is not known is a dash."""
    if cell is None:
        return MISSING
    return cell.text if isinstance(cell, Number) else cell


def numeric_columns(table: Table) -> tuple[bool, ...]:
    """Say of every column whether it holds numbers, and so is set flush right."""
    return tuple(any(isinstance(row[i], Number) for row in table.rows) for i in range(len(table.columns)))


def text_table(table: Table) -> str:
    """Set a table in monospaced type: title, header, rows, notes, without a line break at the end."""
    cells = [[cell_text(cell) for cell in row] for row in table.rows]
    heads = [column.split(" [") for column in table.columns]
    lines = [[head[0] for head in heads]]
    if any(len(head) > 1 for head in heads):
        lines.append([f"[{head[1]}" if len(head) > 1 else "" for head in heads])
    widths = [max(_width(row[i]) for row in [*lines, *cells]) for i in range(len(table.columns))]
    right = numeric_columns(table)

    def set_row(row: list[str]) -> str:
        parts = [_pad(text, width, flush) for text, width, flush in zip(row, widths, right, strict=True)]
        return "  ".join(parts).rstrip()

    rule = "  ".join("-" * width for width in widths)
    return "\n".join([table.title, *map(set_row, lines), rule, *map(set_row, cells), *table.notes])


def _pad(text: str, width: int, right: bool) -> str:
    space = " " * (width - _width(text))
    return space + text if right else text + space


def _width(text: str) -> int:
    """Columns a text takes in a terminal: East Asian characters two, combining marks none."""
    wide = sum(2 if unicodedata.east_asian_width(c) in "WF" else 1 for c in text)
    return wide - sum(1 for c in text if unicodedata.combining(c))


def _leading_zero(value: float, digits: int) -> str:
    if value == 0:
        return f"{0:.{digits}f}"
    exponent = floor(log10(abs(value))) + 1
    mantissa = round(value / 10.0**exponent, digits)
    if abs(mantissa) >= 1:  # rounded up to the next power of ten
        mantissa, exponent = mantissa / 10, exponent + 1
    return f"{mantissa:.{digits}f}e{exponent:d}"
