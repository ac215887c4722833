"""Whoever waits is told that a kernel is being compiled."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from numba.core.errors import TypingError

from core.compiling import njit
from core.progress import SILENT, Progress


def test_the_progress_in_use_says_that_a_kernel_is_compiled_and_says_it_once() -> None:
    heard: list[tuple[float, str]] = []
    progress = Progress(report=lambda fraction, message: heard.append((fraction, message)))
    progress(0.25, "decoding")
    SILENT(0.5, "a part of it that reports nothing")

    @njit
    def twice(values):
        return 2 * values

    twice(np.ones(3))
    told = heard[1:]
    assert told
    assert set(told) == {(0.25, "compiling for this processor, once")}
    heard.clear()
    twice(np.ones(3))
    assert heard == []


def test_python_looks_for_garbage_again_once_a_kernel_is_compiled_or_has_failed_to() -> None:
    @njit
    def twice(values):
        return 2 * values

    @njit
    def wrong(values):
        return values.no_such_thing

    assert gc.isenabled()
    twice(np.ones(3))
    assert gc.isenabled()
    with pytest.raises(TypingError, match="no_such_thing"):
        wrong(np.ones(3))
    assert gc.isenabled()
