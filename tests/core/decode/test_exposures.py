"""Several exposures in one capture: what saturates in one is seen in another."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.decode import decode
from core.decode.exposures import fuse_exposures
from core.decode.options import DecodeOptions
from core.errors import InputError
from core.patterns import Black, White, gray_and_phase, use_of
from tests.core.decode.conftest import score

N = 640
PATTERNS = [*gray_and_phase("x", N, cell=8, periods=[16]), White(), Black()]
PAPER = [*gray_and_phase("x", N, cell=2, periods=[4], profile="square"), White(), Black()]
EXPOSURES = (4.0, 20.0)


def exposed(bench, offset: float = 5.0):
    """Albedo from 0.02 to 1 in bands: no exposure shows all of it. The light grows with it, the offset does not."""
    albedo = np.geomspace(0.02, 1, 40)[:, None]
    patterns, images, exposures = [], [], []
    b = bench(blur=1.0)
    for k, ms in enumerate(EXPOSURES):
        light = albedo * ms * 45
        taken = replace(b, ambient=offset + 0.1 * light, gain=light, dark=1.0, shot=0.02, seed=k).take(PATTERNS)
        patterns, images, exposures = patterns + PATTERNS, images + taken, exposures + [ms] * len(PATTERNS)
    return b, patterns, images, exposures


def test_all_albedos_decode_where_each_exposure_alone_loses_some(bench, judge) -> None:
    b, patterns, images, exposures = exposed(bench)
    fused = judge(decode(patterns, images, lines=(N, N), exposures_ms=exposures), b.u, 8)
    assert fused.gross == 0
    assert fused.valid > 0.99
    assert 0.95 < fused.sigma_ratio < 1.05
    for k in range(2):
        mine = slice(k * len(PATTERNS), (k + 1) * len(PATTERNS))
        assert judge(decode(PATTERNS, images[mine], lines=(N, N)), b.u, 8).valid < fused.valid - 0.1


PARTS = {  # which uses of patterns are taken with which exposure alone
    "white long": {"level": 20.0},
    "code long, phases short": {"code": 20.0, "phase": 4.0},
    "code short, white long": {"code": 4.0, "level": 20.0},
}


@pytest.mark.parametrize("alone", list(PARTS.values()), ids=list(PARTS))
def test_patterns_of_some_exposures_alone_leave_no_wrong_order_nor_sigma(bench, judge, alone) -> None:
    """White saturated in its only exposure made every bit dark that a shorter one shows."""
    b, *every = exposed(bench)
    kept = [(p, image, ms) for p, image, ms in zip(*every, strict=True) if alone.get(use_of(p), ms) == ms]
    patterns, images, exposures = (list(column) for column in zip(*kept, strict=True))
    found = judge(decode(patterns, images, lines=(N, N), exposures_ms=exposures), b.u, 8)
    assert found.gross == 0
    assert found.valid > 0.7
    assert 0.93 < found.sigma_ratio < 1.07


@pytest.mark.parametrize("ms", EXPOSURES)
def test_steps_that_lack_an_exposure_are_as_noisy_as_sigma_says(bench, judge, ms: float) -> None:
    """Sigma was 2.3 times too small where one step is saturated in the only exposure that it has."""
    b, *every = exposed(bench)
    first = PATTERNS.index(next(p for p in PATTERNS if use_of(p) == "phase"))
    kept = [
        (p, image, t) for p, image, t in zip(*every, strict=True) if p not in PATTERNS[first : first + 2] or t == ms
    ]
    patterns, images, exposures = (list(column) for column in zip(*kept, strict=True))
    found = judge(decode(patterns, images, lines=(N, N), exposures_ms=exposures), b.u, 8)
    assert found.gross == 0
    assert 0.95 < found.sigma_ratio < 1.1


def test_axes_of_unlike_exposures_are_each_as_noisy_as_their_own(bench) -> None:
    """No pattern tells how exposures compare; both axes had the mean of their noise: 1.5 and 0.5 of sigma."""
    b = bench(height=300, width=300, count=300, both=True, blur=1.0)
    ways = [gray_and_phase(axis, 300, cell=8, periods=[16]) for axis in ("x", "y")]
    patterns, images, exposures = [], [], []
    for k, (ms, way) in enumerate(zip(EXPOSURES, ([*ways[0]], [*ways[1], White(), Black()]), strict=True)):
        light = ms * np.linspace(1.5, 10, 300)[:, None]
        images += replace(b, ambient=3.0 + 0.05 * light, gain=light, dark=1.0, shot=0.02, seed=k).take(way)
        patterns, exposures = [*patterns, *way], exposures + [ms] * len(way)
    phase = decode(patterns, images, lines=(300, 300), exposures_ms=exposures)
    for axis, truth in (("x", b.u), ("y", b.v)):
        found = score(phase, truth, 8, axis)
        assert found.gross == 0
        assert 0.9 < found.sigma_ratio < 1.12


@pytest.mark.parametrize("patterns", [PATTERNS, PAPER], ids=["sine", "square"])
@pytest.mark.parametrize(
    ("bits", "times"), [(8, (20.0, 2.5)), (12, (20.0, 2.5)), (16, (20.0, 2.5)), (8, (20.0, 10.0, 5.0, 2.5))]
)
def test_sigma_holds_from_bright_to_dim(bench, judge, patterns, bits: int, times: tuple[float, ...]) -> None:
    """One straight line for the noise of all made it 0.6 to 0.8 where the longest is saturated, with 12 bits 0.2."""
    lit, b = 2 ** (bits - 8), bench(height=60, blur=0.6, dark=2.6 * 4.0 ** (bits - 8), bits=bits)
    albedo, images, exposures = np.repeat([8.0, 1.0, 0.5], 20)[:, None], [], []
    for k, ms in enumerate(times):
        light = albedo * ms / times[0] * 90 * lit
        images += replace(b, ambient=12.0 * lit + 0.05 * light, gain=light, seed=k).take(patterns)
        exposures += [ms] * len(patterns)
    phase = decode([*patterns] * len(times), images, lines=(N, N), exposures_ms=exposures)
    for rows in (slice(0, 20), slice(20, 40), slice(40, 60)):
        part = replace(phase, u=phase.u[rows], sigma_u=phase.sigma_u[rows], flags=phase.flags[rows])
        found = judge(part, b.u[rows], 2)
        assert found.gross == 0
        # where noise is eight times the usual, a fifth of the pixels count as doubtful besides
        assert (0.83 if times[0] == 8 * times[-1] and rows.start == 0 else 0.95) < found.sigma_ratio < 1.1
    assert not phase.notes


def test_a_wrong_exposure_is_named_and_does_no_harm(bench, judge) -> None:
    b, patterns, images, exposures = exposed(bench)
    sound = judge(decode(patterns, images, lines=(N, N), exposures_ms=exposures), b.u, 8)
    for changed, said in (
        ([3.0 if ms == 4 else ms for ms in exposures], "Frames of 3 ms have 0.2 "),
        ([24.0 - ms for ms in exposures], "Frames of 4 ms have 5 "),
        ([*exposures[:8], 15.0, *exposures[9:]], "Frame 8 (15 ms) has "),
    ):
        phase = decode(patterns, images, lines=(N, N), exposures_ms=changed)
        found = judge(phase, b.u, 8)
        assert found.gross == 0
        assert found.rms < 1.02 * sound.rms
        assert len(phase.notes) == 1
        assert said in phase.notes[0]
    with pytest.raises(InputError, match="times the light of frame"):
        decode(patterns, images, lines=(N, N), exposures_ms=[*exposures[:7], 20.0, *exposures[8:]])


@pytest.mark.parametrize("seed", range(4))
def test_frames_of_equal_light_tell_no_black_level(bench, judge, seed: int) -> None:
    """As of a camera that ignores its setting: the line through both has a slope of one, and starts anywhere."""
    b = replace(bench(height=60, blur=1.0), ambient=12.0, gain=90.0, dark=1.0, shot=0.02)
    images = [image for k in range(2) for image in replace(b, seed=10 * seed + k).take(PATTERNS)]
    patterns, exposures = [*PATTERNS] * 2, [10.0] * len(PATTERNS) + [20.0] * len(PATTERNS)
    fused = fuse_exposures(patterns, images, exposures, DecodeOptions(), "capture")
    assert fused is not None
    assert 0 <= fused.ground <= 12  # no frame is darker
    phase = decode(patterns, images, lines=(N, N), exposures_ms=exposures)
    assert 0.95 < judge(phase, b.u, 8).sigma_ratio < 1.05
    assert "ms have 1 times the light" in phase.notes[0]


def test_grey_values_are_those_of_the_longest_exposure(bench) -> None:
    _, patterns, images, exposures = exposed(bench)
    phase = decode(patterns, images, lines=(N, N), exposures_ms=exposures)
    truth = np.geomspace(0.02, 1, 40) * EXPOSURES[1] * 45
    assert np.nanmedian(phase.modulation, axis=1) == pytest.approx(0.93 * truth / 2, rel=0.05)  # blur leaves 0.93


def test_equal_exposures_change_nothing(bench) -> None:
    images = bench(blur=1.0).take(PATTERNS)
    plain = decode(PATTERNS, images, lines=(N, N))
    told = decode(PATTERNS, images, lines=(N, N), exposures_ms=[10.0] * len(PATTERNS))
    assert np.array_equal(plain.u, told.u, equal_nan=True)
    assert plain.image.dtype == told.image.dtype


def test_an_exposure_that_is_missing_is_named(bench) -> None:
    _, patterns, images, exposures = exposed(bench)
    with pytest.raises(InputError, match='frame 3: no "exposure_ms"'):
        decode(patterns, images, lines=(N, N), exposures_ms=[*exposures[:3], None, *exposures[4:]])


VARIED = {
    "every second": lambda n: 10.0 * (1 + n % 2),
    "a number that counts up": lambda n: 10.0 + n,
    "the phases alone": lambda n: 10.0 if use_of(PATTERNS[n]) == "phase" else 30.0,
    "a single frame": lambda n: 40.0 if n == 7 else 10.0,
}


@pytest.mark.parametrize("given", VARIED.values(), ids=VARIED)
@pytest.mark.parametrize("offset", [0.0, 15.0])
def test_exposures_that_the_light_does_not_follow_are_refused(bench, judge, given, offset: float) -> None:
    """Without two exposures of one pattern nothing else tells; light that does follow them is taken as it is."""
    times = [given(n) for n in range(len(PATTERNS))]
    b = replace(bench(height=60, blur=1.0), dark=0.5, shot=0.02)
    followed = [
        replace(b, ambient=offset + 0.2 * ms, gain=4 * ms, seed=n).take([PATTERNS[n]])[0] for n, ms in enumerate(times)
    ]
    assert judge(decode(PATTERNS, followed, lines=(N, N), exposures_ms=times), b.u, 8).valid > 0.9
    alike = replace(b, ambient=offset + 4, gain=80, seed=0).take(PATTERNS)
    with pytest.raises(InputError, match="ms, but the frames' light does not follow it"):
        decode(PATTERNS, alike, lines=(N, N), exposures_ms=times)


def test_frames_of_hardly_any_light_are_not_taken_for_wrong_exposures(bench) -> None:
    """Of 10 and 20 ms they show the camera's offset and noise, and 3 grey values of stripes at most."""
    times = [20.0 if use_of(p) == "phase" else 10.0 for p in PATTERNS]
    b = replace(bench(height=60), dark=0.5, shot=0.02)
    images = [
        replace(b, ambient=8 + 0.02 * ms, gain=0.15 * ms, seed=n).take([PATTERNS[n]])[0] for n, ms in enumerate(times)
    ]
    phase = decode(PATTERNS, images, lines=(N, N), exposures_ms=times)
    assert np.isfinite(phase.u).mean() < 0.01
