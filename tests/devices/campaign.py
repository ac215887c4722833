"""`python -m tests.devices.campaign [--random N] [--sequences N]`: faults by the thousand, and what became of them.

First every fault alone: each fault of the serial line at every command of a capture, each fault of the camera at every
shot, with both profiles. Then captures with many faults at random, or sequences by triggers that are lost, doubled and
late: on an emulated timeline, and in real time through the drivers of a DLPC350 and of GenICam. A capture ends right,
refused (a typed error that says what to check), or mislabelled: a listed frame that is not the image of its pattern.
The exit code is 1 if one is.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from core.capture import run_capture
from core.capture.live import Continuous
from core.devices import CAMERA_FAULTS, LINK_FAULTS, TRIGGER_FAULTS, open_devices, open_projector
from core.devices.genicam import GenicamCamera
from core.devices.scene import FlatScene
from core.errors import DeviceError
from core.model import DeviceSpec, Project, Subject
from core.patterns import Black, parse_sequence
from core.project import read_capture, read_image, read_project, write_project
from tests.devices.cabled import Cable, Cabled, Lit
from tests.devices.manuals import plugged

PROFILES = ("stripe-lines", "stripe-frames")
QUICK = "settle_ms=1&answer_ms=15"
COMMANDS = {"stripe-lines": 75, "stripe-frames": 51}  # of one capture of 24 shots without faults
SHOTS = 24
Case = tuple[str, str, str]  # kind, projector URL, camera URL


def make_project(folder: Path) -> Project:
    """Make a project of the flat scene's sizes."""
    write_project(folder, "t", DeviceSpec(96, 72, (0.01, 0.01), 12.0), DeviceSpec(64, 64, (0.09, 0.09), 100.0))
    return read_project(folder)


def outcome(project: Project, name: str, projector: str, camera: str) -> str:
    """Capture, and compare every listed frame with the noise-free image of its pattern: the emulator cannot hide."""
    try:
        folder = run_capture(project, Subject("object", name), projector, camera).folder
    except DeviceError:
        return "refused"
    scene = FlatScene(noise=0.0)
    for frame in read_capture(folder).frames:
        # two different patterns differ by 30 grey values on average, noise of 1 by 0.8
        if np.abs(read_image(frame.path).astype(float) - scene.frame(frame.pattern, 0)).mean() > 1.5:
            return "mislabelled"
    return "right"


def single_link(profile: str, fault: str, at: int) -> Case:
    """One fault of the line at one command."""
    return fault, f"emulated:flat?profile={profile}&{QUICK}&faults={fault}@{at}&fault_seed={at}", "virtual:flat"


def many(seed: int) -> Case:
    """Faults of the line and of the camera at random, 0.3 to 10 % of all commands."""
    rng = random.Random(seed)
    rate = 10 ** rng.uniform(-2.5, -1.0)
    link = ",".join(f"{name}:{2 * rate * rng.random() / len(LINK_FAULTS):.5f}" for name in LINK_FAULTS)
    camera = ",".join(f"{name}:{0.2 * rate * rng.random():.5f}" for name in CAMERA_FAULTS)
    projector = f"emulated:flat?profile={PROFILES[seed % 2]}&{QUICK}&faults={link}&fault_seed={seed}"
    return "at random", projector, f"virtual:flat?faults={camera}&fault_seed={seed}"


PERIOD = "period_ms=8"  # 125 patterns a second
TRIGGERED = {  # which device triggers the other: projector URL, camera URL
    "projector, virtual": (f"virtual:flat?{PERIOD}", "virtual:flat?"),
    "camera, virtual": ("virtual:flat", f"virtual:flat?{PERIOD}&"),
    "projector, emulated": (f"emulated:flat?{PERIOD}&settle_ms=1&answer_ms=2000", "virtual:flat?"),
    "camera, emulated": ("emulated:flat?settle_ms=1&answer_ms=2000", f"virtual:flat?{PERIOD}&"),
}


CABLED = {  # the same in real time, over a pseudo-terminal and through a producer: options of the camera
    "projector, DLPC350": {"line": "Line1"},
    "camera, DLPC350": {"lead": "Line2", "lead_period_s": 1 / 120},
}
Wrongs = tuple[Callable[[float], None], Callable[[], int]]  # sets the rate of wrong triggers; how many there were


@contextmanager
def by_urls(project: Project, setup: str, seed: int) -> Iterator[tuple[Continuous, Wrongs]]:
    """Open devices on an emulated timeline, on which nobody waits."""
    url, camera_url = TRIGGERED[setup]
    with open_devices(url, f"{camera_url}faults=lost-trigger:0&fault_seed={seed}") as (projector, camera):
        camera.stage.patient = False  # type: ignore[attr-defined]
        faults = camera.faults  # type: ignore[attr-defined]

        def at(rate: float) -> None:
            faults.rates = dict.fromkeys(TRIGGER_FAULTS, rate / len(TRIGGER_FAULTS))

        yield Continuous(project, projector, {"camera": camera}), (at, lambda: len(faults.committed))


