"""The latency of a screen against the one that was put in, and a screen without the desktop program's window."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from core.capture.latency import Latency, measure_latency
from core.cli import main
from core.devices import CAMERA_KINDS, DeviceKind, offer_screens, open_projector
from core.devices.protocol import Image
from core.devices.scene import FlatScene
from core.devices.screen import ScreenProjector, ServedSurface
from core.devices.virtual import Stage, VirtualCamera
from core.errors import DeviceError
from core.model import DeviceSpec
from core.patterns import Black, Level, White
from core.project import write_project

EXPOSURE_S = 0.008


class Clock:
    """Time that passes only while somebody sleeps."""

    def __init__(self) -> None:
        self.now = 100.0

    def sleep(self, seconds: float) -> None:
        self.now += seconds

    def __call__(self) -> float:
        return self.now


class LateScreen:
    """A surface whose light follows by a latency with jitter, seen on a stage; only whole fields are shown."""

    size = (64, 64)

    def __init__(self, latency_s: float, jitter_s: float, seed: int) -> None:
        self.stage, self.rng = Stage(FlatScene()), np.random.default_rng(seed)
        self.latency_s, self.jitter_s, self.last = latency_s, jitter_s, 1000

    def present(self, image: np.ndarray) -> None:
        self.last -= 1
        if self.last < 0:
            return
        delay = max(self.rng.normal(self.latency_s, self.jitter_s), 0.0)
        self.stage.switch(White() if image.mean() > 127 else Black(), delay)

    def close(self) -> None:
        """Nothing to take away."""


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(time, "monotonic", made)
    monkeypatch.setattr(time, "sleep", made.sleep)
    return made


def measured(latency_s: float, jitter_s: float, seed: int, flashes: int) -> Latency:
    surface = LateScreen(latency_s, jitter_s, seed)
    camera = VirtualCamera(surface.stage, EXPOSURE_S)
    return measure_latency(ScreenProjector(surface), camera, flashes)


@pytest.mark.parametrize(("latency_ms", "jitter_ms"), [(25.0, 0.0), (48.0, 3.0), (90.0, 8.0)])
def test_the_latency_found_is_the_one_put_in(clock: Clock, latency_ms: float, jitter_ms: float) -> None:
    runs = [measured(latency_ms / 1000, jitter_ms / 1000, seed, 20) for seed in range(12)]
    off = np.array([(run.mean_s - latency_ms / 1000) / run.sigma_s for run in runs])
    assert np.abs(off.mean()) < 4 / np.sqrt(len(runs))  # unbiased: four sigma of the mean of the runs
    assert np.sqrt(np.mean(off**2)) < 1.6  # its sigma is large enough: chi of 12, one in a thousand
    # ... and not much too large: the images' share of it, 8 ms / sqrt(12), comes evenly and so less than at random
    assert np.sqrt(np.mean(off**2)) > 0.5 or jitter_ms < 8 / np.sqrt(12)
    jitter = np.sqrt(np.mean([run.jitter_s**2 for run in runs]))
    # the squared spread of 240 flashes is known to (jitter² + image²/12) / 11, one sigma
    room = 4 * (jitter_ms**2 + 64 / 12) / np.sqrt(120)
    assert abs(1e6 * jitter**2 - jitter_ms**2) < room
    assert all(run.enough_s >= run.most_s >= run.mean_s for run in runs)


def test_a_screen_that_the_camera_does_not_see_is_told(clock: Clock) -> None:
    with pytest.raises(DeviceError, match="hardly changes"):
        measure_latency(ScreenProjector(LateScreen(0.0, 0.0, 0)), VirtualCamera(Stage(FlatScene())))
    surface = LateScreen(0.02, 0.0, 0)
    surface.last = 6  # then the cable is pulled
    with pytest.raises(DeviceError, match="flash was not seen within 2 s"):
        measure_latency(ScreenProjector(surface), VirtualCamera(surface.stage, EXPOSURE_S))


# ------------------------------------------------------------------------------------ a window of its own program


@pytest.fixture(autouse=True)
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("QT_QPA_PLATFORM", "offscreen")


@pytest.fixture
def xvfb(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A virtual screen of 128 x 96; the file that holds what it shows."""
    if shutil.which("Xvfb") is None:
        pytest.skip("needs Xvfb")
    reading, writing = os.pipe()
    command = ["Xvfb", "-displayfd", str(writing), "-screen", "0", "128x96x24", "-fbdir", str(tmp_path), "-ac"]
    server = subprocess.Popen([*command, "-nolisten", "tcp"], pass_fds=[writing], stderr=subprocess.DEVNULL)
    try:
        os.close(writing)
        with os.fdopen(reading) as pipe:
            monkeypatch.setenv("DISPLAY", f":{pipe.readline().strip()}")
        monkeypatch.setenv("QT_QPA_PLATFORM", "xcb")
        yield tmp_path / "Xvfb_screen0"
    finally:
        server.terminate()
        server.wait()


