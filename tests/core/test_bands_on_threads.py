"""Rows handed to threads: all of them, each once, and no error lost."""

from __future__ import annotations

import threading

import pytest

from core.parallel import run_in_bands


@pytest.mark.parametrize("rows", [0, 1, 15, 16, 33, 1000])
def test_every_row_is_worked_on_once(rows) -> None:
    seen: list[int] = []
    run_in_bands(lambda start, stop: seen.extend(range(start, stop)), rows)
    assert sorted(seen) == list(range(rows))


def test_an_error_of_any_band_reaches_the_caller_and_nobody_goes_on_working() -> None:
    working = threading.Semaphore(0)

    def fail(start: int, stop: int) -> None:
        if start <= 500 < stop:
            raise ValueError("row 500")
        working.release()

    with pytest.raises(ValueError, match="row 500"):
        run_in_bands(fail, 1000)
    assert run_in_bands(lambda start, stop: None, 1000) is None


def test_bands_within_bands_come_to_an_end() -> None:
    seen: list[int] = []
    run_in_bands(lambda a, b: run_in_bands(lambda start, stop: seen.extend(range(a + start, a + stop)), b - a), 640)
    assert sorted(seen) == list(range(640))
