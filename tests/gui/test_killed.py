"""The window killed or ended in the middle of a calibration: the project opens as it was."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from core.pipeline import project_states
from core.pipeline.runs import current_runs
from core.project import read_project
from core.project.lock import writing_results
from stripe_gui.presenters.stages import State
from stripe_gui.session import Session
from stripe_gui.settings import Settings

KILLED = """
import os, signal, sys
from pathlib import Path
from PySide6.QtCore import QTimer
from stripe_gui.app import Program, make_application
from stripe_gui.settings import Settings
from stripe_gui.workbench import Workbench

app, bench = make_application(), Workbench(Settings(Path(sys.argv[2])))
program = Program(app, bench)
program.heed_signals()

def look():
    job, page = bench.jobs.running, program.window.page
    if job is None and page.can_run():
        page.run()
    elif job is not None and job.fraction > 0.3:
        timer.stop()
        print("killed at", job.fraction, job.message, flush=True)
        os.kill(os.getpid(), int(sys.argv[3]))

timer = QTimer(interval=5)
timer.timeout.connect(look)
assert bench.open_project(Path(sys.argv[1]), "calibrate")
timer.start()
sys.exit(app.exec())
"""


def contents(folder: Path) -> dict[str, str]:
    """Hash every file but locks, and what only saves time."""
    files = (p for p in sorted(folder.rglob("*")) if p.is_file())
    found = {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}
    return {name: value for name, value in found.items() if "lock" not in name and not Path(name).name.startswith(".")}


@pytest.mark.parametrize(("number", "code"), [(signal.SIGKILL, -9), (signal.SIGTERM, 143)])
def test_a_window_killed_while_calibrating_leaves_the_project_as_it_was(
    finished_project: Path, tmp_path: Path, number: int, code: int
) -> None:
    (finished_project / "results" / "targets.npz").unlink()  # so that there is something to do
    before, states = contents(finished_project), project_states(read_project(finished_project))
    runs = current_runs(read_project(finished_project))
    ended = subprocess.run(
        [sys.executable, "-c", KILLED, str(finished_project), str(tmp_path / "own.ini"), str(int(number))],
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == code, ended.stderr
    assert "Traceback" not in ended.stderr
    if number == signal.SIGTERM:  # who is asked to end leaves nothing behind
        assert not [path for path in finished_project.rglob("*") if path.name.endswith((".part", ".lock"))]
    assert "killed at" in ended.stdout
    after = contents(finished_project)
    assert {name: after.get(name) for name in before} == before  # nothing is lost or changed
    project = read_project(finished_project)
    assert current_runs(project) == runs
    now = project_states(project).stages
    assert now["calibrate"] == states.stages["calibrate"]
    with writing_results(project.path, "a test"):  # the dead process is no obstacle
        pass
    session = Session(Settings(tmp_path / "settings.ini"))
    session.open(finished_project)
    stages = ("capture", "decode", "evaluate")
    assert {session.statuses[stage].state for stage in stages} == {State.DONE}


EARLY = """
import os, signal, sys
from pathlib import Path
from stripe_gui import __main__ as start
from stripe_gui.main_window import MainWindow

opened = MainWindow.open_path

def ended_meanwhile(window, path):
    os.kill(os.getpid(), signal.SIGTERM)
    window.repaint()
    return opened(window, path)

MainWindow.open_path = ended_meanwhile
sys.exit(start.main([sys.argv[1]]))
"""


def test_a_window_ended_while_it_opens_a_project_does_not_stay(finished_project: Path, tmp_path: Path) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", EARLY, str(finished_project)],
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen", "XDG_CONFIG_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (ended.returncode, ended.stderr) == (143, "")
