"""What the captures of a calibration say of each other, and what one more would bring, in tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from core.model import Rig
from core.report import Number, Table
from stripe_gui.presenters.status import device_name
from stripe_gui.presenters.told import translate


def left_out_table(found: Sequence[dict[str, Any]], rig: Rig) -> Table:
    """List the captures, each as the others predict it."""
    devices = list(dict.fromkeys(name for one in found for name in one["fitted_px"]))
    columns = [translate("Studies", "capture")]
    for name in devices:
        unit = translate("Studies", "lines") if name in rig.projectors else "px"
        columns += [f"{device_name(name)} [{unit}]", translate("Studies", "with it")]
    columns += [
        "F",
        translate("Studies", "limit"),
        "",
        translate("Studies", "changes most"),
        translate("Studies", "in σ"),
    ]
    rows = []
    for one in found:
        residuals = [_number(one[key].get(name)) for name in devices for key in ("foreseen_px", "fitted_px")]
        test = Number(one["statistic"], ".2f"), Number(one["limit"], ".2f"), "▲" if one["off"] else ""
        rows.append((one["capture"], *residuals, *test, one["parameter"], Number(one["change_sigmas"], "+.1f")))
    note = translate(
        "Studies",
        "R.m.s. residuals against the calibration without the capture, and with it; F tests whether the capture is "
        "like the others. Last, the parameter that would change most without it, in its σ.",
    )
    return Table("", tuple(columns), tuple(rows), (note,))


def next_pose_table(found: Sequence[dict[str, Any]]) -> Table:
    """List poses of the board in the order in which to capture them."""
    columns = (
        translate("Studies", "pose of the board"),
        translate("Studies", "all σ [%]"),
        translate("Studies", "most of all"),
        translate("Studies", "its σ [%]"),
    )
    rows = [
        (one["words"], Number(-100 * one["gain"], "+.1f"), one["parameter"], Number(-100 * one["most"], "+.1f"))
        for one in found
    ]
    note = translate(
        "Studies",
        "In this order. Tilt and roll as the camera sees the board, from facing it upright. σ: by how much those of "
        "all interior and relative orientations would change on average, after the poses above, and the one that "
        "would gain most. Calibrate with them before you ask again.",
    )
    return Table("", columns, tuple(rows), (note,))


def _number(value: float | None) -> Number | None:
    return None if value is None else Number(value, ".4f")
