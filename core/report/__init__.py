"""The report: what was calibrated and how well it measures, in numbers, figures and words.

Reads `core.model` and `core.geometry` alone and computes nothing that a stage before it should have computed.

data.py        what a report is made of, and where it is written
published.py   the printed results of an experiment that the rig repeats
table.py       a table of plain numbers, and its form in a terminal
numbers.py     Tables 1 to 3: interior orientation, adjustment, plane-table; and the depth calibration
adjusted.py    coverage of the images, correlations and point sigmas of an adjustment
sign_off.py    who answers for the figures, and whether the planes stay within a tolerance
chapters.py    what stands in the report, in order: a registry
csv_files.py   tables and measured values as CSV
words.py       the summary: sentences with the figures in them, what was warned of, what is missing
figures/       the drawings, one room of their own
document.py    what stands where, for HTML and PDF alike
html.py        one self-contained HTML file, also of the checks before the first calibration
pdf.py         the same content on A4 pages
seal.py        who signed a report, and whether it was changed since
board.py       a testfield to print at true size, PDF and SVG
write.py       both files, written whole or not at all

Examples
--------
>>> from core.report import Number, Table, text_table
>>> print(text_table(Table("Base", ("quantity", "value"), (("length", Number(250.0, ".1f")),), ("measured twice",))))
Base
quantity  value
--------  -----
length    250.0
measured twice
"""

from core.report.chapters import CHAPTERS, Chapter, tables
from core.report.csv_files import table_file, write_columns_csv, write_table_csv
from core.report.data import ReportData, ReportPaths, SignOff, Tolerance, verdicts_of
from core.report.sign_off import Conformity, conformity
from core.report.table import Number, Table, cell_text, text_table
from core.report.words import Summary, summary
from core.report.write import write_report

__all__ = [
    "CHAPTERS", "Chapter", "Conformity", "Number", "ReportData", "ReportPaths", "SignOff", "Summary", "Table",
    "Tolerance", "cell_text", "conformity", "summary", "table_file", "tables", "text_table", "verdicts_of",
    "write_columns_csv", "write_report", "write_table_csv",
]  # fmt: skip
