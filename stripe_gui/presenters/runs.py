"""Kept calibrations in tables: one a line, and two side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

from core.model import Method
from core.pipeline import METHODS, CalibrateOptions
from core.pipeline.runs import Difference, Run, compare_runs
from core.report import Number, Table
from core.report.table import Cell
from stripe_gui.presenters.told import told, translate

KNOWN = ("photogrammetric", "polynomial")  # have columns of their own
NOTEWORTHY = 1.0  # a difference of so many sigmas is marked


def run_title(run: Run) -> str:
    """Name a run."""
    title = translate("Runs", "run {n}").format(n=run.number)
    return f"{title}: {run.name}" if run.name else title


def made_at(run: Run) -> str:
    """Tell when a run ended, to the minute."""
    try:
        return f"{datetime.fromisoformat(run.made_at):%Y-%m-%d %H:%M}"
    except ValueError:
        return run.made_at


def options_words(options: CalibrateOptions, methods: Sequence[Method]) -> str:
    """Say in a few words what was chosen; what is usual is left out."""
    usual, words = CalibrateOptions(), []
    read = {name for method in methods for name in METHODS[method].options}
    if "rigid" in read:
        words.append(translate("Runs", "rigid rig") if options.rigid else translate("Runs", "free stations"))
        if options.hold:
            words.append(translate("Runs", "held: {names}").format(names=", ".join(options.hold)))
        if options.reject_beyond is None:
            words.append(translate("Runs", "gross errors kept"))
        elif options.reject_beyond != usual.reject_beyond:
            words.append(translate("Runs", "rejected beyond {s:g} σ").format(s=options.reject_beyond))
    if "degree" in read:
        degree = translate("Runs", "degree {n}").format(n=options.degree)
        words.append(translate("Runs", "depth table") if options.degree is None else degree)
        if options.low_pass_px != usual.low_pass_px:
            words.append(translate("Runs", "low-pass {s:g} px").format(s=options.low_pass_px))
        words += [name for name in (options.camera, options.projector) if name]
    if options.without:
        words.append(translate("Runs", "without {names}").format(names=", ".join(options.without)))
    return "; ".join(words)


def runs_table(runs: Sequence[Run], current: Mapping[Method, int]) -> Table:
    """List runs, the newest first."""
    others = [m for m in METHODS if m not in KNOWN and any(m in run.figures for run in runs)]
    columns = (
        translate("Runs", "run"),
        translate("Runs", "name"),
        translate("Runs", "in use"),
        "σ0",
        translate("Runs", "camera [µm]"),
        translate("Runs", "projector [µm]"),
        translate("Runs", "points [µm]"),
        translate("Runs", "depth [mm]"),
        *map(told, others),
        translate("Runs", "captures"),
        translate("Runs", "left out"),
        translate("Runs", "options"),
        translate("Runs", "made"),
    )
    return Table("", columns, tuple(_row(run, current, others) for run in reversed(runs)))


def _row(run: Run, current: Mapping[Method, int], others: Sequence[Method]) -> tuple[Cell, ...]:
    network: dict[str, Any] = run.figures.get("photogrammetric", {})
    depth: dict[str, Any] = run.figures.get("polynomial", {})
    used = [m for m in run.methods if current.get(m) == run.number]
    return (
        Number(run.number, "d"),
        run.name,
        translate("Runs", "all of it") if len(used) == len(run.methods) > 1 else ", ".join(map(told, used)),
        _number(network.get("sigma0"), ".3f"),
        _rms(network.get("camera", {}).get("residual_rms_um")),
        _rms(network.get("projector", {}).get("residual_rms_um")),
        _rms(network.get("object_sigma_rms_um")),
        _number(depth.get("residual_rms_mm"), "F4"),
        *(_figures(run.figures.get(method, {})) for method in others),
        Number(sum(len(names) for names in run.captures.values()), "d"),
        Number(_left_out(run), "d"),
        options_words(run.options, run.methods),
        made_at(run),
    )


def _left_out(run: Run) -> int:
    """Count the points that took no part, whoever left them out: the operator, or the adjustment as gross errors."""
    told = [entry for figures in run.figures.values() for entry in figures.get("left_out", ())]
    if told:
        return sum(int(entry["points"]) for entry in told)
    return sum(len(targets) for targets in run.excluded.values())


def _figures(figures: Mapping[str, Any]) -> str | None:
    """Give the single numbers that a method tells."""
    told = [f"{name} {value:.4g}" for name, value in figures.items() if isinstance(value, int | float)]
    return ", ".join(told) or None


def _number(value: float | None, spec: str) -> Number | None:
    return None if value is None else Number(value, spec)


def _rms(values: Sequence[float | None] | None) -> Number | None:
    """Root of the mean square of the components."""
    known = [v for v in values or () if v is not None]
    return Number((sum(v * v for v in known) / len(known)) ** 0.5, ".2f") if known else None


def comparison_table(first: Run, second: Run) -> Table:
    """Set two runs side by side, parameter by parameter."""
    columns = (
        translate("Runs", "parameter"),
        run_title(first),
        "σ",
        run_title(second),
        "σ",
        translate("Runs", "difference"),
        translate("Runs", "in σ"),
        "",
    )
    differences = compare_runs(first, second)
    notes = (
        translate("Runs", "In σ: the difference over the greater of both sigmas. The runs share observations, so this "
                  "is no test; it says what the change was worth. ▲ marks differences above one sigma."),
    )  # fmt: skip
    title = translate("Runs", "{second} against {first}").format(second=run_title(second), first=run_title(first))
    return Table(title, columns, tuple(map(_comparison, differences)), notes if differences else ())


def _comparison(d: Difference) -> tuple[Cell, ...]:
    name = f"{d.name} [{d.unit}]" if d.unit else d.name
    spec = ".3f" if d.unit == "mrad" else ".6f" if d.unit == "mm" else "E4"
    mark = "▲" if d.in_sigmas is not None and abs(d.in_sigmas) > NOTEWORTHY else ""
    return (
        name,
        Number(d.first[0], spec),
        _sigma(d.first[1]),
        Number(d.second[0], spec),
        _sigma(d.second[1]),
        Number(d.difference, "+.2g"),
        None if d.in_sigmas is None else Number(d.in_sigmas, "+.2f"),
        mark,
    )


def _sigma(value: float) -> Cell:
    return Number(value, ".2g") if value > 0 else translate("Runs", "held")
