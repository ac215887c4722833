"""Words that only a look-up tells apart, against the truth of an independent forward model."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import cv2
import numpy as np
import pytest

from core.decode import Flag, decode, refuse_patterns
from core.decode.words.book import BLURS, book_of
from core.errors import InputError
from core.model import named_by
from core.patterns import Black, Code, Level, Lines, Phase, White, brightness, gray_and_phase, parse_sequence

N, PAPER = 320, 640  # lines: words times pixels are the work


@pytest.fixture
def bench(bench):
    """Two lines to three pixels, as everywhere."""
    return partial(bench, width=500, count=N)


@pytest.fixture
def rig(bench):
    """Of as many lines as the published one, with its noise."""
    return partial(bench, height=80, width=1000, count=PAPER, ambient=12, gain=70, dark=2.6, shot=0.02)


def paper() -> list:
    return list(parse_sequence("paper:axes=x").patterns((PAPER, PAPER)))


def dense(frames: int, lines: int = N) -> list:
    return list(parse_sequence(f"dense:axes=x,frames={frames}").patterns((lines, 8)))


def test_28_frames_have_two_thirds_of_the_papers_noise_and_no_wrong_word(rig, judge) -> None:
    """14 frames an axis against the paper's 13 with white and black; noise and blur of the published rig."""
    b = rig(blur=0.6)
    found = {}
    for name, patterns in (("paper", paper()), ("dense", dense(14, PAPER))):
        found[name] = judge(decode(patterns, b.take(patterns), lines=(PAPER, PAPER)), b.u, 2)
    assert found["dense"].gross == 0
    assert found["dense"].valid > 0.998
    assert found["dense"].rms < 0.67 * found["paper"].rms  # 0.66 of what the paper had before its ripple was taken out
    assert 0.95 < found["dense"].sigma_ratio < 1.05


def test_16_frames_are_no_worse_than_the_papers_28(rig, judge) -> None:
    b = rig(blur=0.55)
    phases, words = paper(), dense(8, PAPER)
    before = judge(decode(phases, b.take(phases), lines=(PAPER, PAPER)), b.u, 2)
    after = judge(decode(words, b.take(words), lines=(PAPER, PAPER)), b.u, 2)
    assert after.rms < before.rms
    assert after.gross < 5e-4 * b.u.size
    assert after.valid > 0.99
    assert 0.95 < after.sigma_ratio < 1.05


@pytest.mark.parametrize("gain", [3.0, 7.0, 20.0])
def test_a_dark_surface_is_refused_rather_than_wrong(bench, gain: float) -> None:
    """7 grey values are a tenth of the rig's light: without the margin a third of the words would be wrong."""
    b = bench(height=40, blur=0.6, gain=gain, dark=2.6)
    patterns = dense(14)
    u = decode(patterns, b.take(patterns), lines=(N, N)).u
    valid = np.isfinite(u)
    assert np.count_nonzero(np.abs(u - b.u) > 2) <= 5e-4 * u.size
    assert valid.mean() >= {3.0: 0.0, 7.0: 0.03, 20.0: 0.99}[gain]


@pytest.mark.parametrize("blur", [0.35, 1.0])
def test_the_blur_is_found_in_the_frames(bench, judge, blur: float) -> None:
    patterns = dense(14, 200)
    b = bench(height=40, width=400, count=200, blur=blur, gain=90, dark=3.0)
    result = judge(decode(patterns, b.take(patterns), lines=(200, 200)), b.u, 2)
    assert result.gross == 0
    assert result.valid > 0.99
    assert 0.9 < result.sigma_ratio < 1.1


