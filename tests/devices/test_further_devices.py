"""Second screen, OpenCV and GenICam cameras: what the contract suites do not ask."""

import time
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from core.devices import offer_screens, open_camera, open_projector
from core.devices.genicam import GenicamCamera
from core.devices.screen import ScreenProjector, screen_image
from core.devices.uvc import UvcCamera
from core.errors import DeviceError, InputError
from core.patterns import Code, Phase, White
from tests.devices.video import Video


def test_a_video_device_that_cannot_be_opened_is_told_and_released() -> None:
    video = Video(opens=False)
    with pytest.raises(DeviceError, match="cannot be opened"):
        UvcCamera(0, capture=lambda n: video)
    assert video.released


@pytest.mark.parametrize(
    ("key", "option", "seen"),
    [
        (cv2.CAP_PROP_EXPOSURE, {"exposure": 150.0}, "exposure 150 was wanted and 7 is set"),
        (cv2.CAP_PROP_GAIN, {"gain": 3.0}, "gain 3 was wanted and 7 is set"),
        (cv2.CAP_PROP_FRAME_WIDTH, {"width": 640}, "width 640 was wanted and 7 is set"),
        (cv2.CAP_PROP_FOURCC, {"fourcc": "GREY"}, "format 'GREY' was wanted"),
    ],
)
def test_a_setting_that_the_camera_does_not_take_is_named(key: int, option: dict, seen: str) -> None:
    video = Video(sticky={key: 7.0})
    with pytest.raises(DeviceError, match=seen):
        UvcCamera(0, capture=lambda n: video, **option)
    assert video.released


def test_automatic_exposure_is_off_when_an_exposure_is_asked_for() -> None:
    video = Video()
    camera = UvcCamera(0, capture=lambda n: video, exposure=150.0)
    assert video.settings[cv2.CAP_PROP_AUTO_EXPOSURE] in (1.0, 0.25)
    assert video.settings[cv2.CAP_PROP_EXPOSURE] == 150.0
    camera.close()


def test_a_video_device_that_dies_is_an_error_within_the_time() -> None:
    video = Video()
    camera = UvcCamera(0, capture=lambda n: video)
    video.run = False
    start = time.monotonic()
    with pytest.raises(DeviceError, match="within"):
        camera.grab(timeout_s=0.3)
    assert time.monotonic() - start < 1.0
    camera.close()


class Node(SimpleNamespace):
    """A GenICam node that takes what it is given, or keeps its value."""


class FakeProducer:
    """The part of a Harvester that is used: one camera, software trigger or free running."""

    def __init__(self, trigger: bool = True, **nodes: Node) -> None:
        self.light, self.calls, self.dead, self.due = 10, [], False, 0
        self.device_info_list = [SimpleNamespace(serial_number="A1")]
        table = {
            "Width": Node(value=8),
            "Height": Node(value=6),
            "PixelFormat": Node(value="Mono8"),
            "ExposureTime": Node(value=1000.0),
            "ExposureAuto": Node(value="Continuous"),
        }
        if trigger:
            table |= {"TriggerMode": Node(value="Off"), "TriggerSource": Node(value="Line0")}
            table["TriggerSoftware"] = SimpleNamespace(execute=self.fire)
        self.nodes = SimpleNamespace(**{**table, **nodes})
        self.buffers: list[int] = [] if trigger else [77, 77, 77]
        self.trigger = trigger
        self.remote_device = SimpleNamespace(node_map=self.nodes)

    def add_file(self, path: str) -> None:
        self.calls.append(("add_file", path))

    def update(self) -> None:
        self.calls.append(("update",))

    def create(self, key: object) -> "FakeProducer":
        self.calls.append(("create", key))
        return self

    def start(self) -> None:
        self.calls.append(("start",))

    def stop(self) -> None:
        self.calls.append(("stop",))

    def destroy(self) -> None:
        self.calls.append(("destroy",))

    def reset(self) -> None:
        self.calls.append(("reset",))

    def fire(self) -> None:
        self.buffers.append(self.light)

    def fetch(self, timeout: float):
        from contextlib import contextmanager

        if self.dead:
            time.sleep(timeout)
            raise TimeoutError("no event")
        if not self.buffers and not self.trigger:
            time.sleep(0.01)
            self.buffers.append(self.light)
        level = self.buffers.pop(0)
        part = SimpleNamespace(data=np.full(48, level, np.uint8), width=8, height=6)

        @contextmanager
        def buffer():
            yield SimpleNamespace(payload=SimpleNamespace(components=[part]))

        return buffer()


