"""`python -m tests.devices.campaign [--random N] [--triggered N]`: faults by the thousand, and what became of them.

First every fault alone: each fault of the serial line at every command of a capture, each fault of the camera at every
shot, with both profiles. Then captures with many faults at random. A capture ends right, refused (a typed error that
says what to check), or mislabelled: a listed frame that is not the image of its pattern. The exit code is 1 if one is.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from core.capture import run_capture
from core.capture.live import Continuous
from core.devices import CAMERA_FAULTS, LINK_FAULTS, TRIGGER_FAULTS, open_devices
from core.devices.scene import FlatScene
from core.errors import DeviceError
from core.model import DeviceSpec, Project, Subject
from core.project import read_capture, read_image, read_project, write_project

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


def triggered(project: Project, setup: str, count: int, seed: int) -> Counter[str]:
    """Take sequences with lost, doubled and late triggers, 0.1 to 3 % of all, nobody waiting."""
    rng, counts, scene = random.Random(seed), Counter[str](), FlatScene(noise=0.0)
    url, camera_url = TRIGGERED[setup]
    with open_devices(url, f"{camera_url}faults=lost-trigger:0&fault_seed={seed}") as (projector, camera):
        camera.stage.patient = False  # type: ignore[attr-defined]
        faults = camera.faults  # type: ignore[attr-defined]
        rig = Continuous(project, projector, camera)
        wanted = [scene.frame(pattern, 0).astype(float) for pattern in rig.plan.patterns]
        for _ in range(count):
            faults.rates = dict.fromkeys(TRIGGER_FAULTS, 10 ** rng.uniform(-3.0, -1.5) / len(TRIGGER_FAULTS))
            faults.committed.clear()
            try:
                taken = rig.take()
                worst = max(np.abs(i - w).mean() for i, w in zip(taken.images, wanted, strict=True))
                counts["mislabelled" if worst > 1.5 else "right"] += 1
                counts["taken again"] += taken.retakes
            except DeviceError:
                counts["refused"] += 1
            counts["wrong triggers"] += len(faults.committed)
            counts["sequences with any"] += bool(faults.committed)
    return counts


def triggers(count: int, seed: int) -> int:
    """Print what became of sequences by triggers; give the exit code."""
    wrong = 0
    columns = ("right", "refused", "mislabelled", "wrong triggers", "sequences with any", "taken again")
    print(f"{'who triggers':20s} {'sequences':>10s} " + " ".join(f"{name:>18s}" for name in columns) + "   CPU s")
    for setup in TRIGGERED:
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
    parser.add_argument("--triggered", type=int, default=0, metavar="N", help="sequences by triggers, of each setup")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of the first of them")
    options = parser.parse_args()
    start = time.monotonic()
    if options.triggered:
        return triggers(options.triggered, options.seed)
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
