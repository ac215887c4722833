"""Projectors and cameras, real and virtual, behind two small protocols.

protocol.py  what every projector and every camera promises
address.py   device URLs, taken apart with every check
opening.py   from a URL to a device
scene.py     what virtual devices look at
benchscene.py  ... of the virtual bench
virtual.py   a projector and a camera that share such a scene
line         projectors that are spoken to on a line, by a command profile; the other end of it, emulated
screen.py    any HDMI projector as a second screen
uvc.py       cameras that OpenCV opens
genicam.py   industrial cameras through the package harvesters
stored.py    images that are files: a replayed capture, a watched folder
faults.py    what virtual devices do wrong on demand, by name and rate

No device is needed to test any of this: one suite, tests/devices, holds every projector and camera to its promise.
"""

from core.devices.address import parse_address, with_option
from core.devices.faults import CAMERA_FAULTS, LINK_FAULTS, TRIGGER_FAULTS
from core.devices.opening import CAMERA_KINDS, PROJECTOR_KINDS, DeviceKind, open_camera, open_devices, open_projector
from core.devices.protocol import (
    Adjustable,
    Armed,
    Camera,
    Check,
    Following,
    Image,
    Leading,
    Projector,
    SelfRunning,
    Setting,
    no_check,
    wait_until,
)
from core.devices.screen import offer_screens

__all__ = [
    "CAMERA_FAULTS", "CAMERA_KINDS", "LINK_FAULTS", "PROJECTOR_KINDS", "TRIGGER_FAULTS", "Adjustable", "Armed",
    "Camera", "Check", "DeviceKind", "Following", "Image", "Leading", "Projector", "SelfRunning", "Setting", "no_check",
    "offer_screens", "open_camera", "open_devices", "open_projector", "parse_address", "wait_until", "with_option",
]  # fmt: skip
