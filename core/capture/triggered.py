"""A whole sequence by one device's clock, whose triggers the other follows, and nobody waits between.

Either the projector triggers the cameras at every pattern, or a camera triggers the projector, and other cameras, at
every image. Images have the times of their exposures, and frame numbers where the camera counts. Those that are not
one for each pattern, a period apart, are refused together: so triggers are found that a camera has missed. Those that
the projector has missed are found by the content alone, which is checked afterwards as in every capture.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from core.devices import Armed, Camera, Following, Image, Leading, Projector, SelfRunning
from core.devices.protocol import Check, no_check
from core.errors import DeviceError

OFF = 0.25  # of a period that an exposure may be away from its pattern's


def period_of(projector: Projector, cameras: Sequence[Camera]) -> float:
    """Give the period in s by which a projector and cameras take a sequence together; 0: they cannot."""
    lead = _leader(projector, cameras)
    others = [camera for camera in cameras if camera is not lead]
    if not all(isinstance(camera, Armed) and camera.can_arm for camera in others):
        return 0.0
    if lead is not None:
        return lead.lead_period_s
    return projector.period_s if isinstance(projector, SelfRunning) else 0.0


def _leader(projector: Projector, cameras: Sequence[Camera]) -> Leading | None:
    """Give the camera whose clock counts; None where it is the projector's."""
    if not isinstance(projector, Following) or not projector.can_follow:
        return None
    return next((c for c in cameras if isinstance(c, Leading) and c.lead_period_s > 0), None)


def take_sequence(
    projector: Projector, cameras: Sequence[Camera], count: int, check: Check = no_check
) -> list[list[Image]]:
    """Take the `count` patterns that are loaded; give every camera's images in this order.

    DeviceError if the images are not one for each pattern.
    """
    lead, period_s = _leader(projector, cameras), period_of(projector, cameras)
    armed = [camera for camera in cameras if isinstance(camera, Armed)]
    for camera in armed:
        if camera is not lead:
            camera.arm(count)
    if lead is not None and isinstance(projector, Following):
        projector.follow(period_s, check)
        lead.lead(count)
    elif isinstance(projector, SelfRunning):
        projector.run(check)
    wait_s = 2.0 + 2 * count * period_s
    return [matched(camera.collect(count, wait_s, check), count, period_s, camera.name) for camera in armed]


def matched(images: Sequence[Image], count: int, period_s: float, where: str) -> list[Image]:
    """See that images are those of `count` triggers, a period apart.

    A DeviceError names the first that is missing, came twice or at another time.
    """
    remedy = "check the trigger's cable and level, and that the camera is ready again within the period"
    gaps = [(b.time_s - a.time_s) / period_s for a, b in pairwise(images)]
    for i, gap in enumerate(gaps, 1):
        if gap < 1 - OFF:
            raise DeviceError(
                where, f"image {i} came {gap:.2f} periods after the one before: a doubled trigger", remedy
            )
        if gap > 1 + OFF:
            kind = "a lost trigger" if abs(gap - round(gap)) < OFF else "a late trigger"
            raise DeviceError(where, f"image {i} came {gap:.2f} periods after the one before: {kind}", remedy)
    if len(images) != count:
        raise DeviceError(where, f"{len(images)} images for {count} patterns", remedy)
    drift = (images[-1].time_s - images[0].time_s) / period_s - (count - 1)
    if abs(drift) > 2 * OFF:
        raise DeviceError(
            where, f"the last image is {drift:+.2f} periods off", "give the period that the projector keeps"
        )
    numbers = [image.number for image in images if image.number is not None]
    if numbers and numbers != list(range(numbers[0], numbers[0] + count)):
        raise DeviceError(where, f"frame numbers {numbers[0]} to {numbers[-1]} with gaps", remedy)
    return list(images)
