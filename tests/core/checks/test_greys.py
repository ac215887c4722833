"""Grey values that a capture leaves out, against those of the others of its camera; images that stand in several."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from core.checks import grey_concerns, repeated_frames, repeated_planes
from core.model import Capture, DeviceSpec, Frame, Note, PlaneEvaluation, TargetSet
from core.patterns import Code, White
from core.pipeline.evidence import frames_named
from core.verify.pixels import gaps_among

Images = list[np.ndarray]


def taken(bits: int, noise: float, seed: int = 0) -> Images:
    """A dark board with brighter spots, as a camera digitises it: noise of a few grey values, or hardly any."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(0, 9, 160), np.linspace(0, 7, 120))
    scene = 8 + 110 * np.clip(2 * np.sin(2 * x) * np.sin(2 * y) - 0.4, 0, 1) ** 1.5
    top = 2**bits - 1
    grey = [np.round(top / 255 * (k * scene + rng.normal(0, noise, scene.shape))) for k in np.linspace(0.4, 1.6, 20)]
    return [np.clip(g, 0, top).astype(np.uint8 if bits == 8 else np.uint16) for g in grey]


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
@pytest.mark.parametrize("noise", [0.0, 0.3, 2.0])
def test_a_camera_leaves_no_grey_value_out(bits: int, noise: float) -> None:
    assert gaps_among(taken(bits, noise)) < 0.01


