"""The table and the plots of a benchmark run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tests.benchmarks.timing import Row


def write_results(folder: Path, rows: Sequence[Row], machine: str) -> None:
    """Write table.md, and a plot of time and peak memory for every part with several sizes."""
    folder.mkdir(exist_ok=True)
    lines = [machine, "", "| part | size | contestant | median ms | rounds | ratio | peak MB | result |"]
    lines.append("|---|---|---|---:|---:|---:|---:|---|")
    for r in rows:
        ms, ratio, peak = f"{1e3 * r.seconds:.1f}", f"{r.ratio:.2f}", f"{r.peak_mb:.0f}"
        lines.append(f"| {r.part} | {r.size} | {r.contestant} | {ms} | {r.rounds} | {ratio} | {peak} | {r.right} |")
    (folder / "table.md").write_text("\n".join(lines) + "\n")
    for part in dict.fromkeys(r.part for r in rows if r.unit):
        _plot(folder / f"{part.replace(', ', '-').replace(' ', '-')}.png", [r for r in rows if r.part == part])
    print(f"{machine}\n{folder}/table.md")


def _plot(path: Path, rows: Sequence[Row]) -> None:
    if len({r.amount for r in rows}) < 2:
        return
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), layout="constrained")
    for axes, label, values in zip(
        figure.subplots(1, 2),
        ("time, ms", "peak memory, MB"),
        ({id(r): 1e3 * r.seconds for r in rows}, {id(r): r.peak_mb for r in rows}),
        strict=True,
    ):
        for name in dict.fromkeys(r.contestant for r in rows):
            mine = [r for r in rows if r.contestant == name]
            axes.plot([r.amount for r in mine], [values[id(r)] for r in mine], "o-", label=name)
        axes.set(xlabel=rows[0].unit, ylabel=label, xscale="log", title=rows[0].part)
        axes.set_yscale("log" if label.startswith("time") else "linear")
        axes.legend(fontsize="small")
    figure.savefig(path, dpi=110)
