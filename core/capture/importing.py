"""A capture from frames that came from elsewhere: another program's camera, a projector that plays stored images."""

from __future__ import annotations

import re
import shutil
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from core.atomic import part_prefix, sweep, unwritable
from core.capture.plan import make_plan
from core.errors import InputError
from core.fields import regular
from core.lazy import dataclass
from core.model import Capture, DeviceSpec, Frame, PhaseMap, Plan, Project, Subject
from core.model.finding import Finding
from core.numerics import spaced
from core.patterns import Pattern, SequenceSpec, alike, axis_of, like, read_sequence_file
from core.progress import SILENT, Progress
from core.project import add_capture, read_capture, read_image, write_image
from core.project.captures import may_list, write_capture_json
from core.project.images import Image
from core.verify.proof import prove
from core.verify.quality import modulation, noise_of_one, sample_grid, saturation, summarise
from core.verify.recognise import order_in_words, recognise
from core.verify.stored import check_stored

ENDINGS = (".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg")
KEPT = (".png", ".tif", ".tiff")  # these are copied byte by byte, if they are grey
ORDERS = ("name", "list", "content")
DECODES = 0.5  # part of the lit pixels: where fewer do, nobody may say that the patterns come in their order
COLOURED = 5  # frames whose channels are looked at

Decoded = Callable[[Sequence[Frame], Sequence[Image], tuple[int, int]], PhaseMap]


@dataclass(frozen=True)
class ImportReport:
    """What was imported, and what there is to say of it."""

    folder: Path
    frames: int
    order: str
    files: tuple[str, ...]  # in the order of the sequence
    words: tuple[str, ...]
    findings: tuple[Finding, ...] = ()  # of the checks, which `words` tell too


def import_frames(
    project: Project,
    folder: Path,
    subject: Subject,
    *,
    sequence: SequenceSpec | None = None,
    order: str | None = None,
    decoded: Decoded | None = None,
    progress: Progress = SILENT,
) -> ImportReport:
    """Copy frames into ``captures/NAME`` of a project and add the capture to it; whole or not at all.

    Parameters
    ----------
    folder : Path
        Holds the images: PNG or TIFF of 8 or 16 bit; colour files, BMP and JPEG are converted to grey PNG.
    subject : Subject
        As of a capture that is taken; whose frames they are, in a rig of several where the sequence does not name them.
    sequence : SequenceSpec, optional
        What was shown; without it the ``capture.json`` in the folder, else the project's sequence.
    order : str, optional
        "name": the files' names, numbers counted, are in the sequence's order. "list": the sequence names the files.
        "content": what each shows is found from the images. Without it "list" where the sequence names files, else
        "name".
    decoded : callable, optional
        Decodes images by what is known of their frames and the projector's columns and rows: the checks see more then,
        and an order found by content is taken only if it is the only one.

    Raises
    ------
    InputError
        Naming the file: wrong counts or sizes, the same image twice, what is no image. Nothing is written then.
    """
    folder, target = Path(folder), project.path / "captures" / subject.name
    if not folder.is_dir():
        raise InputError(folder, "no such folder", "give the folder that holds the frames")
    if order is not None and order not in ORDERS:
        raise InputError("--order", f"{order!r}", f"use {', '.join(ORDERS)}")
    spec = sequence or sequence_beside(folder, project)
    by = order or ("list" if spec.files else "name")
    parts = _by_devices(project, subject, spec, by)
    exposed = {ms for ms in spec.exposures_ms if ms is not None}
    if by == "content" and len(exposed) > 1:
        seen = f"the list gives frames {len(exposed)} exposures, which no image shows"
        raise InputError("--order content", seen, "order the files by name, or by the list")
    lines = _lines(project, parts[0][0])
    patterns = spec.patterns(lines)
    plans = [make_plan(project, whose, [patterns[k] for k in own or range(len(patterns))]) for whose, own in parts]
    if target.exists():
        raise _taken(target) if target in project.captures else _unlisted(target, project)
    files = frames_in(folder)
    if by == "list":
        files = _listed(folder, files, spec)
    _check_count(folder, files, spec, patterns, lines)
    series = []
    steps = progress.part(0.0, 0.9).parts(len(plans))
    for plan, (_, own), part in zip(plans, parts, steps, strict=True):
        numbers = own or range(len(files))
        exposures = [spec.exposures_ms[k] for k in numbers] if spec.exposures_ms else [None] * len(numbers)
        frames = [Frame("", p, exposure_ms=ms) for p, ms in zip(plan.patterns, exposures, strict=True)]
        series.append(_read(project, plan, frames, [files[k] for k in numbers], by, decoded, part))
    progress.check()
    converted, name = _write(target, series, str(folder.resolve())), f"captures/{subject.name}"
    try:
        add_capture(project.path, name)
    except BaseException:
        if not may_list(project.path, name):
            shutil.rmtree(target, ignore_errors=True)
        raise
    words = []
    for (whose, own), one in zip(parts, series, strict=True):
        words += [f"{whose.camera} with {whose.projector}: {told}" if own else told for told in one.words]
    names = tuple(f.name for one in series for f in one.files)
    if converted:
        words.insert(0, f"{converted} of {len(names)} files were converted to grey PNG (colour, or another format)")
    progress(1.0, "imported")
    return ImportReport(target, len(names), by, names, tuple(words), tuple(f for one in series for f in one.findings))