@pytest.mark.parametrize("rows", [slice(60, None), slice(None)], ids=["a part", "everywhere"])
@pytest.mark.parametrize("part", [0.08, 0.3])
def test_sigma_holds_light_by_a_second_way(rig, judge, part: float, rows: slice) -> None:
    """From a facing wall, tens of lines away; it leaves the noise of the rest as it is."""
    b, patterns = rig(height=120, blur=0.6, ambient=15, gain=90, dark=3.0), dense(14, PAPER)
    second = replace(b, u=(PAPER - 1 - b.u) * 0.83 + 9, ambient=0.0, gain=part * b.gain, dark=0.0, shot=0.0)
    images = [image.copy() for image in b.take(patterns)]
    for image, more in zip(images, second.take(patterns), strict=True):
        image[rows] += more[rows]
    phase = decode(patterns, images, lines=(PAPER, PAPER))
    score = (phase.u - b.u) / phase.sigma_u
    assert np.isfinite(score).mean() > 0.99
    assert np.nanmax(np.abs(score)) < 10
    apart = slice(50 if rows.start else 0)  # 1.7 to 5 without, and up to 1.14 in the rest
    ratios = [np.sqrt(np.nanmean(s**2)) for s in (score[rows], score[apart]) if s.size]
    assert all(0.9 < ratio < 1.12 for ratio in ratios)
    (note,) = phase.notes
    assert float(note.split("about ")[1].split("%")[0]) == pytest.approx(100 * part, rel=0.15)


def test_pixels_count_where_light_by_a_second_way_is_as_much_as_is_told(bench) -> None:
    """A seventh of the image sees 30 %, the rest 4 %: that "all pixels" see "30 %" was told before."""
    b, patterns, part = bench(height=84, blur=0.6, gain=90, dark=0.3), dense(14), np.full(84, 0.04)
    part[:12] = 0.3
    second = replace(b, u=(N - 1 - b.u) * 0.83 + 9)
    images = [
        np.rint(image + part[:, None] * b.gain * second.light(p)).astype(np.uint8)
        for image, p in zip(b.take(patterns), patterns, strict=True)
    ]
    (note,) = decode(patterns, images, lines=(N, N)).notes
    pixels, light = (float(text.split()[-1]) for text in note.split("%")[:2])
    assert pixels == pytest.approx(100 / 7, abs=6)  # residuals are averaged over three rows
    assert light == pytest.approx(30, abs=5)


@pytest.mark.parametrize(("lamp", "room"), [(0.1, 0.0), (0.0, 0.2), (0.03, 0.2)])
def test_light_that_flickers_costs_no_accuracy(bench, judge, lamp: float, room: float) -> None:
    """Of every frame offset and gain are found: 1.2 to 3.8 times the noise without, and a second light was blamed."""
    b, patterns = bench(height=40, blur=0.6, ambient=40, gain=90, dark=3.0, shot=0.02), dense(14)
    draw, images = np.random.default_rng(2), []
    for seed, pattern in enumerate(patterns):
        more, brighter = 1 + room * draw.normal(), 1 + lamp * draw.normal()
        images += replace(b, ambient=40 * more, gain=90 * brighter, seed=seed).take([pattern])
    steady = judge(decode(patterns, b.take(patterns), lines=(N, N)), b.u, 2)
    phase = decode(patterns, images, lines=(N, N))
    found = judge(phase, b.u, 2)
    assert found.valid > 0.998
    assert found.rms < 1.05 * steady.rms
    assert 0.95 < found.sigma_ratio < 1.05
    assert not phase.notes


