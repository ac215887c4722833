"""What every camera promises, held against each of them alike."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from core.devices import Adjustable, Camera, open_camera, open_projector
from core.devices.genicam import GenicamCamera
from core.devices.uvc import UvcCamera
from core.errors import Cancelled, DeviceError
from core.patterns import Black, White
from core.project import write_image
from tests.devices.producer import Node, Producer
from tests.devices.video import Video


@dataclass
class Bed:
    """A camera on the test bed; `bright` sets the light it sees, `stop` keeps images from coming."""

    camera: Camera
    bright: Callable[[bool], None]
    stop: Callable[[], None]
    between: float = 60.0  # the mean grey values of bright and dark images
    exposes: bool = True


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


def uvc(tmp_path: Path) -> Iterator[Bed]:
    video = Video()
    camera = UvcCamera(0, capture=lambda number: video)
    yield Bed(
        camera,
        lambda on: setattr(video, "level", 200 if on else 20),
        lambda: setattr(video, "run", False),
    )
    camera.close()


def genicam(tmp_path: Path) -> Iterator[Bed]:
    producer = Producer(PixelFormat=Node(value="Mono12"))
    camera = GenicamCamera("A1", harvester=producer)
    yield Bed(
        camera,
        lambda on: setattr(producer, "light", 3000 if on else 30),
        lambda: setattr(producer, "dead", True),
    )
    camera.close()


def simulator(tmp_path: Path) -> Iterator[Bed]:
    """The camera of the package genicam: a black ball on white, 20 images a second."""
    package = pytest.importorskip("genicam")
    pytest.importorskip("harvesters")
    producer = Path(package.__file__).parent / "viky.cti"
    camera = open_camera(f"genicam:0?producer={producer}&format=Mono8")
    ball = camera._nodes.BouncingBallSize
    yield Bed(camera, lambda on: setattr(ball, "value", 1 if on else 40), camera._acquirer.stop, 254.0, False)
    camera.close()


BEDS = {"virtual": virtual, "folder": folder, "uvc": uvc, "genicam": genicam, "simulator of genicam": simulator}


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


def test_no_image_is_older_than_the_call_though_one_was_not_waited_for(bed: Bed) -> None:
    for on in (True, False, True, True, False):
        with suppress(DeviceError):
            bed.camera.grab(timeout_s=0.002)
        bed.bright(on)
        time.sleep(0.06)  # what the program of the folder camera has begun to write is over
        assert (bed.camera.grab().pixels.mean() > bed.between) == on


def test_a_camera_that_delivers_nothing_says_so_within_the_time_given(bed: Bed) -> None:
    bed.stop()
    time.sleep(0.1)
    start = time.monotonic()
    with pytest.raises(DeviceError, match=r"no (new )?image within"):
        bed.camera.grab(timeout_s=0.2)
    assert time.monotonic() - start < 2.0


def test_waiting_for_an_image_is_cancelled_within_half_a_second(bed: Bed) -> None:
    bed.stop()
    time.sleep(0.1)
    start = time.monotonic()

    def check() -> None:
        if time.monotonic() - start > 0.2:
            raise Cancelled

    with pytest.raises((Cancelled, DeviceError)) as told:  # the virtual camera says at once that nothing comes
        bed.camera.grab(30.0, check)
    assert time.monotonic() - start < 0.7
    assert told.type is Cancelled or time.monotonic() - start < 0.2


def test_the_exposure_can_be_set_while_it_is_open_or_is_not_offered(bed: Bed) -> None:
    if not isinstance(bed.camera, Adjustable):
        assert "folder" in bed.camera.name  # its own program sets the exposure
        return
    before = bed.camera.setting
    if not bed.exposes:
        with pytest.raises(DeviceError, match="does not take ExposureTime"):
            bed.camera.adjust(5000.0)
        return
    assert before.what in ("exposure", "gain")
    after = bed.camera.adjust(2.0 * max(before.value, 1.0))
    assert after.value == pytest.approx(2.0 * max(before.value, 1.0), rel=0.02)
    assert after.option == before.option


def test_closes_twice(bed: Bed) -> None:
    bed.camera.close()
    bed.camera.close()


def test_images_of_a_sequence_wait_in_buffers_while_the_host_is_busy() -> None:
    """By a producer's own buffers, of which there are three where nobody asks for more."""
    package = pytest.importorskip("genicam")
    pytest.importorskip("harvesters")
    camera = open_camera(f"genicam:0?producer={Path(package.__file__).parent / 'viky.cti'}&format=Mono8")
    with closing(camera):
        camera._switch({}, 20)
        time.sleep(0.8)  # 16 images
        numbers = [camera._fetch(1.0).number for _ in range(12)]
    assert numbers == list(range(numbers[0], numbers[0] + 12))
