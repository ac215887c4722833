"""Plots of a run: time and peak memory against pixels, frames, stations, captures; both axes logarithmic."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tests.benchmarks.timing import FLOOR, OURS, WARM, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_INK, _FAINT = "#222222", "#8a8a8a"
# Okabe and Ito's colours, told apart by colour-blind readers too; a marker of its own for each
_PEERS = (("#d55e00", "s"), ("#009e73", "^"), ("#cc79a7", "D"), ("#e69f00", "v"), ("#56b4e9", "P"), ("#7f6000", "X"))
_TITLES = {
    "decode": "Decoding 28 frames to u, v, their sigmas, modulation and validity",
    "decode, frames": "Decoding against the number of frames, 748 × 576 pixels",
    "intersection, 4": "Intersection with 4 observations and sigmas",
    "intersection, 3": "Intersection with 3 observations and sigmas",
    "depth look-up": "Depth look-up with sigma",
    "frames to points": "From 28 frames in memory to points with sigmas",
    "measurement": "Measuring the 247 targets of an image",
    "rays": "Casting rays in the virtual bench",
    "adjustment": "Bundle adjustment of 247 points with all covariances",
    "opening": "Opening a project and the checks of its captures",
    "batch": "Reading and decoding many captures of 28 frames, 748 × 576 pixels",
}


def write_plots(folder: Path, rows: Sequence[Row]) -> list[Path]:
    """Draw a figure for every part that was measured at several sizes; give the files written."""
    for old in folder.glob("*.png"):
        old.unlink()
    written = []
    for part in dict.fromkeys(row.part for row in rows if row.unit):
        own = [row for row in rows if row.part == part and row.unit and not row.failed]
        if len({row.amount for row in own}) > 1:
            written.append(folder / f"{part.replace(',', '').replace(' ', '-')}.png")
            _figure(written[-1], own)
    return written


def _figure(path: Path, rows: Sequence[Row]) -> None:
    from matplotlib.figure import Figure

    part, unit = rows[0].part, rows[0].unit
    style = _styles(list(dict.fromkeys(row.contestant for row in rows)))
    figure = Figure(figsize=(10.5, 5.2), layout="constrained", facecolor="white")
    figure.suptitle(_TITLES.get(part, part.capitalize()), fontsize=13, color=_INK, x=0.01, ha="left", weight="bold")
    time, memory = figure.subplots(1, 2)
    _panel(time, rows, {id(r): 1e3 * r.seconds for r in rows}, style)
    # below a tenth of a megabyte the kernel's own steps are all there is to see
    _panel(memory, rows, {id(r): r.peak_mb if r.peak_mb >= 0.1 else math.nan for r in rows}, style)
    time.set_ylabel("time, median of rounds [ms]", color=_INK)
    memory.set_ylabel("peak memory above the input [MB]", color=_INK)
    sizes = dict(sorted({row.amount: row.size for row in rows}.items()))
    for axes in (time, memory):
        axes.set_xlabel(unit, color=_INK)
        axes.set_xlim(min(sizes) / 1.3, max(sizes) * 1.3)
        axes.set_xticks(list(sizes), [_tick(amount) for amount in sizes], minor=False)
        axes.xaxis.set_minor_locator(_none())
    handles, labels = time.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(4, len(labels)), frameon=False, fontsize=10)
    figure.savefig(path, dpi=130)


def _panel(axes: Axes, rows: Sequence[Row], values: dict[int, float], style: dict[str, dict[str, object]]) -> None:
    for name, look in style.items():
        own = sorted((r for r in rows if r.contestant == name), key=lambda r: r.amount)
        axes.plot([r.amount for r in own], [values[id(r)] for r in own], label=name, **look)  # type: ignore[arg-type]
    axes.set(xscale="log", yscale="log")
    axes.margins(y=0.12)
    axes.grid(True, which="major", color="#dcdcdc", linewidth=0.8)
    axes.grid(True, which="minor", axis="y", color="#f0f0f0", linewidth=0.6)
    axes.set_axisbelow(True)
    least, most = axes.get_ylim()
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:,.10g}")
    narrow = most / least < 30  # few powers of ten: 2 and 5 between them help
    axes.yaxis.set_minor_formatter(lambda value, _: f"{value:,.10g}" if narrow and f"{value:e}"[0] in "25" else "")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(_FAINT)
    axes.tick_params(colors=_INK, which="both", labelsize=10)


def _styles(names: Sequence[str]) -> dict[str, dict[str, object]]:
    """Ours first and strong, the peers, then the floor as a line without markers."""
    peers = iter(_PEERS * 2)
    looks: dict[str, dict[str, object]] = {}
    for name in sorted(names, key=lambda n: (n in (FLOOR, WARM), n != OURS, names.index(n))):
        if name == FLOOR:
            looks[name] = {"color": _INK, "linestyle": "--", "linewidth": 1.6}
        elif name == WARM:
            looks[name] = {"color": _FAINT, "linestyle": ":", "linewidth": 1.6}
        elif name == OURS:
            looks[name] = {"color": "#0072b2", "marker": "o", "markersize": 7, "linewidth": 2.6, "zorder": 5}
        else:
            colour, marker = next(peers)
            looks[name] = {"color": colour, "marker": marker, "markersize": 6.5, "linewidth": 1.5}
    return looks


def _tick(amount: float) -> str:
    return f"{amount / 1e6:.2g} M" if amount >= 1e5 else f"{amount:,.0f}"


def _none() -> object:
    from matplotlib.ticker import NullLocator

    return NullLocator()