SPOILT: dict[str, tuple[Callable[[np.ndarray], np.ndarray], float]] = {  # and the share that arithmetic leaves out
    "twice as bright": (lambda i: np.minimum(2 * i.astype(int), 255), 1 / 2),
    "brighter by a quarter": (lambda i: np.minimum(np.round(1.25 * i), 255), 1 / 5),
    "two bits fewer": (lambda i: i // 4 * 4, 3 / 4),
    "the same": (lambda i: i, 0.0),
    "half as bright": (lambda i: i // 2, 0.0),
}


@pytest.mark.parametrize("kind", list(SPOILT))
def test_what_was_stretched_after_the_camera_leaves_values_out(kind: str) -> None:
    change, share = SPOILT[kind]
    assert gaps_among([change(i).astype(np.uint8) for i in taken(8, 2.0)]) == pytest.approx(share, abs=0.05)


@pytest.mark.parametrize(
    ("gaps", "told"),
    [
        ([0.0, 0.33, 0.0, 0.001, 0.0], ["b"]),
        ([0.0, 0.33, 0.0], []),  # three do not say what is usual
        ([0.0, 0.33, 0.33, 0.0, 0.0], []),  # two of five: taken by another setting
        ([0.4, 0.5, 0.4, 0.4, 0.4], []),  # the camera's own table
        ([0.0, 0.05, 0.0, None, 0.0, 0.0], []),
    ],
)
def test_one_capture_unlike_the_others_is_named(gaps: list[float | None], told: list[str]) -> None:
    none = np.zeros((0, 2))
    empty = np.zeros(0, np.int64)
    sets = [
        TargetSet(name, empty, empty, none, np.zeros((0, 2, 2)), none, none, none, np.zeros(0), gaps=share)
        for name, share in zip("abcdef", gaps, strict=False)
    ]
    concerns = grey_concerns(sets)
    assert [c.text[0] for c in concerns] == told
    assert all(re.search("leave out 33% of the grey values, those of the other captures 0%", c.text) for c in concerns)


def test_frames_of_one_grey_value_may_stand_in_many_captures() -> None:
    """Without noise and ambient light a camera that sees half of the light has the same black frame in each."""
    patterns = [Code("gray", "x", bit, 2, 1, False) for bit in range(2)]
    captures = [
        Capture(Path(name), "testfield", tuple(Frame(f"{name}/{k}.png", p) for k, p in enumerate(patterns)))
        for name in ("a", "b")
    ]
    contents = {"a/0.png": "dark", "b/0.png": "dark", "a/1.png": "1", "b/1.png": "2"}
    rig = {"projector": DeviceSpec(4, 4, (0.1, 0.1), 100.0)}
    assert repeated_frames(captures, rig, contents, lambda frame: frame.place.endswith("0.png")) == []
    (concern,) = repeated_frames(captures, rig, contents, lambda frame: False)
    assert concern.text.startswith("b: 0.png also stands in a")


def test_files_that_another_capture_holds_are_counted() -> None:
    """Of 20 files four were named, as if these were all."""
    patterns = [Code("gray", "x", bit, 30, 1, False) for bit in range(30)]
    captures = [
        Capture(Path(name), "object", tuple(Frame(f"{name}/{k:02d}.png", p) for k, p in enumerate(patterns)))
        for name in ("a", "b")
    ]
    contents = {f.place: f.path.name if int(f.path.stem) < 20 else f.place for c in captures for f in c.frames}
    (concern,) = repeated_frames(captures, {}, contents, lambda frame: False)
    assert concern.text.startswith("b: 00.png, 01.png, 02.png, 03.png and 16 more also stand in a")


@pytest.mark.parametrize(
    ("strange", "told"),
    [({}, "b"), ({"a": {1}}, "a"), ({"b": {1}}, "b"), ({"a": {1}, "b": {1}}, "b"), ({"a": {0}}, "b")],
)
def test_of_two_captures_that_share_a_frame_the_one_that_it_contradicts_is_named(strange: dict, told: str) -> None:
    """The later one was, though the frame is its own."""
    patterns = [Code("gray", "x", bit, 3, 1, False) for bit in range(3)]
    captures = [
        Capture(Path(name), "object", tuple(Frame(f"{name}/{k}.png", p) for k, p in enumerate(patterns)))
        for name in ("a", "b")
    ]
    contents = {f.place: "same" if f.path.stem == "1" else f.place for c in captures for f in c.frames}
    (concern,) = repeated_frames(captures, {}, contents, no, strange=strange)
    other = "b" if told == "a" else "a"
    assert concern.text == f"{told}: 1.png also stands in {other}: a file of another capture; record it again"
    assert concern.about == told


def test_frames_are_named_by_what_captures_say_of_them() -> None:
    nothing = np.zeros((0, 2))
    field = TargetSet(
        "one", *np.zeros((2, 0), int), nothing, np.zeros((0, 2, 2)), nothing, nothing, nothing, np.zeros(0)
    )
    notes = (
        Note("frame 3 claims sine step 3 of 5, period 18 across columns and shows black", "value"),
        Note("frames 11 and 12 were exchanged", "mistake"),
        Note("frame 7 is as noisy as the others", "capture"),
    )
    assert frames_named([replace(field, notes=notes)]) == {"one": {3, 11, 12}}


def test_a_file_that_many_captures_hold_is_told_once_of_each_and_looked_at_once() -> None:
    """Of 2,000 captures with one white frame decoding one read that frame 2,000,000 times, and told it 1,999 times."""
    bit = Code("gray", "x", 0, 1, 1, False)
    captures = [
        Capture(Path(f"c{k}"), "object", (Frame(f"c{k}/w.png", White()), Frame(f"c{k}/0.png", bit))) for k in range(40)
    ]
    contents = {f.place: "white" if f.pattern == White() else f.place for c in captures for f in c.frames}
    looked_at: list[Frame] = []
    told = repeated_frames(captures, {}, contents, lambda frame: bool(looked_at.append(frame)))
    assert [c.text.partition(":")[0] for c in told] == [c.name for c in captures[1:]]
    assert all("w.png also stands in c0" in c.text for c in told)
    assert len(looked_at) == 1


def test_captures_of_what_stands_still_may_share_a_white_frame() -> None:
    bit = Code("gray", "x", 0, 1, 1, False)
    captures = [Capture(Path(c), "object", (Frame(f"{c}/w", White()), Frame(f"{c}/0", bit))) for c in "abc"]
    contents = {f.place: "white" for c in captures for f in c.frames if f.pattern == White()}
    for strange, told in (("", []), ("c", ["b", "c"]), ("a", ["b", "c"])):
        found = repeated_frames(captures, {}, contents, no, own=lambda c, _, of=strange: c.name != of)
        assert [c.about for c in found] == told
    of_code = {f.place: "code" for c in captures for f in c.frames if f.pattern == bit}
    assert len(repeated_frames(captures, {}, of_code, no, own=lambda *_: True)) == 2
    assert [c.about for c in repeated_frames(captures, {}, of_code, no, of_each=True)] == ["b", "c", "a"]


def no(frame: Frame) -> bool:
    return False


@pytest.mark.parametrize(("device", "told"), [({}, 0), ({"camera": "right"}, 1), ({"projector": "second"}, 1)])
def test_images_of_two_devices_are_never_one_file(device: dict[str, str], told: int) -> None:
    """A camera may have one image of two patterns that are alike on its projector's lines; two cameras may not."""
    rig = {name: DeviceSpec(4, 4, (0.1, 0.1), 100.0) for name in ("projector", "second")}
    gray, binary = (Frame("0.png", Code(kind, "x", 0, 2, 1, False)) for kind in ("gray", "binary"))
    capture = Capture(Path("a"), "testfield", (gray, replace(binary, **device)))
    assert len(repeated_frames([capture], rig, {"0.png": "1"}, lambda frame: False)) == told


COPIES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "as they are": lambda i: i,
    "darker": lambda i: np.round(0.7 * i + 3),
    "brighter, clipped": lambda i: np.minimum(np.round(1.3 * i), 255),
}


NOISES = [(kind, noise) for kind in COPIES for noise in (0.3, 1.0, 3.0)]
COPIES["with noise of a grey value"] = lambda i: i + np.random.default_rng(7).integers(-1, 2, i.shape)


@pytest.mark.parametrize(("kind", "noise"), [*NOISES, ("with noise of a grey value", 1.5)])
def test_planes_of_the_same_frames_are_told_from_planes_that_stood_still(kind: str, noise: float) -> None:
    images = {name: taken(8, noise, seed) for seed, name in enumerate("ab")}
    images["c"] = [COPIES[kind](i) for i in images["a"]]

    def pairs(a: str, b: str) -> list[tuple[np.ndarray, np.ndarray]]:
        return [*zip(images[a][-3:], images[b][-3:], strict=True)]

    def planes(*distances_mm: float) -> list[PlaneEvaluation]:
        at = [np.array([0, 0, 1, -mm]) for mm in distances_mm]
        return [
            PlaneEvaluation(name, 0, "m", 9, 0.1, 0.3, -0.3, 0.1, 0, "", p) for name, p in zip("abc", at, strict=True)
        ]

    assert repeated_planes(planes(600, 600, 600.1), pairs) == {"c": "a"}
    assert repeated_planes(planes(600, 600, 650), pairs) == {}


@pytest.mark.parametrize(("slant", "texture"), [(1.0, 0.0), (0.4, 0.0), (0.0, 0.02), (0.0, 0.05)])
def test_slanted_stripes_and_a_rough_surface_are_no_noise_that_two_exposures_share(
    slant: float, texture: float
) -> None:
    """A copy with a little noise is told from them, however much a pixel differs from its neighbours."""
    rng, (v, u) = np.random.default_rng(3), np.mgrid[:240, :320]
    stripes = 90 + 60 * np.cos(np.pi / 2 * (u + slant * v) / np.hypot(1, slant))
    light = stripes * (1 + texture * rng.normal(size=u.shape)) * np.exp(-(((u - 160) ** 2 + (v - 120) ** 2) / 3e5))
    first, again = (np.round(light + rng.normal(0, 1.5, u.shape)) for _ in range(2))
    even = stripes * (1 + 0.05 * rng.normal(size=u.shape))
    evenly_lit = [np.round(even + rng.normal(0, 1.5, u.shape)) for _ in range(2)]
    planes = [PlaneEvaluation(n, 0, "m", 9, 0.1, 0.3, -0.3, 0.1, 0, "", np.array([0, 0, 1, -600])) for n in "ab"]
    for pair in ((first, again), evenly_lit):
        assert repeated_planes(planes, lambda a, b, pair=pair: [pair]) == {}
    if slant < 1:
        noisy = first + rng.integers(-1, 2, u.shape)
        assert repeated_planes(planes, lambda a, b: [(first, noisy)]) == {"b": "a"}
