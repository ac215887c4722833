"""Commands that write, killed or failed by the disk at their n-th call that changes the disk: nothing is lost.

The moment is chosen by number, anew each day, not by the clock. By default a few commands meet one moment each; with
``STRIPE_MANY=20`` all of them meet twenty.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import zlib
from collections.abc import Callable, Iterator
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from core.cli import main
from core.project.contents import hash_file
from tests.copies import copied

MANY = int(os.environ.get("STRIPE_MANY", "1"))
FEWEST = 7  # calls that every one of these commands makes
CAPTURE = "object-sphere"


def frames_beside(folder: Path) -> None:
    """Frames and their list in a folder outside of the project, for import-frames."""
    shutil.copytree(folder / "captures" / CAPTURE, folder.parent / "frames")


def outdated(folder: Path) -> None:
    """The scale bar is another one: what follows is to be done anew."""
    document = json.loads((folder / "project.json").read_text())
    document["scale"]["sigma_mm"] = 0.006
    (folder / "project.json").write_text(json.dumps(document))


def moved(folder: Path) -> None:
    """A pick was moved: the targets are to be measured anew."""
    picks = folder / "captures" / "testfield-01" / "picks.json"
    document = json.loads(picks.read_text())
    document["seeds"][0]["u"] += 0.1
    picks.write_text(json.dumps(document))


def nothing(folder: Path) -> None:
    pass


def exported(folder: Path) -> None:
    """The calibration as another program's file."""
    assert main(["export", str(folder), str(folder.parent / "theirs.yaml"), "--to", "opencv"]) == 0


def inconsistent(folder: Path) -> None:
    """A capture is not listed, and what a killed program left lies about."""
    path = folder / "project.json"
    document = json.loads(path.read_text())
    path.write_text(json.dumps({**document, "captures": document["captures"][:-1]}))
    (folder / "results" / ".lock").write_text("{}")


BENCH = f"virtual:quick?shot={CAPTURE}"
SEEN = ["testfield-01", "testfield-02"]
ON_BENCH = ["--projector", BENCH, "--camera", BENCH]
MADE = ("capture", "import-frames")  # list a capture: not again once it is there
LISTS = (*MADE, "check")  # change the list of captures

# command, what is changed before, arguments; {beside} is the folder that the project lies in
COMMANDS: dict[str, tuple[Callable[[Path], None], list[str]]] = {
    "simulate": (nothing, ["{beside}/made", "--scenario", "quick"]),
    "capture": (nothing, ["{project}", "new", "--role", "object", *ON_BENCH]),
    "calibrate": (outdated, ["{project}"]),
    "evaluate": (outdated, ["{project}"]),
    "measure": (moved, ["{project}"]),
    "reconstruct": (nothing, ["{project}", CAPTURE, "--out", "{beside}/points.npz"]),
    "batch": (nothing, ["{project}", CAPTURE, "--out", "{beside}/many", "--do", "decode", "--workers", "1"]),
    "export": (nothing, ["{project}", "{beside}/calibration.yaml", "--to", "opencv"]),
    "import": (exported, ["{beside}/theirs.yaml", "{project}", "--from", "opencv"]),
    "merge": (nothing, ["{project}", *SEEN, "--by", "targets", "--out", "{beside}/merged.npz"]),
    "check": (inconsistent, ["{project}", "--repair"]),
    "status": (outdated, ["{project}"]),
    "import-frames": (frames_beside, ["{beside}/frames", "{project}", "new", "--role", "object"]),
    "orient": (nothing, ["{project}", CAPTURE, "--correct"]),
    "sign": (nothing, ["{project}", "--operator", "Ann"]),
    "patterns": (nothing, ["{project}", "--out", "{beside}/images"]),
    "report": (nothing, ["{project}"]),
    "update": (outdated, ["{project}"]),
}
BY_DEFAULT = {
    "kill": ("reconstruct", "import-frames", "sign"),
    "ENOSPC": ("export",),
    "EIO": ("patterns",),
    "SIGTERM": ("merge",),
}
CASES = [(fault, name) for fault, few in BY_DEFAULT.items() for name in (COMMANDS if MANY > 1 else few)]


def arguments(command: str, folder: Path) -> list[str]:
    return [command, *(text.format(beside=folder.parent, project=folder) for text in COMMANDS[command][1])]


