"""Pieces of work on copies of a process: all in order, errors told; what a killed copy leaves is done all the same."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

from core.errors import BusyError, InputError
from core.pipeline.update import decode_project
from core.project import read_project
from core.project.lock import writing_results
from tests.copies import copied, own

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are copied on Linux alone")

SCRIPT = """
import os, resource, signal, sys, time
import cv2
import numpy as np
from core.errors import InputError
from core.parallel import can_fork, limit_threads, on_processes, run_in_bands
from core.progress import Progress, announce

limit_threads(3)
cv2.setNumThreads(3)
image = np.zeros((2000, 2000), np.float32)
run_in_bands(lambda start, stop: time.sleep(0.01), 100)
cv2.GaussianBlur(image, (0, 0), 2.0)
assert len(os.listdir("/proc/self/task")) > 3, "OpenCV has no threads of its own: nothing to be tried"
assert can_fork(9) and not can_fork(2)
assert cv2.getNumThreads() == 3
cv2.GaussianBlur(image, (0, 0), 2.0)  # starts them again: no copy may wait for them
me, heard = os.getpid(), []
said = Progress(lambda fraction, message: heard.append(message))

def work(k, progress):
    progress(0.0, f"piece {k}")
    time.sleep(0.02 * (k == 0))
    announce("patience")
    if k == 5 and os.getpid() != me:
        os.kill(os.getpid(), signal.SIGKILL)
    return k, os.getpid() == me

beside = []
found = list(on_processes(work, 9, said, meanwhile=lambda: beside.append(os.getpid())))
assert [k for k, _ in found] == list(range(9)) and beside == [me], found
assert [k for k, here in found if here] == [5], found
assert "patience" in heard and {f"piece {k}" for k in range(9)} <= {*heard}, heard

def arrays(k, progress):
    return [np.full(shape, k, kind) for shape, kind in (((0,), "f8"), ((7, 3), "u1"), ((600, 500), "f4"))]

for k, made in enumerate(on_processes(arrays, 4, said)):
    for one, same in zip(made, arrays(k, said), strict=True):
        assert one.dtype == same.dtype and np.array_equal(one, same), (k, one)
        assert one.flags.aligned and one.flags.writeable

before = resource.getrlimit(resource.RLIMIT_FSIZE)
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, before[1]))  # no room for what copies hand over
assert [made[2][0, 0] for made in on_processes(arrays, 4, said)] == [0, 1, 2, 3]
resource.setrlimit(resource.RLIMIT_FSIZE, before)

def wrong(k, progress):
    if k == 1:
        raise InputError("piece 1", "nothing", "look again")
    return k

try:
    list(on_processes(wrong, 4, said))
except InputError as error:
    assert (error.where, error.seen, error.remedy) == ("piece 1", "nothing", "look again")
else:
    raise AssertionError("no error")
slow = on_processes(lambda k, progress: time.sleep(60 * (k > 0)), 3, said)
next(slow)
slow.close()
try:
    os.waitpid(-1, os.WNOHANG)
except ChildProcessError:
    print("nobody left")
"""


def test_all_is_done_once_in_order_and_nobody_stays() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "nobody left\n", "")


def test_targets_are_the_same_by_processes_and_by_threads(
    quick_original: Path, calibrated_original: Path, tmp_path: Path
) -> None:
    project = copied(quick_original, tmp_path / "quick")
    command = "from core.parallel import limit_threads; limit_threads(2); from core.cli import run; run()"
    subprocess.run([sys.executable, "-c", command, "measure", str(project)], capture_output=True, check=True)
    by_processes, by_threads = (
        {t["capture"]: t for t in json.loads((folder / "results" / "targets.json").read_text())["captures"]}
        for folder in (project, calibrated_original)
    )
    assert by_processes == by_threads


BESIDE = """
import os, signal, time
import numpy as np
from core.errors import InputError
from core.parallel import beside, limit_threads, run_in_bands

limit_threads(2)
me = os.getpid()

def killed():
    if os.getpid() != me:
        os.kill(os.getpid(), signal.SIGKILL)
    return "done here"

