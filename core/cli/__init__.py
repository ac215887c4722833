"""The command line: parse, call the pipeline, print. Nothing heavy is imported before a command needs it.

`commands` holds the commands in groups, a file each; a new group is one file and its name in `GROUPS`.
"""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
import time
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext, redirect_stdout, suppress
from pathlib import Path
from types import FrameType
from typing import Any

import core
from core.cli.arguments import Commands, Options, Parser, UnfinishedError, write_figures
from core.cli.commands import beginning, exchange, experiment, recording, results, road, state, watching
from core.cli.console import Console, Unread
from core.errors import Cancelled, InputError, StripeError
from core.progress import Progress
from core.starting import ENDING, end_at_once

GROUPS = (experiment, beginning, recording, road, results, state, watching, exchange)
# of glibc's mallopt: bytes at the end of the heap that are given back, that are asked for at once, and of an array from
# which it is no part of the heap
_HEAP = {-1: 128 << 20, -2: 8 << 20, -3: 32 << 20}
_ended = 0  # by which signal


def run() -> None:
    """Run one command, and end without taking all its objects down one by one.

    Who ends the program by a signal has it end as by Ctrl-C: in one line, with nothing half written, no lock held.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # it was closed
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115  to the end
    sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]  # as on stderr: σ is not in all codes
    usual = (signal.SIG_DFL, signal.default_int_handler, end_at_once)  # nohup's is left alone
    heard = [number for number in ENDING if signal.getsignal(number) in usual]
    for number in heard:
        signal.signal(number, _end)
    gc.set_threshold(20_000)  # imports leave few cycles to look for: 4 to 10 % less time, no more memory
    code = main()
    for number in heard:
        signal.signal(number, signal.SIG_IGN)
    atexit._run_exitfuncs()
    with suppress(OSError):  # who read the output has gone
        sys.stdout.flush()
    os._exit(code)


def _end(number: int, frame: FrameType | None) -> None:
    """End the command from where it is; a second signal must not disturb the tidying up."""
    global _ended
    signal.signal(number, signal.SIG_IGN)
    _ended = number
    # a finalizer or a hook of fork() may swallow it: no word on that, see `_not_ended`
    sys.unraisablehook = lambda _: None
    raise KeyboardInterrupt(number)


def _not_ended() -> bool:
    """End the command here if it should have ended before: what calls back from C, or goes, swallows exceptions."""
    if _ended:
        raise KeyboardInterrupt(_ended)
    return False


def _parsed(given: list[str]) -> Any:
    """Read the arguments; names of captures may follow options, which argparse itself takes for too many."""
    of = parser(*given[:1])
    options, further = of.parse_known_args(given)
    if further and (not hasattr(options, "captures") or any(word.startswith("-") for word in further)):
        of.error(f"unrecognized arguments: {' '.join(further)}")
    if further:
        options.captures = [*options.captures, *further]
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; give the exit code: 0 done, 2 bad input, 1 the work failed, 128 + the signal that ended it."""
    started = time.monotonic()
    # the threads of the linear algebra would only spin beside our own; numpy looks here once, when it is imported
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    console = Console(started)
    try:
        given = sys.argv[1:] if arguments is None else list(arguments)
        options = _parsed(given)
        if options.json not in (None, "-"):
            _check_json(Path(options.json), getattr(options, "out", None))
        with _guarded(options), _told(options.json):
            figures, failure = _worked(options, Progress(console.report, _not_ended))
            sys.stdout.flush()
        console.clear()
        if options.json is not None:
            write_figures(options.json, figures or {})
        sys.stdout.flush()
        if failure is not None:
            raise failure
        return 0
    except StripeError as error:
        console.clear()
        print(f"stripe-core: {error}", file=sys.stderr)
        return error.exit_code
    except BrokenPipeError:  # who read the output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        console.clear()
        where, seen = error.filename or "the work", error.strerror or str(error)
        print(f"stripe-core: {StripeError(where, seen, 'see to the disk and run it again')}", file=sys.stderr)
        return 1
    except MemoryError:
        console.clear()
        print(f"stripe-core: {StripeError('the work', 'out of memory', 'free some and run it again')}", file=sys.stderr)
        return 1
    except (KeyboardInterrupt, Exception) as ended:
        number = _ended or (*ended.args, signal.SIGINT)[0] if isinstance(ended, KeyboardInterrupt) else _ended
        if not number:  # otherwise an import or a finalizer made its own error of the end
            raise
        console.clear()
        print(f"stripe-core: {Cancelled('the command')}", file=sys.stderr)
        return 128 + number


def parser(only: str | None = None) -> Parser:
    """Make the parser of all commands, or of one alone if there is one of that name."""
    whole = Parser(prog="stripe-core", description="Decode, calibrate, reconstruct and evaluate stripe projectors.")
    whole.add_argument(
        "--version", action="version", version=f"%(prog)s {core.__version__}", help="say the version and end"
    )
    commands = Commands(whole, only)
    for group in GROUPS:
        group.add(commands)
    return whole if commands else parser()


def _guarded(options: Options) -> AbstractContextManager[None]:
    """Replace in the place that ``--out`` names only what this program wrote there and nobody changed."""
    out = getattr(options, "out", None)
    if out is None:
        return nullcontext()
    from core.project.made import guarding

    return guarding(out, beside=getattr(options, "beside", False))


def _keep_freed() -> None:
    """Have the C library keep what arrays leave for the next ones: the kernel clears every page that it gives anew."""
    if sys.platform == "linux":
        from ctypes import CDLL

        library = CDLL(None)
        with suppress(AttributeError):  # another one than glibc
            for what, size in _HEAP.items():
                library.mallopt(what, size)


def _worked(options: Options, progress: Progress) -> tuple[dict[str, Any] | None, UnfinishedError | None]:
    """Run a command: its figures, and its failure where it has both."""
    _keep_freed()
    try:
        return options.run(options, progress), None
    except UnfinishedError as failure:
        return failure.figures, failure


def _told(figures: str | None) -> AbstractContextManager[object]:
    """Let a command's words stay clear of its figures: where these go to standard output, words go to stderr."""
    if figures is None:
        return nullcontext()
    return redirect_stdout(sys.stderr if figures == "-" else Unread(sys.stdout))


def _check_json(path: Path, out: Path | None) -> None:
    """Refuse a file for the figures that cannot be written before anything else is."""
    from core.atomic import check_place
    from core.project.made import among_results, claim

    check_place(path)
    if out is not None and os.path.realpath(out) == os.path.realpath(path):
        raise InputError("--json", f"is {path}, as --out is", "give two names")
    if among_results(path):
        claim(path)
    elif path.is_file() and path.stat().st_size:
        with path.open("rb") as file:
            start = file.read(200).lstrip()
        if not start.startswith(b"{") or b'"stripe-' in start.replace(b'"stripe-batch"', b""):
            raise InputError(path, "is there already and holds no figures", "give another name, or move that file away")