def test_a_genicam_camera_is_set_triggered_and_let_go() -> None:
    producer = FakeProducer()
    camera = GenicamCamera("A1", "maker.cti", exposure_us=2500.0, pixel_format="Mono12", harvester=producer)
    assert producer.nodes.ExposureAuto.value == "Off"
    assert producer.nodes.ExposureTime.value == 2500.0
    assert (producer.nodes.TriggerMode.value, producer.nodes.TriggerSource.value) == ("On", "Software")
    assert camera.bits == 12
    camera.close()
    names = [call[0] for call in producer.calls]
    assert names == ["add_file", "update", "create", "start", "stop", "destroy", "reset"]


def test_a_freely_running_genicam_camera_gives_nothing_from_its_buffers() -> None:
    camera = GenicamCamera("0", harvester=FakeProducer(trigger=False))
    assert camera.grab().pixels.mean() == 10
    camera.close()


@pytest.mark.parametrize(
    ("place", "options", "nodes", "seen"),
    [
        ("B2", {}, {}, "not among the 1 cameras"),
        ("A1", {}, {"PixelFormat": Node(value="BayerRG8")}, "pixel format is BayerRG8"),
        ("A1", {"gain": 2.0}, {}, "does not take Gain"),
    ],
)
def test_a_genicam_camera_that_does_not_fit_is_told(place: str, options: dict, nodes: dict, seen: str) -> None:
    producer = FakeProducer(**nodes)
    with pytest.raises(DeviceError, match=seen):
        GenicamCamera(place, harvester=producer, **options)
    assert ("reset",) in producer.calls


def test_a_missing_package_says_what_to_install() -> None:
    with pytest.raises(DeviceError, match="pip install harvesters"):
        open_camera("genicam:0")


@pytest.mark.parametrize("url", ["uvc:front", "genicam:", "uvc:0?exposure=long"])
def test_a_camera_url_is_checked_before_the_camera_is_looked_for(url: str) -> None:
    with pytest.raises(InputError):
        open_camera(url)


def test_screen_images_are_the_patterns_pixel_for_pixel() -> None:
    image = screen_image(Code("gray", "y", 1, 3, 2), 5, 16)
    # Gray bit 1 of numbers 0 to 7: 0 0 1 1 1 1 0 0, two rows each
    assert image[:, 0].tolist() == [0] * 4 + [255] * 8 + [0] * 4
    assert (image == image[:, :1]).all()


def test_a_screen_with_gamma_shows_light_that_is_linear() -> None:
    image = screen_image(Phase("x", 64.0, 4, 0, 0.0), 64, 1, gamma=2.2)[0] / 255
    wanted = 0.5 + 0.5 * np.cos(2 * np.pi * (np.arange(64) + 0.5) / 64)
    # one step of 255 is 2.2 / 255 of light at most
    assert np.abs(image**2.2 - wanted).max() < 2.2 / 255


def test_a_screen_whose_resolution_changes_is_told() -> None:
    surface = SimpleNamespace(size=(64, 48), present=lambda image: None, close=lambda: None)
    projector = ScreenProjector(surface)
    projector.show(White())
    surface.size = (128, 96)
    with pytest.raises(DeviceError, match="128x96 px, it had 64x48"):
        projector.show(White())


def test_without_a_window_a_screen_says_where_to_start() -> None:
    with pytest.raises(DeviceError, match="desktop program"):
        open_projector("screen:1")


def test_a_program_with_windows_offers_its_screens() -> None:
    surface = SimpleNamespace(size=(64, 48), present=lambda image: None, close=lambda: None)
    offer_screens(lambda number: surface)
    try:
        assert open_projector("screen:1?gamma=2.2").size == (64, 48)
    finally:
        offer_screens(None)
