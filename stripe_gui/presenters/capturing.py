"""What the capture wizard knows without a window: devices to choose from, names, scenes, findings in words."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from core.capture import CaptureReport, capture_status, retake_frame, rigcheck
from core.devices import Setting, parse_address, with_option
from core.errors import InputError, StripeError
from core.fields import read_document
from core.lazy import dataclass
from core.model import Finding, Project, Role, Subject
from core.patterns import Pattern
from core.pipeline import capture_into
from core.pipeline.capture import preflight_rig
from core.progress import SILENT, Progress
from core.project import read_project
from stripe_gui.presenters.looking import Rig
from stripe_gui.presenters.sequences import Shown
from stripe_gui.presenters.told import told, translate

SCENES = ("virtual", "emulated")  # kinds of devices that look at a scene of the virtual bench


@dataclass(frozen=True)
class DeviceKind:
    """One way to reach a projector or camera: what it is called, a URL to begin with, what it is for."""

    kind: str
    title: str
    url: str
    explanation: str


@dataclass(frozen=True)
class Recording:
    """What every image is taken with: the project's folder, the two devices, and who hears of each image."""

    folder: Path
    rig: Rig
    urls: tuple[str, str]
    listen: Callable[[dict[str, Any]], None]


@dataclass(frozen=True)
class Unfinished:
    """A capture that was interrupted, and how far it got, in words."""

    subject: Subject
    state: str


@dataclass(frozen=True)
class Connection:
    """What answered at the two URLs."""

    words: tuple[str, ...]
    patterns: tuple[Pattern, ...]
    shown: Shown
    setting: Setting | None

    @property
    def lines(self) -> tuple[int, int]:
        return self.shown.lines


def projector_kinds(virtual: str, screens: Sequence[str] = ()) -> tuple[DeviceKind, ...]:
    """Give the ways to reach a projector, by the virtual rig's URL and the names of this computer's screens."""
    scene = virtual.partition(":")[2] or "flat"
    return (
        DeviceKind(
            "virtual",
            translate("Capturing", "Virtual bench"),
            virtual or "virtual:flat",
            translate("Capturing", "A simulated rig: nothing to connect, for trying and for training."),
        ),
        DeviceKind(
            "serial",
            translate("Capturing", "Serial line (RS-232)"),
            "serial:/dev/ttyUSB0?profile=stripe-lines",
            translate(
                "Capturing",
                "A projector spoken to by a command profile. Name the port (/dev/ttyUSB0, COM3) and the profile.",
            ),
        ),
        DeviceKind(
            "screen",
            translate("Capturing", "Second screen (HDMI)"),
            f"screen:{max(len(screens) - 1, 0)}",
            translate(
                "Capturing",
                "Any projector that is a screen of this computer, at its own resolution, picture improvements off. "
                "Screens: {screens}.",
            ).format(screens="; ".join(screens)),
        ),
        DeviceKind(
            "emulated",
            translate("Capturing", "Emulated serial line"),
            f"emulated:{scene}?profile=stripe-lines",
            translate(
                "Capturing",
                "The virtual bench behind a real serial protocol: for trying profiles, with faults if wanted.",
            ),
        ),
        _replay(),
    )


def camera_kinds(virtual: str) -> tuple[DeviceKind, ...]:
    """Give the ways to reach a camera."""
    return (
        DeviceKind(
            "virtual",
            translate("Capturing", "Virtual bench"),
            virtual or "virtual:flat",
            translate("Capturing", "Looks at the same simulated scene as the virtual projector."),
        ),
        DeviceKind(
            "uvc",
            translate("Capturing", "Video device (USB)"),
            "uvc:0",
            translate(
                "Capturing",
                "A camera the system knows as a video device, by its number; ?exposure=150&format=GREY set it.",
            ),
        ),
        DeviceKind(
            "genicam",
            translate("Capturing", "Industrial camera (GenICam)"),
            "genicam:0?producer=/path/to/maker.cti",
            translate(
                "Capturing", "GigE Vision or USB3 Vision: its serial number or 0 for the first, and the maker's file."
            ),
        ),
        DeviceKind(
            "folder",
            translate("Capturing", "Watched folder"),
            "folder:/path/to/images",
            translate("Capturing", "Any tethered camera whose own program writes each image into this folder."),
        ),
        _replay(),
    )


