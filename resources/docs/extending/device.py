"""
A camera
========

URLs that begin with the name of a kind open a device: in ``capture --camera``, ``preflight`` and the capture wizard.
Projectors are added to ``PROJECTOR_KINDS`` in the same way. `core.devices` documents the protocols of both.
"""

import time

import matplotlib.pyplot as plt
import numpy as np

from core.devices import CAMERA_KINDS, DeviceKind, Image, open_camera


class StripedCamera:
    """Sees stripes of a fixed width, whatever is in front of it."""

    bits, name = 8, "striped"

    def __init__(self, width):
        self.size, self.width = (96, 64), width

    def grab(self, timeout_s=5.0, check=lambda: None):
        """Take an image; call `check` while waiting: it may raise to end the wait."""
        stripes = np.arange(self.size[0]) // self.width % 2
        return Image(np.tile(np.uint8(40 + 160 * stripes), (self.size[1], 1)), self.bits, time.monotonic())

    def close(self):
        """Release the device; a second call does nothing."""


def open_striped(address, note, check):
    """Open striped:NAME?width=8."""
    width = address.integer("width", 4, 1, 48)
    address.finish()  # refuses options that were not asked for
    return StripedCamera(width)


CAMERA_KINDS["striped"] = DeviceKind("striped:NAME, stripes of a fixed width", open_striped)

# %%
# A URL opens one.
camera = open_camera("striped:one?width=8")
plt.imshow(camera.grab().pixels, cmap="gray")
plt.title(f"what {camera.name} sees")
plt.show()
camera.close()
