"""Projectors and cameras, real and virtual, behind two small protocols.

protocol.py  what every projector and every camera promises
address.py   device URLs, taken apart with every check
opening.py   from a URL to a device
scene.py     what virtual devices look at
benchscene.py  ... of the virtual bench
virtual.py   a projector and a camera that share such a scene
stored.py    images that are files: a replayed capture, a watched folder
faults.py    what virtual devices do wrong on demand, by name and rate

No device is needed to test any of this: one suite, tests/devices, holds every projector and camera to its promise.
"""

from core.devices.faults import CAMERA_FAULTS, LINK_FAULTS, Faults
from core.devices.opening import CAMERA_KINDS, PROJECTOR_KINDS, open_camera, open_projector
from core.devices.protocol import Camera, Image, Note, Projector, no_note, wait_until

__all__ = [
    "CAMERA_FAULTS",
    "CAMERA_KINDS",
    "LINK_FAULTS",
    "PROJECTOR_KINDS",
    "Camera",
    "Faults",
    "Image",
    "Note",
    "Projector",
    "no_note",
    "open_camera",
    "open_projector",
    "wait_until",
]
