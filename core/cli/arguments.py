"""What the commands of every group share: how they are declared, common arguments, checks of places to write."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from core.errors import InputError, StripeError
from core.progress import Progress

if TYPE_CHECKING:
    from core.model import Subject
    from core.patterns import SequenceSpec

Options = argparse.Namespace
Run = Callable[[Options, Progress], dict[str, Any] | None]  # gives the figures that `--json` writes


class UnfinishedError(StripeError):
    """Work that failed (exit code 1), but has figures that say where."""

    def __init__(self, figures: dict[str, Any], where: object, seen: str, remedy: str) -> None:
        super().__init__(where, seen, remedy)
        self.figures = figures


class Parser(argparse.ArgumentParser):
    """A parser whose refusals look like all others."""

    def error(self, message: str) -> NoReturn:
        """Refuse the arguments."""
        raise InputError("arguments", message, f"see `{self.prog} --help`")


class Unasked(Parser):
    """Stands for a command that is not run: 35 parsers take longer to make than many a command takes to run."""

    def __init__(self) -> None:
        pass

    def add_argument(self, *_: Any, **__: Any) -> Any:
        """Leave it out."""

    def set_defaults(self, **_: Any) -> None:
        """Leave them out."""


class Commands:
    """The commands of the program, to which every group adds its own; or one of them alone."""

    def __init__(self, parser: Parser, only: str | None = None) -> None:
        self._parsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True, parser_class=Parser)
        self._only = only

    def __bool__(self) -> bool:
        return bool(self._parsers.choices)

    def add(self, name: str, run: Run, text: str) -> Parser:
        """Declare a command: its name, what it runs and one line of help; give the parser for its arguments."""
        if self._only not in (None, name):
            return Unasked()
        parser: Parser = self._parsers.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
        parser.set_defaults(run=run)
        words = "write the figures, to standard output without FILE"
        parser.add_argument("--json", metavar="FILE", nargs="?", const="-", help=words)
        return parser

    def add_on_folder(self, name: str, run: Run, text: str) -> Parser:
        """Declare a command whose first argument is a project's folder, `options.project`."""
        parser = self.add(name, run, text)
        parser.add_argument("project", type=Path, metavar="PROJECT")
        return parser

    def add_on_project(self, name: str, run: Run, text: str) -> Parser:
        """Declare a command whose first argument is a project, which is read before it runs."""

        def run_on(options: Options, progress: Progress) -> dict[str, Any] | None:
            from core.project import read_project

            options.project = read_project(options.project)
            return run(options, progress)

        return self.add_on_folder(name, run_on, text)


def add_devices(parser: Parser) -> None:
    """Declare the choice of a camera and a projector."""
    parser.add_argument("--camera", default="", metavar="NAME", help="which camera, if a capture has several")
    parser.add_argument("--projector", default="", metavar="NAME", help="which projector, if a capture has several")


def tell_devices(options: Options, camera: str, projector: str) -> None:
    """Say whose figures they are where others could be meant."""
    if not (options.project.rig.is_pair or (options.camera and options.projector)):
        print(f"of {camera} with {projector}; --camera and --projector choose others")


def add_subject(parser: Parser) -> None:
    """Declare what a new capture is of."""
    parser.add_argument("name", metavar="NAME")
    parser.add_argument("--role", required=True, choices=("testfield", "depth", "plane", "object"))
    parser.add_argument("--testfield", metavar="CSV", help="the board, for roles testfield and depth")
    parser.add_argument("--z-mm", type=float, help="position of the plate, for role depth")
    parser.add_argument("--angle-deg", type=float, help="angle of the plane-table, for role plane")
    sequence_argument(parser)


def chosen_subject(options: Options, camera: str = "", projector: str = "") -> Subject:
    """Read what a new capture is of, and refuse a position of what has none."""
    from core.model import Subject

    for option, value, role in (("--z-mm", options.z_mm, "depth"), ("--angle-deg", options.angle_deg, "plane")):
        if value is not None and options.role != role:
            raise InputError(option, f"{value:g}, with role {options.role}", f"it is for role {role}: leave it out")
    where = (options.z_mm, options.angle_deg, options.testfield)
    return Subject(options.role, options.name, *where, camera, projector)


def add_urls(parser: Parser) -> None:
    """Declare the URLs of a projector and of cameras, for `named_url` and `camera_urls`."""
    parser.add_argument("--projector", metavar="URL", help="virtual, serial, screen, ...; one of several as NAME=URL")
    words = "virtual, folder, replay, uvc, ...; for several cameras repeat it with NAME=URL"
    parser.add_argument("--camera", metavar="URL", action="append", default=[], help=words)


def named_url(given: str) -> tuple[str, str]:
    """Split NAME=URL; the name is empty where only a URL is given, whose options may hold an equals sign, too."""
    name, sep, url = given.partition("=")
    return (name, url) if sep and ":" not in name else ("", given)


def camera_urls(given: list[str]) -> str | dict[str, str] | None:
    """One camera's URL, or those of several by their names in the rig."""
    split = [named_url(url) for url in given]
    if all(name for name, _ in split):
        return dict(split) or None
    if len(given) > 1:
        raise InputError("--camera", " ".join(given), "name each of several in the rig: --camera NAME=URL")
    return given[0]


def method_name(name: str, *others: str) -> str:
    """Refuse the name of a method that is not known."""
    from core.pipeline import METHODS

    if name not in (known := [*METHODS, *others]):
        raise argparse.ArgumentTypeError(f"{name!r} is unknown: choose among {', '.join(known)}")
    return name


def sequence_argument(parser: Parser) -> None:
    """Declare the choice of a sequence."""
    words = "a preset, such as gray-sine or gray-sine:period=24,steps=8, or a JSON file of patterns"
    parser.add_argument("--sequence", metavar="S", help=words)


def chosen_sequence(options: Options) -> SequenceSpec | None:
    """Read the sequence that a command was given; None if it was given none."""
    from core.patterns import parse_sequence

    return None if options.sequence is None else parse_sequence(options.sequence)


def check_out(path: Path, *endings: str) -> None:
    """Refuse a result's file that cannot be written before the work begins."""
    from core.atomic import check_place

    if path.suffix.lower() not in endings:
        raise InputError(path, f"ends in {path.suffix!r}", f"give a file name ending in {' or '.join(endings)}")
    check_place(path)


def write_figures(target: str, figures: dict[str, Any]) -> None:
    """Write what `--json` asks for, - for standard output."""
    import json

    from core.atomic import write_json
    from core.project.made import among_results, guarding

    if target == "-":
        print(json.dumps(figures, indent=1, ensure_ascii=False, allow_nan=False))
        return
    with guarding(Path(target)) if among_results(Path(target)) else nullcontext():
        write_json(Path(target), figures)
