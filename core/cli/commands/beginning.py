"""A new project, and the board to print."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import Any

from core import pipeline
from core.cli.arguments import Commands, Options, chosen_sequence, sequence_argument
from core.progress import Progress

DEVICE = "[NAME=]WIDTHxHEIGHT,PITCH,C"
BOARD = "ROWSxCOLUMNS,SPACING,DIAMETER|FILE.csv"


def add(commands: Commands) -> None:
    """Declare the commands of this group."""
    sub = commands.add("create", _create, "make a project: its rig, boards and sequence, no captures yet")
    sub.add_argument("project", type=Path, metavar="PROJECT")
    words = "pixels, pitch and focal length in mm, such as 748x576,0.008,12; of oblong pixels 748x576,0.008x0.009,12"
    sub.add_argument("--camera", action="append", required=True, metavar=DEVICE, help=f"{words}; repeat it for several")
    words = "the same in lines; WIDTHxHEIGHT alone of a projector that only labels places for several cameras"
    sub.add_argument("--projector", action="append", required=True, metavar=DEVICE, help=words)
    words = "the testfield in mm, such as 13x19,12,5, or the file with its targets"
    sub.add_argument("--board", default="13x19,12,5", metavar=BOARD, help=f"{words}; 13x19,12,5 if not given")
    sub.add_argument("--plate", metavar=BOARD, help="likewise, the plate of the depth calibration")
    words = "the boards given by numbers have black targets on white, not white ones on black"
    sub.add_argument("--black-on-white", action="store_true", help=words)
    words = "a measured distance between two targets of the testfield, with its sigma"
    sub.add_argument("--scale", nargs=4, metavar=("ROW,COL", "ROW,COL", "MM", "SIGMA"), help=words)
    sub.add_argument("--name", default="", metavar="TEXT", help="the project's name; that of its folder if not given")
    sequence_argument(sub)

    sub = commands.add("testfield", _testfield, "make a testfield to print at true size")
    sub.add_argument("testfield", type=Path, metavar="PROJECT|TESTFIELD.csv")
    sub.add_argument("--out", type=Path, required=True, metavar="FILE.pdf|FILE.svg")


def _create(options: Options, progress: Progress) -> dict[str, Any]:
    from core.pipeline.testfield import sheet_of
    from core.project import create_project
    from core.project.typed import typed_board, typed_rig, typed_scale

    rig = typed_rig(options.camera, options.projector)
    boards = {"testfield.csv": typed_board("--board", options.board, options.black_on_white)}
    if options.plate is not None:
        boards["plate.csv"] = typed_board("--plate", options.plate, options.black_on_white)
    for board in boards.values():
        sheet_of(board)  # refuses targets that overlap, and tags that do not exist
    scale = None if options.scale is None else typed_scale(options.scale, boards["testfield.csv"])
    folder, sequence = options.project, chosen_sequence(options)
    create_project(folder, options.name or folder.resolve().name, rig.cameras, rig.projectors, boards, scale, sequence)
    for name, device in rig.devices.items():
        known = "places alone" if device.labels_only else f"c {device.nominal_c_mm:g} mm"
        print(f"{name}: {device.width} x {device.height}, {known}")
    for file, board in boards.items():
        print(f"{folder / file}: {len(board.row)} targets")
    named = quote(str(folder))
    print(f"next: stripe-core testfield {named} --out board.pdf")
    print(f"then: stripe-core capture {named} NAME --role testfield --projector URL --camera URL")
    targets = {file: len(board.row) for file, board in boards.items()}
    return {"project": str(folder), "devices": list(rig.devices), "targets": targets}


def _testfield(options: Options, progress: Progress) -> dict[str, Any]:
    sheet = pipeline.print_testfield(options.testfield, options.out, progress)
    across, down = sheet.bars_mm
    print(f"{options.out}: page of {sheet.width_mm:.1f} x {sheet.height_mm:.1f} mm")
    print(f"print at 100 %; its bars must then measure {across:g} mm across and {down:g} mm down")
    return {
        "out": str(options.out),
        "targets": len(sheet.targets_mm),
        "page_mm": [sheet.width_mm, sheet.height_mm],
        "bars_mm": [across, down],
    }
