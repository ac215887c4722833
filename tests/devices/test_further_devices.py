"""Second screen, OpenCV and GenICam cameras: what the contract suites do not ask."""

import sys
import threading
import time
from contextlib import AbstractContextManager
from pathlib import Path
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
from core.project import write_image
from tests.devices.producer import Node, Producer, Running, delivered
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


@pytest.mark.parametrize(
    ("key", "on", "what"),
    [
        (cv2.CAP_PROP_AUTO_EXPOSURE, 3.0, "exposure"),
        (cv2.CAP_PROP_AUTO_WB, 1.0, "white balance"),
        (cv2.CAP_PROP_AUTOFOCUS, 1.0, "focus"),
    ],
)
def test_what_is_automatic_is_switched_off_or_the_video_device_refused(key: int, on: float, what: str) -> None:
    video = Video()
    video.settings[key] = on
    UvcCamera(0, capture=lambda n: video).close()
    assert video.settings[key] not in (on, 0.75)
    video = Video(sticky={key: on})
    with pytest.raises(DeviceError, match=f"automatic {what} stays on"):
        UvcCamera(0, capture=lambda n: video)
    assert video.released


def test_a_video_device_that_dies_is_an_error_within_the_time() -> None:
    video = Video()
    camera = UvcCamera(0, capture=lambda n: video)
    video.run = False
    start = time.monotonic()
    with pytest.raises(DeviceError, match="within"):
        camera.grab(timeout_s=0.3)
    assert time.monotonic() - start < 1.0
    camera.close()


def test_a_genicam_camera_is_set_triggered_and_let_go() -> None:
    producer = Producer()
    camera = GenicamCamera("A1", "maker.cti", exposure_us=2500.0, pixel_format="Mono12", harvester=producer)
    assert producer.nodes.ExposureAuto.value == "Off"
    assert producer.nodes.ExposureTime.value == 2500.0
    assert (producer.nodes.TriggerMode.value, producer.nodes.TriggerSource.value) == ("On", "Software")
    assert camera.bits == 12
    camera.close()
    assert producer.calls == ["add_file", "update", "create", "start", "stop", "destroy", "reset"]


def test_a_freely_running_genicam_camera_gives_no_image_begun_before_the_call() -> None:
    producer = Running()
    camera = GenicamCamera("0", harvester=producer)
    for light in range(20, 60):
        time.sleep(0.0013 * (light % 40))  # from another place of a period each, at times with all buffers full
        producer.shine(light)
        assert camera.grab().pixels.mean() == light
    camera.close()


def test_a_freely_running_genicam_camera_on_a_busy_machine_gives_nothing_from_its_buffers() -> None:
    class Busy(Running):
        def fetch(self, timeout: float) -> AbstractContextManager:
            time.sleep(0.003)  # an image that waits in its buffer takes long to come too
            return super().fetch(timeout)

    producer = Busy()
    camera = GenicamCamera("0", harvester=producer)
    for light in (20, 30, 40):
        time.sleep(0.05)
        producer.shine(light)
        assert camera.grab().pixels.mean() == light
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
    producer = Producer(**nodes)
    with pytest.raises(DeviceError, match=seen):
        GenicamCamera(place, harvester=producer, **options)
    assert "reset" in producer.calls


def test_a_missing_package_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "harvesters.core", None)
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


def test_a_program_with_windows_offers_its_screens() -> None:
    surface = SimpleNamespace(size=(64, 48), present=lambda image: None, close=lambda: None)
    offer_screens(lambda number: surface)
    try:
        assert open_projector("screen:1?gamma=2.2").size == (64, 48)
    finally:
        offer_screens(None)


class Late(Producer):
    """A triggered camera whose images come when they are told to; frame numbers and time stamps if wanted."""

    def __init__(self, numbers: bool, stamps: bool, restarts: bool) -> None:
        super().__init__()
        self.numbers, self.stamps, self.restarts = numbers, stamps, restarts
        self.fired, self.due_s = 0, []
        self.lag_s = 0.0

    def start(self) -> None:
        self.calls.append("start")
        if self.restarts:
            self.due_s.clear()

    def fire(self) -> None:
        self.fired += 1
        now = time.monotonic()
        self.due_s.append((now + self.lag_s, self.fired, now, self.light))

    def fetch(self, timeout: float) -> AbstractContextManager:
        end = time.monotonic() + timeout
        while not self.due_s or self.due_s[0][0] > time.monotonic():
            if time.monotonic() > end:
                raise TimeoutError("no event")
            time.sleep(0.0005)
        _, number, exposed, level = self.due_s.pop(0)
        told: dict[str, object] = {}
        if self.numbers:
            told["module"] = SimpleNamespace(frame_id=number)
        if self.stamps:
            told["timestamp_ns"] = int(1e9 * (exposed + 1234.5))
        return delivered(level, **told)


@pytest.mark.parametrize("restarts", [True, False], ids=["stopping clears", "stopping clears nothing"])
@pytest.mark.parametrize(("numbers", "stamps"), [(False, False), (True, False), (True, True)])
@pytest.mark.parametrize("lag_s", [0.2, 0.5], ids=["before", "after the next trigger"])
def test_an_image_that_comes_late_is_no_other_triggers_image(
    numbers: bool, stamps: bool, restarts: bool, lag_s: float
) -> None:
    producer = Late(numbers, stamps, restarts)
    camera = GenicamCamera("A1", harvester=producer)
    for light in (10, 20):
        producer.light = light
        assert camera.grab().pixels.mean() == light
    producer.light, producer.lag_s = 30, lag_s
    with pytest.raises(DeviceError, match="no image within"):
        camera.grab(timeout_s=0.1)
    time.sleep(0.2)
    producer.lag_s = 0.05
    for light in (40, 50, 60):
        producer.light = light
        assert camera.grab(timeout_s=1.0).pixels.mean() == light
    assert producer.fired == 6
    camera.close()


