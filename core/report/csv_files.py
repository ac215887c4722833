"""Tables and measured values as CSV for other programs: units in the header, whole files or none.

Commas between values, a point in numbers, UTF-8 with the mark by which spreadsheets know it; lines that start with #
are notes.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from core.atomic import atomic_write
from core.progress import SILENT, Progress
from core.report.table import Cell, Number, Table

ENCODING = "utf-8-sig"
FORMULA = ("=", "+", "-", "@", "\t", "\r")  # what makes a spreadsheet compute
_INNER = re.compile(r"(?<=[,;\t])\s*(?=[=+\-@])")  # a note may be split at its commas
APOSTROPHE = " '"
ROWS_AT_ONCE = 20_000  # between two looks at whether to stop


def table_file(table: Table) -> str:
    """Name the file of a table by its number, or by the words before its first comma.

    Examples
    --------
    >>> table_file(Table("Table 1a. Interior orientation of the camera", (), ()))
    'table-1a.csv'
    """
    words = table.title.partition(".")[0] if table.title.startswith("Table") else table.title.partition(",")[0]
    return "".join(c if c.isalnum() else "-" for c in words.lower()).strip("-") + ".csv"


def write_table_csv(path: Path, table: Table) -> None:
    """Write a table: header, rows, and the notes as comment lines.

    Numbers have the table's digits, without the marks that refer to notes; what is not known is empty.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\r\n")
    writer.writerow([as_text(column) for column in table.columns])
    writer.writerows([[_plain(cell) for cell in row] for row in table.rows])
    for note in table.notes:
        text.write(f"# {_INNER.sub(APOSTROPHE, note)}\r\n")
    with atomic_write(path) as file:
        file.write(text.getvalue().encode(ENCODING))


def write_columns_csv(
    path: Path, columns: Mapping[str, ArrayLike], digits: Sequence[int], *, progress: Progress = SILENT
) -> int:
    """Write arrays of equal length side by side; give the number of rows.

    Columns are by name with unit, such as ``"u [px]"``; NaN becomes an empty field. `digits` are the decimals of each.

    Raises
    ------
    InputError
        If the file cannot be written.
    Cancelled
        If the user stopped. In both cases what was there before stays.
    """
    values = np.column_stack([np.asarray(v, np.float64) for v in columns.values()])
    line = ",".join(f"%.{d}f" for d in digits)
    head = io.StringIO()
    csv.writer(head, lineterminator="\r\n").writerow([as_text(column) for column in columns])
    with atomic_write(path) as file:
        file.write(head.getvalue().encode(ENCODING))
        for start in range(0, len(values), ROWS_AT_ONCE):
            progress(start / len(values), path.name)
            rows = values[start : start + ROWS_AT_ONCE]
            text = "\r\n".join(line % tuple(row) for row in rows.tolist())
            file.write(text.replace("nan", "").encode() + b"\r\n")
    progress(1.0, path.name)
    return len(values)


def _plain(cell: Cell) -> str:
    if isinstance(cell, Number):
        return Number(cell.value, cell.spec).text if np.isfinite(cell.value) else ""
    return as_text(cell or "")


def as_text(cell: str) -> str:
    """Give a cell so that spreadsheets take it for text, not for a formula; numbers stay numbers.

    Examples
    --------
    >>> as_text("=1+1"), as_text("-15.5"), as_text("plane+00")
    ("'=1+1", '-15.5', 'plane+00')
    """
    if not cell.lstrip().startswith(FORMULA):
        return cell
    try:
        float(cell)
    except ValueError:
        return f"'{cell}"
    return cell