@dataclass(frozen=True)
class _Series:
    """The frames of one camera under one projector."""

    plan: Plan
    frames: Sequence[Frame]
    files: Sequence[Path]
    images: Sequence[Image]
    words: Sequence[str]
    findings: Sequence[Finding]


def _by_devices(project: Project, subject: Subject, spec: SequenceSpec, by: str) -> list[tuple[Subject, Sequence[int]]]:
    """Say whose frames they are, by the list, else the subject; a rig of one pair takes them under any names."""
    rig = project.rig
    pairs = [
        (c or subject.camera or rig.camera_name, p or subject.projector or rig.projector_name) for c, p in spec.devices
    ]
    if not any(map(any, spec.devices)) or (rig.is_pair and len(set(pairs)) == 1):
        for kind, known, given in (
            ("camera", rig.cameras, subject.camera),
            ("projector", rig.projectors, subject.projector),
        ):
            if len(known) > 1 and not given:
                raise InputError(
                    f"--{kind}", f"is not given, the rig has {', '.join(known)}", "say whose frames they are"
                )
        return [(subject, ())]
    if by == "content":
        raise InputError("--order content", "the list names whose frame each is", "leave it out, or import them apart")
    wanted = dict.fromkeys(p for p in pairs if subject.camera in ("", p[0]) and subject.projector in ("", p[1]))
    if not wanted:
        told = ", ".join(f"{c} with {p}" for c, p in dict.fromkeys(pairs))
        raise InputError("--camera or --projector", f"none of the frames that are listed: {told}", "name one of these")
    return [
        (replace(subject, camera=c, projector=p), [k for k, pair in enumerate(pairs) if pair == (c, p)])
        for c, p in wanted
    ]


def _lines(project: Project, subject: Subject) -> tuple[int, int]:
    shown_by = project.rig.projectors.get(subject.projector, project.projector)
    return shown_by.width, shown_by.height


def _read(
    project: Project,
    plan: Plan,
    frames: Sequence[Frame],
    files: list[Path],
    by: str,
    decoded: Decoded | None,
    progress: Progress,
) -> _Series:
    """Read the frames of a series and see whether they are what they should be."""
    subject, patterns, words = plan.subject, plan.patterns, []
    lines = _lines(project, subject)
    images = [image for path in progress.part(0.0, 0.4).over(files, "reading frame {}") for image in [read_image(path)]]
    _check_images(files, images, project.rig.cameras.get(subject.camera, project.camera))
    if by == "content":
        progress(0.4, "looking what each frame shows")
        found = recognise(images, patterns, lines, str(files[0].parent), progress)
        words.append(order_in_words([f.name for f in files], patterns, found))
        files, images = [files[k] for k in found], [images[k] for k in found]
    phase = None
    try:
        phase = decoded(frames, images, lines) if decoded is not None else None
    except InputError as error:
        if by == "content":
            raise
        words.append(f"the frames do not decode: {error.seen}; {error.remedy}")
    if by == "content" and phase is not None:
        words += prove(patterns, phase, lines, str(files[0].parent))
    _check_twice(files, images, patterns, lines)
    progress(0.7, "verifying")
    findings = (*_verified(plan, frames, images, lines, phase), *_dead_colours(files))
    for finding in findings:
        named = f" [{', '.join(files[k].name for k in finding.shots)}]" if 0 < len(finding.shots) <= 3 else ""
        disordered = finding.level == "bad" and (finding.check == "order" or "contradicting" in finding.figures)
        hint = "; see whether --order content finds another order" if disordered else ""
        words.append(f"{finding.text}{named}{hint}")
    return _Series(plan, frames, files, images, words, findings)


def frames_in(folder: Path) -> list[Path]:
    """List the images in a folder, by name, numbers counted; hidden files, as macOS writes beside others, are none."""
    shown = (p for p in folder.iterdir() if p.suffix.lower() in ENDINGS and not p.name.startswith("."))
    return sorted((p for p in shown if p.is_file()), key=natural)


