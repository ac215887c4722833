"""GenICam cameras (GigE Vision, USB3 Vision, ...) through the package harvesters and a maker's producer file.

The camera is triggered by software where it can be: then an image was exposed after the call because the call exposed
it, unless it is one that an earlier call did not wait for. Such images are drained before the trigger, known by their
time stamp or frame number where the camera gives these, and else by the image that follows them. A camera without that
trigger runs freely, and images that may have begun before the call are passed over.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np

from core.devices.protocol import GRAIN_S, Check, Image, Note, Pixels, Setting, no_check, no_note
from core.errors import DeviceError, NotThereError
from core.lazy import dataclass

SAME = 0.02  # a setting read back within two per cent counts as taken
_EARLY_S = 0.01  # by which a time stamp may seem to lie before its trigger
_GRACE_S = 0.25  # beside three times what an image takes: for the one that follows a late image
_MOST = 64  # images in the buffers
_UNDER_WAY = 2  # images of a camera that runs freely: one is read out while the next is exposed
_AUTOMATIC = ("ExposureAuto", "GainAuto", "BlackLevelAuto", "BalanceWhiteAuto")


@dataclass(frozen=True)
class _Fetched:
    """An image from the producer, with its frame number and its time stamp in seconds, where the camera gives them."""

    pixels: Pixels
    number: int | None
    stamp_s: float | None


class GenicamCamera:
    """A GenICam camera.

    Parameters
    ----------
    place : str
        The camera's serial number, or its number in the list: 0, 1, ...
    producer : str
        Path of the maker's producer file (.cti).
    gamma : float
        What is set where the camera has a gamma. All that is automatic is switched off.
    pixel_format : str
        "Mono8", "Mono10", "Mono12", "Mono16"; empty: as the camera is set.
    line : str
        Where the projector's trigger comes in, such as "Line1"; empty: nowhere.
    lead : str
        Where the trigger for the projector goes out, such as "Line2", an image every `lead_period_s`; empty: nowhere.
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
        gamma: float = 1.0,
        pixel_format: str = "",
        line: str = "",
        lead: str = "",
        lead_period_s: float = 0.0,
        note: Note = no_note,
        harvester: Any = None,
    ) -> None:
        self.name, self.note = f"GenICam camera {place}", note
        self.can_arm, self._line, self._lead, self.lead_period_s = bool(line), line, lead, lead_period_s
        self._harvester = _new_harvester(self.name) if harvester is None else harvester
        self._acquirer: Any = None
        self._unfinished = False  # an image may come that nobody waits for any more
        self._last: int | None = None  # frame number
        self._clock_s: float | None = None  # the camera's clock at the zero of ours
        self._takes_s = 0.0  # from trigger to image
        try:
            with self._told("cannot be opened", "check cable, supply and producer file, and that nobody else uses it"):
                if producer:
                    self._harvester.add_file(producer)
                self._harvester.update()
                self._acquirer = self._harvester.create(self._key(place))
            self._nodes = self._acquirer.remote_device.node_map
            self._set_up(exposure_us, gain, gamma, pixel_format)
            with self._told("does not start", "switch the camera off and on"):
                self._acquirer.start()
        except BaseException:
            self.close()
            raise

    @property
    def bits(self) -> int:
        digits = "".join(c for c in str(self._nodes.PixelFormat.value) if c.isdigit())
        return int(digits)

    @property
    def size(self) -> tuple[int, int]:
        return int(self._nodes.Width.value), int(self._nodes.Height.value)

    @property
    def setting(self) -> Setting:
        return Setting("exposure_us", "exposure", "µs", 1e6 * self._exposure_s())

    def adjust(self, value: float) -> Setting:
        self._wanted("ExposureTime", value)
        return self.setting

    def grab(self, timeout_s: float = 5.0, check: Check = no_check) -> Image:
        if self._acquirer is None:
            raise DeviceError(self.name, "closed", "open it again")
        if self._triggered:
            self._drain()
            late, self._unfinished = self._unfinished, True
            fired = time.monotonic()
            with self._told("does not take the trigger", "switch the camera off and on"):
                self._nodes.TriggerSoftware.execute()
            found = self._answer(fired, timeout_s, late, check)
            self._unfinished = False
            return Image(found.pixels, self.bits, fired)
        return self._running(timeout_s, check)

    def arm(self, count: int) -> None:
        self._switch({"TriggerSource": self._line}, count)
        self._unfinished = False

    def lead(self, count: int) -> None:
        self._switch(
            {
                "LineSelector": self._lead,
                "LineMode": "Output",
                "LineSource": "ExposureActive",
                "TriggerMode": "Off",
                **({"AcquisitionFrameRateEnable": True} if hasattr(self._nodes, "AcquisitionFrameRateEnable") else {}),
                "AcquisitionFrameRate": 1 / self.lead_period_s,
                "AcquisitionMode": "MultiFrame",
                "AcquisitionFrameCount": count,
            },
            count,
        )
        self._unfinished = False

    def collect(self, count: int, timeout_s: float, check: Check = no_check) -> list[Image]:
        """Give the images since, with times of the camera's own clock; then the trigger is software's again."""
        images: list[Image] = []
        end = time.monotonic() + timeout_s
        while time.monotonic() < end and len(images) <= count:  # one more than wanted tells of a doubled trigger
            patience = min(end - time.monotonic(), 0.1) if len(images) == count else end - time.monotonic()
            try:
                found = self._fetch(max(0.01, patience), check)
            except DeviceError:
                break
            stamp = time.monotonic() if found.stamp_s is None else found.stamp_s
            images.append(Image(found.pixels, self.bits, stamp, found.number))
        led = {"AcquisitionMode": "Continuous", "TriggerMode": "On"} if self._lead else {}
        self._switch({**led, "TriggerSource": "Software"})
        return images

    def _switch(self, nodes: Mapping[str, Any], count: int = 0) -> None:
        """Take images at other triggers; what was on its way is given up. With room for `count` that nobody fetches."""
        with self._told("does not change its trigger", "switch the camera off and on"):
            self._acquirer.stop()
            for node, value in nodes.items():
                self._wanted(node, value)
            if count:
                self._acquirer.num_buffers = max(count + 1, self._acquirer.min_num_buffers)
            self._acquirer.start()
        self._last = None

    def _drain(self) -> None:
        """Throw away images that nobody has waited for."""
        if self._unfinished:  # what is on its way is given up, and frame numbers may begin anew
            with self._told("does not start again", "switch the camera off and on"):
                self._acquirer.stop()
                self._acquirer.start()
            self._last = None
        for found in self._waiting():
            self._last = found.number
            self.note(self.name, "an image came that nobody waited for; it is thrown away")

    def _waiting(self) -> Iterator[_Fetched]:
        """Take off the images that wait in the buffers."""
        for _ in range(_MOST):
            try:
                yield self._fetched(0.001, 0.0)
            except DeviceError:
                return

    def _running(self, timeout_s: float, check: Check) -> Image:
        """Wait for an image that a camera without trigger began after this call.

        Once the buffers are empty, two images may have begun before: one is read out while the next is exposed. How
        long an image was waited for says nothing, since a busy machine waits for those in the buffers too.
        """
        start = time.monotonic()
        if len(list(self._waiting())) == _MOST:
            raise DeviceError(
                self.name, f"{_MOST} images from the buffer", "set a lower frame rate or a software trigger"
            )
        passed = 0
        while True:
            pixels = self._fetch(max(0.01, start + timeout_s - time.monotonic()), check).pixels
            began = time.monotonic() - self._exposure_s()
            if passed >= _UNDER_WAY and began > start:
                return Image(pixels, self.bits, began)
            passed += 1

    def _answer(self, fired_s: float, timeout_s: float, late: bool, check: Check) -> _Fetched:
        """Wait for the image of a trigger; `late`: one of an earlier trigger may come before it."""
        end, suspect = fired_s + timeout_s, None
        while True:
            try:
                found = self._fetch(max(0.01, end - time.monotonic()), check)
            except DeviceError:
                if suspect is None:
                    raise
                return self._accept(suspect, fired_s)  # nothing followed it: it was no late one
            if found.number is not None and self._last is not None and 0 <= self._last - found.number < 1000:
                self.note(self.name, f"image {found.number} came again")
                continue
            proved = found.stamp_s is not None and self._clock_s is not None
            if proved and found.stamp_s - self._clock_s < fired_s - _EARLY_S:  # type: ignore[operator]
                self.note(self.name, "the image of an earlier trigger came late; it is thrown away")
                continue
            if proved or not late or suspect is not None:
                if suspect is not None:
                    self.note(self.name, "the image of an earlier trigger came late; it is thrown away")
                return self._accept(found, fired_s)
            suspect, end = found, min(end, time.monotonic() + 3 * self._takes_s + _GRACE_S)

    def _accept(self, found: _Fetched, fired_s: float) -> _Fetched:
        self._last, self._takes_s = found.number, time.monotonic() - fired_s
        if found.stamp_s is not None:
            self._clock_s = found.stamp_s - fired_s
        return found

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
            remedy = f"use {' or '.join(serials)}" if serials else "check cable, supply and producer file"
            raise NotThereError(self.name, f"not among the {count} cameras found", remedy)
        return {"serial_number": place}

    def _set_up(self, exposure_us: float | None, gain: float | None, gamma: float, pixel_format: str) -> None:
        if pixel_format:
            self._wanted("PixelFormat", pixel_format)
        if not str(self._nodes.PixelFormat.value).startswith("Mono"):
            seen = f"its pixel format is {self._nodes.PixelFormat.value}"
            raise DeviceError(self.name, seen, "choose a grey one: format=Mono8")
        for node in _AUTOMATIC:
            if hasattr(self._nodes, node):
                self._wanted(node, "Off")
        if hasattr(self._nodes, "GammaEnable"):
            self._wanted("GammaEnable", gamma != 1.0)
        if hasattr(self._nodes, "Gamma") and (gamma != 1.0 or not hasattr(self._nodes, "GammaEnable")):
            self._wanted("Gamma", gamma)
        for node, value in (("ExposureTime", exposure_us), ("Gain", gain)):
            if value is not None:
                self._wanted(node, value)
        self._triggered = hasattr(self._nodes, "TriggerSoftware") and hasattr(self._nodes, "TriggerMode")
        if self._triggered:
            for node, text in (("TriggerSelector", "FrameStart"), ("TriggerSource", "Software"), ("TriggerMode", "On")):
                if hasattr(self._nodes, node):
                    self._wanted(node, text)
        else:
            self.note(self.name, "has no software trigger and runs freely")

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

    def _fetch(self, timeout_s: float, check: Check = no_check) -> _Fetched:
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

    def _fetched(self, wait_s: float, patience_s: float) -> _Fetched:
        with (
            self._told(f"no image within {patience_s:g} s", "check the camera's cable and trigger"),
            self._acquirer.fetch(timeout=wait_s) as buffer,
        ):
            part = buffer.payload.components[0]
            pixels = np.array(part.data).reshape(int(part.height), int(part.width))
            module = getattr(buffer, "module", buffer)
            stamp = _told_by(buffer, "timestamp_ns")
            return _Fetched(pixels, _told_by(module, "frame_id"), None if stamp is None else 1e-9 * stamp)

    @contextmanager
    def _told(self, seen: str, remedy: str) -> Iterator[None]:
        try:
            yield
        except DeviceError:
            raise
        except Exception as error:  # makers' producers raise exceptions of many kinds
            raise DeviceError(self.name, f"{seen} ({error})", remedy) from error


def _told_by(source: Any, name: str) -> int | None:
    """Give a number that a buffer knows; None where the camera does not tell it."""
    try:
        value = getattr(source, name)
    except Exception:  # makers' producers raise exceptions of many kinds
        return None
    return None if value is None else int(value)


def _new_harvester(name: str) -> Any:
    try:
        from harvesters.core import Harvester
    except ImportError as error:
        raise DeviceError(
            name, "the package harvesters is missing", "pip install harvesters; a bundle cannot have it"
        ) from error
    return Harvester()
