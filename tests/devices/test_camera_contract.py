"""What every camera promises, held against each of them alike."""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from core.devices import Camera, open_camera, open_projector
from core.errors import DeviceError
from core.patterns import Black, White
from core.project import write_image


@dataclass
class Bed:
    """A camera on the test bed; `bright` sets the light it sees, `stop` keeps images from coming."""

    camera: Camera
    bright: Callable[[bool], None]
    stop: Callable[[], None]


def virtual(tmp_path: Path) -> Iterator[Bed]:
    projector, camera = open_projector("virtual:flat"), open_camera("virtual:flat")

    def stop() -> None:
        camera.faults.rates = {"no-frame": 1.0}

    yield Bed(camera, lambda on: projector.show(White() if on else Black()), stop)
    camera.close()
    projector.close()


def folder(tmp_path: Path) -> Iterator[Bed]:
    """Another program writes a file every 20 ms, slowly and not atomically."""
    state = {"level": 0, "run": True, "end": False}
    write_image(tmp_path / "old.png", np.full((6, 8), 99, np.uint8))

    def work() -> None:
        number = 0
        while not state["end"]:
            if state["run"]:
                write_image(tmp_path / "whole.tmp.png", np.full((6, 8), state["level"], np.uint8), durable=False)
                data = (tmp_path / "whole.tmp.png").read_bytes()
                (tmp_path / "whole.tmp.png").unlink()
                with (tmp_path / f"image{number:04d}.png").open("wb") as file:
                    file.write(data[:40])
                    file.flush()
                    time.sleep(0.01)
                    file.write(data[40:])
                number += 1
            time.sleep(0.02)

    thread = threading.Thread(target=work)
    thread.start()
    try:
        yield Bed(
            open_camera(f"folder:{tmp_path}"),
            lambda on: state.update(level=200 if on else 20),
            lambda: state.update(run=False),
        )
    finally:
        state["end"] = True
        thread.join()


BEDS = {"virtual": virtual, "folder": folder}


@pytest.fixture(params=BEDS)
def bed(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Bed]:
    yield from BEDS[request.param](tmp_path)


def test_an_image_is_grey_of_the_size_and_depth_told(bed: Bed) -> None:
    image = bed.camera.grab()
    assert image.pixels.ndim == 2
    assert image.pixels.dtype in (np.uint8, np.uint16)
    assert bed.camera.size == (image.pixels.shape[1], image.pixels.shape[0])
    assert image.bits == bed.camera.bits
    assert image.pixels.max() <= image.full


def test_time_stamps_lie_between_call_and_return_and_grow(bed: Bed) -> None:
    before = time.monotonic()
    first, second = bed.camera.grab(), bed.camera.grab()
    assert before <= first.time_s < second.time_s <= time.monotonic()


def test_no_image_is_older_than_the_call(bed: Bed) -> None:
    for on in (True, False, True, True, False):
        bed.bright(on)
        time.sleep(0.06)  # what the program of the folder camera has begun to write is over
        assert (bed.camera.grab().pixels.mean() > 60) == on


def test_a_camera_that_delivers_nothing_says_so_within_the_time_given(bed: Bed) -> None:
    bed.stop()
    time.sleep(0.1)
    start = time.monotonic()
    with pytest.raises(DeviceError, match=r"no (new )?image within"):
        bed.camera.grab(timeout_s=0.2)
    assert time.monotonic() - start < 2.0


def test_closes_twice(bed: Bed) -> None:
    bed.camera.close()
    bed.camera.close()
