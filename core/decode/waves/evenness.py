"""The evenly lit image, without what a response leaves of fringes in the mean of few steps.

N steps add up to even light but for harmonics N, 2 N and so on, which a projector's response makes. Of four steps these
are fringes of half a per cent, which move the centres of dots by 0.004 px; of three they move them by up to 0.018 px.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from core.decode.tables import Array, Rows, Singles
from core.decode.waves.curves import HIGHEST, both_sides, dimming, waves
from core.decode.waves.response import Response, Wave
from core.parallel import run_in_bands

WORTH = 5e-4  # of the amplitude of fringes: less moves no centre by a thousandth of a pixel
PLACES = 1024  # of a period, at which it is tabulated


def level_out(
    image: Singles, place: Sequence[Singles], modulation: Singles, rows: Rows, fringes: Sequence[Wave], r: Response
) -> None:
    """Take the harmonics of fringes out of the even image (H, W), the `rows` of all frames, in place.

    `place` are the coordinates of both axes in lines, NaN where these are not known and nothing is changed.
    """
    row = dict(zip(rows.column[: rows.first[1]].tolist(), rows.value[: rows.first[1]].tolist(), strict=True))
    for wave in fringes:
        table = _left(wave, row, r)
        if np.abs(table).max() > WORTH:
            common = image, place[wave.axis], modulation, wave.frames.period, table.astype(np.float32)
            run_in_bands(partial(_subtract, *common), len(image))


def _left(wave: Wave, row: dict[int, float], r: Response) -> Array:
    """What a wave leaves in the even image, by the amplitude of its fringes, at `PLACES` of the period."""
    shares = np.array([row.get(n, 0.0) for n in wave.frames.frames])
    shown = waves(wave.frames.patterns, wave.frames.period, r.table) * dimming(wave.frames.period, r.blur[wave.axis])
    amplitude = np.abs(wave.both @ both_sides(shown)[:, HIGHEST + 1])
    turns = np.exp(2j * np.pi * np.outer(np.arange(1, HIGHEST + 1), np.arange(PLACES) / PLACES))
    return np.asarray(2 * (shares @ shown[:, 1:] @ turns).real / amplitude)


def _subtract(
    image: Singles, place: Singles, modulation: Singles, period: float, table: Singles, first: int, last: int
) -> None:
    some = slice(first, last)
    with np.errstate(invalid="ignore"):  # of NaN any place
        at = ((place[some] + np.float32(0.5)) * np.float32(PLACES / period)).astype(np.int32) & (PLACES - 1)
    image[some] -= np.where(np.isfinite(place[some]), modulation[some] * table[at], np.float32(0))