def _replay() -> DeviceKind:
    text = translate("Capturing", "Shows a stored capture again: name its folder for projector and camera alike.")
    return DeviceKind("replay", translate("Capturing", "Replay of a capture"), "replay:/path/to/capture", text)


def url_problem(url: str) -> str:
    """Say why a text is no device URL; empty if it is one."""
    try:
        parse_address(url.strip())
    except InputError as error:
        return str(error)
    return ""


def scene_of(url: str) -> str:
    """Give the scenario of the virtual bench that a URL looks at; empty for every other device."""
    try:
        address = parse_address(url)
    except InputError:
        return ""
    return address.place if address.kind in SCENES and address.place != "flat" else ""


def scenes(scenario: str, progress: Progress = SILENT) -> tuple[str, ...]:
    """List what can stand before the virtual rig: the captures of a simulated experiment."""
    from core.bench import experiment, scenarios

    progress.check()
    return tuple(shot.name for shot in experiment(scenario).shots) if scenario in scenarios() else ()


def scene_for(name: str, role: Role, names: Iterable[str]) -> str:
    """Choose the scene that suits a new capture: of its name, else of its role and number, going round.

    Examples
    --------
    >>> scene_for("testfield-09", "testfield", ["testfield-01", "testfield-02", "depth-01"])
    'testfield-01'
    """
    every = list(names)
    alike = [n for n in every if n.startswith(role)]
    named = [n for n in every if name == n or name.startswith(f"{n}-")]
    if named or not alike:
        return (named or every or [""])[0]
    number = re.search(r"(\d+)$", name)
    return alike[(int(number.group(1)) - 1) % len(alike)] if number else alike[0]


def in_scene(url: str, scene: str) -> str:
    """Give the URL with the virtual bench's scene in it; other devices' URLs stay."""
    return with_option(url, "shot", scene) if scene and scene_of(url) else url


def role_choices() -> tuple[tuple[Role, str, str], ...]:
    """Give the roles: word, title, what they are for."""
    return (
        (
            "testfield",
            translate("Capturing", "Testfield"),
            translate("Capturing", "The board of dots in one more pose: about 20, tilted, some turned by 90°."),
        ),
        (
            "depth",
            translate("Capturing", "Plate at a depth"),
            translate("Capturing", "A flat plate at a known position along its axis, for the polynomial method."),
        ),
        (
            "plane",
            translate("Capturing", "Plane-table"),
            translate("Capturing", "The certified plane at an angle, to judge the calibration."),
        ),
        ("object", translate("Capturing", "Object"), translate("Capturing", "Whatever is to be measured.")),
    )


def next_name(subject: Subject, taken: Iterable[str]) -> str:
    """Propose the next free name.

    Examples
    --------
    >>> next_name(Subject("testfield"), ["testfield-01", "testfield-02"])
    'testfield-03'
    >>> next_name(Subject("plane", angle_deg=-15), ["plane-15"])
    'plane-15-2'
    """
    used = set(taken)
    if subject.role == "plane":
        first = f"plane{subject.angle_deg or 0:+03.0f}"
        numbered = (f"{first}-{n}" for n in range(2, len(used) + 3))
        return first if first not in used else next(name for name in numbered if name not in used)
    return next(name for n in range(1, len(used) + 2) if (name := f"{subject.role}-{n:02d}") not in used)


def taken_names(project: Project) -> list[str]:
    """List the names that captures have, unfinished ones included."""
    folder = project.path / "captures"
    return sorted(p.name for p in folder.iterdir() if p.is_dir()) if folder.is_dir() else []