def test_a_trigger_that_gives_two_images_shifts_nothing() -> None:
    told = []
    producer = Late(numbers=True, stamps=False, restarts=True)
    camera = GenicamCamera("A1", harvester=producer, note=lambda who, what: told.append(what))
    producer.light = 10
    camera.grab()
    producer.fire()  # a spike on the trigger's cable
    for light in (20, 30):
        producer.light = light
        assert camera.grab().pixels.mean() == light
    assert told == ["an image came that nobody waited for; it is thrown away"]
    camera.close()


def test_two_images_on_their_way_are_given_up_before_the_next_trigger() -> None:
    producer = Late(numbers=False, stamps=False, restarts=True)
    camera = GenicamCamera("A1", harvester=producer)
    camera.grab()
    for producer.light, producer.lag_s in ((20, 0.4), (30, 0.3)):
        with pytest.raises(DeviceError, match="no image within"):
            camera.grab(timeout_s=0.1)
    producer.lag_s = 0.4
    for producer.light in (40, 50):
        assert camera.grab(timeout_s=1.0).pixels.mean() == producer.light
    camera.close()


def test_what_is_automatic_is_off_and_gamma_is_one() -> None:
    producer = Producer(GainAuto=Node(value="Once"), Gamma=Node(value=0.7))
    GenicamCamera("A1", harvester=producer).close()
    assert (producer.nodes.ExposureAuto.value, producer.nodes.GainAuto.value) == ("Off", "Off")
    assert producer.nodes.Gamma.value == 1.0


class Stubborn:
    """A node that keeps its value."""

    def __init__(self, value: object) -> None:
        self.__dict__["value"] = value

    def __setattr__(self, name: str, value: object) -> None:
        """Take nothing."""


@pytest.mark.parametrize(("node", "value"), [("ExposureAuto", "Continuous"), ("Gamma", 0.45)])
def test_what_stays_automatic_or_bent_is_refused(node: str, value: object) -> None:
    with pytest.raises(DeviceError, match=f"{node} .* was wanted and {value} is set"):
        GenicamCamera("A1", harvester=Producer(**{node: Stubborn(value)}))


@pytest.mark.parametrize("lag_s", [0.0, 0.15])
def test_a_folder_camera_with_a_stated_latency_gives_nothing_older(tmp_path: Path, lag_s: float) -> None:
    state, end, due = {"level": 0}, threading.Event(), []

    def work() -> None:
        number = 0
        while not end.wait(0.02):
            due.append((time.monotonic() + lag_s, state["level"]))
            while due and due[0][0] <= time.monotonic():
                image = np.full((6, 8), due.pop(0)[1], np.uint8)
                write_image(tmp_path / f".{number}.png", image, durable=False)
                (tmp_path / f".{number}.png").rename(tmp_path / f"{number:04d}.png")
                number += 1

    thread = threading.Thread(target=work)
    thread.start()
    try:
        camera = open_camera(f"folder:{tmp_path}?latency_ms={1000 * lag_s + 30}")
        for level in (50, 100, 150):
            state["level"] = level
            assert camera.grab().pixels.mean() == level
    finally:
        end.set()
        thread.join()


def test_a_genicam_camera_takes_the_triggers_of_its_line() -> None:
    producer = Late(numbers=True, stamps=True, restarts=True)
    camera = GenicamCamera("A1", harvester=producer, line="Line1")
    camera.arm(3)
    assert producer.nodes.TriggerSource.value == "Line1"
    for light in (10, 20, 30):
        producer.light = light
        producer.fire()
        time.sleep(0.005)
    images = camera.collect(3, 1.0)
    assert [image.pixels.mean() for image in images] == [10, 20, 30]
    assert [image.number for image in images] == [1, 2, 3]
    assert np.all(np.diff([image.time_s for image in images]) >= 0.005)
    assert producer.nodes.TriggerSource.value == "Software"
    camera.close()


def test_a_genicam_camera_leads_by_its_own_clock_and_waits_for_calls_again() -> None:
    lines = {node: Node(value="") for node in ("LineSelector", "LineMode", "LineSource", "AcquisitionMode")}
    rates = {"AcquisitionFrameRate": Node(value=30.0), "AcquisitionFrameCount": Node(value=1)}
    producer = Late(numbers=True, stamps=True, restarts=True)
    producer.nodes.__dict__.update(lines | rates)
    camera = GenicamCamera("A1", harvester=producer, lead="Line2", lead_period_s=0.008)
    camera.lead(3)
    nodes = producer.nodes
    assert (nodes.LineSelector.value, nodes.LineMode.value, nodes.LineSource.value) == (
        "Line2",
        "Output",
        "ExposureActive",
    )
    assert (nodes.TriggerMode.value, nodes.AcquisitionMode.value) == ("Off", "MultiFrame")
    assert (nodes.AcquisitionFrameRate.value, nodes.AcquisitionFrameCount.value) == (125.0, 3)
    assert producer.calls[-2:] == ["stop", "start"]
    for light in (10, 20, 30):
        producer.light = light
        producer.fire()
    assert [image.pixels.mean() for image in camera.collect(3, 1.0)] == [10, 20, 30]
    assert (nodes.TriggerMode.value, nodes.AcquisitionMode.value) == ("On", "Continuous")
    producer.light = 40
    assert camera.grab().pixels.mean() == 40
    camera.close()


@pytest.mark.parametrize("options", ["lead=Line2", "period_ms=8"])
def test_a_leading_camera_needs_its_line_and_its_period(options: str) -> None:
    with pytest.raises(InputError, match="give both"):
        open_camera(f"genicam:0?{options}")
