"""From a URL to a device, by the kinds of `PROJECTOR_KINDS` and `CAMERA_KINDS`, to which a program may add its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Generic, TypeVar
from weakref import WeakValueDictionary

from core.devices.address import Address, parse_address, with_option
from core.devices.faults import CAMERA_FAULTS, LINK_FAULTS, TRIGGER_FAULTS, parse_faults
from core.devices.line.profile import Profile
from core.devices.line.profiles import read_profile
from core.devices.protocol import Camera, Check, Note, Projector, no_check, no_note
from core.devices.scene import FlatScene, Scene
from core.devices.stored import FolderCamera, ReplayScene
from core.devices.virtual import Stage, VirtualCamera, VirtualProjector
from core.errors import InputError
from core.lazy import dataclass

Device = TypeVar("Device", covariant=True)
_SCENE_OPTIONS = ("pose", "shot", "seed", "projector")
_stages: WeakValueDictionary[str, Stage] = WeakValueDictionary()


@dataclass(frozen=True)
class DeviceKind(Generic[Device]):
    """A kind of device: what its URLs look like, and what opens one.

    `open` takes the address, in which it asks for every option that it knows and then calls ``address.finish()``, so
    that others are refused; the receiver of notes; and what is called while the device is waited for.
    """

    text: str
    open: Callable[[Address, Note, Check], Device]


def open_projector(url: str, note: Note = no_note, check: Check = no_check) -> Projector:
    """Open the projector that a URL names.

    Parameters
    ----------
    url : str
        One of `PROJECTOR_KINDS`.
    note : callable
        Receives what the device does beside what it was asked: retries, reconnections.
    check : callable
        Is called while the device is waited for; what it raises ends the wait.

    Raises
    ------
    InputError
        If the URL is wrong; it lists what is allowed.
    DeviceError
        If the device does not answer.
    """
    return _open(url, "projector", PROJECTOR_KINDS, note, check)


def open_camera(url: str, note: Note = no_note, name: str = "") -> Camera:
    """Open the camera that a URL names, one of `CAMERA_KINDS`; otherwise as `open_projector`.

    Of several it says by its `name` in the rig which has failed.
    """
    camera = _open(url, "camera", CAMERA_KINDS, note, no_check)
    if name:
        camera.name = f"{name}, {camera.name}"
    return camera


@contextmanager
def open_devices(
    projector_url: str, camera_url: str, note: Note = no_note, check: Check = no_check
) -> Iterator[tuple[Projector, Camera]]:
    """Open a projector and a camera for a `with` block, as `open_projector` and `open_camera` do, and let both go."""
    with (
        closing(open_projector(projector_url, note, check)) as projector,
        closing(open_camera(camera_url, note)) as camera,
    ):
        yield projector, camera


def open_stage(address: Address) -> Stage:
    """Give the stage of a scene; projector and camera that name the same scene share it while either is open."""
    chosen = [address.options.get(name) for name in _SCENE_OPTIONS]
    address.asked.update(_SCENE_OPTIONS)
    seed = address.integer("seed", 0)
    key = repr((address.kind, address.place, chosen))
    stage = _stages.get(key)
    if stage is None:
        stage = _stages[key] = Stage(_scene(address, seed), seed)
    return stage


def at_depth(url: str, z_mm: float) -> str:
    """Give the URL of a virtual rig with the plate at a position, where its experiment has one; else the URL itself."""
    address = parse_address(url)
    if address.kind not in ("virtual", "emulated") or address.place == "flat":
        return url
    from core.bench import experiment, scenarios

    if address.place not in scenarios():
        return url
    names = [shot.name for shot in experiment(address.place).shots if shot.z_mm == z_mm]
    return with_option(url, "shot", names[0]) if names else url


def _virtual_projector(address: Address, note: Note, check: Check) -> Projector:
    stage = open_stage(address)
    settle_s = address.real("settle_ms", 0.0, 0.0, 10_000.0) / 1000
    capacity = address.integer("capacity", 256, 0, 100_000)
    period_s = address.real("period_ms", 0.0, 0.0, 10_000.0) / 1000
    address.finish()
    return VirtualProjector(stage, settle_s, capacity, period_s)


def _virtual_camera(address: Address, note: Note, check: Check) -> Camera:
    stage = open_stage(address)
    faults = parse_faults(
        address.text("faults", ""), CAMERA_FAULTS | TRIGGER_FAULTS, address.url, address.integer("fault_seed", 0)
    )
    exposure_s = address.real("exposure_ms", 0.0, 0.0, 60_000.0) / 1000
    gain = address.real("gain", 1.0, 0.01, 100.0)
    period_s = address.real("period_ms", 0.0, 0.0, 10_000.0) / 1000
    name, scene = address.text("camera", ""), stage.scene
    if name:
        from core.devices.benchscene import BenchScene

        if not isinstance(scene, BenchScene):
            raise InputError(address.url, f"camera {name!r}", "name none: this scene has one camera")
        scene = scene.seen_by(name, address.url)
    address.finish()
    return VirtualCamera(stage, exposure_s, faults, gain, scene, period_s)


def _folder(address: Address, note: Note, check: Check) -> Camera:
    bits = address.integer("bits", 0, 0, 16)
    latency_s = address.real("latency_ms", 0.0, 0.0, 60_000.0) / 1000
    address.finish()
    return FolderCamera(Path(address.place), bits, latency_s=latency_s)


def _serial(address: Address, note: Note, check: Check) -> Projector:
    from core.devices.line.rs232 import SerialProjector

    if not address.place:
        raise InputError(address.url, "no port", "name it, as in serial:/dev/ttyUSB0 or serial:socket://host:port")
    profile, settle_s = _profile(address, 0, 0)
    address.finish()
    return SerialProjector(address.place, profile, note, settle_s=settle_s, check=check)


def _emulated(address: Address, note: Note, check: Check) -> Projector:
    """A serial projector whose other end is an emulator on the stage of a scene."""
    from core.devices.line.server import EmulatedProjector

    stage = open_stage(Address(address.url, "virtual", address.place, address.options, address.asked))
    profile, settle_s = _profile(address, *stage.scene.projector_size)
    seed = address.integer("fault_seed", 0)
    faults = parse_faults(address.text("faults", ""), LINK_FAULTS, address.url, seed)
    line = address.text("line", "pty", among=("pty", "socket"))
    address.finish()
    return EmulatedProjector(stage, profile, faults, line, note, settle_s, check)


def _screen(address: Address, note: Note, check: Check) -> Projector:
    from core.devices.line.dialogue import Dialogue
    from core.devices.screen import ScreenProjector, no_release, open_surface

    number = address.place_number("screen")
    gamma = address.real("gamma", 1.0, 0.1, 10.0)
    settle_ms = address.optional("settle_ms")
    settle_s = None if settle_ms is None else settle_ms / 1000
    port, profile = address.text("control", ""), address.text("profile", "optoma")
    address.finish()
    with ExitStack() as stack:
        if port:  # the projector behind the screen is switched by a line of its own
            talk = Dialogue(port, read_profile(profile), note)
            stack.callback(talk.close)
            talk.cancel = check
            talk.settle()
            talk.do("start")
        surface = open_surface(number)
        name = f"screen {number}"
        release = talk.close if port else no_release
        projector = ScreenProjector(surface, gamma=gamma, settle_s=settle_s, name=name, note=note, release=release)
        stack.pop_all()
    return projector


def _uvc(address: Address, note: Note, check: Check) -> Camera:
    from core.devices.uvc import UvcCamera

    number = address.place_number("video device")
    width, height = address.integer("width", 0), address.integer("height", 0)
    exposure, gain = address.optional("exposure", -100.0), address.optional("gain")
    gamma = address.optional("gamma")
    fourcc, bits = address.text("format", ""), address.integer("bits", 0, 0, 16)
    address.finish()
    return UvcCamera(
        number,
        width=width,
        height=height,
        exposure=exposure,
        gain=gain,
        gamma=gamma,
        fourcc=fourcc,
        bits=bits,
        note=note,
    )


def _genicam(address: Address, note: Note, check: Check) -> Camera:
    from core.devices.genicam import GenicamCamera

    if not address.place:
        raise InputError(address.url, "no camera", "name its serial number, or 0 for the first")
    producer, pixel_format = address.text("producer", ""), address.text("format", "")
    exposure_us, gain = address.optional("exposure_us"), address.optional("gain")
    gamma, line, lead = address.real("gamma", 1.0, 0.1, 10.0), address.text("line", ""), address.text("lead", "")
    period_s = address.real("period_ms", 0.0, 0.0, 10_000.0) / 1000
    address.finish()
    if bool(lead) != bool(period_s):
        remedy = "give both: the line that triggers the projector, and the period of an image"
        raise InputError(address.url, f"lead={lead!r} with period_ms={1000 * period_s:g}", remedy)
    how = {"gamma": gamma, "pixel_format": pixel_format, "line": line, "lead": lead, "lead_period_s": period_s}
    return GenicamCamera(address.place, producer, exposure_us=exposure_us, gain=gain, note=note, **how)  # type: ignore[arg-type]


def _profile(address: Address, columns: int, rows: int) -> tuple[Profile, float]:
    """Read the profile that a URL names, with the options that change it, and the settle time."""
    columns, rows = address.integer("columns", columns), address.integer("rows", rows)
    profile = read_profile(address.text("profile", "stripe-lines"), columns, rows)
    answer_s = address.real("answer_ms", 1000 * profile.answer_s, 1.0, 60_000.0) / 1000
    baud = address.integer("baud", profile.port.baud, 1)
    load_s = profile.load_s * answer_s / profile.answer_s
    period_s = address.real("period_ms", 1000 * profile.period_s, 0.0, 10_000.0) / 1000
    port = replace(profile.port, baud=baud)
    profile = replace(profile, answer_s=answer_s, load_s=load_s, period_s=period_s, port=port)
    return profile, address.real("settle_ms", 1000 * profile.settle_s, 0.0, 10_000.0) / 1000


def _scene(address: Address, seed: int) -> Scene:
    if address.kind == "replay":
        return ReplayScene(Path(address.place))
    if address.place == "flat":
        return FlatScene()
    from core.devices.benchscene import bench_scene  # the bench compiles its kernels: only on demand

    return bench_scene(address, seed)


def _open(url: str, what: str, kinds: Mapping[str, DeviceKind[Device]], note: Note, check: Check) -> Device:
    address = parse_address(url)
    if address.kind not in kinds:
        known = "; ".join(kind.text for kind in kinds.values())
        raise InputError(url, f"no {what} of kind {address.kind!r}", f"use {known}")
    return kinds[address.kind].open(address, note, check)


PROJECTOR_KINDS: dict[str, DeviceKind[Projector]] = {
    "virtual": DeviceKind(
        "virtual:SCENE, a scene of the virtual bench such as virtual:quick?pose=3, or virtual:flat", _virtual_projector
    ),
    "replay": DeviceKind("replay:FOLDER, a stored capture", _virtual_projector),
    "serial": DeviceKind("serial:PORT, such as serial:/dev/ttyUSB0?profile=stripe-lines", _serial),
    "emulated": DeviceKind("emulated:SCENE, a virtual projector at the other end of a serial line", _emulated),
    "screen": DeviceKind("screen:NUMBER, an HDMI projector as a further screen", _screen),
}
CAMERA_KINDS: dict[str, DeviceKind[Camera]] = {
    "virtual": DeviceKind("virtual:SCENE, together with a virtual projector of the same scene", _virtual_camera),
    "replay": DeviceKind("replay:FOLDER, together with a replaying projector", _virtual_camera),
    "folder": DeviceKind("folder:FOLDER, images that another program writes", _folder),
    "uvc": DeviceKind("uvc:NUMBER, a video device such as uvc:0?exposure=150&format=GREY", _uvc),
    "genicam": DeviceKind("genicam:SERIAL-NUMBER?producer=FILE.cti, an industrial camera", _genicam),
}
