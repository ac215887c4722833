"""What every projector promises, held against each of them alike."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from core.devices import Projector, offer_screens, open_camera, open_projector
from core.errors import Cancelled, DeviceError, PatternRefusedError
from core.patterns import Black, Line, Phase, White, pattern_image, reference_sequence


@dataclass
class Bed:
    """A projector on the test bed and a way to see what it shows: lines that are lit, (H, W) of bool."""

    projector: Projector
    light: Callable[[], np.ndarray]


def lit_by(url: str) -> Iterator[Bed]:
    projector, camera = open_projector(url), open_camera("virtual:flat")
    maps = camera.stage.scene.maps
    columns, rows = projector.size

    def light() -> np.ndarray:
        image = camera.grab().pixels / maps[2]
        lit = np.zeros((rows, columns), bool)
        seen = np.zeros((rows, columns), bool)
        u, v = np.rint(maps[0]).astype(int), np.rint(maps[1]).astype(int)
        near = (abs(maps[0] - u) < 0.3) & (abs(maps[1] - v) < 0.3)
        lit[v[near], u[near]] = image[near] > 15 + 75
        seen[v[near], u[near]] = True
        return np.where(seen, lit, -1)

    yield Bed(projector, light)
    projector.close()


class Window:
    """A surface that remembers what it was given."""

    size = (64, 64)

    def __init__(self) -> None:
        self.image = np.zeros((64, 64), np.uint8)

    def present(self, image: np.ndarray) -> None:
        assert image.shape == self.image.shape
        self.image = image.copy()

    def close(self) -> None:
        self.image = np.zeros((64, 64), np.uint8)


def screen() -> Iterator[Bed]:
    window = Window()
    offer_screens(lambda number: window)
    projector = open_projector("screen:1?settle_ms=0")
    yield Bed(projector, lambda: (window.image > 127).astype(int))
    projector.close()
    offer_screens(None)


BEDS = {
    "virtual": "virtual:flat",
    "text lines on a pseudo-terminal": "emulated:flat?profile=stripe-lines&settle_ms=1",
    "screen": "screen:1",
    "binary frames on a socket": "emulated:flat?profile=stripe-frames&settle_ms=1&line=socket",
}


@pytest.fixture(params=BEDS)
def bed(request: pytest.FixtureRequest) -> Iterator[Bed]:
    yield from screen() if request.param == "screen" else lit_by(BEDS[request.param])


def shows(bed: Bed, pattern: object) -> bool:
    time.sleep(bed.projector.settle_s)
    seen, wanted = bed.light(), pattern_image(pattern, *bed.projector.size) > 0.5
    return bool(np.all((seen == wanted)[seen >= 0]))


def test_shows_every_pattern_of_the_reference_sequence(bed: Bed) -> None:
    for pattern in reference_sequence(*bed.projector.size):
        bed.projector.show(pattern)
        assert shows(bed, pattern)


def test_steps_through_a_loaded_sequence_in_any_order(bed: Bed) -> None:
    patterns = [White(), Line("x", 20, 8), Black(), Line("y", 9, 4)]
    bed.projector.load(patterns)
    for index in (0, 1, 2, 3, 0, 3, 1, 1):
        bed.projector.step(index)
        assert shows(bed, patterns[index])


def test_loading_replaces_the_sequence_before(bed: Bed) -> None:
    bed.projector.load([White(), Black()])
    bed.projector.load([Line("x", 20, 8)])
    bed.projector.step(0)
    assert shows(bed, Line("x", 20, 8))
    with pytest.raises(DeviceError):
        bed.projector.step(1)


def test_loading_can_be_cancelled(bed: Bed) -> None:
    def cancelled() -> None:
        raise Cancelled

    with pytest.raises(Cancelled):
        bed.projector.load([White(), Black()], cancelled)
    bed.projector.show(White())
    assert shows(bed, White())


def test_refuses_in_words_what_it_cannot_show(bed: Bed) -> None:
    grey = Phase("x", 16.0, 4, 0, 0.0, "sine")
    reason = bed.projector.refusal(grey)
    if reason is None:
        bed.projector.show(grey)
    else:
        with pytest.raises(PatternRefusedError, match="sine"):
            bed.projector.show(grey)


def test_loads_as_many_patterns_as_it_says_and_no_more(bed: Bed) -> None:
    with pytest.raises(DeviceError, match="at most"):
        bed.projector.load([White()] * (bed.projector.capacity + 1))


def test_closes_twice_and_is_used_no_more(bed: Bed) -> None:
    bed.projector.close()
    bed.projector.close()
    with pytest.raises(DeviceError, match="closed"):
        bed.projector.show(White())
