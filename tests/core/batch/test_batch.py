"""Many captures on copies of a process, in one alone, or on the worker of a scheduler that several tests share."""

from __future__ import annotations

import builtins
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from core.atomic import part_prefix
from core.batch import Outcome, run_batch
from core.cli import main
from core.errors import Cancelled, InputError
from core.pipeline import decode_capture, evaluate_project, reconstruct_capture
from core.progress import Progress
from core.project import read_image, read_project, write_image
from core.project.made import FILE as MADE
from tests.copies import own


def summary(out: Path) -> dict[str, dict[str, Any]]:
    return {row["capture"]: row for row in json.loads((out / "summary.json").read_text())["captures"]}


CERTIFICATE = str(Path(__file__).with_name("tls.pem"))
TLS = {
    "DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION": "true",
    "DASK_DISTRIBUTED__COMM__TLS__CA_FILE": CERTIFICATE,
    **{f"DASK_DISTRIBUTED__COMM__TLS__{role}__CERT": CERTIFICATE for role in ("SCHEDULER", "WORKER", "CLIENT")},
}


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A Dask scheduler with one worker, each a process of its own, as on a cluster; all speak TLS."""
    from dask import config

    place = tmp_path_factory.mktemp("scheduler")
    address_file, there = place / "scheduler.json", {**os.environ, **TLS, "DASK_TEMPORARY_DIRECTORY": str(place)}
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler"]
    worker = [sys.executable, "-m", "distributed.cli.dask_worker"]
    address = ["--scheduler-file", str(address_file)]
    started = [
        subprocess.Popen(
            [*dask, "--protocol", "tls", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", *address], env=there
        ),
        subprocess.Popen([*worker, "--nthreads", "2", "--no-nanny", "--no-dashboard", *address], env=there),
    ]
    try:
        until = time.monotonic() + 60
        while not address_file.exists() and time.monotonic() < until:
            time.sleep(0.1)
        with config.set(config.collect_env(TLS)):
            yield json.loads(address_file.read_text())["address"]
    finally:
        for process in reversed(started):
            process.terminate()
            process.wait(30)


COPIES = """
import sys
from pathlib import Path
from core.atomic import part_prefix
from core.batch import Outcome, run_batch
from core.parallel import limit_threads
from core.project import read_project

