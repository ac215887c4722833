"""A new project before it is written: what the operator has said, what is wrong with it, and writing it at last."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from core.errors import InputError
from core.lazy import dataclass
from core.model import DeviceSpec, ScaleBar, Testfield
from core.patterns import SequenceSpec, read_sequence
from core.project import ENOUGH, create_project, nominal_testfield, read_testfield, refuse_used_folder
from core.project.shapes import check_fields
from stripe_gui.presenters.rig_view import Cover, RigPlan, presets
from stripe_gui.presenters.told import translate

if TYPE_CHECKING:
    from core.report.board import Sheet

FIELD_FILE, PLATE_FILE = "testfield.csv", "plate.csv"
SMALL_TARGET_PX = 6.0  # across: below, blur and pixels spoil the centroid
LEAST_COVER = 0.25  # share of the camera's field that a testfield should fill
GROSS_DIFFERENCE = 0.01  # a measured length further from the nominal one is hardly the same distance


@dataclass(frozen=True)
class BoardPlan:
    """A board by its numbers, or the CSV file it is taken from if `file` is not empty."""

    rows: int = 13
    columns: int = 19
    spacing_mm: float = 12.0
    diameter_mm: float = 5.0
    polarity: str = "white-on-black"
    from_file: bool = False
    file: str = ""


@dataclass(frozen=True)
class Draft:
    """All that the wizard asks for."""

    name: str
    folder: str
    rig: RigPlan = field(default_factory=lambda: presets()[0][1])
    board: BoardPlan = BoardPlan()
    with_plate: bool = False
    plate: BoardPlan = BoardPlan(7, 9, 24.0, 3.0, "black-on-white")
    with_scale: bool = False
    scale: ScaleBar = field(default_factory=lambda: ScaleBar((0, 0), (12, 18), 0.0, 0.02))
    sequence: Any = None  # as project.json has it; None leaves it to the projector


@dataclass(frozen=True)
class BoardView:
    """A board looked at: its targets and printable sheet, or the reason why there are none."""

    testfield: Testfield | None
    sheet: Sheet | None
    problem: str = ""


PARTS = {"rig": RigPlan, "camera": DeviceSpec, "projector": DeviceSpec, "board": BoardPlan, "plate": BoardPlan}
PARTS |= {"scale": ScaleBar}

# --------------------------------------------------------------------------------------------------------------- place


def new_draft(parent: Path) -> Draft:
    """Start with a name and a folder that is not there yet."""
    name = translate("NewProject", "New project")
    return Draft(name, str(suggested_folder(parent, name)))


def suggested_folder(parent: Path, name: str) -> Path:
    """Name a folder below another after a project; one that is there gets a number."""
    stem = re.sub(r"[^\w.+-]+", "-", name.strip().lower()).strip("-.") or "project"
    number, folder = 1, parent / stem
    while folder.exists():
        number += 1
        folder = parent / f"{stem}-{number}"
    return folder


def place_problem(name: str, folder: str) -> str:
    """Say why a project cannot be made there; empty if it can."""
    if not name.strip():
        return translate("NewProject", "Give the project a name.")
    if not folder.strip():
        return translate("NewProject", "Choose a folder for the project.")
    path = Path(folder.strip()).expanduser()
    if not path.is_absolute():
        return translate("NewProject", "Give the folder in full, such as {example}.").format(example=Path.home() / path)
    try:
        refuse_used_folder(path)
    except InputError as error:
        return f"{error.where} {error.seen}: {error.remedy}."
    return ""


# -------------------------------------------------------------------------------------------------------------- boards


def look_at_board(plan: BoardPlan) -> BoardView:
    """Lay out or read a board, with every check that reading and printing make."""
    from core.pipeline.testfield import sheet_of

    if plan.from_file and not plan.file.strip():
        return BoardView(None, None, translate("NewProject", "Choose the CSV file with the targets."))
    try:
        if plan.from_file:
            testfield = read_testfield(Path(plan.file.strip()).expanduser())
        else:
            size = plan.rows, plan.columns, plan.spacing_mm, plan.diameter_mm
            testfield = nominal_testfield(
                *size, "black-on-white" if plan.polarity == "black-on-white" else "white-on-black"
            )
        targets = len(testfield.row)
        if targets < ENOUGH or min(len(np.unique(testfield.row)), len(np.unique(testfield.col))) < 2:
            text = translate("NewProject", "{n} targets: a testfield needs at least 4, not all in one row or column.")
            return BoardView(None, None, text.format(n=targets))
        return BoardView(testfield, sheet_of(testfield))
    except InputError as error:
        if plan.from_file:
            return BoardView(None, None, f"{error}.")
        text = translate("NewProject", "Neighbouring targets overlap: choose a diameter below the spacing.")
        return BoardView(None, None, text if "overlap" in error.seen else f"{error.seen}: {error.remedy}.")


def board_text(plan: BoardPlan, board: BoardView) -> str:
    """Name a board in one line."""
    if board.testfield is None:
        return board.problem
    if plan.from_file:
        text = translate("NewProject", "{n} targets from {file}")
        return text.format(n=len(board.testfield.row), file=plan.file.strip())
    white = translate("NewProject", "white on black")
    polarity = white if plan.polarity == "white-on-black" else translate("NewProject", "black on white")
    text = translate("NewProject", "{rows} rows × {columns} columns, spacing {a:g} mm, diameter {d:g} mm, {polarity}")
    return text.format(rows=plan.rows, columns=plan.columns, a=plan.spacing_mm, d=plan.diameter_mm, polarity=polarity)


def board_words(testfield: Testfield, camera: Cover, lit: Cover) -> list[str]:
    """What a board is to a rig: its size in the camera, and what stays out of sight or out of the light."""
    wide, high = (float(np.ptp(testfield.xyz_mm[:, axis]) + testfield.diameter_mm.max()) for axis in (0, 1))
    across = float(np.median(testfield.diameter_mm)) / camera.unit_mm
    text = translate(
        "NewProject", "{n} targets on {wide:.0f} × {high:.0f} mm, each {across:.1f} px across in the camera."
    )
    words = [text.format(n=len(testfield.row), wide=wide, high=high, across=across)]
    if across < SMALL_TARGET_PX:
        words.append(
            translate("NewProject", "That is small: below {least:.0f} px blur and pixels spoil the centroid.").format(
                least=SMALL_TARGET_PX
            )
        )
    if _larger((wide, high), camera.field_mm):
        text = translate("NewProject", "It is larger than the camera's field of {w:.0f} × {h:.0f} mm.")
        words.append(text.format(w=camera.field_mm[0], h=camera.field_mm[1]))
    elif wide * high < LEAST_COVER * camera.field_mm[0] * camera.field_mm[1]:
        text = translate(
            "NewProject", "It fills {share:.0f} % of the camera's field: move it into the image's corners too."
        )
        words.append(text.format(share=100 * wide * high / camera.field_mm[0] / camera.field_mm[1]))
    if _larger((wide, high), lit.field_mm):
        text = translate(
            "NewProject", "The projector lights {w:.0f} × {h:.0f} mm: targets beside it serve the camera only."
        )
        words.append(text.format(w=lit.field_mm[0], h=lit.field_mm[1]))
    return words


def _larger(size: tuple[float, float], room: tuple[float, float]) -> bool:
    return max(size) > max(room) or min(size) > min(room)


# --------------------------------------------------------------------------------------------------------------- scale


def nominal_distance_mm(testfield: Testfield, bar: ScaleBar) -> float | None:
    """Distance of the two targets on the board as designed; None where one is not on it."""
    index = testfield.index()
    if bar.start not in index or bar.stop not in index:
        return None
    a, b = (testfield.xyz_mm[index[end]] for end in (bar.start, bar.stop))
    return float(np.linalg.norm(b - a))


def scale_problem(testfield: Testfield, bar: ScaleBar) -> str:
    """Say why a measured distance cannot be used; empty if it can."""
    index = testfield.index()
    for end in (bar.start, bar.stop):
        if end not in index:
            text = translate("NewProject", "There is no target in row {row}, column {col}.")
            return text.format(row=end[0], col=end[1])
    if bar.start == bar.stop:
        return translate("NewProject", "Name two different targets.")
    if bar.length_mm <= 0:
        return translate("NewProject", "Type the measured length.")
    if bar.sigma_mm <= 0:
        return translate("NewProject", "Type the standard deviation of the measured length.")
    return ""


def scale_words(testfield: Testfield, bar: ScaleBar) -> tuple[str, str]:
    """Compare a measured distance with the nominal one; the second sentence doubts a gross difference, or is empty."""
    nominal = nominal_distance_mm(testfield, bar)
    if not nominal:
        return "", ""
    if bar.length_mm <= 0:
        return translate("NewProject", "Nominal distance: {nominal:.3f} mm.").format(nominal=nominal), ""
    off = bar.length_mm - nominal
    text = translate("NewProject", "Nominal distance: {nominal:.3f} mm; measured {off:+.3f} mm ({share:+.3f} %).")
    words = text.format(nominal=nominal, off=off, share=100 * off / nominal)
    if abs(off) <= GROSS_DIFFERENCE * nominal:
        return words, ""
    doubt = translate(
        "NewProject", "So large a difference is rarely true: check the two targets, and that it is in mm."
    )
    return words, doubt


# -------------------------------------------------------------------------------------------- keeping, and writing it


def create(draft: Draft, field_: Testfield, plate: Testfield | None) -> Path:
    """Write the project; nothing is left behind if that fails."""
    folder = Path(draft.folder.strip()).expanduser()
    boards = {FIELD_FILE: field_} | ({PLATE_FILE: plate} if plate is not None else {})
    scale = draft.scale if draft.with_scale else None
    spec = sequence_of(draft)
    create_project(folder, draft.name.strip(), draft.rig.camera, draft.rig.projector, boards, scale, spec)
    return folder


def sequence_of(draft: Draft) -> SequenceSpec | None:
    """Give the sequence that was chosen; None where it is left to the projector."""
    return None if draft.sequence is None else read_sequence(draft.sequence, "draft: sequence")


def draft_text(draft: Draft) -> str:
    """Give a draft as text, to be kept until the project is written."""
    return json.dumps(asdict(draft))


def draft_from_text(text: str) -> Draft | None:
    """Read a kept draft; None where there is none that can be used."""
    try:
        draft: Draft = _made(Draft, json.loads(text))
        sequence_of(draft)
        return draft
    except (ValueError, TypeError, AttributeError, InputError):
        return None


def _made(kind: type, data: dict[str, Any]) -> Any:
    """Make a part of a draft of its fields, and see that each has its type."""
    values = {}
    for key, value in data.items():
        pair = isinstance(value, list) and key != "sequence"
        values[key] = _made(PARTS[key], value) if key in PARTS else tuple(value) if pair else value
    made = kind(**values)
    check_fields(made)
    return made