Run = Callable[..., dict[str, Any]]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Run a command in a process of its own, disturbed at a call; give how it ended and what it said."""
    told = tmp_path_factory.mktemp("told") / "told.txt"
    with subprocess.Popen(
        [sys.executable, "-m", "tests.core.pipeline.disturbing"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[3],
    ) as server:
        assert server.stdin is not None
        assert server.stdout is not None

        def ask(arguments: list[str], root: Path, number: int = 0, fault: str = "kill") -> dict[str, Any]:
            job = {"arguments": arguments, "root": str(root), "number": number, "fault": fault, "told": str(told)}
            server.stdin.write(json.dumps(job) + "\n")
            server.stdin.flush()
            answer = json.loads(server.stdout.readline())
            return {**answer, "told": told.read_text().strip().splitlines()}

        yield ask
        server.stdin.close()


@pytest.fixture(scope="module")
def ready(whole_original: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a project that has all results but the report; never change it."""
    beside = tmp_path_factory.mktemp("ready")
    shutil.rmtree(copied(whole_original, beside / "quick") / "results" / "report")
    return beside


def documents(folder: Path) -> dict[str, str]:
    """What people gave: everything but results and memory."""
    files = [p for p in folder.rglob("*") if p.is_file() and "results" not in p.parts and not p.name.startswith(".")]
    return {str(p.relative_to(folder)): hash_file(p) for p in files}


def outcome(folder: Path, command: str) -> object:
    """What a command leaves behind, dates and numbers of runs apart."""
    if command == "reconstruct":
        return np.load(folder.parent / "points.npz")["xyz"].tobytes()
    if command == "merge":
        return np.load(folder.parent / "merged.npz")["xyz"].tobytes()
    if command == "check":
        return json.loads((folder / "project.json").read_text())
    if command == "export":
        return (folder.parent / "calibration.yaml").read_bytes()
    if command == "capture":  # frames are numbered as they were taken
        return [f["pattern"] for f in json.loads((folder / "captures/new/capture.json").read_text())["frames"]]
    if command == "import-frames":  # capture.json says when and from where
        return {name for name in documents(folder) if "captures/new" in name}
    if command == "simulate":
        return documents(folder.parent / "made")
    if command == "batch":
        return {name for name in documents(folder.parent / "many") if "log" not in name}
    if command == "patterns":
        return [p.read_bytes() for p in sorted((folder.parent / "images").glob("*.png"))]
    return [json.loads(p.read_text()) for p in [folder / "results" / "evaluation.json"]]


def moments(command: str, fault: str, calls: int) -> list[int]:
    """Numbers of calls, other ones each day."""
    chosen = np.random.default_rng(zlib.crc32(f"{command} {fault} {date.today()}".encode()))
    return sorted({int(n) for n in 1 + chosen.permutation(calls)[:MANY]})


@pytest.mark.parametrize(("fault", "command"), CASES)
def test_a_disturbed_command_loses_nothing_and_its_repeat_succeeds(
    fault: str, command: str, ready: Path, run: Run, tmp_path: Path
) -> None:
    calls, expected = FEWEST, None
    if MANY > 1:
        whole = copied(ready, tmp_path / "whole") / "quick"
        COMMANDS[command][0](whole)
        answer = run(arguments(command, whole), whole.parent)
        assert answer["code"] == 0
        calls, expected = answer["calls"], outcome(whole, command)
    for number in moments(command, fault, calls):
        folder = copied(ready, tmp_path / f"at-{number}") / "quick"
        COMMANDS[command][0](folder)
        given = documents(folder)
        answer = run(arguments(command, folder), folder.parent, number, fault)
        where = f"{fault} at call {number} of {calls}: {answer}"
        if fault == "kill":
            assert answer["code"] == -9, where
        else:  # what only remembers hashes or lists what was written may fail without a word: losing it costs time
            assert answer["code"] in ((0, 143) if fault == "SIGTERM" else (0, 1, 2)), where
            assert answer["code"] == 0 or answer["told"][-1].startswith("stripe-core: "), where
            assert not list(folder.parent.rglob("*.part")), where
        kept = documents(folder)
        if command in LISTS:  # the list of captures is its work
            given.pop("project.json")
        assert given.items() <= kept.items(), where
        assert main(["status", str(folder)]) == 0, where
        # a recording that was broken off is told, and goes on when the command is repeated
        assert main(["check", str(folder), "--repair"]) == 0 or command == "capture", where
        # a capture that is whole and has been listed by now is not made once more
        listed = json.loads((folder / "project.json").read_text())["captures"]
        if not (command in MADE and "captures/new" in listed):
            assert run(arguments(command, folder), folder.parent)["code"] == 0, where
        assert expected is None or outcome(folder, command) == expected, where
        assert main(["check", str(folder)]) == 0, where
        assert not list(folder.rglob("*.part")), where
        shutil.rmtree(folder.parent)
