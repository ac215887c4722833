"""Measured distances that contradict each other are refused before the work, each with its own name."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from core.errors import InputError
from core.model import ScaleBar
from core.pipeline import calibrate_project
from core.pipeline.methods.photogrammetric import check_lengths
from core.project import read_capture, read_project
from core.project.boards import nominal_testfield

BOARD = nominal_testfield(7, 9, 19.0, 9.0)  # dots 19 mm apart
DIAGONAL = 19 * float(np.hypot(6, 8))  # from (6, 0) to (0, 8)


def lengths(scale: float, further: float, to: tuple[int, int] = (0, 8)) -> dict[str, ScaleBar]:
    return {
        "scale": ScaleBar((6, 0), (0, 8), scale, 0.005),
        "lengths, entry 0": ScaleBar((6, 0), to, further, 0.005),
    }


@pytest.mark.parametrize(
    ("bars", "words"),
    [
        (lengths(DIAGONAL, DIAGONAL / 10), r"lengths, entry 0: length_mm is 19, 0\.1 times.*cm instead of mm"),
        (lengths(DIAGONAL, DIAGONAL, (1, 8)), r"lengths, entry 0: .* 1\.06 times"),
        (lengths(DIAGONAL * 1.1, DIAGONAL), r"scale: length_mm is 209, 1\.1 times"),
    ],
)
def test_the_length_that_contradicts_the_others_is_named(bars: dict[str, ScaleBar], words: str) -> None:
    with pytest.raises(InputError, match=words):
        check_lengths(Path("rig"), bars, BOARD)


@pytest.mark.parametrize("unit", [1.0, 0.1, 25.4, 0.97])
def test_lengths_that_agree_pass_whatever_the_board_is_given_in(unit: float) -> None:
    check_lengths(Path("rig"), lengths(DIAGONAL * unit, DIAGONAL * unit * 1.02), BOARD)
    check_lengths(Path("rig"), {}, BOARD)


def test_a_short_length_measured_roughly_passes_and_hides_no_other() -> None:
    """19 mm with a ruler: 21 % off is 2 sigmas, which the adjustment weighs."""
    short = {"lengths, entry 1": ScaleBar((0, 0), (0, 1), 23.0, 2.0)}
    check_lengths(Path("rig"), lengths(DIAGONAL, DIAGONAL) | short, BOARD)
    with pytest.raises(InputError, match=r"lengths, entry 0: length_mm is .* 1\.1 times"):
        check_lengths(Path("rig"), lengths(DIAGONAL, DIAGONAL * 1.1) | short, BOARD)


def test_without_a_length_the_board_gives_the_scale_and_its_targets_how_surely(
    calibrated: Path, quick_truth: dict[str, Any], edit_json: Callable[..., None]
) -> None:
    edit_json(calibrated / "project.json", scale=None)
    warnings = calibrate_project(read_project(calibrated), "photogrammetric")["photogrammetric"].warnings
    nominal = read_capture(calibrated / "captures" / "testfield-01").testfield
    assert nominal is not None
    true = {(t["row"], t["col"]): t["xyz_mm"] for t in quick_truth["testfields"]["testfield.csv"]}
    places = nominal.xyz_mm - nominal.xyz_mm.mean(axis=0)
    scales = []  # of boards whose targets are off as truly, in other orders
    for order in map(np.random.default_rng(1).permutation, [len(places)] * 300):
        off = np.array([true[key] for key in nominal.keys])[order] - nominal.xyz_mm[order]
        scales.append(1e6 * np.sum(off * places) / np.sum(places**2))
    (found,) = filter(None, (re.search(r"leave it (\S+) ppm", told) for told in warnings))
    assert float(found[1]) == pytest.approx(np.std(scales), rel=0.2)