def cut():
    if os.getpid() != me:
        signal.setitimer(signal.ITIMER_REAL, 0.2)  # while it waits for who reads
    return b"." * 10**6  # whatever it ends with

def wrong():
    raise InputError("beside", "nothing", "look again")

large = beside(lambda: (os.getpid() != me, np.arange(1e6)))
ends, fails, unread = beside(killed), beside(wrong), [beside(lambda: bytes(10**6)), beside(lambda: time.sleep(60))]
stops = beside(cut)
time.sleep(0.5)
run_in_bands(lambda start, stop: None, 100)
elsewhere, numbers = large()
assert elsewhere and np.array_equal(numbers, np.arange(1e6))
assert ends() == "done here" and stops() == b"." * 10**6
try:
    fails()
except InputError as error:
    assert error.where == "beside"
else:
    raise AssertionError("no error")
del unread  # which ends those that nobody asks
try:
    raise AssertionError(f"left behind: {os.waitpid(-1, os.WNOHANG)}")
except ChildProcessError:
    pass
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
assert beside(os.getpid)() != me
limit_threads(1)
assert beside(os.getpid)() == me
"""


def test_work_beside_is_done_elsewhere_or_else_here() -> None:
    done = subprocess.run([sys.executable, "-c", BESIDE], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


DECODED = """
import os, sys
from pathlib import Path
from core.parallel import limit_threads
from core.pipeline.decode import MANY, from_phase_maps
from core.pipeline.update import decode_project
from core.project import read_capture, read_project

limit_threads(2)
project = read_project(Path(sys.argv[1]))
capture, me = read_capture(project.captures[0], project), os.getpid()

def seen(capture, phase):
    return os.getpid() == me, phase.u.tobytes()

many, few = ([made for _, made in from_phase_maps(project, [capture] * n, seen)] for n in (MANY, MANY - 1))
assert all(here for here, _ in few) and not any(here for here, _ in many)
assert len({u for _, u in few + many}) == 1
print(decode_project(project))
"""


def test_many_captures_are_decoded_by_processes_and_alike(quick: Path, tmp_path: Path) -> None:
    other = copied(quick, tmp_path / "other")
    frame = own(read_project(quick).captures[1] / "000.png")
    frame.write_bytes(b"")  # the others are decoded all the same
    shutil.copy(frame, own(read_project(other).captures[1] / "000.png"))
    with pytest.raises(InputError, match="empty") as told:
        decode_project(read_project(quick))
    done = subprocess.run(
        [sys.executable, "-c", DECODED, str(other)], capture_output=True, text=True, timeout=60, check=False
    )
    assert told.value.seen in done.stderr, done.stderr
    by_threads, by_processes = ((folder / "results/decode.json").read_text() for folder in (quick, other))
    assert json.loads(by_processes.replace(str(other), str(quick))) == json.loads(by_threads)
    assert len(json.loads(by_threads)["captures"]) == len(read_project(quick).captures)


HOLDER = """
import os, sys, time
from pathlib import Path
from core.parallel import limit_threads, on_processes
from core.progress import Progress
from core.project.lock import writing_results

limit_threads(2)
said = Progress(lambda fraction, message: print(message, flush=True))

def work(k, progress):
    with writing_results(Path(sys.argv[1]), "measure"):  # under the lock of the process it is a copy of
        progress(0.0, "at work")
    time.sleep(2)

with writing_results(Path(sys.argv[1]), "measure"):
    list(on_processes(work, 3, said))
"""


def test_who_is_killed_leaves_no_lock_to_its_copies(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(tmp_path)], stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == "at work\n"
        with pytest.raises(BusyError, match=str(holder.pid)), writing_results(tmp_path, "test"):
            pass
        holder.kill()
        holder.wait()
        until = time.monotonic() + 1.0  # its copies sleep for longer; who is just being copied lets go in a moment
        while True:
            try:
                with writing_results(tmp_path, "test"):
                    break
            except BusyError:
                assert time.monotonic() < until