def boards(project: Project) -> list[str]:
    """List the testfields of a project, testfield.csv first."""
    names = sorted(p.name for p in project.path.glob("*.csv"))
    return sorted(names, key=lambda name: name != "testfield.csv")


def unfinished(project: Project) -> tuple[Unfinished, ...]:
    """Find the captures that were interrupted."""
    found, listed = [], {path.name for path in project.captures}
    for name in taken_names(project):
        folder = project.path / "captures" / name
        if name in listed or not (folder / "capture.json").is_file():
            continue
        try:
            status = capture_status(folder)
            fields = read_document(folder / "capture.json", "stripe-capture")
            subject = Subject(
                fields.text("role"),
                name,
                fields.real("z_mm", default=None),
                fields.real("angle_deg", default=None),
                fields.text("testfield", default=None),
            )
        except StripeError:
            continue
        if status.state == "taking":
            found.append(Unfinished(subject, str(status)))
    return tuple(found)


def connect(project: Project, rig: Rig, urls: tuple[str, str], progress: Progress = SILENT) -> Connection:
    """Open both devices, take one image, and say what answered; the devices stay open in `rig`.

    A StripeError says what does not answer or does not fit, and what to check.
    """
    from core.capture.plan import own_sequence, sequence_for
    from core.capture.run import check_sizes

    projector, camera = rig.open(urls, progress)
    progress.check()
    rig.look(urls, "white", progress=progress)  # the first image of a camera takes longer than those after it
    look = rig.look(urls, "white", progress=progress)
    check_sizes(project, projector, camera)
    height, width = look.image.shape
    if (width, height) != (project.camera.width, project.camera.height):
        seen = f"images have {width}x{height} px, the project's camera {project.camera.width}x{project.camera.height}"
        raise InputError(camera.name, seen, "set the camera to that size, or correct the camera in project.json")
    columns, rows = projector.size
    patterns = sequence_for(project, projector)
    first = translate(
        "Capturing", "{name} answers: {columns} × {rows} lines, waited for {settle:.0f} ms after a pattern."
    )
    second = translate("Capturing", "{name} answers: {width} × {height} px, {bits} bit; an image took {ms:.0f} ms.")
    words = (
        first.format(name=_named(projector.name), columns=columns, rows=rows, settle=1000 * projector.settle_s),
        second.format(name=_named(camera.name), width=width, height=height, bits=camera.bits, ms=1000 * look.seconds),
        translate("Capturing", "Both have the sizes of this project."),
    )
    frame_s = projector.settle_s + look.seconds
    shown = Shown((columns, rows), own_sequence(projector), projector.refusal, frame_s)
    return Connection(words, patterns, shown, rig.setting)


def _named(device: str) -> str:
    name = told(device)
    return name[:1].upper() + name[1:]


def take(recording: Recording, subject: Subject, progress: Progress = SILENT) -> CaptureReport:
    """Run the sequence into the project; the devices that were looked through are let go first."""
    recording.rig.close()
    projector, camera = recording.urls
    return capture_into(
        recording.folder, subject, projector=projector, camera=camera, progress=progress, listen=recording.listen
    )


def retake(recording: Recording, name: str, frame: int, progress: Progress = SILENT) -> CaptureReport:
    """Take one frame of a complete capture again."""
    recording.rig.close()
    project = read_project(recording.folder)
    return retake_frame(project, name, frame, *recording.urls, progress=progress, listen=recording.listen)


def check_rig(project: Project, rig: Rig, urls: tuple[str, str], progress: Progress = SILENT) -> tuple[Finding, ...]:
    """Run the checks before the first calibration."""
    rig.close()
    return preflight_rig(project.path, projector=urls[0], camera=urls[1], progress=progress)


def stripes_at(
    project: Project, rig: Rig, urls: tuple[str, str], z_mm: float, progress: Progress = SILENT
) -> tuple[list[Any], float]:
    """Take the finest stripes on a plate at a position; the virtual bench puts its own plate there."""
    rig.close()
    return rigcheck.stripes_at(urls, z_mm, progress)
