"""The desktop program: `stripe-gui [PROJECT]`."""

from __future__ import annotations

import argparse
import os
import socket
import sys
import threading
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path


def main(arguments: Sequence[str] | None = None) -> int:
    """Start the program; give the exit code, 2 where it cannot be started here."""
    options = _parser().parse_args(arguments)
    if options.tour is not None:
        os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    problem = display_problem(os.environ, sys.platform)
    if problem and options.patterns is not None:
        problem = problem.partition(";")[0]  # the command that does without a window has asked for one
    problem = problem or library_problem(os.environ, sys.platform)
    if problem:
        print(f"stripe-gui: {problem}", file=sys.stderr)
        return 2
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # its threads would only spin beside our own
    try:
        if options.patterns is not None:
            from PySide6.QtWidgets import QApplication

            from stripe_gui.garbage import collected_here
            from stripe_gui.screens import Screens

            app = QApplication(["stripe-gui"])
            with collected_here():
                Screens().serve(options.patterns)
            del app
            return 0
        from stripe_gui.app import Program, make_application
        from stripe_gui.garbage import collected_here
    except ImportError as error:
        print(
            f"stripe-gui: {error}; install the window's packages: pip install 'stripe-workbench[gui]'", file=sys.stderr
        )
        return 2
    if options.tour is not None:
        from stripe_gui.tour import tour

        return tour(options.tour, options.project)
    application = make_application()
    with collected_here():
        program = Program(application)
        program.watch_faults()
        program.heed_signals()
        program.window.show()
        threading.Thread(target=_warm_up, daemon=True).start()
        if options.project is not None:
            program.window.open_path(options.project)
        return program.run()


def _warm_up() -> None:
    """Import what opening a project needs, while the operator reads the first page."""
    for name in ("presenters.status", "pages.capture_page"):
        import_module(f"stripe_gui.{name}")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="stripe-gui", description="Calibrate and judge stripe projectors, in a window. Without one: stripe-core."
    )
    parser.add_argument("project", nargs="?", type=Path, metavar="PROJECT", help="a project folder to open")
    parser.add_argument("--tour", type=Path, metavar="DIR", help="write a picture of every page and end")
    # what `stripe-core capture --projector screen:NUMBER` starts, and speaks to
    parser.add_argument("--patterns", type=int, metavar="NUMBER", help=argparse.SUPPRESS)
    return parser


def display_problem(environment: Mapping[str, str], platform: str) -> str:
    """Say why no window can be shown here, empty if one can: Qt itself would abort the process."""
    if environment.get("QT_QPA_PLATFORM") or not platform.startswith("linux"):
        return ""
    elsewhere = "; the command `stripe-core` does the same work without a window"
    wayland, x11 = environment.get("WAYLAND_DISPLAY", ""), environment.get("DISPLAY", "")
    if wayland and (Path(environment.get("XDG_RUNTIME_DIR", "/")) / wayland).exists():
        return ""
    if not (x11 or wayland):
        return "there is no display (DISPLAY and WAYLAND_DISPLAY are not set)" + elsewhere
    if not x11 or not _x11_answers(x11):
        return f"the display {x11 or wayland!r} does not answer" + elsewhere
    return ""


def library_problem(environment: Mapping[str, str], platform: str) -> str:
    """Name all libraries of the system that Qt would miss, empty if there are none: Qt names one, and aborts."""
    if not platform.startswith("linux"):
        return ""
    from stripe_gui.libraries import missing_libraries, packages

    missing = missing_libraries(environment)
    if not missing:
        return ""
    return f"Qt needs {', '.join(missing)}; on Debian and Ubuntu: sudo apt-get install {' '.join(packages(missing))}"


def _x11_answers(display: str) -> bool:
    """Whether something listens where DISPLAY points ("[host]:number[.screen]")."""
    host, _, rest = display.rpartition(":")
    number = rest.split(".")[0]
    if not number.isdigit():
        return False
    try:
        if host in ("", "unix"):
            for name in (f"\0/tmp/.X11-unix/X{number}", f"/tmp/.X11-unix/X{number}"):
                with socket.socket(socket.AF_UNIX) as link:
                    link.settimeout(2)
                    if link.connect_ex(name) == 0:
                        return True
            return False
        with socket.create_connection((host, 6000 + int(number)), timeout=2):
            return True
    except OSError:
        return False


if __name__ == "__main__":
    sys.exit(main())
