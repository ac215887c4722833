"""Captures that a method has too few of are told, not passed over."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from core.model import Capture
from core.pipeline import calibrate
from core.pipeline.options import CalibrateOptions
from core.project.boards import nominal_testfield


@pytest.mark.parametrize(("plates", "told"), [(0, 0), (1, 1), (2, 0)])
def test_a_single_plate_is_told(plates: int, told: int, caplog) -> None:
    board = nominal_testfield(7, 9, 19.0, 9.0)
    captures = [Capture(Path("testfield-01"), "testfield", (), board)]
    captures += [Capture(Path(f"depth-0{k}"), "depth", (), board, 5.0 * k) for k in range(plates)]
    with caplog.at_level(logging.WARNING):
        used = calibrate.captures_for(None, "all", CalibrateOptions(), captures)  # type: ignore[arg-type]
        assert not caplog.records  # a refusal may follow, which is one line
        calibrate.tell_idle("all", CalibrateOptions(), captures, used)
    assert [record.getMessage() for record in caplog.records] == told * [
        "left out: depth-00: a depth calibration needs 2 such captures"
    ]
