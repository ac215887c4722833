"""A command that is ended while its parts are still loaded ends in one line, too. Imported before all else."""

import os
import signal
import sys

ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP", "SIGINT") if hasattr(signal, name)]


def is_command() -> bool:
    """Whether this process was started as `stripe-core` or `python -m core`, and is no worker of one."""
    given = sys.orig_argv[1:3]
    return given == ["-m", "core"] or os.path.basename("".join(given[:1])) == "stripe-core"


def listen() -> None:
    """End at once by any of the signals that end a command; nohup's is left alone."""
    for number in ENDING:
        if signal.getsignal(number) in (signal.SIG_DFL, signal.default_int_handler):
            signal.signal(number, end_at_once)


def end_at_once(number: int, frame: object) -> None:
    """End in the words of `core.errors.Cancelled`, which may not be there yet.

    Nothing is open; whatever import it is in, no error is made of it.
    """
    os.write(2, b"stripe-core: the command: cancelled; start it again when you want the result\n")
    os._exit(128 + number)
