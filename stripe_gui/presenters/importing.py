"""Frames that came from elsewhere: what a folder holds, and making a capture of them."""

from __future__ import annotations

from pathlib import Path

from core.capture.importing import ImportReport, frames_in, sequence_beside
from core.errors import InputError
from core.lazy import dataclass
from core.model import DeviceSpec, Project
from core.patterns import Pattern
from core.project import read_image
from stripe_gui.presenters.sequences import sequence_text
from stripe_gui.presenters.told import sentence, translate


@dataclass(frozen=True)
class FrameFolder:
    """What a folder holds; `own` is the sequence where none is chosen, `problem` says why it cannot be imported."""

    images: int = 0
    words: str = ""
    own: tuple[Pattern, ...] = ()
    problem: str = ""


def look_in(folder: str, project: Project, projector: DeviceSpec) -> FrameFolder:
    """Say what images a folder holds, and which sequence they show as far as the folder or the project says."""
    path = Path(folder.strip()).expanduser()
    if not folder.strip() or not path.is_dir():
        return FrameFolder(problem=translate("Importing", "Choose the folder that holds the images."))
    files = frames_in(path)
    if not files:
        return FrameFolder(problem=translate("Importing", "There are no images (PNG, TIFF, BMP, JPEG) in this folder."))
    try:
        height, width = read_image(files[0]).shape
    except InputError as error:
        return FrameFolder(problem=f"{error}.")
    text = translate("Importing", "{n} images, {first} to {last}, {w} × {h} px.")
    words = [text.format(n=len(files), first=files[0].name, last=files[-1].name, w=width, h=height)]
    own: tuple[Pattern, ...] = ()
    try:
        spec = sequence_beside(path, project)
        own = spec.patterns((projector.width, projector.height))
        text = translate("Importing", "Unless another is chosen they show: {sequence}, {n} patterns.")
        words.append(text.format(sequence=sequence_text(spec), n=len(own)))
    except InputError as error:
        words.append(f"{sentence(error.seen)}.")
    return FrameFolder(len(files), " ".join(words), own)


def order_choices() -> tuple[tuple[str | None, str], ...]:
    """Give the ways to tell which image shows which pattern."""
    return (
        (None, translate("Importing", "as the list of patterns names the files, else by name")),
        ("name", translate("Importing", "by the files' names, numbers counted")),
        ("content", translate("Importing", "found from the images themselves")),
    )


def report_lines(report: ImportReport) -> list[str]:
    """Say what was imported, and what was recognised, a sentence each."""
    orders = {
        "name": translate("Importing", "in the order of their names"),
        "list": translate("Importing", "as the list names them"),
        "content": translate("Importing", "in the order found from the images"),
    }
    text = translate("Importing", "{n} frames are in {folder}, {order}.")
    first = text.format(n=report.frames, folder=report.folder, order=orders[report.order])
    more = report.words[: len(report.words) - len(report.findings)]  # the findings stand by themselves
    lines = [first, *(f"{sentence(words)}." for words in more)]
    if any(finding.level == "bad" for finding in report.findings):
        lines.append(
            translate("Importing", "The images do not show this sequence: see what the checks found, and try another.")
        )
    return lines
