"""`python -m tests.devices.tables`: every profile against the device written from its manual, and latencies found.

All commands of a profile are given once to the device; then again while every second answer is lost, cut short, or has
one bit wrong. Latencies of a screen that were put in are set beside those found by flashes, on an emulated timeline.
The triggered sequences have a command of their own, `python -m tests.devices.campaign --sequences 10000`, and so have
versions and Python, `python packaging/versions.py`.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

from core.capture.probe import questions
from core.devices.line.dialogue import Dialogue
from core.devices.line.profiles import read_profile
from core.errors import DeviceError
from core.resources import resource
from tests.devices.manuals import Device, Dlpc350, Dlpc350OverI2c, Modbus, Optoma, plugged
from tests.devices.presenters import Dlpc900, Epson, Hitachi, Nec, Panasonic, Pjlink, Sony
from tests.devices.test_screen_latency import Clock, measured

DEVICES: dict[str, Callable[[], Device]] = {
    "optoma": Optoma,
    "epson": Epson,
    "nec": Nec,
    "hitachi": Hitachi,
    "panasonic": Panasonic,
    "sony": Sony,
    "pjlink": Pjlink,
    "modbus": lambda: Modbus(patterns=28),
    "lightcrafter4500": Dlpc350,
    "lightcrafter4500-i2c": Dlpc350OverI2c,
    "lightcrafter6500": Dlpc900,
}
SPOILT: dict[str, Callable[[bytes], bytes]] = {
    "": bytes,
    "lost": lambda data: b"",
    "cut": lambda data: data[: len(data) // 2],
    "one bit": lambda data: bytes([data[0] ^ 4]) + data[1:],
}
QUICK = {"answer_ms": 100, "every_ms": 1, "gap_ms": 8, "pause_ms": 0, "within_ms": 2000, "retries": 4}


def quick(text: str) -> str:
    """Give a profile that waits for no lamp, and no parity, which a pseudo-terminal has not."""
    lines = []
    for line in text.splitlines():
        key = line.partition("=")[0].strip()
        lines.append(f"{key} = {QUICK[key]}" if key in QUICK else line.replace('parity = "even"', ""))
    return "\n".join(lines)


def tried(name: str, spoilt: str, folder: Path) -> tuple[int, int, int, int]:
    """Give a profile's commands to its device: those understood, of how many; repetitions, of how many questions."""
    path = folder / f"{name}.toml"
    path.write_text(quick(resource("profiles", f"{name}.toml").read_text(encoding="utf-8")))
    device, answers, understood = DEVICES[name](), [0], 0

    def spoil(data: bytes) -> bytes:
        answers[0] += 1
        return SPOILT[spoilt](data) if spoilt and answers[0] % 2 == 0 else data

    device.spoil = spoil
    profile = read_profile(str(path))
    with plugged(device) as port:
        talk = Dialogue(port, profile)
        asked = list(questions(profile))
        for command, values in asked:
            try:
                talk.do(command, **values)
                understood += 1
            except DeviceError as error:
                print(f"{name}, {spoilt or 'undisturbed'}: {error}", file=sys.stderr)
        repeats, put = talk.repeats, talk.asked
        talk.close()
    return understood, len(asked), repeats, put


def latencies() -> list[tuple[float, float, float, float, float]]:
    """Give latency and jitter put in, those found, and the sigma of the latency, in ms."""
    rows = []
    for latency_ms, jitter_ms in ((0.0, 0.0), (25.0, 0.0), (48.0, 3.0), (90.0, 8.0), (250.0, 5.0)):
        clock = Clock()
        with patch.object(time, "monotonic", clock), patch.object(time, "sleep", clock.sleep):
            found = measured(latency_ms / 1000, jitter_ms / 1000, 5, 20)
        rows.append((latency_ms, jitter_ms, *(1000 * s for s in (found.mean_s, found.sigma_s, found.jitter_s))))
    return rows


def main() -> int:
    """Print the tables; the exit code is 1 if a command was not understood."""
    wrong = 0
    print(f"{'profile':22s} {'device':16s} " + " ".join(f"{name or 'undisturbed':>24s}" for name in SPOILT))
    for name, make in DEVICES.items():
        cells = []
        for spoilt in SPOILT:
            with tempfile.TemporaryDirectory() as folder:
                understood, whole, repeats, put = tried(name, spoilt, Path(folder))
            cells.append(f"{understood} of {whole}" + (f", {repeats} of {put} again" if repeats else ""))
            wrong += whole - understood
        print(f"{name:22s} {type(make()).__name__:16s} " + " ".join(f"{cell:>24s}" for cell in cells), flush=True)
    print(f"\n{'latency in, ms':>14s} {'jitter in':>10s} {'latency found':>18s} {'jitter found':>13s}")
    for latency, jitter, found, sigma, spread in latencies():
        print(f"{latency:14.1f} {jitter:10.1f} {found:10.1f} ± {sigma:5.1f} {spread:13.1f}")
    return 1 if wrong else 0


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    raise SystemExit(main())
