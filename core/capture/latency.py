"""How long after a pattern was shown the camera sees it: the way through window, graphics, cable and projector."""

from __future__ import annotations

import time

import numpy as np

from core.capture.preflight import linearity
from core.devices import Camera, Check, Projector, no_check, open_devices, wait_until
from core.errors import DeviceError
from core.lazy import dataclass
from core.model.finding import Finding
from core.patterns import Black, Pattern, White
from core.progress import SILENT, Progress

STEADY = 0.05  # of the step between black and white
REST_S = 0.3  # for the light to be certainly steady
LONGEST_S = 2.0
GOLDEN = (5**0.5 - 1) / 2  # its multiples fill an interval evenly


@dataclass(frozen=True)
class Latency:
    """When an image begun after `show` has returned sees the new light alone, over some flashes; in s.

    Every flash gives a last image too early and a first one late enough; the mean is that of the middles, and the
    distance of the images is taken out of their spread.
    """

    mean_s: float
    jitter_s: float  # standard deviation between flashes
    sigma_s: float  # of the mean
    most_s: float  # the latest that was certainly enough
    between_s: float  # two images, r.m.s.

    @property
    def enough_s(self) -> float:
        """What to wait, with room for three standard deviations."""
        return max(self.most_s, self.mean_s + 3 * self.jitter_s)

    @property
    def finding(self) -> Finding:
        """In words."""
        mean, jitter, sigma, enough, between = (
            1000 * s for s in (self.mean_s, self.jitter_s, self.sigma_s, self.enough_s, self.between_s)
        )
        figures = {"latency_ms": mean, "sigma_ms": sigma, "jitter_ms": jitter, "settle_ms": enough, "image_ms": between}
        text = (
            f"the light follows {mean:.1f} ± {sigma:.1f} ms after a pattern is shown, with a jitter of {jitter:.1f} ms"
        )
        return Finding("latency", "good", f"{text}: settle_ms={np.ceil(enough):.0f} is enough", figures)


def probe_light(projector_url: str, camera_url: str, progress: Progress = SILENT) -> tuple[Finding, ...]:
    """Measure the latency of a projector, and by a ramp of its levels whether anything bends them on their way.

    Nothing checks the images of the ramp, so they wait until the light is certainly steady.
    """
    with open_devices(projector_url, camera_url, check=progress.check) as (projector, camera):
        latency = measure_latency(projector, camera, check=progress.check)
        return latency.finding, linearity(projector, camera, max(latency.enough_s, REST_S), progress.check)


def measure_latency(projector: Projector, camera: Camera, flashes: int = 20, check: Check = no_check) -> Latency:
    """Flash white and black in turn, and take images until they show it; DeviceError if the camera does not see it."""

    def level(pattern: Pattern) -> float:
        projector.show(pattern, check)
        wait_until(time.monotonic() + REST_S, check)
        return float(camera.grab(check=check).pixels.mean(dtype=np.float64))

    lights: dict[Pattern, float] = {pattern: level(pattern) for pattern in (Black(), White())}
    begun = time.monotonic()
    level(White())
    image_s = max(time.monotonic() - begun - REST_S, 0.001)
    step = lights[White()] - lights[Black()]
    if step < 0.01 * (1 << camera.bits):
        raise DeviceError(
            projector.name,
            "between white and black the image hardly changes",
            "look whether its light reaches the camera, and set the exposure",
        )
    spans = []
    for flash in range(flashes):
        pattern: Pattern = White() if flash % 2 else Black()
        projector.show(pattern, check)
        shown = time.monotonic()
        wait_until(shown + image_s * (flash * GOLDEN % 1), check)  # images at all times after flashes, evenly
        before, after = 0.0, LONGEST_S
        while time.monotonic() < shown + LONGEST_S:
            image = camera.grab(check=check)
            if abs(float(image.pixels.mean(dtype=np.float64)) - lights[pattern]) <= STEADY * step:
                after = image.time_s - shown
                break
            before = image.time_s - shown
        else:
            raise DeviceError(
                camera.name, f"a flash was not seen within {LONGEST_S:g} s", "switch automatic exposure off"
            )
        spans.append((max(before, 0.0), max(after, 0.0)))
        wait_until(shown + after + 0.5 * REST_S, check)
    early, late = np.array(spans).T
    middle, between = (early + late) / 2, float(np.sqrt(np.mean((late - early) ** 2)))
    spread = float(np.var(middle, ddof=1))
    jitter = float(np.sqrt(max(spread - between**2 / 12, 0.0)))
    sigma = float(np.sqrt(spread / flashes))
    return Latency(float(middle.mean()), jitter, sigma, float(late.max()), between)
