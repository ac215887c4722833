"""Whoever waits is told that a kernel is being compiled."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from core.compiling import kept, njit
from core.progress import SILENT, Progress, announce


def test_the_progress_in_use_says_that_a_kernel_is_compiled_and_says_it_once(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(kept, "kernel_folder", lambda: tmp_path)
    heard: list[tuple[float, str]] = []
    progress = Progress(report=lambda fraction, message: heard.append((fraction, message)))
    progress(0.25, "decoding")
    SILENT(0.5, "a part of it that reports nothing")

    @njit(cache=True)
    def twice(values):
        return 2 * values[0]

    twice(np.ones(3))
    told = heard[1:]
    assert told
    assert set(told) == {(0.25, "compiling for this processor, once")}
    heard.clear()
    twice(np.ones(3))
    assert heard == []


def test_work_that_has_ended_is_told_nothing_more() -> None:
    heard: list[str] = []
    progress = Progress(report=lambda fraction, message: heard.append(message))
    list(progress.over([1, 2], "step {}"))
    announce("compiling")
    assert heard == ["step 1", "step 2", "step 2"]
