"""A command that is told to end does so as by Ctrl-C: in one line, with nothing half written."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from core import cli
from core.progress import Progress


@pytest.mark.skipif(os.name == "nt", reason="has no such signals")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_command_ends_in_one_line_and_leaves_nothing(number: int, tmp_path: Path) -> None:
    out = tmp_path / "bench"
    command = [sys.executable, "-m", "core", "simulate", str(out), "--scenario", "quick"]
    before = signal.signal(number, lambda *_: None)  # what is caught here is not ignored there, as nohup would have it
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as program:
        signal.signal(number, before)
        while not out.exists() and program.poll() is None:
            time.sleep(0.01)
        program.send_signal(number)
        time.sleep(0.01)
        program.send_signal(number)  # impatience does not disturb the tidying up
        _, told = program.communicate(timeout=60)
    assert program.returncode == 128 + number
    assert told == "stripe-core: the command: cancelled; start it again when you want the result\n"
    assert not [path for path in tmp_path.rglob("*") if path.name.endswith((".part", ".lock"))]


@pytest.mark.skipif(os.name == "nt", reason="has no such signals")
def test_a_command_ends_in_one_line_while_its_first_parts_are_loaded(tmp_path: Path) -> None:
    """The signal comes when the package asks for the first module that it shares with all others."""
    (tmp_path / "sitecustomize.py").write_text(
        "import os, signal, sys\n"
        "class Ending:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name == 'core.lazy':\n"
        "            os.kill(os.getpid(), signal.SIGTERM)\n"
        "sys.meta_path.insert(0, Ending())\n"
    )
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "core", "status", str(tmp_path)]
    ended = subprocess.run(command, env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False)
    assert ended.returncode == 143  # SIGINT is not heard by what a shell runs in the background
    assert ended.stderr == "stripe-core: the command: cancelled; start it again when you want the result\n"


def test_an_end_that_a_callback_swallowed_comes_at_the_next_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signal, "signal", lambda number, handler: None)
    monkeypatch.setattr(cli, "_ended", 0)
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    assert Progress(cancelled=cli._not_ended)(0.1) is None
    with suppress(KeyboardInterrupt):  # as what is called from C, or a finalizer, does
        cli._end(15, None)
    with pytest.raises(KeyboardInterrupt, match="15"):
        Progress(cancelled=cli._not_ended)(0.2)


def test_an_end_that_a_finalizer_swallows_is_told_once() -> None:
    """Python tells of what nothing can raise; logging's hook of fork() was seen to swallow the end so."""
    work = (
        "import os, signal, sys\n"
        "from core import cli\n"
        "class Going:\n"
        "    def __del__(self):\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\n"
        "        list(map(str, range(9)))\n"
        "def work(options, progress):\n"
        "    going = Going()\n"
        "    del going\n"
        "    progress(0.5)\n"
        "cli._worked = work\n"
        "sys.argv = ['stripe-core', 'status', '.']\n"
        "cli.run()\n"
    )
    ended = subprocess.run([sys.executable, "-c", work], capture_output=True, text=True, check=False)
    assert ended.stderr == "stripe-core: the command: cancelled; start it again when you want the result\n"
    assert ended.returncode == 143


def test_an_end_that_an_import_makes_its_own_error_of_is_told_as_an_end(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def work(*_: object) -> None:
        with suppress(KeyboardInterrupt):
            cli._end(signal.SIGINT, None)
        raise ImportError("Error importing numpy: check your installation")

    monkeypatch.setattr(signal, "signal", lambda number, handler: None)
    monkeypatch.setattr(cli, "_ended", 0)
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    monkeypatch.setattr(cli, "_worked", work)
    assert cli.main(["status", "."]) == 130
    assert capsys.readouterr().err == "stripe-core: the command: cancelled; start it again when you want the result\n"


@pytest.mark.skipif(os.name == "nt", reason="no such shell")
@pytest.mark.parametrize("closed", [">&-", ">&- 2>&-"])
def test_who_closes_the_output_before_gets_the_work_done(closed: str, quick: Path) -> None:
    command = f"{sys.executable} -m core status {quick} {closed}"
    done = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_who_reads_in_another_code_gets_every_word(tmp_path: Path) -> None:
    board, sheet = tmp_path / "board.csv", tmp_path / "σ.svg"
    board.write_text("row,col,x_mm,y_mm,z_mm,diameter_mm\n0,0,0,0,0,5\n0,1,20,0,0,5\n1,0,0,20,0,5\n")
    command = [sys.executable, "-m", "core", "testfield", str(board), "--out", str(sheet)]
    done = subprocess.run(command, capture_output=True, env={**os.environ, "PYTHONIOENCODING": "cp1252"}, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"\\u03c3.svg: page of " in done.stdout
