"""`python -m tests.benchmarks.identity [KIND ...] [--boards N] [--first K] [--tilt T] [--sets N]`: who is who.

Every kind of board as the program prints it, photographed through OpenCV's camera: a quarter hidden, tilted T to 60°,
blurred up to 1.2 px, the light falling to a third. Told: all targets are who they are. Turned: the board looks the same
another way round, which is among the ways offered. Wrong: any other name. `--sets`: that many sets of eight images of
symmetric boards, each with irregularities of its own; `solve_turns` tells how they were held, all as they are or all
alike turned. No figure is asserted; boards are numbered, so that a run in pieces is the same as one.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import replace

import numpy as np

from core.errors import InputError
from core.measure import SAME, recognise, solve_turns, symmetries
from core.measure.identity.turns import Labelling, relabelled
from core.model import TargetSet, Testfield
from tests.printed import SPEC, Printed, field_of, phase_of, photograph, printed

NEAR_PX = 2.0  # targets are at least 6 px apart
GREY = {"retro": (4.0, 190.0)}
FIELDS = {
    "dots": field_of("dots"),
    "retro": field_of("dots", "white-on-black"),
    "rings": field_of("rings"),
    "coded origin": replace(field_of("rings"), kind="rings", diameter_mm=np.full(70, 8.0)),
    "chessboard": field_of("chessboard"),
    "charuco": field_of("charuco"),
    "aprilgrid": field_of("aprilgrid"),
    "tags": field_of("tags"),
}


def outcome(field: Testfield, found: TargetSet, truth: np.ndarray) -> str:
    """Whether all targets are where those of their names are."""
    index = field.index()
    at = [index[key] for key in zip(found.row.tolist(), found.col.tolist(), strict=True)]
    return "told" if np.linalg.norm(found.camera_uv - truth[at], axis=1).max() < NEAR_PX else "wrong"


def one_board(name: str, board: Printed, number: int, least: float) -> tuple[str, float, str]:
    """What became of one board, the share of all targets that was measured, and what was special."""
    rng = np.random.default_rng([number, sum(map(ord, name))])
    tilt, light = rng.uniform(least, 60), rng.uniform(1, 3)
    image, truth = photograph(
        board, rng, tilt, hidden=True, blur=(0.4, 1.2), light=light, grey=GREY.get(name, (15.0, 165.0))
    )
    about = f"tilt {tilt:.0f} light {light:.1f}"
    try:
        found, ways = recognise(phase_of(image), board.field, SPEC)
    except InputError as error:
        return "not recognised", 0.0, f"{about}: {error.seen}"
    share = len(found.row) / len(board.field.row)
    named = [t for way in ways if (t := relabelled(found, way, board.field)) is not None]
    results = [outcome(board.field, t, truth) for t in named]
    if results[0] == "told" or "told" not in results:
        return results[0], share, about
    return "turned", share, about


def one_set(number: int) -> Counter[str]:
    """Eight images of one board that looks the same half a turn round (or a quarter: every fourth set)."""
    rng = np.random.default_rng([number, 8])
    field = FIELDS["dots"]
    if number % 4 == 3:
        row, col = (x.ravel() for x in np.mgrid[0:11, 0:11])
        field = Testfield(row, col, np.column_stack([12.5 * col, -12.5 * row, 0.0 * row]), np.full(121, 5.5))
    made = field.xyz_mm + rng.normal(0, rng.choice([0.03, 0.1]), field.xyz_mm.shape) * (1, 1, 0)
    board = printed(replace(field, xyz_mm=made))
    images, offered, truths = [], [], []
    result: Counter[str] = Counter()
    for _ in range(8):
        image, truth = photograph(board, rng, rng.uniform(0, 50), hidden=bool(rng.random() < 0.5), blur=(0.5, 1.0))
        try:
            found, ways = recognise(phase_of(image), field, SPEC)
        except InputError:
            result["not recognised"] += 1
            continue
        images.append(found)
        offered.append(ways)
        truths.append(truth)
    solved = solve_turns(images, offered, field)
    told = [(s.targets, truth) for s, truth in zip(solved, truths, strict=True) if s.told]
    result["untold"] += len(solved) - len(told)
    turns = [SAME, *symmetries(field)]
    right = max(sum(_is(way, t, field, truth) for t, truth in told) for way in turns)
    result["told"] += right
    result["wrong"] += len(told) - right
    return result


def _is(way: Labelling, targets: TargetSet, field: Testfield, truth: np.ndarray) -> bool:
    named = relabelled(targets, way, field)
    return named is not None and outcome(field, named, truth) == "told"


def main() -> None:
    """Print the confusion table, and every board that was not told."""
    parser = argparse.ArgumentParser(prog="tests.benchmarks.identity", description=__doc__)
    parser.add_argument("kinds", nargs="*", metavar="KIND", help=f"of {', '.join(FIELDS)}; all if unsaid")
    parser.add_argument("--boards", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--tilt", type=float, default=0.0, help="least tilt, degrees")
    parser.add_argument("--sets", type=int, default=0, help="sets of eight images instead of boards")
    options = parser.parse_args()
    numbers = range(options.first, options.first + (options.sets or options.boards))
    if options.sets:
        print("| sets | told | untold | not recognised | wrong |\n|---|---|---|---|---|")
        total: Counter[str] = Counter()
        for number in numbers:
            total += (now := one_set(number))
            if now["told"] < 8:
                print(f"set {number}: {dict(now)}", flush=True)
        print("|", len(numbers), *(f"| {total[key]}" for key in ("told", "untold", "not recognised", "wrong")), "|")
        return
    print("| kind | boards | told | turned | not recognised | wrong | targets |\n|---|---|---|---|---|---|---|")
    for name in options.kinds or FIELDS:
        board = printed(FIELDS[name])
        results: Counter[str] = Counter()
        shares: list[float] = []
        for number in numbers:
            what, share, about = one_board(name, board, number, options.tilt)
            results[what] += 1
            shares.append(share)
            if what in ("not recognised", "wrong"):
                print(f"{name} {number}: {what}, {about}", flush=True)
        cells = [results[key] for key in ("told", "turned", "not recognised", "wrong")]
        print(
            "|", name, "|", len(numbers), *(f"| {n}" for n in cells), f"| {100 * np.mean(shares):.0f} % |", flush=True
        )


if __name__ == "__main__":
    main()