limit_threads(2)  # on copies of this process; that of the tests has threads, and is never copied
run_batch(read_project(Path(sys.argv[1])), Path(sys.argv[2]), steps=["decode", "reconstruct", "evaluate"])
"""


def test_copies_give_what_the_single_commands_give(calibrated: Path, tmp_path: Path) -> None:
    out, project = tmp_path / "out", read_project(calibrated)
    subprocess.run([sys.executable, "-c", COPIES, calibrated, out], check=True)
    names = [folder.name for folder in project.captures]
    rows = summary(out)
    assert [(name, row["state"]) for name, row in rows.items()] == [(name, "done") for name in names]
    phase = decode_capture(project.captures[0])
    with np.load(out / names[0] / "phase.npz") as stored:
        np.testing.assert_array_equal(stored["u"], phase.u)
        np.testing.assert_array_equal(stored["sigma_v"], phase.sigma_v)
    with np.load(out / names[-1] / "points.npz") as stored:
        np.testing.assert_array_equal(stored["xyz"], reconstruct_capture(project, names[-1])[1].xyz_mm)
    for plane in evaluate_project(project):
        (row,) = (r for r in rows[plane.capture]["evaluate"] if r["method"] == plane.method)
        assert row["n"] == plane.n
        assert row["rms_mm"] == pytest.approx(plane.rms_mm)
        assert row["verdict"]["state"] == plane.verdict.state
    assert not list(out.rglob("*.part"))


def test_one_process_tells_how_far_it_is(quick: Path, tmp_path: Path) -> None:
    project, seen = read_project(quick), list[float]()
    names = [folder.name for folder in project.captures[:2]]
    heard = Progress(lambda fraction, text: seen.append(fraction))
    report = run_batch(project, tmp_path / "out", names, steps=["decode"], workers=1, progress=heard)
    assert [(o.capture, o.state) for o in report.outcomes] == [(name, "done") for name in names]
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def test_a_second_run_does_only_what_changed(scheduler: str, quick: Path, tmp_path: Path) -> None:
    out, project = tmp_path / "out", read_project(quick)
    names = [folder.name for folder in project.captures[:3]]
    run_batch(project, out, names[:2], steps=["decode"], scheduler=scheduler)
    before = {name: (out / name / "phase.npz").stat().st_mtime_ns for name in names[:2]}
    frame = next(iter(project.captures[1].glob("*.png")))
    image = read_image(frame).copy()
    image[0, 0] ^= 1
    write_image(frame, image)
    os.utime(own(next(iter(project.captures[0].glob("*.png")))))  # a time alone changes nothing
    report = run_batch(project, out, names, steps=["decode"], scheduler=scheduler)
    assert [o.state for o in report.outcomes] == ["left", "done", "done"]
    assert (out / names[0] / "phase.npz").stat().st_mtime_ns == before[names[0]]
    assert (out / names[1] / "phase.npz").stat().st_mtime_ns > before[names[1]]
    rows = summary(out)
    assert set(rows) == set(names)
    assert rows[names[0]]["decode"]["u"]["valid_pixels"] > 0  # figures of captures that were left are told too
    foreign = out / project.captures[3].name / "points.npz"
    foreign.parent.mkdir()
    foreign.write_text("mine")
    with pytest.raises(InputError, match=r"points\.npz: is there already"):
        run_batch(project, out, steps=["decode"], scheduler=scheduler)
    assert foreign.read_text() == "mine"


def test_a_damaged_capture_stops_no_other_and_is_told(
    scheduler: str, quick: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, captures = tmp_path / "out", read_project(quick).captures[:3]
    frame = own(captures[1] / "000.png")
    whole = frame.read_bytes()
    frame.write_bytes(whole[: len(whole) // 2])
    names = [folder.name for folder in captures]
    command = ["batch", str(quick), *names, "--do", "decode", "--out", str(out), "--scheduler", scheduler]
    assert main(command) == 1
    told = capsys.readouterr().err.strip().splitlines()[-1]
    assert names[1] in told
    assert "truncated" in told
    assert {row["state"] for row in summary(out).values()} == {"done", "failed"}
    assert not (out / names[1] / "phase.npz").exists()
    frame.write_bytes(whole)
    assert main(command) == 0
    assert {name: row["state"] for name, row in summary(out).items()} == {
        names[0]: "left",
        names[1]: "done",
        names[2]: "left",
    }


def test_captures_that_cannot_be_read_stop_no_other_though_they_are_named(
    quick: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, captures = tmp_path / "out", read_project(quick).captures[:3]
    own(captures[0] / "capture.json").write_text("{")
    own(captures[1] / "capture.json").write_text('{"format": "stripe-capture", "version": 1, "role": "plan"}')
    names = [folder.name for folder in captures]
    assert main(["batch", str(quick), *names, "--do", "decode", "--out", str(out), "--workers", "1"]) == 1
    assert names[0] in capsys.readouterr().err.strip().splitlines()[-1]
    assert [row["state"] for row in summary(out).values()] == ["failed", "failed", "done"]
    assert "role" in summary(out)[names[1]]["error"]


def test_cancelling_keeps_what_is_complete(scheduler: str, quick: Path, tmp_path: Path) -> None:
    out, project = tmp_path / "out", read_project(quick)
    last = [0.0]
    progress = Progress(lambda fraction, text: last.__setitem__(0, fraction), lambda: last[0] > 0.05)
    with pytest.raises(Cancelled):
        run_batch(project, out, steps=["decode"], scheduler=scheduler, progress=progress)
    states = [row["state"] for row in summary(out).values()]
    assert "done" in states
    assert "waiting" in states
    assert set(states) == {"done", "waiting"}
    report = run_batch(project, out, steps=["decode"], scheduler=scheduler)
    assert report.count("left") >= states.count("done")
    assert report.count("left") + report.count("done") == len(project.captures)


def test_cancelling_leaves_nothing_of_what_copies_were_writing(
    quick: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone, out = str(2**22 + 1), tmp_path / "out"  # no process has this number

    def ended(*_: object) -> Iterator[Outcome]:
        there = out / "testfield-01"
        there.mkdir(parents=True)
        (there / (part_prefix("phase.npz").replace(str(os.getpid()), gone) + "1.part")).write_bytes(b"half")
        (there / f"{MADE}.lock").write_text(f'{{"pid": {gone}}}')
        yield Outcome("testfield-01")
        raise Cancelled("the command")

    monkeypatch.setattr("core.batch.on_processes", ended)
    with pytest.raises(Cancelled):
        run_batch(read_project(quick), out, steps=["decode"], workers=2)
    assert [path.name for path in out.rglob("*") if path.is_file()] == ["summary.json"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--do", "decode,polish"], "polish"),
        (["--do", ""], "--do"),
        (["--workers", "0"], "--workers"),
        (["plane+00", "plane+00", "--do", "decode"], "plane+00"),
        (["nowhere"], "nowhere"),
        (["--do", "reconstruct"], "no calibration"),
        (["--do", "decode", "--scheduler", "tcp://127.0.0.1:1"], "tcp://127.0.0.1:1"),
        (["--do", "decode", "--scheduler", "nonsense://x"], "nonsense"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(
    arguments: list[str],
    told: str,
    quick: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("core.batch._ANSWER_S", 0.5)
    assert main(["batch", str(quick), *arguments, "--out", str(tmp_path / "out")]) == 2
    message = capsys.readouterr().err.strip()
    assert told in message
    assert len(message.splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_without_dask_the_extra_is_named(quick: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real: Callable[..., Any] = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name == "distributed":
            raise ImportError(name)
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputError, match=r"stripe-workbench\[batch\]"):
        run_batch(read_project(quick), tmp_path / "out", steps=["decode"], scheduler="tcp://127.0.0.1:1")
