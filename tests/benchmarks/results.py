"""The table of a run, as Markdown and JSON, and its short form in the README."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tests.benchmarks.timing import OURS, WARM, Row

BEGIN, END = "<!-- benchmarks: python -m tests.benchmarks --readme -->", "<!-- end of benchmarks -->"

# what the README shows, in this order: part, size, and how it is told there
HEADLINES = (
    ("decode", "748x576 x 28", "decode 28 frames, 748×576"),
    ("decode", "2448x2048 x 28", "decode 28 frames, 2448×2048"),
    ("intersection, 4", "748x576", "intersect, 4 observations, 748×576"),
    ("intersection, 4", "2448x2048", "intersect, 4 observations, 2448×2048"),
    ("intersection, 3", "2448x2048", "intersect, 3 observations, 2448×2048"),
    ("depth look-up", "2448x2048", "look depths up, 2448×2048"),
    ("frames to points", "2448x2048 x 28", "28 frames to points with sigmas, 2448×2048"),
    ("adjustment", "40 stations", "adjust 40 stations with all covariances"),
    ("adjustment", "400 stations", "adjust 400 stations with all covariances"),
    ("measurement", "2448x2048", "measure all targets of a 5 Mpx image"),
    ("rays", "9 rays a pixel", "cast 3.9 million rays on the virtual bench"),
    ("opening", "2000 captures", "open a project of 2,000 captures"),
    ("start", "--help", "`stripe-core --help`"),
    ("window", "first paint", "window, from start to first paint"),
    ("window", "5 Mpx image", "show the next 5 Mpx image"),
    ("window", "5,000 residuals", "draw 5,000 residual vectors"),
)


def write_results(folder: Path, rows: Sequence[Row], machine: dict[str, str], seconds: float) -> None:
    """Write table.md and table.json."""
    folder.mkdir(exist_ok=True)
    entries = [{k: None if isinstance(v, float) and math.isnan(v) else v for k, v in asdict(r).items()} for r in rows]
    data = {"machine": machine, "seconds": round(seconds, 1), "rows": entries}
    (folder / "table.json").write_text(json.dumps(data, indent=1, ensure_ascii=False) + "\n")
    lines = [f"- {name}: {text}" for name, text in machine.items()]
    lines += [
        "",
        "Times in ms; `ratio` is to the first contestant named at the same size, measured in turns with it.",
        "",
        "| part | size | contestant | median | least | rounds | ratio | peak MB | answer |",
        "|---|---|---|---:|---:|---:|---:|---:|---|",
    ]
    for r in rows:
        numbers = (_ms(r.seconds), _ms(r.least), str(r.rounds), _plain(r.ratio, 2), _plain(r.peak_mb, 0))
        lines.append(f"| {r.part} | {r.size} | {r.contestant} | {' | '.join(numbers)} | {r.right} |")
    (folder / "table.md").write_text("\n".join(lines) + "\n")


def readme_block(data: dict[str, Any]) -> str:
    """Give the README's lines of a run, table.json's content.

    Raises
    ------
    ValueError
        If the run did not measure everything that the README shows.
    """
    machine = data["machine"]
    lines = ["| | stripe workbench | in the same run (× ours) |", "|---|---:|---|"]
    for part, size, told in HEADLINES:
        rows = [r for r in data["rows"] if (r["part"], r["size"]) == (part, size)]
        ours = next((r for r in rows if r["contestant"].startswith(OURS)), None)
        if ours is None or ours["seconds"] is None:
            raise ValueError(f"table.json has no answer of ours for {part}, {size}: run the whole, `make bench`")
        others = [_beside(r, ours["seconds"]) for r in rows if r is not ours and r["contestant"] != WARM]
        lines.append(f"| {told} | {_time(ours['seconds'])} | {'; '.join(others)} |")
    source = f"Medians of one run on {machine['processor']}, {machine['memory']}, Python {machine['Python']}"
    source += f", load {machine['load']}" if "load" in machine else ""
    return "\n".join([*lines, "", f"{source}; 0.5× is half our time, 10× ten times."])


def _beside(row: dict[str, Any], ours: float) -> str:
    if row["seconds"] is None:
        return f"{row['contestant']}: {'not here' if row['right'].startswith('not run') else 'failed'}"
    ratio = row["seconds"] / ours
    return f"{row['contestant']} {_time(row['seconds'])} ({ratio:{'.0f' if ratio >= 10 else '.2g'}}×)"


def update_readme(readme: Path, table: Path) -> None:
    """Put the run of table.json between the README's two marks."""
    text = readme.read_text()
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{readme.name} has no lines {BEGIN} and {END}: put them where the table belongs")
    readme.write_text(f"{before}{BEGIN}\n{readme_block(json.loads(table.read_text()))}\n{END}{after}")


def _ms(seconds: float) -> str:
    return _plain(1e3 * seconds, 0 if seconds >= 1 else 1 if seconds >= 0.1 else 2)


def _time(seconds: float) -> str:
    return (
        f"{seconds:.3g} s"
        if seconds >= 1
        else f"{1e3 * seconds:.0f} ms"
        if seconds >= 0.1
        else f"{1e3 * seconds:.2g} ms"
    )


def _plain(value: float, digits: int) -> str:
    return "" if math.isnan(value) else f"{value:.{digits}f}"
