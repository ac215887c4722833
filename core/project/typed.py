"""A rig, boards and a scale as they are typed in a line, with all the checks that their files have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from core.errors import InputError
from core.fields import Fields
from core.model import Rig, ScaleBar, Testfield
from core.project.boards import nominal_testfield
from core.project.captures import ENOUGH, read_testfield
from core.project.rigs import read_bar, read_rig

Number = TypeVar("Number", int, float)
MOST_TARGETS = 10_000  # of a board by numbers: no camera sees as many


def typed_rig(cameras: Sequence[str], projectors: Sequence[str]) -> Rig:
    """Read devices, each as ``[NAME=]WIDTHxHEIGHT,PITCH[xPITCH],C`` with pitch and c in mm.

    A projector by its width and height alone labels places.

    Raises
    ------
    InputError
        Naming the option or the field, the value seen and what is allowed.
    """
    found: dict[str, Any] = {}
    for kind, given in (("camera", cameras), ("projector", projectors)):
        devices = found.setdefault(f"{kind}s", {})
        for text in given:
            name, _, values = text.rpartition("=")
            if not name and len(given) > 1:
                raise InputError(f"--{kind}", text, f"name each of several: --{kind} NAME=WIDTHxHEIGHT,PITCH,C")
            if (name := name or kind) in devices:
                raise InputError(f"--{kind}", text, f"{name} is there already: give it another name")
            devices[name] = _device(f"--{kind}", values, kind == "projector")
    return read_rig(Fields(found, "arguments"))


def _device(option: str, text: str, may_label: bool) -> dict[str, Any]:
    """Read one device's values as project.json has them."""
    size, *optics = text.split(",")
    try:
        width, height = _numbers(int, size, "x")
        if may_label and not optics:
            return {"width": width, "height": height}
        pitch, c = optics
        across, *down = _numbers(float, pitch, "x")
        (down_mm,) = down or (across,)
        return {"width": width, "height": height, "pitch_mm": [across, down_mm], "nominal_c_mm": float(c)}
    except ValueError:
        raise InputError(option, text, "give WIDTHxHEIGHT,PITCH,C, such as 748x576,0.008,12") from None


def typed_board(option: str, text: str, black_on_white: bool = False) -> Testfield:
    """Lay out ``ROWSxCOLUMNS,SPACING,DIAMETER`` in mm, or read the CSV file of a board.

    Raises
    ------
    InputError
        Naming the option or the file, the value seen and what is allowed.
    """
    if text.lower().endswith(".csv"):
        board = read_testfield(Path(text))
        if len(board.row) < ENOUGH:
            raise InputError(option, f"{text}: {len(board.row)} targets", f"a board needs {ENOUGH} at least")
        return board
    try:
        size, *lengths = text.split(",")
        rows, columns = _numbers(int, size, "x")
        spacing, diameter = map(float, lengths)
        if min(rows, columns) < 2 or not all(0 < length < float("inf") for length in (spacing, diameter)):
            raise ValueError
    except ValueError:
        remedy = "give ROWSxCOLUMNS,SPACING,DIAMETER in mm, such as 13x19,12,5, or a file that ends in .csv"
        raise InputError(option, text, remedy) from None
    if diameter >= spacing:
        raise InputError(option, f"{text}: neighbouring targets overlap", "choose a diameter below the spacing")
    if rows * columns > MOST_TARGETS:
        raise InputError(option, f"{text}: {rows * columns} targets", f"give {MOST_TARGETS} at most")
    sizes = rows, columns, spacing, diameter
    return nominal_testfield(*sizes, "black-on-white" if black_on_white else "white-on-black")


def typed_scale(given: Sequence[str], board: Testfield) -> ScaleBar:
    """Read a measured distance: ``ROW,COL``, ``ROW,COL``, length and sigma in mm, between targets of a board.

    Raises
    ------
    InputError
        Naming the value seen and what is allowed.
    """
    try:
        ends = [_numbers(int, end, ",") for end in given[:2]]
        length, sigma = map(float, given[2:])
    except ValueError:
        remedy = "give ROW,COL ROW,COL MM SIGMA, such as 0,0 12,18 258.6 0.02"
        raise InputError("--scale", " ".join(given), remedy) from None
    bar = read_bar(Fields({"from": ends[0], "to": ends[1], "length_mm": length, "sigma_mm": sigma}, "--scale"))
    for row, col in (bar.start, bar.stop):
        if (row, col) not in board.index():
            raise InputError("--scale", f"row {row}, col {col}", "name targets of the testfield")
    return bar


def _numbers(kind: Callable[[str], Number], text: str, between: str) -> list[Number]:
    return [kind(word) for word in text.split(between)]