class ScreenCamera:
    """Sees what is really on the virtual screen, with some ambient light and noise."""

    name, bits, size = "camera before the screen", 8, (128, 96)

    def __init__(self, picture: Path) -> None:
        self.picture, self.rng = picture, np.random.default_rng(1)

    def grab(self, timeout_s: float = 5.0, check: object = None) -> Image:
        begun = time.monotonic()
        raw = np.frombuffer(self.picture.read_bytes()[-4 * 128 * 96 :], np.uint8).reshape(96, 128, 4)[..., 0]
        light = 12 + 0.7 * raw + self.rng.normal(0, 0.7, raw.shape)
        return Image(np.rint(light).clip(0, 255).astype(np.uint8), 8, begun)

    def close(self) -> None:
        """Nothing to let go."""


def test_a_screen_is_captured_from_the_command_line(
    xvfb: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Patterns of a screen that the camera sees pixel for pixel: every frame is checked against its own pixels."""
    kind = DeviceKind("seen:FILE", lambda address, note, check: ScreenCamera(Path(address.place)))
    monkeypatch.setitem(CAMERA_KINDS, "seen", kind)
    project = tmp_path / "project"
    project.mkdir()
    write_project(project, "s", *(DeviceSpec(128, 96, (0.01, 0.01), 12.0) for _ in range(2)))
    devices = ["--projector", "screen:0", "--camera", f"seen:{xvfb}"]
    assert main(["capture", str(project), "a", "--role", "object", *devices]) == 0
    told = [json.loads(line) for line in (project / "captures/a/transcript.jsonl").read_text().splitlines()]
    assert [e for e in told if e["event"] == "device" and "the light follows" in e["what"]]
    assert main(["probe", "screen:0", "--camera", f"seen:{xvfb}", "--json", str(tmp_path / "p.json")]) == 0
    latency, linearity = json.loads((tmp_path / "p.json").read_text())["findings"]
    assert latency["figures"]["latency_ms"] < latency["figures"]["settle_ms"]
    assert linearity["figures"]["exponent"] == pytest.approx(1.0, abs=0.02)
    offer_screens(None)
    projector = open_projector("screen:0?gamma=2.2&settle_ms=0")
    projector.show(Level(0.5))
    time.sleep(0.1)
    middle = np.frombuffer(xvfb.read_bytes()[-4 * 128 * 96 :], np.uint8)[0]
    projector.close()
    assert middle == round(255 * 0.5 ** (1 / 2.2))


@pytest.mark.parametrize(
    ("program", "seen"),
    [
        ([], "no such screen"),
        (["false"], "did not answer"),
        (["python3", "-c", "import no_such_package"], "packages are missing"),
    ],
)
def test_a_window_that_does_not_come_says_why(program: list[str], seen: str) -> None:
    with pytest.raises(DeviceError, match=seen):
        ServedSurface(7, program)


def test_a_window_that_dies_is_told_and_can_be_closed() -> None:
    surface = ServedSurface(0)
    surface._program.kill()
    with pytest.raises(DeviceError, match="no window to show patterns in"):
        surface.present(np.zeros((800, 800), np.uint8))
    surface.close()
    surface.close()
    with pytest.raises(DeviceError, match="closed"):
        surface.present(np.zeros((800, 800), np.uint8))
