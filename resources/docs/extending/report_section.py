"""
A report section
================

Tables and pictures, used for both HTML and PDF and written as CSV by ``stripe-core tables``. A section without content
is left out.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

from core.pipeline import simulate_project
from core.report import CHAPTERS, Chapter, Number, ReportData, Table


def weather(data):
    """Give the section's tables from the contents of a report."""
    rows = (("air [°C]", Number(20.5, ".1f")), ("pressure [hPa]", Number(1013.2, ".1f")))
    return [Table(f"Weather over {data.project.name}", ("quantity", "value"), rows)]


CHAPTERS["weather"] = Chapter("Weather of the day", weather)

# %%
# What it says about a project.
project = simulate_project(Path(tempfile.mkdtemp()) / "quick", "quick")
(table,) = CHAPTERS["weather"].tables(ReportData(project))
figure, axes = plt.subplots(figsize=(5, 1.6))
axes.set_axis_off()
axes.set_title(table.title)
axes.table([[name, str(cell)] for name, cell in table.rows], colLabels=table.columns, loc="center")
plt.show()
