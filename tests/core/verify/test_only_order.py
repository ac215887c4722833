"""An order found from the images is taken only if no other order shows the same images."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from core.cli import main
from core.errors import InputError
from core.model import DeviceSpec, PhaseMap
from core.patterns import Pattern, parse_sequence, pattern_to_dict
from core.project import create_project
from core.verify.proof import prove

SIZE, SHAPE = (64, 48), (96, 128)  # of the projector, columns and rows; of images
NAN = np.full(SHAPE, np.nan, np.float32)


def shown(pattern: Pattern, count: int) -> np.ndarray:
    """Light on every line, written down from the contract."""
    said, i = pattern_to_dict(pattern), np.arange(count)
    if said["kind"] in ("white", "black"):
        return np.full(count, float(said["kind"] == "white"))
    if said["kind"] == "phase":
        wave = np.cos(2 * np.pi * (i + 0.5) / said["period"] - said["shift_rad"])
        return 0.5 + 0.5 * wave if said["profile"] == "sine" else (wave > 0).astype(float)
    word = i // said["cell"]
    word = word ^ (word >> 1) if said["kind"] == "gray" else word
    return (((word >> (said["bits"] - 1 - said["bit"])) & 1) ^ int(said.get("inverse", False))).astype(float)


def field(first: float, last: float, count: int, along: int) -> np.ndarray:
    """Lines (H, W) from the first to the last along an axis of the image, a little askew."""
    at = np.linspace(0, 1, SHAPE[along])
    at = at[None, :] if along else at[:, None]
    across = np.linspace(0, 0.02, SHAPE[1 - along])
    across = across[:, None] if along else across[None, :]
    return np.asarray(np.clip(first + (last - first) * (at + across), 0, count - 1), np.float32)


def phase(u: np.ndarray, v: np.ndarray = NAN) -> PhaseMap:
    return PhaseMap(u, v, NAN, NAN, NAN, NAN, np.zeros(SHAPE, np.uint8))


@pytest.mark.parametrize(
    ("sequence", "first", "last", "told"),
    [
        ("gray-sine:axes=x", 0, 63, ""),
        ("gray-sine:axes=x", 5, 58, ""),
        ("paper:axes=x", 5, 40, ""),  # no inverse frames: each bit has one way
        ("gray-inverse:axes=x", 0, 63, "the other way round"),
        ("gray-inverse:axes=x,steps=0,cell=1", 3, 60, "the other way round"),
        ("gray-inverse:axes=x,steps=0,cell=1", 2, 26, "another order shows the same images"),  # the left half alone
        (
            "gray-inverse:axes=x",
            10,
            42,
            "another order shows the same images 16 columns farther",
        ),  # of 64, in cells of 8
        ("two-period:axes=x", 4, 58, "another order shows the same images"),  # a step of each period moves both alike
    ],
)
def test_what_a_code_leaves_open_is_known(sequence: str, first: float, last: float, told: str) -> None:
    patterns = parse_sequence(sequence).patterns(SIZE)
    try:
        said = prove(patterns, phase(field(first, last, SIZE[0], 1)), SIZE, "test")[1:]
    except InputError as error:
        said = [error.seen]
    assert bool(said) == bool(told)
    assert told in "".join(said)


@pytest.mark.parametrize("bits", [(0, 1), (1, 2), (4, 5), (0, 5)])
def test_exchanged_bits_tear_lines_apart(bits: tuple[int, int]) -> None:
    patterns = parse_sequence("gray-inverse:axes=x,steps=0,cell=1").patterns(SIZE)
    words = np.arange(64) ^ (np.arange(64) >> 1)
    a, b = (words >> (5 - bit) & 1 for bit in bits)
    other = words ^ ((a ^ b) << (5 - bits[0])) ^ ((a ^ b) << (5 - bits[1]))
    number = np.argsort(words)[other]
    with pytest.raises(InputError, match="have no neighbours"):
        prove(patterns, phase(number[np.rint(field(0, 63, 64, 1)).astype(int)].astype(np.float32)), SIZE, "test")


def photographed(patterns: list[Pattern], zoom: float, seed: int) -> list[np.ndarray]:
    """A textured surface with a bump, by a camera with a gamma, noise and blur."""
    rng, (v, u) = np.random.default_rng(seed), np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)
    x, y = u / SHAPE[1] - 0.5, v / SHAPE[1] - 0.5 * SHAPE[0] / SHAPE[1]
    bump = 0.04 * np.exp(-((x - 0.1) ** 2 + y**2) / 0.02)
    at = {"x": SIZE[0] * (0.5 + zoom * (x + 0.05 * y) + bump), "y": SIZE[0] * (zoom * (y - 0.05 * x)) + SIZE[1] / 2}
    texture = 0.6 + 0.4 * (cv2.GaussianBlur(rng.normal(size=SHAPE), (0, 0), 3) > 0)
    images = []
    for p in patterns:
        axis = pattern_to_dict(p).get("axis", "x")
        fine = np.repeat(shown(p, SIZE[axis == "y"]), 8)
        soft = cv2.GaussianBlur(fine[None, :], (0, 0), 4, borderType=cv2.BORDER_REPLICATE)[0]
        light = np.interp(at[axis], (np.arange(len(fine)) + 0.5) / 8 - 0.5, soft)
        grey = 10 + 190 * (texture * (0.05 + light) / 1.05) ** 0.8 + rng.normal(0, 1.5, SHAPE)
        images.append(np.clip(np.rint(grey), 0, 255).astype(np.uint8))
    return images


@pytest.mark.parametrize(("zoom", "code"), [(0.95, 0), (0.6, 2)])
def test_frames_of_a_part_of_the_field_are_not_ordered_by_chance(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], zoom: float, code: int
) -> None:
    """Of 6 cells that are seen of 8, another order shows the same images two cells farther; of all cells, none does."""
    devices = [DeviceSpec(*size, (0.01, 0.01), 12.0) for size in (SHAPE[::-1], SIZE)]
    create_project(tmp_path / "p", "p", *devices, {})
    patterns = list(parse_sequence("gray-inverse").patterns(SIZE))
    shuffled = np.random.default_rng(4).permutation(len(patterns))
    (tmp_path / "in").mkdir()
    for k, image in zip(shuffled, photographed(patterns, zoom, 4), strict=True):
        cv2.imwrite(str(tmp_path / f"in/{k:03d}.png"), image)
    words = ["import-frames", str(tmp_path / "in"), str(tmp_path / "p"), "a", "--role", "object"]
    assert main([*words, "--sequence", "gray-inverse", "--order", "content"]) == code
    assert (tmp_path / "p/captures/a").exists() == (not code)
    assert ("no order of the images is sure" in capsys.readouterr().err) == bool(code)