def natural(path: Path) -> tuple[tuple[int, int, str], ...]:
    """Sort by names in which numbers count as numbers.

    Examples
    --------
    >>> sorted([Path("img10.png"), Path("img9.png"), Path("img1.png")], key=natural)[-1].name
    'img10.png'
    """
    parts = re.split(r"(\d+)", path.name.lower())
    return tuple((0, int(p), "") if p.isdigit() else (1, 0, p) for p in parts if p)


def sequence_of(project: Project) -> SequenceSpec:
    """Give the sequence of a project: its own, or that of its latest capture."""
    if project.sequence is not None:
        return project.sequence
    for path in reversed(project.captures):
        try:
            frames = read_capture(path, project).series[0].frames
            exposures = tuple(frame.exposure_ms for frame in frames)
            exposures = exposures if len({*exposures}) > 1 else ()  # a single one is that capture's own
            return SequenceSpec(listed=tuple(frame.pattern for frame in frames), exposures_ms=exposures)
        except InputError:
            continue
    seen = "gives no sequence, and there is no capture to take it from"
    raise InputError(project.path / "project.json", seen, 'give --sequence, such as "gray-sine", or a list of patterns')


def sequence_beside(folder: Path, project: Project) -> SequenceSpec:
    """Give the sequence that frames show where nothing else is said: of their capture.json, else the project's."""
    path = folder / "capture.json"
    return read_sequence_file(path) if path.is_file() else sequence_of(project)


def _listed(folder: Path, files: Sequence[Path], spec: SequenceSpec) -> list[Path]:
    """Give the files in the order in which a list names them."""
    if not spec.files:
        seen = "the sequence names no files"
        raise InputError("--order list", seen, "give --sequence a JSON file whose frames have file and pattern")
    there = {path.name: path for path in files}
    missing = [name for name in spec.files if Path(name).name not in there]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise InputError(folder / missing[0], f"is listed and not there{more}", "add it, or correct the list")
    if twice := [name for name in spec.files if spec.files.count(name) > 1]:
        raise InputError(folder / twice[0], "is listed twice", "give every frame its own file")
    return [there[Path(name).name] for name in spec.files]


def _check_count(
    folder: Path, files: Sequence[Path], spec: SequenceSpec, patterns: Sequence[Pattern], lines: tuple[int, int]
) -> None:
    if not files:
        raise InputError(folder, "holds no images", f"give a folder of {', '.join(ENDINGS[:3])} files")
    if len(files) != len(patterns):
        seen = f"holds {len(files)} images, the sequence has {len(patterns)} patterns ({spec.words})"
        remedy = "add or remove frames, or give the --sequence that was shown"
        if (other := like(spec, lines, len(files))) is not None:
            remedy += f"; {other}, for one, has {len(files)}, other periods may have as many"
        raise InputError(folder, seen, remedy)


def _check_images(files: Sequence[Path], images: Sequence[Image], camera: DeviceSpec) -> None:
    first = images[0]
    for path, image in zip(files, images, strict=True):
        if image.shape != (camera.height, camera.width):
            seen = (
                f"{image.shape[1]}x{image.shape[0]} px, the camera in project.json has {camera.width}x{camera.height}"
            )
            raise InputError(path, seen, "give frames of the camera's size, or correct the camera")
        if image.dtype != first.dtype:
            seen = f"{image.dtype}, {files[0].name} is {first.dtype}"
            raise InputError(path, seen, "use one bit depth for all frames")


def _check_twice(
    files: Sequence[Path], images: Sequence[Image], patterns: Sequence[Pattern], lines: tuple[int, int]
) -> None:
    """Refuse one image under two patterns: noise makes every exposure another one."""
    known: dict[int, int] = {}
    for k, image in enumerate(images):
        check = zlib.crc32(image.tobytes())
        other = known.setdefault(check, k)
        if other == k or np.ptp(image) == 0 or not np.array_equal(image, images[other]):
            continue
        if not alike(patterns[k], patterns[other], lines):
            seen = f"the same image as {files[other].name}, for another pattern"
            raise InputError(files[k], seen, "record the frame of each pattern")


