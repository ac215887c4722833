"""A whole sequence by the projector's own clock: it triggers the camera at every pattern, and nobody waits between.

Every image has the time of its exposure, and a frame number where the camera counts. Images that are not one for each
pattern, a period apart, are refused together; what they show is checked afterwards like every capture.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from core.devices import Armed, Camera, Image, Projector, SelfRunning
from core.devices.protocol import Check, no_check
from core.errors import DeviceError

OFF = 0.25  # of a period that an exposure may be away from its pattern's


def runs_by_itself(projector: Projector, cameras: Sequence[Camera]) -> bool:
    """Whether a projector and cameras can take a sequence by the projector's clock."""
    if not isinstance(projector, SelfRunning) or projector.period_s <= 0:
        return False
    return all(isinstance(camera, Armed) and camera.can_arm for camera in cameras)


def take_sequence(
    projector: Projector, cameras: Sequence[Camera], count: int, check: Check = no_check
) -> list[list[Image]]:
    """Take the `count` patterns that are loaded; give every camera's images in this order.

    Raises
    ------
    DeviceError
        If the images are not one for each pattern.
    """
    assert isinstance(projector, SelfRunning)  # as `runs_by_itself` says
    armed = [camera for camera in cameras if isinstance(camera, Armed)]
    for camera in armed:
        camera.arm(count)
    projector.run(check)
    wait_s = 2.0 + 2 * count * projector.period_s
    return [matched(c.collect(count, wait_s, check), count, projector.period_s, c.name) for c in armed]


def matched(images: Sequence[Image], count: int, period_s: float, where: str) -> list[Image]:
    """See that images are those of `count` triggers, a period apart.

    Raises
    ------
    DeviceError
        Naming the first that is missing, came twice or at another time.
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