@contextmanager
def by_cable(project: Project, setup: str, seed: int) -> Iterator[tuple[Continuous, Wrongs]]:
    """Open a DLPC350 and a GenICam camera with a trigger cable between them."""
    sequence, scene = parse_sequence("paper").patterns((64, 64)), FlatScene()
    planes = {(slot // 24, slot % 24): scene.frame(pattern, seed) for slot, pattern in enumerate(sequence)}
    dark, cable = scene.frame(Black(), seed), Cable(seed)
    device = Lit(cable)
    producer = Cabled(device, cable, lambda plane: planes.get(plane, dark))
    with plugged(device) as port, closing(GenicamCamera("A1", harvester=producer, **CABLED[setup])) as camera:
        url = f"serial:{port}?profile=lightcrafter4500&columns=64&rows=64&settle_ms=1"
        with closing(open_projector(url)) as projector:
            rates = partial(setattr, cable, "rate")
            yield Continuous(project, projector, {"camera": camera}), (rates, lambda: cable.wrong)


def triggered(project: Project, setup: str, count: int, seed: int) -> Counter[str]:
    """Take sequences with lost, doubled and late triggers, 0.1 to 3 % of all."""
    rng, counts, scene = random.Random(seed), Counter[str](), FlatScene(noise=0.0)
    opened = by_cable if setup in CABLED else by_urls
    with opened(project, setup, seed) as (rig, (at, wrong)):
        wanted = [scene.frame(pattern, 0).astype(float) for pattern in rig.plan.patterns]
        for _ in range(count):
            at(10 ** rng.uniform(-3.0, -1.5))
            before = wrong()
            try:
                taken = rig.take()
                worst = max(np.abs(i - w).mean() for i, w in zip(taken.images["camera"], wanted, strict=True))
                counts["mislabelled" if worst > 1.5 else "right"] += 1
                counts["taken again"] += taken.retakes
            except DeviceError:
                counts["refused"] += 1
            counts["wrong triggers"] += wrong() - before
            counts["sequences with any"] += wrong() > before
    return counts


def triggers(whole: int, seed: int, setups: Sequence[str]) -> int:
    """Print what became of so many sequences by triggers; give the exit code."""
    wrong, count = 0, -(-whole // len(setups))
    columns = ("right", "refused", "mislabelled", "wrong triggers", "sequences with any", "taken again")
    print(f"{'who triggers':20s} {'sequences':>10s} " + " ".join(f"{name:>18s}" for name in columns) + "   CPU s")
    for setup in setups:
        begun = time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            result = triggered(make_project(Path(folder)), setup, count, seed)
        figures = " ".join(f"{result[name]:18d}" for name in columns)
        print(f"{setup:20s} {count:10d} {figures} {time.process_time() - begun:7.0f}", flush=True)
        wrong += result["mislabelled"]
    return 1 if wrong else 0


def every_fault_alone() -> Iterator[Case]:
    """Every fault at every place."""
    for profile in PROFILES:
        for fault in LINK_FAULTS:
            for at in range(COMMANDS[profile]):
                yield single_link(profile, fault, at)
        for fault in CAMERA_FAULTS:
            for at in range(SHOTS):
                yield fault, f"emulated:flat?profile={profile}&{QUICK}", f"virtual:flat?faults={fault}@{at}"


def main() -> int:
    """Run the campaign and print what became of it."""
    parser = argparse.ArgumentParser(prog="tests.devices.campaign", description=__doc__)
    parser.add_argument("--random", type=int, default=0, metavar="N", help="captures with faults at random instead")
    parser.add_argument("--sequences", type=int, default=0, metavar="N", help="sequences by triggers, of all setups")
    parser.add_argument(
        "--only", choices=("timeline", "cable"), help="of these, on an emulated timeline or in real time"
    )
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of the first of them")
    options = parser.parse_args()
    start = time.monotonic()
    if options.sequences:
        setups = {"timeline": TRIGGERED, "cable": CABLED, None: {**TRIGGERED, **CABLED}}[options.only]
        return triggers(options.sequences, options.seed, list(setups))
    cases = [many(options.seed + i) for i in range(options.random)] if options.random else list(every_fault_alone())
    counts: Counter[tuple[str, str]] = Counter()
    longest = 0.0
    for i, (kind, projector, camera) in enumerate(cases):
        with tempfile.TemporaryDirectory() as folder:
            begun = time.monotonic()
            result = outcome(make_project(Path(folder)), "a", projector, camera)
            longest = max(longest, time.monotonic() - begun)
        counts[kind, result] += 1
        if result == "mislabelled" or (result == "refused" and not options.random):
            print(f"{result}: {projector}  {camera}", flush=True)
        if (i + 1) % 100 == 0:
            print(f"{i + 1} of {len(cases)} after {time.monotonic() - start:.0f} s", file=sys.stderr, flush=True)
    for (kind, result), count in sorted(counts.items()):
        print(f"{kind:20s} {result:12s} {count:6d}")
    totals = Counter[str]()
    for (_, result), count in counts.items():
        totals[result] += count
    words = ", ".join(f"{totals[r]} {r}" for r in ("right", "refused", "mislabelled"))
    print(f"{len(cases)} captures: {words}; the longest took {longest:.1f} s; {time.monotonic() - start:.0f} s in all")
    return 1 if totals["mislabelled"] else 0


if __name__ == "__main__":
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    raise SystemExit(main())
