"""GenICam cameras (GigE Vision, USB3 Vision, ...) through the package harvesters and a maker's producer file.

The camera is triggered by software where it can be: then an image was exposed after the call because the call exposed
it. A camera without that trigger runs freely, and images that may have begun before the call are passed over.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from core.devices.protocol import GRAIN_S, Check, Image, Note, Pixels, Setting, no_check, no_note
from core.errors import DeviceError

SAME = 0.02  # a setting read back within two per cent counts as taken


class GenicamCamera:
    """A GenICam camera.

    Parameters
    ----------
    place : str
        The camera's serial number, or its number in the list: 0, 1, ...
    producer : str
        Path of the maker's producer file (.cti).
    exposure_us : float, optional
    gain : float, optional
    pixel_format : str
        "Mono8", "Mono10", "Mono12", "Mono16"; empty: as the camera is set.
    harvester : object, optional
        In place of a new ``harvesters.core.Harvester``.

    Raises
    ------
    DeviceError
        If the package, the producer or the camera is missing, or a setting is not what is read back.
    """

    def __init__(
        self,
        place: str,
        producer: str = "",
        *,
        exposure_us: float | None = None,
        gain: float | None = None,
        pixel_format: str = "",
        note: Note = no_note,
        harvester: Any = None,
    ) -> None:
        self.name, self.note = f"GenICam camera {place}", note
        self._harvester = _new_harvester(self.name) if harvester is None else harvester
        self._acquirer: Any = None
        try:
            with self._told("cannot be opened", "check cable, supply and producer file, and that nobody else uses it"):
                if producer:
                    self._harvester.add_file(producer)
                self._harvester.update()
                self._acquirer = self._harvester.create(self._key(place))
            self._nodes = self._acquirer.remote_device.node_map
            self._set_up(exposure_us, gain, pixel_format)
            with self._told("does not start", "switch the camera off and on"):
                self._acquirer.start()
        except BaseException:
            self.close()
            raise

    @property
    def bits(self) -> int:
        """How many bits of a grey value are used."""
        digits = "".join(c for c in str(self._nodes.PixelFormat.value) if c.isdigit())
        return int(digits)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in px."""
        return int(self._nodes.Width.value), int(self._nodes.Height.value)

    @property
    def setting(self) -> Setting:
        """The exposure time."""
        return Setting("exposure_us", "exposure", "µs", 1e6 * self._exposure_s())

    def adjust(self, value: float) -> Setting:
        """Set the exposure time and read it back."""
        self._expose("Exposure", value)
        return self.setting

    def grab(self, timeout_s: float = 5.0, check: Check = no_check) -> Image:
        """Take one image."""
        if self._acquirer is None:
            raise DeviceError(self.name, "closed", "open it again")
        start = time.monotonic()
        if self._triggered:
            with self._told("does not take the trigger", "switch the camera off and on"):
                self._nodes.TriggerSoftware.execute()
            return Image(self._fetch(timeout_s, check), self.bits, start)
        for passed in range(64):
            begun = time.monotonic()
            pixels = self._fetch(max(0.01, start + timeout_s - begun), check)
            waited = time.monotonic() - begun
            # an image that was there at once came from a buffer, and the first that had to be waited for began before
            if passed and waited > 0.001 and time.monotonic() - start > self._exposure_s():
                return Image(pixels, self.bits, time.monotonic() - self._exposure_s())
        raise DeviceError(self.name, "64 images from the buffer", "set a lower frame rate or a software trigger")

    def close(self) -> None:
        """Let the camera go, whatever state it is in."""
        acquirer, self._acquirer = self._acquirer, None
        for step in ("stop", "destroy"):
            if acquirer is not None:
                with suppress(Exception):  # makers' producers raise exceptions of many kinds
                    getattr(acquirer, step)()
        with suppress(Exception):
            self._harvester.reset()

    def _key(self, place: str) -> Any:
        count = len(self._harvester.device_info_list)
        if place.isdigit() and int(place) < count:
            return int(place)
        serials = [str(device.serial_number) for device in self._harvester.device_info_list]
        if place not in serials:
            raise DeviceError(
                self.name, f"not among the {count} cameras found", f"use {', '.join(serials) or 'a cable'}"
            )
        return {"serial_number": place}

    def _set_up(self, exposure_us: float | None, gain: float | None, pixel_format: str) -> None:
        if pixel_format:
            self._wanted("PixelFormat", pixel_format)
        if not str(self._nodes.PixelFormat.value).startswith("Mono"):
            seen = f"its pixel format is {self._nodes.PixelFormat.value}"
            raise DeviceError(self.name, seen, "choose a grey one: format=Mono8")
        for node, value in (("Exposure", exposure_us), ("Gain", gain)):
            if value is not None:
                self._expose(node, value)
        self._triggered = hasattr(self._nodes, "TriggerSoftware") and hasattr(self._nodes, "TriggerMode")
        if self._triggered:
            for node, text in (("TriggerSelector", "FrameStart"), ("TriggerSource", "Software"), ("TriggerMode", "On")):
                if hasattr(self._nodes, node):
                    self._wanted(node, text)
        else:
            self.note(self.name, "has no software trigger and runs freely")

    def _expose(self, node: str, value: float) -> None:
        """Set exposure or gain, without the camera's own automatic."""
        if hasattr(self._nodes, f"{node}Auto"):
            self._wanted(f"{node}Auto", "Off")
        self._wanted("ExposureTime" if node == "Exposure" else node, value)

    def _wanted(self, node: str, value: Any) -> None:
        """Set a node and read it back."""
        with self._told(f"does not take {node} = {value}", f"choose a {node} that the camera offers"):
            getattr(self._nodes, node).value = value
            found = getattr(self._nodes, node).value
        same = found == value if isinstance(value, str) else abs(found - value) <= SAME * max(abs(value), 1e-9)
        if not same:
            raise DeviceError(
                self.name, f"{node} {value} was wanted and {found} is set", f"choose a {node} that the camera offers"
            )

    def _exposure_s(self) -> float:
        return float(self._nodes.ExposureTime.value) / 1e6 if hasattr(self._nodes, "ExposureTime") else 0.0

    def _fetch(self, timeout_s: float, check: Check = no_check) -> Pixels:
        """Copy the next image out of the producer's buffer."""
        end = time.monotonic() + timeout_s
        while (rest := end - time.monotonic()) > GRAIN_S:
            check()
            try:
                return self._fetched(min(rest, GRAIN_S), timeout_s)
            except DeviceError:  # nothing yet, as a rule; what else it is the last try tells
                if time.monotonic() < end - rest + GRAIN_S / 2:
                    break  # it was not the waiting that failed
        return self._fetched(max(0.01, end - time.monotonic()), timeout_s)

    def _fetched(self, wait_s: float, patience_s: float) -> Pixels:
        with (
            self._told(f"no image within {patience_s:g} s", "check the camera's cable and trigger"),
            self._acquirer.fetch(timeout=wait_s) as buffer,
        ):
            part = buffer.payload.components[0]
            return np.array(part.data).reshape(int(part.height), int(part.width))

    @contextmanager
    def _told(self, seen: str, remedy: str) -> Iterator[None]:
        try:
            yield
        except DeviceError:
            raise
        except Exception as error:  # makers' producers raise exceptions of many kinds
            raise DeviceError(self.name, f"{seen} ({error})", remedy) from error


def _new_harvester(name: str) -> Any:
    try:
        from harvesters.core import Harvester
    except ImportError as error:
        raise DeviceError(
            name, "the package harvesters is missing", "pip install harvesters; a bundle cannot have it"
        ) from error
    return Harvester()