@pytest.mark.parametrize(
    ("frames", "gamma", "spread"),
    [(14, 2.2, 0.0), (14, 0.7, 0.0), (14, 1.0, 3.0), (14, 1.0, 8.0), (14, 1.8, 5.0), (8, 2.2, 0.0), (8, 1.0, 8.0)],
)
def test_a_camera_with_a_gamma_and_surfaces_that_spread_light(bench, judge, frames, gamma, spread) -> None:
    """All words are bent alike: that is found. It was a second light, with sigma 0.8 to 1 of the error before."""
    b, patterns, draw = bench(height=40, blur=0.6), dense(frames), np.random.default_rng(3)
    images, wide = [], replace(b, blur=max(spread, 0.6))
    for pattern in patterns:
        light = 15 + 120 * (0.6 * b.light(pattern) + 0.4 * wide.light(pattern))
        grey = 255 * (light / 255) ** (1 / gamma) + 2.5 * draw.normal(size=light.shape)
        images.append(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
    phase = decode(patterns, images, lines=(N, N))
    found = judge(phase, b.u, 2)
    assert not phase.notes
    assert found.gross == 0
    assert found.valid > 0.99
    assert 0.93 < found.sigma_ratio < 1.05


def test_compressed_frames_are_no_second_light(bench) -> None:
    patterns = dense(14)
    images = bench(height=120, blur=0.6, gain=90, dark=3.0).take(patterns)
    quality = [cv2.IMWRITE_JPEG_QUALITY, 25]
    images = [cv2.imdecode(cv2.imencode(".jpg", image, quality)[1], cv2.IMREAD_GRAYSCALE) for image in images]
    (note,) = decode(patterns, images, lines=(N, N)).notes
    assert "JPEG" in note
    assert "second way" not in note


def test_a_decoded_pixel_without_a_decoded_neighbour_is_none(bench) -> None:
    patterns = dense(14)
    images = bench(height=9, gain=90).take(patterns)
    lit = np.zeros(images[0].shape, bool)
    lit[4, 100], lit[2:7, 300:340] = True, True
    u = decode(patterns, [np.where(lit, image, 15).astype(np.uint8) for image in images], lines=(N, N)).u
    assert np.isnan(u[4, 100])
    assert np.isfinite(u[2:7, 300:340]).mean() > 0.99


def test_words_on_one_axis_and_code_on_the_other(bench, judge) -> None:
    words = [*parse_sequence("dense:axes=x,frames=10").patterns((160, 160))]
    patterns = [*words, *gray_and_phase("y", 160, cell=4, periods=[8]), White(), Level(0.3), Black()]
    b = bench(height=120, width=160, count=160, both=True, gain=120, dark=3.0)
    phase = decode(patterns, b.take(patterns), lines=(160, 160))
    for axis, truth in (("x", b.u), ("y", b.v)):
        result = judge(phase, truth, 3, axis)
        assert result.gross == 0
        assert result.valid > 0.98
        assert 0.9 < result.sigma_ratio < 1.15


def test_words_with_phases_besides(bench, judge) -> None:
    """Every frame of the axis counts: fringes refine what the words tell."""
    patterns = [*dense(8, 160), *gray_and_phase("x", 160, cell=1, periods=[8])[-4:]]
    b = bench(height=40, width=400, count=160, gain=90, dark=3.0)
    both = judge(decode(patterns, b.take(patterns), lines=(160, 160)), b.u, 2)
    words = judge(decode(patterns[:8], b.take(patterns[:8]), lines=(160, 160)), b.u, 2)
    assert both.gross == 0
    assert both.rms < 0.95 * words.rms


def test_what_the_projector_does_not_light_is_flagged(bench) -> None:
    patterns = dense(10, 160)
    b = bench(height=20, width=200, count=160, gain=90)
    images = b.take(patterns)
    for image in images:
        image[:5] = 17
    phase = decode(patterns, images, lines=(160, 160))
    assert np.isnan(phase.u[:5]).all()
    assert (phase.flags[:5] & Flag.LOW_MODULATION).all()
    assert np.isnan(phase.v).all()


def test_too_few_frames_and_words_that_repeat_are_refused() -> None:
    image = np.zeros((4, 4), np.uint8)
    with pytest.raises(InputError, match="axis x"):
        decode([Lines("x", "0100"), Lines("x", "0010")], [image] * 2, lines=(4, 4))
    again = [Lines("x", p.values[:20] * 2) for p in dense(6, 40)]
    with pytest.raises(InputError, match="same at several lines"):
        decode(again, [image] * 6, lines=(40, 4))


@pytest.mark.parametrize("lines_a_pixel", [1.9, 2.6])
def test_a_camera_coarser_than_the_lines_sees_no_second_light(bench, lines_a_pixel: float) -> None:
    """What its pixels, and no blur, mix was called gloss or a facing wall in half of the image."""
    patterns = dense(40)
    wide = round(lines_a_pixel * 500 / N)
    b = bench(blur=0.3, dark=0.01)
    fine = [image[:, : 500 // wide * wide].astype(float) for image in b.take(patterns)]
    rng = np.random.default_rng(2)
    coarse = [image.reshape(len(image), -1, wide).mean(axis=2) for image in fine]
    images = [np.rint(image + rng.normal(0, 1, image.shape)).clip(0, 255).astype(np.uint8) for image in coarse]
    true = b.u[:, : 500 // wide * wide].reshape(len(b.u), -1, wide).mean(axis=2)
    phase = decode(patterns, images, lines=(N, N))
    assert all("a pixel sees several lines" in note and named_by(note) == "mended" for note in phase.notes)
    known = np.isfinite(phase.u)
    assert known.mean() > 0.9
    assert np.abs(phase.u - true)[known].max() < 0.1


def test_two_lines_of_one_word_are_known_to_a_cell(bench) -> None:
    """Lines of a Gray code with cells of two: between two edges all places look the same."""
    number = np.arange(N) // 2
    words = [(number ^ (number >> 1)) >> bit & 1 for bit in range(9)]
    patterns = [*(Lines.of("x", word) for word in words), White(), Black()]
    b = bench(blur=0.4)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    error = np.abs(phase.u - b.u) / phase.sigma_u
    known = np.isfinite(error)
    assert known.mean() > 0.9
    assert np.quantile(error[known], 0.997) < 3
    assert 0.1 < np.median(phase.sigma_u[known]) < 2 / np.sqrt(12)


@pytest.mark.parametrize("kind", ["gray", "binary"])
@pytest.mark.parametrize(("bits", "cell", "before"), [(9, 1, 47), (6, 8, 133), (7, 4, 0)])
def test_lists_that_are_the_bits_of_a_code_decode_as_that(bench, kind: str, bits: int, cell: int, before: int) -> None:
    """Many programs begin a Gray code in its middle: as words of single lines four fifths of such pixels were lost."""
    code = [Code(kind, "x", bit, bits, cell, inverse=bit == 2) for bit in range(bits)]  # type: ignore[arg-type]
    lists = [Lines.of("x", brightness(p, np.arange(before, before + N))) for p in code]
    patterns = [*lists, White(), Black()]
    b = bench(blur=0.6)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    error = np.abs(phase.u - b.u) / phase.sigma_u
    known = np.isfinite(error)
    assert known.mean() > 0.95
    assert np.quantile(error[known], 0.99) < 3
    assert np.nanmin(phase.u) > -0.6
    assert np.nanmax(phase.u) < N - 0.4


def test_patterns_of_the_axis_beside_words_are_refused_as_in_decoding() -> None:
    """Those of the other axis were not looked at, and `check` said that everything fits."""
    patterns = [*dense(8, 40), *(Phase("y", 8.0, 4, k, k * np.pi / 2, "sine") for k in range(2))]
    with pytest.raises(InputError, match="axis y") as decoding:
        decode(patterns, [np.full((4, 4), 9 * k, np.uint8) for k in range(len(patterns))], lines=(40, 40))
    with pytest.raises(InputError, match="axis y") as refused:
        refuse_patterns(patterns, (40, 40))
    assert str(refused.value) == str(decoding.value)
    refuse_patterns(dense(8, 40), (40, 40))


def test_phases_beside_lists_that_are_bits_of_a_code(bench) -> None:
    code = [Code("gray", "x", bit, 6, 8) for bit in range(6)]
    lists = [Lines.of("x", brightness(p, np.arange(69, 69 + N))) for p in code]
    steps = [Phase("x", 16.0, 4, k, k * np.pi / 2, "sine") for k in range(4)]
    patterns = [*lists, *steps, White(), Black()]
    b = bench(blur=0.6)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    known = np.isfinite(phase.u)
    assert known.mean() > 0.97
    assert np.sqrt(np.mean(((phase.u - b.u) / phase.sigma_u)[known] ** 2)) == pytest.approx(1, abs=0.25)
    assert np.median(phase.sigma_u[known]) < 0.15


def shifted_gray(lines: int, before: int) -> list:
    """A Gray code that begins `before` lines early, as other programs centre theirs, with the inverse of every bit."""
    number = np.arange(lines) + before
    words = [(number ^ (number >> 1)) >> bit & 1 for bit in range(10)]
    return [*(Lines.of("x", shown) for word in words for shown in (word, 1 - word)), White(), Black()]


@pytest.mark.parametrize("blur", [4.0, 8.0])
def test_lines_finer_than_a_pixel_cost_their_bits_alone(bench, judge, blur: float) -> None:
    """Stripes of one and two lines leave no contrast; those of eight tell the place still."""
    patterns = shifted_gray(N, 192)
    b = bench(blur=blur, gain=150.0, dark=2.0)
    phase = decode(patterns, b.take(patterns), lines=(N, N))
    inner = np.isfinite(phase.u) & (b.u > 4 * blur) & (b.u < N - 4 * blur)  # the field's edge fades as fringes do
    error = (phase.u - b.u)[inner]
    assert inner.mean() > 0.8
    assert np.abs(error).max() < blur
    assert 0.85 < np.sqrt(np.mean((error / phase.sigma_u[inner]) ** 2)) < 1.15
    assert phase.notes == ()


@pytest.mark.parametrize(
    ("blur", "shown", "said"),
    [(0.6, slice(None, None, -1), "capture.json"), (25.0, slice(None), "Focus"), (0.6, slice(0), "full scale (255)")],
    ids=["other words", "blurred", "too bright"],
)
def test_words_that_decode_nowhere_say_why(bench, blur: float, shown: slice, said: str) -> None:
    patterns = dense(14, PAPER)
    seen = partial(bench, width=1000, count=PAPER)  # blurred lines of half as many are told apart
    images = seen(blur=blur, gain=90.0).take(patterns)[shown] or seen(gain=900.0).take(patterns)
    note = decode(patterns, images, lines=(PAPER, PAPER)).notes[0]
    assert note.startswith("Only 0% of the pixels that the projector lights decode: ")
    assert said in note


@pytest.mark.parametrize("frames", [8, 14])
@pytest.mark.parametrize(("gain", "part"), [(90.0, 0.0), (90.0, 0.3), (20.0, 0.0), (5.0, 0.0)])
def test_what_neighbours_foretell_is_what_all_words_tell(bench, frames: int, gain: float, part: float) -> None:
    """Against the product of all words with all pixels: at steps of the surface, in a second light, dark and unlit."""
    patterns = dense(frames)
    b = bench(height=6, blur=0.6, gain=gain, dark=3.0, shot=0.02)
    b = replace(b, u=np.where(np.arange(b.u.shape[1]) % 150 > 90, b.u - 60.3, b.u))
    second = replace(b, u=(N - 1 - b.u) * 0.83 + 9, ambient=0.0, gain=part * gain, dark=0.0, shot=0.0)
    images = [image + more for image, more in zip(b.take(patterns), second.take(patterns), strict=True)]
    grey = np.stack([np.where(np.arange(image.size) % 999 < 80, 17, image.ravel()) for image in images])
    grey = grey.astype(np.float32)
    book = book_of(tuple(patterns), "x", N, "capture")
    blur = int(np.argmin(np.abs(BLURS - 0.6)))
    fits = book.shelf(blur).words @ (grey - grey.mean(axis=0))
    best = fits.argmax(axis=0)
    away = np.abs(np.arange(len(fits))[:, None] - best) > book.shelf(blur).apart
    rival = np.where(away, fits, 0).max(axis=0)
    found = book.compared(blur).find(grey, b.u.shape[1])
    near = 1e-4 * np.linalg.norm(grey, axis=0)
    assert np.all((found.best == best) | (np.abs(found.top - fits.max(axis=0)) < near))
    assert np.all(found.rival > rival - near)
    assert np.all((found.rival < rival + near)[found.known])
    lit = np.arange(grey.shape[1]) % 999 >= 80
    assert np.all((found.rival <= np.maximum(found.top, 0) + near)[lit])
    assert (~found.known).mean() > (0.6 if gain == 90.0 and frames == 14 else -1)


def test_pixels_beyond_the_last_line_do_not_tell_what_bends_words(bench, judge) -> None:
    """Words end there: neither place nor contrast follows, and decoding ended with "Singular matrix"."""
    within, patterns, draw = bench(height=80, blur=0.6), dense(14), np.random.default_rng(3)
    beyond = np.zeros(within.u.shape, bool)
    beyond[:, :150] = True  # so bright that the last line's blur lights it like the rest
    b, images = replace(within, u=np.where(beyond, N + 0.6, within.u)), []
    gain, wide = np.where(beyond, 2500, 120), replace(b, blur=3.0)
    for pattern in patterns:
        light = 15 + gain * (0.7 * b.light(pattern) + 0.3 * ~beyond * wide.light(pattern))
        images.append(np.clip(np.rint(light + 4 * draw.normal(size=light.shape)), 0, 255).astype(np.uint8))
    phase = decode(patterns, images, lines=(N, N))
    inside = judge(replace(phase, u=np.where(beyond, np.nan, phase.u)), b.u, 2)
    assert inside.gross == 0
    assert inside.valid > 0.99 * np.mean(~beyond)
    assert 0.93 < inside.sigma_ratio < 1.05