def _verified(
    plan: Plan, frames: Sequence[Frame], images: Sequence[Image], lines: tuple[int, int], phase: PhaseMap | None
) -> tuple[Finding, ...]:
    """Give what the checks of stored captures find, and light and sharpness of the stripes."""
    shape = images[0].shape
    at = sample_grid((shape[0], shape[1]))
    bare = replace(plan, guards=())
    grey = np.array([image[at[0], at[1]] for image in images], np.float64)
    sampled = summarise(bare, grey, at, (shape[0], shape[1]), 255 if images[0].itemsize == 1 else int(grey.max()))
    sampled = replace(sampled, noise=max(sampled.noise, noise_of_one(max(images, key=np.mean)[::4].astype(np.float64))))
    capture = Capture(Path(plan.subject.name), plan.subject.role, tuple(frames))
    findings = check_stored(capture, images, phase, lines)
    told = {"light": "modulation"}.get
    checks = {told(f.check, f.check) for f in findings}
    several = len({frame.exposure_ms for frame in frames}) > 1  # what one saturates another sees
    seen = () if several else (modulation(bare, sampled), saturation(sampled))
    light = [f for f in seen if f.check not in checks]
    if phase is not None and _decoded_part(phase, plan.patterns, at[:, sampled.lit]) < DECODES:
        findings += [Finding("order", "warning", note.rstrip(".")) for note in phase.notes]  # a finding is no sentence
    elif not any(f.level == "bad" for f in (*findings, *light)):
        findings.append(Finding("order", "good", "the patterns come in their order"))
    findings += light
    return tuple(sorted(findings, key=lambda f: f.level != "bad"))


def _decoded_part(phase: PhaseMap, patterns: Sequence[Pattern], at: NDArray[np.intp]) -> float:
    """Part of pixels, rows and columns (2, n), that have a coordinate along every axis of the patterns."""
    axes = {axis_of(pattern) for pattern in patterns}
    found = [values[at[0], at[1]] for axis, values in (("x", phase.u), ("y", phase.v)) if axis in axes]
    return float(np.isfinite(found).all(axis=0).mean()) if at.size else 0.0


def _write(target: Path, series: Sequence[_Series], source: str) -> int:
    """Write the frames into a folder beside, then move it to its place; give how many were converted."""
    sweep(target.parent)
    part = target.with_name(f"{part_prefix(target.name)}part")
    entries: list[tuple[str, Pattern]] = []
    more: list[Mapping[str, str | float]] = []
    converted = 0
    frames = [frame for one in series for frame in zip(one.files, one.images, one.plan.patterns, strict=True)]
    try:
        part.mkdir(parents=True)
        for k, (path, image, pattern) in enumerate(frames):
            grey = path.suffix.lower() in KEPT and _is_grey(path)
            entry = f"{k:03d}{path.suffix.lower() if grey else '.png'}"
            if grey:
                shutil.copyfile(path, part / entry)
            else:
                write_image(part / entry, image)
                converted += 1
            entries.append((entry, pattern))
        for one in series:
            exposures = [{} if f.exposure_ms is None else {"exposure_ms": f.exposure_ms} for f in one.frames]
            more += [{**one.plan.devices, **exposure} for exposure in exposures]
        extra = {"imported": {"from": source, "files": [path.name for path, *_ in frames]}}
        write_capture_json(part, series[0].plan.subject, entries, extra=extra, more=more if any(more) else None)
        part.rename(target)
    except OSError as error:
        raise _taken(target) if target.exists() else unwritable(target, error) from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return converted


def _taken(target: Path) -> InputError:
    return InputError(target, "is there already", "choose another name, or remove that capture")


def _unlisted(target: Path, project: Project) -> InputError:
    """Refuse the folder that an import leaves which is killed before its capture is listed."""
    remedy = f"list it with `stripe-core check {project.path} --repair`, choose another name, or remove that folder"
    return InputError(target, "is there already, but project.json does not list it", remedy)


def _is_grey(path: Path) -> bool:
    """Whether a file's pixels have one channel."""
    return (pixels := _pixels(path)) is not None and pixels.ndim == 2


def _pixels(path: Path) -> Image | None:
    """Read a file's pixels with all their channels."""
    return cv2.imdecode(np.frombuffer(regular(path).read_bytes(), np.uint8), cv2.IMREAD_UNCHANGED)


def _dead_colours(files: Sequence[Path]) -> list[Finding]:
    """Say that one colour of some frames never varies while the other two do: light of one colour leaves out two."""
    if _is_grey(files[0]):
        return []
    some = [_pixels(files[k]) for k in spaced(len(files), COLOURED)]
    seen = [p[..., :3].reshape(-1, 3) for p in some if p is not None and p.ndim == 3 and p.shape[2] >= 3]
    if not seen:
        return []
    low, high = np.min([p.min(axis=0) for p in seen], axis=0), np.max([p.max(axis=0) for p in seen], axis=0)
    if np.count_nonzero(low == high) != 1:
        return []
    dead = int(np.argmax(low == high))
    text = (
        f"{('blue', 'green', 'red')[dead]} is {low[dead]} in every pixel of the colour frames: this channel of the "
        "camera is off or lost; record with it, or in grey"
    )
    return [Finding("colour", "warning", text)]
